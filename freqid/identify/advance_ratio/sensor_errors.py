"""What constant errors of airspeed and flow angles do to all laws together: no repetition averages them out.

An airspeed that reads ``V (1 + e)`` makes dynamic pressure too large, every coefficient too small by
``(1 + e)^2`` and the advance ratio too large by ``1 + e``; reduced rates are too small, so their derivatives
are off by ``1 + e`` alone. A flow angle that reads too much by d moves constant terms by the derivative
times d. Both change a law into another of the same kind, so they enter its draws exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.results.advance_ratio import AdvanceRatioLaw, AdvanceRatioModel, TrimCluster

KNOWN = {"V": "m/s", "alpha": "rad", "beta": "rad"}
"""Sensors whose constant errors are allowed for, with their units."""
_REDUCED_RATES = ("phat", "qhat", "rhat")


def with_sensor_errors(model: AdvanceRatioModel, std_error: Mapping[str, float]) -> AdvanceRatioModel:
    """Widen a model's intervals by constant sensor errors, common to all its manoeuvres.

    Parameters
    ----------
    model : AdvanceRatioModel
    std_error : mapping of str to float
        One sigma by sensor: ``V`` m/s, ``alpha`` and ``beta`` rad.

    Returns
    -------
    AdvanceRatioModel
        With the same laws, whose draws differ by the errors.

    Raises
    ------
    UsageError
        For another sensor, a negative sigma, or where the manoeuvres' airspeed is not known.
    """
    for name, sigma in std_error.items():
        if name not in KNOWN:
            raise UsageError(
                f"a sensor error of '{name}' is stated, which laws cannot allow for",
                remedy=nearest(name, KNOWN),
            )
        if not 0 <= sigma < np.inf:
            raise UsageError(
                f"the sensor error of '{name}' is {sigma:g} {KNOWN[name]}, expected zero or more"
            )
    if not any(std_error.values()):
        return model
    count = max(len(law.draws) for c in model.clusters for law in c.laws.values())
    rng = np.random.default_rng(1)
    normal = {name: sigma * rng.standard_normal(count) for name, sigma in std_error.items()}
    return replace(model, clusters=tuple(_widened(c, normal) for c in model.clusters))


def _widened(cluster: TrimCluster, errors: Mapping[str, Array]) -> TrimCluster:
    speed = float(np.mean(cluster.local.airspeed))
    if "V" in errors and not speed > 0:
        raise UsageError(
            "an airspeed error is stated, but the manoeuvres do not state their airspeed",
            remedy="leave it out, or log V or u v w",
        )
    draws = {name: law.draws.copy() for name, law in cluster.laws.items()}
    for angle in ("alpha", "beta"):
        for name in draws:
            response, _, regressor = name.partition(".")
            slope = cluster.laws.get(f"{response}.{angle}")
            if regressor == "0" and slope is not None and angle in errors:
                draws[name] = _shifted(draws[name], slope, errors[angle])
    if "V" in errors:
        for name, drawn in draws.items():
            one = 1 + errors["V"][: len(drawn), None] / speed
            power = 1 if name.partition(".")[2] in _REDUCED_RATES else 2
            drawn[:, :1] *= one**power
            drawn[:, 1::2] *= one**power
            drawn[:, 2::2] *= one
    laws = {name: replace(law, draws=draws[name]) for name, law in cluster.laws.items()}
    return replace(cluster, laws=laws)


def _shifted(draws: Array, slope: AdvanceRatioLaw, error: Array) -> Array:
    """Return draws of a constant term with the derivative's law times an error of the angle added."""
    off = error[: len(draws), None]
    own = slope.draws[: len(draws)].copy()
    own[:, 0] *= off[:, 0]
    own[:, 1::2] *= off
    out = np.concatenate([draws, own[:, 1:]], axis=1)
    out[:, 0] += own[:, 0]
    return out

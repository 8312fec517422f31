"""What a study of a campaign over advance ratios found, and the histories that show it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.blend.semi_local.held_out import HeldOutScores
from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT
from freqid.core.record import Maneuver
from freqid.core.results.advance_ratio import AdvanceRatioModel, LocalDerivatives
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel
from freqid.core.sections.identification import Identification
from freqid.core.viewable import Viewable
from freqid.identify.loads.explanatory import history
from freqid.identify.model.problem import measured_responses
from freqid.identify.spectra.trend import up_to


@dataclass(frozen=True, eq=False)
class CampaignStudy(Viewable):
    """Laws over advance ratio from one campaign, and how they were judged.

    Attributes
    ----------
    local : LocalDerivatives
        Of all manoeuvres.
    models : tuple of AdvanceRatioModel
        Global, semi-local and one-shot, from all manoeuvres.
    scores : HeldOutScores
        Of models made without the held-out manoeuvres, on these.
    shown : str
        The held-out manoeuvre whose histories are kept.
    coefficients : mapping of str to mapping of str to Fit
        Its coefficients in time by response, for each kind of model: ``local`` is its own estimate.
    outputs : mapping of str to mapping of str to Fit
        Its motion by output, simulated with parameters of ``equation error`` and of ``output error``; empty
        where no form of dynamic model fits the identification.
    points : mapping of str to PointModel
        Of the manoeuvres by id.
    validation : mapping of str to mapping of str to float
        Theil's coefficient by held-out manoeuvre and response: of the coefficients in time, as laws say that
        were made without it.
    repeated : mapping of str to mapping of str to float
        By two manoeuvres that were flown at one trim, and by response: probability of a larger chi-square
        between their parameters, were the two alike.
    remarks : tuple of str
        What could not be had, one sentence each.
    provenance : dict
        JSON-compatible.
    """

    local: LocalDerivatives
    models: tuple[AdvanceRatioModel, ...]
    scores: HeldOutScores
    shown: str
    coefficients: Mapping[str, Mapping[str, Fit]]
    outputs: Mapping[str, Mapping[str, Fit]]
    points: Mapping[str, PointModel] = field(default_factory=dict)
    validation: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    repeated: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<CampaignStudy: {self.models[0]!r}, {len(self.scores.ids)} held out>"

    def model(self, kind: str) -> AdvanceRatioModel:
        """Return the model of one kind.

        Parameters
        ----------
        kind : {"global", "semi-local", "one-shot"}
        """
        return next(m for m in self.models if m.kind == kind)


def coefficient_histories(
    maneuver: Maneuver,
    settings: Identification,
    derivatives: Mapping[str, float],
    highest_hz: float | None = None,
) -> dict[str, Fit]:
    """Return the coefficients of a manoeuvre in time, as measured and as derivatives give them.

    Parameters
    ----------
    maneuver : Maneuver
    settings : Identification
        In coefficient form.
    derivatives : mapping of str to float
        ``CZ.0``, ``CZ.alpha`` and so on, about zero; products of regressors are of their whole values.
    highest_hz : float, optional
        Both are shown up to here: above it measured accelerations are noise.

    Returns
    -------
    dict of str to Fit
        By response, X to N.
    """
    record = maneuver.record
    measured = measured_responses(maneuver, settings).history(record.dt)
    fits = {}
    for row, (symbol, response) in zip(
        measured, ((s, r) for s, r in COEFFICIENT.items() if r in settings.responses), strict=True
    ):
        modelled = np.full(row.size, derivatives[f"{symbol}.0"])
        for name in settings.regressors_of(response):
            modelled = modelled + derivatives[f"{symbol}.{name}"] * _value(maneuver, name)
        both = np.array([row, modelled])
        if highest_hz is not None:
            both = up_to(both, record.dt, highest_hz)
        fits[response] = Fit(record.time - record.time[0], both[0], both[1])
    return fits


def _value(maneuver: Maneuver, name: str) -> Array:
    return np.prod([history(maneuver, factor) for factor in name.split("*")], axis=0)


def inner_trims(local: LocalDerivatives, labels: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which manoeuvres are held out where none are named: every second inside each cluster's range.

    Parameters
    ----------
    local : LocalDerivatives
    labels : ndarray of int, shape (n,)
        Cluster of each manoeuvre.

    Returns
    -------
    ndarray of bool, shape (n,)
        Never the lowest advance ratio, the highest finite one or stopped propellers: laws are judged
        between trims, not beyond them.
    """
    out = np.zeros(len(local.ids), dtype=bool)
    for cluster in np.unique(labels):
        members = np.flatnonzero((labels == cluster) & np.isfinite(local.advance_ratio))
        order = members[np.argsort(local.advance_ratio[members])]
        out[order[2:-1:2]] = True
    return out

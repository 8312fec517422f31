"""Sensors brought into line before modelling: delays by group, biases of attitude, a steady wind.

Velocity and attitude are brought to the clock of the inertial sensors by kinematics (`delays_motion`),
effectors to that of the responses, together with the wind where velocity is known over the ground only
(`delays_loads`; docs/theory/kinematics.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.identification import Identification, factors_of
from freqid.core.record import Maneuver
from freqid.core.viewable import Viewable
from freqid.identify.delays_loads import Changes, fit_loads, loads_unknowns
from freqid.identify.delays_motion import fit_motion, motion_unknowns
from freqid.identify.delays_record import Misaligned, kind_of

Array = NDArray[np.float64]

# One sigma of each kind of unknown before anything was measured, SI units.
PLAUSIBLE = {"delay": 0.1, "bias": 0.03, "scale": 0.01, "wind": 5.0}
UNITS = {"delay": "s", "bias": "rad", "scale": "1", "wind": "m/s"}
# Beyond this share of what was known beforehand an unknown is not told by the data.
LARGEST_SHARE = 0.5
_ORDER = 1.96  # normal, 95 %


@dataclass(frozen=True, eq=False)
class Alignment(Viewable):
    """What stands between a record's clocks, its attitude and its velocity, with its uncertainty.

    Attributes
    ----------
    names : tuple of str, length k
        ``"velocity delay"``, ``"surface delay"``, ``"theta bias"``, ``"wind north"`` ... A positive delay is
        a channel later than the inertial sensors.
    units : tuple of str, length k
    estimate : ndarray, shape (k,)
        SI units.
    covariance : ndarray, shape (k, k)
    plausible : ndarray, shape (k,)
        One sigma of each beforehand.
    disagreement : mapping of str to float
        By how much the responses differ about delays of effectors and wind, over what noise explains; the
        standard errors allow for it.
    flown : Misaligned
        The manoeuvre as it was.
    changes : Changes
        Regressors and responses of the aligned manoeuvre, and their derivatives by the unknowns.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    estimate: Array
    covariance: Array
    plausible: Array
    disagreement: Mapping[str, float]
    flown: Misaligned
    changes: Changes

    def __repr__(self) -> str:
        rows = zip(self.names, self.estimate, self.std_error, self.units, strict=True)
        listed = ", ".join(f"{n} {e:.3g} +- {s:.2g}" + (f" {u}" if u != "1" else "") for n, e, s, u in rows)
        return f"<Alignment: {listed}>"

    @property
    def std_error(self) -> Array:
        """Standard errors, shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def lower(self) -> Array:
        """Lower 95 % limits, shape (k,)."""
        return self.estimate - _ORDER * self.std_error

    @property
    def upper(self) -> Array:
        """Upper 95 % limits, shape (k,)."""
        return self.estimate + _ORDER * self.std_error

    @property
    def untold(self) -> tuple[str, ...]:
        """Unknowns that the data hardly tell more about than was known beforehand."""
        share = self.std_error / self.plausible
        return tuple(n for n, s in zip(self.names, share, strict=True) if s > LARGEST_SHARE)

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Return estimate and standard error of one unknown."""
        if name not in self.names:
            raise UsageError(f"the alignment has no '{name}'", remedy=nearest(name, self.names))
        i = self.names.index(name)
        return float(self.estimate[i]), float(self.std_error[i])

    @property
    def errors(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.names, self.estimate.tolist(), strict=True))

    def account(self) -> dict[str, Any]:
        """Return names, estimates and errors, JSON-compatible."""
        rows = zip(self.names, self.estimate, self.std_error, self.units, strict=True)
        return {n: {"estimate": float(e), "std_error": float(s), "units": u} for n, e, s, u in rows}


@dataclass(frozen=True)
class AlignmentSettings:
    """What is known of a record's sensors beforehand.

    Attributes
    ----------
    plausible : mapping of str to float
        One sigma by unknown, SI units; replaces the built-in sizes.
    """

    plausible: Mapping[str, float] = field(default_factory=dict)


def align(
    maneuver: Maneuver,
    settings: Identification,
    lines_hz: Array,
    known: AlignmentSettings = AlignmentSettings(),
) -> tuple[Maneuver, Alignment]:
    """Find delays, biases of attitude and steady wind of a manoeuvre, and take them out.

    Parameters
    ----------
    maneuver : Maneuver
    settings : Identification
        Responses and regressors; effectors among these have their delays found, one for each kind.
    lines_hz : ndarray, shape (M,)
        Hz, those of the regression.
    known : AlignmentSettings

    Returns
    -------
    maneuver : Maneuver
        On the clock of the inertial sensors; with u v w, through the fitted wind, where only velocity over
        the ground was logged.
    alignment : Alignment

    Raises
    ------
    DataError
        Where nothing can be aligned, or as in `identify_point`.
    UsageError
        Where a size is given for none of the unknowns.
    """
    kinds = {e.name: e.kind for e in maneuver.vehicle.effectors}
    named = {f for r in settings.responses for n in settings.regressors_of(r) for f in factors_of(n)}
    groups = {k: tuple(n for n, kind in kinds.items() if kind == k and n in named) for k in kinds.values()}
    flown = Misaligned(maneuver, {k: of for k, of in groups.items() if of})
    by_kinematics, by_loads = motion_unknowns(flown), loads_unknowns(flown)
    names = (*by_kinematics, *by_loads)
    if not names:
        raise DataError(
            "nothing can be aligned: the record has neither effectors among the regressors nor rates, "
            "specific forces and attitude",
            remedy="log them, or leave the alignment out",
        )
    for name in known.plausible:
        if name not in names:
            raise UsageError(f"the alignment has no '{name}'", remedy=nearest(name, names))
    sizes = {n: known.plausible.get(n, PLAUSIBLE[kind_of(n)]) for n in names}
    moved, spread = fit_motion(flown, lines_hz, sizes) if by_kinematics else (np.empty(0), np.empty((0, 0)))
    motion = dict(zip(by_kinematics, moved.tolist(), strict=True))
    loads = fit_loads(flown, motion, settings, lines_hz, sizes)
    passed_on = loads.by_motion @ spread
    alignment = Alignment(
        names=names,
        units=tuple(UNITS[kind_of(n)] for n in names),
        estimate=np.concatenate([moved, loads.estimate]),
        covariance=np.block(
            [[spread, passed_on.T], [passed_on, loads.covariance + passed_on @ loads.by_motion.T]]
        ),
        plausible=np.array(list(sizes.values())),
        disagreement=dict(zip(by_loads, loads.disagreement.tolist(), strict=True)),
        flown=flown,
        changes=loads.changes,
    )
    return flown.at(alignment.errors), alignment

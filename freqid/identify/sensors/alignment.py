"""Sensors brought into line before a point model: delays, biases of attitude, a steady wind; and the model.

Velocity and attitude are brought to the clock of the inertial sensors by kinematics (`alignment_motion`),
effectors to that of the responses, together with the wind where velocity is known over the ground only
(`alignment_loads`; docs/theory/kinematics.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import Maneuver
from freqid.core.results.point import PointModel, ResponseModel, per
from freqid.core.scenario import Reference
from freqid.core.sections.estimators import EstimatorName
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification, factors_of
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.model.widening import with_covariance
from freqid.identify.point import identify_point, lines_of
from freqid.identify.regress.confidence_interval import confidence_interval
from freqid.identify.regress.covariance_corrections import independent_share
from freqid.identify.regress.estimators import find_estimator
from freqid.identify.sensors.alignment_loads import Changes, fit_loads, loads_unknowns
from freqid.identify.sensors.alignment_motion import Misaligned, fit_motion, motion_unknowns
from freqid.identify.sensors.errors import SensorErrors, error_kind

# One sigma of each kind of unknown before anything was measured, SI units.
PLAUSIBLE = {"delay": 0.1, "bias": 0.03, "scale": 0.01, "wind": 5.0}
# Beyond this share of what was known beforehand an unknown is not told by the data.
LARGEST_SHARE = 0.5


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(SensorErrors):
    """What stands between a record's clocks, its attitude and its velocity, with its uncertainty.

    Attributes
    ----------
    names, estimate, covariance
        As in `SensorErrors`: ``"velocity delay"``, ``"surface delay"``, ``"theta bias"``, ``"wind north"``.
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

    plausible: Array
    disagreement: Mapping[str, float]
    flown: Misaligned
    changes: Changes

    @property
    def lower(self) -> Array:
        """Lower 95 % limits, shape (k,)."""
        return confidence_interval(self.estimate, self.std_error)[0]

    @property
    def upper(self) -> Array:
        """Upper 95 % limits, shape (k,)."""
        return confidence_interval(self.estimate, self.std_error)[1]

    @property
    def unobservable(self) -> tuple[str, ...]:
        """Unknowns that the data hardly tell more about than was known beforehand."""
        share = self.std_error / self.plausible
        return tuple(n for n, s in zip(self.names, share, strict=True) if s > LARGEST_SHARE)


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
    sizes = {n: known.plausible.get(n, PLAUSIBLE[error_kind(n)]) for n in names}
    moved, spread = np.empty(0), np.empty((0, 0))
    if by_kinematics:
        # Over the ground gusts do not part velocity from what accelerometers feel.
        gusty = "velocity delay" in by_kinematics and not flown.over_ground
        alone = partial(_driven, settings=settings, lines_hz=lines_hz) if gusty else None
        moved, spread = fit_motion(flown, lines_hz, sizes, alone)
    motion = dict(zip(by_kinematics, moved.tolist(), strict=True))
    loads = fit_loads(flown, motion, settings, lines_hz, sizes)
    passed_on = loads.by_motion @ spread
    alignment = Alignment(
        names=names,
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


def _driven(maneuver: Maneuver, settings: Identification, lines_hz: Array) -> Misaligned | None:
    """Return what the injected signals alone would have made of a manoeuvre, None where unknown."""
    try:
        return Misaligned(driven_maneuvers((maneuver,), lines_hz, settings)[0], {})
    except (UsageError, DataError):  # no injected signals, or channels that a loop needs are missing
        return None


# A parameter is named where an unknown of the alignment adds more than this many of its standard errors.
DOMINANT = 2.0


def identify_aligned(
    maneuvers: Sequence[Maneuver],
    settings: Identification,
    *,
    excitation: Excitation | None = None,
    reference: Reference | None = None,
    estimator: EstimatorName | None = None,
) -> tuple[PointModel, tuple[Alignment, ...]]:
    """Align manoeuvres, each by itself, and identify them as `identify_point` does.

    Parameters
    ----------
    maneuvers, settings, excitation, reference, estimator
        As in `identify_point`.

    Returns
    -------
    model : PointModel
        Its standard errors, covariances and intervals hold the uncertainty of the alignment; its remarks name
        the parameters that this more than doubles.
    alignments : tuple of Alignment
        By manoeuvre.

    Raises
    ------
    UsageError
        In the time domain, where there are no lines to align on.
    """
    if settings.method != "frequency":
        raise UsageError(
            f"alignment works on lines, but the method is '{settings.method}'",
            remedy="use the method 'frequency'",
        )
    lines_hz = lines_of(settings, excitation)
    both = [align(m, settings, lines_hz) for m in maneuvers]
    model = identify_point(
        [m for m, _ in both], settings, excitation=excitation, reference=reference, estimator=estimator
    )
    alignments = tuple(a for _, a in both)
    chosen = {name: model[name].regressors for name in settings.responses}
    final = msgspec.structs.replace(settings, regressors=chosen)
    changes = [_changes(a, final, lines_hz) for a in alignments]
    by_instruments = find_estimator(model.estimator).needs_instruments
    by = {
        name: _sensitivity(changes, model[name], row, by_instruments=by_instruments)
        for row, name in enumerate(settings.responses)
    }
    responses = {
        name: with_covariance(
            model[name],
            model[name].covariance
            + np.sum([j.T @ a.covariance @ j for j, a in zip(by[name], alignments, strict=True)], axis=0),
        )
        for name in settings.responses
    }
    remarks = _remarks(model, by, alignments)
    return replace(model, responses=responses, remarks=(*model.remarks, *remarks)), alignments


def _changes(alignment: Alignment, settings: Identification, lines_hz: Array) -> Changes:
    """Return the changes of those regressors that the model has in the end; products may have been added."""
    known = alignment.changes
    if all(n in known.names for r in settings.responses for n in settings.regressors_of(r)):
        return known
    return Changes.about(alignment.flown, alignment.errors, alignment.names, settings, lines_hz)


def _sensitivity(
    changes: Sequence[Changes], response: ResponseModel, row: int, *, by_instruments: bool
) -> list[Array]:
    """Return the derivatives of a response's parameters by the unknowns of each manoeuvre, shape (k, p).

    ``d theta = - (Z^T X)^-1 Z^T (theta dX - dz)``, nuisance columns taken out of all, manoeuvres weighed as
    in the fit.
    """
    parts = []
    for own in changes:
        part, duration = own.part(response.regressors), own.equations.durations[0]
        nuisance = len(part.x) - len(part.columns)
        ends = np.linalg.qr(part.x[:nuisance].T)[0]
        instruments = part.instruments if by_instruments else part.x
        x, z = (rows - (rows @ ends) @ ends.T for rows in (part.x[nuisance:], instruments[nuisance:]))
        weight = independent_share(own.equations.lines_hz, duration) / duration
        parts.append((weight * z, x, part.disturbance(own, row, response.estimate)))
    length = np.sqrt(np.sum([(z**2).sum(axis=1) for z, _, _ in parts], axis=0))[:, None]
    normal = np.sum([(z / length) @ x.T for z, x, _ in parts], axis=0)
    return [-np.linalg.solve(normal, (z / length) @ d.T).T for z, _, d in parts]


def _remarks(
    model: PointModel, by: Mapping[str, Sequence[Array]], alignments: Sequence[Alignment]
) -> list[str]:
    """Name, by unknown, the parameters whose standard error it raises more than all noise of the fit does."""
    remarks = []
    for m, alignment in enumerate(alignments):
        for i, (unknown, sigma) in enumerate(zip(alignment.names, alignment.std_error, strict=True)):
            open_ = []
            for name, response in model.responses.items():
                added = np.abs(by[name][m][i]) * sigma
                rows = zip(
                    response.regressors, response.regressor_units, added, response.std_error, strict=True
                )
                open_ += [
                    f"{name} by {n} (+- {2 * a:.2g} {per(response.unit, unit)})"
                    for n, unit, a, s in rows
                    if a > DOMINANT * s
                ]
            if open_:
                what = "not told by these data" if unknown in alignment.unobservable else "uncertain"
                where = f" of manoeuvre {m + 1}" if len(alignments) > 1 else ""
                size = f"+- {2 * sigma:.2g} {alignment.units[i]}"
                remarks.append(
                    f"{unknown}{where} is {what} ({size}), which alone leaves open {', '.join(open_)}."
                )
    return remarks

"""What the uncertainty of an identified model means for a control loop: margins, modes and trim.

Every model that is drawn from the covariance is put under the same law (docs/margins.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from freqid.blend.global_model import GlobalModel
from freqid.blend.state_space import StateSpace, point_statespaces, vehicle_of
from freqid.compare.consequence import Assessment, Condition, assess, trim_authority
from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError, UsageError
from freqid.core.results.loop_margins import Beside, LoopMargins
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference
from freqid.core.vehicle import Vehicle
from freqid.dynamics.control_law import ControlLaw, LawAt
from freqid.dynamics.linear_loop import Margins
from freqid.dynamics.modes import MOTION, Mode

DRAW_POINTS = 300
"""Frequencies at which a drawn loop is computed. Its margins are compared with the estimate's on the same
frequencies, so that what lies between them cancels: 0.02 deg and 0.01 dB are left on the LA-8 class loops."""

_LEAN = 0.2  # rad of bank or pitch that balances like an effector at half its range
_REACHED = 1e-2  # of the largest: what effectors can balance


@dataclass(frozen=True)
class Place:
    """A condition that margins are wanted at.

    Attributes
    ----------
    id : str
    u, rho : float
        m/s, kg/m3.
    scheduled : dict of str to float
        What else is set there, SI.
    """

    id: str
    u: float
    rho: float
    scheduled: dict[str, float]


MotionAt = Callable[[Place], StateSpace]
"""The small motion of an aircraft at a place, tilts included in what is scheduled there."""


def places_of(
    model: GlobalModel | PointModel,
    at: Sequence[str | Reference | float] = (),
    others: Sequence[Reference] = (),
) -> list[Place]:
    """Return the conditions that are asked for.

    Parameters
    ----------
    model : GlobalModel or PointModel
    at : sequence of str, Reference or float
        Ids of the model's own points, conditions, or speeds, m/s; all points where empty. A speed is at the
        density of the corridor's densest line.
    others : sequence of Reference
        Conditions that an id may name too, as those of a scenario; a point of the model of that id goes
        first.

    Raises
    ------
    UsageError
        For an id that the model has not, or conditions of a point model.
    """
    if isinstance(model, PointModel):
        r = model.reference
        if any(one not in (r.id, r) for one in at):
            raise UsageError(
                f"a point model holds at its own condition '{r.id}' alone", remedy="give a global model"
            )
        return [Place(r.id, r.u, r.rho, dict(r.scheduled))]
    c = model.corridor
    points = {
        name: Place(name, float(u), float(rho), dict(zip(c.scheduled, row.tolist(), strict=True)))
        for name, u, rho, row in zip(c.ids, c.u, c.rho, c.schedule.T, strict=True)
    }
    found = []
    for one in at or c.ids:
        if isinstance(one, str) and one not in points:
            one = next((r for r in others if r.id == one), one)
        if isinstance(one, Reference):
            found.append(Place(one.id, one.u, one.rho, dict(one.scheduled)))
        elif isinstance(one, str):
            if one not in points:
                raise UsageError(
                    f"the model has no point '{one}'", remedy=f"name some of {', '.join(c.ids)}, or a speed"
                )
            found.append(points[one])
        else:
            if c.along != "u":
                raise UsageError(
                    f"the corridor runs along {c.along}, so that a speed says no condition",
                    remedy="name its points, or give references",
                )
            found.append(Place(f"{float(one):g} m/s", float(one), model.lines[-1].rho, {}))
    return found


def loop_margins(
    model: GlobalModel | PointModel,
    law: LawAt,
    places: Sequence[Place],
    *,
    vehicle: Vehicle | None = None,
    draws: int = 200,
    seed: int = 0,
    level: float = 0.95,
    names: tuple[str, str] = ("model", "law"),
    tell: Callable[[str], None] = lambda _: None,
    beside: Mapping[str, GlobalModel | MotionAt] | None = None,
) -> LoopMargins:
    """Return margins, modes and trim authority of a model under a law, with intervals from its covariance.

    Parameters
    ----------
    model : GlobalModel or PointModel
    law : callable
        ``law(u, rho, scheduled)`` returns the ControlLaw of a condition.
    places : sequence of Place
    vehicle : Vehicle, optional
        Mass properties, rotors and limits in place of the model's own.
    draws : int
        Models drawn for the intervals; none where zero.
    seed : int
    level : float
        Of the intervals.
    names : tuple of 2 str
        Of model and law.
    tell : callable
        Told what begins, in a few words.
    beside : mapping, optional
        By name: another model, or a function that gives a place's motion, to be put under the same law.

    Raises
    ------
    UsageError
        Where law and model do not fit, or the model states no covariance.
    DataError
        Where a condition is outside the corridor.
    """
    described = vehicle_of(vehicle, _aircraft(model))
    drawn = [] if not draws else model.drawn(draws, seed)
    columns, laws, settled = [], [], []
    motions = _statespaces(model, places, described)
    varied = [_statespaces(one, places, described) for one in drawn]
    for i, (place, motion) in enumerate(zip(places, motions, strict=True)):
        tell(f"margins at {place.id}")
        tilts = {w.tilt: motion.trim[w.tilt] for w in described.wings if w.tilt in motion.trim}
        settled.append(replace(place, scheduled=tilts | place.scheduled))
        try:
            laws.append(law(place.u, place.rho, settled[-1].scheduled))
            found = _Estimated.of(motion, laws[-1], described)
            columns.append(found.with_draws([each[i] for each in varied], laws[-1], described))
        except (DataError, UsageError) as error:
            raise error.at(f"condition '{place.id}'") from None
    figures = tuple(dict.fromkeys(path for column in columns for path in column.estimate))
    stood: dict[str, Beside] = {}
    for name, other in (beside or {}).items():
        tell(f"margins of {name}")
        motions = [other(p) for p in settled] if callable(other) else _statespaces(other, settled, described)
        conditions = [closed(m, one, described) for m, one in zip(motions, laws, strict=True)]
        stood[name] = Beside(np.array([_row(figures_of(c, assess(c)), figures) for c in conditions]).T)
    first = columns[0].assessment
    return LoopMargins(
        ids=tuple(p.id for p in places),
        u=np.array([p.u for p in places]),
        rho=np.array([p.rho for p in places]),
        figures=figures,
        estimate=np.array([_row(c.estimate, figures) for c in columns]).T,
        lower=np.array([_row(c.limits((1 - level) / 2), figures) for c in columns]).T,
        upper=np.array([_row(c.limits((1 + level) / 2), figures) for c in columns]).T,
        stable=np.array([c.assessment.stable for c in columns]),
        unstable_share=np.array([c.unstable_share for c in columns]),
        axes=first.axes,
        effectors=columns[0].effectors,
        level=level,
        draws=draws,
        seed=seed,
        law=names[1],
        model=names[0],
        beside=stood,
    )


def _aircraft(model: GlobalModel | PointModel) -> Vehicle | None:
    return model.aircraft if isinstance(model, PointModel) else model.corridor.aircraft


def _statespaces(
    model: GlobalModel | PointModel, places: Sequence[Place], vehicle: Vehicle
) -> list[StateSpace]:
    if isinstance(model, PointModel):
        return point_statespaces(model, vehicle)
    references = [Reference(p.id, p.u, p.rho, p.scheduled) for p in places]
    return model.to_statespaces(references, vehicle)


def _row(values: Mapping[str, float], figures: Sequence[str]) -> list[float]:
    return [float(values.get(path, np.nan)) for path in figures]


def closed(motion: StateSpace, law: ControlLaw, vehicle: Vehicle, shift: Array | None = None) -> Condition:
    """Return a law closed around a motion; `shift` moves the trim of the effectors that the law moves."""
    loop = law.close(motion.A, motion.B, motion.inputs, motion.velocity, motion.trim["theta"])
    moved = np.zeros(len(law.effectors)) if shift is None else shift
    limits = {e.name: e.limits for e in vehicle.effectors}
    trim = {n: motion.trim[n] + float(d) for n, d in zip(law.effectors, moved, strict=True)}
    return Condition(loop, trim, {n: limits[n] for n in trim if n in limits})


def figures_of(condition: Condition, assessment: Assessment) -> dict[str, float]:
    """Return the figures of a condition by path, as `LoopMargins` has them."""
    table = {k: v for k, v in assessment.figures().items() if not k.startswith("authority/")}
    if assessment.stable and len(assessment.axes) > 1:
        table["margins/all axes/disk"] = condition.loop.disk_margin()
    left = trim_authority(condition.trim, condition.limits)
    return table | {f"trim/{name}/travel_left": 1 - used for name, used in left.items()}


@dataclass(frozen=True, eq=False)
class _Estimated:
    """One condition: the estimate, what draws make of it, and what the estimate is on their frequencies."""

    motion: StateSpace
    condition: Condition
    assessment: Assessment
    estimate: dict[str, float]
    coarse: dict[str, float]
    drawn: dict[str, Array]
    unstable_share: float

    @classmethod
    def of(cls, motion: StateSpace, law: ControlLaw, vehicle: Vehicle) -> _Estimated:
        condition = closed(motion, law, vehicle)
        assessment = assess(condition)
        return cls(motion, condition, assessment, figures_of(condition, assessment), {}, {}, 0.0)

    @property
    def effectors(self) -> tuple[str, ...]:
        return self.condition.loop.effectors

    def with_draws(self, drawn: Sequence[StateSpace], law: ControlLaw, vehicle: Vehicle) -> _Estimated:
        """Return the same with the figures of draws, shape (draw,) each; nan where a draw has no figure."""
        if not drawn:
            return self
        rows, unstable = [], 0
        for motion in drawn:
            shift = _rebalanced(self.motion, motion.residual - self.motion.residual, law.effectors, vehicle)
            condition = closed(motion, law, vehicle, shift)
            unstable += not condition.loop.stable
            rows.append(self._coarse(condition))
        values = {path: np.array([row.get(path, np.nan) for row in rows]) for path in self.estimate}
        coarse = self._coarse(self.condition)
        return replace(self, coarse=coarse, drawn=values, unstable_share=unstable / len(drawn))

    def limits(self, share: float) -> dict[str, float]:
        """Return a quantile of each figure over the draws that have it, where half of them do."""
        found = {}
        for path, values in self.drawn.items():
            known = values[~np.isnan(values)]
            if known.size and known.size >= 0.5 * values.size:
                start = self.coarse.get(path, np.nan)
                refined = self.estimate[path] - start if np.isfinite(start) else 0.0
                found[path] = _quantile(known, share) + (refined if np.isfinite(refined) else 0.0)
            if path.startswith("trim/"):  # a trim near the middle of the range can only have less travel left
                outer = min if share < 0.5 else max
                found[path] = outer(found[path], self.estimate[path])
        return found

    def _coarse(self, condition: Condition) -> dict[str, float]:
        """Return the figures on fewer frequencies; modes are those nearest to the estimate's."""
        table: dict[str, float] = {}
        if condition.loop.stable:
            margins = condition.loop.margins(exact=False, points=DRAW_POINTS)
            for place, found in margins.items():
                table |= {f"margins/{place}/{k}": v for k, v in vars(found).items() if k in _MARGINS}
            if len(condition.loop.axes) > 1:
                table["margins/all axes/disk"] = condition.loop.disk_margin(points=DRAW_POINTS)
        alone = np.linalg.eigvals(_motion(condition)).astype(complex)
        for kind, modes, values in (
            ("modes", self.assessment.modes, alone),
            ("closed_modes", self.assessment.closed_modes, condition.loop.eigenvalues),
        ):
            for mode, value in zip(modes, _nearest_to(modes, values), strict=True):
                now = Mode(mode.name, value)
                table |= {
                    f"{kind}/{mode.name}/frequency": now.frequency,
                    f"{kind}/{mode.name}/damping": now.damping,
                }
        left = trim_authority(condition.trim, condition.limits)
        return table | {f"trim/{name}/travel_left": 1 - used for name, used in left.items()}


_MARGINS = tuple(Margins.__dataclass_fields__)


def _motion(condition: Condition) -> Array:
    """Return the matrix of the aircraft alone, of the states that name its modes."""
    loop = condition.loop
    places = [loop.states.index(n) for n in MOTION if n in loop.states]
    return loop.A[np.ix_(places, places)]


def _nearest_to(modes: Sequence[Mode], values: Complex) -> list[complex]:
    """Return for each mode an eigenvalue of its own, all together as near as can be."""
    upper = values[values.imag >= -1e-12]
    if not modes or upper.size < len(modes):
        return [complex(np.nan, np.nan)] * len(modes)
    start = np.array([m.eigenvalue for m in modes])
    _, chosen = linear_sum_assignment(np.abs(start[:, None] - upper[None]))
    return upper[chosen].tolist()


def _quantile(values: Array, share: float) -> float:
    """Return a quantile between the values, and an infinite one where it lies next to an infinite value."""
    finite = np.isfinite(values)
    if finite.all():
        return float(np.quantile(values, share, method="median_unbiased"))
    return float(np.quantile(values, share, method="closest_observation"))


def _rebalanced(motion: StateSpace, residual: Array, effectors: Sequence[str], vehicle: Vehicle) -> Array:
    """Return what effectors move by to take up a change of the loads at the trim, with least effort.

    Bank and pitch take part. Effort is travel over half the effector's range.
    """
    half = {e.name: (e.limits[1] - e.limits[0]) / 2 for e in vehicle.effectors}
    size = np.array([half.get(n, 1.0) for n in effectors])
    places = [motion.inputs.index(n) for n in effectors]
    lean = [motion.states.index(n) for n in ("phi", "theta")]
    effect = np.hstack([motion.B[:6, places] * size, motion.A[:6, lean] * _LEAN])
    return -size * (np.linalg.pinv(effect, rcond=_REACHED) @ residual)[: len(effectors)]

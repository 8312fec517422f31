"""Closures on manoeuvres that were not used, in the figures that engineers know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from freqid.core.diagnosis import Change, Closure, Interval, Share
from freqid.core.errors import FreqidError
from freqid.core.record import FlightRecord
from freqid.gap.changes import changes
from freqid.gap.close import Misfit, misfit
from freqid.gap.compare import Compared
from freqid.gap.fidelity import frequency_cost, rmse, theil
from freqid.gap.locate import regime_of
from freqid.gap.quiet import sensor_noise
from freqid.gap.refit import Refit, Seen, refit, stepped
from freqid.gap.simulation import Simulation, side_by_side
from freqid.gap.together import together
from freqid.identify.smoothing import local_derivative
from freqid.identify.trend import up_to
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Settings = Mapping[str, Mapping[str, float]]
Flight = dict[str, Array] | None

ITSELF = "scored on the manoeuvre that it was fitted to, for there is no other"
"""Note of a closure that is held against what it was made from."""

_MOST_FOLDS = 5
_HARDLY = 0.5  # of what goes where it was fitted: less elsewhere is said
_STATES = ("u", "v", "w", "p", "q", "r")


def closure(
    used: Sequence[Compared],
    kept: Sequence[Compared],
    names: Sequence[str],
    effects: Sequence[Effect],
    start: Settings,
    interval: float,
) -> tuple[Closure, Refit]:
    """Refit effects and score them on manoeuvres that the refit did not see.

    Parameters
    ----------
    used, kept : sequence of Compared
        Without manoeuvres that are kept, those used take turns.
    names : sequence of str
        Of all manoeuvres.
    effects : sequence of Effect
    start : dict of dict of float
        Where the refit begins.
    interval : float
    """
    seen: Seen = {}
    fitted = refit(used, effects, start, seen)
    notes = _determined(fitted)
    if kept:
        parts, shown, held = [misfit(kept, effects, fitted.settings)], kept, names[len(used) :]
    elif len(used) > 1:
        parts, shown, held = _turns(used, effects, fitted, seen), used, names
        notes.append("manoeuvres took turns in being held out")
    else:
        parts, shown, held = [misfit(used, effects, fitted.settings)], used, names
        notes.append(ITSELF)
    whole = Misfit.pooled(parts)
    wrench = whole.share(interval)
    if wrench.G < 0 and len(parts) >= 1:
        notes.append("it makes matters worse where it was not fitted: it does not transfer")
    elif kept:
        inside = misfit(used, effects, fitted.settings).share(interval)
        if wrench.hi < _HARDLY * inside.lo:
            there, here = 100 * inside.G, 100 * wrench.G
            notes.append(
                f"it removes {there:.0f} % where it was fitted, {here:.0f} % elsewhere: it hardly transfers"
            )
    reach = float(norm.ppf((1 + interval) / 2))
    settings: dict[str, dict[str, Interval]] = {}
    units = {e.id: {n: p.unit for n, p in e.parameters.items()} for e in effects}
    for (i, n), x, s in zip(fitted.names, fitted.value, np.sqrt(np.diag(fitted.covariance)), strict=True):
        settings.setdefault(i, {})[n] = Interval(
            float(x), float(x - reach * s), float(x + reach * s), units[i][n]
        )
    errors, theils, costs = _classical(shown, effects, fitted.settings)
    found = Closure(
        effects=tuple(e.id for e in effects),
        settings=settings,
        wrench=wrench,
        response=_flown(shown, fitted.settings),
        rmse=errors,
        theil=theils,
        J=costs,
        held_out=tuple(held),
        note="; ".join(notes),
    )
    return found, fitted


def _determined(fitted: Refit) -> list[str]:
    said = [f"{i} {n} is not determined by these records" for i, n in fitted.undetermined]
    return said + [f"{i} {n} stopped at a bound" for i, n in fitted.at_bound]


def _turns(used: Sequence[Compared], effects: Sequence[Effect], fitted: Refit, seen: Seen) -> list[Misfit]:
    """Return the misfits of manoeuvres held out in turn, regimes kept together where there are several."""
    regimes = list(dict.fromkeys(regime_of(c) for c in used))
    label = [regimes.index(regime_of(c)) for c in used] if len(regimes) > 1 else list(range(len(used)))
    folds = min(_MOST_FOLDS, len(set(label)))
    parts = []
    for fold in range(folds):
        inside = [c for c, k in zip(used, label, strict=True) if k % folds != fold]
        outside = [c for c, k in zip(used, label, strict=True) if k % folds == fold]
        parts.append(misfit(outside, effects, stepped(inside, effects, fitted, seen)))
    return parts


def _classical(
    shown: Sequence[Compared], effects: Sequence[Effect], settings: Settings
) -> tuple[dict[str, Change], dict[str, Change], dict[str, Change]]:
    """Return RMSE, Theil's coefficient and cost J, before and after, and of no change at all.

    By response, and by actuator where the effects move its position.
    """
    pieces: dict[str, list[tuple[Array, Array, Array]]] = {}
    costs: dict[str, list[tuple[float, float]]] = {}
    for c in shown:
        measured, before, after = followed(c, effects, settings)
        for i, row in enumerate(c.rows):
            moved = row.kind == "actuator" and not np.array_equal(before[i], after[i])
            if row.kind == "response" or moved:
                pieces.setdefault(row.name, []).append((measured[i], before[i], after[i]))
        _costs(c, changes(c, effects, settings), costs)
    errors, theils = {}, {}
    for name, found in pieces.items():
        z, before, after = (np.concatenate([p[k] for p in found]) for k in range(3))
        still = np.concatenate([np.full(p[0].size, p[0].mean()) for p in found])
        errors[name] = Change(rmse(z, before), rmse(z, after), rmse(z, still))
        theils[name] = Change(*(theil(z, y).coefficient for y in (before, after, still)))
    cost = {n: Change(*(float(np.mean([p[k] for p in v])) for k in (0, 1))) for n, v in costs.items()}
    return errors, theils, cost


def followed(c: Compared, effects: Sequence[Effect], settings: Settings) -> tuple[Array, Array, Array]:
    """Return all rows' histories as measured, as simulated, and as simulated with effects.

    Without what lies above the band; each of shape (row, sample).
    """
    trial, dt, top = c.flown, c.lines.dt, float(c.lines.hz[-1])
    total = together(effects, trial, settings)
    before = trial.rows(c.predicted, trial.positions)
    found = []
    for direct, momentum in (
        (c.measured.direct, c.measured.momentum),
        (before.direct, before.momentum),
        (before.direct + total.direct, total.momentum),
    ):
        values = direct.copy()
        changing = momentum.any(axis=1)
        if changing.any():
            values[changing] += local_derivative(momentum[changing], dt, 9, 4)
        found.append(up_to(values, dt, top))
    return found[0], found[1], found[2]


def _costs(c: Compared, change: NDArray[np.complex128], costs: dict[str, list[tuple[float, float]]]) -> None:
    """Add the frequency-domain cost of each response to each injected signal, where noise leaves any."""
    if not c.lines.inputs:
        return
    predicted = c.lines.spectrum(c.predicted)
    for i, row in enumerate(c.rows):
        if row.kind != "response":
            continue
        noise = c.noise.covariance[:, i, i].real
        measured = predicted[i] + c.residual[i]
        power = np.abs(measured) ** 2
        coherence = np.clip(1 - noise / np.maximum(power, 1e-300), 0.0, 1.0)
        for o in range(len(c.lines.inputs)):
            on = (c.lines.owner == o) & (coherence > 0.6)
            if on.sum() >= 3:
                args = c.lines.hz[on], measured[on]
                pair = [
                    frequency_cost(*args, p[on], coherence[on], points=None)
                    for p in (predicted[i], predicted[i] + change[i])
                ]
                costs.setdefault(row.name, []).append((float(pair[0]), float(pair[1])))


def _flown(shown: Sequence[Compared], settings: Settings) -> Share:
    """Return the share of the gap that goes in the simulation's own flights of the same inputs."""
    simulation = shown[0].trial.simulation
    strange = [i for i in settings if i not in simulation.effects]
    if strange:
        why = f"the simulation does not have {strange[0]}, so it cannot fly with it"
        return Share(np.nan, np.nan, np.nan, why)
    before = after = noise = 0.0
    count = 0
    try:
        every = _flights(simulation, [c.maneuver.record for c in shown], settings)
    except FreqidError as error:
        return Share(np.nan, np.nan, np.nan, str(error))
    for c, flights in zip(shown, every, strict=True):
        record = c.maneuver.record
        known = [f for f in flights if f is not None]
        if len(known) < 2:
            return Share(np.nan, np.nan, np.nan, "the simulation does not fly by itself")
        names = [n for n in _STATES if f"state/{n}" in record and n in known[0]]
        sigma = sensor_noise(record, [f"state/{n}" for n in names])
        for n in names:
            floor = sigma[f"state/{n}"] ** 2 * record.dt
            z = c.lines.spectrum(record[f"state/{n}"])
            misses = [np.abs(z - c.lines.spectrum(f[n])) ** 2 / floor for f in known]
            before, after = before + float(misses[0].sum()), after + float(misses[1].sum())
            noise, count = noise + c.lines.hz.size, count + c.lines.hz.size
    if before - noise < 4 * np.sqrt(max(count, 1)):
        return Share(np.nan, np.nan, np.nan, "before, the flights differ by no more than noise")
    share = 1 - (after - noise) / (before - noise)
    half = 1.645 * 2 * np.sqrt(max(after, noise)) / (before - noise)
    return Share(float(share), float(share - half), float(share + half))


def _flights(
    simulation: Simulation, records: Sequence[FlightRecord], settings: Settings
) -> list[tuple[Flight, Flight]]:
    """Return a simulation's own flights of records, as it is and with settings, side by side where it can."""

    def both(record: FlightRecord) -> tuple[Flight, Flight]:
        return simulation.fly(record), simulation.fly(record, settings)

    return side_by_side(simulation, both, records)

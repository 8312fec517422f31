"""Is a gap bookkeeping? Mistakes of units, signs, axes, points and order, found before any physics.

A mistake is named only where taking it back, by exactly what it is, makes nearly all of a residual go:
an effect of physics is hardly ever a whole sign, a factor of 57.3 or two names exchanged.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.record import FlightRecord
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Vehicle
from freqid.gap.bookkeeping import Bench, Fault, inputs, outputs, shifted
from freqid.gap.connect.differences import moved
from freqid.gap.simulation import Simulation
from freqid.gap.trial import COEFFICIENT, Trial, bench_of, difference, energy

Array = NDArray[np.float64]

EXPLAINED = 0.9  # share of a residual, noise set aside, that has to go
_LIKELY = 0.5  # the same with the noise, of what is looked at further
SHARP = 0.15  # departure of the fitted size from the mistake's own
_LEAST = 0.003  # residual over the response's own energy that is worth a word
_OWN = 0.01  # the same of a simulation's own flight, beyond noise
SEA_LEVEL = 1.225  # kg/m3
_CONFIRMED = 10  # candidates by derivatives that are tried on the simulation itself
_DELAYS = np.concatenate([-np.arange(0.1, 1.01, 0.02), np.arange(0.1, 1.01, 0.02)])  # s
# Of a change, its share in motion or in level, and of a response's energy: what has to be right by itself.
# Levels are judged less, because sensors' offsets are among them.
_MOTION, _LEVEL, _ROW = 0.02, 0.2, 0.005
_MOST = 6  # mistakes at a time


@dataclass(frozen=True)
class Finding:
    """One mistake of bookkeeping.

    Attributes
    ----------
    fault : str
        Its kind: gravity, response_sign, effector_sign, swapped_effectors, swapped_responses, degrees,
        units, coefficient, axes, moment_reference, gyroscopic, time_shift, trim_level, density or
        self_replay.
    subject : str
        Responses or channels.
    sentence : str
    remedy : str
    explained : float
        Share of the residual that goes when it is taken back.
    """

    fault: str
    subject: str
    sentence: str
    remedy: str
    explained: float


def check(
    simulation: Simulation,
    records: Sequence[FlightRecord],
    vehicle: Vehicle | None = None,
    *,
    own: bool = False,
) -> list[Finding]:
    """Look for mistakes of bookkeeping between a simulation and flights.

    Parameters
    ----------
    simulation : Simulation
    records : sequence of FlightRecord
    vehicle : Vehicle, optional
        In place of the records' and the simulation's.
    own : bool
        The records are the simulation's own flights: whatever is left is a mistake.

    Returns
    -------
    list of Finding
        Largest first; a mistake is looked for after the larger ones were taken back.

    Raises
    ------
    DataError
        Where records lack what the responses are made of.
    """
    trials = [Trial(simulation, bench_of(simulation, record, vehicle)) for record in records]
    findings: list[Finding] = []
    while len(findings) < _MOST:
        found = _next(trials)
        if found is None:
            break
        fault, explained = found
        findings.append(Finding(fault.id, fault.subject, fault.sentence, fault.remedy, explained))
        for trial in trials:
            trial.accept(fault)
    if own and not findings:
        findings += _not_its_own(trials)
    return findings


def _not_its_own(trials: Sequence[Trial]) -> list[Finding]:
    """Return a finding where a simulation does not reproduce flights of its own."""
    nothing = Fault("", "", "", "", mend=lambda record: record)
    left = np.mean([energy(t.residual(t.predicted)) - t.noise(nothing) for t in trials], axis=0)
    worst = int(np.argmax(left))
    if left[worst] < _OWN:
        return []
    name = trials[0].bench.names[worst]
    return [
        Finding(
            "self_replay",
            name,
            f"the simulation does not reproduce its own flight: {100 * np.sqrt(left[worst]):.2g} % of {name} "
            "(rms) is left on the states and positions that it flew itself",
            "compare its logged states, positions and loads with what its model is given",
            0.0,
        )
    ]


def _next(trials: Sequence[Trial]) -> tuple[Fault, float] | None:
    """Return the mistake that explains most, if one explains sharply enough, with the share it explains."""
    likely = []
    for fault in _candidates(trials):
        mended = [trial.without(fault) for trial in trials]
        there = [p for p in mended if p is not None]
        if len(there) == len(trials):
            change = _Change.of(trials, there, fault.rows)
            if change.gain > 0 and change.explained(0.0) > _LIKELY and change.sharp:
                likely.append((change, fault))
    for change, fault in sorted(likely, key=lambda found: -found[0].gain):
        noise = np.sum([trial.noise(fault) for trial in trials], axis=0)
        explained = change.explained(noise)
        if explained > EXPLAINED:
            return fault, explained
    return _trim_level(trials)


@dataclass(frozen=True, eq=False)
class _Change:
    """What taking a mistake back does to the residual; energies by response, summed over records.

    Attributes
    ----------
    before, after : ndarray, shape (response,)
    touched : ndarray of int
        Responses that it is judged by.
    fitted : float
        How much of the change fits best; one for a mistake that is exactly what it is called.
    apart, by_row : tuple of float
        The same of fluctuations and levels, and of each response, by themselves, where they change enough.
    """

    before: Array
    after: Array
    touched: NDArray[np.intp]
    fitted: float
    apart: tuple[float, ...]
    by_row: tuple[float, ...]

    @classmethod
    def of(cls, trials: Sequence[Trial], predicted: Sequence[Array], rows: Sequence[int]) -> _Change:
        now = [t.residual(t.predicted) for t in trials]
        then = [t.residual(p) for t, p in zip(trials, predicted, strict=True)]
        changes = [difference(a, b) for a, b in zip(now, then, strict=True)]
        before, after, size = (
            np.sum([energy(part) for part in parts], axis=0) for parts in (now, then, changes)
        )
        touched = np.array(rows, dtype=int) if len(rows) else np.flatnonzero(size > 0.1 * before)
        products, sizes = [], []  # of fluctuations and levels, by response
        for part in (0, 1):
            now_part, by_part = ([np.reshape(x[part], (len(size), -1)) for x in xs] for xs in (now, changes))
            pairs = list(zip(now_part, by_part, strict=True))
            products.append(np.sum([(r * c).sum(axis=1) for r, c in pairs], axis=0)[touched])
            sizes.append(np.sum([(c**2).sum(axis=1) for _, c in pairs], axis=0)[touched])
        by_row, of_row = np.sum(products, axis=0), np.sum(sizes, axis=0)
        whole = max(float(of_row.sum()), 1e-300)
        apart = [
            float(p.sum() / size.sum())
            for p, size, least in zip(products, sizes, (_MOTION, _LEVEL), strict=True)
            if size.sum() > least * whole
        ]
        each = [float(p / s) for p, s in zip(by_row, of_row, strict=True) if s > _ROW * len(trials)]
        return cls(before, after, touched, float(by_row.sum()) / whole, tuple(apart), tuple(each))

    @property
    def sharp(self) -> bool:
        """Whether it is by exactly the mistake's size that the change fits."""
        return (
            abs(self.fitted - 1) < SHARP
            and all(abs(part - 1) < 2 * SHARP for part in self.apart)
            and all(abs(row - 1) < 4 * SHARP for row in self.by_row)
        )

    @property
    def gain(self) -> float:
        """Energy that goes, of all responses."""
        return float((self.before - self.after).sum())

    def explained(self, noise: Array | float) -> float:
        """Return the share that goes of what is not noise; zero where there is hardly anything."""
        noise = np.broadcast_to(noise, self.before.shape)
        before, after = (np.maximum(e - noise, 0.0)[self.touched].sum() for e in (self.before, self.after))
        return float(1 - after / before) if before > _LEAST * max(1, self.touched.size) else 0.0


def _candidates(trials: Sequence[Trial]) -> Iterable[Fault]:
    first = trials[0]
    # the same mistake is made of every record by its own closure where it uses the record's signals
    yield from _of_every(trials, [list(outputs(t.bench)) for t in trials])
    yield from _shifts(trials)
    yield from _ignored_density(first)
    ranked = []
    for fault in inputs(first.bench):
        guess = first.linear(fault)
        if guess is not None:
            ranked.append((_gain([first], [guess]), fault))
    large = [f for _, f in ranked if f.id in ("degrees", "units", "axes") and " " in f.subject]  # not linear
    small = sorted((r for r in ranked if r[1] not in large), key=lambda r: -r[0])
    yield from (f for gain, f in small[:_CONFIRMED] if gain > 0)
    if first.simulation.kind != "predictions":
        yield from large


def _of_every(trials: Sequence[Trial], lists: Sequence[Sequence[Fault]]) -> Iterable[Fault]:
    """Join the same mistake of several records into one that knows which record it is asked about."""
    by_key = [{(f.id, f.subject, f.sentence): f for f in faults} for faults in lists]
    for key, fault in by_key[0].items():
        if all(key in found for found in by_key):
            mine = {id(t.bench): found[key] for t, found in zip(trials, by_key, strict=True)}

            def undo(predicted: Array, bench: Bench, mine: dict = mine) -> Array:
                return mine[id(bench)].undo(predicted, bench)

            yield Fault(fault.id, fault.subject, fault.sentence, fault.remedy, fault.rows, undo=undo)


def _ignored_density(trial: Trial) -> Iterable[Fault]:
    """Yield a density that stays that of sea level, where the prediction does not change with it."""
    record = trial.bench.record
    if "air/rho" not in record or trial.simulation.kind == "predictions":
        return
    there, denser = (
        trial.simulation.predict(r)
        for r in (record, moved(record, "air/rho", 0.1 * record["air/rho"].mean()))
    )
    if np.abs(denser - there).max() < 1e-3 * np.abs(there).max():
        yield Fault(
            "density",
            "rho",
            "the density of the record is not used: loads are those of sea level",
            "use air['rho'], or qbar",
            tuple(range(len(trial.bench.names))),
            undo=lambda p, bench: p * bench.record["air/rho"] / SEA_LEVEL,
        )


def _shifts(trials: Sequence[Trial]) -> Iterable[Fault]:
    """Yield the one shift of all responses together that leaves least."""
    names = trials[0].bench.names
    least = 0.1 if sum(n in WRENCH or n in COEFFICIENT for n in names) >= 3 else 0.25

    def left(delay: float) -> float:
        return sum(
            float((t.residual(shifted(t.predicted, t.bench.record.dt, delay))[0] ** 2).sum()) for t in trials
        )

    best = min((float(d) for d in _DELAYS if abs(d) >= least), key=left)
    how = "early" if best > 0 else "late"
    yield Fault(
        "time_shift",
        " ".join(names),
        f"all responses come {abs(best):.2f} s too {how}",
        "bring the simulation and the record to one clock",
        tuple(range(len(names))),
        undo=lambda p, bench: shifted(p, bench.record.dt, best),
    )


def _gain(trials: Sequence[Trial], predicted: Sequence[Array]) -> float:
    """Return how much residual a change removes where it may be somewhat smaller or larger."""
    gain = 0.0
    for trial, there in zip(trials, predicted, strict=True):
        now, then = trial.residual(trial.predicted), trial.residual(there)
        change = difference(now, then)
        product = float((now[0] * change[0]).sum() + (now[1] * change[1]).sum())
        size = float(energy(change).sum())
        fitted = np.clip(product / size, 0.0, 2.0) if size > 0 else 0.0
        gain += 2 * fitted * product - fitted**2 * size
    return gain


def _trim_level(trials: Sequence[Trial]) -> tuple[Fault, float] | None:
    """Return the level as a mistake where a large one is all that is wrong."""
    bench = trials[0].bench
    vehicle = bench.maneuver.vehicle
    weight = vehicle.mass_properties.mass_kg * STANDARD_GRAVITY
    arm = vehicle.chord_m or 0.15 * (vehicle.span_m or 1.0)
    for i, name in enumerate(bench.names):
        if name not in WRENCH:
            continue
        off = np.mean([(t.bench.measured[i] - t.predicted[i]).mean() for t in trials])
        spread = np.std([(t.bench.measured[i] - t.predicted[i]).mean() for t in trials])
        moving = np.mean([(t.residual(t.predicted)[0][i] ** 2).sum() for t in trials])
        size = 0.3 * weight * (1.0 if name in "XYZ" else arm)
        missing = abs(trials[0].predicted[i].mean()) < 0.1 * abs(off)
        if abs(off) > size and moving < (0.25 if missing else 0.05) and spread < 0.1 * abs(off):

            def undo(predicted: Array, _: Bench, i: int = i, off: float = float(off)) -> Array:
                out = predicted.copy()
                out[i] += off
                return out

            sentence = (
                f"{name} is a departure from the trim: its level, {off:.4g}, is missing"
                if missing
                else f"the level of {name} is off by {-off:.4g} while its changes are right"
            )
            total = np.sum([energy(t.residual(t.predicted))[i] for t in trials])
            return (
                Fault("trim_level", name, sentence, "give total loads, trim included", (i,), undo=undo),
                float(1 - moving * len(trials) / total),
            )
    return None

"""One record beside a simulation: what is compared, and how much of what is left is noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT, WRENCH
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.vehicle import Vehicle
from freqid.gap.bookkeeping.fault import Bench, Fault
from freqid.gap.simulation import Simulation
from freqid.identify.loads.wrench import applied_wrench

Parts = tuple[Array, Array]  # fluctuation, shape (response, sample), and level, shape (response,)

_BAND = 3.0  # Hz, in which responses are compared
_LONGEST = 60.0  # s of each record that are looked at
_DRAWS = 3


class Comparison:
    """One record beside the simulation, with the mistakes taken back that were found so far."""

    def __init__(self, simulation: Simulation, bench: Bench):
        self.simulation, self.bench = simulation, bench
        self.faults: list[Fault] = []
        self._slow_motion = _SlowMotion(bench)
        self.scale = self._slow_motion.scale(bench.measured)
        self.fluctuation, self.level = self._slow_motion(bench.measured, self.scale)
        self.predicted = self._predict(())
        self._slopes: Array | None = None

    def accept(self, fault: Fault) -> None:
        """Take a mistake back from now on."""
        self.faults.append(fault)
        self.predicted = self._predict(())
        self._slopes = None

    def residual(self, predicted: Array) -> Parts:
        """Return fluctuation, shape (response, sample), and level, shape (response,), over their scales."""
        fluctuation, level = self._slow_motion(predicted, self.scale)
        return self.fluctuation - fluctuation, self.level - level

    def scaled(self, rows: Array) -> Array:
        """Return the slow fluctuation of rows over the responses' scales, shape (response, sample)."""
        return self._slow_motion(rows, self.scale)[0]

    @property
    def degrees_of_freedom(self) -> int:
        """How many independent numbers the fluctuation of one response holds."""
        return self._slow_motion.dimension

    def without(self, fault: Fault) -> Array | None:
        """Return the prediction with one more mistake taken back; None where the simulation cannot."""
        if fault.undo is not None:
            return fault.undo(self.predicted, self.bench)
        try:
            return self._predict((fault,))
        except DataError:
            return None

    def noise(self, fault: Fault) -> Array:
        """Return what the sensors' noise alone would leave with a mistake taken back, shape (response,).

        Noise as strong again as what the record's channels have beyond any smooth motion, and offsets of
        half its size, go through the simulation and into what was measured.
        """
        rng, total = np.random.default_rng(0), np.zeros(len(self.bench.names))
        try:
            still = self._predict((fault,))
            for _ in range(_DRAWS):
                record = _noisier(self.bench.record, rng)
                noisy = self._predict((fault,), record)
                maneuver = replace(self.bench.maneuver, record=record)
                changed = _measured(maneuver, self.bench.names) - self.bench.measured
                # inputs' noise itself is among what residuals are projected on, another draw is not
                total += energy(self._slow_motion(noisy - still, self.scale, whole=True))
                total += energy(self._slow_motion(changed, self.scale))
        except DataError:
            return total
        return total / _DRAWS

    def linear(self, fault: Fault) -> Array:
        """Return the prediction with one more mistake of inputs taken back, to first order: to rank them."""
        record = self._mended(())
        names = [n for n in record.channels if n.partition("/")[0] in ("state", "effector")]
        if self._slopes is None:
            try:
                self._slopes = self.simulation.gradient(record, names)
            except DataError:
                self._slopes = np.zeros((len(self.bench.names), len(names), record.time.size))
        assert fault.mend is not None
        change = fault.mend(record).matrix(names) - record.matrix(names)
        raw = np.einsum("rin,in->rn", self._slopes, change)
        return self.predicted + raw

    def _mended(self, more: Sequence[Fault], record: FlightRecord | None = None) -> FlightRecord:
        record = record or self.bench.record
        for fault in (*self.faults, *more):
            record = fault.mend(record) if fault.mend else record
        return record

    def _predict(self, more: Sequence[Fault], record: FlightRecord | None = None) -> Array:
        predicted = self.simulation.predict(self._mended(more, record))
        for fault in (*self.faults, *more):
            predicted = fault.undo(predicted, self.bench) if fault.undo else predicted
        return predicted


def _noisier(record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
    """Return a record with its own noise once more."""
    channels = []
    for name, channel in record.channels.items():
        if name.partition("/")[0] in ("state", "effector", "air"):
            rough = np.diff(channel.values, n=3).std() / np.sqrt(20)  # white noise through third differences
            draw = rng.standard_normal(channel.values.size) + 0.5 * rng.choice((-1, 1))
            channels.append(replace(channel, values=channel.values + rough * draw))
    return record.with_channels(*channels)


class _SlowMotion:
    """What is compared: slow enough to be flown, not at the ends, spanned by what moved.

    Fluctuations are projected on states, attitude, effectors and their rates, so that noise that no input
    explains does not hide what a mistake explains.
    """

    def __init__(self, bench: Bench):
        record = bench.record
        self._sigma = 0.1325 / (min(_BAND, 0.2 / record.dt) * record.dt)
        margin = int(2 * self._sigma) + 1
        self._pick = slice(margin, record.time.size - margin, max(1, int(0.1 / record.dt)))
        self._count = len(range(record.time.size)[self._pick])
        names = [f"state/{n}" for n in ("u", "v", "w", "p", "q", "r", "phi", "theta")]
        names += [f"effector/{n}" for n in record.group("effector")]
        slow = self._slow(record.matrix(n for n in names if n in record))
        x = np.concatenate([slow, np.gradient(slow, axis=1)])[:, self._pick]
        x -= x.mean(axis=1, keepdims=True)
        size = np.sqrt((x**2).mean(axis=1))
        x = x[size > 1e-9 * max(1.0, float(size.max()))].T
        self._basis: Array | None = None
        if x.shape[0] > 4 * x.shape[1] > 0:
            u, s, _ = np.linalg.svd(x / np.linalg.norm(x, axis=0), full_matrices=False)
            self._basis = u[:, s > 1e-6 * s[0]]

    @property
    def dimension(self) -> int:
        """Of the space that fluctuations are projected on; samples kept where they are not."""
        return self._count if self._basis is None else self._basis.shape[1]

    def __call__(self, rows: Array, scale: Parts, *, whole: bool = False) -> Parts:
        """Return fluctuation and level over their scales; the `whole` fluctuation, or what is spanned."""
        slow = self._slow(rows)[:, self._pick]
        level = slow.mean(axis=1)
        fluctuation = slow - level[:, None]
        if self._basis is not None and not whole:
            fluctuation = (fluctuation @ self._basis) @ self._basis.T
        return fluctuation / (scale[0][:, None] * np.sqrt(slow.shape[1])), level / scale[1]

    def scale(self, measured: Array) -> Parts:
        """Return what fluctuations and levels are judged by, each of shape (response,)."""
        slow = self._slow(measured)[:, self._pick]
        rms = np.maximum(slow.std(axis=1), 1e-12)
        return rms, np.maximum(np.abs(slow.mean(axis=1)), 3 * rms)

    def _slow(self, rows: Array) -> Array:
        return gaussian_filter1d(rows, self._sigma, axis=1, mode="nearest")


def bench_of(simulation: Simulation, record: FlightRecord, vehicle: Vehicle | None) -> Bench:
    """Return what a record measured of a simulation's responses; of a long one, the first minute.

    Raises
    ------
    DataError
        Where nobody describes the vehicle, or the record lacks what responses are made of.
    """
    if record.duration > _LONGEST:
        record = record.cut(float(record.time[0]), float(record.time[0]) + _LONGEST)
    maneuver = Maneuver.of(record, vehicle or record.vehicle or simulation.vehicle)
    names = tuple(simulation.responses)
    return Bench(maneuver, names, _measured(maneuver, names))


def _measured(maneuver: Maneuver, names: Sequence[str]) -> Array:
    """Return what was measured of responses: as recorded, else reconstructed from the motion."""
    record, rows = maneuver.record, []
    for name in names:
        if f"response/{name}" in record:
            rows.append(record[f"response/{name}"])
        elif name in WRENCH or name in COEFFICIENT:
            form = "force" if name in WRENCH else "coefficient"
            applied = applied_wrench(maneuver, [COEFFICIENT.get(name, name)], form)
            rows.append(applied.history(record.dt)[0])
        else:
            rows.append(record[f"state/{name}"])
    return np.array(rows)


def energy(residual: Parts) -> Array:
    """Return the energy of a residual by response, shape (response,)."""
    fluctuation, level = residual
    return (fluctuation**2).sum(axis=1) + level**2


def difference(before: Parts, after: Parts) -> Parts:
    """Return what goes from one residual to another."""
    return before[0] - after[0], before[1] - after[1]

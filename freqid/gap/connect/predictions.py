"""Recorded predictions as a simulation: a log of a simulator that flew, or was driven through, the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.core.channels import RESPONSE
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import FlightRecord, read_record
from freqid.core.vehicle import Vehicle
from freqid.gap.connect.differences import by_parameters
from freqid.gap.simulation import Departures, Settings, Tolerance, checked_departures

_RIDGE = 1e-4  # prior of a derivative, over (rms of the response / rms of the input)
_CLOCK = 0.01  # of a sample: clocks that differ by less are the same
_ALIKE = ("excitation", "command")  # what both logs share exactly where they are of one manoeuvre


@dataclass(frozen=True, eq=False)
class RecordedPredictions:
    """Predictions along manoeuvres that were logged; methods as in `freqid.gap.simulation.Simulation`.

    Attributes
    ----------
    logs : tuple of (str, FlightRecord)
        File and content; every one with the same ``response/<name>`` channels.
    responses : tuple of str
    vehicle : Vehicle or None
    name : str
    """

    logs: tuple[tuple[str, FlightRecord], ...]
    responses: tuple[str, ...]
    vehicle: Vehicle | None = None
    name: str = "predictions"
    kind: Literal["predictions"] = "predictions"
    effects: Settings = field(default_factory=dict)
    parts: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    can_fly: bool = False
    gyroscopic: bool | None = None

    @property
    def has_actuators(self) -> bool:
        """Whether positions are among the logs."""
        return any(log.group("effector") for _, log in self.logs)

    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the recorded responses on the record's clock, shape (response, sample)."""
        checked_departures(departures, self.tolerances, self.name)
        if effects:
            raise UsageError("recorded predictions have no effects that could be set", where=self.name)
        return self._on(record, [f"response/{name}" for name in self.responses])

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what departures of its own parameters make, of which it has none."""
        return by_parameters(self.predict, record, sizes, departures)

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives identified from the predictions, shape (response, input, sample).

        Least squares of the responses on u v w p q r and all effectors, each about its mean, constant in
        time, so that what a manoeuvre did not move gets nothing: a prior of zero weighs little beside
        anything excited. Other inputs get zero.
        """
        for name in inputs:
            record.channel(name)
        felt = [f"state/{n}" for n in "uvwpqr" if f"state/{n}" in record]
        felt += [f"effector/{n}" for n in record.group("effector")]
        x, y = record.matrix(felt), self.predict(record)
        x, y = (part - part.mean(axis=1, keepdims=True) for part in (x, y))
        size = np.sqrt((x**2).mean(axis=1))
        still = size <= 1e-12 * np.maximum(1.0, np.abs(record.matrix(felt)).max(axis=1))
        scaled = x / np.where(still, 1.0, size)[:, None]
        scaled[still] = 0.0
        information = scaled @ scaled.T / x.shape[1] + _RIDGE * np.eye(len(felt))
        slopes = np.linalg.solve(information, scaled @ y.T / x.shape[1]).T / np.where(still, 1.0, size)
        out = np.zeros((len(self.responses), len(inputs), record.time.size))
        for i, name in enumerate(inputs):
            if name in felt:
                out[:, i] = slopes[:, felt.index(name)][:, None]
        return out

    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return the positions that the simulator logged beside its predictions, by effector.

        Only those that it made itself: positions equal to the record's were given to it.
        """
        log, _ = self._of(record)
        names = [n for n in log.group("effector") if f"command/{n}" in record]
        if not names:
            return {}
        rows = self._on(record, [f"effector/{n}" for n in names])
        return {
            n: row
            for n, row in zip(names, rows, strict=True)
            if f"effector/{n}" not in record or not np.array_equal(row, record[f"effector/{n}"])
        }

    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> None:
        """Return nothing: a log cannot fly."""

    def _of(self, record: FlightRecord) -> tuple[FlightRecord, str]:
        """Return the log that is of a record's manoeuvre, and its file."""
        best = max(self.logs, key=lambda log: _likeness(log[1], record))
        if not _likeness(best[1], record):
            start, stop = record.time[[0, -1]]
            found = "; ".join(f"{f}: '{r.reference}' {r.time[0]:g} to {r.time[-1]:g} s" for f, r in self.logs)
            raise DataError(
                f"no prediction covers the record of '{record.reference}' from {start:g} to {stop:g} s "
                f"(predictions: {found})",
                remedy="give one for each record, with its reference and on its clock",
            )
        return best[1], best[0]

    def _on(self, record: FlightRecord, channels: Sequence[str]) -> Array:
        log, file = self._of(record)
        missing = [name for name in channels if name not in log]
        if missing:
            raise DataError(
                f"channel '{missing[0]}' is missing", where=file, remedy=nearest(missing[0], log.channels)
            )
        rows = log.matrix(channels)
        if log.time.size == record.time.size and np.abs(log.time - record.time).max() < _CLOCK * record.dt:
            return rows
        spline = CubicSpline(log.time, rows, axis=1)
        return spline(np.clip(record.time, log.time[0], log.time[-1]))


def load(paths: Sequence[Path], vehicle: Vehicle | None = None) -> RecordedPredictions:
    """Read recorded predictions.

    Raises
    ------
    DataError
        Where a file is no intact record, holds no response, or holds others than the first file.
    """
    logs = tuple((str(path), read_record(Path(path))) for path in paths)
    first = [name for name in RESPONSE if f"response/{name}" in logs[0][1]]
    for file, log in logs:
        names = [name for name in RESPONSE if f"response/{name}" in log]
        if not names:
            raise DataError(
                "holds no prediction",
                where=file,
                remedy="write datasets /response/<name>, such as /response/X",
            )
        if names != first:
            raise DataError(
                f"predicts {' '.join(names)}, but {logs[0][0]} predicts {' '.join(first)}",
                where=file,
                remedy="let all predictions have the same responses",
            )
    name = ", ".join(file for file, _ in logs)
    return RecordedPredictions(logs, tuple(first), vehicle or logs[0][1].vehicle, name)


def _likeness(log: FlightRecord, record: FlightRecord) -> float:
    """Return how well a log fits a record, zero where it cannot be of the same manoeuvre.

    The clocks must cover each other and the references agree where both say one; among several such logs
    the one with the same injected signals and commands is meant.
    """
    slack = 1.5 * max(log.dt, record.dt)
    if log.time[0] > record.time[0] + slack or log.time[-1] < record.time[-1] - slack:
        return 0.0
    if log.reference and record.reference and log.reference != record.reference:
        return 0.0
    shared = [n for n in record.channels if n.partition("/")[0] in _ALIKE and n in log]
    found = [
        _correlation(np.interp(record.time, log.time, log[n]), record[n]) for n in shared if np.ptp(record[n])
    ]
    nearer = abs(log.time.size * log.dt - record.time.size * record.dt) / max(record.duration, record.dt)
    return 1.0 + max(0.0, float(np.mean(found)) if found else 0.0) - 0.1 * min(nearer, 1.0)


def _correlation(a: Array, b: Array) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size else 0.0

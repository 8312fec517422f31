"""Commands as the actuators got them, as well as a record can tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from freqid.core.arrays import Array, Complex
from freqid.core.channels import ATTITUDE, RATES, VELOCITY
from freqid.core.record import FlightRecord
from freqid.gap.simulation import Simulation
from freqid.gap.stack.lines import Lines

_ORDER = 3  # of the polynomial in frequency by which positions may differ from what the simulation makes
_ROUNDS = 3  # by when that polynomial and the share that is followed have settled


@dataclass(frozen=True, eq=False)
class Commands:
    """What the motion and the injected signals ask for, and how much of the rest the positions follow.

    Attributes
    ----------
    asked : dict of ndarray, shape (sample,)
        By command channel.
    followed : dict of float
        From 0 to 1, of what was logged besides, where a position tells.
    moved : dict of ndarray, shape (sample,)
        By effector, what that makes of the simulated positions.
    """

    asked: Mapping[str, Array]
    followed: Mapping[str, float]
    moved: Mapping[str, Array]

    def of(self, record: FlightRecord, untold: float = 1.0) -> FlightRecord:
        """Return a record of the same motion with its commands as the actuators got them.

        Parameters
        ----------
        record : FlightRecord
        untold : float
            Share that stays of a command that no position tells of.
        """
        share = {n: self.followed.get(n, untold) for n in self.asked}
        changed = [
            replace(record.channel(n), values=x + share[n] * (record[n] - x))
            for n, x in self.asked.items()
            if share[n] < 1
        ]
        return record.with_channels(*changed) if changed else record


def commands_of(simulation: Simulation, record: FlightRecord, clean: FlightRecord, lines: Lines) -> Commands:
    """Return the commands of a record.

    Feedback sends the sensors' noise on to the commands. A log of all commands holds what the actuators
    followed; one that keeps one of several folds what it skips into the band, and the actuators miss that. A
    column that is computed on what they miss would hold the residual's own noise: a gain that is too large.
    So a command is what the injected signals and the motion ask for, and of the rest the share that the
    measured positions follow: that is what the rest says of the true command, and the error that stays is
    independent of it (regression calibration: R. J. Carroll and others, Measurement Error in Nonlinear
    Models, 2nd ed., 2006, chapter 4).

    Parameters
    ----------
    simulation : Simulation
    record : FlightRecord
    clean : FlightRecord
        Its motion without noise.
    lines : Lines
    """
    asked = _asked(record, clean)
    if not asked:
        return Commands({}, {}, {})
    at_rest = record.with_channels(*(replace(record.channel(n), values=x) for n, x in asked.items()))
    before, after = simulation.positions(at_rest), simulation.positions(record)
    followed, moved = {}, {}
    for command in asked:
        name = command.partition("/")[2]
        if name in after and f"effector/{name}" in record:
            more = after[name] - before[name]
            signals = np.array([before[name], more, record[f"effector/{name}"]])
            x, by, measured = lines.spectrum(signals)[:, 1:]
            followed[command] = _followed(lines.hz[1:], x, by, measured - x)
            moved[name] = followed[command] * more
    return Commands(asked, followed, moved)


def _asked(record: FlightRecord, clean: FlightRecord) -> dict[str, Array]:
    """Return the part of each command that goes with the signal injected there and with motion.

    With its integrals and its derivatives, about straight lines.
    """
    time = record.time / record.time[-1]
    moving = [clean[n] for n in (*VELOCITY, *RATES, *ATTITUDE[:2]) if n in clean and np.ptp(clean[n])]
    states = np.array(moving).reshape(-1, time.size)
    states = states - states.mean(axis=1, keepdims=True)
    integrals = cumulative_trapezoid(states, dx=record.dt, initial=0, axis=1)
    shared = np.vstack([states, integrals, np.gradient(states, record.dt, axis=1), np.ones_like(time), time])
    found = {}
    for name in record.group("command"):
        sent, own = record[f"command/{name}"], f"excitation/{name}"
        if not np.ptp(sent):
            continue
        columns = np.vstack([shared, record[own][None]]) if own in record else shared
        size = np.maximum(np.linalg.norm(columns, axis=1, keepdims=True), 1e-300)
        weights = np.linalg.lstsq((columns / size).T, sent, rcond=1e-10)[0]
        found[f"command/{name}"] = weights @ (columns / size)
    return found


def _followed(hz: Array, x: Complex, more: Complex, left: Complex) -> float:
    """Return the share of one more movement that is in what is left of a position, on lines.

    Beside errors of the simulated position x that change slowly with frequency, such as a delay. What more
    there is has the same errors: beside a delay of a quarter of a period it would seem not to be followed.
    """
    powers = (1j * hz / hz[-1]) ** np.arange(_ORDER + 1)[:, None]
    y, share, as_moved = np.concatenate([left.real, left.imag]), 0.0, np.ones_like(x)
    for _ in range(_ROUNDS):
        columns = np.concatenate([x * powers, (as_moved * more)[None]])
        real = np.concatenate([columns.real, columns.imag], axis=1)
        size = np.linalg.norm(real, axis=1)
        if not size[-1]:
            return 0.0
        size = np.maximum(size, 1e-300)
        found = np.linalg.lstsq((real / size[:, None]).T, y, rcond=1e-10)[0] / size
        share, as_moved = found[-1], 1 + found[:-1] @ powers
    return float(np.clip(share, 0.0, 1.0))

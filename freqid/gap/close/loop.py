"""Small motions of a simulation under the control law of a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.dynamics.loop import LAW_POWERS, law_on_lines, powers_of, steady_motion
from freqid.dynamics.small_motion import STATES, equations_of_motion, rotor_spin
from freqid.gap.stack.lines import Lines

_ROUNDING = 1e-9  # m/s, rad/s or rad
_SMALL = 1e-8  # of the largest singular value: what the flights do not tell of the law


@dataclass(frozen=True, eq=False)
class Loop:
    """``s E x = A x + B d + added``, ``d = feedback x + displaced``, line by line.

    Attributes
    ----------
    mass, rates : ndarray, shape (8, 8 + n)
        E and A of the states u v w p q r phi theta and of n effectors.
    feedback : ndarray of complex, shape (line, n, 8)
        From states to positions, actuators in between.
    hz : ndarray, shape (line,)
    moving : ndarray of bool, shape (8,)
        States that take part.
    """

    mass: Array
    rates: Array
    feedback: Complex
    hz: Array
    moving: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        record: FlightRecord,
        vehicle: Vehicle,
        effectors: Sequence[str],
        slopes: Array,
        feedback: Complex,
        hz: Array,
    ) -> Loop:
        """Return the loop about the mean of a flight.

        Parameters
        ----------
        record : FlightRecord
        vehicle : Vehicle
        effectors : sequence of str, length n
        slopes : ndarray, shape (6, 6 + n)
            X to N per unit of u v w p q r and effectors, N and N m.
        feedback : ndarray of complex, shape (line, n, 8)
        hz : ndarray, shape (line,)
            Not zero.
        """
        names = record.group("effector")
        trim = {n: float(record[f"effector/{n}"].mean()) for n in names}
        momentum = rotor_spin(vehicle, names, trim) @ np.array(list(trim.values()))
        wrench = np.concatenate([slopes[:, :6], np.zeros((6, 2)), slopes[:, 6:]], axis=1)
        velocity = np.array([record[f"state/{n}"].mean() for n in "uvw"])
        theta = float(record["state/theta"].mean()) if "state/theta" in record else 0.0
        spin = rotor_spin(vehicle, tuple(effectors), trim)
        mass, rates = equations_of_motion(wrench, vehicle, velocity, theta, spin, momentum)
        moving = np.array([_moves(record, f"state/{n}") for n in STATES])
        return cls(mass, rates, feedback, hz, moving)

    def moved_by(self, wrench: Complex, displaced: Complex) -> Complex:
        """Return the steady response of the states, shape (8, line).

        Parameters
        ----------
        wrench : ndarray of complex, shape (6, line)
            Added loads, N and N m; of shape (8, line) with what is added to the rates of phi and theta.
        displaced : ndarray of complex, shape (n, line)
            Added to positions, behind the law and the actuators.
        """
        return steady_motion(
            self.mass, self.rates, self.feedback, displaced, self.hz, added=wrench, moving=self.moving
        )

    def unsteady(self) -> Complex:
        """Return what ends and slow drifts make of the states, shape (column, 8, line).

        ``F[x'] = s X + (x(T) - x(0)) / sqrt(T)``: no two flights begin and end alike. A straight line that
        was removed from a state is missed by the equations as a ramp.
        """
        none = np.zeros((self.feedback.shape[1], self.hz.size), dtype=complex)
        found = []
        for i in np.flatnonzero(self.moving):
            for shape in (np.ones(self.hz.size), 1 / (2j * np.pi * self.hz)):
                added = np.zeros((8, self.hz.size), dtype=complex)
                added[i] = shape
                found.append(self.moved_by(added, none))
        return np.array(found)


def _moves(record: FlightRecord, channel: str) -> bool:
    """Return whether a channel leaves its straight line by more than rounding."""
    if channel not in record:
        return False
    time, values = record.time - record.time.mean(), record[channel]
    left = values - np.polyval(np.polyfit(time, values, 1), time)
    return bool(np.std(left) > _ROUNDING)


def steady_spectra(record: FlightRecord, channels: Sequence[str], lines: Lines) -> Complex:
    """Return channels on the lines, straight lines removed, shape (channel, line); zero where absent."""
    time = record.time - record.time.mean()
    x = np.array([record[n] if n in record else 0 * time for n in channels])
    x = np.array([np.unwrap(row) if n == "state/phi" else row for n, row in zip(channels, x, strict=True)])
    slopes, levels = np.polyfit(time, x.T, 1)
    return lines.spectrum(x - slopes[:, None] * time - levels[:, None])


def law_of(
    records: Sequence[FlightRecord], sent: Sequence[str], excited: Sequence[str], lines: Lines
) -> Array:
    """Return what a control law adds to the injected signals, shape (3, n, 8): per integral, state and rate.

    The law has heard the states as they were logged, noise and gusts with them, so that least squares on all
    lines have no bias of noisy regressors, and what excites nothing but the law tells it apart from the
    response to the injected signals.

    Parameters
    ----------
    records : sequence of FlightRecord
    sent : sequence of str, length n
        Channels that hold what was sent.
    excited : sequence of str, length n
        Channels of what was injected there.
    lines : Lines
    """
    names = [f"state/{n}" for n in STATES]
    on = np.flatnonzero(lines.hz > 0)
    s = 2j * np.pi * lines.hz[on]
    x = np.concatenate([steady_spectra(r, names, lines)[:, on] for r in records], axis=1)
    powers = np.tile(powers_of(s), len(records))
    columns = (powers[:, None] * x).reshape(len(LAW_POWERS) * len(names), -1)
    law = np.concatenate(
        [(steady_spectra(r, sent, lines) - steady_spectra(r, excited, lines))[:, on] for r in records], axis=1
    )
    length = np.maximum(np.linalg.norm(columns, axis=1), 1e-300)
    real = np.concatenate([columns.real, columns.imag], axis=1) / length[:, None]
    wanted = np.concatenate([law.real, law.imag], axis=1)
    gains = np.linalg.lstsq(real.T, wanted.T, rcond=_SMALL)[0] / length[:, None]
    return gains.T.reshape(len(sent), len(LAW_POWERS), len(names)).transpose(1, 0, 2)


def feedback_on(gains: Array, actuators: Complex, hz: Array) -> Complex:
    """Return a law and its actuators on lines, shape (line, n, 8).

    Parameters
    ----------
    gains : ndarray, shape (3, n, 8)
    actuators : ndarray of complex, shape (n, line)
        Position by command.
    hz : ndarray, shape (line,)
    """
    return np.asarray(law_on_lines(gains, hz) * actuators.T[:, :, None], dtype=np.complex128)

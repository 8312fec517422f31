"""Small motions of an aircraft under a control law and real actuators.

Actuators and delays act by their exact transfer functions, so that nothing is approximated but the inverse
transform, whose error is a matter of the number of lines.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.vehicle import Vehicle
from freqid.dynamics.control_law import ControlLaw
from freqid.dynamics.linear_loop import LinearLoop
from freqid.dynamics.loop import steady_motion_at
from freqid.dynamics.small_motion import equations_of_motion

_WRAPPED = 6.0  # exponent of the weight over a transform: what wraps around is exp(-6) of a decayed motion
_PADDED = 2.0  # length of the transform over that of the signals
_LEFT_OUT = 3e-5  # lines whose inputs are below this share of the largest are left out


class UnevenLags(NamedTuple):
    """First-order lags that follow faster one way than the other; time constants, s, shape (n,) each."""

    up: Array
    down: Array


@dataclass(frozen=True, eq=False)
class ControlledAircraft:
    """Changes of ``x = u v w p q r phi theta`` and positions d about straight flight, wings level.

    Attributes
    ----------
    vehicle : Vehicle
        Mass properties as they are at the trim.
    wrench : ndarray, shape (6, 8 + n)
        X to N per unit of x and d, N and N m.
    velocity : ndarray, shape (3,)
        u v w of the trim, m/s.
    theta : float
        rad.
    spin : ndarray, shape (3, n)
        Rotors' angular momentum per unit of position, kg m2.
    momentum : ndarray, shape (3,)
        Of all rotors at the trim, N m s.
    law : ControlLaw
        Of all n effectors, its actuators behind it.
    lags : UnevenLags, optional
        Of actuators whose ``law.actuation.lag`` is their mean for small motions. Where both ways are equal,
        nothing is done about it.
    """

    vehicle: Vehicle
    wrench: Array
    velocity: Array
    theta: float
    spin: Array
    momentum: Array
    law: ControlLaw
    lags: UnevenLags | None = None

    def with_wrench(self, wrench: Array) -> ControlledAircraft:
        """Return the aircraft with other derivatives."""
        return replace(self, wrench=wrench)

    @cached_property
    def _matrices(self) -> tuple[Array, Array]:
        return equations_of_motion(
            self.wrench, self.vehicle, self.velocity, self.theta, self.spin, self.momentum
        )

    def feedback(self, s: Complex, *, air_data: bool = True) -> Complex:
        """Return positions per unit of x, law and actuators in line, shape (line, n, 8).

        `air_data` as in `ControlLaw.transfer`.
        """
        commands = self.law.transfer(s, self.velocity, self.theta, air_data=air_data)
        return np.asarray(self.law.actuation.transfer(s).T[:, :, None] * commands, dtype=np.complex128)

    def motion(
        self, s: Complex, injected: Complex, added: Complex | None = None, gust: Complex | None = None
    ) -> tuple[Complex, Complex]:
        """Return transforms of states and positions, shape (8, line) and (n, line).

        Parameters
        ----------
        s : ndarray of complex, shape (line,)
            1/s.
        injected : ndarray of complex, shape (n, line)
            Added to the commands.
        added : ndarray of complex, shape (6, line), optional
            Added loads, N and N m.
        gust : ndarray of complex, shape (6, line), optional
            Velocity and rotation of the air in body axes, m/s and rad/s. u v w are then relative to the air,
            the law feeds back those over the ground, but for airspeed and flow angles, and p q r are the
            vehicle's own.
        """
        E, A = self._matrices
        feedback = self.feedback(s)
        displaced = self.law.actuation.transfer(s) * injected
        loads = np.zeros((6, s.size), dtype=complex) if added is None else added.copy()
        if gust is not None:
            ground = self.feedback(s, air_data=False)[:, :, :3]
            displaced = displaced + np.einsum("fnx,xf->nf", ground, gust[:3])
            loads[:3] -= self.vehicle.mass_properties.mass_kg * s * gust[:3]
            loads -= self.wrench[:, 3:6] @ gust[3:]
        x = steady_motion_at(E, A, feedback, displaced, s, added=loads)
        return x, displaced + np.einsum("fnx,xf->nf", feedback, x)

    def history(self, injected: Array, dt: float, *, uneven: bool = True) -> tuple[Array, Array]:
        """Return states and positions in time from rest, shape (8, sample) and (n, sample).

        Parameters
        ----------
        injected : ndarray, shape (n, sample)
            Added to the commands; it starts and ends at zero.
        dt : float
            s.
        uneven : bool
            False takes lags as their mean, which is twice as fast.

        Notes
        -----
        Inverse Laplace transform on the line ``Re s = g + 6 / L``, g the growth of the fastest growing mode
        and L twice the length of the signals, by FFT: what wraps around is ``exp(-6)`` of what is left after
        the signals' length, and a motion that grows is had as well as one that decays (Dubner & Abate, J. ACM
        15(1), 1968). Lags that are uneven are integrated under what the linear loop asks of them; what they
        differ by acts on the loop as a displacement.
        """
        count = injected.shape[1]
        size = int(2 * np.ceil(_PADDED * count / 2))
        growth = max(float(self.loop.eigenvalues.real.max()), 0.0)
        shift = growth + _WRAPPED / (size * dt)
        weight = np.exp(-shift * dt * np.arange(count))
        lines = np.fft.rfft(injected * weight, size)
        strength = np.abs(lines) / np.maximum(np.abs(lines).max(axis=1, keepdims=True), 1e-300)
        last = int(np.flatnonzero((strength > _LEFT_OUT).any(axis=0)).max(initial=0)) + 1
        s = np.asarray(shift + 2j * np.pi * np.arange(last) / (size * dt), dtype=np.complex128)

        def in_time(found: Complex) -> Array:
            full = np.zeros((len(found), size // 2 + 1), dtype=complex)
            full[:, :last] = found
            return np.fft.irfft(full, size)[:, :count] / weight

        x, d = self.motion(s, lines[:, :last])
        states, positions = in_time(x), in_time(d)
        if uneven and self.lags is not None and not np.array_equal(*self.lags):
            (up, down), lag = self.lags, self.law.actuation.lag
            those = np.flatnonzero(up != down)
            asked = in_time((lag[those, None] * s + 1) * d[those])
            off = np.zeros_like(injected)
            off[those] = _followed(asked, dt, up[those], down[those]) - positions[those]
            moved = self.displaced(s, np.fft.rfft(off * weight, size)[:, :last])
            states, positions = states + in_time(moved[0]), positions + in_time(moved[1])
        return states, positions

    def displaced(self, s: Complex, displacement: Complex) -> tuple[Complex, Complex]:
        """Return transforms of states and positions where positions are off what law and actuators make.

        Parameters
        ----------
        s : ndarray of complex, shape (line,)
        displacement : ndarray of complex, shape (n, line)
        """
        E, A = self._matrices
        feedback = self.feedback(s)
        x = steady_motion_at(E, A, feedback, displacement, s)
        return x, displacement + np.einsum("fnx,xf->nf", feedback, x)

    @cached_property
    def loop(self) -> LinearLoop:
        """The same as a state space, delays by Pade's approximation, without the rotors' reaction."""
        E, A = self._matrices
        both: Array = np.asarray(np.linalg.solve(E[:, :8], A), dtype=float)
        return self.law.close(both[:, :8], both[:, 8:], self.law.effectors, self.velocity, self.theta)


def _followed(asked: Array, dt: float, up: Array, down: Array) -> Array:
    """Return positions that follow with one time constant up and another down, shape (n, sample)."""
    found = np.zeros_like(asked)
    rise, fall = np.exp(-dt / up), np.exp(-dt / down)
    middle = (asked[:, :-1] + asked[:, 1:]) / 2  # of each step, over which what is asked is held
    for k in range(asked.shape[1] - 1):
        off = middle[:, k] - found[:, k]
        found[:, k + 1] = middle[:, k] - np.where(off > 0, rise, fall) * off
    return found

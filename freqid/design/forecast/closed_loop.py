"""Small motions of a rigid aircraft under state feedback: what excitations do to states and loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig

from freqid.core.arrays import Array, Complex
from freqid.core.channels import AIR, RESPONSE, STATE, WRENCH
from freqid.core.errors import UsageError, nearest
from freqid.core.vehicle import Vehicle
from freqid.dynamics.small_motion import STATES

SPECIFIC_FORCES = ("ax", "ay", "az")

# A mode that is faster than this, rad/s, is no motion but an effector without lag.
INSTANT = 1e6


@dataclass(frozen=True, eq=False)
class PerturbedAircraft:
    """Perturbations ``x = [states, effector positions]`` as ``E x' = A x + B e``, e injected at effectors.

    The positions are among the unknowns, so that a lag, a rotor's reaction torque and an effector
    without lag, whose row of E is zero, need no cases of their own.

    Attributes
    ----------
    vehicle : Vehicle
        Its n effectors, in order, are those of the model.
    E, A : ndarray, shape (8 + n, 8 + n)
        SI; rows are forces, moments, two attitude angles, then the effectors.
    B : ndarray, shape (8 + n, n)
    wrench : ndarray, shape (6, 8 + n)
        Applied X Y Z L M N per unit of x, N and N m.
    velocity : ndarray, shape (3,)
        u v w of the reference, m/s.
    spin : ndarray, shape (3, n)
        Angular momentum of the rotors per unit of effector position, kg m2.
    momentum : ndarray, shape (3,)
        That of all rotors at the trim, N m s.
    """

    vehicle: Vehicle
    E: Array
    A: Array
    B: Array
    wrench: Array
    velocity: Array
    spin: Array
    momentum: Array

    @property
    def effectors(self) -> tuple[str, ...]:
        """Names of the effectors, in order."""
        return tuple(effector.name for effector in self.vehicle.effectors)

    def rows(self, channels: Sequence[str]) -> Array:
        """Return channels as combinations of states and positions, shape (channel, 8 + n).

        Parameters
        ----------
        channels : sequence of str
            States; effectors, measured positions; ``X`` to ``N``; ``ax ay az`` at the centre of gravity;
            ``V alpha beta`` and ``phat qhat rhat``, linear about the reference.

        Raises
        ------
        UsageError
            Where a channel is unknown, or an air datum undefined at the reference.
        """
        names = (*STATES, *self.effectors)
        identity = np.eye(len(names))
        known = dict(zip(names, identity, strict=True)) | dict(zip(WRENCH, self.wrench, strict=True))
        mass = self.vehicle.mass_properties.mass_kg
        known |= dict(zip(SPECIFIC_FORCES, self.wrench[:3] / mass, strict=True))
        missing = [c for c in channels if c not in known]
        if missing:
            known |= self._air_rows(identity, missing[0])
        for channel in missing:
            if channel not in known:
                raise UsageError(
                    f"channel '{channel}' is not one of the small-perturbation model",
                    remedy=nearest(channel, known),
                )
        return np.array([known[c] for c in channels]).reshape(len(channels), len(names))

    def units(self, channels: Sequence[str]) -> tuple[str, ...]:
        """Return the SI units of channels."""
        tables = {**STATE, **AIR, **RESPONSE}
        return tuple(tables[c][0] if c in tables else self.vehicle.effector(c).unit for c in channels)

    def response(self, channels: Sequence[str], excited: Sequence[str], frequencies_hz: ArrayLike) -> Complex:
        """Return steady-state responses of channels to unit excitations.

        Parameters
        ----------
        channels : sequence of str
            As in `rows`.
        excited : sequence of str
            Effectors that a signal is injected at.
        frequencies_hz : array_like, shape (frequency,)
            Hz.

        Returns
        -------
        ndarray of complex, shape (channel, excitation, frequency)
            Unit of the channel per unit of the effector.
        """
        frequencies = np.asarray(frequencies_hz, dtype=float)
        drive = np.broadcast_to(
            self._drive(excited)[:, :, None], (len(self.A), len(excited), frequencies.size)
        )
        return np.einsum("cx,xef->cef", self.rows(channels), self._solve(drive, frequencies))

    def motion(self, excited: Sequence[str], tones: Complex, frequencies_hz: ArrayLike) -> Complex:
        """Return the steady state under excitations that act together, line by line.

        Parameters
        ----------
        excited : sequence of str
            Effectors that signals are injected at.
        tones : ndarray of complex, shape (excitation, frequency)
            Complex amplitudes, unit of the effector.
        frequencies_hz : array_like, shape (frequency,)
            Hz.

        Returns
        -------
        ndarray of complex, shape (8 + n, frequency)
            Complex amplitudes of states and positions; `rows` makes other channels of them.
        """
        return self._solve(self._drive(excited) @ tones, np.asarray(frequencies_hz, dtype=float))

    def _drive(self, excited: Sequence[str]) -> Array:
        return self.B[:, [index_of(name, self.effectors, "excited effector") for name in excited]]

    def _solve(self, drive: NDArray[Any], frequencies: Array) -> Complex:
        """Solve ``(j w E - A) x = drive`` by frequency, the last axis; one at a time, to spare memory."""
        x = np.empty(drive.shape, dtype=complex)
        for i, s in enumerate(2j * np.pi * frequencies):
            x[..., i] = np.linalg.solve(s * self.E - self.A, drive[..., i])
        return x

    def modes(self) -> tuple[Complex, tuple[tuple[str, ...], ...]]:
        """Return the modes, slowest decay first, and what takes part in each.

        Returns
        -------
        eigenvalues : ndarray of complex, shape (mode,)
            1/s, without those of effectors that have no lag.
        participants : tuple of tuple of str
            By mode, the one or two states or effectors that it mostly lives in.
        """
        # The stubs know neither the ratio form nor three results.
        found: Any = eig(self.A, self.E, left=True, right=True, homogeneous_eigvals=True)
        (alpha, beta), left, right = found
        moving = np.flatnonzero(np.abs(alpha) < INSTANT * np.abs(beta))
        values = alpha[moving] / beta[moving]
        share = np.abs(left.conj() * (self.E @ right))[:, moving]  # participation factors have no unit
        order = np.argsort(-values.real)
        names = (*STATES, *self.effectors)
        participants = []
        for column in share.T[order]:
            ranked = np.argsort(-column)[:2]
            participants.append(tuple(names[i] for i in ranked if column[i] >= 0.2 * column.sum()))
        return values[order], tuple(participants)

    def _air_rows(self, identity: Array, wanted: str) -> dict[str, Array]:
        u, _, w = self.velocity
        speed = np.hypot(u, w)
        if speed == 0.0:
            if wanted in AIR:
                raise UsageError(
                    f"'{wanted}' is undefined in hover, at zero airspeed", remedy="regress on u, v and w"
                )
            return {}
        rows = {
            "V": (u * identity[0] + w * identity[2]) / speed,
            "alpha": (u * identity[2] - w * identity[0]) / speed**2,
            "beta": identity[1] / speed,
        }
        lengths = {"phat": self.vehicle.span_m, "qhat": self.vehicle.chord_m, "rhat": self.vehicle.span_m}
        for rate, (name, length) in enumerate(lengths.items(), start=3):
            if length is not None:
                rows[name] = identity[rate] * length / (2 * speed)
        return rows


def index_of(name: str, known: Sequence[str], what: str) -> int:
    """Return where a name stands among those known, or raise what it was meant to be."""
    if name not in known:
        raise UsageError(f"{what} '{name}' is unknown", remedy=nearest(name, known))
    return list(known).index(name)

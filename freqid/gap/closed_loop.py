"""A vehicle, its actuators and its control law, linear, to be broken open where one likes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from freqid.core.errors import UsageError, nearest
from freqid.gap.margins import Margins, frequencies, margins_of
from freqid.gap.modes import Mode, named_modes

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

PADE = 3
"""Order of the delays' approximation in eigenvalues; frequency responses have the delays themselves."""

SPAN = (0.01, 300.0)
"""Frequencies that margins are looked for in, rad/s."""


@dataclass(frozen=True, eq=False)
class Actuation:
    """Linear dynamics from commands to positions of n effectors; every field of shape (n,).

    ``gain exp(-s delay) (1 + share (w^2 / (s^2 + 2 z w s + w^2) - 1)) / (lag s + 1) / (lag_2 s + 1)``

    Attributes
    ----------
    gain : ndarray
    delay : ndarray
        s.
    frequency, damping : ndarray
        w, rad/s, and z; infinite for none of second order.
    share : ndarray
        Of the distance between command and servo.
    lag, lag_2 : ndarray
        s; zero for none.
    """

    gain: Array
    delay: Array
    frequency: Array
    damping: Array
    share: Array
    lag: Array
    lag_2: Array

    @classmethod
    def ideal(cls, count: int) -> Actuation:
        """Return actuators that are where they are commanded to be."""
        one, none = np.ones(count), np.zeros(count)
        return cls(one, none, np.full(count, np.inf), one, one, none, none)

    def response(self, omega: Array) -> Complex:
        """Return the frequency responses, shape (n, M), omega in rad/s."""
        s = 1j * np.asarray(omega, dtype=float)
        ratio = s / self.frequency[:, None]
        servo = 1 / (ratio**2 + 2 * self.damping[:, None] * ratio + 1)
        followed = 1 + self.share[:, None] * (servo - 1)
        behind = (self.lag[:, None] * s + 1) * (self.lag_2[:, None] * s + 1)
        return self.gain[:, None] * np.exp(-s * self.delay[:, None]) * followed / behind

    def state_space(self, i: int) -> tuple[Array, Array, Array, float]:
        """Return A, B, C and D of one effector, its delay by Pade's approximation."""
        numerator, denominator = np.array([self.gain[i]]), np.array([1.0])
        w, z, share = self.frequency[i], self.damping[i], self.share[i]
        if np.isfinite(w):
            top, below = (1 - share) * np.array([1.0, 2 * z * w, 0.0]), np.array([1.0, 2 * z * w, w**2])
            numerator, denominator = np.polymul(numerator, top + np.array([0.0, 0.0, w**2])), below
        for lag in (self.lag[i], self.lag_2[i]):
            if lag > 0:
                denominator = np.polymul(denominator, [lag, 1.0])
        if self.delay[i] > 0:
            top, below = _pade(float(self.delay[i]))
            numerator, denominator = np.polymul(numerator, top), np.polymul(denominator, below)
        return _companion(np.array(numerator, dtype=float), np.array(denominator, dtype=float))


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """``x' = A x + B d``, ``d = actuation(c)``, ``c = -allocation @ gain @ x``.

    Attributes
    ----------
    states, effectors, axes : tuple of str
        Of x, length k; of d and c, length n; of what the law asks for, length a. A law without allocation
        has the effectors for axes.
    A, B : ndarray, shape (k, k), (k, n)
        Integrals of the law are states too.
    gain, allocation : ndarray, shape (a, k), (n, a)
    actuation : Actuation
    """

    states: tuple[str, ...]
    effectors: tuple[str, ...]
    axes: tuple[str, ...]
    A: Array
    B: Array
    gain: Array
    allocation: Array
    actuation: Actuation

    @cached_property
    def eigenvalues(self) -> Complex:
        """Of the closed loop with delays by Pade, rad/s."""
        return np.asarray(np.linalg.eigvals(self._closed), dtype=np.complex128)

    @property
    def stable(self) -> bool:
        """Whether no eigenvalue grows."""
        return bool(self.eigenvalues.real.max() < 1e-6)

    def modes(self) -> tuple[Mode, ...]:
        """Return the closed loop's modes that are mostly of the vehicle, named."""
        size = len(self._closed) - len(self.states)
        found = named_modes(self._closed, (*self.states, *(f"actuator {i}" for i in range(size))))
        return tuple(m for m in found if not m.name.startswith("control"))

    def broken_at(self, place: str, omega: Array) -> Complex:
        """Return the loop that opens where one command, or one axis of the law, is cut, all others closed.

        Parameters
        ----------
        place : str
            Of `effectors` or of `axes`.
        omega : ndarray, shape (M,)
            rad/s.

        Raises
        ------
        UsageError
            For a place that is neither.
        """
        every = self.loops(omega)
        if place not in every:
            raise UsageError(f"the loop has no '{place}'", remedy=nearest(place, every))
        return every[place]

    def loops(self, omega: Array) -> dict[str, Complex]:
        """Return all loops that open at one effector's command or at one axis, by name.

        Notes
        -----
        With M the matrix of the loop that is open at all commands, ``1 + l_i = 1 / [(1 + M)^-1]_ii``:
        J. M. Maciejowski, *Multivariable Feedback Design*, Addison-Wesley, 1989, sec. 2.
        """
        s = 1j * np.asarray(omega, dtype=float)
        motion = np.linalg.solve(s[:, None, None] * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        driven = self.gain @ motion * self.actuation.response(omega).T[:, None]  # (M, axis, effector)
        found = {}
        for names, matrix in (
            (self.axes, driven @ self.allocation),
            (self.effectors, self.allocation @ driven),
        ):
            inverse = np.linalg.inv(np.eye(len(names)) + matrix)
            with np.errstate(divide="ignore"):
                ratio = 1 / np.diagonal(inverse, axis1=1, axis2=2).T - 1
            found |= dict(zip(names, ratio, strict=True))
        return found

    def margins(self, *, exact: bool = True, span: tuple[float, float] = SPAN) -> dict[str, Margins]:
        """Return the margins of all loops, by name; they mean something where `stable`.

        An effector that takes no part in the law has none. `exact` as in `margins.loop_margins`.
        """
        if not self.axes:
            return {}
        omega = frequencies(*span)
        found = {}
        for name, values in self.loops(omega).items():
            if np.abs(values).max() > 1e-9:
                refine = (lambda w, name=name: self.loops(w)[name]) if exact else None
                found[name] = margins_of(omega, values, refine)
        return found

    @cached_property
    def _closed(self) -> Array:
        """Closed loop's matrix, of x and of the actuators."""
        parts = [self.actuation.state_space(i) for i in range(len(self.effectors))]
        a, b, c = (block_diag(*matrices) for matrices in zip(*(part[:3] for part in parts), strict=True))
        direct = np.array([part[3] for part in parts])
        command = -self.allocation @ self.gain
        within = [len(part[0]) for part in parts]
        if not sum(within):
            return self.A + self.B @ (direct[:, None] * command)
        return np.block([[self.A + self.B @ (direct[:, None] * command), self.B @ c], [b @ command, a]])


def _pade(delay: float) -> tuple[Array, Array]:
    """Return numerator and denominator of Pade's approximation of a delay, falling powers of s."""
    n, coefficient = PADE, [1.0]
    for k in range(1, n + 1):
        coefficient.append(coefficient[-1] * (n - k + 1) / (k * (2 * n - k + 1)))
    rising: Array = np.array([c * delay**k for k, c in enumerate(coefficient)])
    return (rising * (-1.0) ** np.arange(n + 1))[::-1], rising[::-1]


def _companion(numerator: Array, denominator: Array) -> tuple[Array, Array, Array, float]:
    """Return the state space of a transfer function."""
    n = len(denominator) - 1
    top = np.zeros(n + 1)
    top[n + 1 - len(numerator) :] = numerator
    top, below = top / denominator[0], np.asarray(denominator) / denominator[0]
    A = np.zeros((n, n))
    if n:
        A[0], A[1:, :-1] = -below[1:], np.eye(n - 1)
    return A, np.eye(n)[:, :1], (top[1:] - top[0] * below[1:])[None], float(top[0])

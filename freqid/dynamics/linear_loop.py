"""A linear vehicle with its actuators under a control law, and the stability margins of that loop.

References
----------
K. J. Astrom, R. M. Murray, *Feedback Systems*, 2nd ed., Princeton, 2021, sec. 10.3 (margins, delay margin).
J. M. Maciejowski, *Multivariable Feedback Design*, Addison-Wesley, 1989, sec. 2 (loops broken one at a time).
P. Seiler, A. Packard, P. Gahinet, "An Introduction to Disk Margins", *IEEE Control Systems Magazine* 40(5),
2020 (disk margins, one loop at a time and several at once).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag
from scipy.optimize import brentq, minimize_scalar

from freqid.core.arrays import Array, Complex
from freqid.core.errors import UsageError, nearest
from freqid.dynamics.modes import Mode, named_modes

LoopGain = Callable[[Array], Complex]

PADE_ORDER = 3
"""Order of the delays' approximation in eigenvalues. Frequency responses use the exact delay."""

MARGIN_RANGE = (0.01, 300.0)
"""Frequencies in which margins are sought, rad/s."""

POINTS = 1500
"""Frequencies between which crossings are sought. Two crossings closer than their spacing are missed."""

# At `_STABLE` a loop counts as a static gain, without an integrator, if its imaginary part is less than
# this share of the real part, and the real part is below this size.
_REAL, _LARGEST = 1e-3, 1e4
_NO_LOOP = 1e-9  # largest loop gain of an effector that takes no part in the law
# rad/s: an eigenvalue that is nearer to the origin is there but for rounding. It does not grow, and loops at
# zero frequency are taken here, where they do not feel it.
_STABLE = 1e-6


@dataclass(frozen=True)
class Margins:
    """How far a stable loop is from the limit of stability.

    Attributes
    ----------
    gain_up_db, gain_down_db : float
        Least increase and least decrease of the gain that make the loop unstable, dB, both positive; infinite
        if none does.
    phase_deg : float
        Least phase shift, in either direction, that makes it unstable, deg; infinite if the gain is never
        one.
    delay_s : float
        Least added delay that makes it unstable, s.
    crossover_hz : float
        Frequency of `phase_deg`, Hz; nan if the gain is never one.
    modulus : float
        Least distance of the loop gain from -1, over all frequencies.
    disk : float
        Symmetric disk margin, 0 to 2: the loop stays stable for any gain and phase, together, of
        ``(1 + d / 2) / (1 - d / 2)`` with complex ``|d| < disk`` (Seiler, Packard & Gahinet, 2020).
    """

    gain_up_db: float
    gain_down_db: float
    phase_deg: float
    delay_s: float
    crossover_hz: float
    modulus: float
    disk: float


@dataclass(frozen=True, eq=False)
class Actuation:
    """Linear dynamics from the commands to the positions of n effectors; every field of shape (n,).

    ``gain exp(-s delay) (1 + k (w^2 / (s^2 + 2 z w s + w^2) - 1)) / (lag s + 1) / (lag_2 s + 1)``

    Attributes
    ----------
    gain : ndarray
        Position per command at zero frequency.
    delay : ndarray
        s.
    frequency, damping : ndarray
        Natural frequency w, rad/s, and damping ratio z of a second-order servo; infinite w for no servo.
    share : ndarray
        k: 1 for the whole servo, 0 for a position that equals the command.
    lag, lag_2 : ndarray
        Time constants of first-order lags, s; zero for none.
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
        """Return actuators whose positions equal their commands."""
        one, zero = np.ones(count), np.zeros(count)
        return cls(one, zero, np.full(count, np.inf), one, one, zero, zero)

    def response(self, omega: Array) -> Complex:
        """Return the frequency responses, shape (n, M), for omega in rad/s of shape (M,)."""
        return self.transfer(1j * np.asarray(omega, dtype=float))

    def transfer(self, s: Complex) -> Complex:
        """Return the transfer functions at s, 1/s of shape (M,): shape (n, M)."""
        ratio = s / self.frequency[:, None]
        servo = 1 / (ratio**2 + 2 * self.damping[:, None] * ratio + 1)
        second_order = 1 + self.share[:, None] * (servo - 1)
        lags = (self.lag[:, None] * s + 1) * (self.lag_2[:, None] * s + 1)
        return self.gain[:, None] * np.exp(-s * self.delay[:, None]) * second_order / lags

    def state_space(self, i: int) -> tuple[Array, Array, Array, float]:
        """Return A, B, C and D of one effector, with its delay by Pade's approximation."""
        numerator, denominator = np.array([self.gain[i]]), np.array([1.0])
        w, z, share = self.frequency[i], self.damping[i], self.share[i]
        if np.isfinite(w):
            servo = np.array([1.0, 2 * z * w, w**2])
            numerator = np.polymul(numerator, (1 - share) * servo + [0.0, 0.0, share * w**2])
            denominator = servo
        for lag in (self.lag[i], self.lag_2[i]):
            if lag > 0:
                denominator = np.polymul(denominator, [lag, 1.0])
        if self.delay[i] > 0:
            above, below = _pade(float(self.delay[i]))
            numerator, denominator = np.polymul(numerator, above), np.polymul(denominator, below)
        return _companion(np.array(numerator, dtype=float), np.array(denominator, dtype=float))


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """``x' = A x + B d``, ``d = actuation(c)``, ``c = -allocation @ gain @ x``.

    Attributes
    ----------
    states, effectors, axes : tuple of str
        Names of x (k of them), of d and c (n), and of the axes that the control law commands (a). A law
        without allocation has the effectors as its axes.
    A, B : ndarray, shape (k, k), (k, n)
        Integrators of the law are states too.
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
        """Of the closed loop, rad/s; delays by Pade's approximation."""
        return np.asarray(np.linalg.eigvals(self.closed), dtype=np.complex128)

    @property
    def stable(self) -> bool:
        """Whether no eigenvalue grows."""
        return bool(self.eigenvalues.real.max() < _STABLE)

    def modes(self) -> tuple[Mode, ...]:
        """Return the named modes of the closed loop in which the vehicle's motion takes most part."""
        count = len(self.closed) - len(self.states)
        every = named_modes(self.closed, (*self.states, *(f"actuator {i}" for i in range(count))))
        return tuple(m for m in every if not m.name.startswith("control"))

    def loop_gain(self, place: str, omega: Array) -> Complex:
        """Return the loop gain at one command or axis, broken there, with all other loops closed.

        Parameters
        ----------
        place : str
            One of `effectors` or `axes`.
        omega : ndarray, shape (M,)
            rad/s.

        Raises
        ------
        UsageError
            If there is no such effector or axis.
        """
        every = self.loop_gains(omega)
        if place not in every:
            raise UsageError(f"the loop has no '{place}'", remedy=nearest(place, every))
        return every[place]

    def loop_gains(self, omega: Array) -> dict[str, Complex]:
        """Return the loop gain, shape (M,), broken at each axis and at each effector's command in turn.

        Notes
        -----
        With M the return ratio matrix of the loop that is broken at all commands at once,
        ``1 + l_i = 1 / [(1 + M)^-1]_ii``: Maciejowski, 1989, sec. 2.
        """
        law = self._law(omega)
        inverse = np.linalg.inv(np.eye(len(self.axes)) + law @ self.allocation)
        by_axis = np.diagonal(inverse, axis1=1, axis2=2).T
        # (1 + S G)^-1 = 1 - S (1 + G S)^-1 G: there are fewer axes than effectors
        by_effector = 1 - np.einsum("na,fab,fbn->nf", self.allocation, inverse, law, optimize=True)
        gains = {}
        for names, sensitivity in ((self.axes, by_axis), (self.effectors, by_effector)):
            with np.errstate(divide="ignore"):
                gains |= dict(zip(names, 1 / sensitivity - 1, strict=True))
        return gains

    def disk_margin(self, *, points: int = POINTS, span: tuple[float, float] = MARGIN_RANGE) -> float:
        """Return a disk margin that all axes of the law keep at once, each perturbed on its own.

        Parameters
        ----------
        points : int
            Frequencies that it is computed at.
        span : tuple of 2 floats
            rad/s.

        Returns
        -------
        float
            At most the true one, as `Margins.disk` has it; nan without a law, meaningless if not `stable`.

        Notes
        -----
        ``1 / max mu(S - I / 2)`` over frequency, S the sensitivity at the axes and mu for a diagonal complex
        perturbation, of which the largest singular value of ``D (S - I / 2) D^-1`` is an upper bound for any
        positive diagonal D (Seiler et al., 2020). D balances the matrix (Osborne, J. ACM 7, 1960).
        """
        if not self.axes:
            return float("nan")
        omega = margin_frequencies(*span, points)
        eye = np.eye(len(self.axes))
        matrix = np.linalg.inv(eye + self._law(omega) @ self.allocation) - eye / 2
        largest = np.linalg.svd(_balanced(np.asarray(matrix, dtype=np.complex128)), compute_uv=False)[:, 0]
        return float(1 / largest.max())

    def _law(self, omega: Array) -> Complex:
        """Return what the law makes of commands, back at its axes, shape (M, axis, effector)."""
        s = 1j * np.asarray(omega, dtype=float)
        across = s[:, None, None] * np.eye(len(self.A)) - self.A.T
        seen = np.linalg.solve(across, self.gain.T.astype(complex)).swapaxes(1, 2)  # (M, axis, state)
        return seen @ self.B * self.actuation.response(omega).T[:, None]

    def margins(
        self, *, exact: bool = True, span: tuple[float, float] = MARGIN_RANGE, points: int = POINTS
    ) -> dict[str, Margins]:
        """Return the margins at every axis and effector, by name; they are meaningful only if `stable`.

        Effectors that take no part in the law are left out. `exact` and `points` as in `stability_margins`.
        """
        if not self.axes:
            return {}
        omega = margin_frequencies(*span, points)
        found = {}
        for name, values in self.loop_gains(omega).items():
            if np.abs(values).max() > _NO_LOOP:
                refine = (lambda w, name=name: self.loop_gains(w)[name]) if exact else None
                found[name] = margins_from_samples(omega, values, refine)
        return found

    @cached_property
    def closed(self) -> Array:
        """Matrix of the closed loop, for the states of x and then of the actuators.

        Effectors that answer alike share one answer for each axis where they are more than the axes: left
        out are eigenvalues of actuators alone, which nothing reaches.
        """
        motion, rows = self.A.copy(), []
        for places in _alike(self.actuation):
            effect = self.B[:, places] * self.actuation.gain[places]
            command = -self.allocation[places] @ self.gain
            if len(places) > len(self.axes):
                effect, command = effect @ self.allocation[places], -self.gain
            a, b, c, direct = replace(self.actuation, gain=np.ones(len(self.effectors))).state_space(
                places[0]
            )
            motion[:] += direct * effect @ command
            rows += [(a, b @ command[[k]], effect[:, [k]] @ c) for k in range(len(command)) if len(a)]
        if not rows:
            return motion
        a = block_diag(*(row[0] for row in rows))
        b, c = np.vstack([row[1] for row in rows]), np.hstack([row[2] for row in rows])
        return np.block([[motion, c], [b, a]])


def _alike(actuation: Actuation) -> list[list[int]]:
    """Return the places of effectors whose dynamics are the same but for the gain."""
    names = ("delay", "frequency", "damping", "share", "lag", "lag_2")
    groups: dict[tuple[float, ...], list[int]] = {}
    for i in range(len(actuation.gain)):
        groups.setdefault(tuple(float(getattr(actuation, n)[i]) for n in names), []).append(i)
    return list(groups.values())


def stability_margins(
    loop: LoopGain, low: float, high: float, *, exact: bool = True, points: int = POINTS
) -> Margins:
    """Return the margins of ``1 + loop``; they are meaningful only if the closed loop is stable.

    Parameters
    ----------
    loop : callable
        ``loop(omega)``, omega in rad/s of shape (M,), negative feedback: -1 is the critical point.
    low, high : float
        Range of frequencies, rad/s.
    exact : bool
        False interpolates crossings linearly between the frequencies: less accurate, and fast enough for
        hundreds of systems.
    points : int

    Returns
    -------
    Margins

    Notes
    -----
    Whatever the poles of the open loop: as gain, phase or delay leave their nominal values, stability can
    end only where ``loop`` reaches -1, so the nearest such change in each direction is the margin.
    """
    omega = margin_frequencies(low, high, points)
    return margins_from_samples(omega, loop(omega), loop if exact else None)


def margin_frequencies(low: float, high: float, points: int = POINTS) -> Array:
    """Return the frequencies at which loops are sampled, rad/s: one for zero, then `low` to `high`."""
    return np.concatenate([[_STABLE], np.geomspace(low, high, points)])


def margins_from_samples(omega: Array, values: ArrayLike, loop: LoopGain | None = None) -> Margins:
    """Return the margins of a loop gain that is sampled in frequency.

    Parameters
    ----------
    omega : ndarray, shape (M,)
        rad/s, increasing.
    values : array_like of complex, shape (M,)
    loop : callable, optional
        The loop gain as a function of frequency, to refine the crossings with.
    """
    v = np.array(values, dtype=np.complex128)

    def crossings(of: Array, exact: Callable[[complex], float]) -> list[tuple[float, complex]]:
        found = []
        for i in np.flatnonzero(np.sign(of[:-1]) * np.sign(of[1:]) < 0):
            low, high = float(omega[i]), float(omega[i + 1])
            # one frequency at a time may round to the other sign of a part that is zero but for rounding
            if loop is None or exact(_one(loop, low)) * exact(_one(loop, high)) > 0:
                share = of[i] / (of[i] - of[i + 1])
                at = float(low * (high / low) ** share)
                found.append((at, complex(v[i] + share * (v[i + 1] - v[i]))))
            else:
                at = float(brentq(lambda w: exact(_one(loop, w)), low, high, xtol=1e-12 * low))
                found.append((at, _one(loop, at)))
        return found

    imaginary: Array = np.imag(v)
    unity = crossings(np.log(np.abs(v)), lambda x: float(np.log(abs(x))))
    # of the zeros of the imaginary part only those on the negative real axis matter
    real = [x for _, x in crossings(imaginary, lambda x: x.imag) if x.real < 0]
    if v[0].real < 0 and abs(v[0].imag) < _REAL * abs(v[0].real) < _REAL * _LARGEST:
        real.append(complex(v[0]))  # static gain of a loop that has no integrator
    up = [-20 * np.log10(-x.real) for x in real if x.real > -1]
    down = [20 * np.log10(-x.real) for x in real if x.real < -1]
    shift = [(abs(np.angle(-x)), w) for w, x in unity]
    delay = [(np.angle(-x) % (2 * np.pi)) / w for w, x in unity]
    phase, at = min(shift, default=(np.inf, np.nan))
    return Margins(
        gain_up_db=float(min(up, default=np.inf)),
        gain_down_db=float(min(down, default=np.inf)),
        phase_deg=float(np.degrees(phase)),
        delay_s=float(min(delay, default=np.inf)),
        crossover_hz=float(at / (2 * np.pi)),
        modulus=_least(omega, v, loop, lambda x: np.abs(1 + x)),
        disk=min(2.0, _least(omega, v, loop, _symmetric_disk)),
    )


def _symmetric_disk(gain: Any) -> Any:
    """Return ``1 / |S - 1 / 2|`` of loop gains: S - 1/2 = (1 - L) / (1 + L) / 2."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 2 * np.abs(1 + gain) / np.abs(1 - gain)


def _least(omega: Array, values: Complex, loop: LoopGain | None, of: Callable[[Any], Any]) -> float:
    """Return the least of a function of the loop gain, between the frequencies too if `loop` is given."""
    sampled = of(values)
    i = int(np.nanargmin(sampled))
    if loop is None or not 0 < i < omega.size - 1:
        return float(sampled[i])
    found = minimize_scalar(
        lambda w: float(of(_one(loop, w))), bounds=(omega[i - 1], omega[i + 1]), method="bounded"
    )
    return float(min(found.fun, sampled[i]))


def _balanced(matrix: Complex, sweeps: int = 12) -> Complex:
    """Return ``D M D^-1`` with rows and columns of equal size, D positive and diagonal, shape (M, n, n)."""
    size: Array = np.asarray(np.abs(matrix) ** 2, dtype=float)
    count, n, _ = matrix.shape
    at = np.arange(n)
    size[:, at, at] = 0.0
    scale = np.ones((count, n))
    for _ in range(sweeps):
        for i in range(n):
            row = (size[:, i] / scale**2).sum(axis=1) * scale[:, i] ** 2
            column = (size[:, :, i] * scale**2).sum(axis=1) / scale[:, i] ** 2
            with np.errstate(divide="ignore", invalid="ignore"):
                step = (column / row) ** 0.25
            scale[:, i] *= np.where(np.isfinite(step) & (step > 0), step, 1.0)
    return matrix * scale[:, :, None] / scale[:, None, :]


def _one(loop: LoopGain, omega: float) -> complex:
    return complex(loop(np.array([omega]))[0])


def _pade(delay: float) -> tuple[Array, Array]:
    """Return numerator and denominator of Pade's approximation of a delay, falling powers of s."""
    n, coefficient = PADE_ORDER, [1.0]
    for k in range(1, n + 1):
        coefficient.append(coefficient[-1] * (n - k + 1) / (k * (2 * n - k + 1)))
    rising: Array = np.array([c * delay**k for k, c in enumerate(coefficient)])
    return (rising * (-1.0) ** np.arange(n + 1))[::-1], rising[::-1]


def _companion(numerator: Array, denominator: Array) -> tuple[Array, Array, Array, float]:
    """Return a state space of a transfer function, in controllable canonical form."""
    n = len(denominator) - 1
    padded = np.zeros(n + 1)
    padded[n + 1 - len(numerator) :] = numerator
    above, below = padded / denominator[0], np.asarray(denominator) / denominator[0]
    A = np.zeros((n, n))
    if n:
        A[0], A[1:, :-1] = -below[1:], np.eye(n - 1)
    return A, np.eye(n, 1), (above[1:] - above[0] * below[1:])[None], float(above[0])

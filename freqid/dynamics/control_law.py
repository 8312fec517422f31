"""A linear control law as its user describes it: signals in, commands out, actuators behind.

``x' = A x + B y``, ``axes = C x + D y``, ``commands = allocation @ axes``, all measured from the trim. A law
is closed around an aircraft's small motion, which gives the `LinearLoop` that margins are taken of.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import UsageError, nearest
from freqid.dynamics.linear_loop import Actuation, LinearLoop
from freqid.dynamics.small_motion import AIR_DATA, NAVIGATION, SIGNALS, STATES, navigation_rows, signal_row


@dataclass(frozen=True, eq=False)
class ControlLaw:
    """One law, at one condition or at all, SI.

    Attributes
    ----------
    signals : tuple of str, length s
        What it measures, of `freqid.dynamics.small_motion.SIGNALS`.
    axes : tuple of str, length a
        What it asks for; without allocation, the effectors.
    effectors : tuple of str, length n
        What it moves.
    A, B : ndarray, shape (k, k), (k, s)
    C, D : ndarray, shape (a, k), (a, s)
        The command is what is added to the trim: an elevator that goes down with pitch rate has a positive
        gain.
    allocation : ndarray, shape (n, a)
    actuation : Actuation
        From the n commands to the positions.
    name : str
    """

    signals: tuple[str, ...]
    axes: tuple[str, ...]
    effectors: tuple[str, ...]
    A: Array
    B: Array
    C: Array
    D: Array
    allocation: Array
    actuation: Actuation
    name: str = ""

    def __post_init__(self) -> None:
        for signal in self.signals:
            if signal not in SIGNALS:
                raise UsageError(f"the law measures '{signal}'", remedy=nearest(signal, SIGNALS))
        k, s, a, n = (len(self.A), len(self.signals), len(self.axes), len(self.effectors))
        shapes = {"A": (k, k), "B": (k, s), "C": (a, k), "D": (a, s), "allocation": (n, a)}
        for name, expected in shapes.items():
            found = np.shape(getattr(self, name))
            if found != expected:
                raise UsageError(
                    f"{name} has shape {found}, expected {expected} for {k} states, {s} signals, {a} axes "
                    f"and {n} effectors",
                    remedy="correct the matrix or the names",
                )
            if not np.isfinite(getattr(self, name)).all():
                raise UsageError(f"{name} holds a number that is not finite", remedy="correct it")

    @classmethod
    def none(cls, effectors: Sequence[str]) -> ControlLaw:
        """Return no feedback, and actuators that follow at once."""
        n = len(effectors)
        return cls.of_gains((), effectors, np.zeros((n, 0)), name="none")

    @classmethod
    def of_gains(
        cls, signals: Sequence[str], effectors: Sequence[str], gain: Array, *, name: str = ""
    ) -> ControlLaw:
        """Return constant gains, shape (n, s), with actuators that follow at once."""
        n, s = gain.shape
        return cls(
            signals=tuple(signals),
            axes=tuple(effectors),
            effectors=tuple(effectors),
            A=np.zeros((0, 0)),
            B=np.zeros((0, s)),
            C=np.zeros((n, 0)),
            D=gain,
            allocation=np.eye(n),
            actuation=Actuation.ideal(n),
            name=name,
        )

    def over(self, effectors: Sequence[str]) -> ControlLaw:
        """Return the same law over all effectors of an aircraft, in their order.

        The others keep the trim's command, and follow at once what is added to it.

        Raises
        ------
        UsageError
            Where the law moves an effector that is not among them.
        """
        for name in self.effectors:
            if name not in effectors:
                raise UsageError(
                    f"the law moves '{name}', which the aircraft does not have",
                    remedy=nearest(name, effectors),
                )
        order = [list(effectors).index(n) for n in self.effectors]
        allocation = np.zeros((len(effectors), len(self.axes)))
        allocation[order] = self.allocation
        rows = {}
        for field in fields(Actuation):
            rows[field.name] = getattr(Actuation.ideal(len(effectors)), field.name)
            rows[field.name][order] = getattr(self.actuation, field.name)
        return replace(self, effectors=tuple(effectors), allocation=allocation, actuation=Actuation(**rows))

    def transfer(self, s: Complex, velocity: Array, theta: float, *, air_data: bool = True) -> Complex:
        """Return commands per unit of u v w p q r phi theta, shape (line, n, 8).

        Parameters
        ----------
        s : ndarray of complex, shape (line,)
            1/s, neither zero nor a pole of the law.
        velocity : ndarray, shape (3,)
            u v w of the trim, m/s.
        theta : float
            Pitch angle of the trim, rad.
        air_data : bool
            False leaves out what is measured against the air: airspeed and flow angles.

        Raises
        ------
        UsageError
            For a signal without meaning there.
        """
        seen = self._seen(velocity)
        if not air_data:
            seen[[name in AIR_DATA for name in self.signals]] = 0.0
        states = len(STATES)
        over = 1 / s[:, None, None]
        measured = seen[:, :states] + over * (seen[:, states:] @ navigation_rows(velocity, theta))
        inverse = np.linalg.solve(s[:, None, None] * np.eye(len(self.A)) - self.A, self.B.astype(complex))
        return np.asarray(self.allocation @ (self.D + self.C @ inverse) @ measured, dtype=np.complex128)

    def _seen(self, velocity: Array) -> Array:
        """Return the signals by the eight states, heading and altitude; zero for those that do nothing."""
        try:
            seen = np.array([signal_row(n, velocity) for n in self.signals])
        except ValueError as error:
            raise UsageError(str(error), remedy="give a law that does without, or other conditions") from None
        seen = seen.reshape(len(self.signals), len(STATES) + len(NAVIGATION))
        seen[~(self.B.any(axis=0) | self.D.any(axis=0))] = 0.0
        return seen

    def close(
        self, motion: Array, drive: Array, effectors: Sequence[str], velocity: Array, theta: float
    ) -> LinearLoop:
        """Close the law around an aircraft.

        Parameters
        ----------
        motion, drive : ndarray, shape (8, 8), (8, m)
            Of ``x' = motion x + drive d``, x being u v w p q r phi theta.
        effectors : sequence of str, length m
            Names of d; those that the law does not move stay at rest.
        velocity : ndarray, shape (3,)
            u v w of the trim, m/s.
        theta : float
            Pitch angle of the trim, rad.

        Raises
        ------
        UsageError
            For an effector that the aircraft does not have, or a signal without meaning there.
        """
        for name in self.effectors:
            if name not in effectors:
                raise UsageError(
                    f"the law moves '{name}', of which the model has no derivatives",
                    remedy=nearest(name, effectors),
                )
        seen = self._seen(velocity)
        used = [i for i in range(len(NAVIGATION)) if seen[:, len(STATES) + i].any()]
        seen = seen[:, [*range(len(STATES)), *(len(STATES) + i for i in used)]]
        plant, k = len(STATES) + len(used), len(self.A)
        A, B = np.zeros((plant + k, plant + k)), np.zeros((plant + k, len(self.effectors)))
        A[:8, :8] = motion
        A[8:plant, :8] = navigation_rows(velocity, theta)[used]
        A[plant:, :plant], A[plant:, plant:] = self.B @ seen, self.A
        B[:8] = np.asarray(drive)[:, [list(effectors).index(n) for n in self.effectors]]
        states = (*STATES, *(list(NAVIGATION)[i] for i in used), *(f"law {i + 1}" for i in range(k)))
        gain = -np.hstack([self.D @ seen, self.C])
        return LinearLoop(states, self.effectors, self.axes, A, B, gain, self.allocation, self.actuation)


@dataclass(frozen=True, eq=False)
class LawSchedule:
    """Laws along speed, all with the same names, straight between neighbours.

    Attributes
    ----------
    u : tuple of float
        Increasing, m/s; one law alone holds at every speed.
    laws : tuple of ControlLaw
    """

    u: tuple[float, ...]
    laws: tuple[ControlLaw, ...]

    def __post_init__(self) -> None:
        if len(self.u) != len(self.laws) or not self.laws or not (np.diff(self.u) > 0).all():
            raise UsageError(
                f"the law is scheduled by speeds {list(self.u)}, expected increasing ones, one for each law",
                remedy="sort the conditions by u",
            )

    def at(self, u: float) -> ControlLaw:
        """Return the law at a speed.

        Raises
        ------
        UsageError
            Where the speed is outside the schedule.
        """
        if len(self.laws) == 1:
            return self.laws[0]
        if not self.u[0] - 1e-6 <= u <= self.u[-1] + 1e-6:
            raise UsageError(
                f"the law is scheduled from {self.u[0]:.4g} to {self.u[-1]:.4g} m/s, the condition is at "
                f"{u:.4g} m/s",
                remedy="add that speed to the law, or name other conditions",
            )
        i = int(np.clip(np.searchsorted(self.u, u) - 1, 0, len(self.u) - 2))
        share = float(np.clip((u - self.u[i]) / (self.u[i + 1] - self.u[i]), 0.0, 1.0))
        low, high = self.laws[i], self.laws[i + 1]
        between = {m: (1 - share) * getattr(low, m) + share * getattr(high, m) for m in _MATRICES}
        actuation = Actuation(
            *(
                _between(getattr(low.actuation, f.name), getattr(high.actuation, f.name), share)
                for f in fields(Actuation)
            )
        )
        return replace(low, **between, actuation=actuation)


_MATRICES = ("A", "B", "C", "D", "allocation")

LawAt = Callable[[float, float, dict[str, float]], ControlLaw]
"""The law by speed, m/s, density, kg/m3, and what else is set, such as tilts."""


def _between(low: Array, high: Array, share: float) -> Array:
    """Return values straight between two; infinite ones, of actuators without a servo, stay so."""
    with np.errstate(invalid="ignore"):
        value = (1 - share) * low + share * high
    return np.where(np.isnan(value), np.where(share < 0.5, low, high), value)

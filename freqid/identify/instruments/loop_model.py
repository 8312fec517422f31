"""A model of the closed loop, fitted to a flight: equations of motion, a wrench and a control law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.vehicle import Vehicle
from freqid.dynamics.loop import law_on_lines, powers_of, steady_motion
from freqid.dynamics.small_motion import equations_of_motion, rotor_spin
from freqid.identify.loads.explanatory import history
from freqid.identify.model.line_equations import LineEquations
from freqid.identify.regress.equations import real_equations

Complex = NDArray[np.complexfloating[Any, Any]]

# Fewer equations than this for each coefficient of the law, and it repeats the noise it is fitted to.
EQUATIONS_EACH = 3
SIGNAL_POWERS = (0, 1, 2)  # of s: the injected signal and its derivatives, for the actuator's lag


@dataclass(frozen=True, eq=False)
class LoopModel:
    """Small motions x = u v w p q r phi theta and effector positions d under injected signals e.

    Attributes
    ----------
    vehicle : Vehicle
    velocity : ndarray, shape (3,)
        u v w of the reference, m/s.
    theta : float
        Its pitch angle, rad.
    spin : ndarray, shape (3, n)
        Rotors' angular momentum per unit of effector position, kg m2.
    momentum : ndarray, shape (3,)
        That of all rotors at the reference, N m s.
    wrench : ndarray, shape (6, 6 + n)
        X to N per unit of u v w p q r and effectors.
    feedback : ndarray, shape (3, n, 8)
        Effector positions per unit of x: of its integral, of itself and of its derivative.
    forward : ndarray, shape (3, n)
        Effector positions per unit of the signal injected there: of itself and its first two derivatives.
    moving : ndarray of bool, shape (8,)
        States that take part; the others stay at rest.
    """

    vehicle: Vehicle
    velocity: Array
    theta: float
    spin: Array
    momentum: Array
    wrench: Array
    feedback: Array
    forward: Array
    moving: NDArray[np.bool_]

    def response(self, frequencies_hz: Array, injected: Complex) -> Complex:
        """Return the steady response to injected signals, line by line.

        Parameters
        ----------
        frequencies_hz : ndarray, shape (frequency,)
            Positive, Hz.
        injected : ndarray of complex, shape (n, frequency)
            Transforms, unit of the effector.

        Returns
        -------
        ndarray of complex, shape (6 + n, frequency)
            Of u v w p q r and the effectors.
        """
        E, A = self._equations()
        s = 2j * np.pi * frequencies_hz
        forward = np.einsum("kn,kf->nf", self.forward, powers_of(s, SIGNAL_POWERS)) * injected
        feedback = law_on_lines(self.feedback, frequencies_hz)
        x = steady_motion(E, A, feedback, forward, frequencies_hz, moving=self.moving)
        return np.concatenate([x[:6], forward + np.einsum("fnx,xf->nf", feedback, x)])

    def free(self) -> tuple[Complex, Complex]:
        """Return how the loop moves by itself: s of each mode, 1/s, and its shape, (6 + n, mode).

        Of u v w p q r and the effectors, as in `response`; each state moves as exp(s t).

        Notes
        -----
        ``(s E_x - A_x - (A_d - s E_d) K(s)) x = 0`` with ``K = K_i / s + K_p + s K_d``, times s: a cubic
        eigenvalue problem (Tisseur & Meerbergen, SIAM Review 43, 2001), by its companion form.
        """
        E, A = self._equations()
        on = self.moving
        integral, proportional, derivative = (k[:, on] for k in self.feedback)
        rigid_E, rigid_A, E_d, A_d = E[on][:, :8][:, on], A[on][:, :8][:, on], E[on][:, 8:], A[on][:, 8:]
        powers = (
            -A_d @ integral,
            -rigid_A - A_d @ proportional + E_d @ integral,
            rigid_E - A_d @ derivative + E_d @ proportional,
            E_d @ derivative,
        )
        n = len(rigid_E)
        left, right = np.eye(3 * n, k=n), np.eye(3 * n)
        left[2 * n :] = -np.concatenate(powers[:3], axis=1)
        right[2 * n :, 2 * n :] = powers[3]
        s, shape = scipy.linalg.eig(left, right)
        kept = np.isfinite(s) & (s != 0)
        s, x = s[kept], np.zeros((8, int(kept.sum())), dtype=complex)
        x[on] = shape[:n, kept]
        positions = np.einsum("knx,km,xm->nm", self.feedback, powers_of(s), x)
        return s, np.concatenate([x[:6], positions])

    def _equations(self) -> tuple[Array, Array]:
        wrench = np.concatenate([self.wrench[:, :6], np.zeros((6, 2)), self.wrench[:, 6:]], axis=1)
        return equations_of_motion(wrench, self.vehicle, self.velocity, self.theta, self.spin, self.momentum)


def fit_loop(
    maneuvers: Sequence[Maneuver],
    effectors: tuple[str, ...],
    measured: LineEquations,
    injected: Complex,
    wrench: Array,
    moving: NDArray[np.bool_],
) -> LoopModel:
    """Fit the control law of a flight and put the loop together.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
    effectors : tuple of str, length n
    measured : LineEquations
        Its regressors are u v w p q r and the effectors.
    injected : ndarray of complex, shape (n, K)
        On the same lines, with the same weights.
    wrench : ndarray, shape (6, 6 + n)
    moving : ndarray of bool, shape (6 + n,)
        Which of them move at all.

    Returns
    -------
    LoopModel

    Raises
    ------
    DataError
        Where lines are too few.

    Notes
    -----
    Each effector is fitted, by real least squares on the lines, with the states, their integrals and their
    derivatives (gains, integral action, the lag of an actuator to first order), and with the signal injected
    there and its first two derivatives (the actuator's lag to second order). Attitudes are the integrals of
    p and q, so only their own integrals are new. Noise in the states makes the gains too small; an
    instrument need not be right, only free of the noise (docs/theory/instruments.md says what is lost).
    """
    s = np.tile(2j * np.pi * measured.lines_hz, len(measured.durations))
    state = np.flatnonzero(moving[:6])
    attitude = np.flatnonzero(moving[[3, 4]])
    fed = measured.x[state]
    shared = [fed / s, fed, fed * s, measured.x[3 + attitude] / s**2, measured.nuisance]
    n = len(effectors)
    feedback, forward = np.zeros((3, n, 8)), np.zeros((3, n))
    for i in range(n):
        own = injected[i] * powers_of(s, SIGNAL_POWERS) if injected[i].any() else np.empty((0, s.size))
        columns, position = real_equations(np.concatenate([own, *shared]), measured.x[6 + i : 7 + i])
        if columns.shape[1] < EQUATIONS_EACH * len(columns):
            raise DataError(
                f"{s.size} lines are too few to model the control law with {len(columns)} coefficients for "
                f"each effector, expected at least {-(-EQUATIONS_EACH * len(columns) // 2)}",
                remedy="use more lines or several manoeuvres, or the estimator 'least-squares'",
            )
        length = np.linalg.norm(columns, axis=1)
        law = np.linalg.lstsq((columns / length[:, None]).T, position[0])[0] / length
        forward[: len(own), i], law = law[: len(own)], law[len(own) :]
        feedback[:, i, state] = law[: 3 * state.size].reshape(3, -1)
        feedback[0, i, 6 + attitude] = law[3 * state.size : 3 * state.size + attitude.size]
    vehicle = maneuvers[0].vehicle

    def mean(name: str) -> float:
        return float(np.mean([np.mean(history(m, name)) for m in maneuvers]))

    names = maneuvers[0].record.group("effector")
    trim = {name: mean(name) for name in names}
    every_spin = rotor_spin(vehicle, names, trim)
    return LoopModel(
        vehicle=vehicle,
        velocity=np.array([mean(n) for n in "uvw"]),
        theta=mean("theta") if "state/theta" in maneuvers[0].record else 0.0,
        spin=rotor_spin(vehicle, effectors, trim),
        momentum=every_spin @ np.array(list(trim.values())),
        wrench=wrench,
        feedback=feedback,
        forward=forward,
        moving=np.concatenate([moving[:6], moving[[3, 4]]]),
    )

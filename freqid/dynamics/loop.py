"""Steady small motions of an aircraft under a control law with integral action, line by line.

``s E x = A x + B d`` of `freqid.dynamics.small_motion`, with effectors at ``d = K x + displaced``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex

LAW_POWERS = (-1, 0, 1)  # of s: integral, proportional and derivative action


def powers_of(s: NDArray[Any], exponents: tuple[int, ...] = LAW_POWERS) -> Complex:
    """Return powers of s, shape (exponent, ...)."""
    return np.array([s**k for k in exponents], dtype=np.complex128)


def law_on_lines(gains: Array, frequencies_hz: Array) -> Complex:
    """Return what a control law makes of the states, shape (line, n, 8).

    Parameters
    ----------
    gains : ndarray, shape (3, n, 8)
        Effector positions, or commands, per unit of each state: of its integral, of itself and of its
        derivative.
    frequencies_hz : ndarray, shape (line,)
        Not zero.
    """
    law = np.einsum("knx,kf->fnx", gains, powers_of(2j * np.pi * frequencies_hz))
    return np.asarray(law, dtype=np.complex128)


def steady_motion(
    E: Array,
    A: Array,
    feedback: Complex,
    displaced: Complex,
    frequencies_hz: Array,
    *,
    added: Complex | None = None,
    moving: NDArray[np.bool_] | None = None,
) -> Complex:
    """Return the steady response of the states, shape (8, line), by frequency; see `steady_motion_at`."""
    s = 2j * np.pi * frequencies_hz
    return steady_motion_at(E, A, feedback, displaced, s, added=added, moving=moving)


def steady_motion_at(
    E: Array,
    A: Array,
    feedback: Complex,
    displaced: Complex,
    s: NDArray[Any],
    *,
    added: Complex | None = None,
    moving: NDArray[np.bool_] | None = None,
) -> Complex:
    """Return the transform of the states, shape (8, line).

    Parameters
    ----------
    E, A : ndarray, shape (8, 8 + n)
        Of the states u v w p q r phi theta and of n effectors.
    feedback : ndarray of complex, shape (line, n, 8)
        From states to positions, actuators in between.
    displaced : ndarray of complex, shape (n, line)
        Added to positions, behind the law and the actuators.
    s : ndarray of complex, shape (line,)
        1/s.
    added : ndarray of complex, shape (6, line) or (8, line), optional
        Added loads, N and N m, and what is added to the rates of phi and theta.
    moving : ndarray of bool, shape (8,), optional
        States that take part, all by default; the others stay at rest.

    Notes
    -----
    ``(s E_x - A_x - (A_d - s E_d) K) x = (A_d - s E_d) displaced + added``
    """
    lines = s.size
    on, s = np.ones(8, dtype=bool) if moving is None else moving, s[:, None, None]
    control = (A[:, 8:] - s * E[:, 8:])[:, on]
    system = (s * E[:, :8] - A[:, :8])[:, on][:, :, on] - control @ feedback[:, :, on]
    pushed = control @ displaced.T[:, :, None]
    if added is not None:
        loads = np.zeros((8, lines), dtype=complex)
        loads[: len(added)] = added
        pushed = pushed + loads[on].T[:, :, None]
    motion = np.zeros((8, lines), dtype=complex)
    motion[on] = np.linalg.solve(system, pushed)[:, :, 0].T
    return motion

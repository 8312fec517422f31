"""Modes of motion: frequency, damping, and the usual name of each in flight mechanics.

References
----------
I. J. Perez-Arriaga, G. C. Verghese, F. C. Schweppe, "Selective Modal Analysis", *IEEE Trans. Power Apparatus
and Systems* 101, 1982 (participation factors).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

from freqid.core.arrays import Array

MOTION = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
"""States of a rigid vehicle about steady straight flight."""

_LONGITUDINAL = ("u", "w", "q", "theta")
_LATERAL = tuple(n for n in MOTION if n not in _LONGITUDINAL)
_REAL_MODES = {
    "u": "speed",
    "w": "heave",
    "q": "pitch",
    "theta": "pitch attitude",
    "v": "sideslip",
    "p": "roll",
    "r": "yaw",
    "phi": "spiral",
    "psi": "heading",
}
"""Name of a real eigenvalue by the state with the largest participation."""

_ZERO = 1e-6  # rad/s: an eigenvalue that is zero but for rounding, as that of the heading
_OSCILLATES = 1e-9  # imaginary part over size from which an eigenvalue is not real


@dataclass(frozen=True)
class Mode:
    """One real eigenvalue, or one complex pair.

    Attributes
    ----------
    name : str
    eigenvalue : complex
        rad/s; of a pair, the one with positive imaginary part.
    """

    name: str
    eigenvalue: complex

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, rad/s; of a real eigenvalue, its absolute value."""
        return abs(self.eigenvalue)

    @property
    def damping(self) -> float:
        """Damping ratio; 1 for a real eigenvalue that decays, -1 for one that grows, nan at zero."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size if size > _ZERO else float("nan")


def named_modes(A: Array, states: Sequence[str] = MOTION) -> tuple[Mode, ...]:
    """Return the modes of ``x' = A x``, named by the states that take part in them, fastest first.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    states : sequence of str, length n
        Names of x. Those in `MOTION` decide the mode's name. A mode in which other states, of controllers
        and actuators, have more than half of the participation is called "control".

    Returns
    -------
    tuple of Mode
        Names are unique: of several modes of one kind the slower ones are numbered.

    Notes
    -----
    The participation of state k in mode i is ``|W_ki V_ki|``, with left and right eigenvectors normalised to
    each other (Perez-Arriaga et al., 1982). It does not depend on the units of the states.
    """
    values, left, right = (np.array(x, dtype=np.complex128) for x in eig(A, left=True, right=True))
    scale = np.abs(np.sum(left.conj() * right, axis=0))
    participation = np.abs(left.conj() * right) / np.maximum(scale, 1e-300)
    participation = participation / np.maximum(participation.sum(axis=0), 1e-300)
    one_of_each = [i for i in np.argsort(-np.abs(values), kind="stable") if values[i].imag >= 0]
    seen: dict[str, int] = {}
    modes = []
    for i in one_of_each:
        name = _name(complex(values[i]), dict(zip(states, participation[:, i].tolist(), strict=True)))
        seen[name] = seen.get(name, 0) + 1
        modes.append(Mode(name if seen[name] == 1 else f"{name} {seen[name]}", complex(values[i])))
    return tuple(modes)


def _name(value: complex, participation: dict[str, float]) -> str:
    """Return the name of a mode from its eigenvalue and the participation of each state."""
    part = {name: participation.get(name, 0.0) for name in MOTION}
    if sum(part.values()) < 0.5 * sum(participation.values()):
        return "control"
    longitudinal = sum(part[n] for n in _LONGITUDINAL) > 0.5 * sum(part.values())
    if abs(value.imag) > _OSCILLATES * max(abs(value), _ZERO):
        if longitudinal:
            return "short period" if part["w"] + part["q"] > part["u"] + part["theta"] else "phugoid"
        yawing = part["v"] + part["r"] + part["psi"]
        return "Dutch roll" if yawing > part["p"] + part["phi"] else "roll oscillation"
    return _REAL_MODES[max(_LONGITUDINAL if longitudinal else _LATERAL, key=lambda n: part[n])]

"""Modes of motion: frequency, damping, and the name that a flight mechanic would give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

Array = NDArray[np.float64]

MOTION = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
_LONGITUDINAL = ("u", "w", "q", "theta")
_AT_REST = 1e-6  # rad/s: an eigenvalue that is zero but for rounding, as the heading's


@dataclass(frozen=True)
class Mode:
    """One real eigenvalue or one pair.

    Attributes
    ----------
    name : str
    eigenvalue : complex
        rad/s, the one with a positive imaginary part.
    """

    name: str
    eigenvalue: complex

    @property
    def frequency(self) -> float:
        """Undamped natural frequency, rad/s; the size of a real eigenvalue."""
        return abs(self.eigenvalue)

    @property
    def damping(self) -> float:
        """Ratio; 1 and -1 for real ones that decay and grow, nan for one at rest."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size if size > _AT_REST else float("nan")

    @property
    def time_to_double(self) -> float:
        """Seconds in which it doubles, negative where it halves in as many; infinite at rest."""
        growth = self.eigenvalue.real
        return float(np.log(2) / growth) if abs(growth) > _AT_REST else float("inf")


def named_modes(A: Array, states: Sequence[str] = MOTION) -> tuple[Mode, ...]:
    """Return the modes of ``x' = A x`` with names from what takes part in them, fastest first.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    states : sequence of str, length n
        Those of `MOTION` decide the names; the others, of controllers and actuators, are in modes that are
        called "control" where more than half of the participation is theirs.

    Returns
    -------
    tuple of Mode
        Names are unique: of several of one kind the slower ones are numbered.

    Notes
    -----
    Participation of state k in mode i is ``|W_ki V_ki|``, left and right eigenvectors normalised to each
    other: I. J. Perez-Arriaga, G. C. Verghese, F. C. Schweppe, "Selective Modal Analysis", IEEE Trans. Power
    Apparatus and Systems 101, 1982. It does not depend on the units of the states.
    """
    values, left, right = (np.array(x, dtype=np.complex128) for x in eig(A, left=True, right=True))
    scale = np.abs(np.sum(left.conj() * right, axis=0))
    share = np.abs(left.conj() * right) / np.maximum(scale, 1e-300)
    share = share / np.maximum(share.sum(axis=0), 1e-300)
    kept = [i for i in np.argsort(-np.abs(values), kind="stable") if values[i].imag >= 0]
    seen: dict[str, int] = {}
    modes = []
    for i in kept:
        part = {name: float(share[k, i]) for k, name in enumerate(states)}
        name = _name(complex(values[i]), part)
        seen[name] = seen.get(name, 0) + 1
        modes.append(Mode(name if seen[name] == 1 else f"{name} {seen[name]}", complex(values[i])))
    return tuple(modes)


def _name(value: complex, part: dict[str, float]) -> str:
    motion = {name: part.get(name, 0.0) for name in MOTION}
    if sum(motion.values()) < 0.5 * sum(part.values()):
        return "control"
    longitudinal = sum(motion[n] for n in _LONGITUDINAL)
    along = longitudinal > 0.5 * sum(motion.values())
    names = _LONGITUDINAL if along else tuple(n for n in MOTION if n not in _LONGITUDINAL)
    most = max(names, key=lambda n: motion[n])
    if abs(value.imag) > 1e-9 * max(abs(value), _AT_REST):
        if along:
            return "short period" if motion["w"] + motion["q"] > motion["u"] + motion["theta"] else "phugoid"
        rolling, yawing = motion["p"] + motion["phi"], motion["v"] + motion["r"] + motion["psi"]
        return "Dutch roll" if yawing > rolling else "roll oscillation"
    real = {"u": "speed", "w": "heave", "q": "pitch", "theta": "pitch attitude", "v": "sideslip"}
    real |= {"p": "roll", "r": "yaw", "phi": "spiral", "psi": "heading"}
    return real[most]

"""Stability margins of a loop that is broken at one place, from its frequency response alone.

References
----------
K. J. Astrom, R. M. Murray, *Feedback Systems*, 2nd ed., Princeton, 2021, sec. 10.3 (margins, delay margin).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Loop = Callable[[Array], Complex]

POINTS = 1500
"""Frequencies between which crossings are looked for; a resonance narrower than that may hide two."""

# The lowest frequency counts as none at all where a loop is as real as this there, and no integrator.
_REAL, _LARGEST = 1e-5, 1e4
_ALMOST_NONE = 1e-6  # of the lowest frequency


@dataclass(frozen=True)
class Margins:
    """How far a stable loop is from the limit of stability.

    Attributes
    ----------
    gain_up_db, gain_down_db : float
        Least increase and least decrease of the gain that end in instability, dB, both positive; infinite
        where none does.
    phase_deg : float
        Least turn of the loop, to either side, that does; infinite where the gain is never one.
    delay_s : float
        Least additional delay that does, s.
    crossover_hz : float
        Frequency of `phase_deg`; nan where the gain is never one.
    modulus : float
        Least distance of the loop from -1, over all frequencies.
    """

    gain_up_db: float
    gain_down_db: float
    phase_deg: float
    delay_s: float
    crossover_hz: float
    modulus: float


def loop_margins(loop: Loop, low: float, high: float, *, exact: bool = True, points: int = POINTS) -> Margins:
    """Return the margins of ``1 + loop``; they mean something where the closed loop is stable.

    Parameters
    ----------
    loop : callable
        ``loop(omega)``, omega in rad/s of shape (M,), negative feedback: -1 is the critical point.
    low, high : float
        Range of frequencies, rad/s.
    exact : bool
        False reads crossings off straight lines between the frequencies, for many systems in a hurry.
    points : int

    Returns
    -------
    Margins

    Notes
    -----
    Whatever the open loop's poles: as gain, phase or delay leave their nominal value, stability can only
    end where ``loop`` meets -1, so the nearest such point on either side is the margin.
    """
    omega = frequencies(low, high, points)
    return margins_of(omega, loop(omega), loop if exact else None)


def frequencies(low: float, high: float, points: int = POINTS) -> Array:
    """Return frequencies that margins can be read from, rad/s: a range, and one that is as good as zero."""
    return np.concatenate([[_ALMOST_NONE * low], np.geomspace(low, high, points)])


def margins_of(omega: Array, values: ArrayLike, loop: Loop | None = None) -> Margins:
    """Return the margins of a loop that is known at frequencies, rad/s; crossings refined where it is given.

    Parameters
    ----------
    omega : ndarray, shape (M,)
        rad/s, increasing.
    values : array_like of complex, shape (M,)
    loop : callable, optional
    """
    v = np.array(values, dtype=np.complex128)

    def crossings(of: Array, exact: Callable[[complex], float]) -> list[tuple[float, complex]]:
        found = []
        for i in np.flatnonzero(np.sign(of[:-1]) * np.sign(of[1:]) < 0):
            if loop is None:
                share = of[i] / (of[i] - of[i + 1])
                at = float(omega[i] * (omega[i + 1] / omega[i]) ** share)
                found.append((at, complex(v[i] + share * (v[i + 1] - v[i]))))
            else:
                at = float(
                    brentq(lambda w: exact(_one(loop, w)), omega[i], omega[i + 1], xtol=1e-12 * omega[i])  # pyright: ignore
                )
                found.append((at, _one(loop, at)))
        return found

    sideways: Array = np.imag(v)
    unity = crossings(np.log(np.abs(v)), lambda x: float(np.log(abs(x))))
    # a sign change of the imaginary part on the positive real axis is no crossing of the critical ray
    real = [x for _, x in crossings(sideways, lambda x: x.imag) if x.real < 0]
    if v[0].real < 0 and abs(v[0].imag) < _REAL * abs(v[0].real) < _REAL * _LARGEST:
        real.append(complex(v[0]))  # static gain of a loop that has no integrator
    up = [-20 * np.log10(-x.real) for x in real if x.real > -1]
    down = [20 * np.log10(-x.real) for x in real if x.real < -1]
    turn = [(abs(np.angle(-x)), w) for w, x in unity]
    late = [(np.angle(-x) % (2 * np.pi)) / w for w, x in unity]
    phase, at = min(turn, default=(np.inf, np.nan))
    return Margins(
        gain_up_db=float(min(up, default=np.inf)),
        gain_down_db=float(min(down, default=np.inf)),
        phase_deg=float(np.degrees(phase)),
        delay_s=float(min(late, default=np.inf)),
        crossover_hz=float(at / (2 * np.pi)),
        modulus=float(np.abs(1 + v).min()),
    )


def _one(loop: Loop, omega: float) -> complex:
    return complex(loop(np.array([omega]))[0])

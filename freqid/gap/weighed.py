"""How far one residual is smaller than another in the metric of noise and tolerances, and how sure that is.

The misfit of a simulation is its residual in the metric of a diagnosis, noise white and tolerances integrated
over their prior: Q = r' S^-1 r. Half the difference of two is the logarithm of their likelihood ratio, whose
variance makes a test of non-nested models. It is an inner product of what the two differ by and of the mean
of their residuals, so its variance has a closed form.

References
----------
Q. H. Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses", *Econometrica* 57, 1989;
F. X. Diebold, R. S. Mariano, "Comparing predictive accuracy", *Journal of Business & Economic Statistics* 13,
1995; R. L. Berger, "Multiparameter hypothesis testing and acceptance sampling", *Technometrics* 24, 1982
(intersection-union tests); S. Holm, "A simple sequentially rejective multiple test procedure", *Scandinavian
Journal of Statistics* 6, 1979.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNSTATED = 1.5
"""By which a difference is less certain than noise and stated tolerances make it.

Errors of a whole airframe are more than tolerances state: between LA-8 class airframes that were equally far
off, differences scattered by 1.3 times what noise and tolerances account for.
"""

_MOST = 8.0  # of a tolerance's power: scatter between two simulations has twice of it, and two sigma are kept


@dataclass(frozen=True)
class Weighed:
    """Two residuals in the metric of noise and tolerances.

    Attributes
    ----------
    count : int
        White numbers.
    squares : tuple of 2 floats
        ``r' S^-1 r`` of A and B.
    noise : tuple of 2 floats
        What noise alone makes of them.
    difference : float
        Of the explainable energies, squares less noise, A's less B's.
    deviation : float
        Standard deviation of the difference where the two are equally good.
    """

    count: int
    squares: tuple[float, float]
    noise: tuple[float, float]
    difference: float
    deviation: float


def weigh(
    a: Array,
    b: Array,
    allowed: Array,
    noise_a: Array,
    noise_b: Array,
    floor: Array,
    shared: tuple[Array, Array] | None = None,
) -> Weighed:
    """Return which of two residuals is smaller, and how far that can be trusted.

    Parameters
    ----------
    a, b : ndarray, shape (number,)
        Residuals as white numbers.
    allowed : ndarray, shape (tolerance, number)
        What tolerances may do to either, for one sigma.
    noise_a, noise_b : ndarray, shape (draw, number)
        What the same draws of the sensors' noise make of each.
    floor : ndarray, shape (draw, number)
        What all noise, turbulence too, makes of either.
    shared : tuple of 2 ndarray, shape (tolerance,), optional
        What noise of the flown states adds to the products of `allowed` with a and with b.

    Notes
    -----
    With d = a - b, m = (a + b) / 2 and S = 1 + T'T the difference of squares is 2 d' S^-1 m. Two things may
    make it without either simulation being nearer. Noise and tolerances in m, given d: variance 4 d' S^-1 d,
    where both share the errors that tolerances allow, as one simulation does with its next version. Errors
    that tolerances allow in d, given what the nearer one, r, still lacks: along directions of T, of length s
    and shrunk by 1 + s^2, variance 4 sum(min(d_j^2, 8 s_j^2) (r_j / (1 + s_j^2))^2), so that a gap that is in
    both does not turn scatter between them into a verdict. A difference has to stand out of each (an
    intersection-union test), the first deviation taken `UNSTATED` times. Noise of the flown states is in d
    and in m, which shifts the difference; draws tell by how much.
    """
    basis, power = _directions(allowed)
    shrink = power / (1 + power)

    def weighted(x: Array) -> Array:
        return x - ((x @ basis.T) * shrink) @ basis

    d = a - b
    turned = basis @ allowed.T / np.maximum(power, 1e-300)[:, None]
    common = shared or (np.zeros(len(allowed)), np.zeros(len(allowed)))
    on_a, on_b = (basis @ x - turned @ extra for x, extra in zip((a, b), common, strict=True))
    squares = tuple(float(x @ x - on**2 @ shrink) for x, on in ((a, on_a), (b, on_b)))
    between = on_a - on_b
    each = 2 * np.einsum("kn,kn->k", noise_a - noise_b, weighted((noise_a + noise_b) / 2))
    bias, scatter = (float(each.mean()), float(each.var() / each.size)) if each.size else (0.0, 0.0)
    difference = squares[0] - squares[1] - bias
    lacking = (on_b if difference > 0 else on_a) / (1 + power)
    given_d = float(d @ d - between**2 @ shrink)
    given_rest = float((np.minimum(between**2, _MOST * power) * lacking**2).sum())
    heard = float(np.einsum("kn,kn->", floor, weighted(floor)) / max(len(floor), 1))
    return Weighed(
        count=a.size,
        squares=(squares[0], squares[1]),
        noise=(heard + bias / 2, heard - bias / 2),
        difference=difference,
        deviation=float(np.sqrt(4 * max(UNSTATED**2 * given_d, given_rest, 0.0) + scatter)),
    )


def holm(p: Sequence[float]) -> Array:
    """Return p-values adjusted for the number of tests, by Holm's step-down procedure."""
    values = np.asarray(p, dtype=float)
    order = np.argsort(values)
    stepped = np.maximum.accumulate(values[order] * np.arange(values.size, 0, -1))
    found = np.empty(values.size)
    found[order] = np.minimum(stepped, 1.0)
    return found


def _directions(allowed: Array) -> tuple[Array, Array]:
    """Return orthonormal directions that tolerances move, shape (direction, number), and their power."""
    wide = allowed.shape[0] < allowed.shape[1]
    gram = allowed @ allowed.T if wide else allowed.T @ allowed
    power, vectors = np.linalg.eigh(gram)
    kept = power > 1e-10 * max(float(power[-1]) if power.size else 0.0, 1e-300)
    power, vectors = power[kept], vectors[:, kept]
    return ((vectors / np.sqrt(power)).T @ allowed if wide else vectors.T), power

"""End corrections that turn a plain sum of samples into an accurate Fourier integral."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import binom, roots_legendre


def fourier_end_weights(theta: ArrayLike, order: int) -> NDArray[np.complex128]:
    r"""Return the weights that correct a plain Fourier sum at its first samples.

    For samples `x[k] = x(k h)`, `k = 0..n-1`, and `theta = omega h` the integral over the record is

        integral / h = sum_k x[k] exp(-j theta k)
                     + sum_i w[i] x[i] + exp(-j theta (n-1)) sum_i conj(w[i]) x[n-1-i]

    exactly whenever x is a polynomial of degree `order` or less, whatever the frequency. Gregory's
    end weights are the case `theta = 0`; used at other frequencies they need `x exp(-j omega t)`
    to be smooth instead of x, which costs accuracy and forces high orders that amplify noise.

    Parameters
    ----------
    theta : array_like of float, shape (frequency,)
        Angle per sample omega h, rad, in [0, pi]; pi is the Nyquist frequency.
    order : int
        Highest difference used, >= 0; `order + 1` samples are corrected at each end.

    Returns
    -------
    weights : ndarray of complex, shape (order + 1, frequency)
        Weight of sample i counted from the end, on top of the 1 that the plain sum gives it.

    Notes
    -----
    With `z = exp(-j theta)` and x written in forward differences, one sampling interval gives
    `I_m = integral_0^1 C(s, m) exp(-j theta s) ds` for the m-th difference, C the binomial.
    Summing all intervals, `sum_k z^k (1 + D)^k = 1 / (1 - z - z D)`, and taking the plain sum
    away leaves `sum_m c_m D^m = (sum_m I_m D^m - 1) / (1 - z - z D)`, hence

        (1 - z) c_m - z c_(m-1) = I_m - [m = 0].

    Upwards the recursion divides by `1 - z`, downwards it multiplies by it, so each frequency takes
    the direction in which rounding errors shrink. At `theta = 0` it is Gregory's `c_(m-1) = -I_m`.

    References
    ----------
    Press et al., Numerical Recipes, 3rd ed., section 13.9 (the cubic member of this family);
    Morelli, NASA TM 110340, 1997 (the same for flight data); docs/theory/fourier.md.
    """
    theta = np.atleast_1d(np.asarray(theta, dtype=float))
    z = np.exp(-1j * theta)
    downwards = np.abs(1.0 - z) < 0.7
    top = order + 100  # downwards from c = 0: by the wanted order 0.7^100 = 3e-16 of that is left
    node, weight = roots_legendre(64)
    node, weight = (node + 1.0) / 2.0, weight / 2.0
    basis = binom(node, np.arange(top + 1)[:, None])
    cell = (basis * weight) @ np.exp(-1j * np.outer(node, theta))  # I_m, (m, frequency)
    cell[0] -= 1.0

    up = np.zeros((top + 1, theta.size), dtype=complex)
    down = np.zeros_like(up)
    divisor = np.where(downwards, 1.0, 1.0 - z)
    up[0] = cell[0] / divisor
    for m in range(1, order + 1):
        up[m] = (cell[m] + z * up[m - 1]) / divisor
    for m in range(top, 0, -1):
        down[m - 1] = np.where(downwards, ((1.0 - z) * down[m] - cell[m]) / z, 0.0)
    c = np.where(downwards, down, up)[: order + 1]

    # The m-th forward difference in terms of samples: (-1)^(m - i) C(m, i).
    m, i = np.arange(order + 1)[None, :], np.arange(order + 1)[:, None]
    return (((-1.0) ** (m - i) * binom(m, i)) @ c).astype(complex)

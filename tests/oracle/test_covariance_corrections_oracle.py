"""Covariance corrections against their definitions, by sums over all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.identify.regress.covariance_corrections import (
    correct_by_autocorrelation,
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import least_squares


def test_autocorrelation_correction_is_the_double_sum():
    """Cov = D [sum_ij R(i-j) x(i) x(j)^T] D with D = (X^T X)^-1 (Morelli & Klein 1997)."""
    rng = np.random.default_rng(21)
    n = 45
    x = rng.standard_normal((3, n)).cumsum(axis=1)
    z = rng.standard_normal((2, 3)) @ x + rng.standard_normal((2, n)).cumsum(axis=1)
    corrected = correct_by_autocorrelation(least_squares(x, z))
    inverse = np.linalg.inv(x @ x.T)
    for r in range(2):
        residual = z[r] - (inverse @ x @ z[r]) @ x
        autocorrelation = [sum(residual[i] * residual[i + k] for i in range(n - k)) / n for k in range(n)]
        middle = np.zeros((3, 3))
        for i in range(n):
            for j in range(n):
                middle += autocorrelation[abs(i - j)] * np.outer(x[:, i], x[:, j])
        np.testing.assert_allclose(corrected.covariance[r], inverse @ middle @ inverse, rtol=1e-8)


def plain_coloured(residual, dual, taken, count, spacing, half_width=2.0):
    """Covariance and degrees of freedom by loops over lines `spacing` (in 1/T) apart.

    `taken` is the share of each line's `count` equations that the fit took away.
    """
    n_lines, n = len(residual), len(dual)
    near = [[m for m in range(n_lines) if abs(m - i) * spacing <= half_width] for i in range(n_lines)]
    free = count - taken
    free_near = np.array([sum(free[m] for m in group) for group in near])
    assert (free_near > 0.25 * np.array([sum(count[m] for m in group) for group in near])).all()
    spectrum = np.array([sum(abs(residual[m]) ** 2 for m in near[i]) / free_near[i] for i in range(n_lines)])
    covariance = np.zeros((n, n))
    for i in range(n_lines):
        covariance += spectrum[i] * np.outer(dual[:, i], dual[:, i].conj()).real / spacing
    dof = np.empty(n)
    for j in range(n):
        # variance_j = sum over lines m of gain_m |residual_m|^2
        gain = [sum(abs(dual[j, i]) ** 2 / free_near[i] for i in near[m]) / spacing for m in range(n_lines)]
        mean = sum(gain[m] * spectrum[m] * free[m] for m in range(n_lines))
        # An estimate x of a chi-square mean with nu degrees of freedom has E x^2 = (1 + 2 / nu) (E x)^2;
        # nu = 2 mean^2 / scatter with both squares so corrected is solved for nu.
        square = [spectrum[m] ** 2 / (1 + 2 / (spacing * free_near[m])) for m in range(n_lines)]
        scatter = sum(2 * gain[m] ** 2 * square[m] * free[m] for m in range(n_lines)) / spacing
        dof[j] = 2 * mean**2 / scatter - 2
    return covariance, dof


@pytest.mark.parametrize("spacing", [0.5, 1.0])
def test_coloured_lines_by_loops(spacing):
    rng = np.random.default_rng(22)
    duration, n_lines = 20.0, 40
    lines = 0.1 + np.arange(n_lines) * spacing / duration
    phi = rng.standard_normal((3, n_lines)) + 1j * rng.standard_normal((3, n_lines))
    z = phi[:1] + (rng.standard_normal((2, n_lines)) + 1j * rng.standard_normal((2, n_lines))) / lines
    fit = least_squares(phi, z)
    corrected = correct_coloured_lines(fit, lines, duration)
    real = np.hstack([phi.real, phi.imag])
    hat = np.diag(real.T @ np.linalg.inv(real @ real.T) @ real)
    taken = (hat[:n_lines] + hat[n_lines:]) / spacing
    for r in range(2):
        covariance, dof = plain_coloured(fit.residual[r], fit.dual, taken, np.full(n_lines, 2.0), spacing)
        np.testing.assert_allclose(corrected.covariance[r], covariance, rtol=1e-8, atol=1e-14)
        np.testing.assert_allclose(corrected.degrees_of_freedom[r], dof, rtol=1e-8)


def test_coloured_samples_by_a_plain_transform():
    rng = np.random.default_rng(23)
    n = 60
    x = np.vstack([rng.standard_normal((2, n)).cumsum(axis=1), np.ones(n)])
    z = x[:1] + rng.standard_normal((1, n)).cumsum(axis=1)
    fit = least_squares(x, z)
    corrected = correct_coloured_samples(fit)

    padded = 120  # the next length of small factors after 2 n is 2 n
    kernel = np.exp(-2j * np.pi * np.outer(np.arange(n), np.arange(padded // 2 + 1)) / padded)
    count = np.r_[1.0, np.full(padded // 2 - 1, 2.0), 1.0]
    whitened = np.linalg.solve(np.linalg.cholesky(x @ x.T), x)  # orthonormal rows
    taken = count * (np.abs(whitened @ kernel) ** 2).sum(axis=0) / n
    covariance, dof = plain_coloured(
        np.sqrt(count / n) * (fit.residual[0] @ kernel),
        np.sqrt(count * n) / padded * (fit.dual @ kernel),
        taken,
        count,
        n / padded,
    )
    np.testing.assert_allclose(corrected.covariance[0], covariance, rtol=1e-8)
    np.testing.assert_allclose(corrected.degrees_of_freedom[0], dof, rtol=1e-8)


def test_line_spacing_correction_against_the_full_sinc_covariance():
    """White noise on lines 0.25/T apart: the factor against D K D^H with the sinc correlations K."""
    duration = 40.0
    lines = np.arange(0.05, 2.0, 0.25 / duration)
    time = np.arange(0.0, duration, 0.1)
    rng = np.random.default_rng(24)
    signals = np.sin(2 * np.pi * rng.uniform(0.3, 1.7, (4, 30, 1)) * time + rng.uniform(0, 6.28, (4, 30, 1)))
    phi = signals.sum(axis=1) @ np.exp(-2j * np.pi * time[:, None] * lines)
    z = rng.standard_normal((1, len(lines))) + 1j * rng.standard_normal((1, len(lines)))
    fit = least_squares(phi, z)
    apart = (lines[:, None] - lines) * duration
    correlation = np.sinc(apart) * np.exp(-1j * np.pi * apart)
    shape = (fit.dual.conj() @ correlation @ fit.dual.T).real

    corrected = correct_line_spacing(fit, lines, duration)
    sigma2 = fit.residual_square[0] / (2 * len(lines) - 4 / 0.25)
    np.testing.assert_allclose(np.diag(corrected.covariance[0]), sigma2 * np.diag(shape), rtol=0.03)
    assert corrected.degrees_of_freedom[0, 0] == pytest.approx(2 * len(lines) * 0.25 - 4)

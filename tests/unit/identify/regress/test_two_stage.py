"""Two-stage least squares against its textbook formula, and what it is for."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.identify.regress.regression import least_squares
from freqid.identify.regress.two_stage import WeakInstruments, two_stage_least_squares


def complex_normal(rng, *shape):
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


@pytest.fixture
def case():
    rng = np.random.default_rng(4)
    clean = complex_normal(rng, 3, 80)
    phi = clean + 0.4 * complex_normal(rng, 3, 80)
    instruments = np.array([[1, 0.2, 0], [0, 0.8, 0.1], [-0.3, 0, 1.2]]) @ clean
    instruments += 0.1 * complex_normal(rng, 3, 80)
    nuisance = np.array([np.ones(80), np.exp(-0.3j * np.arange(80))])
    z = np.array([[1.0, -2.0, 0.5], [0.0, 3.0, 1.0]]) @ clean + 0.2 * complex_normal(rng, 2, 80)
    return phi, z + nuisance[0] * 0.7, instruments, nuisance


def test_it_is_the_textbook_formula(case):
    phi, z, instruments, nuisance = case
    fit, _ = two_stage_least_squares(phi, z, instruments, nuisance=nuisance)
    columns, driven = np.concatenate([nuisance, phi]).T, np.concatenate([nuisance, instruments]).T

    def re(a, b):  # Re(a^H b)
        return a.real.T @ b.real + a.imag.T @ b.imag

    projected = driven @ np.linalg.solve(re(driven, driven), re(driven, columns))
    expected = np.linalg.solve(re(projected, columns), re(projected, z.T)).T
    np.testing.assert_allclose(fit.solution, expected, rtol=1e-10)
    residual = z - expected @ columns.T
    np.testing.assert_allclose(fit.residual, residual, atol=1e-12)
    variance = (np.abs(residual) ** 2).sum(axis=1) / (2 * 80 - 5)
    inverse = np.linalg.inv(re(projected, projected))
    np.testing.assert_allclose(fit.solution_covariance, variance[:, None, None] * inverse, rtol=1e-9)
    np.testing.assert_allclose(re(columns, fit.dual.T), np.eye(5), atol=1e-10)  # weights that find them
    assert fit.leverage.sum() == pytest.approx(5)


def test_regressors_that_are_their_own_instruments_make_least_squares(case):
    phi, z, _, nuisance = case
    fit, strength = two_stage_least_squares(phi, z, phi, nuisance=nuisance)
    plain = least_squares(phi, z, nuisance=nuisance)
    np.testing.assert_allclose(fit.solution, plain.solution, rtol=1e-10)
    np.testing.assert_allclose(fit.solution_covariance, plain.solution_covariance, rtol=1e-8)
    assert (strength > 1e20).all()


def test_the_scale_of_instruments_does_not_matter(case):
    phi, z, instruments, nuisance = case
    one, f_one = two_stage_least_squares(phi, z, instruments, nuisance=nuisance)
    other, f_other = two_stage_least_squares(
        phi, z, np.array([[1e6], [-1e-6], [3.0]]) * instruments, nuisance=nuisance
    )
    np.testing.assert_allclose(other.solution, one.solution, rtol=1e-9)
    np.testing.assert_allclose(f_other, f_one, rtol=1e-8)


def test_the_strength_of_one_instrument_is_the_f_of_the_textbook():
    rng = np.random.default_rng(5)
    z = rng.standard_normal((1, 200))
    x = 0.3 * z + rng.standard_normal((1, 200))
    _, strength = two_stage_least_squares(x, x, z)
    slope = (x @ z.T / (z @ z.T)).item()
    s2 = ((x - slope * z) ** 2).sum() / 199
    assert strength[0] == pytest.approx(slope**2 * (z @ z.T).item() / s2)


def test_noise_in_the_regressor_no_longer_shrinks_the_estimate():
    rng = np.random.default_rng(6)
    clean = complex_normal(rng, 1, 60)
    found = []
    for _ in range(400):
        phi = clean + 0.5 * complex_normal(rng, 1, 60)
        z = 2.0 * clean + 0.1 * complex_normal(rng, 1, 60)
        by_instruments, _ = two_stage_least_squares(phi, z, clean)
        found.append([least_squares(phi, z).estimate.item(), by_instruments.estimate.item()])
    plain, unbiased = np.mean(found, axis=0)
    assert plain == pytest.approx(2.0 / 1.25, rel=0.02)  # theta / (1 + 1 / SNR^2)
    scatter = np.std(found, axis=0)[1] / np.sqrt(400)
    assert abs(unbiased - 2.0) < 4 * scatter
    assert scatter < 0.01


def test_an_instrument_that_is_zero_is_named(case):
    phi, z, instruments, nuisance = case
    instruments = instruments * np.array([[1.0], [0.0], [1.0]])
    with pytest.raises(WeakInstruments, match=r"do not move regressor 'w'; drop it") as refused:
        two_stage_least_squares(phi, z, instruments, names=["u", "w", "q"], nuisance=nuisance)
    assert refused.value.weakest == "w"

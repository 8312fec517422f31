"""Complex least squares and its diagnostics against 50-digit arithmetic and slow direct definitions."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from freqid.identify.regress.regression import least_squares


def complex_noise(rng, *shape):
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def exact_complex_least_squares(phi: np.ndarray, z: np.ndarray):
    """Solve Re(Phi^H Phi) theta = Re(Phi^H z) at 50 digits; return estimates and standard errors."""
    with mpmath.workdps(50):
        columns = [[mpmath.mpc(value) for value in row] for row in phi]
        response = [mpmath.mpc(value) for value in z]
        n, m = phi.shape
        normal = mpmath.matrix(n, n)
        right = mpmath.matrix(n, 1)
        for i in range(n):
            right[i] = mpmath.re(sum(mpmath.conj(columns[i][k]) * response[k] for k in range(m)))
            for j in range(n):
                normal[i, j] = mpmath.re(sum(mpmath.conj(columns[i][k]) * columns[j][k] for k in range(m)))
        inverse = normal**-1
        theta = inverse * right
        error = [response[k] - sum(theta[i] * columns[i][k] for i in range(n)) for k in range(m)]
        variance = sum(abs(e) ** 2 for e in error) / (2 * m - n)
        std_error = [mpmath.sqrt(variance * inverse[i, i]) for i in range(n)]
        return np.array([float(x) for x in theta]), np.array([float(s) for s in std_error])


@pytest.fixture(scope="module")
def ill_conditioned():
    """Five regressors of very different size, two of them equal to one part in a million."""
    rng = np.random.default_rng(11)
    phi = complex_noise(rng, 5, 14)
    phi[4] = phi[0] + 1e-6 * complex_noise(rng, 14)
    phi *= np.array([1.0, 1e4, 1e-3, 30.0, 1.0])[:, None]
    z = np.array([2.0, 1e-4, -5e2, 0.1, -1.0]) @ phi + 1e-3 * complex_noise(rng, 14)
    return phi, z[None]


def test_ill_conditioned_complex_problem_at_fifty_digits(ill_conditioned):
    phi, z = ill_conditioned
    theta, std_error = exact_complex_least_squares(phi, z[0])
    fit = least_squares(phi, z)
    assert 1e6 < fit.collinearity.condition_number < 1e7

    error = np.abs(fit.estimate[0] - theta) / np.abs(theta)
    assert error.max() < 1e-9  # condition number times rounding, 2e6 x 2e-16
    np.testing.assert_allclose(fit.std_error[0], std_error, rtol=1e-8)

    # Squaring the condition number shows: the same equations solved through the normal matrix.
    normal = np.linalg.solve((phi.conj() @ phi.T).real, (phi.conj() @ z[0]).real)
    assert np.abs(normal / theta - 1).max() > 100 * error.max()


def test_imaginary_parts_decide_the_answer():
    rng = np.random.default_rng(12)
    phi = complex_noise(rng, 3, 20)
    z = (np.array([[1.0, -2.0, 0.5]]) @ phi).real + 1j * (np.array([[-3.0, 1.0, 4.0]]) @ phi).imag
    theta, std_error = exact_complex_least_squares(phi, z[0])
    fit = least_squares(phi, z)
    np.testing.assert_allclose(fit.estimate[0], theta, rtol=1e-12)
    np.testing.assert_allclose(fit.std_error[0], std_error, rtol=1e-12)

    real_only = least_squares(phi.real, z.real).estimate[0]
    np.testing.assert_allclose(real_only, [1.0, -2.0, 0.5], rtol=1e-10)
    assert np.abs(fit.estimate[0] - real_only).min() > 0.5


def test_parameters_stay_real_where_complex_ones_would_fit_better():
    """A phase shift of the response cannot be taken up: theta is the real part of the complex estimate."""
    rng = np.random.default_rng(13)
    phi = complex_noise(rng, 1, 50)
    fit = least_squares(phi, np.exp(0.5j) * phi)
    np.testing.assert_allclose(fit.estimate, [[np.cos(0.5)]], rtol=1e-13)
    np.testing.assert_allclose(fit.r2, [np.cos(0.5) ** 2], rtol=1e-12)


@pytest.fixture(scope="module", params=["lines", "samples"])
def problem(request):
    """Two responses, four correlated regressors and a nuisance column, complex or real."""
    rng = np.random.default_rng(14)
    noise = complex_noise if request.param == "lines" else lambda rng, *shape: rng.standard_normal(shape)
    phi = noise(rng, 4, 40)
    phi[3] += 3 * phi[0]
    if request.param == "lines":
        nuisance = np.exp(-0.3j * np.arange(40))[None]
    else:
        nuisance, phi = np.ones((1, 40)), phi + 2.0
    z = rng.standard_normal((2, 4)) @ phi + 1.5 * nuisance + 0.5 * noise(rng, 2, 40)
    return phi, nuisance, z


def stacked(table: np.ndarray) -> np.ndarray:
    return np.hstack([table.real, table.imag]) if np.iscomplexobj(table) else table


def squared_residual(columns: np.ndarray, z: np.ndarray) -> float:
    """Residual square of a plain least-squares fit, by numpy's SVD solver."""
    theta = np.linalg.lstsq(columns.T, z, rcond=None)[0]
    return float(np.sum((z - theta @ columns) ** 2))


def test_estimates_covariance_and_fit_measures(problem):
    phi, nuisance, z = problem
    fit = least_squares(phi, z, nuisance=nuisance)
    columns, n_equations = np.vstack([stacked(phi), stacked(nuisance)]), stacked(z).shape[1]
    inverse = np.linalg.inv(columns @ columns.T)
    for r in range(2):
        y = stacked(z)[r]
        theta = inverse @ columns @ y
        square = np.sum((y - theta @ columns) ** 2)
        total = squared_residual(stacked(nuisance), y)  # of samples: about the mean
        np.testing.assert_allclose(fit.estimate[r], theta[:4], rtol=1e-10)
        np.testing.assert_allclose(fit.nuisance_estimate[r], theta[4:], rtol=1e-10)
        covariance = square / (n_equations - 5) * inverse
        np.testing.assert_allclose(fit.covariance[r], covariance[:4, :4], rtol=1e-9, atol=1e-14)
        np.testing.assert_allclose(fit.nuisance_std_error[r] ** 2, [covariance[4, 4]], rtol=1e-10)
        for i in range(4):
            for j in range(4):
                rho = covariance[i, j] / np.sqrt(covariance[i, i] * covariance[j, j])
                assert fit.correlation[r, i, j] == pytest.approx(rho, rel=1e-9, abs=1e-12)
        assert fit.r2[r] == pytest.approx(1 - square / total, rel=1e-12)
        assert fit.fit_error[r] == pytest.approx(np.sqrt(square / (n_equations - 5)), rel=1e-12)
        expected_pse = square / n_equations + (total / n_equations) * 5 / n_equations
        assert fit.pse[r] == pytest.approx(expected_pse, rel=1e-12)
        np.testing.assert_allclose(fit.t_statistic[r] ** 2, theta[:4] ** 2 / np.diag(covariance)[:4])


def test_r2_of_samples_is_about_the_mean_and_of_lines_is_not():
    """A constant among the regressors is no merit of theirs; lines have no mean to speak of."""
    rng = np.random.default_rng(15)
    x = np.vstack([rng.standard_normal(60), np.ones(60)])
    z = x[:1] + 7.0 + rng.standard_normal((1, 60))
    fit = least_squares(x, z)
    square, about_mean = squared_residual(x, z[0]), np.sum((z - z.mean()) ** 2)
    np.testing.assert_allclose(fit.r2, [1 - square / about_mean], rtol=1e-12)
    np.testing.assert_allclose(fit.pse, [square / 60 + about_mean / 60 * 2 / 60], rtol=1e-12)

    fit = least_squares(x + 0j, z)
    np.testing.assert_allclose(fit.r2, [1 - square / np.sum(z**2)], rtol=1e-12)


def test_intervals_are_students(problem):
    from scipy.stats import t

    phi, nuisance, z = problem
    fit = least_squares(phi, z, nuisance=nuisance)
    low, high = fit.interval(0.9)
    dof = stacked(z).shape[1] - 5
    for r in range(2):
        for j in range(4):
            expected = t.interval(0.9, dof, loc=fit.estimate[r, j], scale=fit.std_error[r, j])
            np.testing.assert_allclose([low[r, j], high[r, j]], expected, rtol=1e-10)


def test_variance_inflation_is_one_over_one_minus_r2(problem):
    phi, nuisance, z = problem
    fit = least_squares(phi, z, nuisance=nuisance)
    rows, extra = stacked(phi), stacked(nuisance)
    for j in range(4):
        others = np.vstack([np.delete(rows, j, axis=0), extra])
        r2 = 1 - squared_residual(others, rows[j]) / squared_residual(extra, rows[j])
        assert fit.variance_inflation[j] == pytest.approx(1 / (1 - r2), rel=1e-9)
    assert fit.variance_inflation[0] > 5  # by construction
    assert fit.variance_inflation[1] < 2


def test_condition_indices_and_variance_proportions(problem):
    """Belsley's definitions from the eigenvectors of the scaled normal matrix."""
    phi, nuisance, z = problem
    fit = least_squares(phi, z, nuisance=nuisance)
    columns = np.vstack([stacked(nuisance), stacked(phi)])
    columns = columns / np.linalg.norm(columns, axis=1)[:, None]
    values, vectors = np.linalg.eigh(columns @ columns.T)
    order = np.argsort(values)[::-1]
    values, vectors = values[order], vectors[:, order]
    np.testing.assert_allclose(fit.collinearity.condition_index, np.sqrt(values[0] / values), rtol=1e-9)
    for j in range(5):
        parts = [vectors[j, k] ** 2 / values[k] for k in range(5)]
        for k in range(5):
            share = fit.collinearity.proportion[k, j]
            assert share == pytest.approx(parts[k] / sum(parts), rel=1e-8, abs=1e-12)


def test_dual_and_leverage(problem):
    """The dual makes the estimates; the leverage is the diagonal of the hat matrix."""
    phi, nuisance, z = problem
    fit = least_squares(phi, z, nuisance=nuisance)
    np.testing.assert_allclose((z @ fit.dual.conj().T).real, fit.solution, rtol=1e-10)
    columns = np.vstack([stacked(nuisance), stacked(phi)])
    hat = np.diag(columns.T @ np.linalg.inv(columns @ columns.T) @ columns)
    hat = hat.reshape(-1, 40).sum(axis=0)  # both equations of a line
    np.testing.assert_allclose(fit.leverage, hat, rtol=1e-9)

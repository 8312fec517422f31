"""What least squares promises besides its numbers: shapes, names and clear refusals."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.identify.regress.regression import least_squares


@pytest.fixture
def phi():
    rng = np.random.default_rng(1)
    return rng.standard_normal((3, 30)) + 1j * rng.standard_normal((3, 30))


def respond(phi, n=2):
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((n, phi.shape[1])) + 1j * rng.standard_normal((n, phi.shape[1]))
    return rng.standard_normal((n, len(phi))) @ phi + noise


def test_shapes_and_names(phi):
    ends = np.array([np.ones(30), np.exp(-0.1j * np.arange(30))])
    fit = least_squares(
        phi,
        respond(phi),
        names=["u", "w", "q"],
        response_names=["X", "Z"],
        nuisance=ends,
        nuisance_names=["start", "end"],
    )
    assert (fit.names, fit.nuisance_names, fit.response_names) == (
        ("u", "w", "q"),
        ("start", "end"),
        ("X", "Z"),
    )
    assert fit.estimate.shape == fit.std_error.shape == fit.t_statistic.shape == (2, 3)
    assert fit.nuisance_estimate.shape == fit.nuisance_std_error.shape == (2, 2)
    assert fit.covariance.shape == fit.correlation.shape == (2, 3, 3)
    assert fit.r2.shape == fit.pse.shape == fit.fit_error.shape == (2,)
    assert fit.variance_inflation.shape == (3,)
    assert [limit.shape for limit in fit.interval()] == [(2, 3), (2, 3)]
    assert fit.collinearity.names == ("start", "end", "u", "w", "q")
    assert fit.equations == 60


def test_noiseless_truth_comes_back_with_end_terms(phi):
    ends = np.array([np.ones(30), np.exp(-0.1j * np.arange(30))])
    truth, end_values = np.array([[1.0, -2.0, 3.0]]), np.array([[0.7, -0.4]])
    fit = least_squares(phi, truth @ phi + end_values @ ends, nuisance=ends)
    np.testing.assert_allclose(fit.estimate, truth, rtol=1e-12)
    np.testing.assert_allclose(fit.nuisance_estimate, end_values, rtol=1e-12)


def test_each_response_is_fitted_as_if_alone(phi):
    z = respond(phi, 3)
    together = least_squares(phi, z)
    for r in range(3):
        alone = least_squares(phi, z[[r]])
        np.testing.assert_allclose(together.estimate[r], alone.estimate[0], rtol=1e-12)
        np.testing.assert_allclose(together.covariance[r], alone.covariance[0], rtol=1e-10)


def test_units_of_a_regressor_do_not_matter(phi):
    scale = np.array([1e9, 1.0, 1e-9])
    plain, scaled = (least_squares(p, respond(phi)) for p in (phi, phi * scale[:, None]))
    np.testing.assert_allclose(scaled.estimate * scale, plain.estimate, rtol=1e-12)
    np.testing.assert_allclose(scaled.t_statistic, plain.t_statistic, rtol=1e-10)
    assert scaled.collinearity.condition_number == pytest.approx(plain.collinearity.condition_number)


def test_a_real_response_on_complex_regressors_is_complex_data(phi):
    """A list of integers is a response too, and its imaginary parts are zero, not absent."""
    fit = least_squares(phi, [list(range(30))])
    assert fit.equations == 60


def test_a_response_that_is_zero_is_fitted_by_zeros_without_warnings(phi):
    fit = least_squares(phi, np.zeros((1, 30)))
    np.testing.assert_array_equal(fit.estimate, 0.0)
    np.testing.assert_array_equal(fit.std_error, 0.0)
    assert np.isnan(fit.r2).all()
    assert np.isnan(fit.correlation).all()
    assert np.isnan(fit.t_statistic).all()


def test_perfectly_collinear_pair_is_named(phi):
    phi[2] = -4.0 * phi[0]
    with pytest.raises(DataError, match="'n1' and 'n3' are perfectly collinear") as caught:
        least_squares(phi, respond(phi), names=["n1", "n2", "n3"])
    assert "n2" not in str(caught.value)


def test_constant_samples_beside_a_constant_are_named():
    rng = np.random.default_rng(3)
    samples = np.vstack([rng.standard_normal(50), np.full(50, 0.3)])
    with pytest.raises(DataError, match="'bias' and 'tilt' are perfectly collinear"):
        least_squares(
            samples, samples[:1], names=["q", "tilt"], nuisance=np.ones((1, 50)), nuisance_names=["bias"]
        )


def test_zero_regressor_is_named(phi):
    phi[1] = 0.0
    with pytest.raises(DataError, match="regressor 'de2' is zero throughout"):
        least_squares(phi, respond(phi), names=["de1", "de2", "de3"])


@pytest.mark.parametrize("bad", [np.nan, np.inf, complex(0.0, np.nan)])
def test_nonfinite_channel_is_named(phi, bad):
    z = respond(phi)
    broken = z.copy()
    broken[1, 7] = bad
    with pytest.raises(DataError, match="response 'Z' has 1 of 30 values that are not finite"):
        least_squares(phi, broken, response_names=["X", "Z"])
    phi[2, 4] = bad
    with pytest.raises(DataError, match="regressor 'q' has 1 of 30"):
        least_squares(phi, z, names=["u", "w", "q"])


def test_more_regressors_than_twice_the_lines():
    rng = np.random.default_rng(4)
    phi = rng.standard_normal((21, 10)) + 1j * rng.standard_normal((21, 10))
    with pytest.raises(
        DataError, match=r"21 regressors .* more than 21 real equations, but 10 lines give 20"
    ):
        least_squares(phi, phi[:1])
    with pytest.raises(DataError, match="need more than 20 real equations"):  # exact fit, no residual
        least_squares(phi[:20], phi[20:])
    assert least_squares(phi[:19], phi[20:]).degrees_of_freedom[0, 0] == 1


def test_disagreeing_shapes_and_names(phi):
    z = respond(phi)
    with pytest.raises(UsageError, match="differ in their number of lines"):
        least_squares(phi, z[:, :-1])
    with pytest.raises(UsageError, match="3 regressors came with 2 names"):
        least_squares(phi, z, names=["u", "w"])
    with pytest.raises(UsageError, match="'u' is named twice"):
        least_squares(phi, z, names=["u", "w", "u"])
    with pytest.raises(UsageError, match=r"shape \(channel, line\), found 1"):
        least_squares(phi, z[0])

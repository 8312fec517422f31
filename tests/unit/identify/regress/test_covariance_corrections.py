"""Corrections keep the estimates, meet each other where they should, and refuse what they cannot do."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.identify.regress.covariance_corrections import (
    correct_by_autocorrelation,
    correct_coloured_lines,
    correct_coloured_samples,
    correct_line_spacing,
)
from freqid.identify.regress.regression import least_squares


def lines_fit(n=4, n_lines=60, n_nuisance=0):
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((n + n_nuisance + 2, n_lines)) + 1j * rng.standard_normal(
        (n + n_nuisance + 2, n_lines)
    )
    return least_squares(rows[:n], rows[-2:], nuisance=rows[n:-2] if n_nuisance else None)


def samples_fit(n_samples=200):
    rng = np.random.default_rng(2)
    return least_squares(rng.standard_normal((3, n_samples)), rng.standard_normal((2, n_samples)))


def test_only_covariance_and_freedom_change():
    fit, lines = lines_fit(n_nuisance=2), np.arange(60) / 40.0
    for corrected in (correct_line_spacing(fit, lines, 20.0), correct_coloured_lines(fit, lines, 20.0)):
        np.testing.assert_array_equal(corrected.estimate, fit.estimate)
        np.testing.assert_array_equal(corrected.residual, fit.residual)
        assert corrected.covariance.shape == fit.covariance.shape
        assert (corrected.degrees_of_freedom < fit.degrees_of_freedom).all()
        assert (corrected.nuisance_std_error != fit.nuisance_std_error).all()


def test_harmonics_need_no_line_correction():
    fit = lines_fit()
    for spacing in (1.0, 3.0):
        corrected = correct_line_spacing(fit, np.arange(60) * spacing / 20.0, 20.0)
        np.testing.assert_allclose(corrected.covariance, fit.covariance, rtol=1e-12)
        np.testing.assert_allclose(corrected.degrees_of_freedom, fit.degrees_of_freedom)


def test_one_wide_window_assumes_white_residuals():
    """A window over all lines makes the spectrum flat: the white covariance comes back."""
    fit, lines = lines_fit(), np.arange(60) / 20.0
    flat = correct_coloured_lines(fit, lines, 20.0, half_width=1000.0)
    np.testing.assert_allclose(flat.covariance, fit.covariance, rtol=1e-10)
    np.testing.assert_allclose(flat.degrees_of_freedom, fit.degrees_of_freedom, rtol=1e-9)
    dense = np.arange(60) * 0.3 / 20.0
    flat = correct_coloured_lines(fit, dense, 20.0, half_width=1000.0)
    spaced = correct_line_spacing(fit, dense, 20.0)
    np.testing.assert_allclose(flat.covariance, spaced.covariance, rtol=1e-9)
    np.testing.assert_allclose(flat.degrees_of_freedom, spaced.degrees_of_freedom, rtol=1e-9)
    samples = samples_fit()
    np.testing.assert_allclose(
        correct_coloured_samples(samples, half_width=1000.0).covariance, samples.covariance, rtol=1e-9
    )


def test_window_widens_where_parameters_take_all_equations():
    """Six parameters live on three lines: those lines' own residuals are no measure of the noise."""
    rng = np.random.default_rng(3)
    rows = 1e-6 * (rng.standard_normal((6, 60)) + 1j * rng.standard_normal((6, 60)))
    rows[:, 20:23] += rng.standard_normal((6, 3)) + 1j * rng.standard_normal((6, 3))
    z = rng.standard_normal((1, 60)) + 1j * rng.standard_normal((1, 60))
    fit = least_squares(rows[:6], z)
    corrected = correct_coloured_lines(fit, np.arange(60) / 20.0, 20.0, half_width=0.5)
    assert fit.leverage[20:23].min() > 1.99
    np.testing.assert_allclose(corrected.std_error / fit.std_error, 1.0, atol=0.6)
    assert (corrected.degrees_of_freedom < fit.degrees_of_freedom / 2).all()

    dense = correct_coloured_lines(fit, np.arange(60) * 0.5 / 20.0, 20.0, half_width=0.5)
    np.testing.assert_allclose(dense.std_error / fit.std_error, np.sqrt(2.0), atol=0.6)
    assert (dense.degrees_of_freedom > 0).all()


def test_more_columns_than_independent_equations():
    fit, lines = lines_fit(n=21), np.arange(60) * 0.1 / 20.0
    with pytest.raises(
        DataError, match=r"120 real equations worth 12\.0 independent ones, not enough for 21"
    ):
        correct_line_spacing(fit, lines, 20.0)
    with pytest.raises(DataError, match="21 columns leave too little of the residual free"):
        correct_coloured_lines(fit, lines, 20.0)


def test_lines_and_samples_are_not_mixed_up():
    with pytest.raises(UsageError, match="on complex lines"):
        correct_coloured_samples(lines_fit())
    with pytest.raises(UsageError, match="on complex lines"):
        correct_by_autocorrelation(lines_fit())
    with pytest.raises(UsageError, match="on real samples"):
        correct_line_spacing(samples_fit(), np.arange(200.0), 1.0)
    with pytest.raises(UsageError, match="60 ascending frequencies"):
        correct_coloured_lines(lines_fit(), np.arange(59) / 20.0, 20.0)
    with pytest.raises(UsageError, match="60 ascending frequencies"):
        correct_coloured_lines(lines_fit(), np.arange(60)[::-1] / 20.0, 20.0)


@pytest.mark.parametrize("n_samples", [200, 201])
def test_white_samples_are_hardly_changed(n_samples):
    """Even and odd lengths; with white residuals the coloured estimate is a noisy copy of the white one."""
    fit = samples_fit(n_samples)
    for corrected in (correct_coloured_samples(fit), correct_by_autocorrelation(fit)):
        np.testing.assert_allclose(corrected.std_error / fit.std_error, 1.0, atol=0.3)

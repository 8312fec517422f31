"""Equation error on the Twin Otter's flight f1_017 against the author's stored results (K&M ex. 5.1, 7.1).

Reads the file and integrates the transforms on its own, so that only the regression is on trial.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.io import loadmat

from freqid.identify.regress.covariance_corrections import correct_by_autocorrelation
from freqid.identify.regress.regression import least_squares

DT = 0.02
RESPONSES = {"CY": 62, "Cl": 64, "Cn": 66}
COLUMNS = {"CY": [0, 2, 4, 5], "Cl": [0, 1, 2, 3, 4, 5], "Cn": [0, 1, 2, 3, 4, 5]}


@pytest.fixture(scope="module")
def flight(shared_data):
    table = loadmat(shared_data / "sidpac" / "totter_f1_017_data.mat")["fdata"].T
    beta, aileron, rudder = np.deg2rad(table[[2, 14, 15]])
    regressors = np.array([beta, table[70], table[72], aileron, rudder, np.ones_like(beta)])
    return regressors, {name: table[[column - 1]] for name, column in RESPONSES.items()}


@pytest.fixture(scope="module")
def reference(shared_data):
    stored = json.loads((shared_data / "sidpac" / "reference_values.json").read_text())
    return {key[:5]: value for key, value in stored.items() if "_equation_error_TwinOtter_f1_017" in key}


@pytest.mark.parametrize("response", RESPONSES)
def test_time_domain_estimates_and_coloured_standard_errors(flight, reference, response):
    regressors, responses = flight
    fit = least_squares(regressors[COLUMNS[response]], responses[response])
    stored = reference["ex5.1"]

    np.testing.assert_allclose(fit.estimate[0], stored[response], rtol=1e-6)
    coloured = correct_by_autocorrelation(fit)
    np.testing.assert_allclose(coloured.std_error[0], stored[f"se_colored_{response}"], rtol=1e-6)
    np.testing.assert_array_equal(coloured.estimate, fit.estimate)


def test_time_domain_white_standard_errors(flight, reference):
    regressors, responses = flight
    fit = least_squares(regressors, responses["Cn"])
    np.testing.assert_allclose(fit.std_error[0], reference["ex5.1"]["se_white_Cn"], rtol=1e-6)


def test_coloured_residuals_triple_the_white_standard_errors(flight):
    regressors, responses = flight
    fit = least_squares(regressors, responses["Cn"])
    ratio = correct_by_autocorrelation(fit).std_error[0] / fit.std_error[0]
    assert ratio.min() > 2.5
    assert np.median(ratio) == pytest.approx(3.0, abs=0.2)


def _finite_fourier_integral(signal: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Integrate the signal less the line through its end points, by a spline on a ten times finer grid."""
    time = np.arange(signal.shape[-1]) * DT
    ends = signal[:, [0]] + (signal[:, [-1]] - signal[:, [0]]) * time / time[-1]
    fine = np.linspace(0.0, time[-1], 10 * (len(time) - 1) + 1)
    weights = np.full(len(fine), DT / 10)
    weights[[0, -1]] /= 2
    kernel = np.exp(-2j * np.pi * fine[:, None] * lines)
    return (CubicSpline(time, signal - ends, axis=1)(fine) * weights) @ kernel


@pytest.mark.parametrize("response", RESPONSES)
def test_frequency_domain_estimates_and_standard_errors(flight, reference, response):
    regressors, responses = flight
    lines = np.arange(0.1, 1.501, 0.02)
    phi = np.vstack([_finite_fourier_integral(regressors[:5], lines), np.ones(len(lines))])
    fit = least_squares(
        phi[COLUMNS[response]], _finite_fourier_integral(responses[response], lines), names=COLUMNS[response]
    )
    stored = reference["ex7.1"]
    n_lines, n = len(lines), len(COLUMNS[response])

    np.testing.assert_allclose(fit.estimate[0, :-1], stored[response][:-1], rtol=1e-4)
    np.testing.assert_allclose(fit.estimate[0, -1], stored[response][-1], rtol=1e-3)  # the bias
    # The stored standard errors count complex equations, M - n, where each is two real ones, 2M - n.
    theirs = fit.std_error[0] * np.sqrt((2 * n_lines - n) / (n_lines - n))
    np.testing.assert_allclose(theirs, stored[f"se_{response}"], rtol=1e-4)

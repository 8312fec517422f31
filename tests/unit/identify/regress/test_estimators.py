"""Instruments and least squares side by side: where they may differ by chance, and weak instruments."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.sections.estimators import ESTIMATOR_NAMES
from freqid.identify.regress.covariance_corrections import correct_coloured_lines, correct_line_spacing
from freqid.identify.regress.estimators import Regression, estimators, find_estimator
from freqid.identify.regress.two_stage import WeakInstruments

LINES = np.arange(3, 63) / 30.0


def fitted(x, z, instruments, correct=correct_coloured_lines):
    regression = Regression(
        x=x,
        z=z,
        names=["u", "w", "q"],
        response_names=[f"response {r}" for r in range(len(z))],
        nuisance=np.empty((0, x.shape[1])),
        nuisance_names=[],
        instruments=instruments,
        correct=lambda fit: correct(fit, LINES, 30.0),
        independent=1.0,
        confidence=0.95,
    )
    return find_estimator("least-squares" if instruments is None else "instruments").fit(regression)


def complex_normal(rng, *shape):
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


@pytest.mark.parametrize("correct", [correct_coloured_lines, correct_line_spacing])
def test_without_noise_in_regressors_the_difference_is_what_it_is_said_to_be(correct):
    rng = np.random.default_rng(0)
    x = complex_normal(rng, 3, 60)
    instruments = x + 0.5 * complex_normal(rng, 3, 60)
    theta = np.array([1.0, -2.0, 0.5])
    z = theta @ x + 0.3 * complex_normal(rng, 2000, 60)  # 2000 flights at once
    found = fitted(x, z, instruments, correct)
    difference = np.array(
        [
            (e - b.estimate) / b.difference_std_error
            for e, b in zip(found.fit.estimate, found.errors_in_variables, strict=True)
        ]
    )
    # Student's t of 57 or so degrees of freedom has a standard deviation of 1.02.
    np.testing.assert_allclose(difference.std(axis=0), 1.03, atol=0.06)
    critical = np.array([b.critical for b in found.errors_in_variables])
    anywhere = (np.abs(difference) > critical).any(axis=1).mean()
    assert 0.02 < anywhere < 0.07  # 5 % by Bonferroni's bound, a little less in truth


def test_noise_in_a_regressor_is_told_apart():
    rng = np.random.default_rng(1)
    clean = complex_normal(rng, 3, 60)
    x = clean + np.array([[0.5], [0.0], [0.0]]) * complex_normal(rng, 3, 60)
    z = np.array([[1.0, -2.0, 0.5]]) @ clean + 0.05 * complex_normal(rng, 1, 60)
    found = fitted(x, z, clean)
    (beside,) = found.errors_in_variables
    apart = (found.fit.estimate[0] - beside.estimate) / beside.difference_std_error
    assert abs(apart[0]) > beside.critical[0]
    assert beside.estimate[0] == pytest.approx(1 / 1.25, abs=0.1)
    assert found.fit.estimate[0, 0] == pytest.approx(1.0, abs=4 * found.fit.std_error[0, 0])


def test_a_regressor_that_the_signals_hardly_move_is_refused_by_name():
    rng = np.random.default_rng(2)
    instruments = complex_normal(rng, 3, 60)
    x = instruments + 0.1 * complex_normal(rng, 3, 60)
    x[1] = complex_normal(rng, 60)  # has nothing to do with its instrument
    with pytest.raises(WeakInstruments, match=r"hardly move 'w' \(first-stage F [0-9.]+\) apart") as refused:
        fitted(x, complex_normal(rng, 1, 60), instruments)
    assert refused.value.weakest == "w"


def test_without_instruments_there_is_nothing_beside():
    rng = np.random.default_rng(3)
    found = fitted(complex_normal(rng, 3, 60), complex_normal(rng, 2, 60), None)
    assert found.errors_in_variables == (None, None)


def test_every_name_that_a_scenario_may_write_is_an_estimator():
    assert set(estimators()) == set(ESTIMATOR_NAMES)
    assert [n for n, e in estimators().items() if e.needs_instruments] == ["instruments"]
    with pytest.raises(UsageError, match=r"estimator 'instrument' is unknown; did you mean 'instruments'"):
        find_estimator("instrument")

"""Filter error: its Riccati equation, its gradient, turbulence, and which method is valid."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from second_order import MODEL, TRUTH, fly

from freqid.core.errors import UsageError
from freqid.identify.output_error.estimate import Settings, estimate
from freqid.identify.output_error.filter_error import FilterError, steady_covariance
from freqid.identify.output_error.parameters import Choices, choose_parameters
from freqid.identify.output_error.starts import equation_error_starts

TURBULENCE = 0.6


@pytest.mark.parametrize("process", [(0.3, 0.2, 0.1), (0.3, 0.0, 0.1)])
def test_the_steady_covariance_solves_the_riccati_equation(process):
    rng = np.random.default_rng(0)
    step = 0.5 * rng.normal(size=(3, 3))
    seen, r = rng.normal(size=(4, 3)), np.diag(rng.uniform(0.1, 1.0, 4))
    q = np.diag(process)
    ours = np.asarray(steady_covariance(step, seen, q, r))
    np.testing.assert_allclose(ours, solve_discrete_are(step.T, seen.T, q, r), rtol=1e-8, atol=1e-12)


def test_gradient_and_cost_belong_together():
    signals = [fly(1, noise=1.0, process=TURBULENCE)]
    values = equation_error_starts(MODEL, signals, {}, {})
    parameters = choose_parameters(MODEL, signals, values, Choices())
    likelihood = FilterError(MODEL, signals, parameters, MODEL.states)
    free = np.concatenate((parameters.start, np.log([0.5, 0.02, 0.1, 0.004, 0.15])))
    point = likelihood.linearise(free)
    for i in range(free.size):
        h = 1e-5
        up, down = free.copy(), free.copy()
        up[i] += h
        down[i] -= h
        slope = (likelihood.cost(up) - likelihood.cost(down)) / (2 * h)
        assert point.gradient[i] == pytest.approx(slope, rel=1e-4, abs=1e-3)


def test_turbulence_makes_output_error_invalid_and_filter_error_valid():
    flights = [fly(3, noise=1.0, process=TURBULENCE, samples=1500)]
    plain = estimate(MODEL, flights)
    assert plain.coloured
    assert not plain.valid
    assert any("output error is not valid here" in remark for remark in plain.remarks)
    found = estimate(MODEL, flights, None, Settings("filter-error"))
    assert found.valid
    assert any("filter error is valid here and output error is not" in remark for remark in found.remarks)
    for name, value in TRUTH.items():
        estimate_, sigma = found[name]
        assert abs(estimate_ - value) < 4 * sigma
    assert found.process_noise["w"] == pytest.approx(TURBULENCE, rel=0.15)
    assert found.noise["q"] == pytest.approx(0.004, rel=0.15)
    assert found["Mw"][1] < plain["Mw"][1]


def test_without_turbulence_output_error_is_valid_and_filter_error_agrees():
    flights = [fly(4, noise=1.0)]
    plain = estimate(MODEL, flights)
    assert plain.valid
    found = estimate(MODEL, flights, None, Settings("filter-error"))
    assert any("output error is valid here and simpler" in remark for remark in found.remarks)
    for name in TRUTH:
        assert found[name][0] == pytest.approx(plain[name][0], abs=plain[name][1])


def test_filter_error_is_for_time_and_for_states_that_are():
    with pytest.raises(UsageError, match="filter error is for the time domain"):
        estimate(MODEL, [fly()], None, Settings("filter-error", "frequency", lines_hz=(0.1, 0.2)))
    with pytest.raises(UsageError, match="has no state 'theta'"):
        estimate(MODEL, [fly()], None, Settings("filter-error", process_noise=("theta",)))

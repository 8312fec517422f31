"""Parameters that cannot be trusted, and where a fit is worst: against what was put in by hand."""

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.results.fit import Fit
from freqid.core.results.judged.doubt import doubts_of
from freqid.core.results.judged.truth import KnownTruth
from freqid.core.results.point import ResponseModel

NAMES = ("w", "q", "de", "dr")


def response(**changes) -> ResponseModel:
    """Return a response of four parameters that nothing is wrong with, and what is changed of it."""
    p, estimate, error = len(NAMES), np.array([-4.0, 2.0, 10.0, 0.5]), np.array([0.1, 0.1, 0.1, 0.01])
    time = np.arange(400) / 20
    moved = np.sqrt(2) * np.sin(2 * np.pi * time)  # an rms of one over whole periods
    one = ResponseModel(
        response="M",
        unit="N m",
        regressors=NAMES,
        regressor_units=("m/s", "rad/s", "rad", "rad"),
        trim=np.zeros(p),
        regressor_rms=np.full(p, 0.1),
        estimate=estimate,
        std_error=error,
        covariance=np.diag(error**2),
        lower=estimate - 2 * error,
        upper=estimate + 2 * error,
        bias=0.0,
        bias_std_error=0.0,
        r2=0.9,
        pse=0.0,
        rmse=0.1,
        fit_error=0.1,
        t_statistic=estimate / error,
        variance_inflation=np.ones(p),
        correlation=np.eye(p),
        condition_index=np.ones(p),
        variance_proportion=np.eye(p),
        inseparable=(),
        fit={"time": Fit(time, moved, 0.9 * moved)},
    )
    return replace(one, **changes)


def test_a_response_that_is_known_well_gives_no_doubt():
    assert doubts_of(response()) == ()


def test_a_wide_interval_is_its_half_over_the_estimate_and_weighs_what_it_moves():
    lower, upper = response().lower.copy(), response().upper.copy()
    lower[1], upper[1] = 2.0 - 1.5, 2.0 + 1.5
    lower[3], upper[3] = 0.5 - 0.3, 0.5 + 0.3
    first, second = doubts_of(response(lower=lower, upper=upper))
    assert (first.parameter, first.kinds, first.half_width) == ("q", ("wide interval",), pytest.approx(0.75))
    assert first.weight == pytest.approx(0.1 * 3.5, rel=1e-3)  # rms of the regressor, the far end, over one
    assert first.matters
    assert (second.parameter, second.half_width) == ("dr", pytest.approx(0.6))
    assert second.weight == pytest.approx(0.1 * 0.8, rel=1e-3)
    assert (first.unit, second.unit) == ("N m/(rad/s)", "N m/rad")
    small = doubts_of(response(lower=lower, upper=upper, regressor_rms=np.full(4, 0.01)))
    assert [d.matters for d in small] == [False, False]
    assert all(d.matters for d in doubts_of(response(lower=lower, upper=upper, fit={})))  # not known: it may


def test_collinear_regressors_name_their_companion():
    inflation, correlation = np.array([1.0, 15.0, 1.0, 1.0]), np.eye(4)
    correlation[1, 2] = correlation[2, 1] = -0.95
    (one,) = doubts_of(response(variance_inflation=inflation, correlation=correlation))
    assert (one.parameter, one.kinds, one.companions) == ("q", ("collinear",), ("de",))
    both = doubts_of(response(inseparable=(("w", "dr"),)))
    assert {d.parameter: d.companions for d in both} == {"w": ("dr",), "dr": ("w",)}


def test_a_parameter_off_the_truth_carries_the_computed_cause():
    r = response()
    late = r.estimate.copy()
    late[1] += 5 * r.std_error[1]
    truth = KnownTruth(NAMES, late, r.estimate, r.estimate, np.zeros(4), 0.125)
    (one,) = doubts_of(r, truth.misses(r.estimate, r.std_error))
    assert (one.parameter, one.kinds) == ("q", ("misses the truth",))
    assert one.miss is not None
    assert (one.miss.cause, one.miss.of) == ("wake delay", "linearisation")


def slow_worst(fit: Fit, count: int = 8) -> tuple[float, float, float]:
    """Return the worst band by trying each."""
    best = (-1.0, 0.0, 0.0)
    for k in range(fit.axis.size - count + 1):
        ratio = [abs(fit.residual[i]) / fit.noise[i] for i in range(k, k + count)]
        best = max(best, (np.sqrt(np.mean(np.square(ratio))), fit.axis[k], fit.axis[k + count - 1]))
    return best


def test_the_worst_band_is_where_the_residual_stands_out_of_noise():
    rng = np.random.default_rng(4)
    hz = np.arange(1, 61) / 30
    noise = 0.1 + 0.5 * hz  # much noise at high frequency, where the residual is largest in itself
    left = noise * (rng.standard_normal(60) + 1j * rng.standard_normal(60)) / np.sqrt(2)
    left[20:28] *= 5
    measured = np.full(60, 10 + 0j)
    fit = Fit(hz, measured, measured - left, noise)
    band = fit.worst_band
    assert (band.over_noise, band.low_hz, band.high_hz) == pytest.approx(slow_worst(fit))
    assert abs(band.low_hz - hz[20]) < 2.5 / 30  # where it was put
    inside = (hz >= band.low_hz) & (hz <= band.high_hz)
    assert band.share == pytest.approx(np.sum(np.abs(left[inside]) ** 2) / np.sum(np.abs(left) ** 2))


def test_without_noise_the_worst_band_holds_the_most_of_the_residual_and_a_history_has_none():
    hz = np.arange(1, 31) / 10
    left = np.where((hz > 1.05) & (hz < 1.75), 2.0, 0.1).astype(complex)
    fit = Fit(hz, np.ones(30, complex), 1 - left)
    assert fit.worst_band.low_hz <= 1.1
    assert fit.worst_band.high_hz >= 1.7
    assert np.isnan(fit.worst_band.over_noise)
    assert fit.worst_band.share > 0.95
    assert Fit(hz, np.ones(30), np.zeros(30)).worst_band is None

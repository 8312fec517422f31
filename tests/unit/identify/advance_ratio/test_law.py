"""Laws against known truths, scipy's least squares and their own limits."""

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.stats import norm

from freqid.core.errors import DataError
from freqid.identify.advance_ratio.law import count_trims, fit_law

J = np.concatenate([np.repeat([0.35, 0.45, 0.6, 0.8, 1.05], 2), [np.inf] * 2])


def one(j, c=1.0, p=1.2, r=3.0):
    return c + p * np.exp(-r * np.minimum(j, 1e6))


def momentum(j):
    """Blown dynamic pressure by momentum theory: no exponential."""
    return 0.6 + 0.4 * np.sqrt(1 + 0.25 / np.minimum(j, 1e6) ** 2)


def noisy(truth, s, seed):
    rng = np.random.default_rng(seed)
    j = J * (1 + 0.01 * rng.standard_normal(J.size))
    return j, truth(j) + s * rng.standard_normal(J.size)


def test_one_exponential_is_that_of_nonlinear_least_squares():
    j, y = noisy(one, 0.01, 0)
    law = fit_law(j, y, np.full(j.size, 0.01), "CZ.0")
    (c, p, r), covariance = curve_fit(
        one, np.minimum(j, 1e3), y, p0=(1, 1, 2), sigma=np.full(j.size, 0.01), absolute_sigma=True
    )
    error = np.sqrt(np.diag(covariance))
    assert law.form == "one exponential"
    assert abs(law.unblown - c) < 0.15 * error[0]
    assert abs(law.rate[0] - r) < 0.15 * error[2]
    # what is estimated of the scatter and doubted of the form makes it wider, never narrower
    assert error[0] <= law.std_error < 1.6 * error[0]


def test_a_mean_is_the_weighted_mean():
    rng = np.random.default_rng(4)
    s = rng.uniform(0.5, 2.0, J.size) * 0.01
    y = 2.0 + s * rng.standard_normal(J.size)
    law = fit_law(J, y, s)
    assert law.form == "mean"
    weights = 1 / (s**2 + law.scatter**2)
    assert abs(law.unblown - np.average(y, weights=weights)) < 0.1 * weights.sum() ** -0.5
    assert law.scatter < np.median(s)
    np.testing.assert_array_equal(law.increment([0.4, np.inf]), 0.0)


@pytest.mark.parametrize(
    ("truth", "forms"), [(one, {"one exponential"}), (lambda j: 0 * np.minimum(j, 1) + 1, {"mean"})]
)
def test_forms_and_intervals_are_right(truth, forms):
    """Six draws: the form of each, and intervals at five advance ratios that hold the truth."""
    at = np.array([0.35, 0.5, 0.7, 1.0, np.inf])
    right, inside = 0, []
    for seed in range(6):
        j, y = noisy(truth, 0.02, seed)
        law = fit_law(j, y, np.full(j.size, 0.02))
        low, high = law.interval(at)
        right += law.form in forms
        inside.append((low <= truth(at)) & (truth(at) <= high))
    assert right >= 5
    assert np.mean(inside) > 0.85


def test_a_truth_that_is_no_exponential_is_scatter_and_stays_inside():
    j, y = noisy(momentum, 0.005, 1)
    law = fit_law(j, y, np.full(j.size, 0.005))
    at = np.append(np.linspace(0.35, 1.05, 15), np.inf)
    low, high = law.interval(at)
    assert law.form != "mean"
    assert np.mean((low <= momentum(at)) & (momentum(at) <= high)) > 0.8


def test_scatter_beyond_the_standard_errors_is_found():
    rng = np.random.default_rng(2)
    y = 1 + 0.05 * rng.standard_normal(40)
    law = fit_law(np.linspace(0.3, 1.2, 40), y, np.full(40, 0.005))
    assert law.form == "mean"
    assert 0.03 < law.scatter < 0.08
    assert law.std_error == pytest.approx(0.05 / np.sqrt(40), rel=0.5)


def test_without_stopped_propellers_the_unblown_limit_is_doubted():
    finite = np.isfinite(J)
    j, y = noisy(one, 0.01, 3)
    s = np.full(j.size, 0.01)
    all_, blown = fit_law(j, y, s), fit_law(j[finite], y[finite], s[finite])
    assert all_.reaches_unblown
    assert not blown.reaches_unblown
    assert blown.std_error > 3 * all_.std_error
    low, high = blown.interval(np.inf)
    assert low < 1 < high


def test_leave_one_out_of_a_mean_is_the_textbook_formula():
    """With estimates that are exact to their standard errors the scatter hardly counts."""
    rng = np.random.default_rng(8)
    y, s = rng.standard_normal(60), np.ones(60)
    law = fit_law(np.full(60, 0.5), y, s)
    others = (y.sum() - y) / 59
    assert law.forms[0].prediction_rms == pytest.approx(np.sqrt(np.mean((y - others) ** 2)), rel=1e-9)
    plain = norm.logpdf(y, others, np.sqrt(1 + 1 / 59)).sum()
    assert law.forms[0].log_predictive == pytest.approx(plain, abs=2.0)


def test_too_few_trims_say_so_and_give_the_mean():
    law = fit_law(np.array([0.4, 0.7, 1.0]), np.array([2.0, 1.5, 1.2]), np.full(3, 0.01), "CZ.0")
    assert law.form == "mean"
    assert law.remarks == (
        "CZ.0: one exponential needs 4 different advance ratios, 3 are there; fly more of them to tell.",
    )
    assert [f.form for f in law.forms] == ["mean"]
    single = fit_law(np.full(6, 0.5), np.ones(6), np.full(6, 0.1), "CZ.0")
    assert "1 is there" in single.remarks[0]
    alone = fit_law(np.array([0.5]), np.ones(1), np.full(1, 0.1), "CZ.0")
    low, high = alone.interval(0.5)
    assert low < 1 < high
    assert "one manoeuvre tells no scatter" in alone.remarks[-1]


def test_all_stopped_is_a_mean():
    law = fit_law(np.full(4, np.inf), np.array([1.0, 1.1, 0.9, 1.0]), np.full(4, 0.1))
    assert law.form == "mean"
    assert law.reaches_unblown


@pytest.mark.parametrize("bad", [np.nan, 0.0, -1.0])
def test_standard_errors_must_be_positive(bad):
    with pytest.raises(DataError, match="no positive standard error"):
        fit_law(J, np.ones(J.size), np.full(J.size, bad))


def test_trims_within_three_per_cent_are_one():
    assert count_trims(np.array([0.5, 0.505, 0.51, 0.6, 0.601])) == 2
    assert count_trims(np.array([])) == 0

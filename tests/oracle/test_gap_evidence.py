"""Evidence from inner products beside the same Gaussians written out with their whole covariance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag, subspace_angles
from scipy.stats import chi2, multivariate_normal

from freqid.gap.evidence import Hypothesis
from freqid.gap.gather import gather

SIZES = (40, 55)  # white numbers of each manoeuvre
SIGNATURES = ("worn:share", "late:by", "late:d1")
COMMON = ("derivatives:M:q", "derivatives:M:de", "tolerance:mass:fraction")
TWO = Hypothesis("late", (2, 3), (0.4, 1.5))
ONE = Hypothesis("worn", (1,), (0.7,))


class Dense:
    """Two manoeuvres in one: everything stacked, nothing reduced."""

    def __init__(self, draws=12, alone=(2, 3), shared=False, absent=(), seed=3):
        rng = np.random.default_rng(seed)
        self.h = [0.4 * rng.standard_normal((len(SIGNATURES), n)) for n in SIZES]
        for h in self.h:
            h[2] += 0.8 * h[1]
        for manoeuvre, k in absent:
            self.h[manoeuvre][k] = 0.0
        self.t = [0.5 * rng.standard_normal((len(COMMON), n)) for n in SIZES]
        for t, h in zip(self.t, self.h, strict=True):
            t[0] += 0.6 * h[0]
        self.own = [
            0.7 * rng.standard_normal((k, n)) + h[:1] for k, n, h in zip(alone, SIZES, self.h, strict=True)
        ]
        self.y = [2.0 * h[0] + 0.5 * h[1] + rng.standard_normal(h.shape[1]) for h in self.h]
        self.noise = [rng.standard_normal((draws, n)) for n in SIZES]
        names = (*SIGNATURES, *COMMON)
        count = len(names)
        self.shared = [
            (0.5 * shared * rng.standard_normal(count), 0.5 * shared * rng.standard_normal(k)) for k in alone
        ]
        white = []
        for h, t, y, z in zip(self.h, self.t, self.y, self.noise, strict=True):
            columns = dict(zip(names, np.concatenate([h, t]), strict=True))
            white.append({n: x for n, x in columns.items() if x.any()} | {"data": y, "draws": z})
        self.evidence = gather(white, self.own, SIGNATURES, COMMON, self.shared, draws, seed=11)

    @property
    def columns(self) -> np.ndarray:
        """Signatures and common tolerances, shape (column, number)."""
        return np.concatenate([np.concatenate(self.h, axis=1), np.concatenate(self.t, axis=1)])

    @property
    def covariance(self) -> np.ndarray:
        """Of noise and tolerances of both sorts."""
        t = np.concatenate(self.t, axis=1)
        return np.eye(sum(SIZES)) + t.T @ t + block_diag(*(u.T @ u for u in self.own))

    @property
    def data(self) -> np.ndarray:
        """The data whose products with all columns are less by what noise puts into both."""
        found = []
        for h, t, u, y, (common, mine) in zip(self.h, self.t, self.own, self.y, self.shared, strict=True):
            every = np.concatenate([h, t, u])
            found.append(y - np.linalg.pinv(every) @ np.concatenate([common, mine]))
        return np.concatenate(found)

    def log_bayes(self, y: np.ndarray, hypothesis: Hypothesis) -> float:
        h = self.columns[[c - 1 for c in hypothesis.columns]] * np.array(hypothesis.scale)[:, None]
        zero = np.zeros(y.size)
        with_it = multivariate_normal(zero, self.covariance + h.T @ h).logpdf(y)
        return float(with_it - multivariate_normal(zero, self.covariance).logpdf(y))


@pytest.mark.parametrize("hypothesis", [ONE, TWO, Hypothesis("worn+late", (1, 2, 3), (0.7, 0.4, 1.5))])
@pytest.mark.parametrize("case", [{}, {"alone": (0, 0)}, {"shared": True}, {"absent": ((1, 0), (0, 2))}])
def test_log_bayes_factor_is_the_difference_of_two_densities(hypothesis, case):
    dense = Dense(**case)
    expected = dense.log_bayes(dense.data, hypothesis)
    assert dense.evidence.evidences(hypothesis)[0] == pytest.approx(expected, rel=1e-8)
    assert dense.evidence.estimate(hypothesis).evidence == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("shared", [False, True])
def test_estimate_is_the_gaussian_conditional_of_coefficients(shared):
    dense = Dense(shared=shared)
    h, prior = dense.columns[1:3], np.diag(np.square(TWO.scale))
    whole = dense.covariance + h.T @ prior @ h
    gain = prior @ h @ np.linalg.inv(whole)  # conditional of jointly Gaussian coefficients and data
    found = dense.evidence.estimate(TWO)
    assert found.value == pytest.approx(gain @ dense.data, rel=1e-8)
    assert found.covariance == pytest.approx(prior - gain @ h.T @ prior, rel=1e-7)
    made = found.value @ h
    assert found.detectability == pytest.approx(made @ np.linalg.solve(dense.covariance, made), rel=1e-8)


def test_a_tolerance_may_be_an_explanation_of_its_own():
    """A derivative that may be wrong by more than its tolerance: its prior variances add up."""
    dense = Dense()
    column = dense.evidence.column("derivatives:M:de")
    wider = Hypothesis("other", (column,), (np.sqrt(15),))  # four sigma in all
    expected = dense.log_bayes(dense.data, wider)
    assert dense.evidence.evidences(wider)[0] == pytest.approx(expected, rel=1e-8)


def test_best_fit_lowers_the_misfit_by_its_gain():
    dense = Dense()
    root = np.linalg.cholesky(np.linalg.inv(dense.covariance)).T
    y, h = root @ dense.data, root @ dense.columns[1:3].T
    left = y - h @ np.linalg.lstsq(h, y)[0]
    expected = 0.5 * (y @ y - left @ left)
    assert dense.evidence.likelihood_gain(TWO)[0] == pytest.approx(expected, rel=1e-8)


def test_alignment_is_the_cosine_of_the_smallest_angle_between_spans():
    dense = Dense()
    root = np.linalg.cholesky(np.linalg.inv(dense.covariance)).T
    a, b = root @ dense.columns[:1].T, root @ dense.columns[1:3].T
    expected = np.cos(subspace_angles(a, b).min())
    assert dense.evidence.alignment(ONE, TWO) == pytest.approx(expected, rel=1e-8)
    angle = np.linspace(0, np.pi, 20001)  # and by trying every direction of the plane
    q = np.linalg.qr(b)[0]
    tried = np.abs((a[:, 0] / np.linalg.norm(a)) @ (q @ np.array([np.cos(angle), np.sin(angle)])))
    assert dense.evidence.alignment(TWO, ONE) == pytest.approx(tried.max(), rel=1e-6)
    assert dense.evidence.alignment(TWO, Hypothesis("same", (3,), (1.0,))) == pytest.approx(1.0)


def test_one_manoeuvre_alone_is_what_it_would_be_had_it_flown_alone():
    dense = Dense()
    alone = Dense()
    for part in (alone.h, alone.t, alone.own, alone.y, alone.shared):
        del part[0]
    second = dense.evidence.only([1])
    found = second.estimate(TWO)
    covariance = np.eye(SIZES[1]) + alone.t[0].T @ alone.t[0] + alone.own[0].T @ alone.own[0]
    h = alone.h[0][1:3]
    precision = h @ np.linalg.solve(covariance, h.T) + np.diag(1 / np.square(TWO.scale))
    expected = np.linalg.solve(precision, h @ np.linalg.solve(covariance, alone.y[0]))
    assert found.value == pytest.approx(expected, rel=1e-8)


def test_null_draws_are_noise_and_tolerances_and_are_weighed_as_data_are():
    dense = Dense(alone=(0, 0))
    t = np.concatenate(dense.t, axis=1)
    draws = np.concatenate(dense.noise, axis=1) + dense.evidence.null @ t
    inverse = np.linalg.inv(dense.covariance)
    for column in (1, 3):
        expected = draws @ inverse @ dense.columns[column - 1]
        assert dense.evidence.null_products(column) == pytest.approx(expected, rel=1e-8)
    expected = [dense.log_bayes(x, TWO) for x in draws]
    assert dense.evidence.evidences(TWO)[1:] == pytest.approx(expected, rel=1e-7)


def test_null_draws_scatter_as_noise_and_every_tolerance_say():
    """Products of a column h with draws of covariance S have the variance ``h^T S^-1 h``."""
    dense = Dense(draws=2000)
    inverse = np.linalg.inv(dense.covariance)
    for column in (1, 2, 3):
        h = dense.columns[column - 1]
        found = dense.evidence.null_products(column)
        energy = np.square(found).sum() / (h @ inverse @ h)
        assert chi2.ppf(1e-4, 2000) < energy < chi2.isf(1e-4, 2000)


def test_without_an_effect_the_evidence_is_against_it_on_average():
    """The mean of a log Bayes factor under the null is minus a Kullback-Leibler divergence."""
    dense = Dense(draws=2000)
    h = dense.columns[1:3] * np.array(TWO.scale)[:, None]
    inner = h @ np.linalg.solve(dense.covariance, h.T)
    share = np.linalg.eigvalsh(inner)
    mean = 0.5 * (share / (1 + share) - np.log1p(share)).sum()
    scatter = np.sqrt(0.5 * np.square(share / (1 + share)).sum())
    found = dense.evidence.evidences(TWO)[1:]
    assert abs(found.mean() - mean) < 4 * scatter / np.sqrt(2000)
    assert found.std() == pytest.approx(scatter, rel=0.15)


def test_metric_holds_the_products_of_data_signatures_and_tolerances():
    dense = Dense()
    stacked = np.concatenate([dense.data[None], dense.columns])
    expected = stacked @ np.linalg.solve(dense.covariance, stacked.T)
    assert dense.evidence.metric[:7, :7] == pytest.approx(expected, rel=1e-8, abs=1e-10)


def test_energy_of_null_draws_is_a_white_number_each():
    """``x^T S^-1 x`` of draws of covariance S is chi-square with as many degrees as numbers."""
    for alone in ((0, 0), (2, 3)):
        found = Dense(draws=2000, alone=alone).evidence.null_energy
        assert abs(found.mean() - sum(SIZES)) < 4 * np.sqrt(2 * sum(SIZES) / 2000)
        assert found.var() == pytest.approx(2 * sum(SIZES), rel=0.15)

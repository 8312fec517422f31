"""The gap's small matrices beside the same Gaussians written out with their whole covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from freqid.gap.close.fit import departures_beyond, fit
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import Form, Products
from freqid.gap.infer.evidence import estimate, separation, weigh
from freqid.gap.infer.explain import Explanation, explain
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.infer.linearise import Linearised
from freqid.gap.infer.null_draws import Drawn, drawn, effects_of
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import Candidate, Place
from freqid.gap.self_test.answers import DrawnData

NUMBERS = (30, 42)  # real numbers of each block
NONE = Form(0.0, 0.0)
FORMS = (NONE, Form(0.05, 0.0), Form(0.2, 0.0), Form(0.0, 0.1), Form(0.2, 0.1))
TOLERANCES, OWN, LOADS, ACTUATORS = 4, 2, 6, 3
LOG_SIZES = np.geomspace(0.05, 5.0, 33)


def scalar(effect, sizes, prior, place=""):
    return Candidate(effect, Place(place, (effect,)), "scalar", np.array(sizes), np.array(prior), [])


def vector(effect, count):
    names = tuple(f"{effect}{k}" for k in range(count))
    return Candidate(effect, Place("", names), "vector", np.ones(count), np.array([0.3, 1.0, 3.0]), [])


class Dense:
    """Two blocks: everything stacked, nothing reduced."""

    def __init__(self, seed=3, effect=None, visible=1.0):
        rng = np.random.default_rng(seed)
        both = np.concatenate([-LOG_SIZES[::-1], LOG_SIZES])
        self.candidates = [
            scalar("heavy", [0.5], both),
            scalar("late", [0.2, 1.0, 4.0], LOG_SIZES, "de"),
            scalar("late", [0.2, 1.0, 4.0], LOG_SIZES, "da"),
            vector("off", 3),
        ]
        count = sum(c.sizes.size for c in self.candidates)
        self.x = [0.4 * rng.standard_normal((count, n)) for n in NUMBERS]
        self.t = [0.5 * rng.standard_normal((TOLERANCES, n)) for n in NUMBERS]
        for x, t in zip(self.x, self.t, strict=True):
            t[0] += 0.6 * x[0]
            x[2] += 3.0 * x[1]
            x[0] *= visible
        self.u = [0.7 * rng.standard_normal((OWN, n)) + x[:1] for n, x in zip(NUMBERS, self.x, strict=True)]
        self.form = [2.0 * rng.standard_normal((LOADS, n)) for n in NUMBERS]
        for form in self.form:
            form[-1] = form[0] + form[1]  # a direction that is there already
        self.servos = [3.0 * rng.standard_normal((ACTUATORS, n)) for n in NUMBERS]
        for servos, form, x in zip(self.servos, self.form, self.x, strict=True):
            servos[0] += form[0] + x[1]  # shared with the loads' form and with an effect
        weights = np.zeros(count) if effect is None else np.asarray(effect)
        self.r = [rng.standard_normal(n) + weights @ x for n, x in zip(NUMBERS, self.x, strict=True)]
        blocks = [
            Products.of(x, t, r, u, form, servos).matrices()
            for x, t, r, u, form, servos in zip(
                self.x, self.t, self.r, self.u, self.form, self.servos, strict=True
            )
        ]
        names = tuple(f"t{k}" for k in range(TOLERANCES))
        self.system = System(self.candidates, names, blocks, FORMS)
        self.columns, self.residual = np.concatenate(self.x, axis=1), np.concatenate(self.r)

    def covariance(self, f):
        """Of noise, own unknowns, form and tolerances; these and shared errors of form are in all blocks."""
        own = [
            np.eye(u.shape[1]) + u.T @ u + f.loads**2 * z.T @ z
            for u, z in zip(self.u, self.form, strict=True)
        ]
        t, servos = np.concatenate(self.t, axis=1), np.concatenate(self.servos, axis=1)
        return block_diag(*own) + t.T @ t + f.shared**2 * servos.T @ servos

    def log_density(self, f, mean=0.0, more=0.0):
        return multivariate_normal(np.zeros(self.residual.size), self.covariance(f) + more).logpdf(
            self.residual - mean
        )

    def at(self, i):
        return self.columns[self.system.columns_of(i)]


@pytest.fixture(scope="module")
def dense():
    return Dense()


def test_reduced_matrices_are_products_in_the_whole_covariance(dense):
    for f in FORMS:
        inverse, reduced = np.linalg.inv(dense.covariance(f)), dense.system.reduced(f)
        products = dense.columns @ inverse @ dense.columns.T
        np.testing.assert_allclose(reduced.G, products, rtol=1e-8, atol=1e-9)
        assert reduced.g == pytest.approx(dense.columns @ inverse @ dense.residual, rel=1e-8, abs=1e-9)
        mean = np.concatenate(dense.t, axis=1) @ inverse @ dense.residual
        fitted = fit(weigh(dense.system), Explanation((), (), ()), f)
        assert fitted.tolerances_alone == pytest.approx(mean, rel=1e-8)


def test_evidence_of_no_effect_is_the_log_density_but_for_a_constant(dense):
    found = [dense.system.reduced(f).log_evidence for f in FORMS]
    expected = [dense.log_density(f) for f in FORMS]
    assert np.diff(found) == pytest.approx(np.diff(expected), rel=1e-8)


def test_a_tolerance_that_is_held_is_known_and_nothing_of_it_is_left(dense):
    """Its change is taken off the residual, its variance off the covariance."""
    held = dense.system.held({1: 3.0, 3: -3.0})
    t = np.concatenate(dense.t, axis=1)
    known = 3.0 * t[1] - 3.0 * t[3]
    gone = np.outer(t[1], t[1]) + np.outer(t[3], t[3])
    found = [held.reduced(f).log_evidence for f in FORMS]
    expected = [dense.log_density(f, mean=known, more=-gone) for f in FORMS]
    assert np.diff(found) == pytest.approx(np.diff(expected), rel=1e-8)
    assert held.tolerances == ("t0", "t2")


def test_tolerances_that_are_asked_for_more_than_is_believed_are_held(dense):
    t = np.concatenate(dense.t, axis=1)
    assert departures_beyond(dense.system) == {}
    far = System(dense.candidates, dense.system.tolerances, with_residual(dense, 9.0 * t[2]), FORMS)
    assert departures_beyond(far) == {2: 3.0}


def with_residual(dense, more):
    """Return the blocks with something added to the data."""
    parts = np.split(more, [NUMBERS[0]])
    return [
        Products.of(x, t, r + m, u, form, servos).matrices()
        for x, t, r, m, u, form, servos in zip(
            dense.x, dense.t, dense.r, parts, dense.u, dense.form, dense.servos, strict=True
        )
    ]


def integral(dense, i, f):
    """Return the log mean density ratio over sizes of a scalar, spread evenly in the logarithm."""
    c, inverse = dense.candidates[i], np.linalg.inv(dense.covariance(f))
    signs, logs = np.unique(np.sign(c.prior)), np.linspace(*np.log(LOG_SIZES[[0, -1]]), 6401)
    change = np.array([[c.weights(s * x) @ dense.at(i) for x in np.exp(logs)] for s in signs])
    each = change @ inverse @ dense.residual - 0.5 * ((change @ inverse) * change).sum(axis=-1)
    trapezoid = np.r_[0.5, np.ones(logs.size - 2), 0.5]
    return logsumexp(each, b=trapezoid) - np.log(signs.size * (logs.size - 1))


def test_scalar_bayes_factor_is_the_integral_over_log_uniform_sizes(dense):
    places = weigh(dense.system).places
    for i in (0, 1, 2):
        assert places[1, i] == pytest.approx(integral(dense, i, FORMS[1]), abs=0.05)


@pytest.mark.parametrize("size", [0.3, 1.0, 3.05, 3.2, 3.4])
def test_it_is_so_for_effects_that_leave_no_doubt_of_their_size(size):
    """The likelihood is far narrower than the distance between sizes of the prior."""
    dense = Dense(effect=np.r_[2 * size, np.zeros(9)], visible=5.0)
    assert weigh(dense.system).places[1, 0] == pytest.approx(integral(dense, 0, FORMS[1]), abs=0.1)


def tied(dense, sigma, residual=None):
    """Return the same stack, its second tolerance that of the late effects."""
    blocks = dense.system.blocks if residual is None else with_residual(dense, residual)
    candidates = [
        replace(c, spreads={c.tolerance: sigma}) if c.effect == "late" else c for c in dense.candidates
    ]
    return System(candidates, ("t0", "late.late", "t2", "t3"), blocks, FORMS)


@pytest.mark.parametrize("sigma", [0.02, 0.4, 1.5])
def test_an_effect_is_weighed_by_its_sum_with_the_tolerance_of_its_parameter(dense, sigma):
    """That tolerance out of the covariance, its spread in that of the size; beside others as it is alone."""
    i, f = 1, FORMS[1]
    c, t = dense.candidates[i], np.concatenate(dense.t, axis=1)[1]
    u = np.union1d(np.linspace(-1, 6, 14001), np.linspace(-5 * sigma, 5 * sigma, 2001))
    logs = np.linspace(*np.log(LOG_SIZES[[0, -1]]), 2001)
    density = np.exp(-0.5 * ((u[:, None] - np.exp(logs)) / sigma) ** 2).mean(axis=1) / sigma
    density /= np.trapezoid(density, u)
    without = dense.covariance(f) - np.outer(t, t)
    inverse, change = np.linalg.inv(without), c.weights(u) @ dense.at(i)
    each = change @ inverse @ dense.residual - 0.5 * ((change @ inverse) * change).sum(axis=1)
    ratio = dense.log_density(f, more=-np.outer(t, t)) - dense.log_density(f)
    expected = np.log(np.trapezoid(np.exp(each - each.max()) * density, u)) + each.max() + ratio
    evidence = weigh(tied(dense, sigma))
    assert evidence.places[1, i] == pytest.approx(expected, abs=0.1)
    # the heavy one, known to be there, changes what the data say of that tolerance
    given = np.r_[0.7, np.zeros(9)]
    left = evidence.system.reduced(f).given(given)
    moved = weigh(tied(dense, sigma, -given @ dense.columns)).places[1, i]
    assert evidence.weighing.of_place(i, left) == pytest.approx(moved, rel=1e-8)


def test_of_a_vector_too_the_sum_with_tolerances_of_its_parameters_is_estimated(dense):
    """As if that tolerance were not there; its sigma widens that parameter's interval alone."""
    candidates = [*dense.candidates[:3], replace(dense.candidates[3], spreads={"off.off1": 0.4})]
    system = System(candidates, ("t0", "off.off1", "t2", "t3"), dense.system.blocks, FORMS)
    (found,) = joint_estimates(system, (3,))
    rest = [
        Products.of(x, np.delete(t, 1, axis=0), r, u, form, servos).matrices()
        for x, t, r, u, form, servos in zip(
            dense.x, dense.t, dense.r, dense.u, dense.form, dense.servos, strict=True
        )
    ]
    without = estimate(weigh(System(candidates, ("t0", "t2", "t3"), rest, FORMS)), 3, 0.9)
    assert found.size == pytest.approx(without.size, rel=1e-6)
    room = np.array([0.0, 1.6449 * 0.4, 0.0])
    assert found.hi - found.size == pytest.approx(np.hypot(without.hi - without.size, room), rel=1e-4)
    assert found.size - found.lo == pytest.approx(np.hypot(without.size - without.lo, room), rel=1e-4)


def test_what_is_free_leaves_of_a_tolerance_what_a_wide_prior_leaves(dense):
    wide = 1e4 * np.eye(10)[[0, 7]]
    f = FORMS[1]
    freed = tied(dense, 0.4).reduced(f).freed(wide / 1e4).posterior
    whole = dense.covariance(f) + (wide @ dense.columns).T @ (wide @ dense.columns)
    inverse, t = np.linalg.inv(whole), np.concatenate(dense.t, axis=1)
    assert freed.mean == pytest.approx(t @ inverse @ dense.residual, rel=1e-4)
    assert freed.variance == pytest.approx(1 - np.diag(t @ inverse @ t.T), rel=1e-4)
    kept = np.delete(np.arange(10), [0, 7])
    np.testing.assert_allclose(freed.slopes[:, kept], (t @ inverse @ dense.columns.T)[:, kept], atol=1e-4)


def test_vector_bayes_factor_is_the_mean_density_ratio_over_its_scales(dense):
    places = weigh(dense.system).places
    columns = dense.at(3)
    for k, f in enumerate(FORMS):
        each = [dense.log_density(f, more=t**2 * columns.T @ columns) for t in dense.candidates[3].prior]
        expected = logsumexp(each) - np.log(3) - dense.log_density(f)
        assert places[k, 3] == pytest.approx(expected, rel=1e-8, abs=1e-8)


def test_effects_share_their_prior_over_places_and_form_is_integrated_out(dense):
    evidence = weigh(dense.system)
    none = logsumexp([dense.log_density(f) for f in FORMS])
    each = [dense.log_density(f) + evidence.places[k, i] for k, f in enumerate(FORMS) for i in (1, 2)]
    assert evidence.effect["late"] == pytest.approx(logsumexp(each) - np.log(2) - none, rel=1e-8, abs=1e-8)
    posterior = np.exp([dense.log_density(f) for f in FORMS] - none) * np.exp(evidence.places[:, 0])
    assert evidence.form_weights(0) == pytest.approx(posterior / posterior.sum(), rel=1e-7)


def all_at(form_error, count):
    return np.full(count, FORMS.index(form_error))


def test_rows_with_errors_of_form_of_their_own_are_as_if_each_column_had_that_size(dense):
    """Two rows of the form, the second without a size, and how likely that is before the data."""
    sizes, row = (0.2, 0.0, 0.05), np.array([0, 0, 1, 1, 2, 2])
    f = Form(sizes, 0.1, -1.5)
    scale = np.array(sizes)[row]
    parts = list(zip(dense.x, dense.t, dense.r, dense.u, dense.form, dense.servos, strict=True))
    blocks = [Products.of(*one).matrices(form_row=row) for one in parts]
    here = System(dense.candidates, dense.system.tolerances, blocks, (f, NONE))
    scaled = [Products.of(*one[:4], scale[:, None] * one[4], one[5]).matrices() for one in parts]
    there = System(dense.candidates, dense.system.tolerances, scaled, (Form(1.0, 0.1), NONE))
    own, other = here.reduced(f), there.reduced(Form(1.0, 0.1))
    np.testing.assert_allclose(own.G, other.G, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(own.g, other.g, rtol=1e-8, atol=1e-9)
    assert own.log_evidence == pytest.approx(other.log_evidence - 1.5, rel=1e-10)
    one, two = (
        drawn(s, np.zeros(20000, int), np.random.default_rng(2))[s.form_errors[0]] for s in (here, there)
    )
    spread = np.sqrt(np.diag(np.cov(one[0])))
    assert np.cov(two[0]) / np.outer(spread, spread) == pytest.approx(
        np.cov(one[0]) / np.outer(spread, spread), abs=0.05
    )
    assert one[1].mean() + 1.5 == pytest.approx(two[1].mean(), abs=5 * one[1].std() / np.sqrt(20000))


@pytest.mark.parametrize("inserted", [False, True])
def test_draws_have_the_moments_of_the_whole_gaussian(dense, inserted):
    """At each error of form: products with columns, and log evidence of no effect less the first one's."""
    drawn_at, count = FORMS[-1], 40000
    weights = np.r_[0.7, np.zeros(7), 0.4, -0.5] if inserted else None
    data = drawn(dense.system, all_at(drawn_at, count), np.random.default_rng(5), mean=weights)
    truth = dense.covariance(drawn_at)
    shift = weights @ dense.columns if inserted else np.zeros(dense.residual.size)
    inverse = {f: np.linalg.inv(dense.covariance(f)) for f in FORMS}
    half = {f: 0.5 * np.linalg.slogdet(dense.covariance(f))[1] for f in FORMS}
    for f in FORMS:
        g, log, departures = data[f]
        for rows, seen in ((dense.columns, g), (np.concatenate(dense.t, axis=1), departures)):
            x = rows @ inverse[f]
            expected = x @ truth @ x.T
            sigma = np.sqrt(np.diag(expected))
            apart = (seen.mean(axis=1) - x @ shift) / sigma
            assert apart == pytest.approx(np.zeros(len(seen)), abs=5 / np.sqrt(count))
            scale = np.outer(sigma, sigma)
            np.testing.assert_allclose(np.cov(seen) / scale, expected / scale, atol=0.03)
        more = inverse[f] - inverse[NONE]
        middle = -0.5 * np.trace(more @ truth) - 0.5 * shift @ more @ shift - half[f] + half[NONE]
        apart = log - data[NONE][1]
        assert apart.mean() == pytest.approx(middle, abs=1e-9 + 5 * apart.std() / np.sqrt(count))


def test_an_effect_added_to_draws_is_one_that_was_drawn_with_them(dense):
    weights = np.r_[0.7, np.zeros(7), 0.4, -0.5]
    bare = drawn(dense.system, all_at(FORMS[-1], 4), np.random.default_rng(1))
    with_it = drawn(dense.system, all_at(FORMS[-1], 4), np.random.default_rng(1), mean=weights)
    added = DrawnData(dense.system, bare).with_effect(weights, range(4))
    for f in FORMS:
        assert added[f].g == pytest.approx(with_it[f].g, rel=1e-8)
        assert added[f].departures == pytest.approx(with_it[f].departures, rel=1e-8)
        between = added[f][1] - with_it[f][1] - (added[NONE][1] - with_it[NONE][1])
        assert between == pytest.approx(np.zeros(4), abs=1e-8)


def test_draws_are_weighed_as_data_are(dense):
    evidence = weigh(dense.system)
    each = {f: dense.system.reduced(f) for f in FORMS}
    data = {
        f: Drawn(r.g[:, None], np.array([r.log_evidence]), r.posterior.mean[:, None]) for f, r in each.items()
    }
    effects, none = effects_of(evidence, data)
    joint = logsumexp(none + effects[:, :, 0], axis=0) - logsumexp(none)
    assert joint == pytest.approx(list(evidence.effect.values()), rel=1e-8)


def test_vector_estimate_is_the_gaussian_conditional_mixed_over_scales_and_form():
    dense = Dense(effect=np.r_[np.zeros(7), 1.0, -0.5, 0.3])
    columns, logs, means, spreads = dense.at(3), [], [], []
    for f in FORMS:
        for t in dense.candidates[3].prior:
            whole = dense.covariance(f) + t**2 * columns.T @ columns
            gain = t**2 * columns @ np.linalg.inv(whole)
            logs.append(dense.log_density(f, more=t**2 * columns.T @ columns))
            means.append(gain @ dense.residual)
            spreads.append(np.diag(t**2 * np.eye(3) - t**2 * gain @ columns.T))
    share = np.exp(logs - logsumexp(logs))
    mean = share @ np.array(means)
    variance = share @ (np.array(spreads) + np.array(means) ** 2) - mean**2
    found = estimate(weigh(dense.system), 3, 0.9)
    assert found.size == pytest.approx(mean, rel=1e-6)
    assert found.hi - found.size == pytest.approx(1.6449 * np.sqrt(variance), rel=1e-4)


def test_separation_from_a_vector_is_what_no_combination_of_it_copies(dense):
    evidence = weigh(dense.system)
    inverse = np.linalg.inv(dense.covariance(evidence.form_error(0)))
    one = estimate(evidence, 0, 0.9).weights @ dense.at(0)
    root = np.linalg.cholesky(inverse).T
    y, h = root @ one, root @ dense.at(3).T
    left = y - h @ np.linalg.lstsq(h, y)[0]
    assert separation(evidence, 0, 3) == pytest.approx(left @ left, rel=1e-6)


def alone(system):
    return Linearised(system, [], [], {}, {})


def test_a_second_effect_is_weighed_with_the_first_one_free():
    dense = Dense(effect=np.r_[4.0, np.zeros(6), 1.5, -1.0, 1.0])
    evidence = weigh(dense.system)
    found, _ = explain(alone(evidence.system), ("heavy",))
    assert set(found.effects) == {"heavy", "off"}
    first = estimate(evidence, 0, 0.9).weights @ dense.at(0)
    free = 1e6 * np.outer(first, first)
    columns = dense.at(3)
    with_it, without = [], []
    for f in FORMS:
        power = first @ np.linalg.solve(dense.covariance(f), first)
        same = 0.5 * np.log(power)  # the freed direction itself counts for nothing at any error of form
        without.append(dense.log_density(f, more=free) + same)
        scales = dense.candidates[3].prior
        each = [dense.log_density(f, more=free + t**2 * columns.T @ columns) for t in scales]
        with_it.append(logsumexp(each) - np.log(3) + same)
    expected = logsumexp(with_it) - logsumexp(without)
    assert found.gains[1] == pytest.approx(expected, rel=1e-4)


def test_one_effect_that_explains_all_stands_alone():
    """Whichever came first: what is not needed beside a later one is dropped, and chance gains none."""
    dense = Dense(effect=np.r_[np.zeros(7), 1.5, -1.0, 1.0])
    evidence = weigh(dense.system)
    for first in ("off", "heavy", "late"):
        found, _ = explain(alone(evidence.system), (first,))
        assert found.effects == ("off",)
        assert found.gains == pytest.approx((evidence.effect["off"],))
    found, _ = explain(alone(evidence.system), ("heavy",), asked=True)
    assert found.effects == ("heavy", "off")


def test_sizes_of_several_effects_at_once_are_as_the_whole_posterior_has_them():
    """A scalar and a vector beside each other: mean and spread of each with the other one unknown too."""
    dense = Dense(effect=np.r_[2.0, np.zeros(6), 1.5, -1.0, 1.0])
    few = [*dense.candidates[:3], replace(dense.candidates[3], prior=np.array([3.0]))]
    evidence = weigh(replace(dense.system, candidates=few, form_errors=(FORMS[1],), _kept=Kept()))
    found = joint_estimates(evidence.system, (0, 3))
    columns = np.concatenate([dense.at(0) / dense.candidates[0].sizes[0], dense.at(3)])
    inverse = np.linalg.inv(dense.covariance(FORMS[1]))
    precision = columns @ inverse @ columns.T + np.diag([0.0, *[3.0**-2] * 3])
    mean = np.linalg.solve(precision, columns @ inverse @ dense.residual)
    spread = 1.6449 * np.sqrt(np.diag(np.linalg.inv(precision)))
    assert found[0].size == pytest.approx(mean[:1], rel=0.02)
    assert found[1].size == pytest.approx(mean[1:], rel=0.02)
    assert (found[0].hi - found[0].lo) / 2 == pytest.approx(spread[:1], rel=0.03)
    assert (found[1].hi - found[1].lo) / 2 == pytest.approx(spread[1:], rel=0.05)
    alone = estimate(evidence, 0, 0.9, given=np.r_[np.zeros(7), found[1].weights])
    assert np.all(found[0].hi - found[0].lo > alone.hi - alone.lo)


def test_two_effects_that_do_the_same_have_sizes_and_intervals():
    """As one of a user's own has that is in the library already: their sum is known, neither by itself."""
    dense = Dense(effect=np.r_[2.0, np.zeros(9)])
    twin = replace(dense.candidates[0], effect="heavy again")
    few = [dense.candidates[0], twin]
    same = [np.concatenate([x[:1], x[:1]]) for x in dense.x]
    blocks = [
        Products.of(x, t, r, u, form, servos).matrices()
        for x, t, r, u, form, servos in zip(
            same, dense.t, dense.r, dense.u, dense.form, dense.servos, strict=True
        )
    ]
    evidence = weigh(System(few, dense.system.tolerances, blocks, (FORMS[1],)))
    alone, found = estimate(evidence, 0, 0.9), joint_estimates(evidence.system, (0, 1))
    assert found[0].size + found[1].size == pytest.approx(alone.size, rel=0.1)
    assert all(np.isfinite([e.lo, e.hi]).all() for e in found)

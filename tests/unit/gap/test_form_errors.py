"""Errors of form of all terms together: found where they are, and none where there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from freqid.gap.infer import block_matrices
from freqid.gap.infer.block_matrices import Form, Products
from freqid.gap.infer.evidence import Weighing, weigh
from freqid.gap.infer.forms import common_form, forms_beside, likely_forms
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import OTHER, Candidate, Place
from freqid.gap.settings import (
    ACTUATOR_FORM,
    FORM_ALIKE,
    FORM_ERRORS,
    FORM_KIND_SPREAD,
    FORM_SPREAD,
    FORM_TYPICAL,
    SEPARATE,
)

ROWS = ("X", "Z", "M", "actuator/de", "kinematic/u", "kinematic/w")
NUMBERS, TERMS = 240, 12  # of each row
LARGEST = FORM_ERRORS[-1]
UNSEEN = 1.01 * FORM_TYPICAL  # which makes as much as the noise on one term: 1 / (30 sqrt(240))
LEAST = tuple(1.01 * ACTUATOR_FORM if name.startswith("actuator/") else UNSEEN for name in ROWS)


def stack(errors, seed=4):
    """Return a stack of rows whose own terms are wrong by given shares, beside noise of one."""
    rng = np.random.default_rng(seed)
    form = np.zeros((len(ROWS) * TERMS, len(ROWS) * NUMBERS))
    residual = rng.standard_normal(form.shape[1])
    for i, error in enumerate(errors):
        at, numbers = slice(i * TERMS, (i + 1) * TERMS), slice(i * NUMBERS, (i + 1) * NUMBERS)
        form[at, numbers] = 30.0 * rng.standard_normal((TERMS, NUMBERS))
        residual += error * rng.standard_normal(TERMS) @ form[at]
    none = np.zeros((0, residual.size))
    block = Products.of(none, none, residual, none, form, none).matrices(
        form_row=np.repeat(np.arange(len(ROWS)), TERMS)
    )
    return System([], (), [block], (Form((LARGEST,) * len(ROWS), 0.0),))


def best(system):
    forms = likely_forms(system, ROWS, np.full(len(ROWS), 0.05))
    return max(forms, key=lambda f: system.reduced(f).log_evidence).loads


def test_a_simulation_without_errors_of_form_has_none():
    assert np.all(best(stack((0.0,) * 6)) <= np.array(LEAST))


def test_no_record_makes_a_load_better_than_those_of_a_good_simulation():
    quiet = stack((0.0,) * 6)
    quiet = replace(quiet, blocks=[replace(b, form=30 * b.form) for b in quiet.blocks])
    for form in likely_forms(quiet, ROWS, np.full(len(ROWS), 0.05)):
        assert np.all(np.array(form.loads[:3]) >= 0.999 * FORM_TYPICAL)
        assert max(form.loads[4:]) < FORM_TYPICAL  # relations between sensors are no simulation


@pytest.mark.parametrize(
    "errors", [(0.1, 0.1, 0.1, 0, 0, 0), (0.0, 0.0, 0.2, 0, 0, 0), (0, 0, 0, 0.05, 0, 0.02)]
)
def test_each_row_has_the_error_that_its_data_have(errors):
    for found, there, least in zip(best(stack(errors)), errors, LEAST, strict=True):
        assert there / 2.1 <= found <= max(2.1 * there, least)


def test_one_term_that_is_wrong_does_not_make_its_whole_row_uncertain():
    """Eleven derivatives of a load are right to .3 %, and one is missing: each has the size that it has."""
    rng = np.random.default_rng(2)
    names = [f"N by {k}" for k in range(12)]
    form = 30.0 * rng.standard_normal((12 * 4, NUMBERS))
    there = np.where(np.arange(12) == 5, 0.3, 0.003)
    residual = rng.standard_normal(NUMBERS) + np.repeat(there, 4) * rng.standard_normal(48) @ form
    none = np.zeros((0, NUMBERS))
    block = Products.of(none, none, residual, none, form, none).matrices(form_row=np.repeat(np.arange(12), 4))
    system = System([], (), [block], ())
    found = np.array(likely_forms(system, names, np.full(12, 0.01))[0].loads)
    assert 0.1 < found[5] < 0.9
    others = np.delete(found, 5)
    assert np.all(others < 0.02)
    assert 0.001 < np.median(others) < 0.01


def test_slopes_of_the_evidence_are_those_of_the_dense_density():
    """Of errors of form that each block has of its own, and of those that are the same in both."""
    rng = np.random.default_rng(3)
    count, sizes = 40, np.array([0.3, 0.05, 1.1])
    row, beside, alike = np.repeat(np.arange(3), 4), np.array([[0.7, -0.2]]), np.array([2, 0, 2])
    parts = [[rng.standard_normal((k, count)) for k in (2, 3, 2, 12, 3)] for _ in range(2)]
    residuals = [2.0 * rng.standard_normal(count) for _ in parts]
    blocks = [
        Products.of(x, t, r, o, d, a).matrices(form_row=row, shared_row=alike)
        for (x, t, o, d, a), r in zip(parts, residuals, strict=True)
    ]
    pair = Candidate("pair", Place("", ("a", "b")), "vector", np.ones(2), np.ones(1), [])
    system = System([pair], ("a", "b", "c"), blocks, ()).beside(beside)

    def density(log_sizes, shared):
        form, same = np.exp(log_sizes)[row, None], shared * np.exp(log_sizes)[alike, None]
        whole = np.concatenate([np.concatenate([t, beside @ x, same * a]) for x, t, _, _, a in parts], axis=1)
        covariance = np.eye(2 * count) + whole.T @ whole
        for k, (_, _, o, d, _) in enumerate(parts):
            at = slice(k * count, (k + 1) * count)
            wrong = form * d
            covariance[at, at] += o.T @ o + wrong.T @ wrong
        y = np.concatenate(residuals)
        return -0.5 * (np.linalg.slogdet(covariance)[1] + y @ np.linalg.solve(covariance, y))

    step, at = 1e-5 * np.eye(3), np.log(sizes)
    for shared in (0.0, 1.5):
        log, slope, _ = system.slope(Form(tuple(sizes), shared))
        expected = [(density(at + e, shared) - density(at - e, shared)) / 2e-5 for e in step]
        np.testing.assert_allclose(slope, expected, rtol=1e-5, atol=1e-6)
        assert log == pytest.approx(density(at, shared), rel=1e-9)  # own unknowns of every size count
        higher, *_ = system.slope(Form(tuple(2 * sizes), shared))
        change = density(at + np.log(2), shared) - density(at, shared)
        assert higher - log == pytest.approx(change, rel=1e-9)


def test_own_unknowns_of_another_size_are_those_that_are_made_at_it():
    rng = np.random.default_rng(5)
    x, t, o, d, a = (rng.standard_normal((k, 40)) for k in (2, 3, 4, 6, 3))
    residual, sizes = rng.standard_normal(40), np.array([0.0, 0.5, 1.0, 3.0])
    sized = Products.of(x, t, residual, o, d, a).with_own_sizes(sizes).matrices()
    anew = Products.of(x, t, residual, sizes[:, None] * o, d, a).matrices()
    for name in ("gram", "own_half"):
        np.testing.assert_allclose(getattr(sized, name), getattr(anew, name), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(sized.data.columns, anew.data.columns, rtol=1e-10, atol=1e-12)
    assert sized.data.energy == pytest.approx(anew.data.energy)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("alike", [0.0, FORM_ALIKE])
def test_the_search_ends_at_the_largest_evidence(seed, alike):
    """Which another search finds that takes its time: within .2 nats, prior of the sizes and all."""
    rng = np.random.default_rng(seed)
    names = tuple(f"{load} by {k}" for load in "YLN" for k in range(8))
    row, there = np.repeat(np.arange(24), 3), np.exp(rng.normal(np.log(0.01), 1.5, 24))
    blocks, same = [], rng.standard_normal(24)
    for _ in range(2):
        form, alone = 30.0 * rng.standard_normal((72, NUMBERS)), 30.0 * rng.standard_normal((24, NUMBERS))
        residual = rng.standard_normal(NUMBERS) + (there[row] * rng.standard_normal(72)) @ form
        residual += alike * (there * same) @ alone
        none = np.zeros((0, NUMBERS))
        products = Products.of(none, none, residual, none, form, alone)
        blocks.append(products.matrices(form_row=row, shared_row=np.arange(24)))
    system = System([], (), blocks, ())
    largest = np.full(24, LARGEST)
    found = next(f for f in likely_forms(system, names, np.full(24, 0.05)) if f.shared == alike)
    load = np.repeat(np.arange(3), 8)
    spread = FORM_SPREAD**2 * (np.eye(24) + (load[:, None] == load)) + FORM_KIND_SPREAD**2
    precision = np.linalg.inv(spread)

    def fall(x):
        log, slope, _ = system.slope(Form(tuple(np.exp(x)), alike))
        pull = precision @ (x - np.log(FORM_TYPICAL))
        return 0.5 * (x - np.log(FORM_TYPICAL)) @ pull - log, pull - slope

    bounds = [(np.log(1e-5), x) for x in np.log(largest)]
    slow = minimize(fall, np.full(24, np.log(0.01)), jac=True, method="L-BFGS-B", bounds=bounds, tol=1e-10)
    assert slow.success
    assert fall(np.log(found.loads))[0] < slow.fun + 0.2


def test_the_common_error_is_one_for_each_kind_of_row():
    found = common_form(stack((0.1, 0.1, 0.1, 0.0, 0.02, 0.02)), ROWS).loads
    assert found[0] == found[1] == found[2] == pytest.approx(0.1, rel=0.6)
    assert found[3] <= LEAST[3]
    assert found[4] == found[5] == pytest.approx(0.02, rel=0.6)


def test_one_row_that_is_poor_is_found_behind_a_valley():
    """All rows together at a middle size are less likely than none at all."""
    assert best(stack((0.0, 0.8, 0.0, 0.0, 0.0, 0.0)))[1] == pytest.approx(0.8, rel=0.6)


def test_a_second_effect_that_hides_in_the_form_of_several_rows_is_found_beside_the_first():
    """Alone, each of two effects that act in three rows leaves the other one to the form of all three."""
    rng = np.random.default_rng(1)
    plain = stack((0.0,) * 6)
    form = 30.0 * rng.standard_normal((3 * TERMS, 3 * NUMBERS))
    for i in range(3):  # every term is in one row
        outside = np.arange(3 * NUMBERS) // NUMBERS != i
        form[i * TERMS : (i + 1) * TERMS, outside] = 0.0
    effects = np.stack([0.05 * rng.standard_normal(3 * TERMS) @ form for _ in range(2)])
    residual = rng.standard_normal(3 * NUMBERS) + effects.sum(axis=0)
    none = np.zeros((0, residual.size))
    block = Products.of(effects, none, residual, none, form, none).matrices(
        form_row=np.repeat(np.arange(3), TERMS)
    )
    prior = np.geomspace(0.05, 10.0, 33)
    both = [Candidate(n, Place("", (n,)), "scalar", np.ones(1), prior, []) for n in ("one", "other")]
    hidden = Form((0.05, 0.05, 0.05), 0.0)
    system = replace(plain, candidates=both, blocks=[block], form_errors=(hidden,))
    forms = forms_beside(system, ROWS[:3], [np.array([[1.0, 0.0]]), np.eye(2)])
    assert forms[0] == hidden
    left = {f: system.reduced(f).freed(np.array([[1.0, 0.0]])) for f in forms}
    second = {f: x.log_evidence + Weighing(system).of_place(1, x) for f, x in left.items()}
    assert max(max(second, key=second.get).loads) <= UNSEEN
    assert max(second.values()) - max(x.log_evidence for x in left.values()) > SEPARATE
    known = second[hidden] - left[hidden].log_evidence
    assert known < max(second.values()) - left[hidden].log_evidence - SEPARATE


def test_terms_may_be_wrong_alike_in_all_blocks():
    """The evidence is the mean of that of noise and of terms off by shares of one draw."""
    rng = np.random.default_rng(5)
    terms, count = 4, 60
    columns = [30.0 * rng.standard_normal((terms, count)) for _ in range(2)]
    off = 0.03 * rng.standard_normal(terms)
    residuals = [rng.standard_normal(count) + off @ x for x in columns]
    none, none_at = np.zeros((0, count)), np.zeros(0, dtype=int)
    blocks = [
        Products.of(x, none, r, none, none, x).matrices(form_row=none_at, shared_row=np.arange(terms))
        for x, r in zip(columns, residuals, strict=True)
    ]
    labels = tuple(f"Z:{k}" for k in range(terms))
    free = Candidate(OTHER, Place("", labels), "vector", np.ones(terms), np.array([0.3]), [])
    system = System([free], (), blocks, tuple(Form((0.03,) * terms, alike) for alike in (0.0, 1.0)))
    found = weigh(system)
    x, y = np.concatenate(columns, axis=1), np.concatenate(residuals)

    def density(size):
        covariance = np.eye(y.size) + size**2 * x.T @ x
        return -0.5 * (np.linalg.slogdet(covariance)[1] + y @ np.linalg.solve(covariance, y))

    both = np.array([density(0.0), density(0.03)])
    expected = np.logaddexp(*both) - np.log(2)
    assert found.log_none == pytest.approx(expected, rel=1e-9)
    wider = [density(0.3), density(np.hypot(0.3, 0.03))]  # free changes beside them
    assert found.places[:, 0] == pytest.approx(wider - both, rel=1e-6)
    assert found.candidate[0] < 0  # an error of form, not a gap


def _parts(rng, count=50):
    """Return random columns of candidates, tolerances, own unknowns, a form and shared errors; a residual."""
    x, t, o, d, a = (rng.standard_normal((k, count)) for k in (4, 3, 2, 9, 2))
    return x, t, 2.0 * rng.standard_normal(count), o, d, a


def test_louder_noise_is_smaller_columns():
    x, t, r, o, d, a = _parts(np.random.default_rng(8))
    row, alike, form = np.repeat(np.arange(3), 3), np.array([0, 2]), Form((0.3, 0.05, 1.1), 0.0)
    louder = Products.of(x, t, r, o, d, a).matrices(1.7, row, alike)
    smaller = Products.of(*(part / 1.7 for part in (x, t, r, o, d, a))).matrices(1.0, row, alike)
    for one in ("gram", "form"):
        np.testing.assert_allclose(getattr(louder, one), getattr(smaller, one), atol=1e-12)
    np.testing.assert_allclose(louder.at_loads(form.loads), smaller.at_loads(form.loads), atol=1e-12)


def test_a_form_is_factored_once_whatever_is_asked_beside_it(monkeypatch):
    made, lower = [], block_matrices.lower_of
    monkeypatch.setattr(block_matrices, "lower_of", lambda gram: made.append(gram) or lower(gram))
    x, t, r, o, d, a = _parts(np.random.default_rng(9))
    products, row = Products.of(x, t, r, o, d, a), np.repeat(np.arange(3), 3)
    block, form = products.matrices(form_row=row), Form((0.3, 0.05, 1.1), 0.0)
    place, one = Place("", ("a",)), np.ones(1)
    candidates = [Candidate(str(i), place, "vector", one, one, []) for i in range(4)]
    system = System(candidates, ("a", "b", "c"), [block], (form,))
    whole, few = system.gram(form), system.of([2, 0]).gram(form)
    np.testing.assert_allclose(few, whole[np.ix_([2, 0, 4, 5, 6, 7], [2, 0, 4, 5, 6, 7])], atol=1e-12)
    changed = replace(products, gram=2 * products.gram)  # other columns beside the same form
    changed.matrices(form_row=row).taken(form.loads)
    assert len(made) == 1
    products.beside(2 * o, (x, t, a), r, _Plain(d)).matrices(form_row=row).taken(form.loads)
    assert len(made) == 2  # other own unknowns: another metric


def test_other_data_are_weighed_in_the_metric_that_there_is():
    """Beside some candidates, and with a tolerance held, too: as a stack that is made anew of these data."""
    rng = np.random.default_rng(10)
    x, t, r, o, d, a = _parts(rng)
    rows = {"form_row": np.repeat(np.arange(3), 3), "shared_row": np.array([0, 2])}
    forms = (Form((0.3, 0.05, 1.1), 0.0), Form((0.3, 0.0, 0.2), 1.5, -2.0))
    place, one = Place("", ("a",)), np.ones(1)
    candidates = [Candidate(str(i), place, "vector", one, one, []) for i in range(4)]
    products, names, other = Products.of(x, t, r, o, d, a), ("a", "b", "c"), rng.standard_normal(50)
    block = products.matrices(**rows)
    system = System(candidates, names, [block], forms)
    known = [system.metric(f) for f in forms]
    moved = products.with_residual(other, (x, t, a), o, _Plain(d))
    again = system.with_data([block.with_data(moved.data_beside_own)])
    fresh = System(candidates, names, [Products.of(x, t, other, o, d, a).matrices(**rows)], forms)
    assert all(again.metric(f) is metric for f, metric in zip(forms, known, strict=True))
    weights = np.array([0.0, 0.4, 0.0, -1.0])
    for some in (lambda s: s, lambda s: s.of([2, 0]), lambda s: s.held({1: 0.7}, weights)):
        for f in forms:
            found, expected = (some(s).reduced(f) for s in (again, fresh))
            for name in ("G", "g", "log_evidence"):
                np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-9)
            for part, right in zip(found.posterior, expected.posterior, strict=True):
                np.testing.assert_allclose(part, right, atol=1e-11)
            asked = [
                some(s).misfit(f, np.zeros(len(some(s).tolerances)), np.zeros(some(s).columns))
                for s in (again, fresh)
            ]
            assert asked[0] == pytest.approx(asked[1], rel=1e-9)


class _Plain:
    """A form of plain rows, with what `Products.beside` asks of one."""

    def __init__(self, rows):
        self.rows = rows

    def across(self, columns):
        return self.rows @ columns.T

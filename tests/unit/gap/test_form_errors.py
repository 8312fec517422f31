"""Errors of form of all rows together: found where they are, and none where there is none."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from freqid.gap.infer.evidence import Weighing
from freqid.gap.infer.forms import _log_prior, common_form, forms_beside, likely_forms
from freqid.gap.infer.system import BlockMatrices, Form, System
from freqid.gap.model.candidates import Candidate, Place
from freqid.gap.settings import FORM_ERRORS, SEPARATE

ROWS = ("X", "Z", "M", "actuator/de", "kinematic/u", "kinematic/w")
NUMBERS, TERMS = 240, 12  # of each row
LARGEST = FORM_ERRORS[-1]
UNSEEN = 0.002  # an error that makes as much as the noise on one term: 1 / (30 sqrt(240))


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
    block = BlockMatrices.of(
        none, none, residual, none, form, none, form_row=np.repeat(np.arange(len(ROWS)), TERMS)
    )
    return System([], np.zeros(1, int), (), [block], (Form((LARGEST,) * len(ROWS), 0.0),))


def best(system):
    forms = likely_forms(system, ROWS)
    return max(forms, key=lambda f: system.reduced(f).log_evidence).loads


def test_a_simulation_without_errors_of_form_has_none():
    assert max(best(stack((0.0,) * 6))) <= UNSEEN


@pytest.mark.parametrize(
    "errors", [(0.1, 0.1, 0.1, 0, 0, 0), (0.0, 0.0, 0.2, 0, 0, 0), (0, 0, 0, 0.05, 0, 0.02)]
)
def test_each_row_has_the_error_that_its_data_have(errors):
    for found, there in zip(best(stack(errors)), errors, strict=True):
        assert there / 2.1 <= found <= max(2.1 * there, UNSEEN)


def test_rows_that_are_alike_are_likelier_than_one_that_is_apart():
    alike, near, apart = (_log_prior(np.array(index)) for index in ((3, 3, 3), (3, 4, 3), (3, 9, 3)))
    assert alike > near > apart
    every = itertools.product(range(len(FORM_ERRORS)), repeat=2)
    assert sum(np.exp(_log_prior(np.array(index))) for index in every) == pytest.approx(1.0)


def test_the_common_error_is_one_for_each_kind_of_row():
    found = common_form(stack((0.1, 0.1, 0.1, 0.0, 0.02, 0.02)), ROWS).loads
    assert found[0] == found[1] == found[2] == pytest.approx(0.1, rel=0.6)
    assert found[3] <= UNSEEN
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
    block = BlockMatrices.of(
        effects, none, residual, none, form, none, form_row=np.repeat(np.arange(3), TERMS)
    )
    prior = np.geomspace(0.05, 10.0, 33)
    both = [Candidate(n, Place("", (n,)), "scalar", np.ones(1), prior, []) for n in ("one", "other")]
    hidden = Form((0.05, 0.05, 0.05), 0.0)
    system = replace(plain, candidates=both, start=np.arange(3), blocks=[block], form_errors=(hidden,))
    forms = forms_beside(system, ROWS[:3], np.array([[1.0, 0.0]]))
    assert forms[0] == hidden
    left = {f: system.reduced(f).freed(np.array([[1.0, 0.0]])) for f in forms}
    second = {f: x.log_evidence + float(Weighing(system).of_place(1, x, x.g)) for f, x in left.items()}
    assert max(max(second, key=second.get).loads) <= UNSEEN
    assert max(second.values()) - max(x.log_evidence for x in left.values()) > SEPARATE
    known = second[hidden] - left[hidden].log_evidence
    assert known < max(second.values()) - left[hidden].log_evidence - SEPARATE

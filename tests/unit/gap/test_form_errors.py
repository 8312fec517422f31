"""Errors of form of all rows together: found where they are, and none where there is none."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from freqid.gap.infer.forms import _log_prior, common_form, likely_forms
from freqid.gap.infer.system import BlockMatrices, Form, System
from freqid.gap.settings import FORM_ERRORS

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

"""Terms of an error of form: a term that the simulation leaves out is one too."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import INPUTS, SLOPES, Linear, Truth, fly

from freqid.gap.model.form import load_errors
from freqid.gap.stack.block import stack_of


@pytest.fixture(scope="module")
def block():
    return stack_of(Linear(), [fly(Truth(), seed=1)], ["one"], (0.05, 2.0))[0]


def test_every_motion_may_be_missing_from_every_load_as_large_as_the_average_one_at_least(block):
    terms = load_errors(block)
    rows, spectra = [t.row for t in terms], np.array([t.spectrum for t in terms])
    size = np.sqrt((np.abs(spectra[:, 1:]) ** 2).sum(axis=1)).reshape(len(SLOPES), -1)
    record = block.trial.maneuver.record
    assert rows == [i for i in range(len(SLOPES)) for _ in INPUTS]
    moved = np.array([record[n].std() for n in INPUTS])
    own = np.abs(SLOPES) * moved
    average = np.sqrt((own**2).mean(axis=1, keepdims=True))
    heard = np.minimum((own / average).max(axis=0), 1.0)  # a motion that is small everywhere
    wanted = np.maximum(own, heard * average)
    np.testing.assert_allclose(size / size[:1], wanted / wanted[:1], rtol=0.02)

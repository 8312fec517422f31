"""Terms of an error of form: a term that the simulation leaves out is one too."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import INPUTS, SLOPES, Linear, Truth, fly

from freqid.gap.model.form import load_errors, load_products, shared_columns
from freqid.gap.settings import FORM_CONSTANT
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


def test_second_order_is_every_product_of_two_motions_as_large_as_the_average_term(block):
    products = load_products(block)
    pairs = len(INPUTS) * (len(INPUTS) + 1) // 2
    assert [t.row for t in products] == [i for i in range(len(SLOPES)) for _ in range(pairs)]
    record = block.trial.maneuver.record
    moved = np.array([record[n] - record[n].mean() for n in INPUTS])
    rms = np.abs(SLOPES) * moved.std(axis=1)
    average = np.sqrt((rms**2).mean(axis=1))
    heard = np.minimum((rms / average[:, None]).max(axis=0), 1.0)
    unit = heard[:, None] * moved / moved.std(axis=1, keepdims=True)
    wanted = average[-1] * block.grid.spectrum((unit[0] * unit[1])[None])[0]
    second = products[(len(SLOPES) - 1) * pairs + 1]  # of the last load, by the first motion and the next
    np.testing.assert_allclose(second.spectrum, wanted, rtol=1e-6, atol=1e-9)


def test_what_is_the_same_everywhere_is_a_share_of_the_derivative_and_of_the_average_term(block):
    """The last load by each motion: its own term with its sign, and the load's average term."""
    record, last = block.trial.maneuver.record, len(SLOPES) - 1
    moved = np.array([record[n] - record[n].mean() for n in INPUTS])
    rms = np.abs(SLOPES) * moved.std(axis=1)
    average = np.sqrt((rms**2).mean(axis=1))
    heard = np.minimum((rms / average[:, None]).max(axis=0), 1.0)
    found = shared_columns(block)
    assert found
    name = block.rows[last].name
    for k, motion in enumerate(INPUTS):
        z = block.grid.spectrum(moved[k][None])[0]
        own, other = (found[f"{name} by {motion}", which] for which in ("share", "average"))
        np.testing.assert_allclose(own[last], FORM_CONSTANT * SLOPES[last][k] * z, rtol=1e-6, atol=1e-9)
        wanted = FORM_CONSTANT * heard[k] * average[last] / moved[k].std() * z
        np.testing.assert_allclose(other[last], wanted, rtol=1e-6, atol=1e-9)
        assert not np.delete(own, last, axis=0).any()
        largest = np.where(np.abs(own[last]).sum() > np.abs(wanted).sum(), np.abs(own[last]), np.abs(wanted))
        of_top = block.lines.hz / block.lines.hz[-1]
        for which, part in (("rate", of_top / 2), ("curve", of_top**2 / 3)):
            changing = found[f"{name} by {motion}", which]
            np.testing.assert_allclose(np.abs(changing[last]), part * largest, rtol=1e-6, atol=1e-9)

"""Parameters that vary with the motion: the directions that are left make what all products make."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import Linear, fly
from test_beyond_tolerance import Declared

from freqid.gap.model.varying_parameters import varying_columns
from freqid.gap.settings import VARIATIONS
from freqid.gap.stack.block import stack_of


def block_of(simulation):
    return stack_of(simulation, [fly(noise=1.0, duration=40.0, seed=1)], ["one"], (0.05, 2.0))[0]


@pytest.fixture(scope="module")
def block():
    return block_of(Declared())


def product_by_product(block):
    """Return what each parameter makes of a block where it changes with each motion, one by one."""
    trial, record, found = block.drawn, block.drawn.maneuver.record, []
    for name, tolerance in trial.simulation.tolerances.items():
        up, down = (trial.simulation.predict(record, None, {name: s * tolerance.sigma}) for s in (1, -1))
        for moving in trial.inputs:
            move = (record[moving] - np.mean(record[moving])) / np.std(record[moving])
            found.append(block.transform(trial.rows(VARIATIONS[-1] * 0.5 * (up - down) * move)))
    return np.array(found)


def test_few_directions_make_what_all_products_make(block):
    made = block.white(np.array(list(varying_columns(block, {}).values())))
    one_by_one = block.white(product_by_product(block))
    covariance, expected = made.T @ made, one_by_one.T @ one_by_one
    largest = np.linalg.norm(expected, 2)
    assert largest > 1.0  # they are seen
    # a direction that is left out makes less than a hundredth of the noise's power
    assert np.linalg.norm(covariance - expected, 2) < 0.02
    assert len(made) < len(one_by_one)


def test_a_parameter_that_is_known_exactly_does_not_vary(block):
    assert varying_columns(block, dict.fromkeys(block.trial.simulation.tolerances, 0.0)) == {}


def test_a_simulation_without_parameters_of_its_own_has_none():
    assert varying_columns(block_of(Linear()), {}) == {}

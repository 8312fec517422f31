"""Parameters that vary with the motion: the directions that are left make what all products make."""

from __future__ import annotations

import numpy as np
import pytest
from linear_flight import LIBRARY, RESPONSES, SLOPES, U0, W0, Linear, fly
from test_beyond_tolerance import Declared

from freqid.gap.infer.build import build
from freqid.gap.model.tolerance import stated
from freqid.gap.model.varying_parameters import NAME, varying_columns
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


class WithWrongFormula(Declared):
    """Its pitch stiffness goes with the speed, as that of the truth does not."""

    def predict(self, record, effects=None, departures=None):
        found = super().predict(record, effects, departures)
        faster = (record["state/u"] - U0) / np.std(record["state/u"])
        found[RESPONSES.index("M")] += 0.05 * SLOPES[2, 1] * (record["state/w"] - W0) * faster
        return found


@pytest.mark.parametrize(("simulation", "vary"), [(Declared(), False), (WithWrongFormula(), True)])
def test_a_record_tells_whether_parameters_vary(simulation, vary):
    flights = [fly(noise=1.0, duration=40.0, seed=s, phases=s, reference=f"r{s}") for s in (1, 2)]
    blocks = stack_of(simulation, flights, ["one", "two"], (0.05, 2.0))
    at, _ = build(blocks, LIBRARY, stated({"dynamics": 0.02}, LIBRARY, simulation))
    largest = [
        max([np.linalg.norm(z) for n, z in zip(c.own_names, c.own, strict=True) if n.startswith(NAME)] or [0])
        for c in at.columns
    ]
    known = [np.linalg.norm(block_columns(b), axis=1).max() for b in at.blocks]
    for found, at_most in zip(largest, known, strict=True):  # at the largest share that is asked
        assert found == pytest.approx(at_most, rel=0.2) if vary else found < 0.1 * at_most


def block_columns(block):
    made = block.white(np.array(list(varying_columns(block, {}).values())))
    return made.reshape(len(made), -1)

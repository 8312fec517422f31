"""Terms of an error of form: a term that the simulation leaves out is one too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import INPUTS, SLOPES, Linear, Truth, fly

from freqid.gap.infer.build import build
from freqid.gap.infer.evidence import weigh
from freqid.gap.model.form import ALIKE_ACTUATOR, ALIKE_LOAD, actuator_terms, load_errors, shared_form
from freqid.gap.model.tolerance import stated
from freqid.gap.settings import FORM_CONSTANT
from freqid.gap.stack.block import stack_of
from freqid.simulate.effects import shipped


@pytest.fixture(scope="module")
def block():
    return stack_of(Linear(), [fly(Truth(), seed=1)], ["one"], (0.05, 2.0))[0]


def test_every_motion_may_be_missing_from_every_load_as_large_as_the_average_one_at_least(block):
    rows, spectra = load_errors(block)
    size = np.sqrt((np.abs(spectra[:, 1:]) ** 2).sum(axis=1)).reshape(len(SLOPES), -1)
    record = block.trial.maneuver.record
    assert rows == [i for i in range(len(SLOPES)) for _ in INPUTS]
    moved = np.array([record[n].std() for n in INPUTS])
    own = np.abs(SLOPES) * moved
    average = np.sqrt((own**2).mean(axis=1, keepdims=True))
    heard = np.minimum((own / average).max(axis=0), 1.0)  # a motion that is small everywhere
    wanted = np.maximum(own, heard * average)
    np.testing.assert_allclose(size / size[:1], wanted / wanted[:1], rtol=0.02)


def test_what_blocks_share_is_each_motion_in_each_load_and_each_kind_of_actuator(block):
    found = shared_form(block)
    rows, spectra = load_errors(block)
    loads = {key: z for key, z in found.items() if key[0].startswith(ALIKE_LOAD)}
    assert len(loads) == len(rows)
    for (kind, _), z, i, wanted in zip(loads, loads.values(), rows, spectra, strict=True):
        assert kind == f"{ALIKE_LOAD}{block.rows[i].name}"
        np.testing.assert_allclose(z[i], wanted)
        assert not np.delete(z, i, axis=0).any()
    rows, spectra = actuator_terms(block)
    first = found[f"{ALIKE_ACTUATOR}surface", "surface 0"]
    np.testing.assert_allclose(first[rows], spectra)  # the same share of the movement of each


@pytest.mark.parametrize("alike", [True, False])
def test_an_error_that_is_the_same_everywhere_is_not_counted_once_for_each_flight(alike):
    """What a simulation leaves out at one condition it leaves out at the next: one error, not four."""
    flights = [fly(noise=1.0, duration=40.0, seed=s, phases=s, reference=f"r{s}") for s in range(4)]
    blocks = stack_of(Linear(), flights, [f"r{s}" for s in range(4)], (0.05, 2.0))
    rows, spectra = zip(*(load_errors(b) for b in blocks), strict=True)
    rng = np.random.default_rng(3)
    wrong = 0.05 * rng.standard_normal((1 if alike else len(blocks), len(rows[0])))
    off = []
    for k, b in enumerate(blocks):
        z = np.zeros_like(b.residual)
        np.add.at(z, np.array(rows[k]), wrong[k % len(wrong), :, None] * spectra[k])
        off.append(replace(b, residuals=b.residuals + z))
    effects = {n: shipped()[n] for n in ("mass", "surface_effectiveness")}
    system, _, columns, _ = build(off, effects, stated({"derivatives": 0.0, "dynamics": 0.0}, effects))
    sizes = dict(zip(columns[0].form_names, weigh(system).form_sizes(), strict=True))
    own = np.mean([sizes[n] for n in ("X", "Z", "M")]) * FORM_CONSTANT
    shared = np.mean([sizes[f"{ALIKE_LOAD}{n}"] for n in ("X", "Z", "M")])
    there, absent = (shared, own) if alike else (own, shared)
    assert 0.02 < there < 0.1
    assert absent < there / (4 if alike else 1)  # the mean of four independent errors is half of one

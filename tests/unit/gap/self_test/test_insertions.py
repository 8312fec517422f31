"""Insertions have the detectability that was asked for, and are the effect's full formula."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.gap.infer.block_matrices import Form, Products
from freqid.gap.infer.seen_sizes import size_at
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import Candidate, Place
from freqid.gap.model.changes import change
from freqid.gap.self_test.insertions import insert

GOALS = (15.0, 200.0)


@pytest.fixture(scope="module")
def inserted(findings, used, library):
    return insert(findings.evidence, *used, library, GOALS, 0)


def of(findings, inserted, name):
    found = [i for i in inserted.insertions if findings.evidence.system.candidates[i.candidate].name == name]
    assert found, name
    return found


def test_every_effect_is_inserted_at_its_places_with_the_detectability_asked_for(findings, inserted, library):
    system = findings.evidence.system
    assert inserted.not_inserted == {}
    assert {system.candidates[i.candidate].effect for i in inserted.insertions} == set(library)
    names = {system.candidates[i.candidate].name for i in inserted.insertions}
    assert {"cg_offset@x", "cg_offset@all", "surface_effectiveness@de", "time_skew@rates"} <= names
    for i in inserted.insertions:
        assert i.detectability == pytest.approx(i.goal, rel=0.25)
        c = system.candidates[i.candidate]
        if c.kind == "scalar":
            assert c.bounds[0] <= i.size[0] <= c.bounds[1]


@pytest.mark.parametrize("name", ["mass", "unsteady_lift", "time_skew@velocity"])
def test_an_insertion_is_what_the_full_formula_makes_of_the_stack(findings, used, inserted, library, name):
    """Its products with all columns are those of a column that is computed here at that size."""
    blocks, columns = used
    system = findings.evidence.system
    for one in of(findings, inserted, name):
        c = system.candidates[one.candidate]
        effect = library[c.effect].of(blocks[0].trial.maneuver.vehicle)
        settings = dict.fromkeys(c.place.parameters, float(one.size[0]))
        fresh = [b.white(b.transform(change(effect, b.trial, settings)))[None] for b in blocks]
        matrices = [
            Products.of(
                np.concatenate([k.effects, z]), k.tolerances, k.residual, k.own, k.form, k.own[:0]
            ).matrices(form_row=k.form_row)
            for k, z in zip(columns, fresh, strict=True)
        ]
        unit = Candidate("inserted", Place("", ("size",)), "scalar", np.ones(1), np.ones(1), [])
        own = System([*system.candidates, unit], system.tolerances, matrices, ())
        rows = len(columns[0].form_names)
        for f in (Form((0.0,) * rows, 0.0), Form((0.02,) * rows, 0.0)):
            expected = own.reduced(f).G[-1]
            found = inserted.system.reduced(f).G @ one.weights
            # a candidate that counts as proportional may depart from it by three per cent
            close = 0.04 * np.sqrt(np.diag(own.reduced(f).G) * expected[-1])
            assert np.all(np.abs(found[: system.columns] - expected[:-1]) <= close[:-1] + 1e-9)


def test_a_computed_insertion_is_no_interpolation(findings, inserted):
    """Between two sizes of its columns an effect that is not proportional is another thing."""
    system, G = findings.evidence.system, inserted.system.reduced(inserted.form_error).G
    left = []
    for one in of(findings, inserted, "unsteady_lift"):
        c, at = system.candidates[one.candidate], system.columns_of(one.candidate)
        assert not one.weights[: system.columns].any()
        apart = one.weights.copy()
        apart[at] -= c.weights(float(one.size[0]))
        left.append(apart @ G @ apart / one.detectability)
    assert 1e-6 < max(left) < 0.05


def test_an_effect_that_cannot_be_so_visible_is_not_inserted_and_says_why(findings, used, library):
    found = insert(findings.evidence, *used, library, (1e12,), 0)
    assert found.insertions == []
    assert set(found.not_inserted) == set(library)
    assert "no size within its physical range" in found.not_inserted["mass"]


def test_the_size_of_a_detectability_goes_with_its_root_where_the_effect_is_proportional(findings):
    system = findings.evidence.system
    index = next(k for k, c in enumerate(system.candidates) if c.name == "mass")
    at = system.columns_of(index)
    G = system.reduced(Form(0.0, 0.0)).G[at, at]
    sizes = [size_at(system.candidates[index], G, goal, 1.0) for goal in (10.0, 40.0)]
    assert sizes[1] == pytest.approx(2 * sizes[0], rel=1e-9)
    assert size_at(system.candidates[index], G, 10.0, -1.0) == pytest.approx(-sizes[0])
    assert np.isnan(size_at(system.candidates[index], G, 1e12, 1.0))

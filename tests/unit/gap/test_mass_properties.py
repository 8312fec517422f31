"""Mass, centre of gravity and inertia that are off together, beside each by itself."""

from __future__ import annotations

from dataclasses import replace

import pytest
from linear_flight import Linear, fly

from freqid.gap.infer.build import build
from freqid.gap.infer.which import rank
from freqid.gap.model.changes import change
from freqid.gap.model.tolerance import stated
from freqid.gap.stack.block import stack_of
from freqid.simulate.effects import shipped

SINGLE = ("mass", "cg_offset", "inertia")
EFFECTS = {n: shipped()[n] for n in (*SINGLE, "mass_properties", "sensor_scale", "surface_effectiveness")}
TOLERANCES = stated({"derivatives": 0.02, "dynamics": 0.02}, EFFECTS)


def ranking(seed, **settings):
    """Return what is said of two flights with mass properties that are off, by the full formula."""
    flights = [fly(noise=1.0, duration=40.0, seed=s, phases=s, reference=f"r{s}") for s in (seed, seed + 1)]
    blocks = stack_of(Linear(), flights, ["one", "other"], (0.05, 2.0))
    effect = EFFECTS["mass_properties"]
    zero = dict.fromkeys(effect.parameters, 0.0)
    off = [b.transform(change(effect, b.trial, zero | settings)) for b in blocks]
    blocks = [replace(b, residuals=b.residuals + z) for b, z in zip(blocks, off, strict=True)]
    evidence = build(blocks, EFFECTS, TOLERANCES)[0].evidence
    return rank(evidence, True, 0.9, 1.0, 0.0)


@pytest.mark.parametrize("seed", [1, pytest.param(5, marks=pytest.mark.slow)])
def test_a_load_that_moves_all_of_them_leads(seed):
    found = ranking(seed, fraction=0.08, x=0.03, yy=0.06)
    assert next(iter(found.probabilities)) == "mass_properties"
    assert "mass_properties" in found.credible


@pytest.mark.parametrize(
    ("effect", "settings"),
    [("mass", {"fraction": 0.08}), ("cg_offset", {"x": 0.03}), ("inertia", {"yy": 0.3})],
)
def test_one_that_suffices_keeps_its_name(effect, settings):
    found = ranking(1, **settings)
    assert next(iter(found.probabilities)) == effect
    assert found.probabilities[effect] > found.probabilities["mass_properties"]


def test_all_parameters_are_off_together_only():
    """Each by itself is another effect already, and would share its odds with it."""
    flight = fly(noise=1.0, duration=20.0)
    blocks = stack_of(Linear(), [flight], ["one"], (0.05, 2.0))
    system = build(blocks, EFFECTS, TOLERANCES)[0].system
    (found,) = [c for c in system.candidates if c.effect == "mass_properties"]
    assert found.kind == "vector"
    assert {"fraction", "x", "yy"} <= set(found.place.parameters)
    assert dict(zip(found.place.parameters, found.units, strict=True))["x"] == "m"

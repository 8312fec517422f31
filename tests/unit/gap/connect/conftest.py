"""A flight of the tilt-wing that the connections are laid beside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from freqid.core.results.design import SampledInputs
from freqid.core.scenario import read_scenario
from freqid.simulate.control.lq import close_loop
from freqid.simulate.maneuver import Conditions, fly_maneuver

SCENARIO = Path(__file__).parents[4] / "scenarios" / "la8.toml"


def multisine(scenario, duration, seed=1):
    """Return one period of a multisine on every surface and rotor, lines of their own below 2 Hz."""
    rng, time = np.random.default_rng(seed), np.arange(round(50 * duration) + 1) / 50
    moved = [e for e in scenario.effector if e.kind != "tilt"]
    values = []
    for i, effector in enumerate(moved):
        lines = np.arange(2 + i, 2 * duration, len(moved))
        phases = rng.uniform(0, 2 * np.pi, lines.size)
        signal = np.sin(2 * np.pi * lines[:, None] * time / duration + phases[:, None]).sum(axis=0)
        values.append(
            (np.radians(2) if effector.kind == "surface" else 8.0) * signal / np.sqrt(lines.size / 2)
        )
    names, units = (tuple(getattr(e, a) for e in moved) for a in ("name", "unit"))
    return SampledInputs(names, units, time, np.array(values))


@pytest.fixture(scope="session")
def la8():
    return read_scenario(SCENARIO)[0]


@pytest.fixture(scope="session")
def flown(la8):
    """Return flights of 20 s by reference and multiple of the research sensors' noise, each flown once."""
    found = {}

    def fly(reference, noise=0.0):
        if (reference, noise) not in found:
            at = la8.reference_of(reference)
            if reference not in found:
                found[reference] = close_loop(la8, at)
            found[reference, noise] = fly_maneuver(
                la8, at, multisine(la8, 20.0), Conditions(noise=noise), loop=found[reference]
            )
        return found[reference, noise]

    return fly


@pytest.fixture(scope="session")
def inputs(la8):
    return multisine(la8, 20.0)

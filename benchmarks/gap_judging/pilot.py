"""Inputs of a pilot or of a simple flight computer, one effector after another: they drive every line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

PEAK = 2.5  # of the multisine's root mean square
UNIT = 0.35  # s, of a 3-2-1-1
EDGE = 0.15  # s, of each step: no servo meets the limit of its rate, which owners do not have


def pilot_inputs(scenario: dict[str, Any], time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return three designs, shape (3, effector, sample): 3-2-1-1s, doublets with sweeps, doublets in pairs.

    Each effector has its own slot of the period, in another order in each design.
    """
    period = scenario["excitation"]["period_s"]
    amplitude = scenario["excitation"]["amplitude"]
    names = [e["name"] for e in scenario["effector"]]
    driven = list(amplitude)
    slot = period / len(driven)
    out = np.zeros((3, len(names), time.size))
    for design, shape in enumerate((three_two_one_one, doublet_and_sweep, doublets)):
        order = np.random.default_rng(design).permutation(driven)
        for k, name in enumerate(order):
            since = np.mod(time, period) - k * slot
            out[design, names.index(name)] = PEAK * amplitude[name] * shape(since, slot)
    return out


def three_two_one_one(since: NDArray[np.float64], slot: float) -> NDArray[np.float64]:
    """Return a 3-2-1-1 of steps of one, at the slot's begin."""
    return steps(since, min(UNIT, 0.9 * slot / 7), (3, -2, 1, -1))


def doublet_and_sweep(since: NDArray[np.float64], slot: float) -> NDArray[np.float64]:
    """Return a doublet of 1 s, then a sweep from 0.3 to 2 Hz for the rest of the slot but a tenth."""
    end = 0.9 * slot
    within = np.clip(since - 1.2, 0, end - 1.2)
    turns = 0.3 * within + 0.5 * (2.0 - 0.3) / (end - 1.2) * within**2
    faded = np.clip((end - since) / EDGE, 0, 1)
    return steps(since, 0.5, (1, -1)) + faded * np.sin(2 * np.pi * turns)


def doublets(since: NDArray[np.float64], slot: float) -> NDArray[np.float64]:
    """Return a slow and a quick doublet."""
    unit = 0.9 * slot / 6
    return steps(since, unit, (-2, 2)) + steps(since - 4 * unit, unit, (1, -1))


def steps(since: NDArray[np.float64], unit: float, lasting: tuple[int, ...]) -> NDArray[np.float64]:
    """Return steps of one that last so many units, with their signs; each edge is a ramp."""
    ends = unit * np.cumsum([0, *np.abs(lasting)])
    jumps = np.diff([0, *np.sign(lasting), 0])
    return sum(j * np.clip((since - t) / EDGE, 0, 1) for j, t in zip(jumps, ends, strict=True))

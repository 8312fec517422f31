"""The linear aircraft of the examples, its loop and a multisine design, for the tests of the forecast."""

from pathlib import Path

import numpy as np

from freqid.core.results.design import Multisine, MultisineDesign
from freqid.core.scenario import read_scenario

SCENARIO = read_scenario(Path(__file__).resolve().parents[3] / "scenarios" / "linear.toml")[0]
VEHICLE = SCENARIO.aircraft()
GAINS = {"de": {"theta": 0.35, "q": 0.05}, "da": {"phi": -0.3, "p": -0.05}}
AMPLITUDE = {"de": 0.06, "da": 0.05, "dr": 0.06, "n1": 25.0}
NOISE = dict.fromkeys("uvw", 0.15) | dict.fromkeys("pqr", 0.0017) | dict.fromkeys(("ax", "ay", "az"), 0.1)
NOISE |= dict.fromkeys(("de", "da", "dr"), 0.0009) | {"n1": 0.84}


def design(combs=None, period_s=20.0, periods=2, band_hz=(0.1, 1.5), dt_s=0.02, seed=0):
    """Return multisines on interleaved or given harmonics, flat power, random phases."""
    rng = np.random.default_rng(seed)
    lines = np.arange(round(band_hz[0] * period_s), round(band_hz[1] * period_s) + 1)
    signals = []
    for i, (name, amplitude) in enumerate(AMPLITUDE.items()):
        index = np.array(combs[name]) if combs else lines[i :: len(AMPLITUDE)]
        size = np.full(index.size, amplitude * np.sqrt(2 / index.size))
        unit = VEHICLE.effector(name).unit
        signals.append(Multisine(name, unit, index, size, rng.uniform(0, 2 * np.pi, index.size)))
    return MultisineDesign(tuple(signals), period_s, periods, band_hz, dt_s, seed)

"""Models of the tilt-wing that is written down in `tilt_wing`, for all tests of exports."""

from functools import cache

import numpy as np
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up

SPEEDS = (0.0, 4.0, 9.0, 14.0, 25.0)
SEA, HIGH = 1.225, 1.058


@cache
def point():
    return tilt_wing.exact_point(tilt_wing.trim(9.0, SEA), "u9", seed=3)


def _points(rho):
    sea = [tilt_wing.trim(u, SEA)["dw1"] for u in SPEEDS]
    trims = [tilt_wing.trim(u, rho, tilt) for u, tilt in zip(SPEEDS, sea, strict=True)]
    return [tilt_wing.exact_point(at, f"u{at['u']:g}-{rho}", seed=i) for i, at in enumerate(trims)]


@cache
def one_line():
    points = _points(SEA)
    return GlobalModel(line_up(points, [p.reference.id for p in points]))


@cache
def two_lines():
    points = _points(SEA) + _points(HIGH)
    return GlobalModel(line_up(points, [p.reference.id for p in points]))


def states(model, count, seed):
    """Return states up to 40 % of the tolerance beside the corridor; the exports make their own otherwise."""
    rng = np.random.default_rng(seed)
    c = model.corridor
    rho = rng.uniform(c.rho.min(), c.rho.max(), count)
    speed = rng.uniform(1.0, 22.0, count)
    at = model.reference(speed, rho)
    off = {n: 0.4 * rng.uniform(-1, 1, count) for n in model.inputs}
    size = {"u": 4.0, "dw1": np.deg2rad(5), "dw2": np.deg2rad(5), "rho": 0.0}
    size |= {n: 3 * tilt_wing.MOVED[n] * (500 if n[0] == "n" else 1) for n in tilt_wing.INPUTS if n != "u"}
    return {n: at[n] + size[n] * off[n] for n in model.inputs}

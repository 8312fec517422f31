"""A global model of the tilt-wing that is written down in a page, and a loop file for it."""

from __future__ import annotations

from dataclasses import replace

import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up

SPEEDS = (6.0, 9.0, 14.0)
LOOP = """
name = "attitude hold"
[signals]
q = "deg/s"
theta = "deg"
p = "deg/s"
phi = "deg"
[commands]
dr = "deg"
da = "deg"
[gains.dr]
q = 0.4
theta = 1.0
[integral_gains.dr]
theta = 0.3
[gains.da]
p = -0.2
phi = -0.6
[actuator.default]
frequency_hz = 6.0
damping = 0.7
lag_s = 0.03
"""


def aircraft() -> GlobalModel:
    """Return the blended model, which knows its vehicle."""
    trims = [tilt_wing.trim(u, 1.1, tilt_wing.trim(u, 1.225)["dw1"]) for u in SPEEDS]
    points = [replace(tilt_wing.exact_point(at, f"u{at['u']:g}"), aircraft=tilt_wing.VEHICLE) for at in trims]
    return GlobalModel(line_up(points, [p.reference.id for p in points]))

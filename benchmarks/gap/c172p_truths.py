"""What the c172p flies: effects of the library, none by the candidate's formula, and none of them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass

import c172p_edits as edits
import numpy as np
from c172p_craft import Craft
from log_truths import bending, compressed, hysteresis, shaken_gyro, skewed
from truth import Truth


def _unedited(craft: Craft, size: float, place: str) -> Craft:
    del size, place
    return craft


@dataclass(frozen=True)
class Edited(Truth):
    """A truth of JSBSim's aircraft.

    Attributes
    ----------
    craft : callable
        ``craft(craft, size, place)``: the aircraft, edited.
    """

    craft: Callable[[Craft, float, str], Craft] = _unedited

    @property
    def logged(self) -> bool:
        """Whether nothing but the log is another: the aircraft is not edited either."""
        return super().logged and self.craft is _unedited


INSIDE = (
    Edited("actuator_delay", "pade", 0.02, 0.15, ("elevator", "", "aileron", "rudder"), craft=edits.pade),
    Edited("actuator_lag", "two lags", 0.02, 0.5, craft=edits.two_lags),
    Edited("rate_limit", "apart", 6.0, 90.0, craft=edits.limited),
    Edited("backlash", "jsbsim", 0.01, 0.1, craft=edits.played),
    Edited(
        "surface_effectiveness", "uneven", 0.2, 0.9, ("elevator", "aileron", "rudder", ""), craft=edits.less
    ),
    Edited("extra_drag", "cd0", 0.5, 8.0, craft=edits.coefficients(lambda k: {"CDo": 1 + k})),
    Edited("mass", "ballast", 0.1, 0.6, ("", "-"), craft=edits.heavier),
    Edited("cg_offset", "moved", 0.05, 0.4, ("x", "-x", "z", "y"), craft=edits.off_centre),
    Edited("inertia", "edited", 0.15, 1.0, ("yy", "xx", "zz"), craft=edits.turned_harder),
    Edited("sensor_bias", "warming", 0.05, 10.0, ("theta", "q", "w", "p", "u"), record=edits.warming),
    Edited("sensor_scale", "compressed", 0.05, 0.9, ("q", "az", "p", "surface"), record=compressed),
    Edited(
        "time_skew",
        "pade",
        0.01,
        0.2,
        ("rates", "velocity", "accelerometers", "attitude", "effectors"),
        record=skewed,
    ),
    Edited("lever_arm", "moved", 0.2, 5.0, ("x", "-y", "z"), craft=edits.accelerometer),
    Edited(
        "misalignment", "crossed", 0.02, 0.5, ("imu_z", "velocity_y", "imu_x", "imu_y"), record=edits.askew
    ),
    Edited("flow_upwash", "by lift", 0.1, 1.5, ("alpha", "-alpha", "beta"), record=edits.bent_flow),
    Edited(
        "steady_wind", "jsbsim", 2.0, 14.0, ("north", "east", "-north", "down"), craft=edits.wind, rises=True
    ),
    Edited("stall", "early", 0.5, 1.5, craft=edits.rounded),
    Edited("unsteady_lift", "half", 0.05, 1.0, craft=edits.late_circulation),
    Edited(
        "downwash_lag",
        "alpha dot",
        1.0,
        12.0,
        craft=edits.coefficients(lambda k: {"Cmadot": 1 + k, "CLadot": 1 + 1.3 * k}),
    ),
    Edited("flexible_mode", "softer", 0.1, 3.0, record=bending),
)
"""One truth an effect that means something to this aircraft, none of them by the candidate's formula."""

SECOND = (
    Edited("actuator_delay", "waits", 0.02, 0.15, ("elevator", "", "aileron"), craft=edits.waits),
    Edited("extra_drag", "induced", 0.3, 5.0, craft=edits.coefficients(lambda k: {"CDwbh": 1 + k})),
)
"""Other forms of the same."""


# --- none of the library -----------------------------------------------------------------------------------


def _icing(craft: Craft, size: float, place: str) -> Craft:
    """Less lift for the angle, and much more drag."""
    del place
    for name, factor in {"CLwbh": 1 - 0.3 * size, "CDo": 1 + 4 * size, "CDwbh": 1 + size}.items():
        craft.times(name, factor)
    return craft


def _one_wing(craft: Craft, size: float, place: str) -> Craft:
    """One wing that lifts less than the other: it rolls, and yaws as its drag falls."""
    del place
    lever = edits.PRESSURE + "<property>metrics/bw-ft</property><property>aero/alpha-rad</property>"
    craft.part("ROLL", f"<product>{lever}<value>{size}</value></product>")
    craft.part("YAW", f"<product>{lever}<value>{-0.2 * size}</value></product>")
    return craft


def _slosh(craft: Craft, size: float, place: str) -> Craft:
    """Fuel that hangs like a pendulum in the wings and leans to one side; its weight as a share."""
    del place
    w, z = 2 * np.pi * 0.6, 0.08
    c = (0.0, 2 * z * w, w * w, 1.0, 2 * z * w, w * w)
    terms = "".join(f"<c{i + 1}>{x}</c{i + 1}>" for i, x in enumerate(c))
    xml = '<second_order_filter name="fcs/slosh"><input>accelerations/a-pilot-y-ft_sec2</input>'
    craft.channel(ET.fromstring(f"{xml}{terms}</second_order_filter>"))
    mass = size * craft.weighed().weight / 32.174
    load = "<property>fcs/slosh</property>"
    still = "<property>accelerations/a-pilot-y-ft_sec2</property>"
    moved = f"<difference>{still}{load}</difference>"  # what is weighed with the rest does not follow it
    craft.part("SIDE", f"<product>{moved}<value>{mass}</value></product>")
    craft.part("ROLL", f"<product>{moved}<value>{2.3 * mass}</value></product>")
    return craft


def _sticky_valve(craft: Craft, size: float, place: str) -> Craft:
    """Return an engine whose valve sticks behind the throttle."""
    del place
    craft.behind("throttle", "<actuator {0}>{1}" + f"<hysteresis_width>{size}</hysteresis_width></actuator>")
    return craft


def _dead_zone(craft: Craft, size: float, place: str) -> Craft:
    """Return ailerons and a rudder that float free about the middle, not dragged along."""
    del place
    for control in ("aileron", "rudder"):
        craft.behind(control, "<deadband {0}>{1}" + f"<width>{size}</width></deadband>")
    return craft


def _hysteresis_of_lift(craft: Craft, size: float, place: str) -> Craft:
    """Return wings whose lift, once it has dropped, stays low until the angle is well below."""
    del place
    limits = next(craft.root.iter("hysteresis_limits"))
    for tag, value in (("min", edits.UP - 0.015), ("max", edits.UP + 0.01)):
        item = limits.find(tag)
        assert item is not None
        item.text = repr(value)
    data = next(craft.function("CLwbh").iter("tableData"))
    lines = (data.text or "").strip().splitlines()
    rows = [[float(x) for x in line.split()] for line in lines[1:]]
    table = "\n".join(f"{a} {x} {x - size * 0.2 * (a > 0.1)}" for a, x, _ in rows)
    data.text = f"\n{lines[0]}\n{table}\n"
    return craft


OUTSIDE = (
    Edited("outside_icing", "other", 0.3, 2.0, craft=_icing),
    Edited("outside_one_wing", "other", 0.02, 0.5, craft=_one_wing),
    Edited("outside_slosh", "other", 0.05, 0.5, craft=_slosh),
    Edited("outside_sticky_valve", "other", 0.05, 0.3, craft=_sticky_valve),
    Edited("outside_dead_zone", "other", 0.01, 0.2, craft=_dead_zone),
    Edited("outside_lift_hysteresis", "other", 0.3, 1.5, craft=_hysteresis_of_lift),
    Edited("outside_sticky_sensor", "other", 0.01, 0.2, record=hysteresis),
    Edited("outside_shaken_gyro", "other", 0.002, 0.1, record=shaken_gyro),
)


def find(identifier: str, form: str) -> Edited:
    """Return one truth."""
    return next(t for t in (*INSIDE, *SECOND, *OUTSIDE) if (t.id, t.form) == (identifier, form))

"""Truths that the c172p flies: edits of JSBSim's own description, of the air, or of the log."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from c172p_craft import RATE_HZ, STEPS, SURFACES, TRAVEL, Craft
from gap_c172p import FOOT
from truths import Truth, _bending, _compressed, _hysteresis, _shaken_gyro, _skewed

from freqid.core.record import FlightRecord

Array = np.ndarray
_PRESSURE = "<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>"
_UP = 0.17  # rad, where early stall begins


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


# --- between command and position, and behind it -----------------------------------------------------------


def _in_all(place: str) -> tuple[str, ...]:
    return (place,) if place else (*SURFACES, "throttle")


def _pade(craft: Craft, size: float, place: str) -> Craft:
    """Return commands late by a first-order Pade form."""
    for control in _in_all(place):
        xml = f"<c1>{-size / 2}</c1><c2>1</c2><c3>{size / 2}</c3><c4>1</c4>"
        craft.before(control, "<lead_lag_filter {0}>{1}" + xml + "</lead_lag_filter>")
    return craft


def _waits(craft: Craft, size: float, place: str) -> Craft:
    """Return commands late by JSBSim's own delay, in whole steps."""
    told = size + 1.001 / (STEPS * RATE_HZ)  # it waits one step less than it is told
    for control in _in_all(place):
        xml = f'<delay type="time">{told}</delay>'
        craft.before(control, "<actuator {0}>{1}" + xml + "</actuator>")
    return craft


def _two_lags(craft: Craft, size: float, place: str) -> Craft:
    """Return surfaces behind two lags of half the time each."""
    del place
    w = 2 / size
    for control in SURFACES:
        xml = f"<c1>0</c1><c2>0</c2><c3>{w * w}</c3><c4>1</c4><c5>{2 * w}</c5><c6>{w * w}</c6>"
        craft.before(control, "<second_order_filter {0}>{1}" + xml + "</second_order_filter>")
    return craft


def _limited(craft: Craft, size: float, place: str) -> Craft:
    """Return another rate limit for each surface."""
    del place
    for control, share in zip(SURFACES, (0.8, 1.0, 1.2), strict=True):
        xml = f"<rate_limit>{1 / (share * size * TRAVEL[control])}</rate_limit>"
        craft.before(control, "<actuator {0}>{1}" + xml + "</actuator>")
    return craft


def _played(craft: Craft, size: float, place: str) -> Craft:
    """Return surfaces behind JSBSim's hysteresis, the rudder's twice as wide as the others'."""
    del place
    for control, share in zip(SURFACES, (0.8, 0.8, 1.4), strict=True):
        xml = f"<hysteresis_width>{share * size}</hysteresis_width>"
        craft.behind(control, "<actuator {0}>{1}" + xml + "</actuator>")
    return craft


_MADE = {
    "elevator": {"Cmde": 1.0, "CLDe": 0.7},
    "aileron": {"ClDa": 1.0, "Cnda": 0.5},
    "rudder": {"Cndr": 1.0, "CYdr": 0.8, "Cldr": 0.6},
}


def _less(craft: Craft, size: float, place: str) -> Craft:
    """Return a surface whose moment falls by more than its force."""
    for control in (place,) if place else SURFACES:
        for name, share in _MADE[control].items():
            craft.times(name, 1 - share * size)
    return craft


# --- loads -------------------------------------------------------------------------------------------------


def _coefficients(factors: Callable[[float], Mapping[str, float]]) -> Callable[[Craft, float, str], Craft]:
    def craft(craft: Craft, size: float, place: str) -> Craft:
        for name, factor in factors(-size if place == "-" else size).items():
            craft.times(name, factor)
        return craft

    return craft


def _lift_table(craft: Craft, change: Callable[[Array, Array], Array]) -> Craft:
    """Change the lift curves ``change(alpha, lift)`` at steps of 0.005 rad, with hysteresis and without."""
    data = next(craft.function("CLwbh").iter("tableData"))
    rows = np.array([[float(x) for x in line.split()] for line in (data.text or "").strip().splitlines()[1:]])
    alpha = np.round(np.arange(-0.09, 0.3601, 0.005), 6)
    lift = [change(alpha, np.interp(alpha, rows[:, 0], rows[:, i])) for i in (1, 2)]
    table = "\n".join(f"{a:.6f} {x:.6f} {y:.6f}" for a, x, y in zip(alpha, *lift, strict=True))
    data.text = f"\n0.0 1.0\n{table}\n"
    return craft


def _rounded(craft: Craft, size: float, place: str) -> Craft:
    """Return wings whose lift curve bends early, and whose drag rises there."""
    del place

    def change(alpha: Array, lift: Array) -> Array:
        beyond = np.maximum(alpha - _UP, 0)
        return lift - size * 5 * beyond * np.tanh(beyond / 0.03)

    return _lift_table(craft, change)


def _late_circulation(craft: Craft, size: float, place: str) -> Craft:
    """Return wings half of whose lift follows the angle of attack by a lag of twice the time."""
    del place
    filters = f"<c1>{size}</c1><c2>1</c2><c3>{2 * size}</c3><c4>1</c4>"
    xml = f'<lead_lag_filter name="fcs/late-alpha"><input>aero/alpha-rad</input>{filters}</lead_lag_filter>'
    craft.channel(ET.fromstring(xml))
    late = "<property>fcs/late-alpha</property><property>aero/alpha-rad</property>"
    product = f"{_PRESSURE}<property>{craft.switch()}</property><difference>{late}</difference>"
    craft.part("LIFT", f"<product>{product}<value>5.0</value></product>")
    return craft


# --- mass --------------------------------------------------------------------------------------------------


def _heavier(craft: Craft, size: float, place: str) -> Craft:
    craft.ballast((-size if place == "-" else size) * craft.weighed().weight)
    return craft


def _off_centre(craft: Craft, size: float, place: str) -> Craft:
    sign = -1 if place.startswith("-") else 1
    craft.shift(sign * size * np.eye(3)["xyz".index(place.lstrip("-"))])
    return craft


def _turned_harder(craft: Craft, size: float, place: str) -> Craft:
    craft.turn_harder({place.lstrip("-"): -size if place.startswith("-") else size})
    return craft


# --- sensors and the air -----------------------------------------------------------------------------------


def _accelerometer(craft: Craft, size: float, place: str) -> Craft:
    sign = -1 if place.startswith("-") else 1
    craft.accelerometer[:] += sign * size * np.eye(3)["xyz".index(place.lstrip("-"))]
    return craft


def _wind(craft: Craft, size: float, place: str) -> Craft:
    """Return flights in JSBSim's own wind, velocities logged over the ground."""
    sign = -1 if place.startswith("-") else 1
    craft.rising[f"atmosphere/wind-{place.lstrip('-')}-fps"] = sign * size / FOOT
    craft.ground.append(True)
    return craft


def _changed(record: FlightRecord, values: Mapping[str, Array]) -> FlightRecord:
    return record.with_channels(*(replace(record.channel(n), values=v) for n, v in values.items()))


def _surfaces(place: str) -> list[str]:
    return [f"effector/{n}" for n in SURFACES] if place == "surface" else [f"state/{place}"]


def _warming(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a sensor with a bias that comes up as it warms."""
    share = 1 - 0.4 * np.exp(-record.time / 20)
    return _changed(record, {n: record[n] + size * share for n in _surfaces(place)})


def _askew(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a triad of which only two axes cross over, as after a poor calibration."""
    sensor, _, axis = place.partition("_")
    one, other = ((1, 2), (2, 0), (0, 1))["xyz".index(axis)]
    groups = (("u", "v", "w"),) if sensor == "velocity" else (("p", "q", "r"), ("ax", "ay", "az"))
    found = {}
    for group in groups:
        x = record.matrix(f"state/{n}" for n in group)
        found[f"state/{group[one]}"] = x[one] + size * x[other]
        found[f"state/{group[other]}"] = x[other] - size * x[one]
    return _changed(record, found)


def _bent_flow(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of vanes that lift bends the flow at: more so as there is more of it, not by angle."""
    sign = -1 if place.startswith("-") else 1
    u, v, w = record.matrix(("state/u", "state/v", "state/w"))
    speed = np.sqrt(u**2 + v**2 + w**2)
    if place.endswith("beta"):
        return _changed(record, {"state/v": speed * np.sin((1 + sign * size) * np.arcsin(v / speed))})
    lift = -850 * record["state/az"] / (0.5 * record["air/rho"] * speed**2 * 16.2)
    alpha = np.arctan2(w, u) + sign * size * lift / 5.0
    flat = np.hypot(u, w)
    return _changed(record, {"state/u": flat * np.cos(alpha), "state/w": flat * np.sin(alpha)})


INSIDE = (
    Edited("actuator_delay", "pade", 0.02, 0.15, ("elevator", "", "aileron", "rudder"), craft=_pade),
    Edited("actuator_lag", "two lags", 0.02, 0.5, craft=_two_lags),
    Edited("rate_limit", "apart", 6.0, 90.0, craft=_limited),
    Edited("backlash", "jsbsim", 0.01, 0.1, craft=_played),
    Edited("surface_effectiveness", "uneven", 0.2, 0.9, ("elevator", "aileron", "rudder", ""), craft=_less),
    Edited("extra_drag", "cd0", 0.5, 8.0, craft=_coefficients(lambda k: {"CDo": 1 + k})),
    Edited("mass", "ballast", 0.1, 0.6, ("", "-"), craft=_heavier),
    Edited("cg_offset", "moved", 0.05, 0.4, ("x", "-x", "z", "y"), craft=_off_centre),
    Edited("inertia", "edited", 0.15, 1.0, ("yy", "xx", "zz"), craft=_turned_harder),
    Edited("sensor_bias", "warming", 0.05, 10.0, ("theta", "q", "w", "p", "u"), record=_warming),
    Edited("sensor_scale", "compressed", 0.05, 0.9, ("q", "az", "p", "surface"), record=_compressed),
    Edited(
        "time_skew",
        "pade",
        0.01,
        0.2,
        ("rates", "velocity", "accelerometers", "attitude", "effectors"),
        record=_skewed,
    ),
    Edited("lever_arm", "moved", 0.2, 5.0, ("x", "-y", "z"), craft=_accelerometer),
    Edited("misalignment", "crossed", 0.02, 0.5, ("imu_z", "velocity_y", "imu_x", "imu_y"), record=_askew),
    Edited("flow_upwash", "by lift", 0.1, 1.5, ("alpha", "-alpha", "beta"), record=_bent_flow),
    Edited("steady_wind", "jsbsim", 2.0, 14.0, ("north", "east", "-north", "down"), craft=_wind),
    Edited("stall", "early", 0.5, 1.5, craft=_rounded),
    Edited("unsteady_lift", "half", 0.05, 1.0, craft=_late_circulation),
    Edited(
        "downwash_lag",
        "alpha dot",
        1.0,
        12.0,
        craft=_coefficients(lambda k: {"Cmadot": 1 + k, "CLadot": 1 + 1.3 * k}),
    ),
    Edited("flexible_mode", "softer", 0.1, 3.0, record=_bending),
)
"""One truth an effect that means something to this aircraft, none of them by the candidate's formula."""

SECOND = (
    Edited("actuator_delay", "waits", 0.02, 0.15, ("elevator", "", "aileron"), craft=_waits),
    Edited("extra_drag", "induced", 0.3, 5.0, craft=_coefficients(lambda k: {"CDwbh": 1 + k})),
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
    lever = _PRESSURE + "<property>metrics/bw-ft</property><property>aero/alpha-rad</property>"
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
    for tag, value in (("min", _UP - 0.015), ("max", _UP + 0.01)):
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
    Edited("outside_sticky_sensor", "other", 0.01, 0.2, record=_hysteresis),
    Edited("outside_shaken_gyro", "other", 0.002, 0.1, record=_shaken_gyro),
)


def find(identifier: str, form: str) -> Edited:
    """Return one truth."""
    return next(t for t in (*INSIDE, *SECOND, *OUTSIDE) if (t.id, t.form) == (identifier, form))

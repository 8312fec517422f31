"""Truths that are edits of JSBSim's own description of the c172p, of the air, or of its log."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from c172p_craft import RATE_HZ, STEPS, SURFACES, TRAVEL, Craft
from gap_c172p import FOOT

from freqid.core.record import FlightRecord

Array = np.ndarray
PRESSURE = "<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>"
UP = 0.17  # rad, where early stall begins


# --- between command and position, and behind it -----------------------------------------------------------


def _in_all(place: str) -> tuple[str, ...]:
    return (place,) if place else (*SURFACES, "throttle")


def pade(craft: Craft, size: float, place: str) -> Craft:
    """Return commands late by a first-order Pade form."""
    for control in _in_all(place):
        xml = f"<c1>{-size / 2}</c1><c2>1</c2><c3>{size / 2}</c3><c4>1</c4>"
        craft.before(control, "<lead_lag_filter {0}>{1}" + xml + "</lead_lag_filter>")
    return craft


def waits(craft: Craft, size: float, place: str) -> Craft:
    """Return commands late by JSBSim's own delay, in whole steps."""
    told = size + 1.001 / (STEPS * RATE_HZ)  # it waits one step less than it is told
    for control in _in_all(place):
        xml = f'<delay type="time">{told}</delay>'
        craft.before(control, "<actuator {0}>{1}" + xml + "</actuator>")
    return craft


def two_lags(craft: Craft, size: float, place: str) -> Craft:
    """Return surfaces behind two lags of half the time each."""
    del place
    w = 2 / size
    for control in SURFACES:
        xml = f"<c1>0</c1><c2>0</c2><c3>{w * w}</c3><c4>1</c4><c5>{2 * w}</c5><c6>{w * w}</c6>"
        craft.before(control, "<second_order_filter {0}>{1}" + xml + "</second_order_filter>")
    return craft


def limited(craft: Craft, size: float, place: str) -> Craft:
    """Return another rate limit for each surface."""
    del place
    for control, share in zip(SURFACES, (0.8, 1.0, 1.2), strict=True):
        xml = f"<rate_limit>{1 / (share * size * TRAVEL[control])}</rate_limit>"
        craft.before(control, "<actuator {0}>{1}" + xml + "</actuator>")
    return craft


def played(craft: Craft, size: float, place: str) -> Craft:
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


def less(craft: Craft, size: float, place: str) -> Craft:
    """Return a surface whose moment falls by more than its force."""
    for control in (place,) if place else SURFACES:
        for name, share in _MADE[control].items():
            craft.times(name, 1 - share * size)
    return craft


# --- loads -------------------------------------------------------------------------------------------------


def coefficients(factors: Callable[[float], Mapping[str, float]]) -> Callable[[Craft, float, str], Craft]:
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


def rounded(craft: Craft, size: float, place: str) -> Craft:
    """Return wings whose lift curve bends early, and whose drag rises there."""
    del place

    def change(alpha: Array, lift: Array) -> Array:
        beyond = np.maximum(alpha - UP, 0)
        return lift - size * 5 * beyond * np.tanh(beyond / 0.03)

    return _lift_table(craft, change)


def late_circulation(craft: Craft, size: float, place: str) -> Craft:
    """Return wings half of whose lift follows the angle of attack by a lag of twice the time."""
    del place
    filters = f"<c1>{size}</c1><c2>1</c2><c3>{2 * size}</c3><c4>1</c4>"
    xml = f'<lead_lag_filter name="fcs/late-alpha"><input>aero/alpha-rad</input>{filters}</lead_lag_filter>'
    craft.channel(ET.fromstring(xml))
    late = "<property>fcs/late-alpha</property><property>aero/alpha-rad</property>"
    product = f"{PRESSURE}<property>{craft.switch()}</property><difference>{late}</difference>"
    craft.part("LIFT", f"<product>{product}<value>5.0</value></product>")
    return craft


# --- mass --------------------------------------------------------------------------------------------------


def heavier(craft: Craft, size: float, place: str) -> Craft:
    craft.ballast((-size if place == "-" else size) * craft.weighed().weight)
    return craft


def off_centre(craft: Craft, size: float, place: str) -> Craft:
    sign = -1 if place.startswith("-") else 1
    craft.shift(sign * size * np.eye(3)["xyz".index(place.lstrip("-"))])
    return craft


def turned_harder(craft: Craft, size: float, place: str) -> Craft:
    craft.turn_harder({place.lstrip("-"): -size if place.startswith("-") else size})
    return craft


# --- sensors and the air -----------------------------------------------------------------------------------


def accelerometer(craft: Craft, size: float, place: str) -> Craft:
    sign = -1 if place.startswith("-") else 1
    craft.accelerometer[:] += sign * size * np.eye(3)["xyz".index(place.lstrip("-"))]
    return craft


def wind(craft: Craft, size: float, place: str) -> Craft:
    """Return flights in a wind of JSBSim's, velocities logged over the ground.

    It rises as a gust: JSBSim turns its turbulence to where what it calls wind blows.
    """
    sign = -1 if place.startswith("-") else 1
    craft.rising[f"atmosphere/gust-{place.lstrip('-')}-fps"] = sign * size / FOOT
    craft.ground.append(True)
    return craft


def _changed(record: FlightRecord, values: Mapping[str, Array]) -> FlightRecord:
    return record.with_channels(*(replace(record.channel(n), values=v) for n, v in values.items()))


def _surfaces(place: str) -> list[str]:
    return [f"effector/{n}" for n in SURFACES] if place == "surface" else [f"state/{place}"]


def warming(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a sensor with a bias that comes up as it warms."""
    share = 1 - 0.4 * np.exp(-record.time / 20)
    return _changed(record, {n: record[n] + size * share for n in _surfaces(place)})


def askew(record: FlightRecord, size: float, place: str) -> FlightRecord:
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


def bent_flow(record: FlightRecord, size: float, place: str) -> FlightRecord:
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

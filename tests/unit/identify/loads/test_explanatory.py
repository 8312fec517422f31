"""Regressors are those of the centre of gravity, wherever the sensors are."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle, Wing
from freqid.identify.loads.explanatory import history, motion_of_centre, unit_of

CG = np.array([0.09, 0.0, 0.03])
VELOCITY, FLOW = ("u", "v", "w"), ("V", "alpha", "beta")


@pytest.fixture(scope="module")
def motion():
    """Velocity of the centre of gravity and rates of a lively flight, shape (3, sample) each."""
    t = 0.02 * np.arange(500)
    v = np.array([14 + np.sin(t), 0.8 * np.cos(1.3 * t), 1.5 + 0.7 * np.sin(0.9 * t)])
    rates = np.array([0.6 * np.sin(2 * t), 0.4 * np.cos(1.7 * t), 0.5 * np.sin(1.1 * t + 1)])
    return v, rates


def vehicle(wings=()):
    body = MassProperties(mass_kg=28.6, inertia=Inertia(xx=3, yy=6, zz=8), cg_m=tuple(CG))
    tilts = tuple(Effector(name=w.tilt, kind="tilt", limits=(-0.1, 1.9)) for w in wings)
    return Vehicle(name="test", mass_properties=body, wings=wings, effectors=tilts)


def recorded(values, rates, places, described=None, **more):
    units = dict.fromkeys("uvwV", "m/s") | dict.fromkeys(("alpha", "beta"), "rad")
    channels = [
        Channel(("state/" if n in VELOCITY else "air/") + n, units[n], x, 50.0, "test", places[n])
        for n, x in values.items()
    ]
    channels += [Channel(f"state/{n}", "rad/s", x, 50.0, "test") for n, x in zip("pqr", rates, strict=True)]
    channels += [Channel(f"effector/{n}", "rad", x, 50.0, "test") for n, x in more.items()]
    record = FlightRecord(0.02 * np.arange(500), {c.name: c for c in channels})
    return Maneuver(record, described or vehicle())


def at(v, rates, place):
    return v + np.cross(rates, np.subtract(place, CG)[:, None], axis=0)


def test_velocities_are_moved_each_from_its_own_place(motion):
    v, rates = motion
    places = {"u": (0.0, 0.0, 0.0), "v": (1.2, 0.1, -0.2), "w": (-0.8, 0.3, 0.4)}
    seen = {n: at(v, rates, places[n])[i] for i, n in enumerate(VELOCITY)}
    maneuver = recorded(seen, rates, places)
    for i, name in enumerate(VELOCITY):
        assert np.abs(seen[name] - v[i]).max() > 0.01
        np.testing.assert_allclose(history(maneuver, name), v[i], atol=1e-12)
    speed = np.linalg.norm(v, axis=0)
    np.testing.assert_allclose(history(maneuver, "beta"), np.arcsin(v[1] / speed), atol=1e-12)


def test_a_sensor_that_states_no_place_is_the_centre_of_gravity_s(motion):
    v, rates = motion
    for place in (None, tuple(CG)):
        maneuver = recorded(dict(zip(VELOCITY, v, strict=True)), rates, dict.fromkeys(VELOCITY, place))
        np.testing.assert_array_equal(history(maneuver, "w"), v[2])


@pytest.mark.parametrize("with_velocity", [True, False])
def test_vanes_and_tube_are_moved_each_from_its_own_place(motion, with_velocity):
    v, rates = motion
    places = {"V": (1.3, 0.0, 0.0), "alpha": (1.2, 0.05, 0.0), "beta": (1.2, -0.05, 0.0)} | dict.fromkeys(
        VELOCITY, (0.0, 0.0, 0.0)
    )
    seen = {}
    for name in FLOW:
        x, y, z = at(v, rates, places[name])
        speed = np.sqrt(x**2 + y**2 + z**2)
        seen[name] = {"V": speed, "alpha": np.arctan2(z, x), "beta": np.arcsin(y / speed)}[name]
    if with_velocity:
        seen |= dict(zip(VELOCITY, at(v, rates, (0.0, 0.0, 0.0)), strict=True))
    maneuver = recorded(seen, rates, places)
    speed = np.linalg.norm(v, axis=0)
    expected = {"V": speed, "alpha": np.arctan2(v[2], v[0]), "beta": np.arcsin(v[1] / speed)}
    for name, values in expected.items():
        assert np.abs(seen[name] - values).max() > 0.01
        np.testing.assert_allclose(history(maneuver, name), values, atol=2e-5)
    np.testing.assert_allclose(history(maneuver, "w"), v[2], atol=2e-5)


def test_the_centre_of_gravity_moves_with_the_wings(motion):
    v, rates = motion
    wing = Wing(name="front", tilt="dw1", pivot_m=(0.6, 0.0, 0.0), mass_kg=4.5, cg_m=(0.7, 0.0, 0.0))
    tilt = np.full(500, 1.2)
    shift = 4.5 / 28.6 * 0.1 * np.array([np.cos(1.2) - 1.0, 0.0, -np.sin(1.2)])
    seen = v + np.cross(rates, -(CG + shift)[:, None], axis=0)  # at the origin
    maneuver = recorded(
        dict(zip(VELOCITY, seen, strict=True)),
        rates,
        dict.fromkeys(VELOCITY, (0.0, 0.0, 0.0)),
        vehicle((wing,)),
        dw1=tilt,
    )
    np.testing.assert_allclose(history(maneuver, "w"), v[2], atol=1e-12)


@pytest.mark.parametrize("logged", ["uvw", "Vab", "uvwVab", "uwa", "V"])
@pytest.mark.parametrize("rates_too", [True, False])
def test_all_of_the_motion_at_once_is_each_of_it_alone(motion, logged, rates_too):
    v, rates = motion
    places = dict.fromkeys(VELOCITY, (0.4, 0.1, 0.0)) | {"V": None, "alpha": (1.2, 0.0, 0.0), "beta": None}
    seen = dict(zip(VELOCITY, v, strict=True)) | {"V": v[0], "alpha": v[2] / v[0], "beta": v[1] / v[0]}
    maneuver = recorded({n: x for n, x in seen.items() if n[0] in logged}, rates, places)
    channels = {n: c for n, c in maneuver.record.channels.items() if rates_too or n[-2:] not in ("/p", "/q")}
    channels["air/rho"] = Channel("air/rho", "kg/m3", np.full(500, 1.2), 50.0, "test")
    maneuver = replace(maneuver, record=FlightRecord(maneuver.record.time, channels))
    alone = {}
    for name in (*VELOCITY, *FLOW, "qbar"):
        try:
            alone[name] = history(maneuver, name)
        except DataError:
            continue
    together = motion_of_centre(maneuver)
    assert set(together) == set(alone)
    for name, values in alone.items():
        np.testing.assert_allclose(together[name], values, atol=1e-12)


def test_without_rates_it_cannot_be_moved(motion):
    v, rates = motion
    maneuver = recorded(
        dict(zip(VELOCITY, v, strict=True)), rates, dict.fromkeys(VELOCITY, (1.09, 0.0, 0.03))
    )
    channels = {n: c for n, c in maneuver.record.channels.items() if n != "state/q"}
    bare = replace(maneuver, record=replace(maneuver.record, channels=channels))
    with pytest.raises(
        DataError, match=r"'state/w' was measured 1 m from the centre of gravity .* 'state/q' is missing"
    ):
        history(bare, "w")


def test_the_advance_ratio_is_that_of_all_tips(motion):
    """J = V / (n d) with n in turns per second; unlike propellers count by n d, the mean over both."""
    v, rates = motion
    places = dict.fromkeys(VELOCITY, tuple(CG))
    rotors = tuple(Rotor(name=n, spin=1, inertia=0.0, diameter_m=d) for n, d in (("n1", 0.4), ("n2", 0.3)))
    described = msgspec.structs.replace(vehicle(), rotors=rotors)
    turns = {"n1": 400.0 + 10 * v[0], "n2": np.full(500, 500.0)}
    maneuver = recorded(dict(zip(VELOCITY, v, strict=True)), rates, places, described, **turns)
    per_second = [turns["n1"] / (2 * np.pi) * 0.4, turns["n2"] / (2 * np.pi) * 0.3]
    expected = np.linalg.norm(v, axis=0) / np.mean(per_second, axis=0)
    np.testing.assert_allclose(history(maneuver, "J"), expected, rtol=1e-12)
    assert unit_of(maneuver, "J") == "1"
    with pytest.raises(DataError, match="needs rotors whose diameter is stated"):
        history(recorded(dict(zip(VELOCITY, v, strict=True)), rates, places), "J")

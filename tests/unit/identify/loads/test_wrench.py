from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wrench_cases import DT, FULL, INERTIA, RIGID, SENSOR, TILTING, TIME, motion, record

from freqid.core.channels import WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.vehicle import Rotor
from freqid.dynamics.frames import specific_force_at
from freqid.identify.loads.wrench import applied_wrench, response_name


def test_a_rigid_vehicle_obeys_the_scalar_equations():
    values, (p, q, r), (pdot, qdot, rdot) = motion()
    found = applied_wrench(record(RIGID, **values)).history(DT)
    ix, iy, iz, ixz = INERTIA.xx, INERTIA.yy, INERTIA.zz, INERTIA.xz
    wanted = [
        12.0 * values["ax"],
        12.0 * values["ay"],
        12.0 * values["az"],
        ix * pdot - ixz * rdot + (iz - iy) * q * r - ixz * p * q,
        iy * qdot + (ix - iz) * p * r + ixz * (p**2 - r**2),
        iz * rdot - ixz * pdot + (iy - ix) * p * q + ixz * q * r,
    ]
    np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-11)


def test_recorded_accelerations_leave_nothing_to_differentiate():
    values, rates, change = motion()
    values |= dict(zip(("pdot", "qdot", "rdot"), change, strict=True))
    maneuver = record(RIGID, SENSOR, **values)
    found = applied_wrench(maneuver, angular_acceleration="record")
    assert not found.momentum.any()
    np.testing.assert_allclose(found.history(DT), applied_wrench(maneuver).history(DT), rtol=1e-9, atol=1e-9)


def test_force_moves_from_the_sensor_to_the_centre_of_gravity():
    values, rates, change = motion()
    found = applied_wrench(record(RIGID, SENSOR, **values)).history(DT)
    sensed = np.array([values[n] for n in ("ax", "ay", "az")])
    moved = specific_force_at(sensed, rates, change, np.subtract((0.5, 0.0, -0.1), SENSOR["ax"]))
    np.testing.assert_allclose(found[:3], 12.0 * moved, rtol=1e-10)


def test_rotor_terms_are_those_of_the_scalar_equations():
    values, (p, q, r), _ = motion()
    speed = {"n1": 300 + 20 * TIME, "n2": 250 + 5 * TIME**2}
    rotors = (
        Rotor(name="n1", spin=1, inertia=0.02, axis=(2.0, 0.0, 0.0)),
        Rotor(name="n2", spin=-1, inertia=0.03, axis=(0.0, 0.6, -0.8)),
    )
    vehicle = msgspec.structs.replace(RIGID, rotors=rotors)
    maneuver = record(vehicle, **values, **speed)
    found = applied_wrench(maneuver).history(DT) - applied_wrench(maneuver, rotors=False).history(DT)
    h1, h2 = 0.02 * speed["n1"], -0.03 * speed["n2"]
    hx, hy, hz = h1, 0.6 * h2, -0.8 * h2
    hxdot, h2dot = 0.02 * 20, -0.03 * 10 * TIME
    wanted = [hxdot + q * hz - r * hy, 0.6 * h2dot + r * hx - p * hz, -0.8 * h2dot + p * hy - q * hx]
    np.testing.assert_allclose(found[3:], wanted, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found[:3], 0.0, atol=1e-12)


def test_a_right_handed_propeller_yaws_a_pitching_aircraft_to_the_right():
    """Nose up with a propeller clockwise from behind: the airframe must be held against a right yaw."""
    vehicle = msgspec.structs.replace(RIGID, rotors=(Rotor(name="n1", spin=1, inertia=0.02),))
    maneuver = record(vehicle, p=0.0, q=0.5, r=0.0, n1=400.0)
    found = applied_wrench(maneuver, "LMN").history(DT)
    np.testing.assert_allclose(found[2], -0.5 * 0.02 * 400.0)
    np.testing.assert_allclose(found[:2], [0.0 * TIME, 0.45 * 0.0 * TIME], atol=1e-12)


def test_only_the_channels_of_the_responses_are_needed():
    found = applied_wrench(record(RIGID, ay=2.0), ["Y"])
    assert (found.names, found.units) == (("Y",), ("N",))
    np.testing.assert_allclose(found.history(DT), 24.0 * np.ones((1, TIME.size)))
    # In stability axes the lift needs both forces of the plane of symmetry, and no other.
    found = applied_wrench(record(RIGID, ax=1.0, az=-9.0, alpha=0.1), ["Z"], axes="stability")
    np.testing.assert_allclose(found.history(DT), 12.0 * (-9.0 * np.cos(0.1) - np.sin(0.1)))


def test_responses_come_in_the_order_asked():
    values, _, _ = motion()
    maneuver = record(RIGID, **values)
    full = applied_wrench(maneuver).history(DT)
    some = applied_wrench(maneuver, ["N", "X", "M"])
    assert some.units == ("N m", "N", "N m")
    np.testing.assert_allclose(some.history(DT), full[[5, 0, 4]], rtol=1e-12)  # filtered in another batch


def test_specific_form_is_per_mass_and_per_moment_of_inertia_of_its_axes():
    values, _, _ = motion()
    maneuver = record(RIGID, **values, alpha=0.3)
    force = applied_wrench(maneuver).history(DT)
    found = applied_wrench(maneuver, form="specific")
    assert found.units == ("m/s2",) * 3 + ("rad/s2",) * 3
    divisor = np.array([12.0, 12.0, 12.0, 3.1, 4.7, 6.9])[:, None]
    np.testing.assert_allclose(found.history(DT), force / divisor)
    # About x stability: Ix cos2 + Iz sin2 - 2 Ixz sin cos.
    c, s = np.cos(0.3), np.sin(0.3)
    turned = applied_wrench(maneuver, ["L"], "specific", "stability").history(DT)
    wanted = (force[3] * c + force[5] * s) / (3.1 * c**2 + 6.9 * s**2 - 2 * 0.45 * s * c)
    np.testing.assert_allclose(turned[0], wanted)


def test_coefficients_divide_by_dynamic_pressure_and_lengths():
    values, _, _ = motion()
    maneuver = record(RIGID, **values, qbar=80.0)
    force = applied_wrench(maneuver).history(DT)
    found = applied_wrench(maneuver, form="coefficient")
    lengths = np.array([1, 1, 1, 2.9, 0.4, 2.9])[:, None]
    np.testing.assert_allclose(found.history(DT), force / (80.0 * 1.2 * lengths), rtol=1e-9, atol=1e-12)
    assert found.units == ("1",) * 6
    assert [response_name(r, "coefficient") for r in WRENCH] == ["CX", "CY", "CZ", "Cl", "Cm", "Cn"]
    assert response_name("M", "specific") == "M"


def test_a_steady_momentum_does_not_bring_the_derivative_of_dynamic_pressure_in():
    vehicle = msgspec.structs.replace(RIGID, rotors=(Rotor(name="n1", spin=1, inertia=0.02),))
    noisy = 80.0 + np.random.default_rng(0).normal(size=TIME.size)
    maneuver = record(vehicle, p=0.1, q=0.2, r=0.0, n1=400.0, qbar=noisy)
    found = applied_wrench(maneuver, ["N"], "coefficient")
    np.testing.assert_allclose(found.momentum, 0.0, atol=1e-12)
    moment = applied_wrench(maneuver, ["N"]).direct
    np.testing.assert_allclose(found.direct, moment / (noisy * 1.2 * 2.9), rtol=1e-12)


def test_the_mean_is_that_of_the_history():
    values, _, _ = motion()
    maneuver = record(RIGID, **values)
    wrench = applied_wrench(maneuver)
    history = wrench.history(DT)
    # A mean of samples and the mean over time differ by the end samples' share.
    slack = np.abs(history).max(axis=1) / TIME.size
    assert np.all(np.abs(wrench.mean(DT) - history.mean(axis=1)) <= slack)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.floats(-0.5, 1.6))
def test_the_mirror_image_of_a_flight_has_the_mirror_image_of_its_wrench(seed, tilt):
    rng = np.random.default_rng(seed)
    values, _, _ = motion(seed)
    values |= {"dw1": tilt + 0.3 * np.sin(TIME), "n1": 300 + 50 * np.sin(2 * TIME), "n2": 250 - 9 * TIME}
    sensor = rng.uniform(-1, 1, 3)

    def flip(x):
        return (x[0], -x[1], x[2])

    def mirrored(vehicle):
        rotors = tuple(msgspec.structs.replace(r, spin=-r.spin, axis=flip(r.axis)) for r in vehicle.rotors)
        return msgspec.structs.replace(vehicle, rotors=rotors)

    image = values | {n: -values[n] for n in ("p", "r", "ay")}
    names = ("ax", "ay", "az")
    here = record(TILTING, {n: tuple(sensor) for n in names}, **values)
    there = record(mirrored(TILTING), {n: flip(sensor) for n in names}, **image)
    signs = np.array([1, -1, 1, -1, 1, -1])[:, None]
    np.testing.assert_allclose(
        applied_wrench(there).history(DT), signs * applied_wrench(here).history(DT), rtol=1e-9, atol=1e-9
    )


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.tuples(*[st.floats(-5, 5)] * 3))
def test_the_origin_of_the_vehicle_axes_does_not_matter(shift):
    values, _, _ = motion()
    values |= {"dw1": 0.8 + 0.3 * np.sin(TIME), "n1": 300.0, "n2": 250.0}

    def moved(point):
        return tuple(np.add(point, shift))

    stated, wing = TILTING.mass_properties, TILTING.wings[0]
    vehicle = msgspec.structs.replace(
        TILTING,
        mass_properties=msgspec.structs.replace(stated, cg_m=moved(stated.cg_m)),
        wings=(msgspec.structs.replace(wing, cg_m=moved(wing.cg_m), pivot_m=moved(wing.pivot_m)),),
    )
    here = record(TILTING, {"ax": (0.1, 0.2, 0.3)}, **values)
    there = record(vehicle, {"ax": moved((0.1, 0.2, 0.3))}, **values)
    np.testing.assert_allclose(
        applied_wrench(there).history(DT), applied_wrench(here).history(DT), rtol=1e-9, atol=1e-9
    )


# ------------------------------------------------------------------------- refusals
@pytest.mark.parametrize(
    ("channel", "name"),
    [("state/r", "r"), ("state/az", "az"), ("effector/n2", "n2"), ("effector/dw1", "dw1")],
)
def test_a_missing_channel_is_named(channel, name):
    values = {k: v for k, v in FULL.items() if k != name}
    with pytest.raises(DataError, match=f"channel '{channel}' is missing"):
        applied_wrench(record(TILTING, **values))


def test_coefficients_are_refused_near_zero_airspeed():
    slow = 60.0 * np.abs(TIME - 3.0) / 3.0
    with pytest.raises(DataError, match=r"falls to 0 Pa at t = 3 s, .*expected at least 5 Pa; use the form"):
        applied_wrench(record(RIGID, **(FULL | {"qbar": slow})), form="coefficient")
    fast = 4000.0 - 3900.0 * np.isclose(TIME, 0.8)
    with pytest.raises(DataError, match=r"100 Pa at t = 0.8 s.*expected at least 200 Pa"):
        applied_wrench(record(RIGID, **(FULL | {"qbar": fast})), form="coefficient")


@pytest.mark.parametrize("key", ["area_m2", "span_m", "chord_m"])
def test_a_missing_reference_length_names_its_scenario_key(key):
    vehicle = msgspec.structs.replace(RIGID, **{key: None})
    with pytest.raises(UsageError, match=rf"need {key} of vehicle 'rigid'.*add {key} to \[vehicle\]"):
        applied_wrench(record(vehicle, **FULL), form="coefficient")


def test_a_force_coefficient_needs_no_span():
    vehicle = msgspec.structs.replace(RIGID, span_m=None, chord_m=None)
    found = applied_wrench(record(vehicle, **FULL), "XYZ", "coefficient").history(DT)
    np.testing.assert_allclose(found[1], 12.0 * FULL["ay"] / (80.0 * 1.2))


def test_stability_axes_are_refused_where_the_angle_of_attack_wanders():
    alpha = np.linspace(-1.6, 1.6, TIME.size)
    with pytest.raises(DataError, match="too far for stability axes, expected at most 45 deg; use body axes"):
        applied_wrench(record(RIGID, **(FULL | {"alpha": alpha})), axes="stability")


def test_an_unknown_response_form_or_axes_is_refused():
    maneuver = record(RIGID, **FULL)
    with pytest.raises(UsageError, match="'Cm' is no response"):
        applied_wrench(maneuver, ["Cm"])
    with pytest.raises(UsageError, match=r"'wind'.*known names are: body, stability"):
        applied_wrench(maneuver, axes="wind")  # type: ignore[arg-type]


def test_a_record_s_own_mass_properties_are_used():
    maneuver = record(RIGID, **FULL)
    heavier = msgspec.structs.replace(RIGID.mass_properties, mass_kg=15.0)
    flown = Maneuver.of(replace(maneuver.record, mass_properties=heavier))
    found = applied_wrench(flown, ["X"]).history(DT)
    np.testing.assert_allclose(found[0], 15.0 * FULL["ax"])

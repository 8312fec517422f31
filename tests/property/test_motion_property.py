"""Motion over the whole envelope: limits hold, nothing turns infinite, mass is put together rightly."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from freqid.core.vehicle import Inertia, MassProperties, Rotor, Vehicle, Wing
from freqid.simulate.loads.quantities import Wrench
from freqid.simulate.motion import attitude, delay_line, multibody, rigid_body
from freqid.simulate.motion.actuators import Motors, Servos, motor_acceleration, servo_acceleration
from freqid.simulate.motion.battery import BatterySection, battery, power
from freqid.simulate.motion.integrate import integrate, rk4
from freqid.simulate.motion.multibody import Configuration
from freqid.simulate.motion.rigid_body import BodyState

DT = 0.005
few = settings(max_examples=40, deadline=None, derandomize=True)


def floats(low, high, *shape):
    return arrays(float, shape, elements=st.floats(low, high, allow_subnormal=False))


@jax.jit
def follow(servos, commands):
    def step(state, command):
        slope = lambda s, _: (s[1], servo_acceleration(servos, *s, command))  # noqa: E731
        return rk4(slope, state, DT)

    return integrate(step, (jnp.zeros(1), jnp.zeros(1)), commands)[0]


@few
@given(
    frequency=st.floats(0.5, 15.0),
    damping=st.floats(0.3, 2.0),
    rate=st.floats(0.1, 20.0),
    commands=floats(-3.0, 3.0, 12),
)
def test_a_servo_stays_between_its_stops_and_below_its_rate(frequency, damping, rate, commands):
    values = (2 * np.pi * frequency, damping, -0.4, 0.9, rate)
    servos = Servos(*(jnp.array([value]) for value in values))
    position, speed = follow(servos, jnp.repeat(jnp.asarray(commands), 20)[:, None])
    # The law holds for continuous time; a step of 5 ms rounds the corner of the fastest servo.
    assert np.all(position >= -0.4 - 1e-3)
    assert np.all(position <= 0.9 + 1e-3)
    assert np.max(np.abs(speed)) <= rate * (1 + 1e-3)


@jax.jit
def spin(motors, commands, ratio):
    step = lambda speed, c: rk4(lambda s, _: motor_acceleration(motors, s, c, ratio), speed, DT)  # noqa: E731
    return integrate(step, jnp.zeros(1), commands)[0]


@few
@given(commands=floats(-500.0, 2000.0, 12), ratio=st.floats(0.6, 1.1))
def test_a_motor_never_turns_backward_nor_faster_than_the_voltage_lets_it(commands, ratio):
    motors = Motors(*(jnp.array([v]) for v in (0.05, 0.08, 0.0, 900.0, 4000.0)))
    speed = spin(motors, jnp.repeat(jnp.asarray(commands), 20)[:, None], jnp.asarray(ratio))
    assert np.all(speed >= 0.0)
    assert np.all(speed <= 900.0 * ratio * (1 + 1e-9))


@few
@given(late=st.floats(0.0, 9.0), slope=floats(-5.0, 5.0, 3), offset=floats(-5.0, 5.0, 3))
def test_a_delay_line_delays_a_straight_line_exactly(late, slope, offset):
    line = jnp.asarray(offset - slope * np.arange(10)[:, None])
    assert np.allclose(delay_line.read(line, late), offset - slope * late, atol=1e-12)


@jax.jit
def given_power(charge, torque, speed):
    section = BatterySection(
        nominal_v=46.0, full_v=50.0, empty_v=42.0, resistance_ohm=0.02, capacity_ah=20.0, efficiency=0.8
    )
    of = lambda torque: power(battery(section), charge, torque, speed)  # noqa: E731
    return of(torque), jax.grad(lambda t: of(t).voltage)(torque)


@few
@given(charge=st.floats(-0.1, 1.1), torque=floats(-10.0, 40.0, 8), speed=floats(0.0, 1200.0, 8))
def test_a_battery_stays_finite_and_gives_no_more_than_its_open_circuit_voltage(charge, torque, speed):
    given_now, slope = given_power(jnp.asarray(charge), jnp.asarray(torque), jnp.asarray(speed))
    assert 0.54 * 42.0 < float(given_now.voltage) <= 50.0
    assert float(given_now.current) >= 0.0
    assert np.all(np.isfinite(slope))
    assert np.all(slope <= 0.0)


@pytest.fixture(scope="module")
def vehicle():
    inertia = Inertia(xx=1.3, yy=0.06, zz=1.35, xz=0.02)
    wings = tuple(
        Wing(name=n, tilt=t, pivot_m=(x, 0, -0.1), mass_kg=4.5, cg_m=(x + 0.06, 0, -0.1), inertia=inertia)
        for n, t, x in (("front", "dw1", 0.62), ("rear", "dw2", -0.62))
    )
    rotors = tuple(
        Rotor(name=f"n{k}", spin=(-1) ** k, inertia=2.5e-4, wing=w.name) for k, w in enumerate(wings)
    )
    whole = MassProperties(
        mass_kg=28.6, cg_m=(0.09, 0, 0.03), inertia=Inertia(xx=4.1, yy=7.6, zz=9.9, xz=0.1)
    )
    return Vehicle(name="v", mass_properties=whole, wings=wings, rotors=rotors)


@pytest.fixture(scope="module")
def motion(vehicle):
    """Accelerations and their derivatives by every input, compiled once."""
    model = multibody.mass_model(vehicle)

    def accelerations(inner, change, velocity, rates, angles, load):
        body = BodyState(jnp.zeros(3), attitude.from_euler(*angles), velocity, rates)
        wrench = Wrench(load[:3], load[3:])
        return jnp.concatenate(rigid_body.accelerations(model, inner, change, body, wrench))

    return jax.jit(accelerations), jax.jit(jax.jacfwd(accelerations, argnums=(0, 2, 3, 4, 5)))


inners = st.builds(Configuration, floats(-4.0, 4.0, 2), floats(-2.0, 2.0, 2), floats(0.0, 1000.0, 2))
changes = st.builds(Configuration, floats(-2.0, 2.0, 2), floats(-30.0, 30.0, 2), floats(-4e3, 4e3, 2))


@few
@given(
    inner=inners,
    change=changes,
    velocity=floats(-40.0, 40.0, 3),
    rates=floats(-6.0, 6.0, 3),
    angles=floats(-7.0, 7.0, 3),
    load=floats(-500.0, 500.0, 6),
)
def test_accelerations_and_their_derivatives_are_finite_everywhere(
    motion, inner, change, velocity, rates, angles, load
):
    values, slopes = motion
    inner = inner._replace(tilt_rate=change.tilt)  # the same quantity in both
    assert np.all(np.isfinite(values(inner, change, velocity, rates, angles, load)))
    for slope in jax.tree.leaves(slopes(inner, change, velocity, rates, angles, load)):
        assert np.all(np.isfinite(slope))


@few
@given(
    inner=inners,
    change=changes,
    boost=floats(-50.0, 50.0, 3),
    rates=floats(-3.0, 3.0, 3),
    load=floats(-9.0, 9.0, 6),
)
def test_a_steady_wind_changes_no_acceleration_in_space(motion, inner, change, boost, rates, load):
    values, inner = motion[0], inner._replace(tilt_rate=change.tilt)
    level, zero = np.zeros(3), np.zeros(3)
    still, boosted = (values(inner, change, v, rates, level, load) for v in (zero, boost))
    expected = np.concatenate([still[:3] - np.cross(rates, boost), still[3:]])
    assert np.allclose(boosted, expected, rtol=1e-9, atol=1e-8)


@few
@given(tilts=floats(-0.5, 2.0, 2), now=floats(-0.5, 2.0, 2))
def test_stating_the_mass_at_another_tilt_describes_the_same_vehicle(vehicle, tilts, now):
    model = multibody.mass_model(vehicle)
    moment, inertia = (np.array(x) for x in multibody.moments_of_mass(model, jnp.asarray(tilts)))
    cg = moment / 28.6
    about = inertia - 28.6 * (cg @ cg * np.eye(3) - np.outer(cg, cg))
    stated = Inertia(
        xx=about[0, 0], yy=about[1, 1], zz=about[2, 2], xy=-about[0, 1], xz=-about[0, 2], yz=-about[1, 2]
    )
    restated = Vehicle(
        name="v",
        mass_properties=MassProperties(mass_kg=28.6, cg_m=tuple(cg), inertia=stated),
        tilt_rad=dict(zip(("front", "rear"), tilts, strict=True)),
        wings=vehicle.wings,
        rotors=vehicle.rotors,
    )
    again = multibody.moments_of_mass(multibody.mass_model(restated), jnp.asarray(now))
    for a, b in zip(again, multibody.moments_of_mass(model, jnp.asarray(now)), strict=True):
        assert np.allclose(a, b, atol=1e-12)

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.toml import convert
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.simulate.motion import delay_line
from freqid.simulate.motion.actuators import (
    ActuatorSection,
    Motors,
    Servos,
    by_kind,
    motor_acceleration,
    servo_acceleration,
)
from freqid.simulate.motion.battery import BatterySection, battery, charge_rate, power
from freqid.simulate.motion.integrate import integrate, rk4

DT = 0.005


def servo(frequency_hz=8.0, damping=0.7, limit=0.5, rate=np.inf):
    values = (2 * np.pi * frequency_hz, damping, -limit, limit, rate)
    return Servos(*(jnp.array([value]) for value in values))


@jax.jit
def follow(servos, commands):
    """Positions and rates of a servo from rest at zero, shape (sample,) each."""

    def step(state, command):
        slope = lambda s, _: (s[1], servo_acceleration(servos, *s, command))  # noqa: E731
        return rk4(slope, state, DT)

    outputs, _ = integrate(step, (jnp.zeros(1), jnp.zeros(1)), commands)
    return outputs[0][:, 0], outputs[1][:, 0]


@jax.jit
def spin(motors, start, commands, ratio):
    step = lambda speed, c: rk4(lambda s, _: motor_acceleration(motors, s, c, ratio), speed, DT)  # noqa: E731
    return integrate(step, start, commands)[0][:, 0]


def test_inside_its_limits_a_servo_is_the_second_order_step_response():
    position, _ = follow(servo(), jnp.full((100, 1), 0.1))
    t, w, z = DT * np.arange(100), 2 * np.pi * 8.0, 0.7
    damped = w * np.sqrt(1 - z**2)
    exact = 0.1 * (1 - np.exp(-z * w * t) * (np.cos(damped * t) + z * w / damped * np.sin(damped * t)))
    assert np.max(np.abs(position - exact)) < 1e-5


def test_a_servo_keeps_its_rate_limit_and_does_not_overrun_its_stop():
    position, rate = follow(servo(rate=2.0), jnp.full((200, 1), 9.0))
    assert np.max(rate) < 2.0
    assert np.max(rate) > 1.99
    assert np.max(position) <= 0.5
    assert position[-1] == pytest.approx(0.5, abs=1e-4)


def test_a_motor_follows_up_and_down_with_its_two_time_constants():
    motors = Motors(*(jnp.array([v]) for v in (0.05, 0.08, 0.0, 900.0, np.inf)))
    up = spin(motors, jnp.array([400.0]), jnp.full((30, 1), 500.0), jnp.array(1.0))
    down = spin(motors, jnp.array([400.0]), jnp.full((30, 1), 300.0), jnp.array(1.0))
    t = DT * np.arange(30)
    assert np.allclose(up, 500 - 100 * np.exp(-t / 0.05), atol=1e-3)
    assert np.allclose(down, 300 + 100 * np.exp(-t / 0.08), atol=1e-3)


def test_a_lower_voltage_lowers_what_a_command_gives_and_the_highest_speed():
    motors = Motors(*(jnp.array([v]) for v in (0.05, 0.08, 0.0, 900.0, np.inf)))
    for command, expected in ((500.0, 450.0), (1200.0, 810.0)):
        speed = spin(motors, jnp.array([400.0]), jnp.full((400, 1), command), jnp.array(0.9))
        assert speed[-1] == pytest.approx(expected, rel=1e-9)


BATTERY = BatterySection(
    nominal_v=46.0,
    full_v=50.0,
    empty_v=42.0,
    resistance_ohm=0.02,
    capacity_ah=20.0,
    efficiency=0.8,
    idle_w=20.0,
)


def test_the_battery_gives_the_power_that_is_taken_and_loses_the_rest_inside():
    torque, speed = jnp.array([1.2, 0.8]), jnp.array([500.0, 600.0])
    given = power(battery(BATTERY), jnp.array(0.75), torque, speed)
    load = (1.2 * 500 + 0.8 * 600) / 0.8 + 20.0
    assert float(given.voltage * given.current) == pytest.approx(load, rel=1e-12)
    assert float(given.voltage + 0.02 * given.current) == pytest.approx(48.0, rel=1e-12)
    assert float(charge_rate(battery(BATTERY), given.current)) == pytest.approx(
        -float(given.current) / 72000.0
    )


def test_a_load_beyond_the_battery_keeps_voltage_and_gradient_finite():
    taken = lambda torque: power(battery(BATTERY), jnp.array(0.5), torque, jnp.array([900.0])).voltage  # noqa: E731
    assert 23.0 < float(taken(jnp.array([1e4]))) < 30.0
    assert np.isfinite(jax.grad(taken)(jnp.array([1e4]))[0])


def test_a_delay_line_returns_what_was_sent_then_and_goes_straight_between():
    line = delay_line.start(jnp.zeros(2), 8)
    for k in range(1, 6):
        line = delay_line.push(line, jnp.array([1.0, 10.0]) * k)
    for late in (0.0, 1.0, 2.25, 4.0):
        assert np.allclose(delay_line.read(line, late), np.array([1.0, 10.0]) * (5 - late))
    assert np.allclose(delay_line.read(line, 99.0), 0.0)  # the oldest
    slope = jax.grad(lambda late: delay_line.read(line, late)[0])(2.25)
    assert float(slope) == pytest.approx(-1.0)


def test_commands_in_the_order_of_the_scenario_are_split_by_kind():
    kinds = ["rotor", "surface", "tilt", "surface", "rotor"]
    effectors = tuple(Effector(name=f"e{k}", kind=kind, limits=(0.0, 1.0)) for k, kind in enumerate(kinds))
    properties = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0))
    vehicle = Vehicle(name="v", mass_properties=properties, effectors=effectors)
    split = by_kind(vehicle, jnp.arange(10.0).reshape(2, 5))
    assert np.array_equal(split.surface, [[1, 3], [6, 8]])
    assert np.array_equal(split.tilt, [[2], [7]])
    assert np.array_equal(split.speed, [[0, 4], [5, 9]])


def test_a_wrong_section_names_the_key():
    good = {"frequency_hz": 8.0, "damping": 0.7}
    table = {"surface": {**good, "dampin": 1.0}, "tilt": good, "motor": {"rise_s": 0.1, "fall_s": 0.1}}
    with pytest.raises(UsageError, match=r"surface: key 'dampin' is unknown; did you mean 'damping'"):
        convert(table, ActuatorSection, "la8.toml")
    with pytest.raises(UsageError, match=r"found frequency -1 Hz"):
        convert({**table, "surface": {**good, "frequency_hz": -1.0}}, ActuatorSection, "la8.toml")

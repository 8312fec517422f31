"""Effects in flight: absent at zero, there when on, and what a replay of the flight says they add."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
import pytest

from freqid.core.results.design import SampledInputs
from freqid.core.scenario import read_scenario
from freqid.dynamics.frames import cross
from freqid.gap.model.replay import Replay
from freqid.simulate import effects
from freqid.simulate.control.lq import close_loop
from freqid.simulate.effects import along
from freqid.simulate.fly import fly, sortie
from freqid.simulate.loads import airframe
from freqid.simulate.loads.airframe import Situation
from freqid.simulate.maneuver import with_effects
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.truth import truth_of

WHOLE = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0]
REFERENCE = WHOLE.reference_of("u45")
SCENARIO = msgspec.structs.replace(WHOLE, reference=(REFERENCE,))
VEHICLE = SCENARIO.aircraft()
DURATION = 4.0
EXCITED = [e for e in SCENARIO.effector if e.kind != "tilt"]


def inputs():
    time = 0.02 * np.arange(201)
    waves = [
        (20.0 if e.kind == "rotor" else 0.08) * np.sin(2 * np.pi * (0.5 + 0.1 * i) * time)
        for i, e in enumerate(EXCITED)
    ]
    return SampledInputs(
        tuple(e.name for e in EXCITED), tuple(e.unit for e in EXCITED), time, np.array(waves)
    )


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, REFERENCE)


@pytest.fixture(scope="module")
def flown(loop):
    """Flight and truth under settings of effects, with the trim and the law of the vehicle without them."""
    found = {}

    def of(feedback=True, **settings):
        key = repr((feedback, settings))
        if key not in found:
            scenario = with_effects(SCENARIO, settings)
            parameters = jax.tree.map(jnp.asarray, motion.parameters(scenario))
            ready = sortie(
                scenario,
                replace(loop, parameters=parameters),
                REFERENCE,
                inputs(),
                duration=DURATION,
                feedback=feedback,
            )
            flight = fly(ready)
            found[key] = flight, truth_of(SCENARIO, flight, excited=(), reference="u45")[0], parameters
        return found[key]

    return of


def motion_of(truth):
    return np.concatenate([truth.matrix(f"state/{n}" for n in "uvwpqr"), truth.matrix(("state/theta",))])


def replayed(identifier, truth, simulation=None, **changed):
    effect = effects.find(identifier).of(VEHICLE)
    settings = {n: p.default for n, p in effect.parameters.items()} | {effect.size: 0.0} | changed
    return effect.replay(settings, Replay(simulation, truth, VEHICLE))


IN_FLIGHT = {
    "actuator_delay": {"extra": 0.04},
    "actuator_lag": {"extra": 0.05},
    "rate_limit": {"slowness": 5.0},
    "backlash": {"width": 0.05},
    "surface_effectiveness": {"de1": 0.5},
    "motor_lag": {"extra": 0.05},
    "weak_rotor": {"n3": 0.2},
    "downwash_lag": {"strength": 1.0},
    "stall": {"strength": 0.3},
    "unsteady_lift": {"time_constant": 0.1},
    "extra_drag": {"coefficient": 0.05},
    "mass": {"fraction": 0.1},
    "cg_offset": {"x": 0.03},
    "inertia": {"yy": 0.3},
    "mass_properties": {"fraction": 0.1, "x": 0.03, "yy": 0.1},
    "tilt_inertia": {"fraction": -0.5},
}


def test_an_effect_of_size_zero_is_not_there_whatever_its_shape(flown):
    shapes = {"downwash_lag": {"delay": 0.3, "arm": 9.0}, "stall": {"onset": 0.01}}
    _, base, _ = flown()
    _, same, _ = flown(**shapes)
    assert np.abs(motion_of(same) - motion_of(base)).max() < 1e-12
    for identifier in ("downwash_lag", "stall", "unsteady_lift", "extra_drag", "ground_effect", "wing_wake"):
        if identifier != "ground_effect":  # asks a simulation for its thrusts
            assert not np.any(replayed(identifier, base))


@pytest.mark.parametrize("identifier", IN_FLIGHT)
def test_an_effect_that_is_on_moves_the_flight(flown, identifier):
    _, base, _ = flown()
    flight, moved, _ = flown(**{identifier: IN_FLIGHT[identifier]})
    assert flight.divergence is None
    assert np.abs(motion_of(moved) - motion_of(base)).max() > 1e-3


def added(identifier, flight, parameters):
    """X Y Z L M N about the origin that an effect's flight form adds, from what the flight remembers."""
    effect = effects.find(identifier)
    moving, details = flight.samples.moving, flight.samples.details

    def one(flow, positions, memory):
        situation = Situation(parameters.airframe, flow, positions, None, memory)  # type: ignore[arg-type]
        extra = effect.add(parameters.airframe.effects[identifier], situation)
        return jnp.concatenate([extra.force, extra.moment])

    memory = moving.memories.get(identifier, {})
    return np.asarray(jax.jit(jax.vmap(one))(details.flow, details.positions, memory)).T


def about_centre(wrench, truth):
    from freqid.simulate.effects.along import centre

    return np.concatenate([wrench[:3], wrench[3:] - cross(centre(truth, VEHICLE), wrench[:3])])


@pytest.mark.parametrize("identifier", ["downwash_lag", "stall", "unsteady_lift", "extra_drag"])
def test_a_replay_of_a_flight_says_what_the_effect_added_to_it(flown, identifier):
    flight, truth, parameters = flown(**{identifier: IN_FLIGHT[identifier]})
    inside = about_centre(added(identifier, flight, parameters), truth)
    outside = replayed(identifier, truth, **IN_FLIGHT[identifier])
    size = np.abs(inside).max(axis=1)
    assert size[2] > 0.1  # N
    # lags are integrated at 200 Hz in flight and filtered at 100 Hz in a replay
    assert np.abs(inside - outside).max(axis=1) == pytest.approx(np.zeros(6), abs=2e-3 * size.max())


def test_drag_is_along_the_velocity_and_stall_takes_lift(flown):
    _, truth, _ = flown()
    force = replayed("extra_drag", truth, coefficient=0.05)[:3]
    velocity = truth.matrix(f"state/{n}" for n in "uvw")
    qbar = 0.5 * truth["air/rho"] * (velocity**2).sum(axis=0)
    np.testing.assert_allclose(
        -(force * velocity).sum(axis=0), 0.05 * 1.21 * qbar * np.linalg.norm(velocity, axis=0)
    )
    assert np.abs(cross(force, velocity)).max() < 1e-9
    assert np.all(replayed("stall", truth, strength=0.3)[2] > 0)  # z is down


def test_a_stalled_wing_does_not_hold_a_roll_back(flown):
    """The half that goes down meets the air at the larger angle, loses more lift and goes on down."""
    _, truth, _ = flown()
    rate = truth.channel("state/p")

    def roll(p):
        record = truth.with_channels(replace(rate, values=np.full(rate.values.size, p)))
        return replayed("stall", record, strength=0.3, onset=0.0)[3]

    assert np.all(roll(0.5) > roll(0.0))
    assert np.all(roll(-0.5) < roll(0.0))


OPEN_LOOP = {
    "actuator_delay": ({"extra": 0.04}, ("de1", "dr2", "n3"), 2e-3),
    "actuator_delay of surfaces": ({"surface": 0.04}, ("de1", "dr2"), 2e-3),
    "actuator_delay of rotors": ({"rotor": 0.04}, ("n3", "n6"), 2e-3),
    "actuator_lag": ({"extra": 0.05}, ("de1", "dr2"), 0.03),
    # motors that rise faster than they fall do not commute with a lag
    "motor_lag": ({"extra": 0.05}, ("n3", "n6"), 0.08),
    "rate_limit": ({"slowness": 5.0}, ("df4", "dr2"), 0.15),
}


@pytest.mark.parametrize("case", OPEN_LOOP)
def test_positions_in_flight_are_those_that_act_makes_of_them(flown, case):
    """With the commands held but for the excitation, so that both flights are commanded alike."""
    settings, names, tolerance = OPEN_LOOP[case]
    identifier = case.partition(" ")[0]
    steady = {"battery_sag": 0.0}
    _, base, _ = flown(feedback=False, **steady)
    _, moved, _ = flown(feedback=False, **steady, **{identifier: settings})
    signals = {n: base[f"effector/{n}"] for n in names}
    effect = effects.find(identifier)
    usual = {n: p.default for n, p in effect.parameters.items()}
    expected = effect.act(usual | settings, signals, base.dt, VEHICLE.effector_kinds)
    for name in names:
        change = np.abs(expected[name] - signals[name]).max()
        assert change > 0.01 * np.ptp(signals[name])
        off = np.abs(moved[f"effector/{name}"] - expected[name])[10:].max()
        assert off < tolerance * max(change, np.ptp(signals[name]) / 4), name


@pytest.fixture(scope="module")
def loads():
    """The airframe's loads about the origin along a truth, wakes in their steady state; compiled once."""
    at_once = jax.jit(
        jax.vmap(lambda p, f, x: jnp.concatenate(airframe.wrench(p, f, x).wrench), (None, 0, 0))
    )

    def of(parameters, flight, **strengths):
        effects = parameters.airframe.effects
        changed = {i: {**effects[i], "strength": s} for i, s in strengths.items()}
        scaled = parameters.airframe._replace(effects=effects | changed)
        scaled = jax.tree.map(partial(jnp.asarray, dtype=float), scaled)  # one type, compiled once
        details = flight.samples.details
        return np.asarray(at_once(scaled, details.flow, details.positions)).T

    return of


def test_in_plane_forces_of_a_replay_are_those_of_the_simulation(flown, loads):
    flight, truth, parameters = flown()
    inside = loads(parameters, flight, rotor_inplane_force=1) - loads(
        parameters, flight, rotor_inplane_force=0
    )
    outside = replayed("rotor_inplane_force", truth, strength=1.0)
    inside = about_centre(inside, truth)
    assert np.abs(inside - outside).max() < 0.02 * np.abs(inside).max()


def test_a_front_wings_wake_pushes_the_rear_wing_down_in_both_forms(flown, loads):
    flight, truth, parameters = flown()
    inside = about_centre(
        loads(parameters, flight, wing_wake=1) - loads(parameters, flight, wing_wake=0), truth
    )
    outside = replayed("wing_wake", truth, strength=1.0)
    for row, sign in ((2, 1), (4, 1)):  # less lift, behind the centre of gravity: the nose goes up
        assert np.sign(inside[row].mean()) == np.sign(outside[row].mean()) == sign


class Quadratic:
    """A simulation whose rotors push along x with the square of their speed, and whose wing lifts with w."""

    responses = ("X", "Y", "Z", "L", "M", "N")

    def gradient(self, record, channels):
        out = np.zeros((6, len(channels), record.time.size))
        for i, channel in enumerate(channels):
            if channel.startswith("effector/n"):
                out[0, i] = 2 * 1e-4 * record[channel] * np.cos(record["effector/dw1"])
                out[2, i] = -2 * 1e-4 * record[channel] * np.sin(record["effector/dw1"])
            elif channel == "state/w":
                out[2, i] = -30.0
            elif channel == "effector/de1":
                out[2, i] = -40.0
        return out


def steady(truth, **values):
    """A record that stays as it is told."""
    rows = {name.replace("__", "/"): np.full(truth.time.size, value) for name, value in values.items()}
    return truth.with_channels(*(replace(truth.channel(n), values=v) for n, v in rows.items()))


def test_a_slipstream_adds_to_lift_and_surfaces_by_the_thrust_coefficient(flown):
    _, truth, _ = flown()
    still = {f"effector__{e.name}": 0.0 for e in SCENARIO.effector}
    speeds = {f"effector__n{i}": 500.0 for i in range(1, 9)}
    record = steady(
        truth,
        **still
        | speeds
        | {"effector__de1": 0.1, "state__u": 12.0, "state__v": 0.0, "state__w": 5.0}
        | dict.fromkeys(("state__p", "state__q", "state__r"), 0.0),
    )
    found = replayed("slipstream", record, Quadratic(), strength=1.0)
    thrust, disc, rho = 1e-4 * 500**2, np.pi / 4 * 0.4064**2, record["air/rho"]
    # the air behind a disc is faster by T / (rho A V); the wing's chord is level: w is across it
    lift = 8 * 0.5 * rho * 4.5 * 0.33 * 0.4064 * thrust / (rho * disc * 13.0) * 5.0
    coefficient = thrust / (0.5 * rho * disc * 13.0**2)
    np.testing.assert_allclose(found[2], -lift - 0.7 * coefficient * 40.0 * 0.1, rtol=1e-9)
    assert np.abs(found[[1, 3, 5]]).max() < 1e-9 * np.abs(found[2]).max()  # left and right are alike


def test_near_ground_a_hovering_rotor_gains_as_cheeseman_and_bennett_say(flown):
    _, truth, _ = flown()
    up = {f"effector__{e.name}": 0.0 for e in SCENARIO.effector} | {
        "effector__dw1": np.pi / 2,
        "effector__dw2": np.pi / 2,
        "effector__n1": 500.0,
        "state__u": 0.0,
        "state__v": 0.0,
        "state__w": 0.0,
        "state__alt": 100.3,
    }
    found = replayed("ground_effect", steady(truth, **up), Quadratic(), strength=1.0, ground=100.0)
    height = 0.3 + 0.2  # the hub is 0.2 m above its pivot, which is at the origin's height
    near = (0.2032 / (4 * height)) ** 2
    assert found[2][0] == pytest.approx(-25.0 * near / (1 - near), rel=1e-3)


class WithTorque(Quadratic):
    """The same, whose first rotor turns the vehicle too: about its shaft, and by the thrust at its hub."""

    def gradient(self, record, channels):
        out = super().gradient(record, channels)
        first = VEHICLE.rotors[0]
        hub, shaft = along.hub(record, VEHICLE, first), along.shaft(record, VEHICLE, first)
        for i, channel in enumerate(channels):
            out[3:, i] = np.cross(hub - along.centre(record, VEHICLE), out[:3, i], axis=0)
            out[3:, i] -= 2 * 3e-6 * record[channel] * shaft
        return out


def test_a_weak_rotor_that_drags_as_before_keeps_the_torque_of_the_thrust_that_it_lost(flown):
    _, truth, _ = flown()
    record = steady(truth, effector__n1=500.0, effector__dw1=0.4)
    found = replayed("weak_rotor", record, WithTorque(), n1=0.2, torque_kept=1.0)
    kept = -0.2 * 3e-6 * 500.0**2
    np.testing.assert_allclose(found[3:, 0], kept * np.array([np.cos(0.4), 0.0, -np.sin(0.4)]), atol=1e-12)
    assert not found[:3].any()
    assert not replayed("weak_rotor", record, WithTorque(), n1=0.2).any()


def test_rotors_push_back_against_being_turned_and_sped_up(flown):
    _, truth, _ = flown()
    time = truth.time
    values = {f"effector__{e.name}": 0.0 for e in SCENARIO.effector}
    values |= {"effector__n1": 400.0 + 50.0 * time, "state__p": 0.0, "state__q": 0.3, "state__r": 0.0}
    found = replayed("gyroscopic", steady(truth, **values), strength=1.0)
    inertia = 2.5e-4  # kg m2; n1 turns right-handed about x
    np.testing.assert_allclose(found[3], -inertia * 50.0, rtol=1e-6)
    # w x h = (0, q, 0) x (h, 0, 0) = (0, 0, -q h)
    np.testing.assert_allclose(found[5], 0.3 * inertia * (400.0 + 50.0 * time), rtol=1e-9)


def test_backlash_in_flight_is_the_play_of_a_replay():
    from freqid.simulate.effects import backlash

    servo = 0.1 * np.sin(0.3 * np.arange(60))
    settings, at, found = {"width": jnp.asarray(0.04)}, jnp.asarray([servo[0]]), []
    for now in servo:
        at = backlash.dragged(settings, at, jnp.asarray([now]))
        found.append(float(at[0]))
    expected = backlash.EFFECT.feel({"width": 0.04}, {"de1": servo}, 0.02, {"de1": "surface"})["de1"]
    np.testing.assert_allclose(found, expected, atol=1e-15)

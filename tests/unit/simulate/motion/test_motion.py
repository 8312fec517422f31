"""The whole vehicle of scenarios/la8.toml in motion: memory, effects, and what they are worth."""

from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.scenario import read_scenario
from freqid.simulate.air.surroundings import Surroundings, calm, relative_flow, windy
from freqid.simulate.effects import ground_effect, turbulence
from freqid.simulate.loads import wake
from freqid.simulate.loads.airframe import Situation
from freqid.simulate.loads.quantities import Aero, Flow, Positions, Wake, Wrench
from freqid.simulate.motion import attitude
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import Commands
from freqid.simulate.motion.integrate import integrate
from freqid.simulate.motion.rigid_body import BodyState

SCENARIO = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0]
DT, STEPS = 0.005, 160
AIR = calm(1.2, ground=40.0)
QUICK = {"xla_backend_optimization_level": 0}  # half the time to compile, for a few calls


@pytest.fixture(scope="module")
def parameters():
    return jax.tree.map(jnp.asarray, motion.parameters(SCENARIO))


@pytest.fixture(scope="module")
def begin(parameters):
    started = jax.jit(partial(motion.start, dt=DT))
    return lambda body, positions: started(parameters, body, positions, AIR)


@pytest.fixture(scope="module")
def start(begin):
    body = BodyState(
        jnp.array([0.0, 0.0, -100.0]),
        attitude.from_euler(0.0, 0.05, 0.0),
        jnp.array([14.0, 0.0, 0.7]),
        jnp.zeros(3),
    )
    positions = Positions(jnp.zeros(10), jnp.full(2, 0.3), jnp.zeros(2), jnp.full(8, 450.0))
    return begin(body, positions)


@pytest.fixture(scope="module")
def fly():
    """Flights of 0.8 s: what moves, and details, at every step; compiled once for all tests."""

    @partial(jax.jit, compiler_options=QUICK)
    def flown(parameters, state, commands, dt):
        step = lambda s, c: motion.step(parameters, s, c, AIR, dt)  # noqa: E731
        look = lambda s, c: (s.moving, motion.observe(parameters, s, c, AIR, dt))  # noqa: E731
        return integrate(step, state, commands, observe=look)[0]

    def plain(*inputs):
        """Call with plain arrays, so that no difference in type compiles it again."""
        return flown(*jax.tree.map(partial(np.asarray, dtype=float), inputs))

    return lambda parameters, state, commands, dt=DT: plain(parameters, state, commands, dt)


def held(state):
    """The commands that the vehicle starts with, for the whole flight."""
    return jax.tree.map(lambda line: jnp.repeat(line[:1], STEPS, axis=0), state.commands)


def with_effect(parameters, **strengths):
    effects = parameters.airframe.effects
    changed = {**effects, **{n: {**effects[n], "strength": jnp.asarray(x)} for n, x in strengths.items()}}
    return parameters._replace(airframe=parameters.airframe._replace(effects=changed))


def test_a_start_is_steady_for_everything_but_the_body(parameters, start, fly):
    moving, (rate, _) = fly(parameters, start, held(start))
    for part in (rate.surface, rate.surface_rate, rate.tilt, rate.tilt_rate):
        assert np.array_equal(part, np.zeros_like(part))
    assert np.max(np.abs(rate.speed[0])) < 1e-9
    assert np.all(np.diff(moving.charge) < 0)
    # Left and right are mirrored, so an untrimmed flight pitches and climbs but does not turn.
    assert np.max(np.abs(moving.body.rates[:, [0, 2]])) < 1e-12
    assert np.max(np.abs(moving.body.rates[:, 1])) > 1e-3


def test_the_recorded_rate_of_change_is_that_of_what_moves(parameters, start, fly):
    commands = held(start)
    commands = commands._replace(
        surface=commands.surface.at[:, 0].set(0.1 * jnp.sin(20 * DT * jnp.arange(STEPS)))
    )
    moving, (rate, _) = fly(parameters, start, commands)
    for value, slope in ((moving.body.velocity, rate.body.velocity), (moving.body.rates, rate.body.rates)):
        central = (value[2:] - value[:-2]) / (2 * DT)
        # commands are held over a step, so slopes jump between them by about their own step
        assert np.max(np.abs(central - slope[1:-1])) < 0.02 * np.max(np.abs(slope))


def test_halving_the_step_changes_a_flight_by_little(parameters, start, fly):
    coarse = fly(parameters, start, held(start))[0]
    fine = fly(parameters, start, held(start), DT / 2)[
        0
    ]  # the lines are full of one value: they fit any step
    last = STEPS // 2 - 1
    change = np.abs(coarse.body.velocity[last] - fine.body.velocity[2 * last])
    assert np.max(change) < 1e-4 * np.max(np.abs(coarse.body.velocity[last] - coarse.body.velocity[0]))


def test_commands_arrive_late_by_their_delay_and_at_once_without_it(parameters, start, fly):
    commands = held(start)
    commands = commands._replace(surface=commands.surface.at[:, 3].set(0.2))
    moving, _ = fly(parameters, start, commands)
    late = int(np.argmax(moving.surface[:, 3] > 0)) * DT
    assert late == pytest.approx(0.02 + DT)  # a servo of second order moves in the step after
    moving, _ = fly(with_effect(parameters, actuator_delay=0.0), start, commands)
    assert int(np.argmax(moving.surface[:, 3] > 0)) == 1
    moving, _ = fly(with_effect(parameters, actuator_delay=2.0), start, commands)
    assert int(np.argmax(moving.surface[:, 3] > 0)) == 9


def test_without_lag_surfaces_are_where_they_are_commanded(parameters, start, fly):
    commands = held(start)
    commands = commands._replace(surface=commands.surface.at[:, 3].set(0.2))
    bare = with_effect(parameters, actuator_lag=0.0, actuator_delay=0.0)
    _, (_, details) = fly(bare, start, commands)
    assert np.allclose(details.positions.surface[:, 3], 0.2)
    half = with_effect(parameters, actuator_lag=0.5, actuator_delay=0.0)
    moving, (_, details) = fly(half, start, commands)
    assert np.allclose(details.positions.surface[:, 3], 0.5 * (0.2 + moving.surface[:, 3]))


def test_a_sagging_battery_slows_the_rotors_by_the_voltage(parameters, start, fly):
    commands = held(start)._replace(speed=jnp.full((STEPS, 8), 450.0))
    moving, (_, details) = fly(parameters, start, commands)
    sagged = 450.0 * details.power.voltage[-1] / 46.0
    assert np.allclose(moving.speed[-1], sagged, rtol=1e-3)
    assert abs(sagged - 450.0) > 1.0
    moving, _ = fly(with_effect(parameters, battery_sag=0.0), start, commands)
    assert np.allclose(moving.speed[-1], 450.0, rtol=1e-6)


def test_gyroscopic_moments_turn_the_body_only_where_spins_do_not_cancel(parameters, start, fly):
    commands = held(start)
    uneven = commands._replace(speed=commands.speed * jnp.array([1.2, 0.8, 1.2, 0.8, 0.8, 1.2, 0.8, 1.2]))
    with_spin, without = (
        fly(with_effect(parameters, gyroscopic=g), start, uneven)[0].body.rates for g in (1.0, 0.0)
    )
    assert np.max(np.abs(with_spin - without)) > 1e-3
    with_spin, without = (
        fly(with_effect(parameters, gyroscopic=g), start, commands)[0].body.rates for g in (1.0, 0.0)
    )
    assert np.allclose(with_spin, without, atol=1e-12)


def test_the_wake_that_arrives_left_the_front_wing_a_convection_time_ago(parameters, start, fly):
    ages = np.arange(start.wake.downwash.shape[0])[:, None] * np.ones(2)
    ramp, zero = Wake(0.1 * ages, 0.05 * ages), Wake(0 * ages, 0 * ages)
    _, (_, details) = fly(parameters, start._replace(wake=ramp), held(start))
    flow = jax.tree.map(lambda x: x[0], details.flow)
    age = float(wake.convection_time(parameters.airframe.wakes, flow)) / DT - 1  # the newest is a step old
    even = Wake(zero.downwash + 0.1 * age, zero.blowing + 0.05 * age)
    _, (_, expected) = fly(parameters, start._replace(wake=even), held(start))
    _, (_, without) = fly(parameters, start._replace(wake=zero), held(start))
    moments = [np.array(d.aero.wrench.moment[0]) for d in (details, expected, without)]
    assert np.allclose(moments[0], moments[1], rtol=1e-10, atol=1e-10)
    assert abs(moments[0][1] - moments[2][1]) > 0.1  # N m: it matters


def test_wind_and_turning_air_are_felt_in_body_axes():
    body = BodyState(
        jnp.array([0.0, 0.0, -60.0]),
        attitude.from_euler(0.0, 0.0, np.pi / 2),
        jnp.array([10.0, 0, 0]),
        jnp.zeros(3),
    )  # heading east at 10 m/s
    around = Surroundings(
        wind=jnp.array([1.0, 4.0, 0.0]),
        spin=jnp.array([0.0, 0.0, 0.2]),
        rho=jnp.array(1.2),
        ground=jnp.array(50.0),
    )
    flow = relative_flow(body, around)
    assert np.allclose(
        flow.velocity, [6.0, 1.0, 0.0]
    )  # the west wind from behind, the south wind from the right
    assert np.allclose(flow.rates, [0.0, 0.0, -0.2])
    assert float(flow.height) == pytest.approx(10.0)


def test_gusts_come_along_the_flight_path_on_top_of_the_wind():
    gusts = np.arange(12.0).reshape(6, 2)
    around = windy(np.array([3.0, 0.0, 0.0]), gusts, 1.2, heading=np.pi / 2)  # eastward
    assert np.allclose(around.wind, [[3 - 2, 0, 4], [3 - 3, 1, 5]])
    assert np.allclose(around.spin, [[-8, 6, 10], [-9, 7, 11]])
    assert around.rho.shape == around.ground.shape == (2,)
    off = turbulence.series({"wind_20ft": 0.0}, height=9e9, airspeed=0.0, span=1.8, steps=4, dt=0.1, seed=0)
    assert np.array_equal(off, np.zeros((6, 4)))


def test_the_ground_adds_what_cheeseman_and_bennett_say(parameters):
    # One radius up in hover: 1 / (1 - 1 / 16); half of it with forward speed v; little above three.
    rotors = parameters.airframe.propellers
    hover = Positions(jnp.zeros(10), jnp.full(2, np.pi / 2), jnp.zeros(2), jnp.full(8, 500.0))
    thrust, radius = jnp.full(8, 35.0), float(rotors.diameter[0]) / 2
    aero = Aero(Wrench(jnp.zeros(3), jnp.zeros(3)), jnp.zeros(8), thrust, Wake(jnp.zeros(2), jnp.zeros(2)))
    induced = np.sqrt(35.0 / (2 * 1.2 * np.pi * radius**2))

    @jax.jit
    def gain(height, speed, tilt):
        flow = Flow(speed * jnp.array([1.0, 0, 0]), jnp.zeros(3), jnp.array(1.2), height)
        at = hover._replace(tilt=tilt)
        added = ground_effect.EFFECT.add({"strength": 1.0}, Situation(parameters.airframe, flow, at, aero))
        return jnp.append(added.force, added.moment) / (8 * 35.0)

    # Upright, the front hubs are 0.2 m above the origin and the rear ones 0.35 m.
    up, level = jnp.full(2, np.pi / 2), jnp.zeros(2)
    near = np.array([(radius / (4 * (1.0 + h))) ** 2 for h in (0.2, 0.35)])
    assert float(gain(1.0, 0.0, up)[2]) == pytest.approx(-np.mean(near / (1 - near)), rel=1e-4)
    assert float(gain(1.0, induced, up)[2]) == pytest.approx(-np.mean(near / 2 / (1 - near / 2)), rel=1e-3)
    assert float(gain(1.0, 0.0, up)[4]) > 0  # the front, nearer the ground, is lifted more
    assert np.array_equal(gain(1.0, 0.0, level), np.zeros(6))
    assert -gain(60.0, 0.0, up)[2] < 1e-6


def test_derivatives_stay_finite_at_rest_in_still_air_and_beyond_stall(parameters, start):
    moving = start.moving
    speeds = jnp.array([[0.0, 0, 0], [14.0, 0, 0], [0.0, 0, 12.0], [-9.0, 3.0, -4.0], [0.0, 0.0, 0.0]])
    rotors = jnp.array([0.0, 0.0, 450.0, 300.0, 520.0])
    tilts = jnp.array([0.0, 0.3, 1.57, 1.2, 1.57])

    @partial(jax.jit, compiler_options=QUICK)
    @jax.vmap
    def slope(velocity, rotor, tilt):
        def of(p, velocity, rotor, tilt):
            at = moving._replace(
                body=moving.body._replace(velocity=velocity), speed=jnp.full(8, rotor), tilt=jnp.full(2, tilt)
            )
            commands = Commands(jnp.zeros(10), at.tilt, at.speed)
            return motion.derivative(p, at, commands, Wake(jnp.ones(2), jnp.ones(2)), AIR)[0]

        one = jax.tree.map(jnp.ones_like, (parameters, velocity, rotor, tilt))
        return jax.jvp(of, (parameters, velocity, rotor, tilt), one)

    for leaf in jax.tree.leaves(slope(speeds, rotors, tilts)):
        assert np.all(np.isfinite(leaf))


def test_a_delay_that_is_longer_than_the_line_is_refused():
    effects = {**SCENARIO.simulation.effects, "actuator_delay": {"strength": 9.0}}
    late = msgspec.structs.replace(
        SCENARIO, simulation=msgspec.structs.replace(SCENARIO.simulation, effects=effects)
    )
    with pytest.raises(UsageError, match=r"a command is delayed by 0.18 s, at most 0.1 s can be"):
        motion.parameters(late)


@pytest.mark.parametrize(
    ("effect", "name"),
    [("battery_sag", "emptying"), ("rotor_inplane_force", "hub_moment")],
)
def test_what_flights_have_in_another_way_is_refused(effect, name):
    effects = {**SCENARIO.simulation.effects, effect: {name: 0.005}}
    changed = msgspec.structs.replace(
        SCENARIO, simulation=msgspec.structs.replace(SCENARIO.simulation, effects=effects)
    )
    with pytest.raises(UsageError, match=f"{effect}: flights do not have its {name}"):
        motion.parameters(changed)


def test_a_delay_of_one_effector_alone_is_refused():
    effects = {**SCENARIO.simulation.effects, "actuator_delay": {"de1": 0.01}}
    late = msgspec.structs.replace(
        SCENARIO, simulation=msgspec.structs.replace(SCENARIO.simulation, effects=effects)
    )
    with pytest.raises(UsageError, match="actuator_delay: flights do not have it at de1 alone"):
        motion.parameters(late)

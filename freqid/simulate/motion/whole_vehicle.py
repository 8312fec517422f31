"""The whole vehicle in motion: one state, one step, whatever commands it.

Everything with memory is in `State`: the rigid body, servos, tilt drives, motors, the battery's charge,
what effects remember, commands under way and the front wing's wake under way. A closed loop puts its
controller's own state beside this one and calls `step` with commands that the controller made and the
excitation was added to.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario
from freqid.simulate.air.surroundings import Surroundings, relative_flow
from freqid.simulate.effects import (
    actuator_delay,
    actuator_lag,
    backlash,
    battery_sag,
    gyroscopic,
    loaded,
    motor_lag,
    rate_limit,
    shipped,
)
from freqid.simulate.effects.places import alone
from freqid.simulate.loads import airframe, description
from freqid.simulate.loads.airframe import Memories
from freqid.simulate.loads.coefficients import Coefficients
from freqid.simulate.loads.quantities import Aero, Flow, Positions, Wake
from freqid.simulate.motion import delay_line, multibody, rigid_body
from freqid.simulate.motion.actuators import (
    Actuators,
    Commands,
    actuators,
    motor_acceleration,
    servo_acceleration,
)
from freqid.simulate.motion.battery import Power, charge_rate, power
from freqid.simulate.motion.integrate import rk4
from freqid.simulate.motion.multibody import Configuration, MassModel
from freqid.simulate.motion.rigid_body import BodyState

LONGEST_DELAY = 0.1  # s, of a command; the wake's is bounded by its own convection time
_LONGEST_CONVECTION = 0.5  # s


class Parameters(NamedTuple):
    """All numbers of a simulation, leaves that can be differentiated and batched.

    Attributes
    ----------
    airframe : airframe.Parameters or Coefficients
        With the settings of every effect.
    mass : MassModel
    actuators : Actuators
    """

    airframe: airframe.Parameters | Coefficients
    mass: MassModel
    actuators: Actuators


class Moving(NamedTuple):
    """What changes continuously; also its rate of change.

    Attributes
    ----------
    body : BodyState
    surface, surface_rate : Array, shape (surface,)
        Of the servos, rad and rad/s.
    tilt, tilt_rate : Array, shape (wing,)
        rad and rad/s.
    speed : Array, shape (rotor,)
        rad/s.
    charge : Array, shape ()
        Of the battery, 0 to 1.
    memories : dict of dict of Array
        Of effects on the airframe, by their id and the names of their states.
    """

    body: BodyState
    surface: jax.Array
    surface_rate: jax.Array
    tilt: jax.Array
    tilt_rate: jax.Array
    speed: jax.Array
    charge: jax.Array
    memories: Memories


class State(NamedTuple):
    """All memory of the vehicle.

    Attributes
    ----------
    moving : Moving
    commands : Commands of Array, shape (sample, ...)
        Under way to the actuators, the newest first.
    wake : Wake of Array, shape (sample, 2)
        Under way from the front to the rear wing, the newest first.
    followed : Commands
        What the actuators followed in the last step.
    dragged : Array, shape (surface,)
        Where surfaces are inside the play of their linkages, rad.
    """

    moving: Moving
    commands: Commands
    wake: Wake
    followed: Commands
    dragged: jax.Array


class Details(NamedTuple):
    """What one evaluation of the motion yields besides the rate of change.

    Attributes
    ----------
    flow : Flow
    positions : Positions
        Of the effectors, where they can be measured.
    aero : Aero
    power : Power
    """

    flow: Flow
    positions: Positions
    aero: Aero
    power: Power


def parameters(scenario: Scenario) -> Parameters:
    """Return all numbers of the simulation that a scenario describes.

    Raises
    ------
    UsageError
        Where a section is incomplete, has unknown keys or asks for a delay beyond `LONGEST_DELAY`.
    """
    described = description.parameters(scenario)
    settings = {i: {n: float(x) for n, x in of.items()} for i, of in described.effects.items()}
    built = Parameters(
        airframe=described,
        mass=multibody.mass_model(loaded(scenario.aircraft(), settings)),
        actuators=actuators(scenario),
    )
    for effect in (e for i, e in shipped().items() if i in settings):
        for name, value in settings[effect.id].items():
            known = effect.parameters.get(name)
            if known is not None and known.replay_only and value != known.default:
                raise UsageError(
                    f"effect {effect.id}: flights do not have its {name}", remedy=f"leave {name} out"
                )
    for effect in (actuator_delay, actuator_lag, motor_lag, rate_limit, backlash):
        single = alone(effect.EFFECT, settings[effect.EFFECT.id])
        if single:
            raise UsageError(
                f"effect {effect.EFFECT.id}: flights do not have it at {single[0]} alone",
                remedy=f"set {effect.EFFECT.size}, which all effectors have in common",
            )
    delays = actuator_delay.delays(built.airframe.effects["actuator_delay"], built.actuators.delay)
    if max(delays) > LONGEST_DELAY:
        raise UsageError(
            f"a command is delayed by {max(delays):.3g} s, at most {LONGEST_DELAY:g} s can be",
            remedy="lower delay_s in [simulation.actuators] or effect actuator_delay",
        )
    return built


def start(
    parameters: Parameters, body: BodyState, positions: Positions, around: Surroundings, dt: float
) -> State:
    """Return the state of a vehicle that has been doing for long what it does now.

    Parameters
    ----------
    parameters : Parameters
    body : BodyState
    positions : Positions
        Of the effectors; they rest there.
    around : Surroundings
    dt : float
        Of the steps to come, s.
    """
    charge = parameters.actuators.battery.charge
    still = jnp.zeros_like(positions.surface)
    flow = relative_flow(body, around)
    aero = airframe.wrench(parameters.airframe, flow, positions)
    commands = holding(parameters, positions, aero, charge)
    memories = airframe.steady_memories(parameters.airframe, flow, positions)
    moving = Moving(
        body, positions.surface, still, positions.tilt, positions.tilt_rate, positions.speed, charge, memories
    )
    return State(
        moving,
        delay_line.start(commands, int(np.ceil(LONGEST_DELAY / dt)) + 2),
        delay_line.start(aero.shed, int(np.ceil(_LONGEST_CONVECTION / dt)) + 2),
        commands,
        positions.surface,
    )


def holding(parameters: Parameters, positions: Positions, aero: Aero, charge: jax.Array) -> Commands:
    """Return the commands that keep effectors where they are, the battery's voltage allowed for."""
    ratio, _ = _voltage(parameters, aero, positions.speed, charge)
    return Commands(positions.surface, positions.tilt, positions.speed / ratio)


def derivative(
    parameters: Parameters,
    moving: Moving,
    commands: Commands,
    arriving: Wake | None,
    around: Surroundings,
    dragged: jax.Array | None = None,
) -> tuple[Moving, Details]:
    """Return the rate of change of what moves, and what it came from.

    Parameters
    ----------
    parameters : Parameters
    moving : Moving
    commands : Commands
        As they reach the actuators.
    arriving : Wake, optional
        What reaches the rear wing; the steady wake where absent.
    around : Surroundings
    dragged : Array, shape (surface,), optional
        Where surfaces were at the start of the step, rad; without play where absent.
    """
    effects, act, memories = parameters.airframe.effects, parameters.actuators, moving.memories
    surface = actuator_lag.position(effects["actuator_lag"], moving.surface, commands.surface)
    positions = Positions(surface, moving.tilt, moving.tilt_rate, moving.speed)
    felt = surface if dragged is None else backlash.dragged(effects["backlash"], dragged, surface)
    flow = relative_flow(moving.body, around)
    aero, rates = airframe.remembering(
        parameters.airframe, flow, positions._replace(surface=felt), arriving, memories
    )
    ratio, given = _voltage(parameters, aero, moving.speed, moving.charge)
    servos = act.surface._replace(rate_limit=rate_limit.limits(effects["rate_limit"], act.surface.rate_limit))
    surface_rate = servo_acceleration(servos, moving.surface, moving.surface_rate, commands.surface)
    tilt_rate = servo_acceleration(act.tilt, moving.tilt, moving.tilt_rate, commands.tilt)
    slower = motor_lag.longer(effects["motor_lag"])
    motors = act.motor._replace(rise=slower * act.motor.rise, fall=slower * act.motor.fall)
    speed = motor_acceleration(motors, moving.speed, commands.speed, ratio)
    body = rigid_body.derivative(
        gyroscopic.spinning(effects["gyroscopic"], parameters.mass),
        Configuration(moving.tilt, moving.tilt_rate, moving.speed),
        Configuration(moving.tilt_rate, tilt_rate, speed),
        moving.body,
        aero.wrench,
    )
    charge = charge_rate(act.battery, given.current)
    rate = Moving(body, moving.surface_rate, surface_rate, moving.tilt_rate, tilt_rate, speed, charge, rates)
    return rate, Details(flow, positions, aero, given)


def step(parameters: Parameters, state: State, commands: Commands, around: Surroundings, dt: float) -> State:
    """Return the state one step later; parameters as in `seen_step`."""
    return seen_step(parameters, state, commands, around, dt)[0]


def seen_step(
    parameters: Parameters, state: State, commands: Commands, around: Surroundings, dt: float
) -> tuple[State, tuple[Moving, Details]]:
    """Return the state one step later, and what `observe` sees at the start of the step.

    Parameters
    ----------
    parameters : Parameters
    state : State
    commands : Commands
        Sent now, after control and excitation; held over the step.
    around : Surroundings
        Held over the step.
    dt : float
        Step, s; as `start` was told.
    """
    sent = delay_line.push(state.commands, commands)
    obeyed = _arrived(parameters, sent, state.followed, dt)
    age = _wake_age(parameters, state, around, dt)

    def rate(moving: Moving, elapsed: jax.Array) -> tuple[Moving, tuple[Moving, Details]]:
        arriving = delay_line.read(state.wake, age - elapsed / dt)
        slope, details = derivative(parameters, moving, obeyed, arriving, around, state.dragged)
        return slope, (slope, details)

    moving, seen = rk4(rate, state.moving, dt, has_aux=True)
    moving = moving._replace(body=rigid_body.normalised(moving.body))
    effects = parameters.airframe.effects
    surface = actuator_lag.position(effects["actuator_lag"], moving.surface, obeyed.surface)
    dragged = backlash.dragged(effects["backlash"], state.dragged, surface)
    return State(moving, sent, delay_line.push(state.wake, seen[1].aero.shed), obeyed, dragged), seen


def observe(
    parameters: Parameters, state: State, commands: Commands, around: Surroundings, dt: float
) -> tuple[Moving, Details]:
    """Return the rate of change and the details at the start of a step; parameters as in `step`."""
    obeyed = _arrived(parameters, delay_line.push(state.commands, commands), state.followed, dt)
    arriving = delay_line.read(state.wake, _wake_age(parameters, state, around, dt))
    return derivative(parameters, state.moving, obeyed, arriving, around, state.dragged)


def _arrived(parameters: Parameters, sent: Commands, before: Commands, dt: float) -> Commands:
    """Return the commands that the described actuators follow, late and behind by lags."""
    effects = parameters.airframe.effects
    arrived = actuator_delay.arrived(effects["actuator_delay"], parameters.actuators.delay, sent, dt)
    servo, motor = effects["actuator_lag"]["extra"], motor_lag.before(effects["motor_lag"])
    return Commands(
        *(
            actuator_lag.behind(lag, command, old, dt)
            for lag, command, old in zip((servo, servo, motor), arrived, before, strict=True)
        )
    )


def _wake_age(parameters: Parameters, state: State, around: Surroundings, dt: float) -> jax.Array:
    """Return where in the line the wake is that arrives now; its newest entry is one step old."""
    flow = relative_flow(state.moving.body, around)
    return parameters.airframe.convection_time(flow) / dt - 1


def _voltage(
    parameters: Parameters, aero: Aero, speed: jax.Array, charge: jax.Array
) -> tuple[jax.Array, Power]:
    """Return the voltage that the motors feel over the nominal one, and what the battery gives."""
    battery = parameters.actuators.battery
    given = power(battery, charge, aero.torque, speed)
    settings = parameters.airframe.effects["battery_sag"]
    return battery_sag.voltage_ratio(settings, given.voltage, battery.nominal), given

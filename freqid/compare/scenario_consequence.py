"""What effects cost in margins, modes and trim in the simulation of a scenario, linearised at its trims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.compare.consequence import Condition, Consequence, compare_conditions
from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.scenario import Reference, Scenario
from freqid.dynamics.linear_loop import Actuation, LinearLoop
from freqid.dynamics.small_motion import navigation_rows
from freqid.simulate import effects as library
from freqid.simulate.control.law import Setting
from freqid.simulate.control.linearize import STATES, linearize
from freqid.simulate.control.lq import axes_of, design_law
from freqid.simulate.control.trim import Trim, trim
from freqid.simulate.effects import actuator_delay, motor_lag
from freqid.simulate.maneuver import with_effects
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import by_kind

Settings = Mapping[str, Mapping[str, float]]
Name = tuple[str, str]

INTEGRATORS = ("integral of u", "integral of v", "altitude", "integral of psi")
"""States of the control law."""

DRAWS = 200
"""Vehicles drawn for the intervals."""

_STEP = 0.5  # sigma: the step by which a vehicle's derivatives by an effect's parameter are taken


def consequence_of_effects(
    scenario: Scenario,
    reference: Reference,
    before: Settings,
    after: Settings,
    *,
    names: Sequence[Name] = (),
    covariance: ArrayLike | None = None,
    draws: int = DRAWS,
    level: float = 0.9,
    seed: int = 0,
) -> Consequence:
    """Return what effects cost at one condition of a scenario, under the law designed without them.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    before, after : mapping of mapping of float
        Parameters by effect id, replacing the scenario's: as simulated, and as found in flight.
    names : sequence of (effect, parameter), length k
        Those parameters of `after` that are uncertain.
    covariance : array_like, shape (k, k), optional
        Their covariance; without it there are no intervals.
    draws : int
        Vehicles drawn for the intervals.
    level : float
        Of the intervals.
    seed : int
        Of the random numbers.

    Returns
    -------
    Consequence

    Raises
    ------
    UsageError
        For unknown effects or parameters, a covariance of another shape, or a condition that cannot be
        trimmed.

    Notes
    -----
    A drawn vehicle (A, B and trim) is interpolated linearly in each parameter between the vehicle found and
    one that is half a sigma away. Its actuators and margins are computed in full.
    """
    law = design_law_at(scenario, reference, before)
    start = condition_at(scenario, reference, before, law)
    end = condition_at(scenario, reference, after, law)
    pairs = []
    if covariance is not None and names:
        spread = np.asarray(covariance, dtype=float)
        if spread.shape != (len(names), len(names)):
            raise UsageError(
                f"the covariance of {len(names)} parameters has shape {spread.shape}",
                remedy="give one row and one column for each name",
            )
        sigma = np.sqrt(np.diag(spread))
        neighbours = [
            condition_at(scenario, reference, _shifted(after, [name], [_STEP * s]), law)
            for name, s in zip(names, sigma, strict=True)
        ]
        rng = np.random.default_rng(seed)
        for shift in rng.multivariate_normal(np.zeros(len(names)), spread, draws):
            steps = np.divide(shift, _STEP * sigma, out=np.zeros_like(shift), where=sigma > 0)
            settings = _within_bounds(_shifted(after, names, shift))
            pairs.append((start, _interpolated(scenario, end, neighbours, steps, settings)))
    return compare_conditions(start, end, pairs, level=level)


def condition_at(scenario: Scenario, reference: Reference, settings: Settings, law: Setting) -> Condition:
    """Return the vehicle with effects, trimmed, with its actuators, under a given law.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    settings : mapping of mapping of float
        Parameters by effect id, replacing the scenario's.
    law : Setting
        Gains and allocation at one condition, as `design_law_at` returns them.
    """
    described = with_effects(scenario, {k: dict(v) for k, v in settings.items()})
    parameters = jax.device_put(motion.parameters(described))
    at = trim(described, parameters, reference)
    linear = linearize(described, parameters, at)
    velocity, theta = np.asarray(at.body.velocity), float(at.angles[1])
    order = _commanded(scenario)
    states = (*STATES, *INTEGRATORS)
    size, k = len(states), len(STATES)
    A, B = np.zeros((size, size)), np.zeros((size, len(order)))
    A[:k, :k], B[:k] = linear.A, linear.B[:, order]
    climb = np.append(navigation_rows(velocity, theta)[1], 0.0)
    unit = np.eye(k)
    A[k:, :k] = [unit[STATES.index("u")], unit[STATES.index("v")], climb, unit[STATES.index("psi")]]
    effectors = tuple(linear.effectors[i] for i in order)
    loop = LinearLoop(
        states=states,
        effectors=effectors,
        axes=axes_of(scenario),
        A=A,
        B=B,
        gain=np.asarray(law.gain),
        allocation=np.concatenate([np.asarray(law.surface), np.asarray(law.speed)]),
        actuation=_actuation(parameters, _speed_per_command(at)),
    )
    positions = np.concatenate([np.asarray(at.positions.surface), np.asarray(at.positions.speed)])
    return Condition(
        loop,
        trim=dict(zip(effectors, positions.tolist(), strict=True)),
        limits={e.name: e.limits for e in scenario.effector if e.name in effectors},
    )


def design_law_at(scenario: Scenario, reference: Reference, settings: Settings) -> Setting:
    """Return the control law of one condition, designed for the vehicle with these effects."""
    described = with_effects(scenario, {k: dict(v) for k, v in settings.items()})
    parameters = jax.device_put(motion.parameters(described))
    law = design_law(described, parameters, [trim(described, parameters, reference)])
    return jax.tree.map(lambda table: np.asarray(table)[0], law.settings)


def _commanded(scenario: Scenario) -> NDArray[np.int64]:
    """Return the indices of the effectors that the law commands: surfaces, then rotors."""
    vehicle = scenario.aircraft()
    kinds = by_kind(vehicle, np.arange(len(vehicle.effectors)))
    return np.concatenate([np.asarray(kinds.surface), np.asarray(kinds.speed)]).astype(np.int64)


def _speed_per_command(at: Trim) -> Array:
    """Return rotor speeds over their commands; a sagging battery lowers them."""
    speed, command = np.asarray(at.positions.speed), np.asarray(at.commands.speed)
    return np.divide(speed, command, out=np.ones_like(speed), where=command > 0)


def _actuation(parameters: motion.Parameters, speed_per_command: Array) -> Actuation:
    """Return the linear dynamics of surfaces and rotors, away from rate limits, stops and backlash."""
    act, effects = parameters.actuators, parameters.airframe.effects
    delay = actuator_delay.delays(effects["actuator_delay"], act.delay)
    servo, motor = effects["actuator_lag"], effects["motor_lag"]
    surfaces, rotors = act.surface.low.size, act.motor.low.size

    def both(surface: ArrayLike, rotor: ArrayLike) -> Array:
        parts = [np.broadcast_to(surface, surfaces), np.broadcast_to(rotor, rotors)]
        return np.concatenate(parts).astype(float)

    # in a small oscillation a rotor follows with the mean of its rates up and down
    slower = motor_lag.longer(motor)
    lag = 2 * slower / (1 / np.asarray(act.motor.rise) + 1 / np.asarray(act.motor.fall))
    return Actuation(
        gain=both(1.0, speed_per_command),
        delay=np.maximum(both(np.asarray(delay.surface), np.asarray(delay.speed)), 0.0),
        frequency=both(np.asarray(act.surface.frequency), np.inf),
        damping=both(np.asarray(act.surface.damping), 1.0),
        share=both(np.asarray(servo["strength"]), 1.0),
        lag=both(np.asarray(servo.get("extra", 0.0)), lag),
        lag_2=both(0.0, motor_lag.before(motor)),
    )


def _shifted(settings: Settings, names: Sequence[Name], shift: Sequence[float] | Array) -> Settings:
    """Return settings with some parameters shifted."""
    table = {effect: dict(values) for effect, values in settings.items()}
    for (effect, parameter), by in zip(names, shift, strict=True):
        known = library.find(effect).parameters
        if parameter not in known and parameter not in table.get(effect, {}):
            raise UsageError(
                f"effect '{effect}' has no parameter '{parameter}'",
                remedy=f"choose among {', '.join(known)}",
            )
        default = known[parameter].default if parameter in known else 0.0
        values = table.setdefault(effect, {})
        values[parameter] = values.get(parameter, default) + float(by)
    return table


def _within_bounds(settings: Settings) -> Settings:
    """Return settings clipped to the parameters' bounds."""
    table = {}
    for effect, values in settings.items():
        known = library.find(effect).parameters
        table[effect] = {
            name: float(np.clip(value, known[name].low, known[name].high)) if name in known else value
            for name, value in values.items()
        }
    return table


def _interpolated(
    scenario: Scenario, base: Condition, neighbours: Sequence[Condition], steps: Array, settings: Settings
) -> Condition:
    """Return a drawn condition: A, B and trim linear in the steps, actuators from the settings."""

    def linear(of):
        start = of(base)
        return start + sum(s * (of(one) - start) for s, one in zip(steps, neighbours, strict=True))

    described = with_effects(scenario, {k: dict(v) for k, v in settings.items()})
    loop = base.loop
    rotors = np.array([scenario.aircraft().effector(n).kind == "rotor" for n in loop.effectors])
    drawn = LinearLoop(
        loop.states,
        loop.effectors,
        loop.axes,
        linear(lambda c: c.loop.A),
        linear(lambda c: c.loop.B),
        loop.gain,
        loop.allocation,
        _actuation(motion.parameters(described), linear(lambda c: c.loop.actuation.gain)[rotors]),
    )
    names = tuple(base.trim)
    positions = linear(lambda c: np.array([c.trim[n] for n in names]))
    return Condition(drawn, dict(zip(names, positions.tolist(), strict=True)), base.limits)

"""The consequence of effects for the simulation of a scenario, linearised at its trims."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.errors import UsageError
from freqid.core.scenario import Reference, Scenario
from freqid.gap.closed_loop import Actuation, LinearLoop
from freqid.gap.condition import Condition
from freqid.gap.consequence import DRAWS, Consequence, compare
from freqid.simulate import effects as library
from freqid.simulate import motion
from freqid.simulate.actuators import by_kind
from freqid.simulate.control import AXES, Setting
from freqid.simulate.effects import actuator_delay
from freqid.simulate.linearize import STATES, linearize
from freqid.simulate.lq import design_law
from freqid.simulate.maneuver import with_effects
from freqid.simulate.trim import Trim, trim

Array = NDArray[np.float64]
Settings = Mapping[str, Mapping[str, float]]
Name = tuple[str, str]

INTEGRALS = ("integral of u", "integral of v", "altitude", "integral of psi")
ALL_STATES = (*STATES, *INTEGRALS)

_STEP = 0.5  # sigma, over which the vehicle is taken to be linear in a parameter


def consequence(
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
    """Return what effects cost at one condition of a scenario, under the law that was made without them.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    before, after : mapping of mapping of float
        Effects by id, on top of the scenario's: as simulated, and as found in flight.
    names : sequence of (effect, parameter), length k
        Parameters of `after` that are estimates.
    covariance : array_like, shape (k, k), optional
        Theirs; without it there are no intervals.
    draws, level, seed : int, float, int
        Of the intervals: vehicles drawn; confidence; where the draws start.

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
    Vehicles that are drawn are straight-line combinations of the one found and of one half a sigma away in
    each parameter; delays and lags of actuators, and margins, are those of each draw.
    """
    law = _law(scenario, reference, before)
    start = condition(scenario, reference, before, law)
    found = condition(scenario, reference, after, law)
    several = []
    if covariance is not None and names:
        spread = np.asarray(covariance, dtype=float)
        if spread.shape != (len(names), len(names)):
            raise UsageError(
                f"the covariance of {len(names)} parameters has shape {spread.shape}",
                remedy="give one row and one column for each name",
            )
        sigma = np.sqrt(np.diag(spread))
        there = [
            condition(scenario, reference, _moved(after, [n], [_STEP * s]), law)
            for n, s in zip(names, sigma, strict=True)
        ]
        rng = np.random.default_rng(seed)
        for shift in rng.multivariate_normal(np.zeros(len(names)), spread, draws):
            size = np.divide(shift, _STEP * sigma, out=np.zeros_like(shift), where=sigma > 0)
            moved = _inside(_moved(after, names, shift))
            several.append((start, _between(scenario, found, there, size, moved)))
    return compare(start, found, several, level=level)


def condition(scenario: Scenario, reference: Reference, settings: Settings, law: Setting) -> Condition:
    """Return the vehicle with effects, trimmed, with its actuators, under a law made for another.

    Parameters
    ----------
    scenario : Scenario
    reference : Reference
    settings : mapping of mapping of float
        Effects, on top of the scenario's.
    law : Setting
        Of one condition, as in `freqid.simulate.control`.
    """
    described = with_effects(scenario, {k: dict(v) for k, v in settings.items()})
    parameters = jax.tree.map(jnp.asarray, motion.parameters(described))
    at = trim(described, parameters, reference)
    linear = linearize(described, parameters, at)
    velocity, theta = np.asarray(at.body.velocity), float(at.angles[1])
    order = _order(scenario)
    count = len(order)
    A, B = np.zeros((13, 13)), np.zeros((13, count))
    A[:9, :9], B[:9] = linear.A, linear.B[:, order]
    A[9, 0] = A[10, 1] = A[12, 8] = 1.0
    climb = velocity[0] * np.cos(theta) + velocity[2] * np.sin(theta)
    A[11, [0, 2, 7]] = np.sin(theta), -np.cos(theta), climb
    effectors = tuple(linear.effectors[i] for i in order)
    loop = LinearLoop(
        states=ALL_STATES,
        effectors=effectors,
        axes=AXES,
        A=A,
        B=B,
        gain=np.asarray(law.gain),
        allocation=np.concatenate([np.asarray(law.surface), np.asarray(law.speed)]),
        actuation=_actuation(parameters, _speed_ratio(at)),
    )
    positions = np.concatenate([np.asarray(at.positions.surface), np.asarray(at.positions.speed)])
    return Condition(
        loop,
        trim=dict(zip(effectors, positions.tolist(), strict=True)),
        limits={e.name: e.limits for e in scenario.effector if e.name in effectors},
    )


def _law(scenario: Scenario, reference: Reference, settings: Settings) -> Setting:
    """Return the law of one condition, made for the vehicle with these effects."""
    described = with_effects(scenario, {k: dict(v) for k, v in settings.items()})
    parameters = jax.tree.map(jnp.asarray, motion.parameters(described))
    law = design_law(described, parameters, [trim(described, parameters, reference)])
    return jax.tree.map(lambda table: np.asarray(table)[0], law.settings)


def _order(scenario: Scenario) -> NDArray[np.int64]:
    """Return the places of surfaces, then rotors, which the law commands, among all effectors."""
    vehicle = scenario.aircraft()
    kinds = by_kind(vehicle, np.arange(len(vehicle.effectors)))
    return np.concatenate([np.asarray(kinds.surface), np.asarray(kinds.speed)]).astype(np.int64)


def _speed_ratio(at: Trim) -> Array:
    """Return rotor speeds over their commands, which a sagging battery lowers."""
    speed, command = np.asarray(at.positions.speed), np.asarray(at.commands.speed)
    return np.divide(speed, command, out=np.ones_like(speed), where=command > 0)


def _actuation(parameters: motion.Parameters, ratio: Array) -> Actuation:
    """Return the small motions of surfaces and rotors: no limit is reached, no play is felt."""
    act, effects = parameters.actuators, parameters.airframe.effects
    late = actuator_delay.delays(effects["actuator_delay"], act.delay)
    servo, motor = effects["actuator_lag"], effects.get("motor_lag", {})
    surfaces, rotors = act.surface.low.size, act.motor.low.size

    def both(surface: ArrayLike, rotor: ArrayLike) -> Array:
        return np.concatenate([np.broadcast_to(surface, surfaces), np.broadcast_to(rotor, rotors)]).astype(
            float
        )

    # a rotor follows with the mean of its two rates in a small oscillation
    lag = 2 / (1 / np.asarray(act.motor.rise) + 1 / np.asarray(act.motor.fall))
    return Actuation(
        gain=both(1.0, ratio),
        delay=np.maximum(both(np.asarray(late.surface), np.asarray(late.speed)), 0.0),
        frequency=both(np.asarray(act.surface.frequency), np.inf),
        damping=both(np.asarray(act.surface.damping), 1.0),
        share=both(np.asarray(servo["strength"]), 1.0),
        lag=both(np.asarray(servo.get("extra", 0.0)), lag),
        lag_2=both(0.0, np.asarray(motor.get("extra", 0.0))),
    )


def _moved(settings: Settings, names: Sequence[Name], shift: Sequence[float] | Array) -> Settings:
    """Return settings with parameters shifted."""
    found = {effect: dict(values) for effect, values in settings.items()}
    for (effect, parameter), by in zip(names, shift, strict=True):
        known = library.find(effect).parameters
        if parameter not in known and parameter not in found.get(effect, {}):
            raise UsageError(
                f"effect '{effect}' has no parameter '{parameter}'",
                remedy=f"choose among {', '.join(known)}",
            )
        default = known[parameter].default if parameter in known else 0.0
        values = found.setdefault(effect, {})
        values[parameter] = values.get(parameter, default) + float(by)
    return found


def _inside(settings: Settings) -> Settings:
    """Return settings held to what the parameters may be."""
    found = {}
    for effect, values in settings.items():
        known = library.find(effect).parameters
        found[effect] = {
            name: float(np.clip(value, known[name].low, known[name].high)) if name in known else value
            for name, value in values.items()
        }
    return found


def _between(
    scenario: Scenario, found: Condition, there: Sequence[Condition], size: Array, settings: Settings
) -> Condition:
    """Return a drawn condition: its vehicle straight between others, its actuators its own."""

    def mixed(of, base):
        return base + sum(s * (of(one) - base) for s, one in zip(size, there, strict=True))

    described = with_effects(scenario, {k: dict(v) for k, v in settings.items()})
    loop = found.loop
    rotors = np.array([scenario.aircraft().effector(n).kind == "rotor" for n in loop.effectors])
    ratio = mixed(lambda c: c.loop.actuation.gain, loop.actuation.gain)[rotors]
    drawn = LinearLoop(
        loop.states,
        loop.effectors,
        loop.axes,
        mixed(lambda c: c.loop.A, loop.A),
        mixed(lambda c: c.loop.B, loop.B),
        loop.gain,
        loop.allocation,
        _actuation(motion.parameters(described), ratio),
    )
    names = tuple(found.trim)
    base = np.array([found.trim[n] for n in names])
    trims = mixed(lambda c: np.array([c.trim[n] for n in names]), base)
    return Condition(drawn, dict(zip(names, trims.tolist(), strict=True)), found.limits)

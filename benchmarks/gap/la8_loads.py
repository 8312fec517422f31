"""Truths that are loads in the LA-8's flight by other formulas than the candidates', and by none of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from truth import Settings

from freqid.simulate import attitude, frames
from freqid.simulate.effects import register
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.quantities import Wrench

_MASS = 28.6  # kg, of the LA-8 class vehicle


def _hubs(situation: Any) -> tuple[jax.Array, jax.Array]:
    """Return hubs and shafts of the rotors, vehicle axes, shape (rotor, 3)."""
    parameters, flow, positions = situation[:3]
    rotors = parameters.propellers
    turn = rotors.frame @ frames.motion(parameters.frames, flow, positions).turn.reshape(-1, 9)
    turn = turn.reshape(-1, 3, 3)
    hub = rotors.frame @ parameters.frames.pivot + (turn * rotors.hub[:, None, :]).sum(-1)
    return hub, (turn * rotors.axis[:, None, :]).sum(-1)


def _at(force: jax.Array, place: jax.Array) -> Wrench:
    return Wrench(force, attitude.cross(place, force))


def _worn(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    """Return the loads of thrust that a worn propeller lacks, at an unchanged torque."""
    hub, axis = _hubs(situation)
    share = jnp.stack([settings[f"n{i + 1}"] for i in range(8)]) + settings["loss"]
    push = -(share * situation.aero.thrust)[:, None] * axis
    return Wrench(push.sum(0), jnp.cross(hub, push).sum(0))


def _blown(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    """Blown strips behind the discs: lift of the momentum theory's far slipstream, on what is simulated.

    Within a disc's diameter the section meets ``V + 2 v`` along the chord, v from the disc's momentum
    balance, so that its lift grows with the product of that speed and the velocity across the chord.
    """
    parameters, flow, positions, aero = situation[:4]
    hub, axis = _hubs(situation)
    rotors = parameters.propellers
    moving = flow.velocity + jnp.cross(jnp.broadcast_to(flow.rates, hub.shape), hub)
    along = (moving * axis).sum(-1)
    down = jnp.stack([-axis[:, 2], jnp.zeros(axis.shape[0]), axis[:, 0]], axis=-1)
    across = (moving * down).sum(-1)
    area = jnp.pi / 4 * rotors.diameter**2
    gain2 = 2 * jnp.maximum(aero.thrust, 0.0) / (flow.rho * area)
    fast = jnp.sqrt(jnp.maximum(along, 0.0) ** 2 + gain2 + 0.01)
    still = jnp.sqrt(along**2 + 0.01)
    lift = (
        0.5
        * settings["strength"]
        * flow.rho
        * 4.2
        * parameters.geometry.chord
        * rotors.diameter
        * (fast - still)
        * across
    )
    push = -lift[:, None] * down
    place = hub - 0.2 * axis
    return Wrench(push.sum(0), jnp.cross(place, push).sum(0))


def _kirchhoff(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    """Return what trailing-edge separation takes of both wings' normal force, by ``((1 + sqrt f) / 2)^2``."""
    geometry, flow = situation.parameters.geometry, situation.flow
    pivot = situation.parameters.frames.pivot[:-1]
    cos, sin = jnp.cos(situation.positions.tilt), jnp.sin(situation.positions.tilt)
    x, _, z = (flow.velocity + attitude.cross(flow.rates, pivot)).T
    u, w = x * cos - z * sin, x * sin + z * cos
    speed2 = u**2 + w**2 + 0.01
    alpha = jnp.arctan2(w, jnp.maximum(u, 0.1))
    attached = 0.5 * (1 - jnp.tanh((alpha - 0.30) / 0.08))
    kept = ((1 + jnp.sqrt(attached + 1e-6)) / 2) ** 2
    lost = (
        settings["strength"]
        * (1 - kept)
        * 4.5
        * alpha
        * 0.5
        * flow.rho
        * speed2
        * geometry.area
        / pivot.shape[0]
    )
    force = jnp.stack([lost * sin, jnp.zeros_like(lost), lost * cos], axis=-1)
    return Wrench(force.sum(0), attitude.cross(pivot, force).sum(0))


def _steady_normal(situation: Any) -> jax.Array:
    flow = situation.flow
    speed = jnp.sqrt((flow.velocity**2).sum() + 0.01)
    return -0.5 * 4.2 * flow.rho * situation.parameters.geometry.area * speed * flow.velocity[2]


_JONES = {"slow": "N", "fast": "N"}  # states


def _jones_start(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    del settings
    now = _steady_normal(situation)
    return {"slow": now, "fast": now}


def _jones_rate(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    """Two lags in the semichords travelled, as R. T. Jones approximates Wagner's function."""
    del settings
    now = _steady_normal(situation)
    chords = 2 * jnp.sqrt((situation.flow.velocity**2).sum() + 1.0) / situation.parameters.geometry.chord
    return {
        "slow": 0.0455 * chords * (now - situation.memory["slow"]),
        "fast": 0.3 * chords * (now - situation.memory["fast"]),
    }


def _jones(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    now = _steady_normal(situation)
    missing = 0.165 * (situation.memory["slow"] - now) + 0.335 * (situation.memory["fast"] - now)
    down = settings["share"] * missing
    return _at(jnp.stack([0 * down, 0 * down, down]), situation.parameters.geometry.centre)


_LATE = {"one": "m/s", "two": "m/s"}  # states


def _late_start(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    del settings
    return {"one": situation.flow.velocity[2], "two": situation.flow.velocity[2]}


def _late_rate(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    """Downwash under way for the distance over the speed, by two lags of half of that."""
    del settings
    per_lag = 2 * jnp.sqrt((situation.flow.velocity**2).sum() + 4.0) / 1.2
    memory = situation.memory
    return {
        "one": per_lag * (situation.flow.velocity[2] - memory["one"]),
        "two": per_lag * (memory["one"] - memory["two"]),
    }


def _late(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    geometry, flow = situation.parameters.geometry, situation.flow
    ahead = flow.velocity[2] - situation.memory["two"]
    speed = jnp.sqrt((flow.velocity**2).sum() + 0.01)
    down = -0.5 * settings["strength"] * flow.rho * geometry.area * speed * ahead
    place = geometry.centre - jnp.stack([1.19 + 0.0 * down, 0.0 * down, -0.07 + 0.0 * down])
    return _at(jnp.stack([0 * down, 0 * down, down]), place)


_SLOSH = {"y": "m", "rate": "m/s"}  # states


def _slosh_start(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    del settings
    zero = 0.0 * situation.flow.rho
    return {"y": zero, "rate": zero}


def _slosh_rate(settings: dict[str, jax.Array], situation: Any) -> dict[str, jax.Array]:
    del settings
    y, rate, w = situation.memory["y"], situation.memory["rate"], 2 * jnp.pi * 0.7
    push = situation.aero.wrench.force[1] / _MASS
    return {"y": rate, "rate": -push - w**2 * y - 2 * 0.08 * w * rate}


def _slosh(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    """Liquid that hangs like a pendulum below the centre of gravity and leans to one side."""
    y, rate, w = situation.memory["y"], situation.memory["rate"], 2 * jnp.pi * 0.7
    side = settings["mass"] * (w**2 * y + 2 * 0.08 * w * rate)
    force = jnp.stack([0 * side, side, 0 * side])
    place = situation.parameters.geometry.centre + jnp.array([0.25, 0.0, 0.1])
    return _at(force, place)


def _fin(settings: dict[str, jax.Array], situation: Any) -> Wrench:
    """Return the loads of a fin far behind that no one described."""
    flow = situation.flow
    speed = jnp.sqrt((flow.velocity**2).sum() + 0.01)
    across = flow.velocity[1] - 1.1 * flow.rates[2]
    side = -0.5 * flow.rho * speed * 3.0 * settings["area"] * across
    return _at(jnp.stack([0 * side, side, 0 * side]), jnp.array([-1.1, 0.0, -0.3]))


def _effect(identifier: str, add: Callable, size: str, unit: str, *more: str, **hooks: Any) -> Effect:
    names = (size, *more)
    return Effect(
        id=identifier,
        stage="airframe",
        meaning="of these cases",
        parameters={n: Parameter(0.0, unit, "of these cases", 1.0) for n in names},
        add=add,
        **hooks,
    )


FLOWN = (
    _effect("case_worn", _worn, "loss", "1", *(f"n{i + 1}" for i in range(8))),
    _effect("case_blown", _blown, "strength", "1"),
    _effect("case_kirchhoff", _kirchhoff, "strength", "1"),
    _effect("case_jones", _jones, "share", "1", states=_JONES, start=_jones_start, rate=_jones_rate),
    _effect("case_late", _late, "strength", "1", states=_LATE, start=_late_start, rate=_late_rate),
    _effect("case_slosh", _slosh, "mass", "kg", states=_SLOSH, start=_slosh_start, rate=_slosh_rate),
    _effect("case_fin", _fin, "area", "m2"),
)
for _one in FLOWN:
    register(_one)


def flown_as(effect: str, *names: str) -> Callable[[float, str], Settings]:
    def settings(size: float, place: str) -> Settings:
        name = place.lstrip("-") or names[0]
        return {effect: {name: -size if place.startswith("-") else size}}

    return settings

"""Truths that the cases fly: effects of the library, the same physics by other formulas, and none of them.

A truth is flown by settings of effects, by another description of the aircraft, or made of the log.
Nothing here is seen by the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import msgspec
import numpy as np

from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.simulate import attitude, frames
from freqid.simulate.effects import register
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.quantities import Wrench

Settings = dict[str, dict[str, float]]
_MASS = 28.6  # kg, of the LA-8 class vehicle
_G = 9.80665


def _no_settings(size: float, place: str) -> Settings:
    del size, place
    return {}


def _same(thing: Any, size: float, place: str) -> Any:
    del size, place
    return thing


@dataclass(frozen=True)
class Truth:
    """One effect by one formula, at a size.

    Attributes
    ----------
    id : str
        Of the library, or ``outside_...``.
    form : str
    one : float
        A plausible size, to start from.
    most : float
        Beyond which it is no such effect any more, or does not fly.
    places : tuple of str
        Where it can be: one is drawn for a case.
    settings : callable
        ``settings(size, place)`` of effects, added to what the scenario has.
    scenario : callable
        ``scenario(scenario, size, place)``: the aircraft described otherwise.
    record : callable
        ``record(record, size, place)``: the log.
    """

    id: str
    form: str
    one: float
    most: float
    places: tuple[str, ...] = ("",)
    settings: Callable[[float, str], Settings] = _no_settings
    scenario: Callable[[Scenario, float, str], Scenario] = _same
    record: Callable[[FlightRecord, float, str], FlightRecord] = _same


# --- the library's own formulas ---------------------------------------------------------------------------


def _own(identifier: str, one: float, most: float, *places: str, parameter: str = "") -> Truth:
    """Return an effect by its own formula; a place is a parameter, with a minus for one that is lowered."""

    def settings(size: float, place: str) -> Settings:
        sign = -1.0 if place.startswith("-") else 1.0
        return {identifier: {place.lstrip("-") or parameter: sign * size}}

    return Truth(identifier, "own", one, most, places or ("",), settings)


def _strength(identifier: str, one: float, most: float = 1.0) -> Truth:
    return _own(identifier, one, most, "strength", "-strength")


OWN = (
    _own("actuator_delay", 0.01, 0.078, "extra"),
    _own("actuator_lag", 0.01, 0.5, "extra"),
    _own("motor_lag", 0.02, 0.5, "extra"),
    _own("rate_limit", 3.0, 30.0, "slowness"),
    _own("backlash", 0.02, 0.2, "width"),
    _own("surface_effectiveness", 0.1, 0.95, "loss", "de1", "df4", "de3", "dr2"),
    _own("weak_rotor", 0.05, 0.6, "loss", "n1", "n3", "n6", "n8"),
    _strength("slipstream", 0.2),
    _strength("rotor_inplane_force", 0.5, 3.0),
    _own("battery_sag", 0.5, 5.0, "strength"),
    _strength("gyroscopic", 0.5, 8.0),
    _strength("wing_wake", 0.2),
    _own("downwash_lag", 0.2, 5.0, "strength"),
    _own("stall", 0.3, 3.0, "strength"),
    _own("unsteady_lift", 0.03, 0.6, "time_constant"),
    _own("extra_drag", 0.02, 1.0, "coefficient"),
    _own("mass", 0.05, 0.5, "fraction", "-fraction"),
    _own("cg_offset", 0.02, 0.15, "x", "-x", "y", "z"),
    _own("inertia", 0.1, 0.9, "xx", "yy", "-yy", "zz"),
    _own("tilt_inertia", 0.2, 0.9, "fraction", "-fraction"),
    _own("flexible_mode", 0.05, 2.0, "strength"),
    _own("sensor_bias", 0.05, 5.0, "p", "q", "theta", "w", "u", "surface"),
    _own("sensor_scale", 0.03, 0.9, "az", "q", "p", "u", "surface", "theta"),
    _own("time_skew", 0.01, 0.2, "velocity", "rates", "accelerometers", "attitude", "effectors"),
    _own("lever_arm", 0.05, 1.0, "x", "-y", "z"),
    _own("flow_upwash", 0.05, 0.9, "alpha", "-alpha", "beta"),
    _own("misalignment", 0.02, 0.5, "imu_x", "imu_y", "imu_z", "velocity_y", "velocity_z"),
    _own("steady_wind", 1.0, 12.0, "north", "-north", "east", "down"),
)

# --- the same by another description of the aircraft -----------------------------------------------------


def _section(scenario: Scenario, name: str, change: Callable[[dict[str, Any]], dict[str, Any]]) -> Scenario:
    """Return a scenario with ``[simulation.<name>]`` changed."""
    simulation = scenario.simulation
    found = change(msgspec.json.decode(msgspec.json.encode(getattr(simulation, name))))
    return msgspec.structs.replace(scenario, simulation=msgspec.structs.replace(simulation, **{name: found}))


def _times(table: dict[str, Any], path: str, factor: float | tuple[float, ...]) -> dict[str, Any]:
    """Multiply one number of a table, or those of a list."""
    *way, last = path.split(".")
    at = table
    for name in way:
        at = at[name]
    old = at[last]
    at[last] = np.multiply(old, factor).tolist() if isinstance(old, list) else float(old * np.mean(factor))
    return table


def _damped_servos(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with servos damped more: as late as by a first-order lag of `size`, s."""
    del place

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for kind in ("surface", "tilt"):
            table[kind]["damping"] += np.pi * table[kind]["frequency_hz"] * size
        return table

    return _section(scenario, "actuators", change)


def _slow_motors(scenario: Scenario, size: float, place: str) -> Scenario:
    """Motors with longer time constants, more so in braking, in place of a lag before them."""
    del place

    def change(table: dict[str, Any]) -> dict[str, Any]:
        table["motor"]["rise_s"] += 0.7 * size
        table["motor"]["fall_s"] += 1.3 * size
        return table

    return _section(scenario, "actuators", change)


def _limits_apart(scenario: Scenario, size: float, place: str) -> Scenario:
    """Another rate limit for each surface, about ``1 / size``."""
    del place
    factors = iter(np.linspace(0.7, 1.3, 10))
    effectors = tuple(
        msgspec.structs.replace(e, rate_limit=min(e.rate_limit or np.inf, 1 / (size * next(factors))))
        if e.kind == "surface"
        else e
        for e in scenario.effector
    )
    return msgspec.structs.replace(scenario, effector=effectors)


def _cut_surface(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with a surface that has lost its inner end, not a share of its deflection."""

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for surface in table["surface"]:
            if surface["name"] == place:
                inner, outer = sorted(surface["span_m"], key=abs)
                inner = inner + size * (outer - inner)
                surface["span_m"] = sorted([inner, outer])
        return table

    return _section(scenario, "airframe", change)


def _factors(section: str, factors: Callable[[float], Mapping[str, Any]]) -> Callable[..., Scenario]:
    """Return a change of numbers of a section, each by its own factor of the size; a place may say minus."""

    def scenario(scenario: Scenario, size: float, place: str) -> Scenario:
        def change(table: dict[str, Any]) -> dict[str, Any]:
            for path, factor in factors(-size if place == "-" else size).items():
                _times(table, path, factor)
            return table

        return _section(scenario, section, change)

    return scenario


def _uneven_spin(scenario: Scenario, size: float, place: str) -> Scenario:
    """Front rotors heavier by more than rear ones."""
    size = -size if place == "-" else size
    rotors = tuple(
        msgspec.structs.replace(r, inertia=r.inertia * (1 + (1.4 if r.wing == "front" else 0.6) * size))
        for r in scenario.rotor
    )
    return msgspec.structs.replace(scenario, rotor=rotors)


def _uneven_wings(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with a front wing heavier by more than the rear one; the whole as it was weighed."""
    size = -size if place == "-" else size
    wings = []
    for wing in scenario.wing:
        more = 1 + (1.3 if wing.name == "front" else 0.7) * size
        own = wing.inertia
        scaled = {name: more * getattr(own, name) for name in own.__struct_fields__}
        wings.append(msgspec.structs.replace(wing, mass_kg=more * wing.mass_kg, inertia=type(own)(**scaled)))
    return msgspec.structs.replace(scenario, wing=tuple(wings))


def _moved_accelerometer(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with an accelerometer elsewhere; `_as_stated` puts it back in the log."""

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for suite in table.values():
            stated = suite["accelerometer"].get("position_m", (0.0, 0.0, 0.0))
            suite["accelerometer"]["position_m"] = np.add(stated, _along(size, place)).tolist()
        return table

    return _section(scenario, "sensors", change)


def _along(size: float, place: str) -> np.ndarray:
    return size * np.eye(3)["xyz".index(place)]


def _as_stated(record: FlightRecord, size: float, place: str) -> FlightRecord:
    channels = [record.channel(f"state/a{axis}") for axis in "xyz"]
    return record.with_channels(
        *(
            replace(c, position_m=tuple(np.subtract(c.position_m or (0, 0, 0), _along(size, place))))
            for c in channels
        )
    )


# --- the same made of the log ----------------------------------------------------------------------------


def _filtered(values: np.ndarray, dt: float, response: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return a signal through a linear filter, its trend kept, mirrored at its ends."""
    trend = np.linspace(values[0], values[-1], values.size)
    inside = values - trend
    whole = np.concatenate([inside, -inside[::-1]])
    s = 2j * np.pi * np.fft.rfftfreq(whole.size, dt)
    return np.fft.irfft(np.fft.rfft(whole) * response(s), whole.size)[: values.size] + trend


def _pade(delay: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda s: (1 - s * delay / 2) / (1 + s * delay / 2)


_SKEWED = {
    "velocity": ("state/u", "state/v", "state/w", "air/V", "air/alpha", "air/beta"),
    "rates": ("state/p", "state/q", "state/r"),
    "accelerometers": ("state/ax", "state/ay", "state/az"),
    "attitude": ("state/phi", "state/theta", "state/psi"),
}


def _skewed(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Sensors behind a first-order Pade form, their digits coarse."""
    names = _SKEWED.get(place) or tuple(f"effector/{n}" for n in record.group("effector"))
    late = []
    for name in (n for n in names if n in record):
        values = _filtered(np.unwrap(record[name]) if "psi" in name else record[name], record.dt, _pade(size))
        late.append(replace(record.channel(name), values=values))
    return record.with_channels(*late)


def _bending(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log with a mode of 4 Hz, well damped, that the gyro feels with another share."""
    del place
    w, damping = 2 * np.pi * 4.0, 0.05

    def response(s: np.ndarray) -> np.ndarray:
        return s**2 / (s**2 + 2 * damping * w * s + w**2)

    force = record["state/az"] - record["state/az"].mean()
    bent = _filtered(force, record.dt, response)
    turned = _filtered(
        force, record.dt, lambda s: s * response(np.where(s == 0, 1.0, s)) / np.where(s == 0, 1, s) ** 2
    )
    az, q = record.channel("state/az"), record.channel("state/q")
    return record.with_channels(
        replace(az, values=az.values - size * bent), replace(q, values=q.values + 0.8 * size * turned)
    )


def _compressed(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a sensor that reads too much about its mean, less so far from it."""
    kinds = record.vehicle.effector_kinds if record.vehicle else {}
    names = (
        tuple(f"effector/{n}" for n in record.group("effector") if kinds.get(n) == place)
        if place == "surface"
        else (f"state/{place}",)
    )
    found = []
    for name in names:
        x = record[name]
        moved = x - x.mean()
        wide = 3 * moved.std()
        found.append(
            replace(record.channel(name), values=x + size * (x.mean() + wide * np.tanh(moved / wide)))
        )
    return record.with_channels(*found)


# --- the same by another formula in flight ---------------------------------------------------------------


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


# --- none of the library ---------------------------------------------------------------------------------


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


def _flown(effect: str, *names: str) -> Callable[[float, str], Settings]:
    def settings(size: float, place: str) -> Settings:
        name = place.lstrip("-") or names[0]
        return {effect: {name: -size if place.startswith("-") else size}}

    return settings


OTHER = (
    Truth("actuator_delay", "by kind", 1.0, 12.0, settings=_flown("actuator_delay", "strength")),
    Truth("actuator_lag", "damped", 0.01, 0.5, scenario=_damped_servos),
    Truth("motor_lag", "uneven", 0.02, 0.5, scenario=_slow_motors),
    Truth("rate_limit", "apart", 3.0, 30.0, scenario=_limits_apart),
    Truth("surface_effectiveness", "cut", 0.15, 0.95, ("de2", "df1", "df3", "de4"), scenario=_cut_surface),
    Truth("weak_rotor", "worn", 0.05, 0.6, ("n2", "n4", "n5", "n7"), settings=_flown("case_worn", "loss")),
    Truth("slipstream", "blown", 0.2, 2.0, ("", "-strength"), settings=_flown("case_blown", "strength")),
    Truth(
        "rotor_inplane_force",
        "uneven",
        0.5,
        6.0,
        scenario=_factors(
            "airframe", lambda k: {"propeller.inplane_force": 1 + k, "propeller.hub_moment": 1 + 0.6 * k}
        ),
    ),
    Truth(
        "battery_sag",
        "resistance",
        0.5,
        8.0,
        scenario=_factors("actuators", lambda k: {"battery.resistance_ohm": 1 + k}),
    ),
    Truth("gyroscopic", "uneven", 0.5, 8.0, scenario=_uneven_spin),
    Truth(
        "wing_wake",
        "uneven",
        0.2,
        0.95,
        ("", "-"),
        scenario=_factors(
            "airframe",
            lambda k: {"wake.downwash": 1 + 1.2 * k if k > 0 else 1 + k, "wake.blowing": 1 + 0.6 * k},
        ),
    ),
    Truth("downwash_lag", "two lags", 0.2, 5.0, settings=_flown("case_late", "strength")),
    Truth("stall", "kirchhoff", 0.3, 3.0, settings=_flown("case_kirchhoff", "strength")),
    Truth("unsteady_lift", "jones", 1.0, 12.0, settings=_flown("case_jones", "share")),
    Truth(
        "extra_drag",
        "fuselage",
        0.4,
        20.0,
        scenario=_factors(
            "airframe", lambda k: {"fuselage.drag_area_m2": (1 + k, 1 + 0.15 * k, 1 + 0.13 * k)}
        ),
    ),
    Truth("tilt_inertia", "uneven", 0.2, 0.7, ("", "-"), scenario=_uneven_wings),
    Truth("flexible_mode", "softer", 0.05, 2.0, record=_bending),
    Truth("time_skew", "pade", 0.01, 0.2, (*_SKEWED, "effectors"), record=_skewed),
    Truth("sensor_scale", "compressed", 0.05, 0.9, ("az", "q", "p", "surface"), record=_compressed),
    Truth("lever_arm", "moved", 0.05, 1.0, ("x", "y", "z"), scenario=_moved_accelerometer, record=_as_stated),
)


def _icing(scenario: Scenario, size: float, place: str) -> Scenario:
    """Both wings: less lift for the angle and much more drag, together."""
    del place
    factors = {"aerofoil.lift_slope": 1 - 0.4 * size, "aerofoil.drag": 1 + 4 * size}

    def change(table: dict[str, Any]) -> dict[str, Any]:
        for path, factor in factors.items():
            _times(table, path, factor)
        return table

    return _section(scenario, "airframe", change)


def _stop(scenario: Scenario, size: float, place: str) -> Scenario:
    """Return an aircraft with a surface that moves no further than one over the size, rad."""
    effectors = tuple(
        msgspec.structs.replace(e, limits=(-1 / size, 1 / size)) if e.name == place else e
        for e in scenario.effector
    )
    return msgspec.structs.replace(scenario, effector=effectors)


def _shaken_gyro(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Return the log of a gyro that answers to acceleration."""
    q = record.channel("state/q")
    ax = record["state/ax"] - record["state/ax"].mean()
    az = record["state/az"] - record["state/az"].mean()
    del place
    return record.with_channels(replace(q, values=q.values + size * (az + 0.5 * ax)))


def _hysteresis(record: FlightRecord, size: float, place: str) -> FlightRecord:
    """Potentiometers that stick: what they read lags behind by up to the size, rad, in each direction."""
    del place
    kinds = record.vehicle.effector_kinds if record.vehicle else {}
    found = []
    for name in (n for n in record.group("effector") if kinds.get(n) == "surface"):
        channel = record.channel(f"effector/{name}")
        state, values = 0.0, channel.values.copy()
        steps = np.diff(channel.values, prepend=channel.values[0])
        for i, step in enumerate(steps.tolist()):
            state += step - abs(step) * state / max(size, 1e-9)
            values[i] -= state
        found.append(replace(channel, values=values))
    return record.with_channels(*found)


OUTSIDE = (
    Truth("outside_icing", "other", 0.2, 1.5, scenario=_icing),
    Truth("outside_slosh", "other", 1.0, 20.0, settings=_flown("case_slosh", "mass")),
    Truth("outside_fin", "other", 0.05, 1.0, settings=_flown("case_fin", "area")),
    Truth("outside_stop", "other", 25.0, 90.0, ("de1", "df2", "de4"), scenario=_stop),
    Truth("outside_shaken_gyro", "other", 0.002, 0.1, record=_shaken_gyro),
    Truth("outside_hysteresis", "other", 0.01, 0.2, record=_hysteresis),
)


def find(identifier: str, form: str) -> Truth:
    """Return one truth."""
    return next(t for t in (*OWN, *OTHER, *OUTSIDE) if (t.id, t.form) == (identifier, form))

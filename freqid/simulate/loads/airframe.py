"""The sum of all parts: aerodynamic and propulsive force and moment, without memory."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp

from freqid.simulate.effects import library, slipstream, surface_effectiveness, weak_rotor, wing_wake
from freqid.simulate.loads import fuselage, tail, wake, wing
from freqid.simulate.loads.frames import Frames, motion, total
from freqid.simulate.loads.fuselage import Fuselage
from freqid.simulate.loads.propeller import Propellers, rotor_loads
from freqid.simulate.loads.quantities import Aero, Flow, Positions, Wake, Wrench
from freqid.simulate.loads.slipstream import Slipstreams
from freqid.simulate.loads.tail import Tail
from freqid.simulate.loads.wake import Wakes
from freqid.simulate.loads.wing import Wings

Memories = dict[str, dict[str, jax.Array]]  # of effects, by their id and the names of their states


class Geometry(NamedTuple):
    """What effects know of the vehicle as a whole.

    Attributes
    ----------
    area, span, chord : Array, shape ()
        Reference area, m2, span and chord, m; zero where not stated.
    centre : Array, shape (3,)
        Centre of gravity as the vehicle was weighed, vehicle axes, m.
    surfaces, rotors : Array, shape (effector, effector)
        Order of the surfaces and of the rotors, as `effects.places.order` has it.
    """

    area: jax.Array
    span: jax.Array
    chord: jax.Array
    centre: jax.Array
    surfaces: jax.Array
    rotors: jax.Array


class Airframe(Protocol):
    """What gives the loads of a vehicle: strips here, or coefficients.

    Effects see the fields, the flight calls the methods.
    """

    @property
    def frames(self) -> Frames:
        """Axes of the wings and of the body."""
        ...

    @property
    def propellers(self) -> Propellers:
        """All rotors."""
        ...

    @property
    def geometry(self) -> Geometry:
        """The vehicle as a whole."""
        ...

    @property
    def effects(self) -> dict[str, dict[str, jax.Array]]:
        """Settings by effect id and parameter."""
        ...

    def loads(self, flow: Flow, positions: Positions, arriving: Wake | None) -> Aero:
        """Return the loads before any effect is added."""
        ...

    def convection_time(self, flow: Flow) -> jax.Array:
        """Return how long what is shed takes to arrive, s."""
        ...


class Parameters(NamedTuple):
    """All numbers of the airframe; `description.parameters` makes them from a scenario.

    Attributes
    ----------
    frames : Frames
    propellers : Propellers
    slipstreams : Slipstreams
    wings : Wings
    wakes : Wakes
    fuselage : Fuselage
    tail : Tail
    geometry : Geometry
    effects : dict of dict of Array, shape ()
        Parameters by effect id and name: leaves like any other, so every effect can be differentiated.
    """

    frames: Frames
    propellers: Propellers
    slipstreams: Slipstreams
    wings: Wings
    wakes: Wakes
    fuselage: Fuselage
    tail: Tail
    geometry: Geometry
    effects: dict[str, dict[str, jax.Array]]

    def loads(self, flow: Flow, positions: Positions, arriving: Wake | None) -> Aero:
        """Return the loads before any effect is added; the steady wake where none is given."""
        return _loads(self, flow, positions, arriving)

    def convection_time(self, flow: Flow) -> jax.Array:
        """Return how long what is shed takes to arrive, s."""
        return wake.convection_time(self.wakes, flow)


class Situation(NamedTuple):
    """What an effect that adds a wrench may look at.

    Attributes
    ----------
    parameters : Airframe
    flow : Flow
    positions : Positions
        As the airframe feels them.
    aero : Aero
        Before any effect was added.
    memory : dict of Array
        The effect's own states by name.
    """

    parameters: Airframe
    flow: Flow
    positions: Positions
    aero: Aero
    memory: dict[str, jax.Array] = {}  # noqa: RUF012  never written to


def wrench(
    parameters: Airframe,
    flow: Flow,
    positions: Positions,
    arriving: Wake | None = None,
    memories: Memories | None = None,
) -> Aero:
    """Return the loads on the airframe.

    Parameters
    ----------
    parameters : Airframe
    flow : Flow
    positions : Positions
    arriving : Wake, optional
        What reaches the rear wing now, having left the front wing earlier; the steady state where absent.
    memories : dict of dict of Array, optional
        Of effects; the steady state where absent.

    Returns
    -------
    Aero

    Notes
    -----
    The tail lies close behind the rear wing: what that sheds arrives at once, on top of the front wing's
    wake.
    """
    return remembering(parameters, flow, positions, arriving, memories)[0]


def remembering(
    parameters: Airframe,
    flow: Flow,
    positions: Positions,
    arriving: Wake | None = None,
    memories: Memories | None = None,
) -> tuple[Aero, Memories]:
    """Return the loads as `wrench` does, and the rates of change of the effects' memories."""
    return _with_added(_situation(parameters, flow, positions, arriving), memories)


def steady_memories(parameters: Airframe, flow: Flow, positions: Positions) -> Memories:
    """Return the memories of effects on a vehicle that has been doing for long what it does now."""
    situation = _situation(parameters, flow, positions, None)
    return {
        identifier: effect.start(parameters.effects[identifier], situation)
        for identifier, effect in library().items()
        if effect.start is not None
    }


def _situation(parameters: Airframe, flow: Flow, positions: Positions, arriving: Wake | None) -> Situation:
    """Return the loads on the airframe as it feels the effectors, before any effect is added."""
    effects, geometry = parameters.effects, parameters.geometry
    surface = surface_effectiveness.effective_deflections(
        effects["surface_effectiveness"], geometry.surfaces, positions.surface
    )
    speed = weak_rotor.sound_speeds(effects["weak_rotor"], geometry.rotors, positions.speed)
    felt = positions._replace(surface=surface, speed=speed)
    return Situation(parameters, flow, felt, parameters.loads(flow, felt, arriving))


def _loads(parameters: Parameters, flow: Flow, positions: Positions, arriving: Wake | None) -> Aero:
    """Return the loads before any effect is added."""
    if arriving is None:  # the front wing does not feel its own wake, so one extra evaluation settles it
        still = Wake(jnp.zeros(2), jnp.zeros(2))
        arriving = _loads(parameters, flow, positions, still).shed
    p, effects = parameters, parameters.effects
    felt = wing_wake.received(effects["wing_wake"], arriving)
    at = motion(p.frames, flow, positions)
    discs, loads = rotor_loads(p.propellers, at, positions.speed, flow.rho, effects["rotor_inplane_force"])

    blown, induced = slipstream.over_wing(effects["slipstream"], p.slipstreams, discs, flow.rho)
    # Seen from the rear wing's strips the wake's blowing is forward speed and its downwash a climb.
    back, down = p.wakes.received @ felt.blowing, p.wakes.received @ felt.downwash
    wake_u, _, wake_w = (jnp.stack([back, jnp.zeros_like(back), -down], axis=-1) @ at.turn[1]).T
    calm = jnp.zeros_like(wake_u)
    added = blown + jnp.stack([calm, wake_u]), jnp.stack([calm, wake_w])
    strips = wing.strips(p.wings, at.velocity[:-1], at.rates[:-1], added, positions.surface, flow.rho)

    shed = wake.shed(p.wakes, flow.velocity, at.turn[:-1, :, 0], strips.circulation, induced)
    rear = wing_wake.received(effects["wing_wake"], Wake(shed.downwash[1], shed.blowing[1]))
    at_tail = Wake(felt.downwash + rear.downwash, felt.blowing + rear.blowing)
    parts = [fuselage.loads(p.fuselage, flow), tail.loads(p.tail, flow, at_tail, positions.surface)]

    body = jnp.zeros((1, 3))
    force = loads[:, :3] + jnp.concatenate([strips.force, body])
    moment = loads[:, 3:] + jnp.concatenate([strips.moment, body])
    whole = total(p.frames, at, force, moment)
    for part in parts:
        whole = Wrench(whole.force + part.force, whole.moment + part.moment)
    return Aero(
        wrench=whole,
        torque=discs.torque,
        thrust=discs.thrust,
        shed=Wake(shed.downwash[0], shed.blowing[0]),
    )


def _with_added(situation: Situation, memories: Memories | None = None) -> tuple[Aero, Memories]:
    """Add the wrenches of the effects that come on top of the airframe; how their memories change."""
    force, moment = situation.aero.wrench
    rates: Memories = {}
    for identifier, effect in library().items():
        settings: Any = situation.parameters.effects.get(identifier)
        if effect.start is not None:
            memory = memories[identifier] if memories else effect.start(settings, situation)
            situation = situation._replace(memory=memory)
        if effect.rate is not None:
            rates[identifier] = effect.rate(settings, situation)
        if effect.stage == "airframe" and effect.add is not None:
            extra = effect.add(settings, situation)
            force, moment = force + extra.force, moment + extra.moment
    return situation.aero._replace(wrench=Wrench(force, moment)), rates

"""The sum of all parts: aerodynamic and propulsive force and moment, without memory."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from . import fuselage, tail, wake, wing
from .effects import library, rotor_inplane_force, slipstream, wing_wake
from .frames import Frames, motion, total
from .fuselage import Fuselage
from .propeller import Propellers, discs
from .quantities import Aero, Flow, Positions, Wake, Wrench
from .slipstream import Slipstreams
from .tail import Tail
from .wake import Wakes
from .wing import Wings


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
    effects: dict[str, dict[str, jax.Array]]


class Situation(NamedTuple):
    """What an effect that adds a wrench may look at.

    Attributes
    ----------
    parameters : Parameters
    flow : Flow
    positions : Positions
    aero : Aero
        Before any effect was added.
    """

    parameters: Parameters
    flow: Flow
    positions: Positions
    aero: Aero


def wrench(parameters: Parameters, flow: Flow, positions: Positions, arriving: Wake | None = None) -> Aero:
    """Return the loads on the airframe.

    Parameters
    ----------
    parameters : Parameters
    flow : Flow
    positions : Positions
    arriving : Wake, optional
        What reaches the rear wing now, having left the front wing earlier; the steady state where absent.

    Returns
    -------
    Aero

    Notes
    -----
    The tail lies close behind the rear wing: what that sheds arrives at once, on top of the front wing's
    wake.
    """
    if arriving is None:  # the front wing does not feel its own wake, so one extra evaluation settles it
        still = Wake(jnp.zeros(2), jnp.zeros(2))
        arriving = wrench(parameters, flow, positions, still).shed
    p, effects = parameters, parameters.effects
    felt = wing_wake.received(effects["wing_wake"], arriving)
    at = motion(p.frames, flow, positions)

    hubs = p.propellers.frame @ jnp.concatenate([at.velocity, at.rates], axis=1)
    hubs = hubs[:, :3] + jnp.cross(hubs[:, 3:], p.propellers.hub)
    rotors = discs(p.propellers, hubs, positions.speed, flow.rho)
    inplane_force, hub_moment = rotor_inplane_force.loads(effects["rotor_inplane_force"], rotors)
    push = rotors.thrust[:, None] * p.propellers.axis + inplane_force
    twist = hub_moment - (p.propellers.spin * rotors.torque)[:, None] * p.propellers.axis
    twist = twist + jnp.cross(p.propellers.hub, push)

    blown, induced = slipstream.over_wing(effects["slipstream"], p.slipstreams, rotors, flow.rho)
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

    loads = p.propellers.frame.T @ jnp.concatenate([push, twist], axis=1)
    body = jnp.zeros((1, 3))
    force = loads[:, :3] + jnp.concatenate([strips.force, body])
    moment = loads[:, 3:] + jnp.concatenate([strips.moment, body])
    whole = total(p.frames, at, force, moment)
    for part in parts:
        whole = Wrench(whole.force + part.force, whole.moment + part.moment)
    aero = Aero(
        wrench=whole,
        torque=rotors.torque,
        thrust=rotors.thrust,
        shed=Wake(shed.downwash[0], shed.blowing[0]),
    )
    return _with_added(Situation(parameters, flow, positions, aero))


def _with_added(situation: Situation) -> Aero:
    """Add the wrenches of the effects that come on top of the airframe."""
    force, moment = situation.aero.wrench
    for effect in library().values():
        if effect.stage == "airframe" and effect.add is not None:
            extra = effect.add(situation.parameters.effects[effect.id], situation)
            force, moment = force + extra.force, moment + extra.moment
    return situation.aero._replace(wrench=Wrench(force, moment))

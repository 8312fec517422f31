"""What all rotors do to the frames that carry them."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from freqid.dynamics.moment_reference_point import moment_about
from freqid.simulate.effects import rotor_inplane_force
from freqid.simulate.loads.frames import Motion
from freqid.simulate.loads.propeller import Discs, Propellers, discs


def loads(
    propellers: Propellers, at: Motion, speed: jax.Array, rho: jax.Array, inplane: dict[str, jax.Array]
) -> tuple[Discs, jax.Array]:
    """Return the loads of all rotors.

    Parameters
    ----------
    propellers : Propellers
    at : Motion
        Of the frames that carry them.
    speed : Array, shape (rotor,)
        rad/s.
    rho : Array, shape ()
        kg/m3.
    inplane : dict of Array
        Settings of the effect `rotor_inplane_force`.

    Returns
    -------
    discs : Discs
    loads : Array, shape (frame, 6)
        Force and moment about the frame's origin on each frame, in its axes, N and N m.
    """
    hubs = propellers.frame @ jnp.concatenate([at.velocity, at.rates], axis=1)
    hubs = hubs[:, :3] + jnp.cross(hubs[:, 3:], propellers.hub)
    found = discs(propellers, hubs, speed, rho)
    inplane_force, hub_moment = rotor_inplane_force.loads(inplane, found)
    push = found.thrust[:, None] * propellers.axis + inplane_force
    twist = hub_moment - (propellers.spin * found.torque)[:, None] * propellers.axis
    twist = moment_about(propellers.hub, push, twist, axis=-1)
    return found, propellers.frame.T @ jnp.concatenate([push, twist], axis=1)

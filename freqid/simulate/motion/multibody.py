"""Mass of a body with tilting wings and spinning rotors: its momentum and its inertia.

Total momentum is written once, as a function of the configuration (tilts, their rates, rotor
speeds) and of the body's velocity and rates; `rigid_body` differentiates it.

References
----------
P. C. Hughes, *Spacecraft Attitude Dynamics*, Dover, 2004, ch. 3: a body with wheels, moments about
a moving point.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.vehicle import Vehicle
from freqid.dynamics import precision
from freqid.dynamics.frames import shaft_axis
from freqid.dynamics.mass import wing_arm, without_wings
from freqid.simulate.motion.attitude import cross

_ALONG_Y = np.array([0.0, 1.0, 0.0])


class MassModel(NamedTuple):
    """Mass of every part, as the equations of motion use it; vehicle axes, SI.

    Attributes
    ----------
    mass : Array, shape ()
        Whole vehicle, kg.
    body_moment : Array, shape (3,)
        First moment of all that does not tilt, about the vehicle's origin, kg m.
    body_inertia : Array, shape (3, 3)
        Its inertia about the vehicle's origin, kg m2.
    wing_mass : Array, shape (wing,)
        Of the tilting parts, kg.
    wing_pivot : Array, shape (wing, 3)
        A point of each tilt axis, m.
    wing_arm : Array, shape (wing, 3)
        From the pivot to the tilting part's centre of gravity at zero tilt, m.
    wing_inertia : Array, shape (wing, 3, 3)
        About that centre of gravity, at zero tilt, rotors locked, kg m2.
    wing_spin : Array, shape (wing, 3, rotor)
        Angular momentum per rotor speed at zero tilt, kg m2; zero for rotors that are elsewhere.
    body_spin : Array, shape (3, rotor)
        The same for rotors that do not tilt.
    """

    mass: jax.Array
    body_moment: jax.Array
    body_inertia: jax.Array
    wing_mass: jax.Array
    wing_pivot: jax.Array
    wing_arm: jax.Array
    wing_inertia: jax.Array
    wing_spin: jax.Array
    body_spin: jax.Array


class Configuration(NamedTuple):
    """What moves inside the vehicle; also its rate of change.

    Attributes
    ----------
    tilt, tilt_rate : Array, shape (wing,)
        rad and rad/s, positive leading edge up.
    speed : Array, shape (rotor,)
        rad/s.
    """

    tilt: jax.Array
    tilt_rate: jax.Array
    speed: jax.Array


def mass_model(vehicle: Vehicle) -> MassModel:
    """Split a vehicle's mass into the parts that move separately.

    What does not tilt is what the whole has beyond its wings, at the tilt for which its mass
    properties are stated.

    Parameters
    ----------
    vehicle : Vehicle

    Returns
    -------
    MassModel

    Raises
    ------
    UsageError
        Where a wing has a mass but no place, or the wings leave no possible body.
    """
    wings, rotors = vehicle.wings, vehicle.rotors
    moment, inertia = without_wings(vehicle, wings, about=(0.0, 0.0, 0.0))

    def spin_on(name: str | None) -> np.ndarray:
        """Return the momentum per speed of the rotors that a wing, or the body, carries."""
        columns = [r.spin * r.inertia * shaft_axis(r.axis, 0.0) * (r.wing == name) for r in rotors]
        return np.reshape(columns, (len(rotors), 3)).T

    count = len(wings)
    parts = (
        vehicle.mass_properties.mass_kg,
        moment,
        inertia,
        [w.mass_kg for w in wings],
        np.reshape([w.pivot_m for w in wings], (count, 3)),
        np.reshape([wing_arm(w) for w in wings], (count, 3)),
        np.reshape([w.inertia.matrix for w in wings], (count, 3, 3)),
        np.reshape([spin_on(w.name) for w in wings], (count, 3, len(rotors))),
        spin_on(None),
    )
    return precision.doubles(MassModel, *parts)


def momentum(
    model: MassModel, configuration: Configuration, velocity: jax.Array, rates: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Return linear momentum and angular momentum about the vehicle's origin, body axes.

    Parameters
    ----------
    model : MassModel
    configuration : Configuration
    velocity, rates : Array, shape (3,)
        Of the vehicle axes, m/s and rad/s.

    Returns
    -------
    linear : Array, shape (3,)
        kg m/s.
    angular : Array, shape (3,)
        N m s.
    """
    tilt, tilt_rate, speed = configuration
    arm = _turn(model.wing_arm, tilt)
    place = model.wing_pivot + arm
    spin = tilt_rate[:, None] * _ALONG_Y  # of each wing on the body
    wing_linear = model.wing_mass[:, None] * (velocity + cross(rates, place) + cross(spin, arm))
    wing_rates = _turn(rates + spin, -tilt)  # in the wing's own axes, where its inertia is constant
    own = (model.wing_inertia * wing_rates[:, None, :]).sum(-1) + (model.wing_spin * speed).sum(-1)
    wing_angular = _turn(own, tilt) + cross(place, wing_linear)
    body_mass = model.mass - model.wing_mass.sum()
    linear = body_mass * velocity + cross(rates, model.body_moment) + wing_linear.sum(0)
    angular = (
        cross(model.body_moment, velocity)
        + (model.body_inertia * rates).sum(-1)
        + (model.body_spin * speed).sum(-1)
        + wing_angular.sum(0)
    )
    return linear, angular


def traced_centre_of_gravity(model: MassModel, tilt: jax.Array) -> jax.Array:
    """Return the centre of gravity at given tilts, vehicle axes, m, shape (3,)."""
    return moments_of_mass(model, tilt)[0] / model.mass


def moments_of_mass(model: MassModel, tilt: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return first moment, kg m, shape (3,), and inertia, kg m2, shape (3, 3), about the origin."""
    place = model.wing_pivot + _turn(model.wing_arm, tilt)
    heavy = model.wing_mass[:, None] * place
    # Turning rows, then rows of the transpose, is R I R^T for a symmetric I.
    half = _turn(model.wing_inertia, tilt[:, None])
    own = _turn(jnp.swapaxes(half, 1, 2), tilt[:, None])
    square = (heavy * place).sum(-1)[:, None, None] * np.eye(3)
    inertia = (own + square - heavy[:, :, None] * place[:, None, :]).sum(0)
    return model.body_moment + heavy.sum(0), model.body_inertia + inertia


def _turn(vector: jax.Array, tilt: jax.Array) -> jax.Array:
    """Turn vectors, shape (..., 3), about +y by angles, shape (...), as core.frames does."""
    cosine, sine = jnp.cos(tilt), jnp.sin(tilt)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    return jnp.stack([x * cosine + z * sine, y, z * cosine - x * sine], axis=-1)

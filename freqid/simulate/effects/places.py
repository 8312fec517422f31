"""Effects that are at one effector or at all of a kind: their settings as one number for each of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.vehicle import Vehicle
from freqid.dynamics import precision as precision
from freqid.simulate.effects.effect import Effect, Parameter


def one_each(vehicle: Vehicle, like: Parameter, kinds: Collection[str]) -> dict[str, Parameter]:
    """Return a parameter for each effector of some kinds beside the one that all have in common."""
    names = [e.name for e in vehicle.effectors if e.kind in kinds]
    return {n: replace(like, meaning=f"{like.meaning}, of {n} alone") for n in names}


def alone(effect: Effect, settings: Mapping[str, float]) -> list[str]:
    """Return the effectors at which an effect acts by themselves: flights have it at all of a kind only."""
    return [
        name for name, size in settings.items() if size and name not in (*effect.parameters, *effect.jointly)
    ]


def order(vehicle: Vehicle, kind: str) -> NDArray[np.float64]:
    """Return the matrix that takes numbers in the order of the alphabet to that of the effectors.

    A tree of settings comes out of every compiled function with its names sorted.
    """
    names = [e.name for e in vehicle.effectors if e.kind == kind]
    return np.array([[float(a == b) for b in sorted(names)] for a in names]).reshape(len(names), len(names))


def spread(settings: dict[str, jax.Array], common: str, order: jax.Array) -> jax.Array:
    """Return what all have in common plus what each has, shape (effector,), in their own order.

    Parameters
    ----------
    settings : dict of Array, shape ()
        The common one and, where the settings are a vehicle's, one for each effector.
    common : str
        Name of the common one.
    order : Array, shape (effector, effector)
        As `order` returns.
    """
    own: Sequence[jax.Array] = [settings[name] for name in sorted(settings) if name != common]
    if not own:
        return jnp.full(order.shape[0], settings[common])
    return settings[common] + order @ jnp.stack(own)

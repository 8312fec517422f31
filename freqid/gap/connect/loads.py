"""The loads that the simulation's airframe has along a record, and their exact derivatives.

Chunks of one length are evaluated one after the other, so that records of any length run through what was
compiled once, and what one chunk needs stays in the cache.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.simulate.loads import airframe
from freqid.simulate.loads.quantities import Aero, Flow, Positions, Wake
from freqid.simulate.motion import attitude, multibody
from freqid.simulate.motion.multibody import MassModel

_CHUNKS = {1024: 0.8, 256: 1.0}  # samples, and the time of each; what a record does not fill is lost
_GRID = 64  # points of the coarse grid of derivatives
_STEP = 0.005  # s: between what the simulation's own wake remembers
_STILL = Wake(np.zeros(2), np.zeros(2))  # type: ignore[arg-type]


class Along(NamedTuple):
    """What the airframe feels along a record; every field has a sample axis in front.

    Attributes
    ----------
    flow : Flow
    positions : Positions
    """

    flow: Flow
    positions: Positions


def wrench(parameters: airframe.Airframe, mass: MassModel, along: Along, time: Array) -> Array:
    """Return X Y Z and L M N about the instantaneous centre of gravity, N and N m, shape (6, sample).

    Parameters
    ----------
    parameters : airframe.Airframe
    mass : MassModel
    along : Along of ndarray
    time : ndarray, shape (sample,)
        s.

    Notes
    -----
    The front wing does not feel its own wake, so that a first pass tells what it sheds; the second one
    lets that arrive when the air has carried it to the rear wing. Before the record, the wake is as at its
    start. Between samples, what is shed is a cubic spline seen, as in flight, straight between steps.
    """
    leaving, late = _chunked(_shed, (parameters,), along, _chunk(time.size))
    arriving = jax.tree.map(lambda shed: _arrived(time, shed, late), leaving)
    return _chunked(_loads, (parameters, mass), (along, arriving), _chunk(time.size)).T


def derivatives(
    parameters: airframe.Airframe, mass: MassModel, along: Along, sensor: Array
) -> tuple[Array, Array, Array, Array]:
    """Return the derivatives of the wrench by what the airframe feels, the wake steady.

    Parameters
    ----------
    parameters, mass, along
        As in `wrench`.
    sensor : ndarray, shape (3,)
        Where u v w are measured, vehicle axes, m.

    Returns
    -------
    by_motion : ndarray, shape (6, 8, sample)
        By u v w p q r, density and altitude.
    by_surface, by_tilt, by_speed : ndarray, shape (6, effector of the kind, sample)
    """
    found = _chunked(_slopes, (parameters, mass, jnp.asarray(sensor)), along, _GRID)
    by_motion, by_surface, by_tilt, by_speed = (np.moveaxis(part, 0, -1) for part in found)
    return by_motion, by_surface, by_tilt, by_speed


def torques(parameters: airframe.Airframe, along: Along) -> Array:
    """Return the rotors' torques in a steady wake, N m, shape (sample, rotor)."""
    return _chunked(_torque, (parameters,), along, _chunk(len(along.flow.rho)))


def _arrived(time: Array, shed: Array, late: Array) -> Array:
    """Return a signal as it was `late` ago, shape (sample, ...)."""
    spline = CubicSpline(time, shed)
    steps = np.clip(late / _STEP, 1.0, None)
    whole = np.floor(steps)
    share = (steps - whole)[:, None]
    newer, older = (spline(np.maximum(time - _STEP * n, time[0])) for n in (whole, whole + 1))
    return (1 - share) * newer + share * older


def _chunk(count: int) -> int:
    """Return the size of chunks that takes the least time for so many samples."""
    return min(_CHUNKS, key=lambda size: _CHUNKS[size] * size * -(-count // size))


def _chunked(function: Callable, fixed: tuple, samples: Any, size: int) -> Any:
    """Return ``function(*fixed, samples)`` over chunks of the sample axis, the last one filled up."""
    count = jax.tree.leaves(samples)[0].shape[0]
    pieces = []
    for first in range(0, count, size):
        chunk = jax.tree.map(lambda x: piece(x, first, size), samples)  # noqa: B023  used at once
        pieces.append(function(*fixed, chunk))
    return jax.tree.map(lambda *x: np.concatenate([np.asarray(p) for p in x])[:count], *pieces)


def piece(values: Array, first: int, size: int) -> Array:
    """Return so many samples from a first one on, the last one repeated where there are fewer."""
    found = np.asarray(values[first : first + size])
    short = size - len(found)
    return np.concatenate([found, np.repeat(found[-1:], short, axis=0)]) if short else found


def _about_centre(aero: Aero, mass: MassModel, tilt: jax.Array) -> jax.Array:
    return aero.wrench.about(multibody.traced_centre_of_gravity(mass, tilt))


def _steady(parameters: airframe.Airframe, at: Along) -> Aero:
    """Return the loads in a steady wake; a loop, so that the airframe is compiled once, not twice."""

    def again(aero: Aero, _):
        return airframe.wrench(parameters, *at, aero.shed), None

    still = jax.tree.map(
        lambda x: jnp.zeros(x.shape), jax.eval_shape(lambda: airframe.wrench(parameters, *at, _STILL))
    )
    return jax.lax.scan(again, still, None, length=2)[0]


@jax.jit
def _shed(parameters: airframe.Airframe, along: Along):
    def one(at: Along):
        leaving = airframe.wrench(parameters, *at, _STILL).shed
        return leaving, parameters.convection_time(at.flow)

    return jax.vmap(one)(along)


@jax.jit
def _loads(parameters: airframe.Airframe, mass: MassModel, samples: tuple[Along, Wake]):
    def one(at: Along, arriving: Wake):
        return _about_centre(airframe.wrench(parameters, *at, arriving), mass, at.positions.tilt)

    return jax.vmap(one)(*samples)


@jax.jit
def _torque(parameters: airframe.Airframe, along: Along):
    return jax.vmap(lambda at: _steady(parameters, at).torque)(along)


@jax.jit
def _slopes(parameters: airframe.Airframe, mass: MassModel, sensor: jax.Array, along: Along):
    def one(at: Along):
        flow, positions = at
        measured = flow.velocity + attitude.cross(flow.rates, sensor)

        def of(motion, surface, tilt, speed):
            velocity, rates, rho, height = motion[:3], motion[3:6], motion[6], motion[7]
            origin = velocity - attitude.cross(rates, sensor)
            there = positions._replace(surface=surface, tilt=tilt, speed=speed)
            aero = _steady(parameters, Along(Flow(origin, rates, rho, height), there))
            return _about_centre(aero, mass, tilt)

        motion = jnp.concatenate([measured, flow.rates, flow.rho[None], flow.height[None]])
        return jax.jacfwd(of, (0, 1, 2, 3))(motion, positions.surface, positions.tilt, positions.speed)

    return jax.vmap(one)(along)

"""Delays in flight: a line that remembers a signal for a while, to be read with any delay.

In one wait commands until the actuators get them (effects/actuator_delay says how long), in another the wake
of the front wing until the rear wing meets it (whole_vehicle). Logged channels are late by effects/time_skew.
"""

from __future__ import annotations

from typing import TypeVar

import jax
import jax.numpy as jnp

from freqid.dynamics import precision as precision

Signal = TypeVar("Signal")


def start(signal: Signal, samples: int) -> Signal:
    """Return a line in which a signal has always been what it is now.

    Parameters
    ----------
    signal : pytree of arrays
    samples : int
        What it can remember, in steps.

    Returns
    -------
    pytree of arrays, shape (sample, ...)
        The newest first.
    """
    return jax.tree.map(lambda x: jnp.repeat(jnp.asarray(x)[None], samples, axis=0), signal)


def push(line: Signal, signal: Signal) -> Signal:
    """Return the line with the present value in front and the oldest one forgotten."""
    return jax.tree.map(lambda past, now: jnp.concatenate([now[None], past[:-1]]), line, signal)


def read(line: Signal, steps: jax.Array | float) -> Signal:
    """Return a signal as it was, straight between its samples.

    Parameters
    ----------
    line : pytree of arrays, shape (sample, ...)
    steps : Array, shape ()
        Delay in steps, any real number; held inside what the line remembers.

    Returns
    -------
    pytree of arrays

    Notes
    -----
    Every sample is weighted by a hat function: no index depends on the delay, so that it can be
    differentiated and can differ between the flights of a batch.
    """

    def of(past: jax.Array) -> jax.Array:
        age = jnp.arange(past.shape[0])
        weight = jnp.maximum(1 - jnp.abs(age - jnp.clip(steps, 0.0, past.shape[0] - 1.0)), 0.0)
        return jnp.tensordot(weight, past, axes=1)

    return jax.tree.map(of, line)

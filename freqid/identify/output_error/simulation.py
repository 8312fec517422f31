"""A model's outputs and their exact sensitivities, compiled once for a model and shared by its estimators.

Steps are classical Runge-Kutta with inputs linear between samples. Sensitivities are those of the integrated
equations themselves (forward mode), so they belong to the simulation to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp

from freqid.dynamics import precision as precision
from freqid.identify.output_error.model import DynamicModel

Compiled = Callable[..., Any]


def derivative_of(model: DynamicModel) -> Compiled:
    """Return ``derivative(x, u, p)`` of a model, on vectors in its own order."""

    def derivative(x: jax.Array, u: jax.Array, p: jax.Array) -> jax.Array:
        found, _ = model.equations(*_named(model, x, u, p))
        return jnp.stack([jnp.asarray(found[s], dtype=x.dtype) for s in model.states]) if len(x) else x

    return derivative


def output_of(model: DynamicModel) -> Compiled:
    """Return ``output(x, u, p)`` of a model, on vectors in its own order."""

    def output(x: jax.Array, u: jax.Array, p: jax.Array) -> jax.Array:
        _, found = model.equations(*_named(model, x, u, p))
        return jnp.stack([jnp.asarray(found[y], dtype=p.dtype) for y in model.outputs])

    return output


def _named(model: DynamicModel, x: jax.Array, u: jax.Array, p: jax.Array) -> tuple[dict, dict, dict]:
    return (
        {n: x[i] for i, n in enumerate(model.states)},
        {n: u[i] for i, n in enumerate(model.inputs)},
        {n: p[i] for i, n in enumerate(model.parameters)},
    )


def advance(derivative: Compiled, x: jax.Array, u0: jax.Array, u1: jax.Array, p: jax.Array, dt: Any) -> Any:
    """Return the state one sample later."""
    middle = 0.5 * (u0 + u1)
    k1 = derivative(x, u0, p)
    k2 = derivative(x + 0.5 * dt * k1, middle, p)
    k3 = derivative(x + 0.5 * dt * k2, middle, p)
    k4 = derivative(x + dt * k3, u1, p)
    return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def delayed(model: DynamicModel, p: jax.Array, u: jax.Array, dt: Any) -> jax.Array:
    """Return the inputs as they act, shape (N, m): late ones interpolated, held before the first sample."""
    time = dt * jnp.arange(u.shape[0])
    for name, parameter in model.delays.items():
        i = model.inputs.index(name)
        u = u.at[:, i].set(jnp.interp(time - p[model.parameters.index(parameter)], time, u[:, i]))
    return u


def simulation_of(model: DynamicModel) -> Compiled:
    """Return ``simulate(vector, u, dt)``: outputs, shape (N, k), from parameters and initial states."""
    derivative, output = derivative_of(model), output_of(model)
    count = len(model.parameters)

    def simulate(vector: jax.Array, u: jax.Array, dt: Any) -> jax.Array:
        p, x0 = vector[:count], vector[count:]
        u = delayed(model, p, u, dt)

        def step(x: jax.Array, pair: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
            return advance(derivative, x, *pair, p, dt), x

        last, path = jax.lax.scan(step, x0, (u[:-1], u[1:]))
        path = jnp.concatenate((path, last[None]))
        return jax.vmap(output, (0, 0, None))(path, u, p)

    return simulate


@lru_cache(maxsize=32)
def compiled(model: DynamicModel) -> tuple[Compiled, Compiled]:
    """Return the simulation of several manoeuvres at once and the same with sensitivities.

    Returns
    -------
    simulate : callable
        ``simulate(vectors, u, dt)`` of shape (manoeuvre, vector) and (manoeuvre, N, m): (manoeuvre, N, k).
    sensitivities : callable
        The same with the derivatives, shape (manoeuvre, N, k, vector).
    """
    one = simulation_of(model)
    simulate = jax.jit(jax.vmap(one, (0, 0, None)))

    def both(vector: jax.Array, u: jax.Array, dt: Any) -> tuple[jax.Array, jax.Array]:
        def pushed(tangent: jax.Array) -> tuple[jax.Array, jax.Array]:
            return jax.jvp(lambda v: one(v, u, dt), (vector,), (tangent,))

        outputs, along = jax.vmap(pushed, out_axes=(None, -1))(jnp.eye(vector.size, dtype=vector.dtype))
        return outputs, along

    return simulate, jax.jit(jax.vmap(both, (0, 0, None)))

"""Fixed-step integration of any state by one compiled loop, and the point where a flight diverges.

What moves continuously goes through `rk4` inside a step; what is sampled (a control law, a delay,
an excitation added to commands) is part of the same step and of the same state. Batches are ``jax.vmap``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import UsageError, nearest
from freqid.dynamics import precision as precision

State = TypeVar("State")
Inputs = Any


def rk4(derivative: Callable[[State, Any], Any], state: State, dt: float, has_aux: bool = False) -> Any:
    """Advance a state by one step of the classical fourth-order Runge-Kutta method.

    Parameters
    ----------
    derivative : callable
        ``derivative(state, elapsed)``: the rate of change, of the same structure as `state`, `elapsed`
        seconds after the start of the step (0, dt/2 or dt).
    state : pytree of arrays
    dt : float
        Step, s.
    has_aux : bool
        Whether the derivative returns a pair, the second of which is anything else worth knowing.

    Returns
    -------
    state : pytree of arrays
    aux : pytree of arrays
        Only with `has_aux`: as it was at the start of the step.

    Notes
    -----
    The four stages are a loop, so the derivative is compiled once: a quarter of the compiler's work and
    of the processor's instruction cache.
    """

    def stage(carry: tuple[State, State], times: tuple[jax.Array, jax.Array]) -> Any:
        (total, slope), (ahead, weight) = carry, times
        found = derivative(jax.tree.map(lambda x, k: x + ahead * k, state, slope), ahead)
        slope, aux = found if has_aux else (found, None)
        return (jax.tree.map(lambda whole, k: whole + weight * k, total, slope), slope), aux

    ahead, weight = dt * jnp.array([0, 0.5, 0.5, 1]), dt / 6 * jnp.array([1.0, 2, 2, 1])
    still = jax.tree.map(jnp.zeros_like, state)
    (after, _), aux = jax.lax.scan(stage, (state, still), (ahead, weight))
    return (after, jax.tree.map(lambda x: x[0], aux)) if has_aux else after


def integrate(
    step: Callable[[State, Inputs], State],
    state: State,
    inputs: Inputs,
    *,
    observe: Callable[[State, Inputs], Any] | None = None,
    every: int = 1,
) -> tuple[Any, State]:
    """Run a step over all inputs and keep what is observed now and then.

    Parameters
    ----------
    step : callable
        ``step(state, input) -> state``, one step of the fixed size that it was made for.
    state : pytree of arrays
        At the start.
    inputs : pytree of arrays, shape (step, ...)
        Held over each step.
    observe : callable, optional
        ``observe(state, input) -> pytree``, at the start of every `every`-th step; the state where absent.
    every : int
        Steps for each sample that is kept; the number of steps must be a multiple of it.

    Returns
    -------
    outputs : pytree of arrays, shape (sample, ...)
        The first sample is the start itself.
    state : pytree of arrays
        After the last step.

    Raises
    ------
    UsageError
        Where the number of steps is no multiple of `every`.
    """
    count = jax.tree.leaves(inputs)[0].shape[0]
    if count % every:
        raise UsageError(f"{count} steps are no multiple of {every}, the steps for each sample")
    look = observe or (lambda state, _: state)
    groups = jax.tree.map(lambda x: x.reshape(count // every, every, *x.shape[1:]), inputs)

    def sample(state: State, group: Inputs) -> tuple[State, Any]:
        seen = look(state, jax.tree.map(lambda x: x[0], group))
        state, _ = jax.lax.scan(lambda s, u: (step(s, u), None), state, group)
        return state, seen

    state, outputs = jax.lax.scan(sample, state, groups)
    return outputs, state


@dataclass(frozen=True)
class Divergence:
    """Where a flight left its limits.

    Attributes
    ----------
    sample : int
        First sample that is outside; the record is good before it.
    time : float
        Of that sample, s.
    channel : str
    value : float
        Found there; may be infinite or not a number.
    limits : tuple of 2 floats
        Expected of the channel; infinite where only a finite value was.
    """

    sample: int
    time: float
    channel: str
    value: float
    limits: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.limits
        expected = f"{low:.4g} to {high:.4g}" if np.isfinite((low, high)).any() else "a finite value"
        found = f"{self.channel} is {self.value:.4g}, expected {expected}"
        return f"the flight diverged at t = {self.time:.4g} s: {found}"


def divergence(
    time: NDArray[np.float64],
    channels: Mapping[str, NDArray[np.float64]],
    limits: Mapping[str, tuple[float, float]],
) -> Divergence | None:
    """Return where a flight first leaves its limits or is no longer finite.

    Parameters
    ----------
    time : ndarray, shape (sample,)
        s.
    channels : mapping of str to ndarray, shape (sample,)
        All are checked to be finite.
    limits : mapping of str to tuple of 2 floats
        Lowest and highest value by channel name, in its unit.

    Returns
    -------
    Divergence or None
        Of several channels at the same sample, the one that is furthest outside for its range.

    Raises
    ------
    UsageError
        Where a limit names no channel.
    """
    unknown = [name for name in limits if name not in channels]
    if unknown:
        raise UsageError(f"there is no channel '{unknown[0]}' to limit", remedy=nearest(unknown[0], channels))
    first: tuple[int, float] | None = None
    found = None
    for name, values in channels.items():
        low, high = limits.get(name, (-np.inf, np.inf))
        bad = ~np.isfinite(values) | (values < low) | (values > high)
        if not bad.any():
            continue
        at = int(np.argmax(bad))
        middle, half = (low + high) / 2, (high - low) / 2
        excess = abs(values[at] - middle) / half if np.isfinite(half) else np.inf
        excess = float(excess) if np.isfinite(excess) else np.inf
        if first is None or (at, -excess) < first:
            first = (at, -excess)
            found = Divergence(at, float(time[at]), name, float(values[at]), (low, high))
    return found

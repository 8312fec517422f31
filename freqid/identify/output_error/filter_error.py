"""Filter error: noise in outputs and in the motion, as turbulence is; a Kalman filter gives innovations."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.arrays import Array
from freqid.dynamics import precision as precision
from freqid.identify.output_error.minimise import Point
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.output_error.parameters import ParameterSet
from freqid.identify.output_error.simulation import Compiled, advance, delayed, derivative_of, output_of
from freqid.identify.output_error.time_domain import padded

DOUBLINGS = 25
"""Of the Riccati recursion: each doubles the filter's steps, so that it is steady to rounding."""


def innovations_of(model: DynamicModel) -> Compiled:
    """Return ``innovations(vector, noise, u, z, dt, x, mid)``: innovations, (N, k), their covariance.

    `noise` is the logarithm of the standard deviation of each state's process noise, per square root of a
    second, and then of each output's. The gain is the steady one of the model linearised about x and mid.
    """
    derivative, output = derivative_of(model), output_of(model)
    count, n = len(model.parameters), len(model.states)

    def innovations(
        vector: jax.Array, noise: jax.Array, u: jax.Array, z: jax.Array, dt: Any, x: jax.Array, mid: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        p, x0 = vector[:count], vector[count:]
        u = delayed(model, p, u, dt)
        step = jax.jacfwd(lambda state: advance(derivative, state, mid, mid, p, dt))(x)
        seen = jax.jacfwd(output)(x, mid, p)
        q, r = dt * jnp.diag(jnp.exp(2 * noise[:n])), jnp.diag(jnp.exp(2 * noise[n:]))
        ahead = steady_covariance(step, seen, q, r)
        s = seen @ ahead @ seen.T + r
        gain = jnp.linalg.solve(s, seen @ ahead).T

        def turn(state: jax.Array, given: tuple[jax.Array, jax.Array, jax.Array]) -> tuple:
            u0, u1, measured = given
            v = measured - output(state, u0, p)
            return advance(derivative, state + gain @ v, u0, u1, p, dt), v

        following = jnp.concatenate((u[1:], u[-1:]))
        return jax.lax.scan(turn, x0, (u, following, z))[1], s

    return innovations


def steady_covariance(step: jax.Array, seen: jax.Array, q: jax.Array, r: jax.Array) -> jax.Array:
    """Return the steady covariance P of the predicted state, shape (n, n).

    Parameters
    ----------
    step, seen : ndarray, shape (n, n) and (k, n)
        Transition of the state over a sample, and its outputs.
    q, r : ndarray, shape (n, n) and (k, k)
        Covariance of the process noise of a sample and of the outputs' noise.

    Notes
    -----
    ``P = step (P - P C^T (C P C^T + R)^-1 C P) step^T + Q`` by doubling: a fixed number of products, so that
    its derivatives are exact (Anderson & Moore, *Optimal Filtering*, 1979, sec. 6.7).
    """
    eye = jnp.eye(len(step))

    def double(carry: tuple[jax.Array, ...], _: None) -> tuple[tuple[jax.Array, ...], None]:
        a, b, p = carry
        inverse = jnp.linalg.inv(eye + b @ p)
        return (a @ inverse @ a, b + a @ inverse @ b @ a.T, p + a.T @ p @ inverse @ a), None

    start = (step.T, seen.T @ jnp.linalg.solve(r, seen), q)
    return jax.lax.scan(double, start, None, length=DOUBLINGS)[0][2]


@lru_cache(maxsize=32)
def _compiled(model: DynamicModel) -> tuple[Compiled, Compiled]:
    innovations = innovations_of(model)

    def both(vector: jax.Array, noise: jax.Array, *given: Any) -> Any:
        whole = jnp.concatenate((vector, noise))

        def pushed(tangent: jax.Array) -> Any:
            of = lambda w: innovations(w[: vector.size], w[vector.size :], *given)  # noqa: E731
            return jax.jvp(of, (whole,), (tangent,))

        (v, s), (dv, ds) = jax.vmap(pushed, out_axes=((None, None), (-1, -1)))(jnp.eye(whole.size))
        return v, s, dv, ds

    axes = (0, None, 0, 0, None, 0, 0)
    return jax.jit(jax.vmap(innovations, axes)), jax.jit(jax.vmap(both, axes))


class FilterError:
    """The likelihood of innovations v, ``J = 1/2 sum v^T S^-1 v + N/2 ln det S``.

    Noise of states and outputs is estimated along: the free numbers are those of the parameters and then the
    logarithms of its standard deviations. The information is Fisher's, exact for a linear model. Jategaonkar
    (2nd ed., ch. 5) estimates S from the innovations instead and process noise beside it; here S is what the
    filter says, so that the likelihood is one function and its steps never go up.
    """

    method = "filter-error"

    def __init__(
        self, model: DynamicModel, signals: Sequence[Signals], parameters: ParameterSet, noisy: Sequence[str]
    ) -> None:
        self.model, self.signals, self.parameters = model, tuple(signals), parameters
        self.noisy = tuple(noisy)
        longest = max(s.samples for s in signals)
        self._counts = [s.samples for s in signals]
        self._mask = np.stack([np.arange(longest) < n for n in self._counts])[..., None]
        centre = [
            [float(np.mean(s.outputs[x])) if x in s.outputs else 0.0 for x in model.states] for s in signals
        ]
        self._z = np.stack([padded(s.output_matrix(model), longest) for s in signals])
        self._given = (
            np.stack([padded(s.input_matrix(model), longest) for s in signals]),
            self._z,
            self.signals[0].dt,
            np.array(centre).reshape(len(signals), len(model.states)),
            np.array([s.input_matrix(model).mean(axis=0) for s in signals]),
        )
        self._innovations, self._both = _compiled(model)
        self._noise = np.array([x in self.noisy for x in model.states] + [True] * len(model.outputs))
        spreads = parameters.spreads()
        (count, vector, f), free_noise = spreads.shape, np.flatnonzero(self._noise)
        self._spreads = np.zeros((count, vector + self._noise.size, f + free_noise.size))
        self._spreads[:, :vector, :f] = spreads
        self._spreads[:, vector + free_noise, f + np.arange(free_noise.size)] = 1.0

    def cost(self, free: Array) -> float:
        """Return the negative log-likelihood; infinite where model or filter diverge."""
        v, s = (np.asarray(x) for x in self._innovations(*self._split(free), *self._given))
        return self._cost(np.where(self._mask, v, 0.0), s)

    def linearise(self, free: Array) -> Point:
        """Return cost, gradient and Fisher information."""
        v, s, dv, ds = self._linear(free)
        cost = self._cost(v, s)
        gradient, information = np.zeros(free.size), np.zeros((free.size, free.size))
        if not np.isfinite(cost) or not np.isfinite(dv).all():
            return Point(np.inf, gradient, information)
        for i, count in enumerate(self._counts):
            inverse = np.linalg.inv(s[i])
            weighted = np.einsum("kl,nlf->nkf", inverse, dv[i], optimize=True)
            change = np.einsum("kl,lmf->kmf", inverse, ds[i])
            gradient += np.einsum("nkf,nk->f", weighted, v[i]) + 0.5 * count * np.einsum("kkf->f", change)
            gradient -= 0.5 * np.einsum("kmf,km->f", change, v[i].T @ v[i] @ inverse)
            information += np.einsum("nkf,nkg->fg", weighted, dv[i], optimize=True)
            information += 0.5 * count * np.einsum("kmf,mkg->fg", change, change)
        return Point(cost, gradient, information)

    def noise_covariance(self, free: Array) -> Array:
        """Return the covariance of the outputs' noise, shape (k, k)."""
        return np.diag(np.exp(2 * self._split(free)[1][len(self.model.states) :]))

    def process_noise(self, free: Array) -> dict[str, float]:
        """Return the standard deviation by state, unit of the state per square root of a second."""
        deviation = np.exp(free[len(self.parameters.free_names) :][: len(self.noisy)])
        return dict(zip(self.noisy, deviation.tolist(), strict=True))

    def white_equations(self, free: Array) -> tuple[Array, Array, list[int]]:
        """Return innovations and their derivatives by the parameters, as `TimeDomain.white_equations`.

        Estimates of dynamics and of noise hardly correlate, so the noise stands apart.
        """
        v, s, dv, _ = self._linear(free)
        f = len(self.parameters.free_names)
        whites, columns, samples = [], [], []
        for i, count in enumerate(self._counts):
            weight = np.linalg.inv(np.linalg.cholesky(s[i]))
            whites.append((v[i, :count] @ weight.T).T.ravel())
            along = np.einsum("kl,nlf->fkn", weight, dv[i, :count, :, :f], optimize=True)
            columns.append(-along.reshape(f, -1))
            samples += [count] * len(weight)
        return np.concatenate(whites), np.concatenate(columns, axis=1), samples

    def outputs(self, free: Array) -> list[Array]:
        """Return the outputs predicted one sample ahead by manoeuvre, shape (N, k) each."""
        return [z[: len(r)] - r for z, r in zip(self._z, self.residuals(free), strict=True)]

    def residuals(self, free: Array) -> list[Array]:
        """Return the innovations by manoeuvre, shape (N, k) each."""
        v = np.asarray(self._innovations(*self._split(free), *self._given)[0])
        return [each[:n] for each, n in zip(v, self._counts, strict=True)]

    def _split(self, free: Array) -> tuple[Array, Array]:
        f = len(self.parameters.free_names)
        noise = np.full(self._noise.size, -np.inf)
        noise[self._noise] = free[f:]
        return self.parameters.vectors(free[:f]), noise

    def _linear(self, free: Array) -> tuple[Array, Array, Array, Array]:
        v, s, dv, ds = (np.asarray(x) for x in self._both(*self._split(free), *self._given))
        with np.errstate(over="ignore", invalid="ignore"):  # of a model that diverges: the cost says so
            dv = np.where(self._mask[..., None], dv, 0.0)
            dv = np.einsum("inkw,iwf->inkf", dv, self._spreads, optimize=True)
            ds = np.einsum("iklw,iwf->iklf", ds, self._spreads)
        return np.where(self._mask, v, 0.0), s, dv, ds

    def _cost(self, v: Array, s: Array) -> float:
        if not (np.isfinite(v).all() and np.isfinite(s).all()):
            return np.inf
        total = 0.0
        for each, covariance, count in zip(v, s, self._counts, strict=True):
            sign, logarithm = np.linalg.slogdet(covariance)
            if sign <= 0:
                return np.inf
            with np.errstate(over="ignore", invalid="ignore"):
                total += 0.5 * float(np.sum(each.T * np.linalg.solve(covariance, each.T)) + count * logarithm)
        return total if np.isfinite(total) else np.inf

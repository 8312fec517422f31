"""Output error in the frequency domain: linear models, delays exact, lines of the band that is modelled."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError
from freqid.identify.output_error.minimise import Point
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.output_error.parameters import ParameterSet
from freqid.identify.output_error.simulation import Compiled, derivative_of, output_of
from freqid.identify.output_error.time_domain import EXACT
from freqid.identify.spectra.fourier import FourierPlan
from freqid.identify.spectra.trend import TrendKind, remove_trend


def responses_of(model: DynamicModel) -> Compiled:
    """Return ``responses(vector, inputs, omega, x, u)``: transforms of the outputs, shape (k, M), complex.

    The model is linearised about the state x and the input u; inputs are transforms of shape (m, M).
    """
    derivative, output = derivative_of(model), output_of(model)
    count = len(model.parameters)

    def responses(vector: jax.Array, inputs: jax.Array, omega: jax.Array, x: jax.Array, u: jax.Array) -> Any:
        p = vector[:count]
        c, d = jax.jacfwd(output, (0, 1))(x, u, p)
        late = jnp.stack(
            [
                p[model.parameters.index(model.delays[n])] if n in model.delays else jnp.zeros(())
                for n in model.inputs
            ]
        )
        acting = inputs * jnp.exp(-1j * omega * late[:, None])
        through = (d @ acting).T
        if model.states:
            a, b = jax.jacfwd(derivative, (0, 1))(x, u, p)
            matrix = 1j * omega[:, None, None] * jnp.eye(len(model.states)) - a
            state = jnp.linalg.solve(matrix, (b @ acting).T[..., None])
            through = through + jnp.einsum("kn,mnj->mk", c, state)
        return through.T

    return responses


@lru_cache(maxsize=32)
def _compiled(model: DynamicModel) -> tuple[Compiled, Compiled]:
    responses = responses_of(model)

    def both(vector: jax.Array, *given: jax.Array) -> tuple[jax.Array, jax.Array]:
        def pushed(tangent: jax.Array) -> tuple[jax.Array, jax.Array]:
            return jax.jvp(lambda v: responses(v, *given), (vector,), (tangent,))

        return jax.vmap(pushed, out_axes=(None, -1))(jnp.eye(vector.size, dtype=vector.dtype))

    return jax.jit(responses), jax.jit(both)


class FrequencyDomain:
    """The likelihood of transforms of the outputs, ``J = M sum ln S_k``, S the residual's power by output.

    The model is linearised about the means of the manoeuvre (zero for states that are no outputs). Biases and
    initial states do not enter: trends are removed before the transform (Klein & Morelli, 2nd ed., ch. 7).
    """

    method = "output-error"

    def __init__(
        self,
        model: DynamicModel,
        signals: Sequence[Signals],
        parameters: ParameterSet,
        lines_hz: Array,
        trend: TrendKind = "endpoints",
    ) -> None:
        self.model, self.signals, self.parameters = model, tuple(signals), parameters
        self.lines_hz = np.asarray(lines_hz, dtype=np.float64)
        self.trend: TrendKind = trend
        self._given, self._z = [], []
        for s in signals:
            if self.lines_hz[-1] > 0.5 / s.dt:
                raise DataError(
                    f"lines reach {self.lines_hz[-1]:g} Hz, above the Nyquist frequency {0.5 / s.dt:g} Hz",
                    where=s.name or None,
                    remedy="lower the band",
                )
            plan = FourierPlan(s.samples, s.dt, self.lines_hz)
            inputs, outputs = s.input_matrix(model).T, s.output_matrix(model).T
            mean = {n: float(np.mean(s.outputs[n])) if n in s.outputs else 0.0 for n in model.states}
            centre = np.array([mean[n] for n in model.states])
            transforms = plan(remove_trend(inputs, s.dt, trend).x) if len(inputs) else np.empty((0, 1))
            for rate, of in model.rates.items():  # exact, where the trend left nothing at the ends
                j = 2j * np.pi * self.lines_hz
                transforms[model.inputs.index(rate)] = j * transforms[model.inputs.index(of)]
            self._given.append((transforms, 2 * np.pi * self.lines_hz, centre, inputs.mean(axis=1)))
            self._z.append(plan(remove_trend(outputs, s.dt, trend).x) / np.sqrt(s.dt * s.samples))
        self._spreads = parameters.spreads()
        self._responses, self._both = _compiled(model)
        power = sum((np.abs(z) ** 2).sum(axis=1) for z in self._z)
        self._floor = EXACT**2 * power / self._lines + np.finfo(float).tiny

    @property
    def _lines(self) -> int:
        return self.lines_hz.size * len(self.signals)

    def with_parameters(self, parameters: ParameterSet) -> FrequencyDomain:
        """Return the same likelihood of other unknowns."""
        return FrequencyDomain(self.model, self.signals, parameters, self.lines_hz, self.trend)

    def cost(self, free: Array) -> float:
        """Return the negative log-likelihood; infinite where the model has no response."""
        return self._cost([z - y for z, y in zip(self._z, self._modelled(free), strict=True)])

    def linearise(self, free: Array) -> Point:
        """Return cost, gradient and Fisher information."""
        residual, along = self._linear(free)
        cost = self._cost(residual)
        if not np.isfinite(cost):
            none = np.zeros(free.size)
            return Point(np.inf, none, np.diag(none))
        white, columns = self._whitened(residual, along)
        return Point(
            cost, -2 * (columns.conj() @ white).real, 2 * np.einsum("fe,ge->fg", columns.conj(), columns).real
        )

    def noise_covariance(self, free: Array) -> Array:
        """Return the residual's power density by output, two-sided, on the diagonal, shape (k, k)."""
        residual = [z - y for z, y in zip(self._z, self._modelled(free), strict=True)]
        taken = free.size / len(self.model.outputs) / 2
        return np.diag(self._power(residual) * self._lines / max(self._lines - taken, 1.0))

    def white_equations(self, free: Array) -> tuple[Complex, Complex, list[Array], list[float]]:
        """Return residual and columns in units of the noise, lines and duration of each stretch."""
        residual, along = self._linear(free)
        white, columns = self._whitened(residual, along)
        stretches = len(self.signals) * len(self.model.outputs)
        durations = [s.dt * (s.samples - 1) for s in self.signals for _ in self.model.outputs]
        return white, columns, [self.lines_hz] * stretches, durations

    def outputs(self, free: Array) -> list[Complex]:
        """Return the modelled transforms by manoeuvre, shape (k, M) each, per square root of duration."""
        return self._modelled(free)

    def residuals(self, free: Array) -> list[Complex]:
        """Return measured less modelled transforms by manoeuvre, likewise."""
        return [z - y for z, y in zip(self._z, self._modelled(free), strict=True)]

    def _modelled(self, free: Array) -> list[Complex]:
        vectors = self.parameters.vectors(free)
        return [
            np.asarray(self._responses(v, *given)) / np.sqrt(s.dt * s.samples)
            for v, given, s in zip(vectors, self._given, self.signals, strict=True)
        ]

    def _linear(self, free: Array) -> tuple[list[Complex], list[Complex]]:
        residual, along = [], []
        for i, vector in enumerate(self.parameters.vectors(free)):
            y, dy = (np.asarray(v) for v in self._both(vector, *self._given[i]))
            size = np.sqrt(self.signals[i].dt * self.signals[i].samples)
            residual.append(self._z[i] - y / size)
            along.append(dy / size @ self._spreads[i])
        return residual, along

    def _power(self, residual: list[Complex]) -> Array:
        return np.sum([(np.abs(r) ** 2).sum(axis=1) for r in residual], axis=0) / self._lines

    def _cost(self, residual: list[Complex]) -> float:
        power = self._power(residual) + self._floor
        return self._lines * float(np.log(power).sum()) if np.isfinite(power).all() else np.inf

    def _whitened(self, residual: list[Complex], along: list[Complex]) -> tuple[Complex, Complex]:
        """Return residual and derivatives, shape (E,) and (f, E); each equation is of unit power."""
        size = np.sqrt(self._power(residual) + self._floor)
        white = np.concatenate([(r / size[:, None]).ravel() for r in residual])
        columns = np.concatenate(
            [(a / size[:, None, None]).reshape(-1, a.shape[-1]).T for a in along], axis=1
        )
        return white, columns

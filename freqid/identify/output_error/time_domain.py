"""Output error in the time domain: noise in the outputs alone, its covariance estimated along."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.identify.output_error.minimise import Point
from freqid.identify.output_error.model import DynamicModel, Signals
from freqid.identify.output_error.parameters import ParameterSet
from freqid.identify.output_error.simulation import compiled

NoiseKind = Literal["diagonal", "full"]
EXACT = 1e-6
"""No output is believed to be measured better than this share of its rms: simulations without noise."""


class TimeDomain:
    """The likelihood of outputs in time.

    ``J = N / 2 ln det R(theta)`` with R the covariance of measured less simulated, diagonal or full: the
    negative logarithm of the likelihood with R at its own estimate (Klein & Morelli, 2nd ed., ch. 6).
    """

    method = "output-error"

    def __init__(
        self, model: DynamicModel, signals: Sequence[Signals], parameters: ParameterSet, noise: NoiseKind
    ) -> None:
        self.model, self.signals, self.parameters = model, tuple(signals), parameters
        self.noise: NoiseKind = noise
        longest = max(s.samples for s in signals)
        self._u = np.stack([padded(s.input_matrix(model), longest) for s in signals])
        self._z = np.stack([padded(s.output_matrix(model), longest) for s in signals])
        self._counts = [s.samples for s in signals]
        self._mask = np.stack([np.arange(longest) < n for n in self._counts])
        self._total = sum(self._counts)
        square = np.where(self._mask[..., None], self._z, 0.0) ** 2
        self._floor = EXACT**2 * square.sum(axis=(0, 1)) / self._total + np.finfo(float).tiny
        self._simulate, self._sensitivities = compiled(model)
        self._spreads = parameters.spreads()

    def with_parameters(self, parameters: ParameterSet) -> TimeDomain:
        """Return the same likelihood of other unknowns."""
        return TimeDomain(self.model, self.signals, parameters, self.noise)

    def cost(self, free: Array) -> float:
        """Return the negative log-likelihood; infinite where the model diverges."""
        return self._cost(self._residual(self._outputs(free)))

    def linearise(self, free: Array) -> Point:
        """Return cost, gradient and Fisher information."""
        residual, along = self._linear(free)
        cost = self._cost(residual)
        if not np.isfinite(cost) or not np.isfinite(along).all():
            none = np.zeros(free.size)
            return Point(np.inf, none, np.diag(none))
        white, columns = self._whitened(residual, along)
        return Point(cost, -columns @ white, columns @ columns.T)

    def noise_covariance(self, free: Array) -> Array:
        """Return R, shape (k, k), corrected for the parameters that were fitted."""
        residual = self._residual(self._outputs(free))
        taken = free.size / residual.shape[-1]
        r = self._covariance(residual) * self._total / max(self._total - taken, 1.0)
        return np.diag(np.diag(r)) if self.noise == "diagonal" else r

    def white_equations(self, free: Array) -> tuple[Array, Array, list[int]]:
        """Return residual and columns in units of the noise, with the samples of each stretch.

        Returns
        -------
        residual : ndarray, shape (E,)
            One output of one manoeuvre after another.
        columns : ndarray, shape (f, E)
        samples : list of int
        """
        residual, along = self._linear(free)
        k = residual.shape[-1]
        white, columns = self._whitened(residual, along)
        order = self._by_output(k)
        return white[order], columns[:, order], [n for n in self._counts for _ in range(k)]

    def outputs(self, free: Array) -> list[Array]:
        """Return the simulated outputs by manoeuvre, shape (N, k) each."""
        return [y[:n] for y, n in zip(self._outputs(free), self._counts, strict=True)]

    def residuals(self, free: Array) -> list[Array]:
        """Return measured less modelled by manoeuvre, shape (N, k) each."""
        return [z[:n] - y for z, y, n in zip(self._z, self.outputs(free), self._counts, strict=True)]

    def _outputs(self, free: Array) -> Array:
        return np.asarray(self._simulate(self.parameters.vectors(free), self._u, self.signals[0].dt))

    def _linear(self, free: Array) -> tuple[Array, Array]:
        y, along = self._sensitivities(self.parameters.vectors(free), self._u, self.signals[0].dt)
        with np.errstate(over="ignore", invalid="ignore"):  # of a model that diverges: the cost says so
            along = np.einsum("inkv,ivf->inkf", np.asarray(along), self._spreads, optimize=True)
        return self._residual(np.asarray(y)), along

    def _residual(self, y: Array) -> Array:
        return np.where(self._mask[..., None], self._z - y, 0.0)

    def _covariance(self, residual: Array) -> Array:
        flat = residual.reshape(-1, residual.shape[-1])
        return flat.T @ flat / self._total

    def _cost(self, residual: Array) -> float:
        if not np.isfinite(residual).all():
            return np.inf
        with np.errstate(over="ignore", invalid="ignore"):
            r = self._covariance(residual) + np.diag(self._floor)
            if not np.isfinite(r).all():
                return np.inf
            if self.noise == "diagonal":
                return 0.5 * self._total * float(np.log(np.diag(r)).sum())
            sign, logarithm = np.linalg.slogdet(r)
        return 0.5 * self._total * float(logarithm) if sign > 0 else np.inf

    def _whitened(self, residual: Array, along: Array) -> tuple[Array, Array]:
        """Return residual and derivatives in units of the noise, shape (E,) and (f, E)."""
        r = self._covariance(residual) + np.diag(self._floor)
        if self.noise == "diagonal":
            weight = np.diag(1 / np.sqrt(np.diag(r)))
        else:
            weight = np.linalg.inv(np.linalg.cholesky(r))
        used = self._mask.ravel()
        flat = residual.reshape(used.size, -1)[used] @ weight.T
        columns = np.einsum(
            "lk,nkf->fnl", weight, along.reshape(used.size, *along.shape[2:])[used], optimize=True
        )
        return flat.ravel(), columns.reshape(along.shape[-1], -1)

    def _by_output(self, k: int) -> np.ndarray:
        """Return the order that puts a manoeuvre's outputs one after another."""
        index = np.arange(self._total * k).reshape(self._total, k)
        parts = np.split(index, np.cumsum(self._counts)[:-1])
        return np.concatenate([part.T.ravel() for part in parts])


def padded(values: Array, samples: int) -> Array:
    """Return a history of so many samples, its last one held."""
    return np.concatenate((values, np.repeat(values[-1:], samples - len(values), axis=0)))

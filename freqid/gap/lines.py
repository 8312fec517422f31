"""The frequency lines on which a manoeuvre is compared, and which injected signal owns which."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord
from freqid.gap.histories import Histories
from freqid.identify.fourier import FourierPlan, harmonics
from freqid.identify.line_equations import plan_of
from freqid.identify.trend import remove_trend, trend_columns

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Of the strongest line of an injected signal: what is weaker is the transform's leakage, not an injection.
EXCITED = 1e-2
MOST_LINES = 400


@dataclass(frozen=True, eq=False)
class Lines:
    """Where one manoeuvre is compared.

    Attributes
    ----------
    hz : ndarray, shape (line,)
        Multiples of 1/T, T the manoeuvre's duration.
    dt : float
        s.
    samples : int
    inputs : tuple of str
        Injected signals.
    owner : ndarray of int, shape (line,)
        Index of the injected signal that drives the line; -1 where none does.
    """

    hz: Array
    dt: float
    samples: int
    inputs: tuple[str, ...]
    owner: NDArray[np.intp]

    @property
    def excited(self) -> NDArray[np.bool_]:
        """Whether a line is driven, shape (line,); all of them where nothing was injected."""
        driven = self.owner >= 0
        return driven if driven.any() else np.ones_like(driven)

    @property
    def plan(self) -> FourierPlan:
        """The transform."""
        return plan_of(self.samples, self.dt, tuple(self.hz))

    def spectrum(self, values: Array) -> Complex:
        """Return transforms of signals about their straight lines, shape (..., line), unit times sqrt(s)."""
        flat = remove_trend(values.reshape(-1, self.samples), self.dt, "line").x
        return self._scaled(self.plan(flat), values.shape)

    def transform(self, histories: Histories) -> Complex:
        """Return rows on the lines, shape (row, line), unit of the row times sqrt(s).

        Their squares are power spectral densities of both signs; what trends and end samples do is taken out.
        """
        z = self.plan(remove_trend(histories.direct, self.dt, "line").x)
        changing = histories.momentum.any(axis=1)
        if changing.any():
            ends = remove_trend(histories.momentum[changing], self.dt, "endpoints").x
            z[changing] += self.plan.derivative(ends)
        z = self._scaled(z, z.shape)
        stacked = np.concatenate([z.real, z.imag], axis=1)
        basis = _nuisance(self.samples, self.dt, tuple(self.hz))
        stacked -= (stacked @ basis) @ basis.T
        half = self.hz.size
        return stacked[:, :half] + 1j * stacked[:, half:]

    @property
    def taken_out(self) -> Complex:
        """What `transform` leaves nothing of, orthonormal with real coefficients, shape (column, line)."""
        basis = _nuisance(self.samples, self.dt, tuple(self.hz)).T
        return basis[:, : self.hz.size] + 1j * basis[:, self.hz.size :]

    def _scaled(self, z: Complex, shape: tuple[int, ...]) -> Complex:
        return z.reshape(*shape[:-1], self.hz.size) / np.sqrt(self.dt * (self.samples - 1))


def lines_of(record: FlightRecord, band_hz: tuple[float, float]) -> Lines:
    """Return the lines of a record in a band, thinned evenly where there are more than `MOST_LINES`.

    Parameters
    ----------
    record : FlightRecord
        ``excitation/*`` are its injected signals.
    band_hz : tuple of 2 floats
        Hz.
    """
    low = max(band_hz[0], 1.5 / record.duration)
    high = min(band_hz[1], 0.4 / record.dt)
    hz = harmonics(record.duration, (low, max(high, 2 * low)))
    inputs = record.group("excitation")
    owner = np.full(hz.size, -1)
    if inputs:
        injected = record.matrix(f"excitation/{name}" for name in inputs)
        plan = FourierPlan(record.time.size, record.dt, hz)
        power = np.abs(plan(remove_trend(injected, record.dt, "mean").x)) ** 2
        power /= np.maximum(power.max(axis=1, keepdims=True), np.finfo(float).tiny)
        driven = power.max(axis=0) > EXCITED
        owner[driven] = power.argmax(axis=0)[driven]
    if hz.size > MOST_LINES:
        driven = np.flatnonzero(owner >= 0)
        rest = np.setdiff1d(np.arange(hz.size), driven)
        spare = max(MOST_LINES - driven.size, MOST_LINES // 4)
        keep = np.union1d(driven[:: max(1, -(-driven.size // MOST_LINES))], rest[:: -(-rest.size // spare)])
        hz, owner = hz[keep], owner[keep]
    return Lines(hz, record.dt, record.time.size, inputs, owner)


@lru_cache(maxsize=32)
def _nuisance(samples: int, dt: float, hz: tuple[float, ...]) -> Array:
    """Return an orthonormal basis of what trends and end samples make, shape (2 line, column)."""
    plan = plan_of(samples, dt, hz)
    columns = np.concatenate([trend_columns(plan.frequencies_hz, plan.duration), plan.nuisance()])
    stacked = np.concatenate([columns.real, columns.imag], axis=1)
    stacked /= np.linalg.norm(stacked, axis=1, keepdims=True)
    left, size, _ = np.linalg.svd(stacked.T, full_matrices=False)
    return left[:, size > 1e-9 * size[0]]

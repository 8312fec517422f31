"""The lines of frequency on which one manoeuvre is compared: all multiples of 1/T from zero on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.record import FlightRecord
from freqid.gap.settings import MOST_LINES
from freqid.gap.stack.histories import Histories
from freqid.identify.model.line_equations import plan_of
from freqid.identify.spectra.fourier import FourierPlan

# Of the strongest line of an injected signal: what is weaker is the transform's leakage, not an injection.
EXCITED = 1e-2
_END_S = 0.4  # s at either end over which a polynomial gives the end value of a measured signal
_END_ORDER = 5  # of that polynomial: at 2 Hz it misses less than 1 per cent, a parabola would miss 60
_FEWEST = 5  # its samples
_SAMPLES = 12  # of the motion without noise in one period of the fastest line
_MARGIN_S = 0.5  # s, the largest delay of a channel that is looked for
_MARGIN = 0.025  # ... at most, of the record


@dataclass(frozen=True, eq=False)
class Lines:
    """Where one manoeuvre is compared.

    Attributes
    ----------
    hz : ndarray, shape (line,)
        Multiples of 1/T from zero, T the duration of what is compared.
    dt : float
        s.
    samples : int
        Of the manoeuvre.
    inputs : tuple of str
        Injected signals.
    owner : ndarray of int, shape (line,)
        Index of the injected signal that drives the line; -1 where none does.
    margin : int
        Samples at either end that are computed and not compared.
    """

    hz: Array
    dt: float
    samples: int
    inputs: tuple[str, ...]
    owner: NDArray[np.intp]
    margin: int = 0

    @property
    def compared(self) -> int:
        """Samples that are compared."""
        return self.samples - 2 * self.margin

    @property
    def duration(self) -> float:
        """T, s, of what is compared."""
        return self.dt * (self.compared - 1)

    @property
    def driven(self) -> NDArray[np.bool_]:
        """Whether an injected signal drives the line, shape (line,)."""
        return self.owner >= 0

    @cached_property
    def _plan(self) -> FourierPlan:
        return plan_of(self.compared, self.dt, tuple(self.hz[1:]))

    def _inside(self, values: Array) -> Array:
        return values[..., self.margin : values.shape[-1] - self.margin]

    def thinned(self, every: int) -> Lines:
        """Return the same lines for signals of which one sample in so many is kept."""
        samples = (self.samples - 1) // every + 1
        return replace(self, samples=samples, dt=self.dt * every, margin=self.margin // every)

    def spectrum(self, values: Array) -> Complex:
        """Return transforms of signals, shape (..., sample) to (..., line), unit times sqrt(s).

        Their squares are power spectral densities of both signs; the zero line is the mean times sqrt(T).
        """
        values = self._inside(values)
        flat = values.reshape(-1, self.compared)
        mean = _mean(flat)
        change = (flat[:, -1] - flat[:, 0])[:, None] / self.duration
        # a straight line is taken out and its transform put back: the end corrections then have nothing to do
        time = self.dt * np.arange(self.compared)
        smooth = flat - mean[:, None] - change * (time - self.duration / 2)
        z = np.empty((len(flat), self.hz.size), dtype=complex)
        z[:, 0] = mean * self.duration
        omega = 2 * np.pi * self.hz[1:]
        z[:, 1:] = self._plan(smooth) + change * 1j * self.duration / omega
        return (z / np.sqrt(self.duration)).reshape(*values.shape[:-1], self.hz.size)

    def transform(self, histories: Histories) -> Complex:
        """Return rows on the lines, shape (row, line), unit of the row times sqrt(s).

        ``F[d/dt h] = j 2 pi f H + h(T) - h(0)``; the end values come from polynomials over the first and
        last 0.4 s.
        """
        z = np.zeros((len(histories.direct), self.hz.size), dtype=complex)
        there = histories.direct.any(axis=1)
        z[there] = self.spectrum(histories.direct[there])
        moving = np.flatnonzero(histories.momentum.any(axis=1))
        if moving.size:
            momentum = histories.momentum[moving]
            first, last = self.end_values(self._inside(momentum))
            z[moving] += 2j * np.pi * self.hz * self.spectrum(momentum)
            z[moving] += ((last - first) / np.sqrt(self.duration))[:, None]
        return z

    def end_values(self, values: Array) -> tuple[Array, Array]:
        """Return smoothed first and last values of signals, shape (row, sample) to (row,) each."""
        weights = _end_weights(self._end_samples)
        n = weights.size
        return values[:, :n] @ weights, values[:, ::-1][:, :n] @ weights

    @property
    def _end_samples(self) -> int:
        return int(np.clip(round(_END_S / self.dt) + 1, _FEWEST, self.compared // 2))

    @property
    def end_gain(self) -> float:
        """Standard deviation of an end value of unit white noise."""
        return float(np.linalg.norm(_end_weights(self._end_samples)))

    def real(self, z: Complex) -> Array:
        """Return spectra, shape (..., line), as real numbers, shape (..., number), of the same power each.

        The zero line is real; of all others the real and the imaginary part count, times sqrt(2).
        """
        root = np.sqrt(2)
        return np.concatenate([z[..., :1].real, root * z[..., 1:].real, root * z[..., 1:].imag], axis=-1)

    def complex(self, y: Array) -> Complex:
        """Return the spectra, shape (..., line), from which `real` made y, shape (..., number)."""
        count = self.hz.size
        z = np.zeros((*y.shape[:-1], count), dtype=np.complex128)
        z[..., 0] = y[..., 0]
        z[..., 1:] = (y[..., 1:count] + 1j * y[..., count:]) / np.sqrt(2)
        return z


def lines_of(record: FlightRecord, top_hz: float) -> Lines:
    """Return the lines of a record from zero to the top of a band.

    Lines that nothing drives are thinned evenly where there are more than `MOST_LINES`. Where nothing was
    injected no whole periods have to be kept, and a margin at either end is not compared: there a channel
    that is late has values that were never logged.

    Parameters
    ----------
    record : FlightRecord
        ``excitation/*`` are its injected signals.
    top_hz : float
        Hz; lines from zero up to it.
    """
    top = min(top_hz, 0.4 / record.dt)
    inputs = record.group("excitation")
    samples = record.time.size
    margin = 0 if inputs else int(min(_MARGIN_S, _MARGIN * record.duration) / record.dt)
    margin -= margin % thinning(samples, record.dt, top)
    duration = record.duration - 2 * margin * record.dt
    count = max(int(np.floor(top * duration + 1e-6)), 1)
    hz = np.arange(count + 1) / duration
    owner = np.full(hz.size, -1)
    if inputs:
        injected = record.matrix(f"excitation/{name}" for name in inputs)
        injected = injected - injected.mean(axis=1, keepdims=True)
        power = np.abs(plan_of(samples, record.dt, tuple(hz[1:]))(injected)) ** 2
        power /= np.maximum(power.max(axis=1, keepdims=True), np.finfo(float).tiny)
        power[~injected.any(axis=1)] = 0.0
        driven = power.max(axis=0) > EXCITED
        owner[1:][driven] = power.argmax(axis=0)[driven]
    if hz.size > MOST_LINES:
        driven, rest = np.flatnonzero(owner >= 0), np.flatnonzero(owner < 0)
        spare = max(MOST_LINES - driven.size, MOST_LINES // 4)
        kept = rest[:: -(-rest.size // spare)]
        keep = np.union1d(driven[:: max(1, -(-driven.size // MOST_LINES))], kept)
        hz, owner = hz[keep], owner[keep]
    return Lines(hz, record.dt, samples, inputs, owner, margin)


def thinning(samples: int, dt: float, top_hz: float) -> int:
    """Return how many samples one may stand for: motion without noise is smooth up to `top_hz`, Hz."""
    most = max(int(1 / (_SAMPLES * top_hz * dt)), 1)
    return next(k for k in range(most, 0, -1) if (samples - 1) % k == 0)


def _mean(values: Array) -> Array:
    """Return the mean over the record, the end samples by half, shape (row,)."""
    inner = values.sum(axis=1) - 0.5 * (values[:, 0] + values[:, -1])
    return inner / (values.shape[1] - 1)


@lru_cache(maxsize=8)
def _end_weights(count: int) -> Array:
    """Return weights of the first samples: their polynomial's value at the first one, shape (count,)."""
    columns = np.vander(np.linspace(0, 1, count), min(_END_ORDER + 1, count), increasing=True)
    return np.linalg.pinv(columns)[0]

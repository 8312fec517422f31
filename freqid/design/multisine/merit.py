"""How good a design is, signal by signal and as a set, over a period and before it is finished."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.results.design import MultisineDesign
from freqid.design.multisine.signals import PEAK_POINTS, relative_peak_factor, sample, samples_per_period


@dataclass(frozen=True)
class Merit:
    """How good a design is, signal by signal and as a set.

    Attributes
    ----------
    names : tuple of str
    rpf, rms, peak, slew : ndarray, shape (effector,)
        Relative peak factor; the others in effector units, slew per second, largest magnitudes.
    correlation : ndarray, shape (effector, effector)
        Over one period.
    max_correlation : float
        Largest magnitude between two signals over one period.
    condition_number : float
        Of the matrix of normalised signals over one period, ``U^T U``.
    """

    names: tuple[str, ...]
    rpf: Array
    rms: Array
    peak: Array
    slew: Array
    correlation: Array
    max_correlation: float
    condition_number: float


def merit(design: MultisineDesign) -> Merit:
    """Judge a design on at least 64 points per shortest period."""
    rows = [(s.index, s.amplitude, s.phase) for s in design.signals]
    samples = samples_per_period(np.concatenate([s.index for s in design.signals]), PEAK_POINTS)
    signals = np.array([sample(*row, samples) for row in rows])
    speed = 2 * np.pi / design.period_s
    slew = [np.abs(sample(k, a * k * speed, p + np.pi / 2, samples)).max() for k, a, p in rows]
    correlation = _correlation(signals)
    return Merit(
        names=design.names,
        rpf=np.array([float(relative_peak_factor(*row)) for row in rows]),
        rms=np.sqrt([0.5 * np.sum(a**2) for _, a, _ in rows]),
        peak=np.abs(signals).max(axis=1),
        slew=np.array(slew),
        correlation=correlation,
        max_correlation=_largest_pair(correlation),
        condition_number=float(np.linalg.cond(correlation)),
    )


@dataclass(frozen=True)
class Truncation:
    """What is left of orthogonality while a manoeuvre is not finished.

    Attributes
    ----------
    time : ndarray, shape (time,)
        Length flown, s.
    max_correlation, condition_number : ndarray, shape (time,)
        As in `Merit`, over that length.
    """

    time: Array
    max_correlation: Array
    condition_number: Array


def truncated(design: MultisineDesign, steps: int = 40) -> Truncation:
    """Judge correlation and condition over growing parts of the first period.

    Parameters
    ----------
    design : MultisineDesign
    steps : int
        Lengths judged, evenly from T / `steps` to T.
    """
    samples = samples_per_period(np.concatenate([s.index for s in design.signals]), 16)
    signals = np.array([sample(s.index, s.amplitude, s.phase, samples) for s in design.signals])
    ends = np.linspace(samples / steps, samples, steps).round().astype(int)
    parts = [_correlation(signals[:, :end]) for end in ends]
    return Truncation(
        time=design.period_s * ends / samples,
        max_correlation=np.array([_largest_pair(c) for c in parts]),
        condition_number=np.array([np.linalg.cond(c) for c in parts]),
    )


def _correlation(signals: Array) -> Array:
    norm = np.linalg.norm(signals, axis=1)
    return signals @ signals.T / np.outer(norm, norm)


def _largest_pair(correlation: Array) -> float:
    return float(np.abs(correlation - np.eye(len(correlation))).max()) if len(correlation) > 1 else 0.0

"""What a model's flight misses of a recorded one, on the lines of the injected signals.

A simulation flies a few per cent off the record: its mass, its delays and whatever it lacks see to that.
Every column that is computed on its motion is off by as much. What it misses is a small share of what it has,
and that share changes slowly with frequency: so it takes few numbers, and these hold little of the noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from freqid.core.arrays import Array, Complex
from freqid.core.channels import RATES
from freqid.core.record import FlightRecord
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.sensor_noise import sensor_noise

_ANGLES = ("state/phi", "state/psi")  # that may turn all the way round
_SHARE_ORDER = 3  # highest polynomial, in frequency, of the share that is missed
_RESPONSE_ORDER = 4  # ... in its logarithm, of a response that the model does not have
_NEIGHBOURS = 9  # lines whose power is averaged
_CLEAR = 2.0  # times the noise: what power of neighbouring lines has to be to tell of motion
_SPREADS = (0.0, *np.geomspace(0.1, 1e3, 9).tolist())  # of either, in the noise's size


def share_missed(
    record: FlightRecord, channels: Mapping[str, Array], noise: Mapping[str, float] | None = None
) -> float:
    """Return the share of the rates' changes, noise apart, that is not in what stands for them.

    Parameters
    ----------
    record : FlightRecord
    channels : dict of ndarray, shape (sample,)
        What stands for its channels.
    noise : dict of float, optional
        The rates' noise, of `noise_of_rates`, where it is at hand.
    """
    named = [n for n in _moving_rates(record) if n in channels]
    if not named:
        return 0.0 if channels else np.inf
    if noise is None:
        noise = sensor_noise(record, named)
    time = record.time - record.time.mean()
    moved = left = 0.0
    for name in named:
        both = (record[name], record[name] - channels[name])
        whole, rest = (float(np.var(x - np.polyval(np.polyfit(time, x, 1), time))) for x in both)
        moved += max(whole - noise[name] ** 2, 0.0)
        left += max(rest - noise[name] ** 2, 0.0)
    return float(np.sqrt(left / max(moved, 1e-300)))


def noise_of_rates(record: FlightRecord) -> dict[str, float]:
    """Return the standard deviation of the rates' white noise, by channel."""
    named = _moving_rates(record)
    return sensor_noise(record, named) if named else {}


def _moving_rates(record: FlightRecord) -> list[str]:
    return [n for n in RATES if n in record and np.ptp(record[n])]


def with_missed(
    record: FlightRecord, own: Mapping[str, Array], lines: Lines, *, fitted: bool = False
) -> dict[str, Array]:
    """Return channels with what they miss of a record.

    On the lines of one injected signal e a channel of the record is ``(1 + a) x + b e``, with x the model's,
    a and b complex polynomials in frequency: b is what couples there and not in the model. Each line is
    corrected by what the others say, and the prior spreads of a and b are those by which the others say most
    (PRESS: D. M. Allen, Technometrics 16, 1974); where nothing but noise is missed these are zero. Below the
    slowest line that is driven there is only what a start out of trim leaves: as much of that is taken as
    stands out of the noise.

    Parameters
    ----------
    record : FlightRecord
    own : dict of ndarray, shape (sample,)
        The model's, by channel.
    lines : Lines
    fitted : bool
        Whether the model is fitted to the record. It starts then as the record does, and couples as it does:
        only shares are taken, nothing slow and no b.

    Returns
    -------
    dict of ndarray, shape (sample,)
    """
    names = [n for n in own if n in record]
    if not names or not lines.driven.any():
        return dict(own)
    modelled, rest = parted(record, own, names)
    x, y = lines.spectrum(modelled), lines.spectrum(rest)
    injected = lines.spectrum(record.matrix(f"excitation/{n}" for n in lines.inputs))
    driven = [(j, np.flatnonzero(lines.owner == j)) for j in range(len(lines.inputs))]
    driven = [(at, injected[j, at]) for j, at in driven if at.size]
    slow = np.arange(1, 1 if fitted else np.flatnonzero(lines.driven)[0])
    missed = np.zeros(y.shape, dtype=complex)
    for i in range(len(names)):
        missed[i], noise = _missed(lines.hz, x[i], y[i], driven, couples=not fitted)
        power = np.abs(y[i, slow]) ** 2
        missed[i, slow] = y[i, slow] * np.maximum(1 - noise / np.maximum(power, 1e-300), 0.0)
    found = modelled + history(missed, lines, record.time.size)
    return dict(own) | dict(zip(names, found, strict=True))


def as_far_as_seen(
    record: FlightRecord, own: Mapping[str, Array], lines: Lines, sigma: Mapping[str, float]
) -> dict[str, Array]:
    """Return channels with what a record says beyond them, as far as it stands out of the noise.

    Where the model flies close to the record, the rest is noise, and it stays the model's; where it does not,
    it is the record's (N. Wiener, Extrapolation, Interpolation, and Smoothing of Stationary Time Series,
    1949, chapter 3, with the power of neighbouring lines).

    Parameters
    ----------
    record : FlightRecord
    own : dict of ndarray, shape (sample,)
        The model's, by channel.
    lines : Lines
    sigma : dict of float
        Standard deviation of white noise by channel; a channel that has none is as it is recorded.

    Returns
    -------
    dict of ndarray, shape (sample,)
    """
    names = [n for n in own if n in record]
    if not names:
        return dict(own)
    noise = lines.dt * np.array([sigma.get(n, 0.0) for n in names])[:, None] ** 2
    modelled, rest = parted(record, own, names)
    y = lines.spectrum(rest)
    for some in (np.flatnonzero(lines.driven), np.flatnonzero(~lines.driven)[1:]):
        if some.size:
            near = min(_NEIGHBOURS, some.size)
            power = uniform_filter1d(np.abs(y[:, some]) ** 2, near, axis=1, mode="nearest")
            y[:, some] *= np.maximum(1 - _CLEAR * noise / np.maximum(power, 1e-300), 0.0)
    y[:, 0] = 0.0  # both stand about the record's level
    found = modelled + history(y, lines, record.time.size)
    return dict(own) | dict(zip(names, found, strict=True))


def parted(record: FlightRecord, own: Mapping[str, Array], names: Sequence[str]) -> tuple[Array, Array]:
    """Return what a model has of some channels, shape (channel, sample), and what the record has beyond."""
    modelled = np.array([own[n] for n in names])
    measured = np.array([np.unwrap(record[n]) if n in _ANGLES else record[n] for n in names])
    return modelled, measured - modelled


def history(spectrum: Complex, lines: Lines, samples: int) -> Array:
    """Return a sum of lines, shape (..., line), over time, shape (..., sample)."""
    wave = np.exp(2j * np.pi * lines.hz[:, None] * (lines.dt * np.arange(samples)))
    return np.asarray(2 / np.sqrt(lines.duration) * np.real(spectrum @ wave), dtype=np.float64)


def _missed(
    hz: Array, x: Complex, y: Complex, driven: list[tuple[NDArray[np.intp], Complex]], *, couples: bool
) -> tuple[Complex, float]:
    """Return the part of y, shape (line,), that changes slowly with frequency, and the power of the rest."""
    size = np.sqrt(np.mean(np.concatenate([np.abs(x[at]) for at, _ in driven]) ** 2))
    missed = np.zeros(y.shape, dtype=np.complex128)
    if not size or not any(y[at].any() for at, _ in driven):
        return missed, 0.0
    half = max(at.size for at, _ in driven)
    number = 2 * half  # signals with fewer lines are filled up with zeros
    shares, responses = np.zeros((2, len(driven), number, number))
    z = np.zeros((len(driven), number))
    for j, (at, sent) in enumerate(driven):
        share = _real(x[at, None] / size * _polynomials(hz[at], _SHARE_ORDER))
        sent = sent / np.sqrt(np.mean(np.abs(sent) ** 2))
        response = _real(sent[:, None] * _polynomials(np.log(hz[at]), _RESPONSE_ORDER))
        used = np.concatenate([np.arange(at.size), half + np.arange(at.size)])
        shares[j][np.ix_(used, used)] = share @ share.T
        responses[j][np.ix_(used, used)] = response @ response.T
        z[j, used] = np.concatenate([y[at].real, y[at].imag])

    def said(spreads: tuple[int, int]) -> Array:
        """Return each line's value as predicted from all other lines, shape (signal, number)."""
        a, b = (_SPREADS[k] ** 2 for k in spreads)
        known = a * shares + b * responses
        return _by_the_others(np.eye(number) - np.linalg.inv(np.eye(number) + known), z)

    def left(spreads: tuple[int, int]) -> float:
        """Return the squared error of that prediction."""
        return float(((z - said(spreads)) ** 2).sum())

    best, known = (0, 0), {(0, 0): left((0, 0))}
    while True:  # one spread after the other, until neither changes
        before = best
        for k in (0, 1) if couples else (0,):
            asked = [(i, best[1]) if k == 0 else (best[0], i) for i in range(len(_SPREADS))]
            known |= {s: left(s) for s in asked if s not in known}
            best = min(asked, key=lambda s: known[s])
        if best == before:
            break
    for (at, _), part in zip(driven, said(best), strict=True):
        missed[at] = part[: at.size] + 1j * part[half : half + at.size]
    return missed, 2 * known[best] / sum(2 * at.size for at, _ in driven)


def _by_the_others(hat: Array, z: Array) -> Array:
    """Return each line as predicted from all others, shape (signal, number): real parts, then imaginary ones.

    The noise of a line is in the residual too. Motion that held any of it would be alike to the residual, and
    most so in what multiplies accelerations: mass and inertia.

    Parameters
    ----------
    hat : ndarray, shape (signal, number, number)
        Linear smoother.
    z : ndarray, shape (signal, number)
    """
    half = z.shape[1] // 2
    pairs = np.arange(half)[:, None] + [0, half]  # of each line
    own = hat[:, pairs[:, :, None], pairs[:, None, :]]
    y, fitted = z[:, pairs, None], (hat @ z[:, :, None])[:, pairs]
    left = np.linalg.solve(np.eye(2) - own, fitted - own @ y)[..., 0]
    return np.asarray(left.swapaxes(1, 2).reshape(z.shape), dtype=np.float64)


def _polynomials(place: Array, order: int) -> Array:
    """Return Chebyshev polynomials over all places, shape (place, order + 1), higher ones smaller."""
    inside = (place - place.min()) / max(np.ptp(place), 1e-12) * 2 - 1
    return chebvander(inside, order) / (1 + np.arange(order + 1))


def _real(columns: Complex) -> Array:
    """Return complex columns, shape (line, column), for real and imaginary weights of each."""
    return np.block([[columns.real, -columns.imag], [columns.imag, columns.real]])

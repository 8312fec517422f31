"""Noise of the rows of one condition: the sensors', sent through the whole pipeline, and what is beyond.

The same antithetic pairs give the mean error of a replay on noisy states, for nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.record import Maneuver
from freqid.gap.settings import PAIRS_OF_DRAWS
from freqid.gap.stack.histories import Histories
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.trial import Trial

_RIDGE = 0.001
"""Of a row's variance: how far rows that share noise are trusted to cancel it."""

_LEAST = 1e-12
"""Of a row's mean power: noise of a row that has none, as of a simulated log without sensors."""

_WIDE = 10  # lines on either side over which correlations of rows are averaged
_NARROW = 2  # ... and their power, which goes with the square of frequency
_QUIETER, _LOUDER = 0.5, 1e6  # ratios of flown noise to the sensors' own that are believed
_ENOUGH = 60  # numbers from which a ratio is told as a function of frequency
_ROUNDS = 60  # of the search for the flown covariance, by when it has settled


@dataclass(frozen=True, eq=False)
class Draws:
    """What antithetic pairs of the sensors' noise make of the rows.

    Attributes
    ----------
    odd : ndarray of complex, shape (pair, row, line)
        Half the difference of a pair: noise.
    bias : ndarray of complex, shape (row, line)
        Mean of the replay's error on noisy states.
    bias_error : ndarray, shape (row, line)
        Its standard deviation.
    """

    odd: Complex
    bias: Complex
    bias_error: Array


def antithetic(trial: Trial, lines: Lines, sigma: dict[str, float], seed: int) -> Draws:
    """Return what the sensors' noise makes of a residual, in pairs of opposite sign.

    Parameters
    ----------
    trial : Trial
        Of the motion without noise.
    lines : Lines
    sigma : dict of float
        Standard deviation of white noise by channel, as the record shows it.
    seed : int
    """
    record = trial.maneuver.record
    base = lines.transform(trial.residual)
    odd, even = [], []
    for pair in range(PAIRS_OF_DRAWS):
        rng = np.random.default_rng([seed, pair])
        noise = {n: s * rng.standard_normal(record.time.size) for n, s in sigma.items()}
        plus, minus = (lines.transform(trial.with_noise(noise, sign)) for sign in (1.0, -1.0))
        odd.append((plus - minus) / 2)
        even.append((plus + minus) / 2 - base)
    even = np.array(even)
    return Draws(np.array(odd), even.mean(axis=0), even.std(axis=0) / np.sqrt(PAIRS_OF_DRAWS - 1))


def covariance_of(draws: Draws, scale: Array, least: Array) -> Complex:
    """Return the noise covariance of rows, shape (line, row, row), power spectral density of both signs.

    Parameters
    ----------
    draws : Draws
    scale : ndarray, shape (row, line)
        Flown power over the sensors' own.
    least : ndarray, shape (row,)
        Power below which no row's noise is believed to be.
    """
    power = np.maximum(sensor_power(draws).T, least)  # (line, row)
    white = draws.odd / np.sqrt(power.T)
    correlation = _averaged(np.einsum("kil,kjl->lij", white, white.conj()) / len(white), _WIDE)
    size = np.sqrt(np.maximum(np.einsum("lii->li", correlation).real, 1e-12))
    correlation = correlation / (size[:, :, None] * size[:, None, :])
    at = np.arange(power.shape[1])
    correlation[:, at, at] = 1.0  # of a row without noise too
    correlation[0] = correlation[0].real  # as the zero line is, whatever lines beside it say
    more = power * (np.clip(scale.T, _QUIETER, _LOUDER) - 1)
    quieter = power + np.minimum(more, 0.0)  # than the sensors say: rows and correlations alike
    root = np.sqrt(quieter)
    covariance = correlation * root[:, :, None] * root[:, None, :]
    diagonal = np.maximum(more, 0.0) + _RIDGE * quieter + draws.bias_error.T**2
    return covariance + diagonal[:, :, None] * np.eye(power.shape[1])


def flown_covariance(sensors: Complex, apart: Complex) -> Complex:
    """Return the noise covariance of rows as repeats of a manoeuvre differ, shape (line, row, row).

    A multiple of the sensors' own, and what each row has beside it by itself: the likeliest, by a
    minorisation of the likelihood (H. Zhou and others, "MM algorithms for variance components models",
    Journal of Computational and Graphical Statistics 28, 2019). Rows share the noise of accelerometers and
    gyros, and what is left of one once the others are known is a hundredth of its power. So the excess has to
    be judged by all rows together: a row's own power tells it to a tenth.

    Parameters
    ----------
    sensors : ndarray of complex, shape (line, row, row)
        Of one record's sensors, as `covariance_of` has it.
    apart : ndarray of complex, shape (difference, row, line)
        Differences between the records, each with the noise of one.
    """
    power = np.einsum("lii->li", sensors).real
    seen = np.einsum("kil,kjl->lij", apart, apart.conj()) / len(apart)
    weight = np.ones((len(power), 1))
    weight[0] = 0.5  # the zero line is real
    excess, multiple, one = np.full(power.shape[1], 0.02), 1.0, np.eye(power.shape[1])
    for _ in range(_ROUNDS):
        precision = np.linalg.inv(multiple * sensors + (excess * power)[:, :, None] * one)
        asked = precision @ seen @ precision
        own = [(weight * power * np.einsum("lii->li", z).real).sum(axis=0) for z in (asked, precision)]
        every = [(weight[:, 0] * np.einsum("lij,lji->l", z, sensors).real).sum() for z in (asked, precision)]
        excess = excess * np.sqrt(own[0] / own[1])
        multiple *= np.sqrt(every[0] / every[1])
    return multiple * sensors + (excess * power)[:, :, None] * one


def sensor_power(draws: Draws) -> Array:
    """Return the power of the sensors' noise, shape (row, line)."""
    return _averaged(np.mean(np.abs(draws.odd) ** 2, axis=0).T, _NARROW).T


def least_power(trial: Trial, lines: Lines) -> Array:
    """Return the smallest noise power that is assumed for each row, shape (row,)."""
    z = lines.transform(trial.measured)[:, 1:]
    return _LEAST * np.mean(np.abs(z) ** 2, axis=1) + np.finfo(float).tiny ** 0.5


def whitening_of(covariance: Complex) -> Complex:
    """Return W with ``W covariance W^H = 1``, lower triangular, shape (line, row, row)."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=np.complex128)


def smooth_ratio(hz: Array, power: Array, freedom: Array) -> Array:
    """Return power ratios as smooth functions of frequency, shape (row, line).

    A parabola in log frequency, by iterated least squares for numbers that scatter as they are large
    (a gamma regression with logarithmic link: McCullagh & Nelder, Generalized Linear Models, 2nd ed., ch. 8).
    It is held beyond the lines that have half of their freedom.

    Parameters
    ----------
    hz : ndarray, shape (line,)
    power : ndarray, shape (row, line)
        Whose mean is the ratio times the freedom.
    freedom : ndarray, shape (row, line) or (line,)
        Share of a line's two numbers that tell of the ratio, zero to one. With few in all, the parabola is a
        constant.
    """
    freedom = np.broadcast_to(freedom, power.shape)
    at = np.maximum(hz, hz[1])
    x = np.log(at / np.sqrt(at[1] * at[-1]))
    return np.array([_smooth_ratio(x, p, f) for p, f in zip(power, freedom, strict=True)])


def _smooth_ratio(x: Array, power: Array, freedom: Array) -> Array:
    """Return one row of `smooth_ratio` at log frequencies x."""
    whole = max(freedom.sum(), np.finfo(float).tiny)
    columns = np.stack([np.ones_like(x), x, x**2])[: 3 if 2 * whole > _ENOUGH else 1]
    inverse = np.linalg.pinv((columns * freedom) @ columns.T)
    found = np.zeros(len(columns))
    found[0] = np.log(max((power * (freedom > 0)).sum() / whole, 1e-12))
    for _ in range(30):
        beyond = power * (freedom > 0) * np.exp(-found @ columns) - freedom
        step = inverse @ (columns @ np.clip(beyond, -freedom, 3 * freedom))
        found += step
        if np.abs(step).max() < 1e-3:
            break
    clear = freedom >= min(0.5, freedom.max())
    inside = np.clip(x, x[clear].min(), x[clear].max())
    columns = np.stack([np.ones_like(x), inside, inside**2])[: len(columns)]
    return np.exp(np.clip(found @ columns, -20, 20))


def beyond_motion(
    maneuver: Maneuver, lines: Lines, like: Histories, residual: Complex, power: Array
) -> tuple[Array, Array]:
    """Return power that no linear response to the motion explains: noise of a record without repeats.

    Motion is strong on some lines, slow motion on the first few: there it takes most of the noise away too.
    So each line has a freedom of its own.

    Parameters
    ----------
    maneuver : Maneuver
        Without noise.
    lines : Lines
    like : Histories
        The rows.
    residual : ndarray of complex, shape (row, line)
    power : ndarray, shape (row, line)
        Of the sensors' noise.

    Returns
    -------
    left : ndarray, shape (row, line)
        Over the sensors' noise.
    freedom : ndarray, shape (row, line)
        Share of a line's degrees of freedom that is left.
    """
    record = maneuver.record
    omega = 2j * np.pi * lines.hz

    def spectra(names: list[str]) -> Complex:
        have = [n for n in names if n in record and np.ptp(record[n]) > 0]
        return lines.spectrum(record.matrix(have)) if have else np.empty((0, lines.hz.size), dtype=complex)

    motion = spectra([f"state/{n}" for n in "uvwpqr"])
    if "state/u" not in record:
        motion = np.concatenate([motion, spectra(["air/V", "air/alpha", "air/beta"])])
    effectors = spectra([f"effector/{n}" for n in record.group("effector")])
    attitude = spectra(["state/phi", "state/theta"])
    mean = (lines.hz == 0).astype(complex)
    ends = np.stack(
        [np.ones_like(omega), np.divide(1, omega, out=np.zeros_like(omega), where=omega != 0), mean]
    )
    left, freedom = np.empty(residual.shape), np.empty(residual.shape)
    for i, row in enumerate(like.rows):
        if row.kind == "actuator":
            name = row.name.partition("/")[2]
            both = np.concatenate([spectra([f"command/{name}"]), spectra([f"effector/{name}"])])
            columns = np.concatenate([both, omega * both, omega**2 * both])
        elif row.kind == "kinematic":
            columns = np.concatenate([motion, attitude])
        else:
            columns = np.concatenate([motion, effectors, omega * motion, omega * effectors])
        every = np.asarray(np.concatenate([ends, columns]), dtype=np.complex128)
        root = np.sqrt(power[i])
        left[i], freedom[i] = _left(lines, residual[i] / root, every / root)
    return left, freedom


def _left(lines: Lines, row: Complex, columns: Complex) -> tuple[Array, Array]:
    """Return the power of a row beyond columns with real coefficients, and what share of each line is left.

    At most half of the equations go to columns: the strongest directions among them.
    """
    y, x = lines.real(row), lines.real(columns)
    x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
    _, size, basis = np.linalg.svd(x, full_matrices=False)
    basis = basis[: min(int((size > 1e-6 * size[0]).sum()), x.shape[1] // 2)]
    y = y - (y @ basis.T) @ basis
    count = lines.hz.size

    def by_line(numbers: Array) -> Array:
        return np.concatenate([numbers[:1], 0.5 * (numbers[1:count] + numbers[count:])])

    return by_line(y**2), np.clip(1 - by_line((basis**2).sum(axis=0)), 0.0, 1.0)


def _averaged(values: NDArray, half_width: int) -> NDArray:
    """Return values on lines, the first axis, averaged over their neighbours; fewer at the slow end."""
    count = len(values)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    width = np.minimum(half_width, np.maximum(np.arange(count) // 2, 1)) if half_width < 5 else half_width
    low = np.maximum(np.arange(count) - width, 0)
    high = np.minimum(np.arange(count) + width + 1, count)
    return (total[high] - total[low]) / (high - low).reshape(-1, *[1] * (values.ndim - 1))

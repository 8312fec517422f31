"""How much of a residual noise alone would make: the sensors' own, and what no motion explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import STATE
from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.lines import Lines
from freqid.gap.residual import Histories, measured_part
from freqid.gap.simulation import Simulation
from freqid.identify.smoothing import Smoothed, smooth

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LEAST = 1e-12  # of a row's power
HALF_WIDTH = 10
"""Lines on either side of one whose noise is averaged with it."""

_MOST = 1e4  # power ratio of the flown noise to the sensors' own
_ALIKE = 0.5  # of a rate's motion, that the simulation's own flight may miss and still stand in for it
_NO_NOISE = 1e-3  # Hz: cutoff of a channel in which no noise is left
_PLAIN = 1.4  # mean ratio from which noise is plainly more than the sensors'
_HEARD = 2.0  # power ratio of a channel to the noise left in it from which others' dependence on it is told
_MOVING = 30.0  # power ratio of a channel to its noise from which it moves at all
_RIDGE = 0.01  # of a row's variance: how far rows that share noise are trusted to cancel it
_LINES_OF_FLOOR = 100
_SLOW = 0.9  # of the record's rate: a sensor below it was joined by straight lines
_FEWEST = 8  # samples that a smoothing takes
_MOTION = ("u", "v", "w", "p", "q", "r")
_FELT = ("ax", "ay", "az")
_ATTITUDE = ("phi", "theta", "psi")


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of the rows of one manoeuvre.

    Attributes
    ----------
    covariance : ndarray of complex, shape (line, row, row)
        Power spectral density of both signs, units of the rows squared times s.
    whitening : ndarray of complex, shape (line, row, row)
        W with ``W covariance W^H = 1``, lower triangular.
    sensor_share : ndarray, shape (row, line)
        Of the sensors' own noise in the whole; below one where turbulence or anything else is left.
    """

    covariance: Complex
    whitening: Complex
    sensor_share: Array

    def white(self, z: Complex) -> Array:
        """Return rows on lines, shape (..., row, line), as independent real numbers of variance one.

        Returns
        -------
        ndarray, shape (..., 2 row line)
        """
        found = np.einsum("lij,...jl->...il", self.whitening, z) * np.sqrt(2)
        flat = found.reshape(*found.shape[:-2], z.shape[-2] * z.shape[-1])  # of no rows too
        return np.concatenate([flat.real, flat.imag], axis=-1)


@dataclass(frozen=True, eq=False)
class Quiet:
    """A record whose channels are parted into motion and white noise.

    Attributes
    ----------
    record : FlightRecord
        Motion alone, as far as it stands out of the noise.
    sigma : dict of float
        Standard deviation of the noise by channel.
    cutoff_hz : dict of float
        Frequency from which on noise is the stronger, by channel.
    """

    record: FlightRecord
    sigma: dict[str, float]
    cutoff_hz: dict[str, float]


def quiet(
    record: FlightRecord,
    names: Sequence[str],
    expected: Mapping[str, Array] | None = None,
    flown: Mapping[str, Array] | None = None,
) -> Quiet:
    """Return a record without the noise of some channels.

    Signatures are computed from it: what noise would put into them is in the residual too, and would pass
    for an effect.

    Parameters
    ----------
    record : FlightRecord
    names : sequence of str
    expected : dict of ndarray, optional
        Histories without noise that some channels should be close to; only what they differ by is smoothed,
        and of noise within the band next to nothing stays.
    flown : dict of ndarray, optional
        The simulation's own flight of the same inputs, by channel: what stands in for the log where the two
        are close, but for a straight line. Neither noise nor gusts are in it.
    """
    names, expected = list(names), expected or {}
    values = record.matrix(names)
    base = np.zeros_like(values)
    for i, name in enumerate(names):
        if name in ("state/phi", "state/psi"):
            values[i] = np.unwrap(values[i])
        base[i] = expected.get(name, base[i])
    rates = [record.channel(n).native_rate_hz for n in names]
    found = _smoothed(values - base, record.dt, rates)
    kept, cutoff = base + found.x, found.cutoff_hz.copy()
    for i, own in _standing_in(record, names, values, flown or {}).items():
        kept[i], cutoff[i] = own, _NO_NOISE
    channels = [replace(record.channel(n), values=x) for n, x in zip(names, kept, strict=True)]
    floor = [
        _floor(x, rate, record.dt, c)
        for x, rate, c in zip(values - kept, rates, found.cutoff_hz, strict=True)
    ]
    sigma = [f if f is not None else s for f, s in zip(floor, found.noise_std.tolist(), strict=True)]
    return Quiet(
        record.with_channels(*channels),
        dict(zip(names, sigma, strict=True)),
        dict(zip(names, cutoff.tolist(), strict=True)),
    )


def _standing_in(
    record: FlightRecord, names: Sequence[str], values: Array, flown: Mapping[str, Array]
) -> dict[int, Array]:
    """Return what stands in for rows of values, by row; nothing where the flights are not alike."""
    time = record.time - record.time.mean()
    found: dict[int, Array] = {}
    for i, name in enumerate(names):
        if name not in flown:
            continue
        own = np.unwrap(flown[name]) if name in ("state/phi", "state/psi") else flown[name]
        found[i] = own + np.polyval(np.polyfit(time, values[i] - own, 1), time)
        line = np.polyval(np.polyfit(time, values[i], 1), time)
        rates = name.rpartition("/")[2] in ("p", "q", "r")
        if rates and np.std(values[i] - found[i]) > _ALIKE * np.std(values[i] - line):
            return {}
    return found


def _smoothed(values: Array, dt: float, rates: Sequence[float]) -> Smoothed:
    """Return channels parted into motion and noise, those of slow sensors by the samples that they took.

    Joined by straight lines their noise falls with frequency as motion does, and would pass for it.
    """
    found = smooth(values, dt)
    parts = [found.x, found.derivative, found.noise_std, found.cutoff_hz]
    for i in (i for i, rate in enumerate(rates) if rate * dt < _SLOW):
        time = dt * np.arange(values.shape[1])
        taken = np.interp(np.arange(0, time[-1], 1 / rates[i]), time, values[i])
        if taken.size >= _FEWEST:
            cutoff = float(smooth(taken[None], 1 / rates[i]).cutoff_hz[0])
            own = smooth(values[i : i + 1], dt, cutoff)
            for part, value in zip(parts, (own.x, own.derivative, own.noise_std, own.cutoff_hz), strict=True):
                part[i] = value[0]
    return found


def _floor(left: Array, native_hz: float, dt: float, cutoff_hz: float) -> float | None:
    """Return the standard deviation of white noise as strong as what is well above a cutoff.

    Beyond it a slow sensor's samples, joined by straight lines, hold less; below it there is motion. None
    where too few lines are in between.
    """
    power = np.abs(np.fft.rfft(left - left.mean())) ** 2 / left.size
    hz = np.fft.rfftfreq(left.size, dt)
    top = 0.4 * min(native_hz, 1 / dt)
    if native_hz * dt < _SLOW:
        # what straight lines between samples leave of noise
        power = power / np.maximum(np.sinc(hz / native_hz) ** 4, 0.1)
    between = (hz > 2 * cutoff_hz) & (hz < top)
    return float(np.sqrt(power[between].mean())) if between.sum() >= _LINES_OF_FLOOR else None


def sensor_noise(record: FlightRecord, names: Sequence[str]) -> dict[str, float]:
    """Return the standard deviation of white noise of channels, by name: what their spectra level off at."""
    return quiet(record, names).sigma


def noisy_channels(record: FlightRecord) -> list[str]:
    """Return the measured channels that a residual may depend on."""
    states = [f"state/{n}" for n in (*_MOTION, *_FELT, *_ATTITUDE)]
    air = [f"air/{n}" for n in ("V", "alpha", "beta")]
    given = [f"{group}/{n}" for group in ("effector", "response") for n in record.group(group)]
    return [n for n in (*states, *air) if n in record] + given


def draws(
    simulation: Simulation,
    maneuver: Maneuver,
    lines: Lines,
    like: Histories,
    predicted: Array,
    sigma: dict[str, float],
    count: int,
    seed: int,
) -> tuple[Complex, Complex]:
    """Return residuals that sensor noise alone makes, through the very steps of the residual.

    Parameters
    ----------
    simulation : Simulation
    maneuver : Maneuver
        Noise is added to what was flown, and the difference taken.
    lines : Lines
    like : Histories
        Measured part of the manoeuvre.
    predicted : ndarray, shape (response, sample)
        By the simulation on it.
    sigma : dict of float
        Standard deviation by channel.
    count : int
    seed : int

    Returns
    -------
    made : ndarray of complex, shape (count, row, line)
        Residuals.
    noise : ndarray of complex, shape (count, channel, line)
        What made them, in the channels of `sigma`.
    """
    rng = np.random.default_rng(seed)
    record = maneuver.record
    actuators = [row.name.partition("/")[2] for row in like.rows if row.kind == "actuator"]
    found = np.empty((count, len(like.rows), lines.hz.size), dtype=complex)
    noise = np.empty((count, len(sigma), lines.hz.size), dtype=complex)
    # a log cannot be asked again, but what it was driven through held the sensors' noise
    slopes = simulation.gradient(record, list(sigma)) if simulation.kind == "predictions" else None
    for k in range(count):
        added = {name: size * rng.standard_normal(record.time.size) for name, size in sigma.items()}
        channels = [replace(record.channel(n), values=record[n] + x) for n, x in added.items()]
        noisy = replace(maneuver, record=record.with_channels(*channels))
        change = measured_part(noisy, simulation.responses, actuators) - like
        if slopes is None:
            change.direct[: len(predicted)] -= simulation.predict(noisy.record) - predicted
        else:
            change.direct[: len(predicted)] -= np.einsum("ijt,jt->it", slopes, np.array(list(added.values())))
        found[k] = lines.transform(change)
        noise[k] = lines.spectrum(np.array(list(added.values())))
    return found, noise


def noise_of(
    maneuver: Maneuver,
    lines: Lines,
    like: Histories,
    residual: Complex,
    own: Complex,
    sigma: dict[str, float],
) -> Noise:
    """Return the noise of one manoeuvre's rows.

    Parameters
    ----------
    maneuver : Maneuver
    lines : Lines
    like : Histories
    residual : ndarray of complex, shape (row, line)
    own : ndarray of complex, shape (draw, row, line)
        Of `draws`.
    sigma : dict of float
        Of `sensor_noise`.

    Notes
    -----
    Sensors' noise gives the spectra's form and what rows share. Where more than that is left once the
    residual is regressed on states, their rates and effectors, the row's noise is that much stronger,
    smoothly along frequency. So turbulence, vibration and whatever is not smooth count as noise, and no
    effect that acts through the motion does.
    """
    covariance = _averaged(np.einsum("kil,kjl->lij", own, own.conj()) / len(own))
    left, freedom = _unexplained(maneuver, lines, like, residual, sigma)
    # a row without any noise, as of a simulated log, is trusted to a millionth of what it holds
    least = _LEAST * np.mean(np.abs(lines.transform(like)) ** 2, axis=1) + np.finfo(float).tiny ** 0.5
    covariance = covariance + least[:, None] * np.eye(len(like.rows))
    level = np.einsum("lii->il", covariance).real
    ratio = _smooth_ratio(lines.hz, left / np.maximum(level * freedom[:, None], 1e-300))
    plain = ratio.mean(axis=1, keepdims=True) > _PLAIN
    size = np.sqrt(np.where(plain, np.clip(ratio, 1.0, _MOST), 1.0))
    covariance = covariance * size.T[:, :, None] * size.T[:, None, :]
    diagonal = np.einsum("lii->li", covariance).real
    covariance = covariance + _RIDGE * diagonal[:, :, None] * np.eye(len(like.rows))
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    return Noise(covariance, whitening, 1 / size**2)


def _averaged(values: Complex) -> Complex:
    """Return values on lines, the first axis, averaged over their neighbours."""
    count = len(values)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    low = np.maximum(np.arange(count) - HALF_WIDTH, 0)
    high = np.minimum(np.arange(count) + HALF_WIDTH + 1, count)
    return (total[high] - total[low]) / (high - low).reshape(-1, *[1] * (values.ndim - 1))


def _unexplained(
    maneuver: Maneuver, lines: Lines, like: Histories, residual: Complex, sigma: dict[str, float]
) -> tuple[Array, Array]:
    """Return power that no linear motion explains, (row, line), and the share of freedom left, (row,)."""
    record = maneuver.record
    omega = 2j * np.pi * lines.hz

    def spectra(names: Sequence[str]) -> Complex:
        """Return transforms of channels that move; one at rest would explain its own noise away."""
        have = [n for n in names if n in record]
        z = lines.spectrum(record.matrix(have)) if have else np.empty((0, lines.hz.size), dtype=complex)
        floor = np.array([sigma.get(n, 0.0) ** 2 * record.dt for n in have])
        return z[np.mean(np.abs(z) ** 2, axis=1) > np.maximum(_MOVING * floor, 1e-300)]

    motion = spectra([f"state/{n}" for n in _MOTION])
    effectors = spectra([f"effector/{n}" for n in record.group("effector")])
    if "state/u" not in record:
        motion = np.concatenate([motion, spectra([f"air/{n}" for n in ("V", "alpha", "beta")])])
    attitude = spectra([f"state/{n}" for n in _ATTITUDE])
    columns = {
        "response": np.concatenate([motion, omega * motion, effectors]),
        "kinematic": np.concatenate([motion, attitude, effectors]),
    }
    # a state is the answer to all that its inputs did before: to delays and lags of them too
    late = np.concatenate([columns["response"], *(omega**k * effectors for k in (1, 2, 3))])
    left, freedom = np.empty(residual.shape), np.empty(len(like.rows))
    # residuals are without trends and ends, motions are not: so these go with the columns
    without = lines.taken_out
    for i, row in enumerate(like.rows):
        if row.kind == "response" and row.name in STATE:
            left[i], freedom[i] = _left(residual[i], np.concatenate([late, without]))
            continue
        if row.kind == "actuator":
            name = row.name.partition("/")[2]
            # a delay or a lag makes next to a straight line of the rate of what is reached, a gain of itself
            both = np.concatenate([spectra([f"command/{name}"]), spectra([f"effector/{name}"])])
            columns["actuator"] = np.concatenate([both, omega * both, omega**2 * both])
        left[i], freedom[i] = _left(residual[i], np.concatenate([columns[row.kind], without]))
    return left, freedom


def _left(row: Complex, columns: Complex) -> tuple[Array, float]:
    """Return the power of a row beyond columns with real coefficients, and the share of equations left.

    At most half of the equations go to columns: the strongest directions among them.
    """
    stacked = np.concatenate([row.real, row.imag])
    share = 1.0
    if len(columns):
        x = np.concatenate([columns.real, columns.imag], axis=1)
        x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        _, size, basis = np.linalg.svd(x, full_matrices=False)
        basis = basis[: min(int((size > 1e-6 * size[0]).sum()), x.shape[1] // 2)]
        stacked = stacked - (stacked @ basis.T) @ basis
        share = 1 - len(basis) / x.shape[1]
    return stacked[: row.size] ** 2 + stacked[row.size :] ** 2, share


def _smooth_ratio(hz: Array, ratio: Array) -> Array:
    """Return power ratios, shape (row, line), as smooth functions of frequency.

    A parabola in log frequency, by iterated least squares for numbers that scatter as they are large
    (a gamma regression with logarithmic link: McCullagh & Nelder, Generalized Linear Models, 2nd ed., ch. 8).
    """
    x = np.log(hz / np.sqrt(hz[0] * hz[-1]))
    columns = np.stack([np.ones_like(x), x, x**2])[: 3 if hz.size > 30 else 1]
    inverse = np.linalg.pinv(columns.T)
    found = np.zeros((len(ratio), len(columns)))
    found[:, 0] = np.log(np.maximum(ratio.mean(axis=1), 1e-12))
    for _ in range(30):
        fitted = found @ columns
        step = np.clip(ratio * np.exp(-fitted) - 1, -1, 3) @ inverse.T
        found += step
        if np.abs(step).max() < 1e-3:
            break
    return np.exp(np.clip(found @ columns, -20, 20))


@dataclass(frozen=True, eq=False)
class Shared:
    """Noise that signatures and residual have in common, because both are computed from the same channels.

    Attributes
    ----------
    names : tuple of str
        Channels, and ``d/dt`` of each.
    spectra : ndarray of complex, shape (channel, line)
        Of the channels without their noise.
    strength : ndarray, shape (channel, row)
        Inner product of what noise is left in a channel with the white-weighed noise of each row.
    moving : ndarray of bool, shape (channel,)
        Whether a channel stands out of that noise; nothing can be told of the dependence on others.
    """

    names: tuple[str, ...]
    spectra: Complex
    strength: Array
    moving: NDArray[np.bool_]

    def attenuation(self, columns: Complex, channels: Sequence[str]) -> Array:
        """Return what shared noise adds to the products of columns with the residual, shape (column,).

        Parameters
        ----------
        columns : ndarray of complex, shape (column, row, line)
        channels : sequence of str
            That they are computed from.

        Notes
        -----
        A signature is nearly linear in the channels that it is computed from, so it carries their noise as
        it carries their motion. Without this the tests of a perfect simulation are off by a few standard
        errors (errors in variables; docs/theory/gap-diagnosis.md).
        """
        at = [i for i, n in enumerate(self.names) if n in channels and self.moving[i]]
        if not at or not len(columns):
            return np.zeros(len(columns))
        z = self.spectra[at]
        x = np.concatenate([z.real, z.imag], axis=1)
        size = np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        x = x / size
        inner = x @ x.T + 1e-5 * np.eye(len(x))
        flat = np.concatenate([columns.real, columns.imag], axis=2)
        slopes = np.linalg.solve(inner, np.einsum("it,crt->icr", x, flat).reshape(len(x), -1))
        slopes = (slopes / size).reshape(len(x), *columns.shape[:2])  # (channel, column, row)
        return np.einsum("jci,ji->c", slopes, self.strength[at])


def shared_noise(quieted: Quiet, lines: Lines, noise: Noise, made: Complex, added: Complex) -> Shared:
    """Return the noise that what is computed from a quiet record shares with the residual.

    Parameters
    ----------
    quieted : Quiet
    lines : Lines
    noise : Noise
    made, added : ndarray of complex, shapes (draw, row, line) and (draw, channel, line)
        Of `draws`, channels in the order of `quieted.sigma`.
    """
    names = list(quieted.sigma)
    # what the smoothing lets through: `freqid.identify.smoothing.smooth`
    passed = 1 / (1 + (lines.hz / np.array([quieted.cutoff_hz[n] for n in names])[:, None]) ** 6)
    spectra, left = lines.spectrum(quieted.record.matrix(names)), added * passed
    omega = 2j * np.pi * lines.hz
    spectra = np.concatenate([spectra, omega * spectra])
    left = np.concatenate([left, omega * left], axis=1)
    metric = np.einsum("lki,lkj->lij", noise.whitening.conj(), noise.whitening)
    weighed = np.einsum("lij,kjl->kil", metric, made)
    strength = 2 * np.einsum("kjl,kil->ji", left.conj(), weighed).real / len(made)
    heard = np.mean(np.abs(left) ** 2, axis=(0, 2))
    moving = np.mean(np.abs(spectra) ** 2, axis=1) > _HEARD * np.maximum(heard, 1e-300)
    return Shared((*names, *(f"d/dt {n}" for n in names)), spectra, strength, moving)

"""How much of a residual noise alone would make: the sensors' own, and what no motion explains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import Maneuver
from freqid.gap.histories import Histories
from freqid.gap.kept_draws import kept
from freqid.gap.lines import Lines
from freqid.gap.residual import measured_part
from freqid.gap.simulation import side_by_side
from freqid.gap.trial import Trial
from freqid.gap.unexplained import unexplained

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LEAST = 1e-12  # of a row's power
HALF_WIDTH = 10
"""Lines on either side of one whose noise is averaged with it."""

_MOST = 1e4  # power ratio of the flown noise to the sensors' own
_PLAIN = 1.4  # mean ratio from which noise is plainly more than the sensors'
_BY_DERIVATIVES = ("predictions", "jsbsim")
"""Kinds of simulation that noise is sent through to first order: those that cannot be replayed on every draw
or take too long for it. What noise of two channels makes together is lost, a fifth of an LA-8's L."""

_RIDGE = 0.01  # of a row's variance: how far rows that share noise are trusted to cancel it


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
    beyond : ndarray, shape (row, line)
        Power spectral density of that rest, which no rows share.
    """

    covariance: Complex
    whitening: Complex
    sensor_share: Array
    beyond: Array

    def louder(self, made: Complex, seed: int) -> Complex:
        """Return draws of the sensors' noise, shape (draw, row, line), with what is beyond it."""
        rng = np.random.default_rng([seed, 5])
        more = rng.standard_normal((2, *made.shape))
        return made + np.sqrt(self.beyond / 2) * (more[0] + 1j * more[1])

    def white(self, z: Complex) -> Array:
        """Return rows on lines, shape (..., row, line), as independent real numbers of variance one.

        Returns
        -------
        ndarray, shape (..., 2 row line)
        """
        found = np.einsum("lij,...jl->...il", self.whitening, z) * np.sqrt(2)
        flat = found.reshape(*found.shape[:-2], z.shape[-2] * z.shape[-1])  # of no rows too
        return np.concatenate([flat.real, flat.imag], axis=-1)


def draws(
    maneuver: Maneuver,
    lines: Lines,
    like: Histories,
    predicted: Array,
    trial: Trial,
    sigma: dict[str, float],
    count: int,
    seed: int,
    cache: Path | None = None,
) -> tuple[Complex, Complex]:
    """Return residuals that sensor noise alone makes, through the very steps of the residual.

    Parameters
    ----------
    maneuver : Maneuver
        Noise is added to what was flown, and the difference taken.
    lines : Lines
    like : Histories
        Measured part of the manoeuvre.
    predicted : ndarray, shape (response, sample)
        By the simulation on it.
    trial : Trial
        Of the manoeuvre without noise, whose derivatives serve where noise goes through to first order.
    sigma : dict of float
        Standard deviation by channel.
    count : int
    seed : int
    cache : Path, optional
        Folder in which draws are kept from one diagnosis to the next.

    Returns
    -------
    made : ndarray of complex, shape (count, row, line)
        Residuals.
    noise : ndarray of complex, shape (count, channel, line)
        What made them, in the channels of `sigma`.
    """
    record, simulation = maneuver.record, trial.simulation
    actuators = [row.name.partition("/")[2] for row in like.rows if row.kind == "actuator"]
    known = [n for n in trial.inputs if n in sigma] if simulation.kind in _BY_DERIVATIVES else None
    slopes = trial.gradient[:, [trial.inputs.index(n) for n in known]] if known else None

    def one(k: int) -> tuple[Complex, Complex]:
        """Return the residual that one draw makes, and the draw."""
        rng = np.random.default_rng([seed, k])
        added = {name: size * rng.standard_normal(record.time.size) for name, size in sigma.items()}
        channels = [replace(record.channel(n), values=record[n] + x) for n, x in added.items()]
        noisy = replace(maneuver, record=record.with_channels(*channels))
        change = measured_part(noisy, simulation.responses, actuators) - like
        if known is None:
            change.direct[: len(predicted)] -= simulation.predict(noisy.record) - predicted
        elif slopes is not None:
            through = np.einsum("ijt,jt->it", slopes, np.array([added[n] for n in known]))
            change.direct[: len(predicted)] -= through
        every = np.array(list(added.values())).reshape(len(sigma), record.time.size)
        return lines.transform(change), lines.spectrum(every)

    first = one(0)

    def every() -> tuple[Complex, Complex]:
        made = [first, *side_by_side(simulation, one, range(1, count))]
        found = np.array([z for z, _ in made]).reshape(count, len(like.rows), lines.hz.size)
        return found, np.array([z for _, z in made]).reshape(count, len(sigma), lines.hz.size)

    return kept(cache, (predicted, *first), count, seed, every)


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
    left, freedom = unexplained(maneuver, lines, like, residual, sigma)
    # a row without any noise, as of a simulated log, is trusted to a millionth of what it holds
    least = _LEAST * np.mean(np.abs(lines.transform(like)) ** 2, axis=1) + np.finfo(float).tiny ** 0.5
    covariance = covariance + least[:, None] * np.eye(len(like.rows))
    level = np.einsum("lii->il", covariance).real
    ratio = _smooth_ratio(lines.hz, left / np.maximum(level * freedom[:, None], 1e-300))
    plain = ratio.mean(axis=1, keepdims=True) > _PLAIN
    power = np.where(plain, np.clip(ratio, 1.0, _MOST), 1.0)
    # what is beyond the sensors' noise is not in the channels whose noise rows share
    beyond = (power - 1) * level
    covariance = covariance + beyond.T[:, :, None] * np.eye(len(like.rows))
    diagonal = np.einsum("lii->li", covariance).real
    covariance = covariance + _RIDGE * diagonal[:, :, None] * np.eye(len(like.rows))
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    return Noise(covariance, whitening, 1 / power, beyond)


def _averaged(values: Complex) -> Complex:
    """Return values on lines, the first axis, averaged over their neighbours."""
    count = len(values)
    total = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    low = np.maximum(np.arange(count) - HALF_WIDTH, 0)
    high = np.minimum(np.arange(count) + HALF_WIDTH + 1, count)
    return (total[high] - total[low]) / (high - low).reshape(-1, *[1] * (values.ndim - 1))


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

"""Noise of rows: their covariance from few draws beside a dense Monte Carlo, and what makes it white."""

from __future__ import annotations

import linear_flight
import numpy as np
import pytest
from linear_flight import UNITS, vehicle

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.gap.stack.block import stack_of
from freqid.gap.stack.histories import Histories, Row
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.noise import (
    Draws,
    beyond_motion,
    covariance_of,
    flown_covariance,
    smooth_ratio,
    whitening_of,
)

LINES, PAIRS = 61, 48
HZ = np.arange(LINES) / 20.0


def mixing(k):
    """Three rows of four sensors: two share one, the third is differentiated and by itself."""
    rate = 0.3 + HZ[k]
    return np.array([[1.0, 0.5, 0, 0], [0.8, 0.0, 0.6, 0], [0, 0, 0, rate]])


def spectra(count, seed):
    rng = np.random.default_rng(seed)
    white = (rng.standard_normal((2, count, 4, LINES)) * np.sqrt(0.5)).T
    white = (white[..., 0] + 1j * white[..., 1]).T
    white[..., 0] = rng.standard_normal((count, 4))
    return np.stack([white[..., k] @ mixing(k).T for k in range(LINES)], axis=-1)


def draws(seed, bias_error=0.0):
    odd = spectra(PAIRS, seed)
    return Draws(odd, np.zeros_like(odd[0]), np.full(odd[0].shape, bias_error))


@pytest.fixture(scope="module")
def dense():
    """Covariance of twenty thousand draws, by line."""
    z = spectra(20000, 1)
    return np.einsum("kil,kjl->lij", z, z.conj()) / len(z)


def test_few_draws_give_the_covariance_of_many(dense):
    one = np.ones((3, LINES))
    found = np.mean([covariance_of(draws(s), one, np.zeros(3)) for s in range(10)], axis=0)
    scale = np.sqrt(np.einsum("lii->li", dense).real)
    apart = np.abs(found - dense) / (scale[:, :, None] * scale[:, None, :])
    assert apart[5:-5].max() < 4 / np.sqrt(10 * PAIRS * 5)  # seeds, pairs and neighbouring lines


def test_noise_whitened_by_few_draws_has_unit_power_and_no_correlation(dense):
    fresh, one = spectra(4000, 2), np.ones((3, LINES))
    power, across = [], []
    for seed in range(10):
        w = whitening_of(covariance_of(draws(100 + seed), one, np.zeros(3)))
        y = np.einsum("lij,kjl->kil", w, fresh)
        product = np.einsum("kil,kjl->lij", y, y.conj()).real / len(y)
        power.append(np.einsum("lii->li", product).mean())
        across.append(product.mean(axis=0))
    assert np.mean(power) == pytest.approx(1.0, abs=0.08)
    left = np.mean(across, axis=0)
    assert np.abs(left - np.diag(np.diag(left))).max() < 0.05


def test_rows_that_share_a_sensor_are_correlated_and_others_are_not():
    found = covariance_of(draws(3), np.ones((3, LINES)), np.zeros(3))
    size = np.sqrt(np.einsum("lii->li", found).real)
    correlation = np.abs(found) / (size[:, :, None] * size[:, None, :])
    truth = 0.8 / np.sqrt(1.25)
    assert correlation[:, 0, 1].mean() == pytest.approx(truth, abs=0.1)
    assert correlation[:, 0, 2].mean() < 0.05


def test_louder_flown_noise_is_each_rows_own_and_adds_to_the_sensors():
    quiet = covariance_of(draws(3), np.ones((3, LINES)), np.zeros(3))
    loud = covariance_of(draws(3), np.full((3, LINES), 4.0), np.zeros(3))
    ratio = np.einsum("lii->li", loud).real / np.einsum("lii->li", quiet).real
    assert ratio == pytest.approx(4.0, rel=0.01)
    assert loud[:, 0, 1] == pytest.approx(quiet[:, 0, 1])


def test_the_error_of_the_bias_adds_its_variance():
    plain, more = (covariance_of(draws(3, e), np.ones((3, LINES)), np.zeros(3)) for e in (0.0, 0.7))
    added = more - plain
    assert added == pytest.approx(0.49 * np.broadcast_to(np.eye(3), added.shape))


def test_a_row_without_noise_is_still_not_trusted_beyond_its_floor():
    silent = Draws(np.zeros((PAIRS, 1, LINES), complex), np.zeros((1, LINES), complex), np.zeros((1, LINES)))
    found = covariance_of(silent, np.ones((1, LINES)), np.array([1e-6]))
    assert found[:, 0, 0].real == pytest.approx(1e-6, rel=0.01)


def test_power_ratios_become_smooth_functions_of_frequency():
    rng = np.random.default_rng(5)
    truth = np.exp(1.0 - 0.8 * np.log(np.maximum(HZ, HZ[1]) / np.sqrt(HZ[1] * HZ[-1])))
    ratio = truth * rng.exponential(1.0, (200, LINES))
    found = smooth_ratio(HZ, ratio, (np.arange(LINES) > 0).astype(float))
    assert np.mean(found, axis=0)[1:] == pytest.approx(truth[1:], rel=0.15)
    assert np.std(np.log(found[:, 10:])) < 0.6 * np.std(np.log(ratio[:, 10:]))


@pytest.mark.parametrize(("excess", "multiple"), [((0, 0, 0), 1.0), ((0, 0, 2.0), 1.0), ((0.3, 0, 0), 1.6)])
def test_flown_noise_is_told_from_repeats_without_breaking_what_rows_share(dense, excess, multiple):
    """What is left of a row once the others are known is right, not its power alone."""
    power = np.einsum("lii->li", dense).real
    truth = multiple * dense + np.einsum("li,ij->lij", power * excess, np.eye(3))
    left = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        z = (rng.standard_normal((2, LINES, 3)) * np.sqrt(0.5)).T @ np.array([1.0, 1j])
        z[:, 0] = rng.standard_normal(3)
        apart = np.einsum("lij,jl->il", np.linalg.cholesky(truth), z)[None]
        left.append(np.mean(_alone(flown_covariance(dense, apart)) / _alone(truth), axis=0))
    assert np.mean(left, axis=0) == pytest.approx(np.ones(3), abs=0.2)


def _alone(covariance):
    """Power of each row that the others do not account for, shape (line, row)."""
    return 1 / np.einsum("lii->li", np.linalg.inv(covariance)).real


def test_lines_that_slow_motion_takes_tell_no_noise():
    """On the few lines that slow motion lives on, it explains most of any noise: less of it is left."""
    time = np.arange(1501) / 50.0
    slow = {n: np.sin(2 * np.pi * (1 + i) * time / 30 + i) for i, n in enumerate(("u", "w", "q"))}
    channels = {f"state/{n}": Channel(f"state/{n}", UNITS[n], x, 50.0, "made here") for n, x in slow.items()}
    record = FlightRecord(time, channels, vehicle())
    lines = lines_of(record, 2.0)
    rows, count = 400, lines.hz.size
    rng = np.random.default_rng(3)
    noise = lines.complex(rng.standard_normal((rows, 2 * count - 1)))
    noise[:, 0] = rng.standard_normal(rows)
    like = Histories((Row("Z", "N", "response"),) * rows, np.zeros((rows, 1)), np.zeros((rows, 1)))
    left, freedom = beyond_motion(Maneuver(record, vehicle()), lines, like, noise, np.ones((rows, count)))
    assert freedom[0, 1:4].max() < 0.5
    assert freedom[0, 20:].min() > 0.9
    assert left.mean(axis=0)[1:] == pytest.approx(freedom[0, 1:], abs=4 / np.sqrt(rows))
    found = smooth_ratio(lines.hz, left, np.where(np.arange(count) > 0, freedom, 0.0))
    assert np.median(found, axis=0) == pytest.approx(np.ones(count), abs=0.15)


def test_lines_beyond_all_signals_do_not_tell_the_noise_below(monkeypatch):
    """Signals that fill every line of their band: in gusts noise is louder there than on the lines left."""
    seconds = 41.0

    def filling(duration, period, seed, late=0.0):
        time = np.arange(round(duration / linear_flight.DT) + 1) * linear_flight.DT - late
        rng, every = np.random.default_rng(seed), np.arange(1, round(1.5 * duration))
        waves = [
            np.sin(2 * np.pi * np.outer(k / duration, time) + rng.uniform(0, 2 * np.pi, (k.size, 1)))
            for k in (every[::2], every[1::2])
        ]
        return 0.03 * np.array([w.sum(axis=0) / np.sqrt(len(w) / 2) for w in waves])

    monkeypatch.setattr(linear_flight, "commands", filling)
    rng = np.random.default_rng(8)
    white = rng.standard_normal(round(seconds / linear_flight.DT) + 1)
    slow = np.exp(-np.arange(200) * linear_flight.DT / 0.3)
    gust = {"state/w": 0.1 * np.convolve(white, slow / np.linalg.norm(slow))[: white.size]}
    flight = linear_flight.fly(noise=1.0, seed=3, duration=seconds, add=gust)
    (block,) = stack_of(linear_flight.Linear(), [flight], ["gusty"], (0.05, 6.0))
    driven = block.lines.driven
    low = slice(4, round(1.4 * seconds))
    assert driven[low].all()
    assert (~driven[: driven.size // 2]).sum() > 40
    row = [r.name for r in block.rows].index("kinematic/w")
    ratio = np.mean(np.abs(block.residual[row, low]) ** 2 / block.noise_power[row, low])
    assert ratio == pytest.approx(1.0, abs=0.5)

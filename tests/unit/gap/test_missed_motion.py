"""What a model's flight misses of a recorded one is taken up; noise is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import SIGMA, Truth, fly, motion

from freqid.core.record import FlightRecord
from freqid.gap.stack.lines import lines_of
from freqid.gap.stack.missed_motion import as_far_as_seen, with_missed

NAMES = ("state/u", "state/w", "state/q", "state/theta", "effector/d1", "effector/d2")


def recorded(truth: Truth, sizes: dict[str, float], seed: int) -> tuple[FlightRecord, dict[str, np.ndarray]]:
    """Return a noisy record of an aircraft, and what it holds without noise."""
    record = fly(noise=0.0, phases=0).record
    clean = motion(truth, 20.0, 20.0, 0)
    rng = np.random.default_rng(seed)
    channels = [
        replace(record.channel(n), values=clean[n] + sizes[n] * rng.standard_normal(clean[n].size))
        for n in NAMES
    ]
    return record.with_channels(*channels), clean


def apart(one: np.ndarray, other: np.ndarray) -> float:
    time = np.arange(one.size)
    rest = one - other
    return float(np.std(rest - np.polyval(np.polyfit(time, rest, 1), time)))


@pytest.mark.parametrize("seed", range(3))
def test_most_of_what_a_slower_and_heavier_aircraft_does_otherwise_is_taken_up(seed):
    record, clean = recorded(Truth(mass=10.5, late=0.01, slow=0.01), SIGMA, seed)
    nominal = motion(Truth(), 20.0, 20.0, 0)
    own = {n: nominal[n] for n in NAMES}
    found = with_missed(record, own, lines_of(record, 2.0))
    for name in ("state/w", "state/q", "effector/d1"):
        assert apart(found[name], clean[name]) < 0.4 * apart(own[name], clean[name]), name


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_not_taken_for_motion(seed):
    record, clean = recorded(Truth(), SIGMA, seed)
    own = {n: clean[n] for n in NAMES}
    found = with_missed(record, own, lines_of(record, 2.0))
    for name in NAMES:
        assert apart(found[name], clean[name]) < 0.1 * SIGMA[name], name


def test_of_a_fitted_model_only_the_share_is_taken_that_it_misses():
    """It starts as the record does and couples as it does: slow motion of the record is gusts to it."""
    record, clean = recorded(Truth(), SIGMA, 0)
    time = record.time - record.time[0]
    lines = lines_of(record, 2.0)
    wander = 0.3 * np.sin(2 * np.pi * 0.5 * lines.hz[lines.driven][0] * time)
    gusty = record.with_channels(
        replace(record.channel("state/w"), values=record["state/w"] + wander * np.std(clean["state/w"]))
    )
    model = {n: 0.95 * clean[n] for n in NAMES}
    found = with_missed(gusty, model, lines, fitted=True)
    assert apart(found["state/w"], clean["state/w"]) < 0.3 * apart(model["state/w"], clean["state/w"])
    taken = with_missed(gusty, model, lines)
    assert apart(taken["state/w"], clean["state/w"]) > 3 * apart(found["state/w"], clean["state/w"])


def test_where_nothing_was_injected_the_model_stays_as_it_is():
    record, clean = recorded(Truth(), SIGMA, 0)
    quiet = [replace(record.channel(n), values=0 * record[n]) for n in record.channels if "excitation" in n]
    own = {n: 0.9 * clean[n] for n in NAMES}
    record = record.with_channels(*quiet)
    found = with_missed(record, own, lines_of(record, 2.0))
    assert all(np.array_equal(found[n], own[n]) for n in NAMES)


@pytest.mark.parametrize("seed", range(3))
def test_a_record_counts_as_far_as_it_stands_out_of_the_noise(seed):
    """A rate of which a fifth is missing is the record's; where the model is right, it stays the model's."""
    record, clean = recorded(Truth(), SIGMA, seed)
    own = {n: clean[n] for n in NAMES} | {"state/q": 0.8 * clean["state/q"]}
    lines = lines_of(record, 2.0)
    found = as_far_as_seen(record, own, lines, SIGMA)
    q = "state/q"
    driven = lines.spectrum(np.array([found[q] - clean[q], own[q] - clean[q]]))[:, lines.driven]
    noise = SIGMA[q] ** 2 * lines.dt
    left, missed = (np.abs(driven) ** 2).mean(axis=1)
    assert missed > 100 * noise
    assert left < 1.5 * noise
    for name in set(NAMES) - {q}:
        assert apart(found[name], clean[name]) < 0.03 * SIGMA[name], name

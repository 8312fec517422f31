"""An excitation that was not logged is found again by its design: start and drift as the log was made."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.core.results.design import SampledInputs
from freqid.identify.response.unlogged_excitation import align_excitation

PERIOD, DRIFT, START = 30.0, 50e-6, 107.3137
TONES = {"de": np.arange(3, 60, 3), "da": np.arange(4, 60, 3)}


def tones(name, t, rng):
    """A multisine by its formula, zero outside of two periods."""
    phase = rng.uniform(0, 2 * np.pi, TONES[name].size)
    x = 0.02 * np.sin(2 * np.pi * TONES[name][:, None] * t / PERIOD + phase[:, None]).sum(axis=0)
    return np.where((t >= 0) & (t <= 2 * PERIOD), x, 0.0)


def flown(seed, *, group="command", noise=0.005, drift=DRIFT):
    """A closed loop in steps of 1 ms: rates follow commands, and commands hold their feedback."""
    rng = np.random.default_rng(seed)
    t = 100.0 + np.arange(0, 75, 0.001)
    own = (t - START) * (1 + drift)
    commands, rates = [], []
    for name in TONES:
        x = tones(name, own, np.random.default_rng(len(name) + TONES[name][0]))
        slow = np.convolve(rng.normal(size=t.size), np.ones(400) / 20, mode="same") * noise
        rate, rows = 0.0, np.empty((2, t.size))
        for i in range(t.size):
            command = x[i] - 0.5 * rate + 0.3 * slow[i]
            rate += 0.001 * (-2.0 * rate + 4.0 * command + 2.0 * slow[i])
            rows[:, i] = command, rate
        commands.append(rows[0])
        rates.append(rows[1])
    pick = slice(7, None, 20)  # 50 Hz
    grid = t[pick]
    rows = {f"{group}/{name}": row[pick] for name, row in zip(TONES, commands, strict=True)}
    rows |= {f"state/{n}": row[pick] for n, row in zip(("q", "p"), rates, strict=True)}
    made = {
        name: Channel(
            name, "rad/s" if name[0] == "s" else "rad", x + 1e-4 * rng.normal(size=x.size), 50.0, "made"
        )
        for name, x in rows.items()
    }
    return FlightRecord(time=grid, channels=made)


def design():
    time = np.arange(0, 2 * PERIOD + 0.01, 0.02)
    rows = [
        tones(name, np.minimum(time, 2 * PERIOD), np.random.default_rng(len(name) + TONES[name][0]))
        for name in TONES
    ]
    return SampledInputs(tuple(TONES), ("rad",) * 2, time, np.array(rows))


@pytest.mark.parametrize("seed", [1, 2])
def test_start_and_drift_within_two_milliseconds_in_a_closed_loop(seed):
    record, timing = align_excitation(flown(seed), design())
    own = np.array([0.0, 2 * PERIOD])
    there = START + own / (1 + DRIFT)
    found = timing.start_s + own / (1 + timing.drift)
    assert np.abs(found - there).max() < 0.002
    assert abs(timing.start_s - START) < 4 * timing.start_std_s
    assert abs(timing.drift - DRIFT) < 4 * timing.drift_std
    assert timing.channels == {"de": "command/de", "da": "command/da"}
    assert timing.gains["de"] == pytest.approx(1.0, abs=0.05)
    truth = tones("de", (record.time - START) * (1 + DRIFT), np.random.default_rng(5))
    assert record.channel("excitation/de").unit == "rad"
    inside = (record.time > START + 1) & (record.time < START + 59)
    largest = 0.002 * np.abs(np.gradient(truth, record.dt)).max()  # what 2 ms make of the steepest slope
    np.testing.assert_allclose(record["excitation/de"][inside], truth[inside], atol=largest)
    about = record.provenance["excitation_aligned"]
    assert about["drift_ppm"] == pytest.approx(1e6 * timing.drift)


def test_another_design_is_not_found_and_what_cannot_be_is_said():
    flight = flown(3)
    time = np.arange(3001) * 0.02
    phase = np.random.default_rng(8).uniform(0, 2 * np.pi, (20, 2))
    lines = 2 * np.pi * np.array([[5.5 + 3 * k, 6.5 + 3 * k] for k in range(20)]) / PERIOD
    other = 0.02 * np.sin(lines[..., None] * time + phase[..., None]).sum(axis=0)
    foreign = SampledInputs(("de", "da"), ("rad",) * 2, time, other)
    with pytest.raises(DataError, match="excitation is not found in command/de, command/da"):
        align_excitation(flight, foreign)
    with pytest.raises(DataError, match="has none of the design's effectors dx"):
        align_excitation(flight, SampledInputs(("dx",), ("rad",), foreign.time, other[:1]))
    with pytest.raises(DataError, match="expected at least the 60 s of the design"):
        align_excitation(flight.cut(100.1, 130.0), design())
    done, _ = align_excitation(flight, design())
    with pytest.raises(DataError, match="already holds the excitation of de, da"):
        align_excitation(done, design())

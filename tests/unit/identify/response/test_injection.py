"""A design found in a log: signals made of the design by known delays, gains and noise."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.record import Channel, FlightRecord
from freqid.core.results.design import Multisine, MultisineDesign, SampledInputs
from freqid.identify.response.injection import (
    FALSE_ALARM,
    find_start,
    flown_span,
    gain_of,
    line_transforms,
    on_clock,
    own_lines,
    share_too_fast,
)

PERIOD, PERIODS, DT = 20.0, 2, 0.02
BAND = (0.1, 2.0)


def design(seed=0):
    """Return three inputs on interleaved harmonics, and a function of time that gives their values."""
    rng = np.random.default_rng(seed)
    signals = tuple(
        Multisine(f"e{k}", "rad", np.arange(2 + k, 41, 3), np.full(13, 0.02), rng.uniform(0, 2 * np.pi, 13))
        for k in range(3)
    )

    def at(t):
        inside = (t >= 0) & (t <= PERIOD * PERIODS)
        rows = [
            (s.amplitude[:, None] * np.sin(2 * np.pi * np.outer(s.index, t) / PERIOD + s.phase[:, None])).sum(
                axis=0
            )
            for s in signals
        ]
        return np.array(rows) * inside

    planned = MultisineDesign(signals, PERIOD, PERIODS, BAND, DT, seed)
    grid = DT * np.arange(round(PERIOD * PERIODS / DT) + 1)
    return planned, SampledInputs(planned.names, ("rad",) * 3, grid, at(grid)), at


def record(rows, t, group="excitation"):
    names = [f"{group}/e{k}" for k in range(len(rows))]
    channels = {n: Channel(n, "rad", x, 1 / DT, "log") for n, x in zip(names, rows, strict=True)}
    return FlightRecord(t, channels)


@pytest.mark.parametrize("start", [3.137, 0.0, -7.313])
def test_the_start_is_found_to_a_tenth_of_a_sample(start):
    _, inputs, at = design()
    t = 100.0 + DT * np.arange(2500)
    found = find_start(record(at(t - 100.0 - start), t), inputs)
    assert found.time_s == pytest.approx(100.0 + start, abs=0.002)


def test_the_start_is_found_in_commands_with_a_trim_and_noise():
    _, inputs, at = design()
    t = DT * np.arange(2500)
    rng = np.random.default_rng(0)
    rows = 0.3 + at(t - 4.0) + 0.02 * rng.standard_normal((3, t.size))
    assert find_start(record(rows, t, "command"), inputs).time_s == pytest.approx(4.0, abs=0.005)


def test_gain_lag_and_coherence_of_a_delayed_signal():
    planned, inputs, at = design()
    t = DT * np.arange(2400)
    flown = record(at(t - 2.0), t)
    span = flown_span(flown, planned, inputs, 2.0)
    assert span.stop - span.start == round(PERIOD * PERIODS / DT) + 1
    lines = own_lines(planned, inputs, 40.0, BAND)["e1"]
    np.testing.assert_allclose(lines, np.arange(3, 41, 3) / PERIOD)
    both = np.array([0.8 * at(t - 2.06)[1], at(t - 2.0)[1]])[:, span]
    output, input_ = line_transforms(both, t[span], lines)
    found = gain_of(output, input_, lines)
    assert found.gain == pytest.approx(0.8, rel=0.01)
    assert found.lag_s == pytest.approx(0.06, abs=0.001)
    assert found.coherence > 0.99


def test_unrelated_lines_are_called_present_as_rarely_as_stated():
    rng = np.random.default_rng(1)
    lines = np.arange(1, 14) / PERIOD
    p = []
    for _ in range(2000):
        a, b = rng.standard_normal((2, 13)) + 1j * rng.standard_normal((2, 13))
        p.append(gain_of(a, b, lines, latest_s=0.0).p_value)
    # only a positive product counts as presence, which halves the rate at least
    for level in (0.1, 0.01):
        assert np.mean(np.array(p) < level) < 1.3 * level
    assert np.mean(np.array(p) < FALSE_ALARM) < 0.002


def test_another_design_is_not_taken_for_this_one():
    planned, inputs, _ = design(0)
    t = DT * np.arange(2000)
    other = record(design(7)[2](t), t)
    start = find_start(other, inputs)
    span = flown_span(other, planned, inputs, start.time_s)
    flown = on_clock(inputs, t[span], start.time_s)
    for k, name in enumerate(inputs.names):
        lines = own_lines(planned, inputs, 40.0, BAND)[name]
        there = line_transforms(other[f"excitation/{name}"][span], t[span], lines)[0]
        signal = line_transforms(flown[k], t[span], lines)[0]
        assert gain_of(there, signal, lines, latest_s=0.0).p_value > FALSE_ALARM


def test_the_share_of_time_at_a_rate_limit():
    ramp = np.minimum(np.arange(1001) * DT, 10.0)  # 1 unit/s over half of the record
    assert share_too_fast(ramp, DT, 1.0 - 1e-9) == pytest.approx(0.5, abs=0.01)
    assert share_too_fast(ramp, DT, 1.1) == 0.0

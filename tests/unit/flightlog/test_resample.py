"""Resampling: exact where it can be, stopped where it would alias, refused where it would invent."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord
from freqid.flightlog.resample import PASS, onto_grid, resample

SECONDS = 40.0


def sine(f, t):
    return np.sin(2 * np.pi * f * t + 0.3)


def record_of(rate, native=None, **signals):
    t = 7.0 + np.arange(round(SECONDS * rate) + 1) / rate
    channels = {
        name.replace("__", "/"): Channel(
            name=name.replace("__", "/"),
            unit="rad",
            values=x(t),
            native_rate_hz=native or rate,
            source="test",
        )
        for name, x in signals.items()
    }
    return FlightRecord(time=t, channels=channels)


def gridded(t, values, rate):
    """Channels of one clock, as onto_grid wants them, and what the tests look at."""
    found = onto_grid({name: (t, x) for name, x in values.items()}, rate)
    return found.time, found.values, found.native_rate_hz, found.filled


def away_from_the_ends(time, margin=4.0):
    return (time > time[0] + margin) & (time < time[-1] - margin)


@pytest.mark.parametrize(("rate", "new"), [(200, 50), (50, 200), (50, 31.7), (50, 50)])
def test_what_is_in_the_pass_band_comes_through_without_phase(rate, new):
    """Tones up to the end of the pass band, within the stated -100 dB (amplitude 1e-5) twice over."""
    for f in np.array([0.02, 0.3, 0.6, 0.99]) * 0.5 * PASS * min(rate, new):
        found = resample(record_of(rate, effector__de=lambda t, f=f: sine(f, t)), new)
        inside = away_from_the_ends(found.time)
        np.testing.assert_allclose(found["effector/de"][inside], sine(f, found.time)[inside], atol=2e-5)
        assert found.dt == pytest.approx(1 / new, rel=1e-12)


@pytest.mark.parametrize("f", [25.5, 30.0, 49.0, 51.0, 80.0])
def test_what_would_alias_is_removed(f):
    found = resample(record_of(200, effector__de=lambda t: sine(f, t)), 50)
    inside = away_from_the_ends(found.time)
    assert np.abs(found["effector/de"][inside]).max() < 2e-5


def test_a_straight_line_comes_back_exactly_up_to_its_ends():
    found = resample(record_of(60, state__theta=lambda t: 3 - 0.25 * t), 17)
    np.testing.assert_allclose(found["state/theta"], 3 - 0.25 * found.time, rtol=1e-13)


def test_resampling_is_linear_and_alike_for_every_channel():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 2001))
    t = np.arange(2001) / 50
    _, found, _, _ = gridded(t, {"a": a, "b": b, "c": 2 * a - 3 * b}, 21.0)
    np.testing.assert_allclose(found["c"], 2 * found["a"] - 3 * found["b"], atol=1e-12)


def test_the_weights_are_those_of_a_plain_sum_over_the_kernel():
    """The sparse product against the formula, sample by sample, in the middle of a record."""
    rng = np.random.default_rng(2)
    x = rng.normal(size=3001)
    t = np.arange(3001) / 100
    grid, found, _, _ = gridded(t, {"x": x}, 40.0)
    slower, beta = 40.0, 0.1102 * (100 - 8.7)
    width = (100 - 7.95) / (14.36 * 0.1 * slower)
    for i in (500, 501, 603):
        tau = grid[i] - t
        inside = np.abs(tau) < width / 2
        kernel = np.sinc(0.9 * slower * tau[inside]) * np.i0(
            beta * np.sqrt(1 - (2 * tau[inside] / width) ** 2)
        )
        ramp = x[0] + (x[-1] - x[0]) * t / t[-1]
        expected = kernel @ (x - ramp)[inside] / kernel.sum() + x[0] + (x[-1] - x[0]) * grid[i] / t[-1]
        assert found["x"][i] == pytest.approx(expected, abs=1e-12)


def test_jittered_times_are_put_onto_a_grid():
    rng = np.random.default_rng(4)
    t = np.arange(0, 60, 0.02) + rng.uniform(-0.004, 0.004, 3000)
    grid, found, native, filled = gridded(t, {"x": sine(1.0, t)}, 50.0)
    assert np.ptp(np.diff(grid)) < 1e-12
    assert native["x"] == pytest.approx(50.0, rel=0.02)
    inside = away_from_the_ends(grid)
    np.testing.assert_allclose(found["x"][inside], sine(1.0, grid)[inside], atol=3e-5)


def test_missing_samples_are_bridged_and_counted():
    t = np.arange(0, 60, 0.02)
    x = sine(0.5, t)
    x[100::50] = np.nan
    grid, found, native, filled = gridded(t, {"x": x, "whole": sine(0.5, t)}, 50.0)
    assert filled == {"x": 58}
    assert native["x"] == pytest.approx(50.0)
    inside = away_from_the_ends(grid)
    np.testing.assert_allclose(found["x"][inside], found["whole"][inside], atol=1e-5)


def test_channels_that_start_late_or_end_early_bound_the_record():
    t = np.arange(0, 20.001, 0.02)
    slow = np.full(t.size, np.nan)
    slow[20:980:25] = 1.0
    grid, found, native, _ = gridded(t, {"fast": t, "slow": slow}, 50.0)
    assert (grid[0], grid[-1]) == (pytest.approx(0.4), pytest.approx(19.4))
    assert native["slow"] == pytest.approx(2.0)
    np.testing.assert_allclose(found["slow"], 1.0, rtol=1e-12)


def test_a_dropout_costs_its_span_and_not_the_flight():
    """0.3 s without samples of one channel: the longest whole stretch is the record, the others are named."""
    t = np.arange(0, 20, 0.02)
    x = sine(0.5, t)
    x[(t > 4.99) & (t < 5.29)] = np.nan
    x[(t > 15.99) & (t < 16.29)] = np.nan
    found = onto_grid({"y": (t, sine(0.5, t)), "x": (t, x)}, 50.0)
    assert found.dropouts == (
        ("x", pytest.approx(4.98), pytest.approx(5.3)),
        ("x", 15.98, pytest.approx(16.3)),
    )
    np.testing.assert_allclose(found.spans, [(0, 4.98), (5.3, 15.98), (16.3, 19.98)])
    assert (found.time[0], found.time[-1]) == (pytest.approx(5.3), pytest.approx(15.98))
    inside = away_from_the_ends(found.time, 1.0)
    np.testing.assert_allclose(found.values["x"][inside], sine(0.5, found.time)[inside], atol=1e-4)
    np.testing.assert_allclose(found.values["x"], found.values["y"], atol=1e-2)


def test_a_channel_that_starts_late_is_a_dropout_before_it():
    t = np.arange(0, 20, 0.02)
    x = t.copy()
    x[:200] = np.nan
    found = onto_grid({"y": (t, t), "x": (t, x)}, 50.0)
    assert found.dropouts == (("x", 0.0, 4.0),)
    assert found.time[0] == 4.0
    with pytest.raises(DataError, match="'x' has 0 samples"):
        gridded(t, {"x": np.full(t.size, np.nan)}, 50.0)
    late = t > 10
    with pytest.raises(DataError, match="'x' and 'y' have no stretch of time in common"):
        onto_grid({"x": (t[late], t[late]), "y": (t[~late], t[~late])}, 50.0)


def test_channels_with_clocks_of_their_own_come_onto_one():
    """Three rates, three offsets, a drifting clock and jitter: all follow the same motion to 2e-4."""
    rng = np.random.default_rng(9)
    fast = 0.0013 + np.arange(0, 60, 0.004)
    middle = 0.011 + 1.0003 * np.arange(0, 60, 0.01) + rng.uniform(-0.001, 0.001, 6000)
    slow = 0.07 + np.arange(0, 59.9, 0.1)
    found = onto_grid({n: (t, sine(0.5, t)) for n, t in (("a", fast), ("b", middle), ("c", slow))}, 50.0)
    inside = away_from_the_ends(found.time)
    for name in "abc":
        np.testing.assert_allclose(found.values[name][inside], sine(0.5, found.time)[inside], atol=2e-4)
    rates = [found.native_rate_hz[n] for n in "abc"]
    np.testing.assert_allclose(rates, [250, 100, 10], rtol=0.01)
    expected = np.sqrt(np.mean((np.diff(middle) - np.median(np.diff(middle))) ** 2))
    assert found.jitter_s["b"] == pytest.approx(expected)
    assert found.jitter_s["a"] < 1e-9


def test_other_faults_are_refused():
    t = np.arange(0, 20, 0.02)
    crowded = np.insert(t, 100, t[100] - 1e-6)
    with pytest.raises(DataError, match="almost repeats at t = 2 s"):
        gridded(crowded, {"x": crowded}, 50.0)
    infinite = t.copy()
    infinite[5] = np.inf
    with pytest.raises(DataError, match=r"'x' is infinite at t = 0.1 s"):
        gridded(t, {"x": infinite}, 50.0)
    with pytest.raises(DataError, match="fewer than two samples"):
        gridded(t[:10], {"x": t[:10]}, 1.0)
    for rate in (0.0, -5.0, np.nan, np.inf, 501.0):
        with pytest.raises(UsageError, match="more than 0 and at most 500 Hz"):
            gridded(t, {"x": t}, rate)


def test_heading_is_unwrapped():
    record = record_of(50, state__psi=lambda t: np.mod(0.5 * t, 2 * np.pi))
    found = resample(record, 20)
    np.testing.assert_allclose(np.diff(found["state/psi"]), 0.025, rtol=1e-9)


def test_the_record_says_what_was_done():
    record = record_of(50, native=10, effector__de=lambda t: sine(0.5, t))
    found = resample(record, 25)
    assert found.channel("effector/de").native_rate_hz == 10
    history = found.provenance["resampled"]
    assert (history["rate_hz"], history["from_hz"]) == (25, pytest.approx(50))
    assert "Kaiser" in history["method"]


def test_a_band_above_a_native_nyquist_frequency_is_refused():
    record = record_of(50, state__q=lambda t: t).with_channels(
        Channel(name="effector/de", unit="rad", values=np.zeros(2001), native_rate_hz=10, source="test")
    )
    record.check_band(["state/q"], 25.0)
    record.check_band(["state/q", "effector/de"], 5.0)
    with pytest.raises(
        DataError,
        match="'effector/de' was logged at 10 Hz and tells nothing above its Nyquist frequency, 5 Hz",
    ):
        record.check_band(["state/q", "effector/de"], 5.1)
    with pytest.raises(DataError, match="'state/q' was logged at 50 Hz"):
        record.check_band(["state/q"], 26.0)
    with pytest.raises(DataError, match="'effector/de'"):
        resample(record, 50, band_hz=(0.1, 6.0))
    with pytest.raises(UsageError, match=r"a rate of 8 Hz passes up to 3.2 Hz.*to 10 Hz or more"):
        resample(record, 8, band_hz=(0.1, 4.0))
    with pytest.raises(DataError, match="'state/q' was logged at 8 Hz"):
        resample(record, 8).check_band(["state/q"], 4.5)

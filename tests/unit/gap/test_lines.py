"""Lines, whose they are, and what a transform on them leaves of noise, trends and ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_flight import DT, fly
from scipy.stats import chi2

from freqid.gap.stack.histories import Histories, Row
from freqid.gap.stack.lines import MOST_LINES, lines_of

TOP = 2.0  # Hz


def rows(direct, momentum=None):
    direct = np.atleast_2d(direct)
    made = tuple(Row(f"r{i}", "N", "response") for i in range(len(direct)))
    return Histories(made, direct, np.zeros_like(direct) if momentum is None else np.atleast_2d(momentum))


@pytest.fixture(scope="module")
def lines():
    return lines_of(fly(duration=20.0).record, TOP)


def test_a_line_belongs_to_the_signal_that_drives_it(lines):
    k = np.rint(20 * lines.hz).astype(int)
    assert lines.hz * 20 == pytest.approx(k)
    assert (k[0], k[-1]) == (0, 40)
    assert lines.inputs == ("d1", "d2")
    within = (k >= 2) & (k < 40)
    expected = np.where(k % 3 == 2, 0, np.where(k % 3 == 0, 1, -1))
    assert (lines.owner[within] == expected[within]).all()
    assert (lines.owner[k < 2] == -1).all()
    assert (lines.driven == (lines.owner >= 0)).all()


def test_of_two_periods_every_second_line_is_driven_by_nothing():
    lines = lines_of(fly(duration=20.0, period=10.0).record, TOP)
    k = np.rint(20 * lines.hz).astype(int)
    assert not lines.driven[k % 2 == 1].any()
    driven = lines.driven[(k % 2 == 0) & (k < 40)]
    assert driven.sum() == np.isin(k // 2 % 3, (0, 2))[(k % 2 == 0) & (k < 40) & (k > 2)].sum()


def test_where_nothing_is_injected_nothing_is_driven():
    record = fly().record
    channels = {n: c for n, c in record.channels.items() if not n.startswith("excitation/")}
    lines = lines_of(replace(record, channels=channels), TOP)
    assert (lines.owner == -1).all()
    assert not lines.driven.any()
    assert lines.inputs == ()


def test_a_long_record_keeps_its_driven_lines_before_others():
    lines = lines_of(fly(duration=400.0, period=20.0).record, TOP)
    k = np.rint(400 * lines.hz).astype(int)
    driven = [20 * j for j in range(2, 40) if j % 3 != 1]
    assert set(driven) <= set(k.tolist())
    assert lines.hz.size <= MOST_LINES + len(driven)
    assert (np.diff(lines.hz) > 0).all()
    assert (lines.driven == np.isin(k, driven)).all()


def test_transforms_are_those_of_closed_forms(lines):
    """Of 3 + t + exp(-t / 4): integrals of the continuous signal over the record, over the root of T."""
    time, duration, decay = DT * np.arange(lines.samples), 20.0, 0.25
    s = 2j * np.pi * lines.hz[1:]
    expected = np.empty(lines.hz.size, dtype=complex)
    expected[0] = 3 * duration + duration**2 / 2 + (1 - np.exp(-decay * duration)) / decay
    expected[1:] = -duration / s + (1 - np.exp(-decay * duration)) / (decay + s)
    found = lines.spectrum(3.0 + time + np.exp(-decay * time))
    assert found == pytest.approx(expected / np.sqrt(duration), rel=1e-6)


def test_a_momentum_is_differentiated_with_its_end_values(lines):
    """The same signal's rate, 1 - exp(-t / 4) / 4, in closed form."""
    time, duration, decay = DT * np.arange(lines.samples), 20.0, 0.25
    s = 2j * np.pi * lines.hz[1:]
    expected = np.empty(lines.hz.size, dtype=complex)
    expected[0] = duration - (1 - np.exp(-decay * duration))
    expected[1:] = -decay * (1 - np.exp(-decay * duration)) / (decay + s)
    momentum = 3.0 + time + np.exp(-decay * time)
    found = lines.transform(rows(0 * time, momentum))[0]
    assert found == pytest.approx(expected / np.sqrt(duration), rel=1e-3, abs=1e-5)


def test_noise_of_end_values_is_as_large_as_is_said(lines):
    """Straight off two samples it would be one."""
    noise = np.random.default_rng(4).standard_normal((4000, lines.samples))
    for ends in lines.end_values(noise):
        assert ends.std() == pytest.approx(lines.end_gain, rel=0.05)
    assert lines.end_gain < 0.92


@pytest.mark.parametrize("phase", [0.0, 0.8, 1.6, 2.4])
def test_the_fastest_motion_that_is_compared_has_its_end_values_to_a_hundredth(lines, phase):
    wave = np.cos(2 * np.pi * 2.0 * DT * np.arange(lines.samples) + phase)
    first, last = lines.end_values(wave[None])
    assert first[0] == pytest.approx(wave[0], abs=0.01)
    assert last[0] == pytest.approx(wave[-1], abs=0.01)


def test_a_derivative_is_the_transform_of_the_differentiated_history(lines):
    time = DT * np.arange(lines.samples)
    wave, slope = np.zeros((2, time.size))
    for k, phase in ((3, 0.3), (17, 1.0), (31, 2.0)):
        omega = 2 * np.pi * k / 20
        wave += np.sin(omega * time + phase)
        slope += omega * np.cos(omega * time + phase)
    one, other = lines.transform(rows(0 * wave, wave)), lines.transform(rows(slope))
    assert np.abs(one - other).max() < 1e-3 * np.abs(other).max()


def test_a_sine_shows_on_its_line_with_half_its_amplitude_times_the_root_of_the_duration(lines):
    time = DT * np.arange(lines.samples)
    found = lines.spectrum(2.0 * np.cos(2 * np.pi * 21 / 20 * time))
    at = np.rint(20 * lines.hz) == 21
    assert np.abs(found[at][0]) == pytest.approx(np.sqrt(20), rel=1e-3)


def test_white_noise_has_the_density_of_its_variance_times_the_sampling_interval(lines):
    sigma, draws = 0.3, 400
    noise = sigma * np.random.default_rng(2).standard_normal((draws, lines.samples))
    for found in (lines.spectrum(noise), lines.transform(rows(noise))):
        energy = np.sum(np.abs(found) ** 2) / (sigma**2 * DT)
        # trends and ends take the equivalent of a few of the lines' real numbers away
        freedom = 2 * draws * lines.hz.size
        assert chi2.ppf(1e-4, freedom - 8 * draws) < 2 * energy < chi2.isf(1e-4, freedom)
    above = found[:, lines.hz > 0.5]
    energy = 2 * np.sum(np.abs(above) ** 2) / (sigma**2 * DT)
    assert energy / (2 * above.size) == pytest.approx(1, abs=0.03)

"""Responses under feedback against the exact ones of an unstable plant that a regulator holds."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, Maneuver
from freqid.identify.response.frequency_response import estimate_frequency_response, estimate_swept_response
from freqid.identify.response.injected_lines import injected_lines
from freqid.identify.response.local_response import ResponseLines, local_response

sys.path.insert(0, str(Path(__file__).parent))
import closed_loop_plant as plant

NOISE = {"gust": 0.15, "sensor": 0.15}
FLIGHTS = 24


@pytest.fixture(scope="module")
def noisy():
    """Many flights of one multisine through noise, their estimates on every line, and the truth."""
    flights = [plant.fly(seed=seed, **NOISE) for seed in range(FLIGHTS)]
    found = [estimate_frequency_response([m], None, plant.OUTPUTS) for m in flights]
    return flights, found, plant.response(found[0].frequencies_hz)


def relative(error, truth):
    return np.abs(error) / np.abs(truth)


def test_without_noise_only_curvature_is_left_and_a_higher_order_leaves_less():
    errors = []
    for order in (1, 2, 3):
        found = estimate_frequency_response([plant.fly()], None, plant.OUTPUTS, order=order)
        errors.append(np.median(relative(found.value - plant.response(found.frequencies_hz), found.value)))
    assert errors[1] < 5e-4
    assert errors[0] > 5 * errors[1] > 15 * errors[2]


def test_a_shared_denominator_follows_the_plant_where_polynomials_do_not():
    """Order 1 in wide windows: the plant's slow poles bend the responses between the lines."""
    m = plant.fly()
    errors = {}
    for poles in (0, 2):
        found = estimate_frequency_response([m], None, plant.OUTPUTS, order=1, poles=poles, lines=5)
        truth = plant.response(found.frequencies_hz)
        errors[poles] = relative(found.value - truth, truth)
    assert np.median(errors[2]) < 0.05 * np.median(errors[0])
    assert np.quantile(errors[2], 0.9) < 0.2 * np.quantile(errors[0], 0.9)


def test_a_start_far_from_trim_is_told_from_the_response():
    found = estimate_frequency_response([plant.fly(state=(2.0, -1.0, 1.0))], None, plant.OUTPUTS)
    still = estimate_frequency_response([plant.fly()], None, plant.OUTPUTS)
    truth = plant.response(found.frequencies_hz)
    assert np.median(relative(found.value - truth, truth)) < 2e-3
    assert np.median(relative(still.value - truth, truth)) < 5e-4


def test_injected_signals_leave_no_bias_where_ratios_of_measured_spectra_have_one():
    """Noise as strong as the signals, sixty flights: mean errors over their own standard errors."""
    at = np.array([0.1, 0.3, 0.5, 0.8])
    truth = plant.response(at)
    by_instruments, plain = [], []
    for seed in range(60):
        m = plant.fly(amplitude=0.5, gust=0.2, sensor=0.2, seed=seed)
        lines = injected_lines(m, 0, plant.INPUTS, "effector", plant.OUTPUTS, plant.PERIOD)
        # inputs in place of the injected signals are their own instruments: least squares
        naive = ResponseLines(lines.hz, lines.record, lines.excited, lines.u, lines.u, lines.y)
        by_instruments.append([local_response(lines, f, 2, 4).value for f in at])
        plain.append([local_response(naive, f, 2, 4).value for f in at])

    def off(found):
        found = np.moveaxis(np.array(found), 1, -1)
        error = np.abs(found.mean(axis=0) - truth)
        return error / np.sqrt(np.mean(np.abs(found - found.mean(axis=0)) ** 2, axis=0) / len(found))

    assert np.sqrt(np.mean(off(by_instruments) ** 2)) < 1.4
    assert np.sqrt(np.mean(off(plain) ** 2)) > 3


def test_stated_errors_are_those_that_repeated_flights_have(noisy):
    _, found, truth = noisy
    error = np.array([one.value for one in found]) - truth
    stated = np.sqrt(np.mean([2 * one.std_error**2 for one in found], axis=0))
    assert np.median(stated / np.sqrt(np.mean(np.abs(error) ** 2, axis=0))) == pytest.approx(1.0, abs=0.1)
    for confidence in (0.5, 0.9, 0.95):
        inside = np.mean([np.abs(e) < one.radius(confidence) for e, one in zip(error, found, strict=True)])
        assert inside == pytest.approx(confidence, abs=0.03)


def test_errors_stated_with_a_denominator_are_not_too_small():
    at = np.array([0.15, 0.4, 0.9])
    truth, hits = plant.response(at), []
    for seed in range(40):
        m = plant.fly(seed=seed, **NOISE)
        lines = injected_lines(m, 0, plant.INPUTS, "effector", plant.OUTPUTS, plant.PERIOD)
        for k, f in enumerate(at):
            one = local_response(lines, f, 1, 5, 2)
            dof = one.degrees_of_freedom
            radius = one.variance * dof * (0.1 ** (-1 / dof) - 1)
            hits.append(np.abs(one.value - truth[..., k]) ** 2 < radius)
    assert 0.88 < np.mean(hits) < 0.98  # they are a little too large


def test_strength_is_the_first_stage_f_of_each_input_beside_the_others():
    m = plant.fly(amplitude=0.3, **NOISE)
    lines = injected_lines(m, 0, plant.INPUTS, "effector", plant.OUTPUTS, plant.PERIOD)
    one = local_response(lines, 0.5, 0, int(lines.excited.sum(axis=1).max()))  # one window of all lines
    wanted = np.flatnonzero(lines.excited.any(axis=0))
    inside = slice(wanted[0], wanted[-1] + 1)
    u, constant = lines.u[:, inside], np.ones(wanted[-1] + 1 - wanted[0])
    given = np.vstack([lines.r[:, inside], constant]).T
    explained = [given @ np.linalg.lstsq(given, row)[0] for row in u]
    for i, row in enumerate(u):
        others = np.column_stack([*explained[:i], *explained[i + 1 :], constant])
        own = explained[i] - others @ np.linalg.lstsq(others, explained[i])[0]
        noise = np.sum(np.abs(row - explained[i]) ** 2) / (row.size - given.shape[1])
        assert one.strength is not None
        assert one.strength[i] == pytest.approx(np.sum(np.abs(own) ** 2) / noise, rel=1e-6)


def test_signals_that_gusts_and_feedback_drown_are_named():
    """F goes with the power of signals far above the noise; that of signals far below it stays near 1."""
    median = {}
    for amplitude in (10.0, 3.0, 0.001):
        flights = [plant.fly(amplitude=amplitude, gust=0.2, sensor=0.2, seed=s) for s in range(6)]
        lines = [injected_lines(m, 0, plant.INPUTS, "effector", plant.OUTPUTS, plant.PERIOD) for m in flights]
        median[amplitude] = np.median([local_response(x, 0.3, 2, 4).strength for x in lines])
        remarks = estimate_frequency_response(flights[:1], None, plant.OUTPUTS).remarks
        assert len(remarks) == (amplitude < 1)
    assert median[10.0] / median[3.0] == pytest.approx((10 / 3) ** 2, rel=0.3)
    assert median[0.001] < 2
    assert "first-stage F below 10" in remarks[0]
    assert all(name in remarks[0] for name in plant.INPUTS)


def test_coherence_is_the_share_of_power_that_flights_have_in_common(noisy):
    flights, found, _ = noisy
    lines = [injected_lines(m, 0, plant.INPUTS, "effector", plant.OUTPUTS, plant.PERIOD) for m in flights]
    y = np.array([one.y for one in lines])
    common, total = np.abs(y.mean(axis=0)) ** 2, np.mean(np.abs(y) ** 2, axis=0)
    share = (FLIGHTS * common / total - 1) / (FLIGHTS - 1)  # without the noise in the mean
    for i, row in enumerate(lines[0].excited):
        at = np.isin(np.round(found[0].frequencies_hz, 9), np.round(lines[0].hz[row], 9))
        stated = np.mean([one.coherence for one in found], axis=0)[:, i, at]
        assert np.median(np.abs(stated - share[:, row])) < 0.06
        assert np.ptp(stated) > 0.3  # from what is seen well to what is not


def test_repeats_lower_the_error_as_their_number_says(noisy):
    flights, found, truth = noisy
    four = [
        estimate_frequency_response(flights[i : i + 4], None, plant.OUTPUTS).value
        for i in range(0, FLIGHTS, 4)
    ]
    one = np.mean(np.abs(np.array([g.value for g in found]) - truth) ** 2, axis=0)
    several = np.mean(np.abs(np.array(four) - truth) ** 2, axis=0)
    assert np.median(one / several) == pytest.approx(4.0, rel=0.3)


def test_partial_coherence_gives_the_random_error_that_the_books_have(noisy):
    """Normalised error sqrt((1 - c) / (2 n c)): n is the same for all entries of one frequency."""
    _, found, _ = noisy
    c = np.median([one.partial_coherence for one in found], axis=0)
    error = np.median([one.random_error for one in found], axis=0)
    n = (1 - c) / (2 * c * error**2)
    inner = n[..., 10:-10]
    # lines of one signal in the window, 4 nearest of every second line: a quadratic keeps about two of them
    assert np.all((inner > 0.7) & (inner < 5))


@pytest.mark.parametrize("periods", [1, 2])
def test_one_period_does_without_noise_lines(periods):
    found = estimate_frequency_response(
        [plant.fly(periods=periods)], None, plant.OUTPUTS, period_s=plant.PERIOD
    )
    truth = plant.response(found.frequencies_hz)
    assert np.median(relative(found.value - truth, truth)) < 2e-3
    assert np.isnan(found.misfit).all() == (periods == 1)


SWEPT_OUTPUTS = ("u", "w", "q", "state/psi")


@pytest.mark.parametrize("spacing", ["logarithmic", "linear"])
def test_sweeps_one_after_the_other_are_right_over_the_whole_band_that_they_excite(spacing):
    """An unstable plant, both inputs in one record, and a heading that drifts away, which nothing holds."""
    found = estimate_swept_response([plant.fly_sweeps(spacing)], None, SWEPT_OUTPUTS)
    f = found.frequencies_hz
    assert f[0] < plant.BAND[0]
    assert f[-1] > plant.BAND[1]
    ratio = found.value / plant.swept_response(f)
    asked = (f >= plant.BAND[0]) & (f <= plant.BAND[1])
    for part, decibel, degrees in ((f >= f[0], 0.1, 1.0), (asked, 0.02, 0.2)):
        assert np.nanmax(np.abs(20 * np.log10(np.abs(ratio[:3, :, part])))) < decibel
        assert np.nanmax(np.abs(np.degrees(np.angle(ratio[:3, :, part])))) < degrees
    assert np.nanmax(np.abs(ratio[3][:, asked & (f < 0.9)] - 1)) < 0.012  # above, the heading hardly moves


def test_sweeps_in_several_records_are_those_in_one():
    m = plant.fly_sweeps()
    middle = int(np.flatnonzero(m.record["excitation/de2"])[0]) - 1
    each = [
        Maneuver(FlightRecord(m.record.time[part] - m.record.time[part][0], channels), m.vehicle)
        for part in (slice(0, middle), slice(middle, None))
        for channels in [
            {
                n: type(c)(n, c.unit, c.values[part], c.native_rate_hz, c.source)
                for n, c in m.record.channels.items()
            }
        ]
    ]
    one, two = (estimate_swept_response(x, None, ("q",), band_hz=(0.05, 1.1)) for x in ([m], each))
    np.testing.assert_allclose(one.value, two.value, rtol=1e-3)


def test_sweeps_under_feedback_have_no_bias_and_circles_hold_the_truth():
    """The same without injected signals, by least squares on the inputs, is biased."""
    flights = [plant.fly_sweeps(gust=0.2, sensor=0.2, seed=seed, duration=60.0) for seed in range(16)]
    found = [estimate_swept_response([m], None, ("u", "w", "q"), band_hz=(0.08, 1.0)) for m in flights]
    truth = plant.response(found[0].frequencies_hz)
    error = np.array([one.value for one in found]) - truth

    def off(error):
        scatter = np.mean(np.abs(error - error.mean(axis=0)) ** 2, axis=0) / len(error)
        return np.sqrt(np.mean(np.abs(error.mean(axis=0)) ** 2 / scatter))

    assert off(error) < 1.4
    for confidence in (0.5, 0.95):
        inside = np.mean([np.abs(e) < one.radius(confidence) for e, one in zip(error, found, strict=True)])
        assert inside == pytest.approx(confidence, abs=0.03)
    without = [m.record for m in flights]
    without = [
        FlightRecord(r.time, {n: c for n, c in r.channels.items() if not n.startswith("excitation/")})
        for r in without
    ]
    plain = [
        estimate_swept_response(
            [Maneuver(r, plant.VEHICLE)], ("de1", "de2"), ("u", "w", "q"), band_hz=(0.08, 1.0)
        )
        for r in without
    ]
    assert "feedback" in plain[0].remarks[0]
    at = plain[0].frequencies_hz
    assert off(np.array([one.value for one in plain]) - plant.response(at)) > 1.7


def test_sweeps_at_the_same_time_are_refused():
    m = plant.fly_sweeps()
    r = m.record
    both = r.channel("excitation/de1").values
    channels = {**r.channels}
    for group in ("excitation", "effector"):
        c = r.channel(f"{group}/de1")
        channels[f"{group}/de2"] = type(c)(
            f"{group}/de2", c.unit, c.values + 0 * both, c.native_rate_hz, c.source
        )
    with pytest.raises(DataError, match="do not move the inputs apart"):
        estimate_swept_response([Maneuver(FlightRecord(r.time, channels), m.vehicle)], None, ("q",))


def test_inputs_that_no_signal_moves_apart_are_refused():
    m = plant.fly()
    record = m.record
    same = record.with_channels(
        *(
            type(c)(f"{group}/de2", c.unit, c.values, c.native_rate_hz, c.source)
            for group in ("effector", "excitation")
            for c in [record.channel(f"{group}/de1")]
        )
    )
    with pytest.raises(DataError, match="apart"):
        estimate_frequency_response(
            [Maneuver(FlightRecord(same.time, same.channels), m.vehicle)], None, ["q"]
        )

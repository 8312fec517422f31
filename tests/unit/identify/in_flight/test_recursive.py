"""The recursive estimates are the batch's from the same samples, at any time, however they arrive."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from wrench_cases import RIGID, SENSOR, TILTING
from wrench_cases import TIME as SHORT
from wrench_cases import record as maneuver_of

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.sections.identification import Identification
from freqid.core.toml import overridden
from freqid.flightlog.read import read_log
from freqid.identify.in_flight.parameter_history import parameter_history
from freqid.identify.in_flight.recursive import RecursiveRegression, RecursiveTransform
from freqid.identify.in_flight.running import InFlight
from freqid.identify.loads.explanatory import history
from freqid.identify.point import identify_point
from freqid.identify.spectra.fourier import FourierPlan, harmonics
from freqid.identify.spectra.trend import remove_trend

SCENARIOS = Path(__file__).resolve().parents[4] / "scenarios"
LINES = harmonics(20.0, (0.05, 1.8))
DT = 0.02


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(SCENARIOS / "linear.toml")[0]


@pytest.fixture(scope="module")
def flown(linear_logs, scenario):
    path = SCENARIOS / "maps" / "linear.toml"
    return Maneuver.of(read_log(linear_logs["noisy"], path, vehicle=scenario.aircraft()))


@pytest.fixture
def channels():
    rng = np.random.default_rng(3)
    t = DT * np.arange(1400)
    drift = np.array([[20.0], [-3.0], [400.0]]) + np.array([[0.1], [0.0], [-2.0]]) * t
    return drift + np.cumsum(rng.standard_normal((3, t.size)), axis=1) * 0.1


def grown(x, sizes=(1,)):
    """Return a transform that took the samples in by parts of these sizes, in turn."""
    transform, start, turn = RecursiveTransform(len(x), DT, LINES), 0, 0
    while start < x.shape[1]:
        stop = start + sizes[turn % len(sizes)]
        transform.update(x[:, start:stop])
        start, turn = stop, turn + 1
    return transform


@pytest.mark.parametrize("trend", ["none", "mean", "endpoints", "line"])
@pytest.mark.parametrize("samples", [1000, 1173, 1400])
def test_transform_is_the_plans_at_any_length(channels, trend, samples):
    x = channels[:, :samples]
    expected = FourierPlan(samples, DT, LINES)(remove_trend(x, DT, trend).x)
    found = grown(x, (1, 64, 3)).read(trend)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(x).max())


def test_transform_does_not_depend_on_how_the_samples_arrive(channels):
    one, many = grown(channels), grown(channels, (2, 5, 100, 7))
    assert one.samples == many.samples == 1400
    np.testing.assert_allclose(one.read("line"), many.read("line"), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(one.change, channels[:, -1] - channels[:, 0])
    np.testing.assert_allclose(one.mean, channels.mean(axis=1))


def test_derivative_is_the_plans_without_its_mean(channels):
    flat = remove_trend(channels, DT, "endpoints").x
    expected = FourierPlan(1400, DT, LINES).derivative(flat)
    np.testing.assert_allclose(grown(channels).read_derivative(), expected, rtol=1e-9, atol=1e-8)


def test_transform_refuses_what_would_spoil_it_for_good(channels):
    transform = grown(channels[:, :1200])
    before = transform.read("line")
    broken = channels[:, 1200:1201].copy()
    broken[1] = np.nan
    with pytest.raises(DataError, match=r"channel 1 is nan at sample 1200.*hold the last good value"):
        transform.update(broken)
    np.testing.assert_array_equal(transform.read("line"), before)


def test_transform_says_when_it_is_too_early_and_what_is_impossible():
    transform = RecursiveTransform(1, DT, LINES)
    transform.update(np.ones((1, 999)))
    with pytest.raises(DataError, match="do not last 20 s"):
        transform.read()
    transform.update(np.ones((1, 1)))
    np.testing.assert_allclose(transform.read("mean"), 0, atol=1e-12)
    with pytest.raises(DataError, match="above Nyquist"):
        RecursiveTransform(1, DT, [26.0])
    for lines, dt in (([0.2, 0.1], DT), ([], DT), ([0.1], 0.0)):
        with pytest.raises(UsageError):
            RecursiveTransform(1, dt, lines)


def assert_same(found, model, at=-1):
    for response in model.responses.values():
        running = found[response.response]
        assert running.regressors == response.regressors
        assert (running.unit, running.regressor_units) == (response.unit, response.regressor_units)
        for name in ("estimate", "std_error", "lower", "upper"):
            np.testing.assert_allclose(
                getattr(running, name)[at], getattr(response, name), rtol=1e-8, err_msg=name
            )
        for name in ("bias", "bias_std_error", "r2"):
            assert getattr(running, name)[at] == pytest.approx(getattr(response, name), rel=1e-8, abs=1e-12)


def test_history_ends_at_the_batch_estimate_and_passes_through_that_of_every_cut(flown, scenario):
    settings, excitation = scenario.identification, scenario.excitation
    found = parameter_history(flown, settings, every_s=4.0, excitation=excitation)
    assert_same(found, identify_point(flown, settings, excitation=excitation))
    time = found["Z"].time
    assert time[0] == pytest.approx(20.0)  # the lowest line is 0.05 Hz
    assert time[-1] == pytest.approx(60.0)
    np.testing.assert_allclose(np.diff(time), 4.0, rtol=1e-9)
    for at in (2, 6):
        start = flown.record.time[0]
        cut = Maneuver(flown.record.cut(start, start + time[at]), flown.vehicle)
        assert_same(found, identify_point(cut, settings, excitation=excitation), at)


@pytest.mark.parametrize(
    "changes",
    [
        {"nuisance": "none", "trend": "endpoints"},
        {"nuisance": "constant", "trend": "mean", "residuals": "white"},
        {"form": "coefficient", "responses": ("Y", "M")},
        {"form": "specific", "frequencies_hz": {"start": 0.07, "step": 0.03, "stop": 1.5}},
        {"axes": "stability", "frequencies_hz": (0.1, 0.13, 0.2, 0.31, 0.5, 0.7, 0.9, 1.1, 1.3)},
    ],
)
def test_history_ends_at_the_batch_estimate_whatever_the_settings(flown, scenario, changes):
    settings = overridden(scenario.identification, **changes)
    found = parameter_history(flown, settings, every_s=20.0, excitation=scenario.excitation)
    assert_same(found, identify_point(flown, settings, excitation=scenario.excitation))


def test_errors_shrink_as_the_manoeuvre_lasts(flown, scenario):
    found = parameter_history(flown, scenario.identification, excitation=scenario.excitation)
    for running in found.values():
        assert (running.std_error[-1] < running.std_error[0]).all()
        late = running.time > 50
        apart = (running.estimate[late] - running.estimate[-1]) / running.std_error[late]
        assert np.sqrt(np.mean(apart**2)) < 1.0


def test_history_refuses_what_the_batch_refuses(flown, scenario):
    settings = scenario.identification
    with pytest.raises(UsageError, match="no frequencies"):
        parameter_history(flown, settings)
    with pytest.raises(UsageError, match="method is 'time'"):
        parameter_history(flown, overridden(settings, method="time"), excitation=scenario.excitation)
    with pytest.raises(UsageError, match="positive time"):
        parameter_history(flown, settings, every_s=0.0, excitation=scenario.excitation)
    still = replace(flown.record.channel("effector/de"), values=np.full(flown.record.time.size, 0.1))
    held = Maneuver(flown.record.with_channels(still), flown.vehicle)
    with pytest.raises(DataError, match="'de' has been constant"):
        parameter_history(held, settings, excitation=scenario.excitation)
    slow = Maneuver(
        flown.record.with_channels(replace(flown.record.channel("state/q"), native_rate_hz=3.0)),
        flown.vehicle,
    )
    with pytest.raises(DataError, match="'state/q' was logged at 3 Hz"):
        parameter_history(slow, settings, excitation=scenario.excitation)
    short = Maneuver(flown.record.cut(flown.record.time[0], flown.record.time[0] + 12), flown.vehicle)
    with pytest.raises(DataError, match="do not last 20 s"):
        parameter_history(short, settings, excitation=scenario.excitation)


def test_in_flight_estimates_are_the_batch_estimates(flown, scenario):
    settings, excitation = scenario.identification, scenario.excitation
    lines = harmonics(excitation.period_s, excitation.band_hz)
    position = flown.record.channel("state/ax").position_m
    running = InFlight(flown.vehicle, settings, flown.record.dt, lines, accelerometer_m=position)
    for sample in np.array([history(flown, name) for name in running.channels]).T:
        running.update(sample)
    found = running.estimate()
    model = identify_point(flown, settings, excitation=excitation)
    for response in model.responses.values():
        estimate = found[response.response]
        assert estimate.time == pytest.approx(60.0)
        np.testing.assert_allclose(estimate.estimate, response.estimate, rtol=1e-8)
        np.testing.assert_allclose(estimate.covariance, response.covariance, rtol=1e-6)
        assert estimate.bias == pytest.approx(response.bias, rel=1e-9)


def test_in_flight_wrench_has_gyroscopic_terms_and_wings_where_they_are_held():
    rng = np.random.default_rng(5)
    lines = np.array([0.2, 0.4, 0.7, 1.1, 1.5, 1.9, 2.3])
    scales = {
        "p": 0.5,
        "q": 0.5,
        "r": 0.5,
        "ax": 3.0,
        "ay": 3.0,
        "az": 3.0,
        "n1": 40.0,
        "n2": 40.0,
        "de": 0.1,
    }
    values = {
        name: scale * np.sin(2 * np.pi * np.outer(lines, SHORT) + rng.uniform(0, 6, (7, 1))).sum(axis=0)
        for name, scale in scales.items()
    }
    values["n1"] += 300
    settings = Identification(regressors=("p", "de"), frequencies_hz=tuple(lines))
    for tilt in (0.4, 1.2):
        maneuver = maneuver_of(TILTING, SENSOR, dw1=tilt, **values)
        running = InFlight(TILTING, settings, DT, lines, tilt_rad={"dw1": tilt}, accelerometer_m=SENSOR["ax"])
        for sample in np.array([history(maneuver, name) for name in running.channels]).T:
            running.update(sample)
        model = identify_point(maneuver, settings)
        for name, found in running.estimate().items():
            np.testing.assert_allclose(found.estimate, model[name].estimate, rtol=1e-8, atol=1e-9)


def test_in_flight_says_what_needs_the_whole_record(scenario):
    settings = scenario.identification
    for changes, what in (({"form": "coefficient"}, "form"), ({"axes": "stability"}, "axes")):
        with pytest.raises(UsageError, match=f"{what} is"):
            InFlight(RIGID, overridden(settings, **changes), DT, LINES)
    with pytest.raises(UsageError, match="no wing tilts by 'dw7'"):
        InFlight(TILTING, settings, DT, LINES, tilt_rad={"dw7": 0.1})
    running = InFlight(TILTING, settings, DT, LINES)
    assert {"n1", "n2"} < set(running.channels)  # they carry momentum, though n2 is no regressor
    with pytest.raises(UsageError, match="one value each of"):
        running.update([0.0])


def test_regression_takes_direct_responses_alone():
    rng = np.random.default_rng(1)
    settings = Identification(regressors=("q", "de"), responses=("M",))
    regression = RecursiveRegression(settings, DT, LINES)
    x = rng.standard_normal((2, 1500))
    z = np.array([[3.0, -2.0]]) @ x + 7.0
    regression.update(x, z, np.zeros_like(z))
    found = regression.estimate()["M"]
    np.testing.assert_allclose(found.estimate, [3.0, -2.0], rtol=1e-9)
    assert found.bias == pytest.approx(np.mean(z))

"""Delays and wind are found within their errors, and parameters then hold what these leave uncertain."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from late_sensors import TRUTH, late

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, Maneuver
from freqid.core.scenario import read_scenario
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point, lines_of
from freqid.identify.sensors.alignment import AlignmentSettings, align, identify_aligned
from freqid.identify.sensors.alignment_motion import Misaligned

SCENARIOS = Path(__file__).resolve().parents[4] / "scenarios"
SEEDS = range(8)


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(SCENARIOS / "linear.toml")[0]


@pytest.fixture(scope="module")
def settings(scenario):
    return msgspec.structs.replace(scenario.identification, estimator="instruments")


@pytest.fixture(scope="module")
def clean(linear_logs, scenario):
    log = read_log(linear_logs["clean"], SCENARIOS / "maps" / "linear.toml", vehicle=scenario.aircraft())
    return Maneuver.of(log)


@pytest.fixture(scope="module")
def trials(clean, settings, scenario):
    """Models and alignments of one flight, logged with the noise of each seed."""
    found = (identify_aligned([late(clean, s)], settings, excitation=scenario.excitation) for s in SEEDS)
    return [(model, alignments[0]) for model, alignments in found]


def test_without_noise_every_delay_the_attitude_and_the_wind_are_found(clean, settings, scenario):
    lines = lines_of(settings, scenario.excitation)
    _, found = align(late(clean, 0, noise=1e-4), settings, lines)
    assert set(found.names) == set(TRUTH)
    tolerance = {"s": 2e-4, "rad": 1e-3, "1": 1e-3, "m/s": 0.05}
    for name, unit in zip(found.names, found.units, strict=True):
        assert found[name][0] == pytest.approx(TRUTH[name], abs=tolerance[unit]), name


def test_with_noise_the_errors_are_what_they_say(trials):
    names = trials[0][1].names
    true = np.array([TRUTH[n] for n in names])
    off = np.array([(a.estimate - true) / a.std_error for _, a in trials])
    # 96 errors, of flights that are alike: rms 0.86 to 1.14 (95 %) were they independent
    assert 0.7 < np.sqrt(np.mean(off**2)) < 1.3
    inside = np.mean([(a.lower < true) & (true < a.upper) for _, a in trials])
    assert inside > 0.88
    for name in ("velocity delay", "surface delay", "rotor delay", "wind north"):
        errors = np.array([a[name][0] - TRUTH[name] for _, a in trials])
        assert np.sqrt(np.mean(errors**2)) < 0.3 * abs(TRUTH[name])


def test_parameters_hold_what_the_alignment_leaves_uncertain(trials, settings, scenario, linear_aircraft):
    off, inside, narrow = [], [], []
    for model, alignment in trials:
        aligned = alignment.flown.at(alignment.errors)
        plain = identify_point(aligned, settings, excitation=scenario.excitation)
        for response in model.responses.values():
            true = np.array([linear_aircraft.DERIVATIVES[response.response][n] for n in response.regressors])
            before = plain[response.response]
            np.testing.assert_allclose(response.estimate, before.estimate)
            assert (response.std_error > before.std_error).all()
            assert (np.linalg.eigvalsh(response.covariance - before.covariance) > -1e-9).all()
            off.append((response.estimate - true) / response.std_error)
            inside.append((response.lower < true) & (true < response.upper))
            narrow.append((before.lower < true) & (true < before.upper))
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.3
    assert np.mean(inside) > 0.9
    assert np.mean(narrow) < np.mean(inside)


def test_sensitivity_is_the_change_of_the_estimate(clean, settings, scenario):
    """First-order sums against identifying again with one unknown moved by its standard error."""
    flown = late(clean, 3)
    model, (alignment,) = identify_aligned([flown], settings, excitation=scenario.excitation)
    plain = identify_point(alignment.flown.at(alignment.errors), settings, excitation=scenario.excitation)
    jacobian = {name: [] for name in model.responses}
    for name in alignment.names:
        step = 0.1 * alignment[name][1]
        both = [
            identify_point(
                alignment.flown.at({**alignment.errors, name: alignment[name][0] + sign * step}),
                settings,
                excitation=scenario.excitation,
            )
            for sign in (1, -1)
        ]
        for r, rows in jacobian.items():
            rows.append((both[0][r].estimate - both[1][r].estimate) / (2 * step))
    for r, rows in jacobian.items():
        j = np.array(rows)
        expected = plain[r].std_error ** 2 + np.diag(j.T @ alignment.covariance @ j)
        np.testing.assert_allclose(model[r].std_error ** 2, expected, rtol=0.05)


def test_without_alignment_the_parameters_are_refused_by_name(clean, settings, scenario):
    flown = late(clean, 0)
    with pytest.raises(
        DataError, match=r"by u w of X Z M and v of Y L N cannot be had.*over the ground only"
    ):
        identify_point(flown, settings, excitation=scenario.excitation)
    still = msgspec.structs.replace(settings, regressors={"L": ("p", "da")}, responses=("L",))
    with pytest.raises(DataError, match=r"instruments cannot be had.*--estimator least-squares"):
        identify_point(flown, still, excitation=scenario.excitation)
    plain = identify_point(flown, still, excitation=scenario.excitation, estimator="least-squares")
    assert set(plain["L"].regressors) == {"p", "da"}
    speed = Channel("air/V", "m/s", np.full(flown.record.time.size, 20.0), 50.0, "", (0.9, 0.0, 0.0))
    piped = Maneuver(flown.record.with_channels(speed), flown.vehicle)
    for change, said in (
        ({"regressors": {"Z": ("V", "q")}, "responses": ("Z",)}, "parameters by V of Z cannot be had"),
        ({"form": "coefficient", "regressors": ("q",)}, "coefficients cannot be had"),
        ({"axes": "stability", "regressors": ("q",)}, "stability axes cannot be had"),
    ):
        with pytest.raises(DataError, match=said + r".*holds V alone"):
            identify_point(piped, msgspec.structs.replace(settings, **change), excitation=scenario.excitation)
    bare = {n: c for n, c in flown.record.channels.items() if n not in ("state/vn", "state/ve", "state/vd")}
    with pytest.raises(DataError, match="holds no velocity through the air"):
        identify_point(
            Maneuver(replace(flown.record, channels=bare), flown.vehicle),
            settings,
            excitation=scenario.excitation,
        )


def test_velocity_through_the_air_is_aligned_without_a_wind(clean, settings, scenario):
    noisy = late(clean, 1).record
    through = {n: clean.record.channel(n) for n in ("state/u", "state/v", "state/w")}
    rng = np.random.default_rng(1)
    t = noisy.time
    late_by = {
        n: replace(c, values=np.interp(t - 0.06, t, c.values) + 0.1 * rng.standard_normal(t.size))
        for n, c in through.items()
    }
    flown = Maneuver(noisy.with_channels(*late_by.values()), clean.vehicle)
    aligned, found = align(flown, settings, lines_of(settings, scenario.excitation))
    assert "wind north" not in found.names
    assert "psi bias" not in found.names
    assert abs(found["velocity delay"][0] - 0.06) < 3 * found["velocity delay"][1] < 0.02
    assert aligned.record["state/w"].std() == pytest.approx(flown.record["state/w"].std(), rel=0.01)
    assert np.array_equal(aligned.record["state/vn"], flown.record["state/vn"])


def test_straight_lines_between_slow_samples_become_smooth(clean):
    t = clean.record.time
    wave = 400 + 20 * np.sin(2 * np.pi * 1.2 * t)
    slow = Channel("effector/n1", "rad/s", np.interp(t, t[::5], wave[::5]), 10.0, "10 Hz, drawn straight")
    flown = Misaligned(Maneuver(clean.record.with_channels(slow), clean.vehicle), {"rotor": ("n1",)})
    inside = slice(20, -20)
    drawn, smooth = slow.values, flown.at({}).record["effector/n1"]
    assert np.abs(drawn - wave)[inside].max() > 1.0
    assert np.abs(smooth - wave)[inside].max() < 0.1
    forward = flown.at({"rotor delay": 0.05}).record["effector/n1"]
    assert np.abs(forward - (400 + 20 * np.sin(2 * np.pi * 1.2 * (t + 0.05))))[inside].max() < 0.1


def test_alignment_says_what_it_cannot_do(clean, settings, scenario):
    lines = lines_of(settings, scenario.excitation)
    with pytest.raises(UsageError, match=r"has no 'rotr delay'.*rotor delay"):
        align(late(clean, 0), settings, lines, AlignmentSettings(plausible={"rotr delay": 0.1}))
    in_time = msgspec.structs.replace(settings, method="time")
    with pytest.raises(UsageError, match="alignment works on lines, but the method is 'time'"):
        identify_aligned([clean], in_time, excitation=scenario.excitation)
    tight = AlignmentSettings(plausible={"wind north": 1e-3, "wind east": 1e-3})
    _, found = align(late(clean, 0), settings, lines, tight)
    assert "wind north" in found.unobservable
    with pytest.raises(UsageError, match="did not estimate 'wind up'"):
        found["wind up"]

"""In gusts: what is late is found, what is on time is left alone, and a measured angle keeps its history."""

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.channels import FLOW, VELOCITY
from freqid.core.record import Channel
from freqid.identify.instruments.driven import driven_maneuvers
from freqid.identify.point import identify_point
from freqid.identify.sensors.air_data_lag import UNSTEADY, LagByLoads, lag_by_loads
from freqid.identify.sensors.alignment import align
from freqid.identify.sensors.kinematics import KinematicSettings, check_kinematics, corrected
from freqid.workflows.inputs import silent
from freqid.workflows.models.sensors import Checked, checked, with_correction_doubt

LATE = 0.14


@pytest.fixture(scope="module")
def bench(script):
    return script("benchmarks/_gusty_flights.py")


@pytest.fixture(scope="module")
def flown(bench):
    return bench.fly(bench.AIRCRAFT[0], 0.5, range(1, 2))[0]


@pytest.fixture(scope="module")
def late(bench, flown):
    return bench.logged(bench.AIRCRAFT[0], flown, 1, LATE, "vanes")


@pytest.fixture(scope="module")
def told(bench, late):
    return checked([late], ["flight"], settings=bench.SETTINGS, excitation=None, correct=True, tell=silent)


def test_late_vanes_are_found_in_gusts_by_the_injected_signals(told):
    (check,) = told.checks
    assert check.instruments
    assert 0.2 < check.gusts.lower < check.gusts.std < check.gusts.upper < 1.0
    for name in ("alpha delay", "beta delay"):
        found, error = check[name]
        assert abs(found - LATE) < 3.5 * error < 0.1
        assert check.probability[name] > 0.95
    account = told.account["flight"]
    assert account["told_by"] == "injected signals"
    assert account["errors"]["alpha delay"]["applied"] == check.correction["alpha delay"][0]


@pytest.mark.slow
def test_late_vanes_are_found_in_gusts_three_times_the_injected_motion(bench):
    """Least squares on the way would lose the channel (a scale of -1), and with it the delay."""
    craft = bench.AIRCRAFT[0]
    (flown,) = bench.fly(craft, 1.0, range(1, 2))
    late = bench.logged(craft, flown, 1, LATE, "vanes")
    (check,) = checked(
        [late], ["flight"], settings=bench.SETTINGS, excitation=None, correct=False, tell=silent
    ).checks
    for name in ("V delay", "alpha delay", "beta delay"):
        found, error = check[name]
        assert name not in check.by_loads
        assert abs(found - LATE) < 3.5 * error < 0.1


def test_loads_tell_one_lag_of_the_air_data(bench, flown, late):
    lines = np.array(bench.SETTINGS.frequencies_hz)
    found = lag_by_loads(late, lines, bench.SETTINGS)
    assert abs(found.estimate - LATE) < 0.003
    assert UNSTEADY <= found.std_error < 1.1 * UNSTEADY
    # What it brings forward is what was flown, but for noise.
    inside = slice(50, -50)
    off = found.on_time.record["air/alpha"] - np.arctan2(flown["wa"], flown["ua"])
    assert off[inside].std() < 1.5 * bench.NOISE["angle"]
    on_time = bench.logged(bench.AIRCRAFT[0], flown, 1, 0.0, "vanes")
    assert abs(lag_by_loads(on_time, lines, bench.SETTINGS).estimate) < 0.003


@pytest.mark.slow
def test_delays_that_no_injected_motion_tells_are_told_by_the_loads_or_named(bench, late):
    still = {
        n: replace(c, values=np.full_like(c.values, c.values.mean()))
        for n, c in late.record.with_channels(*_velocities(late)).channels.items()
    }
    driven = replace(late.record, channels=still)
    lag = LagByLoads(0.15, 0.025, late)
    check = check_kinematics(late, driven=driven, lag=lag)
    delays = ("V delay", "alpha delay", "beta delay")
    assert set(delays) == set(check.by_loads)
    assert not set(delays) & set(check.undetermined)
    for name in delays:
        assert check[name] == pytest.approx((0.15, np.hypot(0.025, UNSTEADY)))
        assert check.probability[name] > 0.9
        assert check.account()[name]["told_by"] == "loads"
    either = [check.correction.names.index(n) for n in delays[:2]]
    covariance = check.correction.covariance[np.ix_(either, either)]
    assert 0.3 < covariance[0, 1] / covariance[0, 0] < 0.8  # one lag of all, and each its own

    blind = check_kinematics(late, driven=driven)
    assert set(delays) <= set(blind.undetermined)
    assert not blind.by_loads
    using = Checked([late], [corrected(late, blind)], [blind], True, {})
    model = identify_point(using.used, bench.SETTINGS)
    said = with_correction_doubt(model, using, identify_point, bench.SETTINGS, aligned=False)
    (remark,) = [r for r in said.remarks if r not in model.remarks]
    assert "do not tell" in remark
    assert all(name in remark for name in delays)


def _velocities(maneuver):
    """Return channels of u v w; of a motion that rests their histories do not matter."""
    speed = maneuver.record["air/V"]
    return (
        Channel(n, "m/s", x, 50.0, "made")
        for n, x in zip(VELOCITY, (speed, 0 * speed, 0 * speed), strict=True)
    )


def test_the_model_of_the_corrected_flight_holds_the_truth_and_the_doubt(bench, late, told):
    true = bench.AIRCRAFT[0].derivatives
    plain, mended = (identify_point(m, bench.SETTINGS) for m in (late, told.used[0]))
    model = with_correction_doubt(mended, told, identify_point, bench.SETTINGS, aligned=False)
    for response, name in (("M", "w"), ("M", "q"), ("Z", "w"), ("N", "v")):
        i = model[response].regressors.index(name)
        value, size = model[response].estimate[i], abs(true[response][name])
        off = abs(value - true[response][name])
        assert off < 4 * model[response].std_error[i]
        assert off < 0.15 * size
        assert model[response].std_error[i] > mended[response].std_error[i]
    q = plain["M"].regressors.index("q")
    assert abs(plain["M"].estimate[q] / true["M"]["q"] - 1) > 0.3


@pytest.mark.slow
def test_least_squares_takes_the_gusts_that_an_aircraft_rides_for_errors_of_its_vanes(bench, flown):
    """Nothing is wrong with these vanes; without instruments the errors must say that this is not known."""
    clean = bench.logged(bench.AIRCRAFT[0], flown, 1, 0.0, "vanes")
    wanted = KinematicSettings(parameters=("alpha scale", "alpha delay", "alpha bias", "az bias", "q bias"))
    blind = check_kinematics(clean, wanted)
    assert not blind.instruments
    lines = np.array(bench.SETTINGS.frequencies_hz)
    driven = driven_maneuvers([clean], lines, bench.SETTINGS)[0].record
    sighted = check_kinematics(clean, wanted, driven)
    for check in (blind, sighted):
        for name in ("alpha scale", "alpha delay"):
            if name in check.names:
                assert abs(check[name][0]) < 4 * check[name][1]
    naive = check_kinematics(clean, replace(wanted, gusts=0.0))
    scale, error = naive["alpha scale"]
    assert scale < -10 * error  # it halves the angle, and doubles its derivatives
    assert abs(sighted.correction.errors.get("alpha scale", 0.0)) < 0.2 * abs(scale)


def test_a_measured_angle_keeps_its_own_history_beside_velocities_that_lag(bench, flown):
    both = bench.logged(bench.AIRCRAFT[0], flown, 1, LATE, "both")
    lines = np.array(bench.SETTINGS.frequencies_hz)
    driven = driven_maneuvers([both], lines, bench.SETTINGS)[0].record
    check = check_kinematics(both, driven=driven)
    assert check.computed == ()
    assert abs(check["u delay"][0] - LATE) < 4 * check["u delay"][1]
    mended = corrected(both, check).record
    used = np.isin(both.record.time, mended.time)
    for name in FLOW:
        np.testing.assert_array_equal(mended[name], both.record[name][used])


def test_angles_that_were_computed_are_no_measurement_and_follow(bench, flown):
    late = bench.logged(bench.AIRCRAFT[0], flown, 1, LATE, "velocity")
    u, v, w = late.record.matrix(("state/u", "state/v", "state/w"))
    speed = np.sqrt(u**2 + v**2 + w**2)
    made = dict(zip(FLOW, (speed, np.arctan2(w, u), np.arcsin(v / speed)), strict=True))
    channels = (Channel(n, "", x, 50.0, "computed on board") for n, x in made.items())
    record = late.record.with_channels(*channels)
    check = check_kinematics(record, KinematicSettings(parameters=("u delay", "v delay", "w delay")))
    assert check.computed == FLOW
    mended = corrected(record, check)
    np.testing.assert_allclose(
        mended["air/alpha"], np.arctan2(mended["state/w"], mended["state/u"]), atol=1e-9
    )


def test_alignment_is_not_misled_by_gusts_either(bench, flown):
    late = bench.logged(bench.AIRCRAFT[0], flown, 1, LATE, "velocity")
    _, found = align(late, bench.SETTINGS, np.array(bench.SETTINGS.frequencies_hz))
    delay, error = found["velocity delay"]
    assert abs(delay - LATE) < 3.5 * error < 0.05

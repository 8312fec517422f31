"""Injected sensor errors are found within their intervals, and what the data do not tell is named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import stdtrit
from wrench_cases import RIGID

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, Maneuver
from freqid.identify.sensors import kinematic_fit
from freqid.identify.sensors.flight_path import (
    attitude_matrix,
    error_growth,
    euler_angles,
    integrate_path,
    running_integral,
    skew,
)
from freqid.identify.sensors.kinematic_fit import coloured_covariance
from freqid.identify.sensors.kinematic_model import GROUND, VELOCITY, predicted, sensors_of
from freqid.identify.sensors.kinematics import KinematicSettings, check_kinematics, corrected

ARM = (0.7, 0.1, -0.3)


@pytest.fixture(scope="module")
def bench(script):
    return script("benchmarks/kinematics.py")


@pytest.fixture(scope="module")
def motion(bench):
    return bench.Motion(np.random.default_rng(4))


@pytest.fixture(scope="module")
def path(motion):
    t = 0.02 * np.arange(1500)
    return integrate_path(*_inertial(motion, t), 0.02, 50, *_start(motion, t, 50))


def _inertial(motion, t, arm=ARM):
    return motion.rates(t), motion.specific_force(t, np.array(arm))


def _start(motion, t, at, arm=ARM):
    here = t[at : at + 1]
    turn = attitude_matrix(*motion.euler(here)[:, 0])
    swung = turn @ np.cross(motion.rates(here)[:, 0], arm)
    return turn, motion.over_ground(here, np.zeros(3))[:, 0] + swung, 80.0


@pytest.mark.parametrize("origin", [0, 1])  # in units of half the record
def test_integration_is_the_motion_to_fourth_order_both_ways_from_the_start(motion, origin):
    off = []
    for dt in (0.04, 0.02):
        t = dt * np.arange(round(30 / dt) + 1)
        at = origin * (t.size // 2)
        run = integrate_path(*_inertial(motion, t), dt, at, *_start(motion, t, at))
        swung = np.cross(motion.rates(t), np.array(ARM)[:, None], axis=0)
        over_ground = run.velocity - np.einsum("ijn,jn->in", run.turn, swung)
        height = motion.quantity("alt", t, np.zeros(3), np.zeros(3))
        down = np.einsum("jn,j->n", run.turn[2], ARM)  # the accelerometers' point goes up and down too
        off.append(
            [
                np.abs(euler_angles(run.turn) - motion.euler(t)).max(),
                np.abs(over_ground - motion.over_ground(t, np.zeros(3))).max(),
                np.abs(run.height - 80 - (height - height[at] - (down - down[at]))).max(),
            ]
        )
    np.testing.assert_array_less(off[1], [5e-6, 5e-4, 5e-3])
    np.testing.assert_allclose(np.divide(*off), 16, rtol=0.2)


def test_growth_of_errors_is_the_difference_of_two_integrations(motion, path):
    t = 0.02 * np.arange(1500)
    (rates, force), start = _inertial(motion, t), _start(motion, t, 50)
    found = error_growth(path)

    def shifted(j, step):
        w, a, turn, velocity, height = rates.copy(), force.copy(), start[0], start[1].copy(), start[2]
        if j < 3:
            turn = (np.eye(3) + step * skew(np.eye(3)[j])) @ turn
        elif j < 6:
            velocity[j - 3] += step
        elif j == 6:
            height += step
        else:
            (w if j < 10 else a)[(j - 7) % 3] -= step
        return integrate_path(w, a, 0.02, 50, turn, velocity, height)

    for j in range(13):
        up, down = shifted(j, 1e-5), shifted(j, -1e-5)
        turned = np.einsum("ijn,kjn->ikn", up.turn - down.turn, path.turn) / 2e-5
        expected = np.concatenate(
            (
                [turned[2, 1], turned[0, 2], turned[1, 0]],
                (up.velocity - down.velocity) / 2e-5,
                (up.height - down.height)[None] / 2e-5,
            )
        )
        np.testing.assert_allclose(found[:, j], expected, atol=1e-4 * (1 + np.abs(expected).max()))


def test_predicted_sensors_are_the_motions_and_so_are_their_derivatives(bench, motion, path):
    t = 0.02 * np.arange(1500)
    wind = np.array([2.0, -1.0, 0.5])
    names = ("alpha", "beta", "V", "phi", "theta", "psi", "vn", "vd")
    values = [motion.quantity(n, t, wind, np.zeros(3)) for n in names]
    groups = {**dict.fromkeys(("V", "alpha", "beta"), "air")}
    rows = {f"{groups.get(n, 'state')}/{n}": v for n, v in zip(names, values, strict=True)}
    (rates, force), place = _inertial(motion, t), {"ax": ARM, "ay": ARM, "az": ARM}
    rows |= {
        f"state/{n}": v for n, v in zip(("p", "q", "r", "ax", "ay", "az"), (*rates, *force), strict=True)
    }
    channels = {n: Channel(n, "", v, 50.0, "", place.get(n[6:])) for n, v in rows.items()}
    sensors = sensors_of(bench.fq.FlightRecord(t, channels), (0.0, 0.0, 0.0))
    assert set(sensors.names) == {n for n in rows if n not in bench_inertial()}
    moving = replace(path, velocity=path.velocity + wind[:, None])
    found, by_state, by_wind = predicted(moving, sensors, rates, wind)
    for row, name in enumerate(sensors.names):
        np.testing.assert_allclose(found[row], rows[name], atol=3e-4, err_msg=name)
    step = 1e-6
    for axis in range(3):
        changes = {
            axis: replace(
                moving, turn=np.einsum("ij,jkn->ikn", np.eye(3) + step * skew(np.eye(3)[axis]), moving.turn)
            ),
            3 + axis: replace(moving, velocity=moving.velocity + step * np.eye(3)[axis][:, None]),
        }
        for state, changed in changes.items():
            slope = (predicted(changed, sensors, rates, wind)[0] - found) / step
            for row, name in enumerate(sensors.names):
                if name not in GROUND or state > 2:  # of these the lever arm's small part is left out
                    np.testing.assert_allclose(by_state[row, state], slope[row], atol=2e-5, err_msg=name)
        slope = (predicted(moving, sensors, rates, wind + step * np.eye(3)[axis])[0] - found) / step
        np.testing.assert_allclose(by_wind[:, axis], slope, atol=2e-5)


def bench_inertial():
    return {f"state/{n}" for n in ("p", "q", "r", "ax", "ay", "az")}


@pytest.mark.parametrize("suite", ["AIR_DATA", "WITH_GROUND"])
def test_without_noise_injected_errors_are_found(bench, suite):
    channels = getattr(bench, suite)
    errors = bench.draw(np.random.default_rng(11), bench.ERRORS[channels])
    record = bench.fly(3, channels, errors, noise=1e-4, duration=25.0)
    check = check_kinematics(record, KinematicSettings(parameters=bench.ERRORS[channels]))
    assert not check.undetermined
    for name, value in zip(check.names, check.estimate, strict=True):
        # What remains is the step of 0.04 s.
        assert value == pytest.approx(errors[name], abs=2e-4), name
    for channel, rms in check.rms_after.items():
        assert rms < 0.02 * check.rms_before[channel]


@pytest.mark.parametrize(("case", "seed"), [(0, 20), (1, 21)])
def test_with_noise_errors_of_the_estimates_are_what_they_say(bench, case, seed):
    errors, check = bench.trial(seed, bench.CASES[case])
    off = check.estimate - np.array([errors[n] for n in check.names])
    assert (np.abs(off) < 5 * check.std_error).all()
    assert 0.5 < np.sqrt(np.mean((off / check.std_error) ** 2)) < 1.5
    assert ((check.lower < check.estimate) & (check.estimate < check.upper)).all()
    for channel, rms in check.rms_after.items():
        assert rms < check.rms_before[channel]


def test_accelerometers_off_the_centre_of_gravity_need_no_derivative_of_rates(bench):
    errors = {"az bias": 0.2, "alpha delay": 0.08, "q bias": 0.004}
    flown = Maneuver(bench.fly(5, bench.AIR_DATA, errors, arm=ARM), centred(RIGID))
    wanted = KinematicSettings(parameters=(*errors, "beta scale"))
    right = check_kinematics(flown, wanted)
    for name, value in zip(right.names, right.estimate, strict=True):
        assert abs(value - errors.get(name, 0.0)) < 4 * right[name][1]
    ignored = {n: replace(c, position_m=None) for n, c in flown.record.channels.items()}
    wrong = check_kinematics(Maneuver(replace(flown.record, channels=ignored), flown.vehicle), wanted)
    assert wrong.rms_after["air/alpha"] > 1.1 * right.rms_after["air/alpha"]


def centred(vehicle):
    import msgspec

    mass = msgspec.structs.replace(vehicle.mass_properties, cg_m=(0.0, 0.0, 0.0))
    return msgspec.structs.replace(vehicle, mass_properties=mass)


def test_what_a_quiet_flight_does_not_tell_is_named_with_what_would_take_it_up(bench):
    class Quiet(bench.Motion):
        def __init__(self, rng):
            super().__init__(rng)
            self._size = self._size * 0.01

    lively, bench.Motion = bench.Motion, Quiet
    try:
        record = bench.fly(2, bench.AIR_DATA, {"ax bias": 0.1}, duration=24.0)
    finally:
        bench.Motion = lively
    check = check_kinematics(record)
    assert "theta bias" in check.undetermined
    assert "ax bias" in check.undetermined["theta bias"]
    assert {"alpha scale", "alpha delay", "beta scale", "V scale"} <= set(check.undetermined)
    assert abs(check["ax bias"][0] - 0.1) < 3 * check["ax bias"][1] < 0.03
    assert not set(check.undetermined) & set(check.names)
    with pytest.raises(UsageError, match="did not estimate 'theta bias'"):
        check["theta bias"]
    assert "theta bias" not in check_kinematics(bench.fly(2, bench.AIR_DATA, {})).undetermined


def test_an_unknown_that_never_settles_is_held_and_named(bench, monkeypatch):
    solve = kinematic_fit._solve

    def swinging(jacobian, residual, size, prior, away, measured=None):
        found = solve(jacobian, residual, size, prior, away, measured)
        # As of a curved valley: the last of eight never comes to rest, once the noise is weighed.
        if measured is not None and len(found.step) == 8:
            found.step[-1] += 0.7 * found.error[-1] * (-1) ** len(calls)
            calls.append(1)
        return found

    calls = []
    monkeypatch.setattr(kinematic_fit, "_solve", swinging)
    record = bench.fly(2, bench.AIR_DATA, {"ax bias": 0.1}, duration=20.0)
    wanted = KinematicSettings(parameters=("ax bias", "V scale"), plausible={"V scale": 0.01})
    check = check_kinematics(record, wanted)
    assert len(calls) > kinematic_fit.PATIENCE
    assert set(check.undetermined) == {"V scale"}
    assert abs(check["ax bias"][0] - 0.1) < 4 * check["ax bias"][1]


def test_a_corrected_record_is_the_flight_and_checks_clean(bench):
    errors = bench.draw(np.random.default_rng(8), bench.ERRORS[bench.WITH_GROUND])
    made = bench.fly(6, bench.WITH_GROUND, errors)
    qbar = Channel("air/qbar", "Pa", 0.6 * (made.matrix(VELOCITY) ** 2).sum(axis=0), 25.0, "made")
    shown = np.linalg.norm(made.matrix(VELOCITY), axis=0)
    speed = Channel("air/V", "m/s", shown, 25.0, "computed from u v w, so no measurement")
    flown = Maneuver(made.with_channels(qbar, speed), RIGID)
    check = check_kinematics(flown, KinematicSettings(parameters=bench.ERRORS[bench.WITH_GROUND]))
    mended = corrected(flown, check)
    assert isinstance(mended, Maneuver)
    record, t = mended.record, mended.record.time
    assert t[0] > 0
    assert t[-1] < 40
    assert record.provenance["kinematics"] == check.correction.errors
    assert check.computed == ("air/V",)
    assert "V scale" not in (*check.names, *check.undetermined)
    motion = bench.Motion(np.random.default_rng(6))
    for name in ("w", "v", "phi", "vn", "q", "az"):
        wind = np.array([errors[f"wind {a}"] for a in ("north", "east", "down")])
        off = record[f"state/{name}"] - motion.quantity(name, t, wind, np.zeros(3))
        noise = bench.NOISE[bench.KIND[name]]
        assert abs(off.mean()) < 0.35 * noise  # of 0.1 to 3 that were injected
        assert off.std() < 1.15 * noise
    speed = np.linalg.norm(record.matrix(VELOCITY), axis=0)
    np.testing.assert_allclose(record["air/V"], speed)
    assert np.median(record["air/qbar"] / (0.6 * speed**2)) == pytest.approx(1.0, abs=0.01)
    again = check_kinematics(mended, KinematicSettings(parameters=bench.ERRORS[bench.WITH_GROUND]))
    for name in ("w scale", "ground delay", "az bias", "u delay", "p bias"):
        assert abs(again[name][0]) < 1.0 * again[name][1]
    assert isinstance(corrected(made, check), bench.fq.FlightRecord)


def test_a_wind_that_wanders_costs_parameters_until_it_may(bench):
    record = bench.fly(10, bench.WITH_GROUND, {})
    t, speed = record.time, 2 * np.pi * np.array([[1 / 45], [1 / 28], [1 / 19]])
    size, phase = np.array([[1.5], [0.8], [0.5]]), np.random.default_rng(10).uniform(0, 6, (3, 3, 1))
    wind = np.array([(size * np.sin(speed * t + p)).sum(axis=0) for p in phase])
    gained = np.array([(size * speed * np.cos(speed * t + p)).sum(axis=0) for p in phase])
    # The same motion through the air: over ground the aircraft goes with the wind, and feels it gain speed.
    turn = np.array([attitude_matrix(*e) for e in bench.Motion(np.random.default_rng(10)).euler(t).T])
    felt = np.einsum("nij,in->jn", turn, gained)
    added = dict(zip((*GROUND, "state/ax", "state/ay", "state/az"), (*wind, *felt), strict=True))
    added["state/alt"] = -running_integral(wind[2], 0.04)
    gusty = record.with_channels(
        *(replace(record.channel(n), values=record[n] + v) for n, v in added.items())
    )
    wanted = bench.ERRORS[bench.WITH_GROUND]
    constant, walking = (
        check_kinematics(gusty, KinematicSettings(parameters=wanted, gusts=gusts)) for gusts in (0.0, None)
    )
    assert "v scale" in constant.undetermined
    assert not walking.undetermined
    for name in ("u delay", "v scale", "w scale", "w bias", "phi bias", "ay bias"):
        assert abs(walking[name][0]) < 4 * walking[name][1]
    assert walking["w bias"][1] < 0.5 * constant["w bias"][1]


def test_check_says_what_it_cannot_use(bench):
    record = bench.fly(1, bench.AIR_DATA, {})
    bare = replace(record, channels={n: c for n, c in record.channels.items() if n in bench_inertial()})
    with pytest.raises(DataError, match="nothing to compare"):
        check_kinematics(bare)
    with pytest.raises(DataError, match="'state/q' is missing"):
        check_kinematics(
            replace(record, channels={n: c for n, c in record.channels.items() if n != "state/q"})
        )
    with pytest.raises(DataError, match="expected at least 256"):
        check_kinematics(record.cut(0.0, 8.0))
    with pytest.raises(UsageError, match=r"'alfa delay' is none of.*alpha delay"):
        check_kinematics(record, KinematicSettings(parameters=("alfa delay",)))
    with pytest.raises(UsageError, match="longest_delay_s is 0, expected a positive"):
        check_kinematics(record, KinematicSettings(longest_delay_s=0.0))
    with pytest.raises(UsageError, match="gusts is -1 m/s"):
        check_kinematics(record, KinematicSettings(gusts=-1.0))
    steep = replace(record.channel("state/theta"), values=record["state/theta"] + 1.4)
    with pytest.raises(DataError, match="80 deg"):
        check_kinematics(record.with_channels(steep))
    placed = replace(record.channel("air/alpha"), position_m=(1.0, 0.0, 0.0))
    with pytest.raises(DataError, match="does not describe its vehicle"):
        check_kinematics(record.with_channels(placed))
    late = bench.fly(1, bench.AIR_DATA, {"alpha delay": 0.2})
    with pytest.raises(DataError, match=r"'alpha delay' runs to 0\.1 s, the limit.*raise longest_delay_s"):
        check_kinematics(late, KinematicSettings(parameters=("alpha delay",), longest_delay_s=0.1))


def test_covariance_of_a_coloured_residual_is_that_of_repeated_noise():
    rng = np.random.default_rng(1)
    t = np.arange(600) / 600
    jacobian = np.array([[1 + 0 * t, t], [np.sin(9 * t), 0 * t + 0.3], [t**2, np.cos(20 * t)]])
    columns = jacobian.reshape(3, -1)
    dual = np.linalg.solve(columns @ columns.T, columns)
    estimates, stated, inside = [], [], []
    for _ in range(300):
        noise = np.array([lfilter([1], [1, -0.8], rng.standard_normal(900))[300:], rng.standard_normal(600)])
        theta = dual @ noise.ravel()
        covariance, dof = coloured_covariance(jacobian, noise - np.einsum("m,mkn->kn", theta, jacobian))
        estimates.append(theta)
        stated.append(covariance)
        half = stdtrit(dof, 0.975) * np.sqrt(np.diag(covariance))
        inside.append(np.abs(theta) < half)
    spread = np.cov(np.array(estimates).T)
    np.testing.assert_allclose(np.sqrt(np.diag(np.mean(stated, axis=0))), np.sqrt(np.diag(spread)), rtol=0.12)
    assert 0.92 < np.mean(inside) < 0.99
    naive = np.sqrt(np.diag(np.linalg.inv(columns @ columns.T)))
    assert (np.sqrt(np.diag(spread)) > 1.15 * naive).any()

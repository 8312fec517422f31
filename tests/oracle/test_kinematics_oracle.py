"""The compatibility check beside dense algebra, beside sums written out, and on real aircraft."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from freqid.flightlog.read import read_log
from freqid.identify.sensors.flight_path import FlightPath, integrate_path, skew
from freqid.identify.sensors.kinematics import KinematicSettings, check_kinematics, corrected
from freqid.identify.sensors.path_noise import PathNoise, estimate_gusts, whiten

MAPS = Path(__file__).resolve().parents[2] / "scenarios" / "maps"
DT = 0.1


@pytest.fixture(scope="module")
def path() -> FlightPath:
    t = DT * np.arange(60)
    rates = 0.3 * np.array([np.sin(t), np.cos(0.7 * t), np.sin(1.3 * t + 1)])
    force = np.array([np.cos(t), 0.5 * np.sin(2 * t), -9.8 + np.sin(t)])
    return integrate_path(rates, force, DT, 10, np.eye(3), [20.0, 0.0, 1.0], 50.0)


def test_whitened_columns_are_generalised_least_squares_with_the_whole_covariance_written_out(path):
    rng = np.random.default_rng(0)
    window, n, k, m = slice(10, 45), 35, 3, 4
    noise = PathNoise(
        np.array([0.02, 0.03, 0.01]), np.array([0.2, 0.1, 0.3]), 0.15, 1.3, np.array([0.1, 0.05, 0.2])
    )
    decay = np.exp(-DT / 1.3)
    seen, z = rng.standard_normal((k, 10, n)), rng.standard_normal((1 + m, k, n))
    seen[:, 6] *= 0.1

    # How a kick of sample i in the ten states shows in sample l > i, one product of steps after the other.
    steps = []
    for i in range(10, 45):
        step = np.eye(10)
        step[3:6, :3] = -DT * skew(path.force[:, i])
        step[6, 5] = -DT
        step[7:, 7:] *= decay
        steps.append(step)
    covariance = np.zeros((n, k, n, k))
    for i in range(-1, n - 1):
        kick = np.zeros((10, 10))
        if i < 0:  # gusts blow already
            kick[7:, 7:] = noise.gusts**2 * np.eye(3)
        else:
            turn = path.turn[:, :, 10 + i]
            kick[:3, :3] = turn @ np.diag(noise.rates**2) @ turn.T * DT**2
            kick[3:6, 3:6] = turn @ np.diag(noise.force**2) @ turn.T * DT**2
            kick[7:, 7:] = noise.gusts**2 * (1 - decay**2) * np.eye(3)
        shown, reach = np.zeros((n, k, 10)), np.eye(10)
        for l in range(i + 1, n):
            shown[l] = seen[:, :, l] @ reach
            reach = steps[l] @ reach
        covariance += np.einsum("lax,xy,mby->lamb", shown, kick, shown)
    covariance = covariance.reshape(n * k, n * k) + np.kron(np.eye(n), np.diag(noise.outputs**2))

    white, log_determinant = whiten(path, window, seen, noise, z)
    assert log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)
    white = white.reshape(1 + m, -1)
    dense = z.transpose(0, 2, 1).reshape(1 + m, n * k)
    np.testing.assert_allclose(white @ white.T, dense @ np.linalg.solve(covariance, dense.T), rtol=1e-9)


def test_gusts_are_as_strong_as_the_residual_was_made_and_their_limits_hold(path):
    """Residuals drawn from gusts of 0.4 m/s; of 40 draws the limits of 95 % hold it in 34 or more."""
    rng, std, time, n = np.random.default_rng(3), 0.4, 1.3, 50
    seen = np.zeros((3, 10, n))
    seen[:, 7:] = -np.eye(3)[:, :, None]
    noise = PathNoise(np.full(3, 1e-6), np.full(3, 1e-6), 0.1, time, np.full(3, 0.1))
    decay, constant = np.exp(-DT / time), np.eye(3)[:, :, None] * np.ones(n)
    found, held = [], 0
    for _ in range(40):
        gust = std * rng.standard_normal((3, n))
        for i in range(1, n):
            gust[:, i] = decay * gust[:, i - 1] + np.sqrt(1 - decay**2) * gust[:, i]
        residual = 0.1 * rng.standard_normal((3, n)) - gust
        one = estimate_gusts(
            path, slice(5, 55), seen, noise, np.concatenate((residual[None], constant)), 1, limits=True
        )
        found.append(one.std)
        held += one.lower < std < one.upper
    assert np.median(found) == pytest.approx(std, rel=0.1)
    assert held >= 34
    calm = 0.1 * rng.standard_normal((3, n))
    none = estimate_gusts(
        path, slice(5, 55), seen, noise, np.concatenate((calm[None], constant)), 1, limits=True
    )
    assert none.lower == 0.0
    assert none.upper < 0.2


def test_integration_is_eulers_method_in_many_small_steps():
    def motion(t):
        rates = 0.4 * np.array([np.sin(t), np.cos(0.7 * t), np.sin(1.3 * t)])
        return rates, np.array([np.cos(t), 0.5 * np.sin(2 * t), -9.8 + np.sin(t)])

    t = 0.05 * np.arange(41)
    found = integrate_path(*motion(t), 0.05, 0, np.eye(3), [5.0, 0.0, 0.0], 10.0)
    for steps, atol in ((5_000, 2e-3), (10_000, 1e-3)):  # first order: half the step, half the error
        h, turn, velocity, height = 2 / steps, np.eye(3), np.array([5.0, 0.0, 0.0]), 10.0
        for i in range(steps):
            rates, force = motion((i + 0.5) * h)
            height -= velocity[2] * h
            velocity = velocity + (turn @ force + [0, 0, 9.80665]) * h
            turn = turn @ (np.eye(3) + h * skew(rates))
        np.testing.assert_allclose(found.turn[:, :, -1], turn, atol=atol)
        np.testing.assert_allclose(found.velocity[:, -1], velocity, atol=10 * atol)
        assert found.height[-1] == pytest.approx(height, abs=10 * atol)


@pytest.fixture(scope="module")
def attas(shared_data):
    return {
        name: read_log(shared_data / "fvsysid" / f"fAttas{name}.mat", MAPS / "attas.toml")
        for name in ("Elv1", "Elv2")
    }


@pytest.fixture(scope="module")
def attas_checks(attas):
    return {name: check_kinematics(record) for name, record in attas.items()}


def test_attas_vanes_are_late_as_equation_error_found_and_both_flights_agree(attas_checks):
    """Equation error on alpha': late by 110 ms, factor 0.937 (docs/theory/equation-error.md)."""
    one, two = attas_checks.values()
    for check in (one, two):
        late, error = check["alpha delay"]
        assert abs(late - 0.110) < 0.012
        assert error < 0.01
        assert abs(check["alpha scale"][0] + 0.063) < 2.5 * check["alpha scale"][1] < 0.03
        assert abs(check["beta delay"][0] - 0.09) < 2 * check["beta delay"][1]
        assert check.rms_after["air/alpha"] < 0.1 * check.rms_before["air/alpha"]
        # Level flight holds accelerometers and attitude together: only one of the two can be told.
        assert "ax bias" in check.undetermined["theta bias"]
    for name in ("p bias", "q bias", "r bias", "alpha delay", "beta delay", "attitude delay", "alpha scale"):
        apart = one[name][0] - two[name][0]
        assert abs(apart) < 2.6 * np.hypot(one[name][1], two[name][1]), name


def test_attas_once_corrected_is_on_time(attas, attas_checks):
    again = check_kinematics(corrected(attas["Elv1"], attas_checks["Elv1"]))
    assert abs(again["alpha delay"][0]) < 0.01
    assert abs(again["alpha scale"][0]) < 0.015
    assert abs(again["q bias"][0]) < 3e-4


def test_turbulence_hides_what_hfbs_vanes_do_unless_it_is_denied(shared_data):
    """Equation error: lift fits best at 170 ms, kinematics at 250 ms, blurred by gusts: no single delay."""
    record = read_log(shared_data / "fvsysid" / "hfb320_1_10.asc", MAPS / "hfb320.toml")
    check = check_kinematics(record)
    assert check.gusts.lower > 0.2
    assert not check.instruments
    assert {"alpha delay", "alpha scale", "beta delay", "V delay"} <= set(check.undetermined)
    mended = corrected(record, check)
    used = np.isin(record.time, mended.time)
    assert np.array_equal(mended["air/alpha"], record["air/alpha"][used])
    still = check_kinematics(record, KinematicSettings(gusts=0.0))
    late, error = still["alpha delay"]
    assert 0.17 < late < 0.27
    assert 0.01 < error < 0.05

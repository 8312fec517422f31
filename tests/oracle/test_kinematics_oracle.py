"""The compatibility check beside dense algebra, beside sums written out, and on real aircraft."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from freqid.flightlog.read import read_log
from freqid.identify.sensors.flight_path import FlightPath, integrate_path, skew
from freqid.identify.sensors.kinematic_fit import PathNoise, whiten
from freqid.identify.sensors.kinematics import KinematicSettings, check_kinematics, corrected

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
        np.array([0.02, 0.03, 0.01]), np.array([0.2, 0.1, 0.3]), 0.15, np.array([0.1, 0.05, 0.2])
    )
    seen, z = rng.standard_normal((k, 10, n)), rng.standard_normal((1 + m, k, n))
    seen[:, 6] *= 0.1

    # How a kick of sample i in the ten states shows in sample l > i, one product of steps after the other.
    steps = []
    for i in range(10, 45):
        step = np.eye(10)
        step[3:6, :3] = -DT * skew(path.force[:, i])
        step[6, 5] = -DT
        steps.append(step)
    covariance = np.zeros((n, k, n, k))
    for i in range(n - 1):
        turn = path.turn[:, :, 10 + i]
        kick = np.zeros((10, 10))
        kick[:3, :3] = turn @ np.diag(noise.rates**2) @ turn.T * DT**2
        kick[3:6, 3:6] = turn @ np.diag(noise.force**2) @ turn.T * DT**2
        kick[7:, 7:] = noise.wind**2 * DT * np.eye(3)
        shown, reach = np.zeros((n, k, 10)), np.eye(10)
        for l in range(i + 1, n):
            shown[l] = seen[:, :, l] @ reach
            reach = steps[l] @ reach
        covariance += np.einsum("lax,xy,mby->lamb", shown, kick, shown)
    covariance = covariance.reshape(n * k, n * k) + np.kron(np.eye(n), np.diag(noise.outputs**2))

    white = whiten(path, window, seen, noise, z).reshape(1 + m, -1)
    dense = z.transpose(0, 2, 1).reshape(1 + m, n * k)
    np.testing.assert_allclose(white @ white.T, dense @ np.linalg.solve(covariance, dense.T), rtol=1e-9)


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
        assert check["beta delay"][0] == pytest.approx(0.09, abs=0.03)
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


def test_hfb_measures_alpha_late_too(shared_data):
    """Equation error: lift fits best at 170 ms, kinematics at 250 ms, blurred by gusts."""
    record = read_log(shared_data / "fvsysid" / "hfb320_1_10.asc", MAPS / "hfb320.toml")
    check = check_kinematics(record)
    late, error = check["alpha delay"]
    assert 0.17 < late < 0.27
    assert 0.01 < error < 0.05
    assert check.rms_after["air/alpha"] < check.rms_before["air/alpha"]
    assert "V delay" in check.undetermined  # airspeed moves too slowly, and in gusts
    gusts = check_kinematics(record, KinematicSettings(parameters=check.names, wind_walk=0.5))
    assert abs(gusts["alpha delay"][0] - late) < 3 * np.hypot(gusts["alpha delay"][1], error)

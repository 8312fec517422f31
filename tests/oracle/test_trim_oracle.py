"""Trims found again by a general solver on the slow wrench, which shares no code with the simulation."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from slow_airframe import SlowAirframe, turn

from freqid.core.scenario import read_scenario
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle as motion

PATH = Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml"
SCENARIO = read_scenario(PATH)[0]
WEIGHT = 28.6 * 9.80665


@pytest.fixture(scope="module")
def parameters():
    return jax.tree.map(jnp.asarray, motion.parameters(SCENARIO))


def centre_of_gravity(table: dict, tilt: float) -> np.ndarray:
    """With both wings turned by the same tilt, from the numbers of the scenario file."""
    vehicle = table["vehicle"]
    moment = vehicle["mass_kg"] * np.array(vehicle["cg_m"])
    for wing in table["wing"]:
        pivot, arm = np.array(wing["pivot_m"]), np.array(wing["cg_m"]) - wing["pivot_m"]
        moment += wing["mass_kg"] * (pivot + turn(arm, tilt) - np.array(wing["cg_m"]))
    return moment / vehicle["mass_kg"]


def unbalanced(slow: SlowAirframe, reference, phi, theta, surface, speed) -> np.ndarray:
    """Force with the weight and moment about the centre of gravity, over the weight."""
    u, tilt = reference.u, reference["dw1"]
    down = np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    velocity = np.array([u, 0.0, -u * down[0] / down[2]])
    still = np.zeros(3)
    force, moment, _, _ = slow.wrench(velocity, still, reference.rho, surface, [tilt] * 2, np.zeros(2), speed)
    moment = moment - np.cross(centre_of_gravity(slow.table, tilt), force)
    return np.concatenate([force + WEIGHT * down, moment]) / WEIGHT


@pytest.mark.parametrize("name", ["u00", "u40", "u85-1500m"])
def test_the_slow_wrench_balances_at_the_trim(parameters, name):
    reference = SCENARIO.reference_of(name)
    at = trim(SCENARIO, parameters, reference)
    left = unbalanced(
        SlowAirframe(PATH),
        reference,
        *at.angles,
        np.asarray(at.positions.surface),
        np.asarray(at.positions.speed),
    )
    assert np.abs(left).max() < 1e-8


def test_least_squares_on_the_slow_wrench_finds_the_same_trim(parameters):
    """Three unknowns that a pilot would use, the others where the trim has them; started far away."""
    reference = SCENARIO.reference_of("u40")
    at = trim(SCENARIO, parameters, reference)
    slow, surface = SlowAirframe(PATH), np.asarray(at.positions.surface)
    spread = np.asarray(at.positions.speed) - np.mean(at.positions.speed)

    def left(x):
        theta, speed, elevator = x[0], 100 * x[1], x[2]
        moved = surface + elevator * np.array([1, 1, -1, -1, 0, 0, 0, 0, 0, 0])  # elevons, front against rear
        return unbalanced(slow, reference, at.angles[0], theta, moved, speed + spread)[[0, 2, 4]]

    found = least_squares(left, [0.1, 6.0, 0.2], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert np.abs(found.fun).max() < 1e-9
    assert found.x[0] == pytest.approx(at.angles[1], abs=1e-7)
    assert 100 * found.x[1] == pytest.approx(float(np.mean(at.positions.speed)), rel=1e-7)
    assert found.x[2] == pytest.approx(0, abs=1e-7)

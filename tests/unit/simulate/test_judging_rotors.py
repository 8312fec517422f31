"""Rotors of the judging tilt-rotor against blade elements added up one by one."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

FILE = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "tiltrotor" / "rotors.py"
SPEED, RHO, PITCH, SOLIDITY = 380.0, 1.2, 0.235, 0.072
FORWARD = np.array([16.0, 1.0, 2.0])


class Nominal:
    """No departures."""

    def has(self, *prefixes):
        return False

    def __call__(self, name):
        return 0.0


@pytest.fixture(scope="module")
def rotors():
    spec = importlib.util.spec_from_file_location("judging_rotors", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def summed(axis, spin, radius, induced, slope, profile):
    """Return force and moment of two blades at small angles, by 200 elements at 180 azimuths."""
    chord = SOLIDITY * np.pi * radius / 2
    r = (np.arange(200) + 0.5) / 200 * radius
    across = np.array([0.0, 1.0, 0.0])
    force, moment = np.zeros(3), np.zeros(3)
    for azimuth in (np.arange(180) + 0.5) / 180 * 2 * np.pi:
        out = np.cos(azimuth) * across + np.sin(azimuth) * np.cross(axis, across)
        ahead = spin * np.cross(axis, out)
        met = SPEED * r + FORWARD @ ahead
        angle = (FORWARD @ axis + induced) / met
        scale = 0.5 * RHO * met**2 * chord * radius / 200
        lift, drag = scale * slope * (PITCH - angle), scale * profile
        part = lift[:, None] * axis - (drag + lift * angle)[:, None] * ahead
        force += 2 * part.sum(axis=0) / 180
        moment += 2 * np.cross(r[:, None] * out, part).sum(axis=0) / 180
    return force, moment


@pytest.mark.parametrize("spin", [1, -1])
def test_thrust_and_in_plane_loads_are_those_of_blade_elements(rotors, spin):
    axis = np.array([np.cos(0.96), 0.0, -np.sin(0.96)])
    described = [{"axis": axis, "position_m": [0.0, 0.0, 0.0], "spin": spin, "diameter_m": 0.5}]
    air = rotors.Rotors(("one",), described, np.array([SOLIDITY]), np.array([PITCH]), ["all"])
    x, rho = np.zeros((9, 1)), np.array([RHO])
    x[:3, 0] = FORWARD
    flow = air.flow(x, np.array([[SPEED]]), rho, Nominal())
    force, moment = summed(axis, spin, 0.25, flow.induced[0, 0], rotors.SLOPE, rotors.PROFILE)
    assert flow.thrust[0, 0] == pytest.approx(force @ axis, rel=1e-4)
    dragged, rolled = air.in_plane(flow, rho, 1.0)
    np.testing.assert_allclose(dragged[:, 0], force - (force @ axis) * axis, rtol=1e-4)
    np.testing.assert_allclose(rolled[:, 0], moment - (moment @ axis) * axis, rtol=1e-4)


def test_induced_velocity_is_what_the_mass_flow_needs_for_the_thrust(rotors):
    described = [{"axis": [0.0, 0.0, -1.0], "position_m": [0.0, 0.0, 0.0], "spin": 1, "diameter_m": 0.5}]
    air = rotors.Rotors(("one",), described, np.array([SOLIDITY]), np.array([PITCH]), ["all"])
    x, rho = np.zeros((9, 1)), np.array([RHO])
    x[:3, 0] = FORWARD
    flow = air.flow(x, np.array([[SPEED]]), rho, Nominal())
    through = np.hypot(np.hypot(16.0, 1.0), -2.0 + flow.induced[0, 0])
    needed = 2 * RHO * np.pi * 0.25**2 * through * flow.induced[0, 0]
    assert flow.thrust[0, 0] == pytest.approx(needed, rel=1e-4)
    assert air.wake(flow, rho)[0, 0] == pytest.approx(2 * flow.induced[0, 0], rel=1e-4)

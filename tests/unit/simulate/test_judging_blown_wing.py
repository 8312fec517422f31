"""Lifting line, propellers and owner of the judging blown wing against closed forms and slow sums."""

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from judging_owner import campaign_again, module_of

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "blownwing"
RHO = 1.2


loaded = partial(module_of, FOLDER)


@pytest.fixture(scope="module")
def line():
    return loaded("lifting_line")


@pytest.fixture(scope="module")
def propellers():
    return loaded("propellers")


@pytest.fixture(scope="module")
def simulation():
    return loaded("simulation")


def test_elliptical_wing_meets_the_closed_form(line):
    span, root, speed, angle = 3.0, 0.4, 20.0, 0.01
    edges = 0.5 * span * np.sin(np.linspace(0, np.pi / 2, 61))
    middles = 0.5 * (edges[1:] + edges[:-1])
    wing = line.LiftingLine(edges, root * np.sqrt(1 - (2 * middles / span) ** 2))
    lift, wash = wing.lift(np.full((120, 1), speed), np.full((120, 1), speed * angle))
    aspect = span**2 / wing.area.sum()
    closed = line.SLOPE * angle / (1 + line.SLOPE / (np.pi * aspect))
    total = (wing.area * lift).sum() / wing.area.sum()
    assert total == pytest.approx(closed, rel=0.01)
    assert (wing.area * lift * wash).sum() / speed / wing.area.sum() == pytest.approx(
        closed**2 / (np.pi * aspect), rel=0.03
    )


def test_sections_and_wash_of_a_strongly_loaded_wing_agree(line):
    """One correction of the circulation is enough: iterated to its end, lift changes by less than 0.1 %."""
    wing = line.LiftingLine(np.linspace(0, 1.6, 11), np.linspace(0.46, 0.30, 10), 0.47)
    ahead, through = np.full((20, 1), 17.0), np.linspace(1.5, 2.8, 20)[:, None]
    lift, _ = wing.lift(ahead, through)
    made = np.zeros((20, 1))
    for _ in range(400):
        angle = (through - wing.wash @ made) / ahead
        found = line.SLOPE * angle * (1 - line.ROUNDING * angle**2)
        made += 0.05 * (0.5 * wing.chord * math.cos(0.47) * ahead * found - made)
    np.testing.assert_allclose(lift, found, rtol=1e-3)


@pytest.mark.parametrize(("speed", "along"), [(711.0, 18.0), (910.0, 24.0), (640.0, 16.0)])
def test_propeller_is_the_one_that_halving_finds(propellers, speed, along):
    r, pitch = propellers.STATION, math.atan(propellers.PITCH / (2 * math.pi * propellers.STATION))
    way, blade = math.hypot(along, speed * r), math.atan2(along, speed * r)
    low, high = 0.0, 0.3 * way
    for _ in range(80):
        e = 0.5 * (low + high)
        met, phi = math.sqrt(way**2 - e**2), blade + math.asin(e / way)
        lift = propellers.SLOPE * math.sin(pitch - phi)
        bound = 0.5 * propellers.BLADES * propellers.CHORD * met * lift  # circulation of all blades
        shed = 4 * math.pi * r * propellers.LOSS * math.sin(phi) * e
        low, high = (e, high) if bound > shed else (low, e)
    drag = propellers.PROFILE + propellers.PROFILE_LIFT * lift**2
    area = propellers.BLADES * propellers.CHORD * propellers.LENGTH
    pressed = 0.5 * RHO * met**2 * area
    thrust = pressed * (lift * math.cos(phi) - drag * math.sin(phi))
    torque = r * pressed * (lift * math.sin(phi) + drag * math.cos(phi))
    made = propellers.propeller(np.array(RHO), np.array(speed), np.array(along))
    np.testing.assert_allclose(made, (thrust, torque, e * math.cos(phi), e * math.sin(phi)), rtol=1e-6)
    assert 0.5 < thrust * along / (torque * speed) < 0.9  # efficiency


def test_truth_and_owner_are_symmetrical(simulation):
    """The mirrored flight has the mirrored loads, in both."""
    truth = loaded("truth")
    x = np.array([18.0, 0.7, 1.6, 0.2, 0.1, -0.15, 0.0, 0.09, 0.0, 100.0])[:, None]
    felt = np.array([0.05, -0.02, -0.03, 0.04, 0.3, 0.42, 690.0, 720, 735, 700, 745, 705, 690, 715])[:, None]
    side = np.array([1.0, -1, 1, -1, 1, -1, 1, 1, 1, 1])[:, None]
    swap = [1, 0, 3, 2, 5, 4, 13, 12, 11, 10, 9, 8, 7, 6]
    sign = np.array([1.0, -1, 1, -1, 1, -1])
    none = loaded("../settings").Settings([{}])
    rho = np.array([RHO])
    flown = truth.loads(x, felt, rho, none, truth.Memory(x, felt, none))[:, 0]
    again = truth.loads(side * x, felt[swap], rho, none, truth.Memory(x, felt, none))[:, 0]
    np.testing.assert_allclose(again, sign * flown, rtol=1e-9, atol=1e-9)
    said = simulation.loads(math, x[:, 0].tolist(), felt[:, 0].tolist(), RHO, {})
    mirrored = simulation.loads(math, (side * x)[:, 0].tolist(), felt[swap][:, 0].tolist(), RHO, {})
    np.testing.assert_allclose(mirrored, sign * said, rtol=1e-9, atol=1e-9)
    assert abs(said[2] / flown[2] - 1) < 0.02


def test_jets_lift_the_wing_behind_them(simulation):
    """More thrust of one propeller: more lift on its side, and the vehicle rolls away from it."""
    truth = loaded("truth")
    at = truth.TRIM["u18"]
    x, felt = at["state"][:, None], np.repeat(at["command"][:, None], 2, axis=1)
    felt[12, 1] += 60.0  # r3
    x = np.repeat(x, 2, axis=1)
    none = loaded("../settings").Settings([{}, {}])
    made = truth.loads(x, felt, np.full(2, RHO), none, truth.Memory(x, felt, none))
    change = made[:, 1] - made[:, 0]
    assert change[0] > 0
    assert change[2] < 0
    assert change[3] < 0
    assert change[5] < 0


def test_committed_coefficients_are_those_that_the_campaign_finds(tmp_path):
    campaign_again(FOLDER, tmp_path)

"""Rotors, wing, late wash and owner of the judging air taxi against slow sums and closed forms."""

import importlib
import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from judging_owner import beside_truth, campaign_again, module_of

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "airtaxi"
RHO = 1.17
SETTLE, LASTING = 4.0, 10.0  # s of a flight before what is looked at, and of that


loaded = partial(module_of, FOLDER)


@pytest.fixture(scope="module")
def simulation():
    return loaded("simulation")


@pytest.fixture(scope="module")
def truth():
    return loaded("truth")


@pytest.fixture(scope="module")
def air(truth):
    return importlib.import_module("taxi_air")


@pytest.fixture(scope="module")
def rings(truth):
    return importlib.import_module("blade_rings")


@pytest.fixture(scope="module")
def steps(truth):
    return importlib.import_module("vortex_steps")


@pytest.fixture(scope="module")
def settings(truth):
    return importlib.import_module("settings")


def test_horseshoe_is_biot_and_savarts(steps):
    """A bound vortex and two legs, cut in short straight pieces."""
    at, left, right = np.array([-2.0, 0.7, 0.4]), -0.5, 1.1
    back = -np.concatenate([[0.0], np.geomspace(1e-3, 3000.0, 4001)])
    leg = lambda y: np.stack([back, np.full_like(back, y), np.zeros_like(back)], axis=1)  # noqa: E731
    across = np.linspace(left, right, 2001)
    bound = np.stack([0 * across, across, 0 * across], axis=1)
    down = 0.0
    for line in (leg(left)[::-1], bound, leg(right)):
        piece, middle = np.diff(line, axis=0), 0.5 * (line[1:] + line[:-1])
        away = at - middle
        down += (np.cross(piece, away) / np.linalg.norm(away, axis=1)[:, None] ** 3).sum(axis=0)[2] / (
            4 * np.pi
        )
    where = tuple(np.array([[x]]) for x in at)
    assert steps.induced(where, np.array([left]), np.array([right]))[0, 0] == pytest.approx(down, rel=1e-4)


def test_tapered_wing_is_glauerts(air):
    """Lift slope and bending of the tapered wing from the series of many terms."""
    wing = air.WING
    bound = wing.solve @ np.ones(wing.place.size)
    n = np.arange(1, 160, 2)
    angle = (np.arange(1, n.size + 1) - 0.5) * np.pi / 2 / n.size
    root, tip = wing.chord[np.argmin(air.OUT), 0], wing.chord[0, 0]
    slope = (tip - root) / (air.OUT[0, 0] - air.OUT.min())
    chord = root + slope * (0.5 * wing.span * np.cos(angle) - air.OUT.min())
    pull = (4 * wing.span / (wing.slope * chord) * np.sin(angle))[:, None]
    series = np.linalg.solve((pull + n) * np.sin(angle[:, None] * n), np.sin(angle))
    lift = (bound * wing.width[:, 0]).sum()
    assert lift == pytest.approx(0.5 * np.pi * wing.span**2 * series[0], rel=0.015)


def test_sections_lose_lift_beyond_a_large_angle(air, settings):
    """Small angles: the linear line. Far beyond: a share of the linear slope is lost."""
    n = air.WING.place.size
    none = settings.Settings([{}])
    along, still = np.full((n, 1), 45.0), np.zeros((n, 1))
    *_, bound = air.wing(along, along * -0.02, still, none)
    np.testing.assert_allclose(bound, air.WING.solve @ (along * (air.CAMBER - 0.02)), rtol=1e-3)
    *_, one = air.wing(along, along * 5.0, still, none)
    *_, two = air.wing(along, along * 6.0, still, none)
    linear = air.WING.solve @ along
    met = linear * 2 / (air.WING.chord * air.WING.slope)
    np.testing.assert_allclose(two - one, linear - air.LOST * air.WING.solve @ met, rtol=1e-6)


@pytest.mark.parametrize(
    ("kind", "speed", "along", "across"), [(0, 150.0, 37.0, 19.0), (4, 140.0, -1.0, 42.0)]
)
def test_rotor_is_the_sum_over_its_blades(air, rings, kind, speed, along, across):
    """Blade elements round the turn, in Drees's inflow, with lift and drag by angles."""
    d = rings.Discs([air.DISCS.radius[kind, 0]], air.DISCS.blades[kind], air.PITCH[:, kind : kind + 1])
    induced, radius = 4.0, d.radius[0, 0]
    made = rings.blades(d, RHO, *(np.array([[x]]) for x in (speed, along, across, induced)))
    turn = np.linspace(0, 2 * np.pi, 361)[:-1]
    tip, through = radius * speed, along + induced
    skew = through / across
    gradient = 4 / 3 * ((1 - 1.8 * (across / tip) ** 2) * math.sqrt(1 + skew * skew) - abs(skew))
    summed = np.zeros(6)
    for i, (x, share) in enumerate(zip(rings.RINGS, rings.SHARES, strict=True)):
        pitch = math.atan2(d.sine[i, 0, 0], d.cosine[i, 0, 0])
        slower = x * tip - induced * through / (x * tip)
        mean = math.sqrt((x * tip) ** 2 + through**2 + 0.5 * across**2)
        slope = rings.SLOPE / math.sqrt(1 - (mean / rings.SOUND) ** 2)
        lift0 = slope * (slower * math.sin(pitch) - through * math.cos(pitch)) / mean
        u, w = slower + across * np.sin(turn), through + induced * gradient * x * np.cos(turn)
        whole, angle = np.hypot(u, w), np.arctan2(w, u)
        lift = 0.5 * RHO * whole**2 * slope * np.sin(pitch - angle)
        drag = 0.5 * RHO * mean * whole * (rings.PROFILE + rings.POLAR * lift0**2)
        area, arm = d.blades[0, 0] * radius**2 * share, x * radius
        pull = area * (lift * np.cos(angle) - drag * np.sin(angle))
        push = area * (lift * np.sin(angle) + drag * np.cos(angle))
        each = (pull, arm * push, push * np.sin(turn), push * np.cos(turn))
        each += (arm * pull * np.sin(turn), -arm * pull * np.cos(turn))
        summed += [e.mean() for e in each]
    names = ("thrust", "torque", "dragged", "sideways", "advancing", "forward")
    np.testing.assert_allclose([getattr(made, n).item() for n in names], summed, rtol=1e-9)


def test_inflow_follows_momentum_with_the_air_of_pitt_and_peters(truth, rings, air, settings):
    """Steady: Glauert's thrust. On the way: the lag of 8/3 of density and radius cubed."""
    made, induced = rings.settled(
        air.DISCS, RHO, np.full((6, 1), 150.0), np.full((6, 1), 5.0), np.full((6, 1), 40.0)
    )
    total = np.sqrt((5.0 + induced) ** 2 + 40.0**2)
    np.testing.assert_allclose(made.thrust, 2 * RHO * air.DISCS.area * induced * total, rtol=1e-9)
    _, slow = rings.momentum(air.DISCS, RHO, 5.0, 40.0, induced, made.thrust)
    np.testing.assert_allclose(
        slow, 8 / 3 * RHO * air.DISCS.radius**3 / (2 * RHO * air.DISCS.area * total), rtol=1e-9
    )


def test_wash_arrives_when_vortices_pass(truth, air, settings):
    none = settings.Settings([{}])
    x = np.array([42.0, 0, 0, 0, 0, 0, 0, 0, 0, 100])[:, None]
    memory = truth.Memory(x, None, none)
    seen = []
    for k in range(30):
        memory.shed = np.full((4, 1), 1.0 if k < 3 else 2.0)
        memory.step(x, None, RHO, none, 0.01)
        seen.append(memory.met[:, 0].copy())
    late = air.WAY[:, 0] / 42.0 / 0.01  # steps
    come = np.arange(30)[:, None, None] - 3 - late[:, None] * np.array(air.NEAR) + 1
    np.testing.assert_allclose(seen, 1 + np.clip(come, 0, 1).mean(axis=2), atol=1e-9)


def settled(truth, x, felt, s):
    memory = truth.Memory(x, felt, s)
    rho = np.array([RHO])
    for _ in range(60):  # until inflow and wash are there
        made = truth.loads(x, felt, rho, s, memory)
        memory.step(x, felt, rho, s, 0.01)
    return made


def test_truth_and_owner_are_symmetrical_and_agree(truth, simulation, settings):
    """The mirrored flight has the mirrored loads, in both."""
    x = np.array([42.3, 0.8, 2.4, 0.06, 0.04, -0.05, 0.0, 0.06, 0.0, 100.0])[:, None]
    felt = np.array([0.04, -0.03, -0.04, -0.06, 0.03, 152.0, 147, 150, 148, 143, 138])[:, None]
    side = np.array([1.0, -1, 1, -1, 1, -1, 1, 1, 1, 1])[:, None]
    swap, turn = [1, 0, 3, 2, 4, 8, 7, 6, 5, 10, 9], np.array([1.0] * 4 + [-1] + [1] * 6)[:, None]
    sign = np.array([1.0, -1, 1, -1, 1, -1])
    none = settings.Settings([{}])
    one = settled(truth, x, felt, none)[:, 0]
    mirrored = (turn * felt)[swap]
    np.testing.assert_allclose(
        settled(truth, side * x, mirrored, none)[:, 0], sign * one, rtol=1e-9, atol=1e-6
    )
    said = np.array(simulation.loads(math, x[:, 0].tolist(), felt[:, 0].tolist(), RHO, {}))
    again = simulation.loads(math, (side * x)[:, 0].tolist(), mirrored[:, 0].tolist(), RHO, {})
    np.testing.assert_allclose(again, sign * said, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(said, one, rtol=0.03, atol=50.0)


@pytest.mark.slow
def test_owner_with_true_tolerances_has_the_loads_of_nulls(truth, simulation, settings):
    """Flown without noise: what varies within some percent; means within half of what he leaves open."""
    for felt in beside_truth(truth, simulation, 4, SETTLE, LASTING, within=0.5):
        assert (np.abs(felt[:5]) < 0.3).all()
        assert (felt[5:] > 100).all()
        assert (felt[5:] < 230).all()


def test_wrench_of_a_record_is_that_of_its_moments(truth, simulation):
    """Steady series and single moments have the same loads, and the trim carries the weight."""
    at = truth.TRIM["u42"]
    state = {n: np.full(5, v) for n, v in zip(("u", "v", "w", "p", "q", "r"), at["state"][:6], strict=True)}
    effector = {n: np.full(5, v) for n, v in zip(truth.EFFECTORS, at["command"], strict=True)}
    made = simulation.wrench(0.02 * np.arange(5), state, effector, {"rho": np.full(5, at["rho"])}, {})
    one = simulation.loads(math, at["state"].tolist(), at["command"].tolist(), at["rho"], {})
    for name, value in zip("XYZLMN", one, strict=True):
        np.testing.assert_allclose(made[name], value, atol=1e-6)
    assert abs(one[2] / 9.80665 / truth.MASS + 1) < 0.002


def test_committed_coefficients_are_those_that_the_campaign_finds(tmp_path):
    campaign_again(FOLDER, tmp_path)

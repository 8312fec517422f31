"""Blades, wakes, wing and owner of the judging winged hexacopter against slow sums and closed forms."""

import importlib
import math
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from judging_owner import beside_truth, campaign_again, module_of
from scipy.optimize import brentq

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "winghex"
RHO = 1.18
SETTLE, LASTING = 5.0, 10.0  # s of a flight before what is looked at, and of that


loaded = partial(module_of, FOLDER)


@pytest.fixture(scope="module")
def simulation():
    return loaded("simulation")


@pytest.fixture(scope="module")
def truth():
    return loaded("truth")


@pytest.fixture(scope="module")
def air(truth):
    return importlib.import_module("hex_air")


def test_rotor_is_the_sum_over_its_blades(truth, air):
    """Forces of blade elements as vectors, station by station round the turn, for both senses of rotation."""
    rotors = importlib.import_module("edgewise_rotors")
    none = loaded("../settings").Settings([{}])
    radius, speed, flow = 0.24, 352.0, np.array([14.0, 1.1, -0.5])
    tip = radius * speed
    for k in (0, 1):
        axis, spin = air.AXIS[:, k, 0], air.SPIN[k, 0]
        climb = axis @ flow
        edge = flow - climb * axis
        wide = np.linalg.norm(edge)
        way, aft = edge / wide, -edge / wide
        x, turn = (np.arange(300) + 0.5) / 300, np.linspace(0, 2 * np.pi, 181)[:-1]
        out = np.cos(turn)[:, None] * aft + spin * np.sin(turn)[:, None] * np.cross(axis, aft)
        moves = spin * np.cross(axis, out)  # of each blade
        ahead = tip * x[:, None] + (moves @ edge)
        fore = np.cos(turn)

        def elements(induced, x=x, fore=fore, ahead=ahead, climb=climb, wide=wide):
            skew = wide / (climb + induced + math.hypot(wide, climb + induced))
            down = climb + induced * (1 + rotors.GRADIENT * skew * x[:, None] * fore)
            pitch = (rotors.ROOT + rotors.TWIST * x)[:, None]
            area = 0.5 * RHO * rotors.SOLIDITY * np.pi * radius**2 / x.size / fore.size
            lift = area * rotors.SLOPE * (pitch * ahead**2 - down * ahead)
            drag = area * (rotors.SLOPE * (pitch * down * ahead - down**2) + rotors.PROFILE * ahead**2)
            return lift, drag

        def balance(induced, wide=wide, climb=climb, elements=elements):
            momentum = 2 * RHO * np.pi * radius**2 * induced * math.hypot(wide, climb + induced)
            return momentum - elements(induced)[0].sum()

        lift, drag = elements(brentq(balance, 0.1, 20.0, xtol=1e-12))
        force = axis * lift.sum() - drag.sum(axis=0) @ moves
        felt = lift[..., None] * axis - drag[..., None] * moves
        moment = np.cross((radius * x)[:, None, None] * out, felt).sum(axis=(0, 1))
        one, two, thrust = air.rotors(
            flow[:, None, None], np.array([[speed]]), np.array([RHO]), none, (truth.ROTORS[k],)
        )
        assert thrust[0, 0] == pytest.approx(lift.sum(), rel=1e-4)
        np.testing.assert_allclose(one[:, 0, 0], force, rtol=1e-3, atol=1e-3)
        np.testing.assert_allclose(two[:, 0, 0], moment, rtol=1e-3, atol=1e-4)
        # The side that advances lifts more: right of the way for a spin up the axis
        assert (two[:, 0, 0] @ way) * spin < 0


def test_slender_wing_is_prandtls():
    """It lifts as Glauert's Fourier series says along the span; an ellipse is washed evenly."""
    ratio = 40.0
    wing = loaded("weissinger").Wing(ratio, 1.0, panels=80)
    bound = (wing.solve @ np.ones((160, 1)))[:, 0]
    width = wing.width[:, 0]
    n = np.arange(1, 120, 2)
    angle = (np.arange(1, n.size + 1) - 0.5) * np.pi / 2 / n.size
    pull = 4 * ratio / (2 * np.pi) * np.sin(angle)[:, None]
    series = np.linalg.solve((pull + n) * np.sin(angle[:, None] * n), np.sin(angle))
    at = np.arccos(-wing.place[:, 0] / (0.5 * ratio))
    closed = 2 * ratio * np.sin(at[:, None] * n) @ series
    # The tips are of lower aspect ratio than a line
    np.testing.assert_allclose(bound[32:-32], closed[32:-32], rtol=0.015)
    lift = 2 * (bound * width).sum() / ratio
    assert lift == pytest.approx(np.pi * ratio * series[0], rel=0.01)
    ellipse = wing.wash @ np.sqrt(1 - (wing.place / (0.5 * ratio)) ** 2)[:, 0]
    np.testing.assert_allclose(ellipse[32:-32], 1 / (2 * ratio), rtol=0.02)


def test_horseshoe_is_the_sum_of_its_pieces():
    """Biot and Savart's law, integrated along bound vortex and legs."""
    weissinger = loaded("weissinger")
    at = np.array([-1.3, 0.25, -0.4])
    left, right, far = -0.2, 0.35, -400.0
    corners = np.array([[far, left, 0], [0, left, 0], [0, right, 0], [far, right, 0]])
    total = np.zeros(3)
    for a, b in pairwise(corners):
        # Fine where it is near: points in the cube of the distance from the nearer end
        share = np.linspace(0, 1, 40001) ** 3
        points = b + share[:, None] * (a - b) if a[0] < b[0] else a + share[:, None] * (b - a)
        step, middle = np.diff(points, axis=0), 0.5 * (points[1:] + points[:-1])
        step = -step if a[0] < b[0] else step
        away = at - middle
        total += (np.cross(step, away) / np.linalg.norm(away, axis=1)[:, None] ** 3).sum(axis=0)
    total /= 4 * np.pi
    made = weissinger.downwash(tuple(at), left, right, 0.0)
    assert abs(made) == pytest.approx(abs(total[2]), rel=1e-3)
    assert made > 0  # air goes down behind a wing that lifts


def test_far_wake_of_a_disc_has_its_momentum(air):
    """Lift is density, speed, circulation and the vortices' distance; air goes down between them."""
    u, thrust = 14.0, 11.0
    made = thrust / (RHO * u * 2 * air.HALF_PAIR)
    each = air.wakes(np.full((len(air.PAIRS), 1), made), np.zeros(1), np.zeros(1), np.array([u]))[:, 0]
    at = air.PAIRS.index((1, air.PANELS + 1))
    way, sunk = 1.36, air.SINK / (np.pi * air.HALF_PAIR) * 1.36 * made / u
    radius2 = air.HALF_PAIR**2 + sunk**2 + air.CORE**2
    closed = made / np.pi * air.HALF_PAIR / radius2 * 0.5 * (1 + way / math.hypot(way, 0.24))
    assert each[at] == pytest.approx(closed, rel=1e-9)
    ideal = thrust / (2 * RHO * np.pi * 0.24**2 * u)
    assert 0.5 < each[at] / ideal < 2.0  # once at the disc, twice far behind
    beside = air.PAIRS.index((3, air.PANELS + 1))
    assert each[beside] < 0  # upwash outside
    assert not any(k in (2, 3) and j < air.PANELS for k, j in air.PAIRS)


def test_wakes_arrive_one_convection_later(truth, air):
    none = loaded("../settings").Settings([{}])
    x = np.array([16.0, 0, 0, 0, 0, 0, 0, 0, 0, 100])[:, None]
    felt = truth.TRIM["u16"]["command"][:, None]
    memory, rho = truth.Memory(x, felt, none), np.array([RHO])
    seen = []
    for k in range(20):
        memory.made = np.full((6, 1), 1e-6 if k < 5 else 2e-6)
        memory.step(x, felt, rho, none, 0.01)
        seen.append(memory.met[air.PANELS + 1, 0])
    share = (np.array(seen) - seen[0]) / seen[0]
    at = [air.PAIRS.index((source, air.PANELS + 1)) for source in (1, 0, 3, 2)]
    each = air.wakes(np.full((len(air.PAIRS), 1), 1e-6), np.zeros(1), np.zeros(1), np.array([16.0]))[:, 0]
    late = np.array([air.WAY[i, 0] for i in at]) / 16.0 / 0.01  # steps
    come = np.clip(np.arange(20)[:, None] - 5 - late + 1, 0, 1)
    np.testing.assert_allclose(share, come @ each[at] / each[at].sum(), atol=1e-4)


def test_owners_wakes_of_several_lags_are_those_of_one_each(simulation):
    owner = sys.modules[simulation.Owner.__module__]
    time, slow = 0.02 * np.arange(500), np.array([0.05, 0.12])
    values = np.array([np.sin(3 * time), np.cos(5 * time)])
    made = owner._series_lag(time)(values, slow)
    for row, value, s in zip(made, values, slow, strict=True):
        np.testing.assert_array_equal(row, owner._series_lag(time)(value, float(s)))
    many, each = owner._Lag(), [owner._Lag(), owner._Lag()]
    for now in values.T:
        one = [lag(float(v), float(s)) for lag, v, s in zip(each, now, slow, strict=True)]
        np.testing.assert_allclose(many(now, slow), one, atol=1e-12)
        for lag in (many, *each):
            lag.advance(0.02)


def settled(truth, x, felt, rho, s):
    memory = truth.Memory(x, felt, s)
    for _ in range(60):  # until the wakes are there
        made = truth.loads(x, felt, rho, s, memory)
        memory.step(x, felt, rho, s, 0.01)
    return made


def test_truth_and_owner_are_symmetrical_and_agree(truth, simulation):
    """The mirrored flight has the mirrored loads, in both."""
    x = np.array([13.2, 0.5, 0.3, 0.2, 0.1, -0.15, 0.0, 0.03, 0.0, 100.0])[:, None]
    felt = np.array([0.05, -0.02, 0.03, 0.04, 340.0, 352, 348, 351, 345, 339])[:, None]
    side = np.array([1.0, -1, 1, -1, 1, -1, 1, 1, 1, 1])[:, None]
    swap, turn = [1, 0, 2, 3, 5, 4, 7, 6, 9, 8], np.array([1.0, 1, 1, -1] + [1] * 6)[:, None]
    sign = np.array([1.0, -1, 1, -1, 1, -1])
    none = loaded("../settings").Settings([{}])
    rho = np.array([RHO])
    one = settled(truth, x, felt, rho, none)[:, 0]
    mirrored = (turn * felt)[swap]
    np.testing.assert_allclose(
        settled(truth, side * x, mirrored, rho, none)[:, 0], sign * one, rtol=1e-9, atol=1e-9
    )
    said = np.array(simulation.loads(math, x[:, 0].tolist(), felt[:, 0].tolist(), RHO, {}))
    again = simulation.loads(math, (side * x)[:, 0].tolist(), mirrored[:, 0].tolist(), RHO, {})
    np.testing.assert_allclose(again, sign * said, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(said, one, rtol=0.03, atol=0.15)


def test_half_of_the_weight_is_on_the_rotors(truth, air):
    for at in truth.TRIM.values():
        x, felt = at["state"][:, None], at["command"][:, None]
        none = loaded("../settings").Settings([{}])
        memory = truth.Memory(x, felt, none)
        for _ in range(60):
            made = truth.loads(x, felt, np.array([at["rho"]]), none, memory)
            memory.step(x, felt, np.array([at["rho"]]), none, 0.01)
        carried = memory.made * at["rho"] * x[0] * 2 * air.HALF_PAIR
        weight = 9.80665 * truth.MASS
        assert 0.50 < carried.sum() / weight < 0.60
        assert made[2, 0] == pytest.approx(-weight * math.cos(at["state"][7]), rel=0.01)
        assert carried[4, 0] < 0.9 * carried[0, 0]  # in the wakes of those ahead


@pytest.mark.slow
def test_owner_with_true_tolerances_has_the_loads_of_nulls(truth, simulation):
    """Flown without noise: what varies within some percent, means well within what the tunnel leaves open."""
    for felt in beside_truth(truth, simulation, 4, SETTLE, LASTING, within=0.5):
        assert (np.abs(felt[:4]) < 0.45).all()
        assert (felt[4:] > 250).all()
        assert (felt[4:] < 450).all()


def test_owner_flies_his_own_simulation(truth, simulation):
    """His flight in plain floats follows the truth's without noise, and has the loads of its own wrench."""
    settings, motion = (importlib.import_module(n) for n in ("settings", "motion"))
    log = motion.fly(truth, [{"condition": "u13", "design": 0}], settings.Settings([{}]), 6.0, 6.0)
    count = 251
    first = 50
    time = 0.02 * np.arange(count)
    record = {"time": time, "state/u": np.full(count, 13.0), "air/rho": np.full(count, 1.19)}
    for i, e in enumerate(truth.EFFECTORS):
        record[f"excitation/{e}"] = truth.excitation(time)[0, i]
    made = simulation.wrench.fly(record, {})
    state = {n: made[n] for n in ("u", "v", "w", "p", "q", "r")}
    effector = {e: made[f"effector/{e}"] for e in truth.EFFECTORS}
    said = simulation.wrench(time, state, effector, {"rho": record["air/rho"]}, {})
    mass = truth.MASS
    # Its own lags began long before the record's first sample, the wrench's in steady state there
    arm = np.array(truth.SENSOR)
    rates = np.array([made[n] for n in "pqr"]).T
    turn = np.gradient(rates, time, axis=0)
    felt = np.array([made[n] for n in ("ax", "ay", "az")]).T
    felt = felt - np.cross(turn, arm) - np.cross(rates, np.cross(rates, arm))
    for i, n in enumerate("XYZ"):
        off = (mass * felt[:, i] - said[n])[25:-5]
        assert off.std() < 0.03 * said[n][25:-5].std() + 0.02
    assert np.abs(made["theta"]).max() < 0.3
    assert np.abs(log.state[first:, 7]).max() < 0.3


def test_wrench_of_a_record_is_that_of_its_moments(truth, simulation):
    """Steady series and single moments have the same loads."""
    at = truth.TRIM["u13"]
    state = {n: np.full(5, v) for n, v in zip(("u", "v", "w", "p", "q", "r"), at["state"][:6], strict=True)}
    effector = {n: np.full(5, v) for n, v in zip(truth.EFFECTORS, at["command"], strict=True)}
    made = simulation.wrench(0.02 * np.arange(5), state, effector, {"rho": np.full(5, at["rho"])}, {})
    one = simulation.loads(math, at["state"].tolist(), at["command"].tolist(), at["rho"], {})
    for name, value in zip("XYZLMN", one, strict=True):
        np.testing.assert_allclose(made[name], value, atol=1e-9)
    assert abs(one[2] / 9.80665 / truth.MASS + 1) < 0.002


def test_committed_coefficients_are_those_that_the_campaign_finds(tmp_path):
    campaign_again(FOLDER, tmp_path)

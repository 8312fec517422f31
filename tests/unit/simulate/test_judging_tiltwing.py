"""Strips, propellers, wake, shafts and owner of the judging tilt-wing against closed forms and slow sums."""

import importlib
import math
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from judging_owner import beside_truth, campaign_again, module_of
from scipy.optimize import brentq, fsolve

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "tiltwing"
RHO = 1.19
SETTLE, LASTING = 5.0, 10.0  # s of a flight before what is looked at, and of that


loaded = partial(module_of, FOLDER)


@pytest.fixture(scope="module")
def simulation():
    return loaded("simulation")


@pytest.fixture(scope="module")
def truth():
    return loaded("truth")


def test_elliptical_circulation_is_washed_evenly():
    """Its downwash is the circulation in the middle over twice the span (Prandtl)."""
    wing = loaded("wing_strips").WingStrips(np.sin(np.linspace(0.01, np.pi / 2, 200)), 0.3)
    wash = (wing.wash @ np.sqrt(1 - wing.place**2))[:, 0]
    np.testing.assert_allclose(wash[np.abs(wing.place[:, 0]) < 0.9], 1 / 4, rtol=0.02)


def test_a_stalled_wing_is_the_one_that_a_solver_finds():
    """Two corrections from nearby are enough: a part of a percent of what a general solver finds."""
    strips = loaded("wing_strips")
    wing = strips.WingStrips((0.14, 0.33, 0.55, 0.77, 1.0), 0.3)
    ahead = np.array([11.0, 17, 17, 11.5, 11.5, 17, 17, 11])[:, None]
    through, moved = np.linspace(6.0, 7.5, 8)[:, None], np.zeros((8, 1))

    def miss(made):
        below = through[:, 0] - wing.wash @ made
        speed = np.hypot(ahead[:, 0], below)
        acts = (below + strips.CAMBER * ahead[:, 0]) / speed
        late = (below / speed + 0.3 * strips.CAMBER * ahead[:, 0] / speed - strips.STALLED) / strips.SOFT
        torn = 0.5 * (1 + late / np.hypot(1, late))
        lift = acts * (strips.SLOPE * (1 - torn) + strips.PLATE * torn * ahead[:, 0] / speed)
        return 0.5 * 0.3 * speed * lift - made

    exact = fsolve(miss, np.full(8, 2.0), xtol=1e-12)
    assert np.abs(miss(exact)).max() < 1e-9
    *_, made = wing.forces(ahead, through, moved, 0.97 * exact[:, None], rounds=2)
    np.testing.assert_allclose(made[:, 0], exact, rtol=2e-3)
    *_, made = wing.forces(ahead, through, moved, np.zeros((8, 1)), rounds=60)
    np.testing.assert_allclose(made[:, 0], exact, rtol=1e-6)


@pytest.mark.parametrize(
    ("speed", "along", "across"), [(550.0, 11.0, 8.5), (505.0, 19.0, 5.0), (600.0, 12.0, 0.0)]
)
def test_propeller_is_the_mean_over_a_turn(speed, along, across):
    """Averaged blade by blade over the turn, with the inflow that a root finder says."""
    props, radius = loaded("oblique_propellers"), 0.22
    way = np.linspace(0, 2 * np.pi, 721)[:-1]
    met = props.STATION * radius * speed + across * np.sin(way)
    size = 0.5 * RHO * props.BLADES * props.CHORD * props.LENGTH * radius

    def sections(induced):
        through = along + induced
        lift = props.SLOPE * (props.PITCH - through / met)
        up = size * met**2 * (lift - props.PROFILE * through / met)
        back = size * met**2 * (lift * through / met + props.PROFILE)
        return up, back

    def balance(induced):
        momentum = 2 * RHO * np.pi * radius**2 * induced * math.hypot(along + induced, across)
        return momentum - sections(induced)[0].mean()

    induced = brentq(balance, 0.0, 30.0, xtol=1e-12)
    up, back = sections(induced)
    thrust, torque, dragged, leaning, found = props.propellers(
        np.array(RHO), np.array(speed), np.array(along), np.array(across), radius
    )
    assert found == pytest.approx(induced, rel=1e-4)
    assert thrust == pytest.approx(up.mean(), rel=1e-4)
    assert torque == pytest.approx(props.STATION * radius * back.mean(), rel=1e-3)
    assert dragged == pytest.approx((back * np.sin(way)).mean(), rel=1e-3, abs=1e-9)
    assert leaning == pytest.approx(props.STATION * radius * (up * np.sin(way)).mean(), rel=5e-3, abs=1e-9)
    assert 0.4 < thrust * along / (torque * speed) < 0.9  # efficiency


def test_shafts_turn_with_their_wings(truth):
    shafts = loaded("../shafts")
    position = np.zeros((10, 2))
    position[8], position[9] = (0.0, np.pi / 2), (0.3, 0.3)
    made = shafts.shafts(truth, position)
    spin = truth.ROTOR_MOMENTUM
    np.testing.assert_allclose(made[:, 0, 0], [spin[0], 0, 0], atol=1e-12)
    np.testing.assert_allclose(made[:, 1, 1], [0, 0, -spin[1]], atol=1e-12)  # upright
    np.testing.assert_allclose(made[:, 3, 0], [spin[3] * math.cos(0.3), 0, -spin[3] * math.sin(0.3)])


def test_the_wake_meets_the_rear_wing_one_convection_later(truth):
    settings = loaded("../settings").Settings([{}])
    air = importlib.import_module("tilt_air")
    x = np.array([22.0, 0, 0, 0, 0, 0, 0, 0, 0, 100])[:, None]
    felt = truth.TRIM["u22"]["command"][:, None]
    memory, rho = truth.Memory(x, felt, settings), np.array([RHO])
    memory.front = np.ones(1)
    memory.step(x, felt, rho, settings, 0.01)
    memory.front = np.full(1, 2.0)
    seen = []
    for _ in range(12):
        memory.step(x, felt, rho, settings, 0.01)
        seen.append(memory.downwash(x, settings)[0] * air.g.SPAN / air.WAKE)
    late = air.WAKE_WAY / (air.WAKE_SPEED * 22.0) / 0.01  # steps
    np.testing.assert_allclose(seen, 1 + np.clip(np.arange(12) - late + 1, 0, 1), atol=1e-9)


def test_owners_wake_has_the_gain_and_phase_of_two_lags(simulation):
    owner = sys.modules[simulation.Owner.__module__]
    slow, dt = 0.07, 0.02
    time = dt * np.arange(1501)
    turn = 2 * np.pi * 1.0
    value = np.sin(turn * time)
    closed = np.imag(np.exp(1j * turn * time) / (1 + 0.5j * turn * slow) ** 2)
    made = owner._series_lag(time)(value, slow)
    np.testing.assert_allclose(made[100:], closed[100:], atol=0.01)
    lag, flown = owner._Lag(), []
    for v in value:
        flown.append(lag(v, slow))
        lag.advance(dt)
    np.testing.assert_allclose(flown[100:], closed[100:], atol=0.08)  # it holds each value for a step


def test_truth_and_owner_are_symmetrical_and_agree(truth, simulation):
    """The mirrored flight has the mirrored loads, in both."""
    x = np.array([19.0, 0.6, 0.4, 0.2, 0.1, -0.15, 0.0, 0.03, 0.0, 100.0])[:, None]
    felt = np.array([0.05, -0.02, -0.03, 0.04, 495.0, 512, 508, 501, 0.315, 0.367])[:, None]
    side = np.array([1.0, -1, 1, -1, 1, -1, 1, 1, 1, 1])[:, None]
    swap = [1, 0, 3, 2, 5, 4, 7, 6, 8, 9]
    sign = np.array([1.0, -1, 1, -1, 1, -1])
    none = loaded("../settings").Settings([{}])
    rho = np.array([RHO])

    def flown(x, felt):
        memory = truth.Memory(x, felt, none)
        for _ in range(60):  # until the wake is there
            made = truth.loads(x, felt, rho, none, memory)
            memory.step(x, felt, rho, none, 0.01)
        return made[:, 0]

    one = flown(x, felt)
    np.testing.assert_allclose(flown(side * x, felt[swap]), sign * one, rtol=1e-9, atol=1e-9)
    said = simulation.loads(math, x[:, 0].tolist(), felt[:, 0].tolist(), RHO, {})
    again = simulation.loads(math, (side * x)[:, 0].tolist(), felt[swap][:, 0].tolist(), RHO, {})
    np.testing.assert_allclose(again, sign * said, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(said, one, rtol=0.05, atol=0.5)


def test_owner_and_truth_have_the_same_derivatives_at_trim(truth, simulation):
    """By differences, within some percent of the wings' own shares: two pitching moments nearly cancel."""
    settings = loaded("../settings")
    moved = np.array([0.2, 0.2, 0.2, 0.02, 0.02, 0.02, *[0.01] * 4, *[4.0] * 4])

    def settled(rows, rho, departures):
        s, air = settings.Settings([departures] * rows.shape[1]), np.full(rows.shape[1], rho)
        x, felt = np.vstack([rows[:6], np.zeros((4, rows.shape[1]))]), rows[6:]
        memory = truth.Memory(x, felt, s)
        for _ in range(40):  # until the wake is there
            made = truth.loads(x, felt, air, s, memory)
            memory.step(x, felt, air, s, 0.01)
        return made

    def slopes(made):
        return (made[:, 0::2] - made[:, 1::2]) / (2 * moved)

    for at in truth.TRIM.values():
        rows = np.repeat(np.concatenate([at["state"][:6], at["command"]])[:, None], 2 * moved.size, axis=1)
        for i, step in enumerate(moved):
            rows[i, 2 * i : 2 * i + 2] += step, -step
        whole = slopes(settled(rows, at["rho"], {}))
        own = sum(
            np.abs(whole - slopes(settled(rows, at["rho"], {f"{n}.lift": -1.0, f"{n}.chord_force": -1.0})))
            for n in ("front", "rear")
        )
        every = [simulation.loads(math, x[:6].tolist(), x[6:].tolist(), at["rho"], {}) for x in rows.T]
        off = np.abs(slopes(np.array(every).T) - whole)
        assert (off <= 0.05 * np.maximum(own, np.abs(whole)) + 1e-6).all()
        assert own[4, 2] > 5 * abs(whole[4, 2])  # M by w is a small difference
        assert off[4, 2] < 0.01 * own[4, 2]


@pytest.mark.slow
def test_owner_with_true_tolerances_has_the_loads_of_nulls(truth, simulation):
    """Flown without noise: what varies within some percent, means well within what the tunnel leaves open."""
    assert len(list(beside_truth(truth, simulation, 4, SETTLE, LASTING, within=0.5))) == 4 * len(truth.TRIM)


def test_wrench_of_a_record_is_that_of_its_moments(truth, simulation):
    """Steady series and single moments have the same loads."""
    at = truth.TRIM["u19"]
    state = {n: np.full(5, v) for n, v in zip(("u", "v", "w", "p", "q", "r"), at["state"][:6], strict=True)}
    effector = {n: np.full(5, v) for n, v in zip(truth.EFFECTORS, at["command"], strict=True)}
    made = simulation.wrench(0.02 * np.arange(5), state, effector, {"rho": np.full(5, at["rho"])}, {})
    one = simulation.loads(math, at["state"].tolist(), at["command"].tolist(), at["rho"], {})
    for name, value in zip("XYZLMN", one, strict=True):
        np.testing.assert_allclose(made[name], value, atol=1e-9)
    assert abs(one[2] / 9.80665 / truth.MASS + 1) < 0.001


def test_committed_coefficients_are_those_that_the_campaign_finds(tmp_path):
    campaign_again(FOLDER, tmp_path)

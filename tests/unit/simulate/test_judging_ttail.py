"""Wing, propellers, late downwash and owner of the judging T-tail against slow sums and closed forms."""

import importlib
import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from judging_owner import beside_truth, campaign_again, module_of
from scipy.optimize import brentq

FOLDER = Path(__file__).resolve().parents[3] / "benchmarks" / "gap_judging" / "ttail"
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
    return importlib.import_module("ttail_air")


@pytest.fixture(scope="module")
def settings(truth):
    return importlib.import_module("settings")


def test_wing_of_elliptical_circulation_washes_evenly(air):
    """Glauert: an ellipse is washed by its circulation over twice the span; twice that far behind."""
    wing = air.WING
    ellipse = np.sqrt(1 - (wing.place / (0.5 * wing.span)) ** 2)[:, 0]
    np.testing.assert_allclose(wing.wash @ ellipse, 1 / (2 * wing.span), rtol=1e-9)
    assert wing.behind(1e5, 0.01, points=40000) @ ellipse == pytest.approx(1 / wing.span, rel=0.01)
    # Above the wake, far behind: the closed form of a vortex sheet of elliptical load
    h, b = 0.4, 0.5 * wing.span
    closed = (1 - h / math.hypot(h, b)) / wing.span
    assert wing.behind(1e5, h) @ ellipse == pytest.approx(closed, rel=1e-4)


def test_rectangular_wing_is_glauerts(air):
    """Lift slope of a rectangle from the series of many more terms."""
    wing = air.WING
    bound = wing.solve @ np.ones(wing.place.size)
    lift = 2 * (bound * wing.width[:, 0]).sum() / (wing.span * wing.chord)
    n = np.arange(1, 120, 2)
    angle = (np.arange(1, n.size + 1) - 0.5) * np.pi / 2 / n.size
    pull = 4 * wing.span / (wing.slope * wing.chord) * np.sin(angle)[:, None]
    series = np.linalg.solve((pull + n) * np.sin(angle[:, None] * n), np.sin(angle))
    assert lift == pytest.approx(np.pi * wing.span / wing.chord * series[0], rel=0.003)


def test_section_goes_from_attached_to_kirchhoffs_quarter(air, settings):
    """All attached, lift is the series'; all separated, a quarter of it before the wing's own wash."""
    n = air.WING.place.size
    none = settings.Settings([{}])
    along = np.full((n, 1), 30.0)
    still = np.zeros((n, 1))
    *_, bound = air.wing(along, along * -0.03, still, none)
    closed = air.WING.solve @ (along * (air.CAMBER - 0.03))
    np.testing.assert_allclose(bound, closed, rtol=0.002)
    *_, bound = air.wing(along, along * 20.0, still, none)  # far beyond, at the tips too
    attached = air.WING.solve @ (along * (air.CAMBER + 20.0))
    met = attached * 2 / (air.WING.chord * air.WING.slope)
    np.testing.assert_allclose(bound, attached - 0.75 * air.WING.solve @ met, rtol=1e-6)


@pytest.mark.parametrize("kind", [0, 1])
def test_propeller_is_the_sum_over_its_blades(air, kind):
    """Blade elements round the turn, with rings' momentum and Prandtl's loss solved apart."""
    module = importlib.import_module("tip_loss_propellers")
    radius, pitch, speed = (0.16, 0.20)[kind], float(air.PITCH[2 * kind, 0]), 560.0
    along, across = 28.0, 2.0
    thrust = torque = dragged = leaning = 0.0
    turn = np.linspace(0, 2 * np.pi, 361)[:-1]
    for x, share in zip(module.RINGS, module.SHARES, strict=True):
        angle = math.atan(pitch / x)
        element = 0.5 * RHO * module.BLADES * module.CHORD * radius * share * radius
        ring = 4 * np.pi * RHO * x * radius * share * radius
        tip = x * radius * speed

        def lifted(through, tip=tip, angle=angle, element=element):
            whole = math.hypot(tip, through)
            return (
                element * module.SLOPE * whole**2 * math.sin(angle - math.atan2(through, tip)) * tip / whole
            )

        def through_at(loss, ring=ring, lifted=lifted):
            return brentq(lambda t: ring * loss * t * (t - along) - lifted(t), along, 80.0, xtol=1e-12)

        guess = through_at(0.9)
        flow = 0.5 * module.BLADES * (1 - x) * tip / (x * guess)
        through = through_at(2 / np.pi * math.acos(math.exp(-flow)))
        moves = tip + across * np.sin(turn)  # of the blade that advances at a quarter turn
        met = moves * math.sin(angle) - through * math.cos(angle)
        drag = module.PROFILE * math.hypot(tip, through)
        pull = element * (module.SLOPE * moves * met - drag * through)
        push = element * (module.SLOPE * through * met + drag * moves)
        thrust, torque = thrust + pull.mean(), torque + x * radius * push.mean()
        dragged = dragged + (push * np.sin(turn)).mean()
        leaning = leaning + x * radius * (pull * np.sin(turn)).mean()
    made = module.propellers(RHO, speed, along, across, radius, pitch)
    np.testing.assert_allclose(made, (thrust, torque, dragged, leaning), rtol=1e-9)


def test_downwash_arrives_when_vortices_pass(truth, air, settings):
    none = settings.Settings([{}])
    x = np.array([26.0, 0, 0, 0, 0, 0, 0, 0, 0, 100])[:, None]
    memory = truth.Memory(x, None, none)
    seen = []
    for k in range(20):
        memory.shed = np.full(1, 1.0 if k < 3 else 2.0)
        memory.step(x, None, RHO, none, 0.01)
        seen.append(memory.met[0])
    late = air.BACK / 26.0 / 0.01  # steps
    come = np.clip(np.arange(20)[:, None] - 3 - late * np.array([0.7, 1.3]) + 1, 0, 1).mean(axis=1)
    np.testing.assert_allclose(seen, 1 + come, atol=1e-9)


def settled(truth, x, felt, s):
    memory = truth.Memory(x, felt, s)
    rho = np.array([RHO])
    for _ in range(40):  # until the downwash is there
        made = truth.loads(x, felt, rho, s, memory)
        memory.step(x, felt, rho, s, 0.01)
    return made


def test_truth_and_owner_are_symmetrical_and_agree(truth, simulation, settings):
    """The mirrored flight has the mirrored loads, in both."""
    x = np.array([26.2, 0.5, 0.3, 0.2, 0.1, -0.15, 0.0, 0.03, 0.0, 100.0])[:, None]
    felt = np.array([0.05, -0.02, 0.11, 0.17, 0.06, 0.04, 510.0, 525, 505, 530])[:, None]
    side = np.array([1.0, -1, 1, -1, 1, -1, 1, 1, 1, 1])[:, None]
    swap, turn = [1, 0, 3, 2, 4, 5, 7, 6, 9, 8], np.array([1.0] * 5 + [-1] + [1] * 4)[:, None]
    sign = np.array([1.0, -1, 1, -1, 1, -1])
    none = settings.Settings([{}])
    one = settled(truth, x, felt, none)[:, 0]
    mirrored = (turn * felt)[swap]
    np.testing.assert_allclose(
        settled(truth, side * x, mirrored, none)[:, 0], sign * one, rtol=1e-9, atol=1e-9
    )
    said = np.array(simulation.loads(math, x[:, 0].tolist(), felt[:, 0].tolist(), RHO, {}))
    again = simulation.loads(math, (side * x)[:, 0].tolist(), mirrored[:, 0].tolist(), RHO, {})
    np.testing.assert_allclose(again, sign * said, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(said, one, rtol=0.03, atol=0.5)


def test_swirl_of_the_tip_propellers_opposes_the_tips_vortices(truth, air, settings):
    """Their jets lift the wing before the tip, and with the other sense of rotation they would not."""
    right_tip, outer = 1, int(np.argmin(np.abs(air.WING.place - 1.66)))
    assert air.SWIRL[outer, right_tip] > 0  # air goes up inboard of the right propeller
    assert air.SWIRL[-1 - outer, 0] == pytest.approx(air.SWIRL[outer, right_tip])


@pytest.mark.slow
def test_owner_with_true_tolerances_has_the_loads_of_nulls(truth, simulation, settings):
    """Flown without noise: what varies within some percent; means within what his parameters leave open.

    Not within half of it, as other owners: his rolling moment misses 0.8 N m in one flight of eight.
    """
    for felt in beside_truth(truth, simulation, 4, SETTLE, LASTING, within=1.0):
        assert (np.abs(felt[:6]) < 0.4).all()
        assert (felt[6:] > 400).all()
        assert (felt[6:] < 780).all()


def test_wrench_of_a_record_is_that_of_its_moments(truth, simulation):
    """Steady series and single moments have the same loads, and the trim carries the weight."""
    at = truth.TRIM["u26"]
    state = {n: np.full(5, v) for n, v in zip(("u", "v", "w", "p", "q", "r"), at["state"][:6], strict=True)}
    effector = {n: np.full(5, v) for n, v in zip(truth.EFFECTORS, at["command"], strict=True)}
    made = simulation.wrench(0.02 * np.arange(5), state, effector, {"rho": np.full(5, at["rho"])}, {})
    one = simulation.loads(math, at["state"].tolist(), at["command"].tolist(), at["rho"], {})
    for name, value in zip("XYZLMN", one, strict=True):
        np.testing.assert_allclose(made[name], value, atol=1e-9)
    assert abs(one[2] / 9.80665 / truth.MASS + 1) < 0.002


def test_committed_coefficients_are_those_that_the_campaign_finds(tmp_path):
    campaign_again(FOLDER, tmp_path)

"""The LA-8 class airframe: hover, trim along the corridor, and which way its effectors act."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from freqid.core.scenario import read_scenario
from freqid.core.units import STANDARD_GRAVITY
from freqid.simulate.effects.effect import Effect, Parameter
from freqid.simulate.loads import airframe, description
from freqid.simulate.loads.quantities import Aero, Flow, Positions, Wake, Wrench
from freqid.simulate.loads.wake import convection_time
from freqid.simulate.motion import multibody

SCENARIO = read_scenario(Path(__file__).resolve().parents[4] / "scenarios" / "la8.toml")[0]
VEHICLE = SCENARIO.aircraft()
WEIGHT = VEHICLE.mass_properties.mass_kg * STANDARD_GRAVITY
EFFECTORS = [e.name for e in VEHICLE.effectors if e.kind == "surface"]


@pytest.fixture(scope="module")
def la8():
    return description.parameters(SCENARIO)


@pytest.fixture(scope="module")
def load(la8):
    """Force and moment as one vector of one vector: u v w, p q r, surfaces, tilts, rotor speeds, density."""

    def evaluate(x):
        velocity, rates, surface, tilt, speed, rho = jnp.split(x, [3, 6, 16, 18, 26])
        flow = Flow(velocity, rates, rho[0], jnp.float64(100.0))
        positions = Positions(surface, tilt, jnp.zeros(2), speed)
        return jnp.concatenate([*airframe.wrench(la8, flow, positions).wrench])

    return jax.jit(evaluate)


def state(u=0.0, w=0.0, tilt=0.0, speed=0.0, rho=1.225, surface=0.0) -> np.ndarray:
    return np.concatenate(
        [[u, 0, w], np.zeros(3), np.zeros(10) + surface, np.zeros(2) + tilt, np.zeros(8) + speed, [rho]]
    )


def test_rotors_carry_the_weight_in_hover_with_a_margin(load):
    for rho in {r.rho for r in SCENARIO.reference}:
        lift = [-float(load(state(tilt=np.pi / 2, speed=s, rho=rho))[2]) for s in (0.0, 0.85 * 950.0, 950.0)]
        assert lift[0] == pytest.approx(0, abs=1e-9)
        assert lift[1] > 1.2 * WEIGHT
        assert lift[2] > 1.5 * WEIGHT


def longitudinal(unknown: np.ndarray, reference) -> np.ndarray:
    """State at pitch angle, front and rear rotor speed; the elevons help in proportion."""
    theta, front, rear = unknown
    pitch = 1.5 * (front - rear)
    surface = pitch * np.array([1, 1, -1, -1, 0.4, 0.4, -0.4, -0.4, -1, -1])
    speed = 600 * np.repeat([front, rear], 4)
    velocity = reference.u * np.array([1.0, 0.0, np.tan(theta)])
    tilt = np.array([reference["dw1"], reference["dw2"]])
    return np.concatenate([velocity, np.zeros(3), surface, tilt, speed, [reference.rho]])


@pytest.mark.parametrize("reference", SCENARIO.reference, ids=lambda r: r.id)
def test_level_flight_is_possible_at_every_reference_with_margin(load, reference):
    masses = multibody.mass_model(VEHICLE)
    centre = np.asarray(
        multibody.traced_centre_of_gravity(masses, jnp.array([reference["dw1"], reference["dw2"]]))
    )

    def residual(unknown):
        found = np.asarray(load(longitudinal(unknown, reference)))
        weight = WEIGHT * np.array([-np.sin(unknown[0]), 0, np.cos(unknown[0])])
        moment = found[3:] + np.cross(centre, weight)
        return np.array([found[0] + weight[0], found[2] + weight[2], moment[1]]) / WEIGHT

    solved = least_squares(residual, [0.0, 0.95, 0.9], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert np.abs(solved.fun).max() < 1e-8
    at = longitudinal(solved.x, reference)
    assert abs(np.degrees(solved.x[0])) < 4
    assert np.all(at[18:26] < 0.85 * 950)
    assert np.all(np.abs(at[6:16]) < 0.6 * 0.5236)


def derivatives(load, reference_id: str) -> dict[str, np.ndarray]:
    r = SCENARIO.reference_of(reference_id)
    x = state(r.u, 0.0, np.array([r["dw1"], r["dw2"]]), 600.0, r.rho)
    steps = 1e-4 * np.eye(len(x))
    found = np.array([np.asarray(load(x + h)) - np.asarray(load(x - h)) for h in steps]) / 2e-4
    names = ["u", "v", "w", "p", "q", "r", *EFFECTORS, "dw1", "dw2", *(f"n{i}" for i in range(1, 9)), "rho"]
    return dict(zip(names, found, strict=True))


def test_signs_in_cruise(load):
    d = derivatives(load, "u85")
    X, Y, Z, L, M, N = range(6)
    for name in ("de1", "de2", "de3", "de4", "df1", "df2", "df3", "df4"):
        assert d[name][Z] < 0  # trailing edge down lifts
    assert d["de1"][L] > 0 > d["de2"][L]  # on the left it rolls to the right
    assert d["de1"][M] > 0 > d["de3"][M]  # ahead of the centre it pitches up
    assert d["dr1"][M] < 0
    assert d["dr2"][M] < 0
    assert d["dr1"][N] > 0 > d["dr2"][N]  # left panel pushed left: nose right
    assert d["dr1"][Y] < 0 < d["dr2"][Y]
    assert all(d[f"n{i}"][X] > 0 for i in range(1, 9))
    assert d["n1"][N] > 0 > d["n4"][N]
    assert d["p"][L] < 0
    assert d["q"][M] < 0
    assert d["r"][N] < 0
    assert d["v"][Y] < 0 < d["v"][N]  # weathercock
    assert d["w"][Z] < 0


def test_signs_in_hover(load):
    d = derivatives(load, "u00")
    X, Y, Z, L, M, N = range(6)
    assert all(d[f"n{i}"][Z] < 0 for i in range(1, 9))
    assert all(d[f"n{i}"][M] > 0 for i in range(1, 5))
    assert all(d[f"n{i}"][M] < 0 for i in range(5, 9))
    assert d["n1"][L] > 0 > d["n4"][L]
    assert d["de1"][X] < 0  # the slipstream is turned forward, the wing pushed back
    assert d["de1"][N] < 0 < d["de2"][N]
    assert abs(d["dr1"][M]) < 0.01 * abs(d["de1"][N])  # no wind at the tail


def test_an_effect_may_add_a_wrench_in_proportion_to_its_size(la8, monkeypatch):
    def brake(settings, situation):
        return Wrench(-settings["area"] * situation.flow.velocity, jnp.zeros(3))

    effect = Effect(
        "brake", "airframe", "It brakes.", {"area": Parameter(0.0, "m2", "of the brake")}, add=brake
    )
    monkeypatch.setattr(airframe, "library", lambda: {"brake": effect})
    still = Wake(jnp.zeros(2), jnp.zeros(2))
    aero = Aero(Wrench(jnp.ones(3), jnp.ones(3)), jnp.zeros(8), jnp.zeros(8), still)
    flow = Flow(jnp.array([10.0, 0.0, 2.0]), jnp.zeros(3), jnp.float64(1.2), jnp.float64(100.0))
    where = Positions(jnp.zeros(10), jnp.zeros(2), jnp.zeros(2), jnp.zeros(8))
    for area in (0.0, 3.0):
        braked = la8._replace(effects=la8.effects | {"brake": {"area": jnp.float64(area)}})
        force, moment = airframe._with_added(airframe.Situation(braked, flow, where, aero))[0].wrench
        np.testing.assert_allclose(force, 1 - area * np.array([10.0, 0.0, 2.0]))
        np.testing.assert_allclose(moment, 1.0)


def test_the_wake_takes_as_long_as_the_way_needs(la8):
    flow = Flow(jnp.array([20.0, 0.0, 0.0]), jnp.zeros(3), jnp.float64(1.2), jnp.float64(100.0))
    assert float(convection_time(la8.wakes, flow)) == pytest.approx(1.249 / 20.0, rel=0.02)
    assert float(convection_time(la8.wakes, flow._replace(velocity=jnp.zeros(3)))) < 0.5

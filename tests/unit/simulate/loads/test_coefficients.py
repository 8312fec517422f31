"""Loads by coefficients: what the derivatives and tables say, written out by hand beside it."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import jax
import msgspec
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario, read_scenario
from freqid.simulate.loads import airframe
from freqid.simulate.loads.coefficients import coefficients, derivatives, variables
from freqid.simulate.loads.description import parameters
from freqid.simulate.loads.quantities import Flow, Positions

SCENARIOS = Path(__file__).resolve().parents[4] / "scenarios"
DEP6 = read_scenario(SCENARIOS / "dep6.toml")[0]
RNG = np.random.default_rng(3)
LIFT = RNG.uniform(-0.5, 1.5, (5, 4))
ALPHAS, RATIOS = [-0.2, -0.05, 0.0, 0.1, 0.3], [0.3, 0.5, 0.9, 2.0]

PLANE = {
    "vehicle": {
        "name": "Plane",
        "mass_kg": 8.0,
        "inertia": {"xx": 0.6, "yy": 0.7, "zz": 1.1},
        "cg_m": [0.02, 0.01, -0.03],
        "area_m2": 0.6,
        "span_m": 2.2,
        "chord_m": 0.28,
    },
    "effector": [
        {"name": "de", "kind": "surface", "limits": [-0.4, 0.4]},
        {"name": "n1", "kind": "rotor", "limits": [0.0, 900.0]},
        {"name": "n2", "kind": "rotor", "limits": [0.0, 900.0]},
    ],
    "rotor": [
        {"name": "n1", "spin": 1, "inertia": 1e-4, "diameter_m": 0.30, "position_m": [0.2, -0.5, 0.1]},
        {"name": "n2", "spin": -1, "inertia": 1e-4, "diameter_m": 0.26, "position_m": [0.2, 0.5, 0.0]},
    ],
    "simulation": {
        "kind": "coefficients",
        "effects": {"rotor_inplane_force": 0.0},
        "coefficients": {
            "about": {"beta": 0.02},
            "point_m": [0.05, 0.0, 0.01],
            "propeller": {"thrust": [0.1, -0.08, -0.02, -0.01], "torque": [0.006, 0.001, -0.002, -0.004]},
            "CD": {"bias": 0.03, "alpha*alpha": 1.1},
            "CL": {
                "bias": {"of": ["alpha", "J"], "at": [ALPHAS, RATIOS], "values": LIFT.tolist()},
                "qhat": 6.0,
                "de": {"of": "J", "at": RATIOS, "values": [0.9, 0.6, 0.5, 0.4]},
            },
            "CY": {"beta": -0.5, "beta*de": 0.3},
            "Cl": {"beta": -0.1, "phat": -0.4, "rhat": 0.1},
            "Cm": {"bias": 0.02, "alpha": -0.8, "qhat": -12.0, "de": -1.1},
            "Cn": {"beta": 0.08, "rhat": -0.15},
        },
    },
}


def changed(edit) -> Scenario:
    table = deepcopy(PLANE)
    edit(table["simulation"]["coefficients"], table)
    return msgspec.convert(table, Scenario)


def states(count, speed=(12.0, 30.0)):
    for _ in range(count):
        v, alpha, beta = RNG.uniform(*speed), RNG.uniform(-0.25, 0.35), RNG.uniform(-0.2, 0.2)
        velocity = v * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
        yield velocity, RNG.uniform(-0.8, 0.8, 3), RNG.uniform(-0.3, 0.3), RNG.uniform(100, 800, 2)


def by_hand(velocity, rates, de, speeds, rho):
    """Return the wrench about the origin, one plain formula after the other."""
    point = np.array([0.05, 0.0, 0.01])
    u, v, w = there = velocity + np.cross(rates, point)
    speed = np.linalg.norm(there)
    alpha, beta = np.arctan2(w, u), np.arcsin(v / speed)
    phat, qhat, rhat = rates * [2.2, 0.28, 2.2] / (2 * speed)
    diameters = np.array([0.30, 0.26])
    ratio = speed / np.mean(speeds * diameters / (2 * np.pi))
    inside = (np.clip(alpha, ALPHAS[0], ALPHAS[-1]), np.clip(ratio, RATIOS[0], RATIOS[-1]))
    lift = float(np.squeeze(RegularGridInterpolator((ALPHAS, RATIOS), LIFT)(inside)))
    lift += 6.0 * qhat + np.interp(ratio, RATIOS, [0.9, 0.6, 0.5, 0.4]) * de
    drag = 0.03 + 1.1 * alpha**2
    slip = beta - 0.02
    force = np.array(
        [
            -drag * np.cos(alpha) + lift * np.sin(alpha),
            -0.5 * slip + 0.3 * slip * de,
            -drag * np.sin(alpha) - lift * np.cos(alpha),
        ]
    )
    moment = np.array(
        [
            2.2 * (-0.1 * slip - 0.4 * phat + 0.1 * rhat),
            0.28 * (0.02 - 0.8 * alpha - 12.0 * qhat - 1.1 * de),
            2.2 * (0.08 * slip - 0.15 * rhat),
        ]
    )
    scale = 0.5 * rho * speed**2 * 0.6
    force, moment = scale * force, scale * moment
    moment = moment + np.cross(point, force)
    for place, d, spin, omega in zip(
        ([0.2, -0.5, 0.1], [0.2, 0.5, 0.0]), diameters, (1, -1), speeds, strict=True
    ):
        axial = (velocity + np.cross(rates, place))[0]
        x = omega * d / (2 * np.pi)
        j = axial / x
        root = np.sqrt(1 + j**2)
        thrust = rho * x**2 * d**2 * (0.1 - 0.08 * j + (-0.02 * j**2 - 0.01 * j**3) / root)
        torque = rho * x**2 * d**3 * (0.006 + 0.001 * j + (-0.002 * j**2 - 0.004 * j**3) / root)
        push = np.array([thrust, 0.0, 0.0])
        force, moment = force + push, moment + np.cross(place, push) - [spin * torque, 0, 0]
    return np.concatenate([force, moment])


def test_loads_are_what_the_coefficients_say():
    built = parameters(msgspec.convert(PLANE, Scenario))
    load = jax.jit(airframe.wrench)
    for velocity, rates, de, speeds in states(40):
        flow = Flow(velocity, rates, 1.1, 100.0)
        found = load(built, flow, Positions(np.array([de]), np.zeros(0), np.zeros(0), speeds)).wrench
        expected = by_hand(velocity, rates, de, speeds, 1.1)
        np.testing.assert_allclose(np.concatenate(found), expected, rtol=2e-4, atol=2e-3)


def test_the_linear_aircraft_is_the_one_of_the_example(linear_aircraft):
    scenario = read_scenario(SCENARIOS / "linear.toml")[0]
    built, load = parameters(scenario), jax.jit(airframe.wrench)
    for _ in range(20):
        state = np.array([20.0, 0, 0, 0, 0, 0, 0, 0, 0]) + RNG.uniform(-1, 1, 9)
        at = {"de": 0.1, "da": -0.05, "dr": 0.07, "n1": 450.0}
        positions = Positions(np.array([0.1, -0.05, 0.07]), np.zeros(0), np.zeros(0), np.array([450.0]))
        found = load(built, Flow(state[:3], state[3:6], 1.225, 100.0), positions).wrench
        np.testing.assert_allclose(np.concatenate(found), linear_aircraft.wrench(state, at), atol=1e-3)


def test_a_stopped_propeller_has_the_last_advance_ratio_of_a_table_and_finite_slopes():
    built = parameters(msgspec.convert(PLANE, Scenario))

    def lift_by_elevator(speeds):
        flow = Flow(np.array([18.0, 0, 1.0]), np.zeros(3), 1.2, 100.0)
        at = variables(built, flow, Positions(np.zeros(1), np.zeros(0), np.zeros(0), speeds))
        column = built.layout.products.index(("de",))
        return derivatives(built, at)[built.layout.names.index("CL"), column]

    value, slope = jax.value_and_grad(lift_by_elevator)(np.zeros(2))
    assert float(value) == 0.4
    assert np.all(np.isfinite(slope))


def test_tables_of_dep6_are_those_that_momentum_theory_gives(script):
    """Straight between the tables' points, so not exact there."""
    theory = script("benchmarks/dep6_aircraft.py")
    text = (SCENARIOS / "dep6.toml").read_text()
    assert theory.section().strip() in text
    built = parameters(DEP6)
    names = built.layout.surfaces
    for ratio, alpha in zip(RNG.uniform(0.3, 1.2, 30), RNG.uniform(-0.05, 0.2, 30), strict=True):
        speeds = np.full(6, 18.0 / ratio / 0.23 * 2 * np.pi)
        velocity = 18.0 * np.array([np.cos(alpha), 0, np.sin(alpha)])
        surface = np.zeros(len(names))
        at = variables(
            built,
            Flow(velocity, np.zeros(3), 1.225, 100.0),
            Positions(surface, np.zeros(0), np.zeros(0), speeds),
        )
        found = coefficients(built, at)
        for name, expected in zip(("CL", "CD", "Cm"), theory.statics(alpha, ratio), strict=True):
            assert float(found[name]) == pytest.approx(float(expected), abs=0.02)
        matrix = derivatives(built, at)
        for name, row in theory.derivatives(ratio).items():
            for variable, expected in row.items():
                place = built.layout.names.index(name), built.layout.products.index((variable,))
                assert float(matrix[place]) == pytest.approx(float(expected), rel=0.02)


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda c, t: t["simulation"].update(coefficients={}), r"no \[simulation.coefficients\]"),
        (lambda c, t: c["CL"].update(alfa=1.0), "'alfa' is unknown.*alpha"),
        (lambda c, t: c["CL"].update({"alpha*dx": 1.0}), "'dx' is unknown"),
        (lambda c, t: c.update(CI={"alpha": 1.0}), "'CI' is unknown"),
        (lambda c, t: c.update(CX={"alpha": 1.0}), "gives CD and CX"),
        (lambda c, t: c.update(X={"u": 1.0}), "form 'coefficient', but gives X"),
        (lambda c, t: c.update(form="force"), "form 'force', but gives CD"),
        (lambda c, t: c.update(about={"speed": 1.0}), "'speed' is unknown"),
        (lambda c, t: c["CL"]["de"].update(at=[0.3, 0.5, 0.5, 2.0]), "expected two or more that increase"),
        (lambda c, t: c["CL"]["de"].update(at=[0.3]), "expected two or more that increase"),
        (lambda c, t: c["CL"]["de"].update(values=[1.0, 2.0]), r"of shape \[2\], expected 4"),
        (lambda c, t: c["CL"]["de"].update(values=[1.0, 2.0, [3.0], 4.0]), "no numbers in rows"),
        (lambda c, t: c["CL"]["bias"].update(values=LIFT.T.tolist()), r"of shape \[4, 5\], expected 5 by 4"),
        (lambda c, t: c["CL"]["bias"].update(at=[ALPHAS]), "of 2 variables, but 'at' has points for 1"),
        (lambda c, t: c["CL"]["de"].update(of="Je"), "'Je' is unknown"),
        (lambda c, t: c["CL"]["de"].update(off="J"), "'off' is unknown"),
        (lambda c, t: c["CL"].update(qhat=float("nan")), "expected a finite number"),
        (lambda c, t: [r.pop("diameter_m") for r in t["rotor"]], "no diameter_m"),
        (lambda c, t: [c.pop("propeller"), *(r.pop("diameter_m") for r in t["rotor"])], "'J' needs a rotor"),
        (lambda c, t: t["vehicle"].pop("chord_m"), "needs chord_m"),
        (lambda c, t: t["rotor"].pop(), "the same order"),
        (lambda c, t: t["effector"][0].update(kind="throttle"), "kind 'throttle', which the simulation"),
        (lambda c, t: c.update(thrust={}), "'thrust' is unknown"),
        (lambda c, t: t["simulation"].update(effects={"wing_wake": 0.5}), "'wing_wake' acts in strips"),
    ],
)
def test_a_slip_is_one_sentence(edit, words):
    with pytest.raises(UsageError, match=words) as said:
        parameters(changed(edit))
    assert "\n" not in str(said.value)

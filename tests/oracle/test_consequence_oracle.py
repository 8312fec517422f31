"""Consequences for the notional LA-8 class aircraft: rigid-body equations, delays and gains by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
import pytest

from freqid.blend.state_space import StateSpace
from freqid.compare.consequence import assess
from freqid.compare.loop_margins import Place, closed
from freqid.compare.scenario_consequence import condition_at, consequence_of_effects, design_law_at
from freqid.compare.scenario_law import scenario_law, simulated_motion
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.vehicle import Inertia
from freqid.dynamics.small_motion import equations_of_motion, rotor_spin
from freqid.identify.loads.mass import moving_mass
from freqid.identify.loads.momentum import airframe_momentum
from freqid.simulate.control.linearize import STATES, linearize
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle

SCENARIO = read_scenario(Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml")[0]
AT = SCENARIO.reference_of("u45")
LATE = 0.03


@pytest.fixture(scope="module")
def late():
    """What an extra delay of all actuators costs, with the delay known to 10 ms."""
    return consequence_of_effects(
        SCENARIO,
        AT,
        {},
        {"actuator_delay": {"extra": LATE}},
        names=[("actuator_delay", "extra")],
        covariance=[[0.01**2]],
        draws=40,
    )


def test_rigid_body_equations_are_those_of_the_differentiated_simulation():
    """Those that identification and design use, with the inertia of the tilted wings at this trim."""
    parameters = jax.tree.map(jnp.asarray, whole_vehicle.parameters(SCENARIO))
    at = trim(SCENARIO, parameters, AT)
    linear = linearize(SCENARIO, parameters, at)
    names = {kind: [e.name for e in SCENARIO.effector if e.kind == kind] for kind in ("rotor", "tilt")}
    speeds = dict(zip(names["rotor"], np.asarray(at.positions.speed).tolist(), strict=True))
    tilts = dict(zip(names["tilt"], np.asarray(at.positions.tilt).tolist(), strict=True))
    vehicle = SCENARIO.aircraft()
    spin = rotor_spin(vehicle, linear.effectors, tilts)
    momentum = spin @ [speeds.get(name, 0.0) for name in linear.effectors]
    assert float(at.angles[0]) == pytest.approx(0.0, abs=1e-9)  # the equations are for level wings
    wrench = np.hstack([linear.wrench[:, :6], np.zeros((6, 2)), linear.wrench[:, 6:]])
    E, motion_and_input = equations_of_motion(
        wrench,
        _tilted(vehicle, tilts),
        np.asarray(at.body.velocity),
        float(at.angles[1]),
        spin,
        momentum,
    )
    rates = np.linalg.solve(E[:, :8], motion_and_input)
    np.testing.assert_allclose(rates[:, :8], linear.A[:8, :8], atol=1e-9)
    np.testing.assert_allclose(rates[:, 8:], linear.B[:8], atol=1e-9)


def test_the_models_state_space_is_the_differentiated_simulation():
    """From derivatives of the wrench alone, the wings' masses moved from where the scenario states them."""
    place = Place("u45", AT.u, AT.rho, dict(AT.scheduled))
    motion = simulated_motion(SCENARIO)(place)
    parameters = jax.tree.map(jnp.asarray, whole_vehicle.parameters(SCENARIO))
    linear = linearize(SCENARIO, parameters, trim(SCENARIO, parameters, AT))
    names = (*STATES[:6], *linear.effectors)
    derivatives = {n: linear.wrench[:, j] for j, n in enumerate(names)}
    found = StateSpace.of(derivatives, motion.trim, SCENARIO.aircraft())
    assert found.inputs == motion.inputs
    np.testing.assert_allclose(found.A, motion.A, atol=1e-9)
    np.testing.assert_allclose(found.B, motion.B, atol=1e-9)


def test_the_simulations_law_read_back_gives_the_simulations_margins(late):
    law = scenario_law(SCENARIO)(AT.u, AT.rho, dict(AT.scheduled))
    motion = simulated_motion(SCENARIO)(Place("u45", AT.u, AT.rho, dict(AT.scheduled)))
    found = assess(closed(motion, law, SCENARIO.aircraft()))
    for axis, margins in late.before.margins.items():
        for figure in ("gain_up_db", "phase_deg", "disk"):
            expected = getattr(margins, figure)
            assert getattr(found.margins[axis], figure) == pytest.approx(expected, abs=1e-9), (axis, figure)
    assert found.authority == pytest.approx(late.before.authority)


def _tilted(vehicle, tilts):
    """Return the vehicle with the inertia that its wings give it at their tilts."""
    held = {
        f"effector/{n}": Channel(f"effector/{n}", "rad", np.full(3, x), 1.0, "") for n, x in tilts.items()
    }
    at_rest = Maneuver(FlightRecord(np.arange(3.0), held), vehicle)
    mass = moving_mass(at_rest, lambda x, dt: np.zeros_like(x))
    matrix = airframe_momentum(mass, np.eye(3))
    xx, yy, zz = np.diag(matrix)
    inertia = Inertia(xx=xx, yy=yy, zz=zz, xz=-matrix[0, 2], xy=-matrix[0, 1], yz=-matrix[1, 2])
    mass_properties = msgspec.structs.replace(vehicle.mass_properties, inertia=inertia)
    return msgspec.structs.replace(vehicle, mass_properties=mass_properties)


def test_a_delay_costs_the_turn_at_the_crossover(late):
    """Of one axis alone the cost would be delay times crossover; the others are late too, so nearly that."""
    before, after = late.before.margins["L"], late.after.margins["L"]
    turn = np.degrees(2 * np.pi * before.crossover_hz * LATE)
    assert before.phase_deg - after.phase_deg == pytest.approx(turn, rel=0.1)
    assert before.delay_s - after.delay_s == pytest.approx(LATE, rel=0.35)
    # a slow axis hardly feels it
    assert late.change["margins/Z/phase_deg"] > -4


def test_a_delay_changes_no_vehicle_and_no_trim(late):
    for path, value in late.change.items():
        if path.startswith(("modes/", "authority/")) and not path.startswith("modes/heading"):
            assert value == pytest.approx(0.0, abs=1e-6), path


def test_what_is_not_known_of_the_delay_is_an_interval_of_the_margin(late):
    low, high = late.change_intervals["margins/L/phase_deg"]
    slope = late.change["margins/L/phase_deg"] / LATE
    assert low < late.change["margins/L/phase_deg"] < high
    # ninety per cent of a normal law, from forty draws
    assert high - low == pytest.approx(2 * 1.645 * 0.01 * abs(slope), rel=0.35)
    assert "phase margin at" in late.sentence()


def test_surfaces_that_do_less_lower_the_gain_as_much():
    """A fifth less effect: the roll axis, which surfaces make with rotors, bears up to as much more gain."""
    found = consequence_of_effects(SCENARIO, AT, {}, {"surface_effectiveness": {"loss": 0.2}})
    before, after = found.before, found.after
    lost = 20 * np.log10(1 / 0.8)
    assert 0.3 * lost < after.margins["L"].gain_up_db - before.margins["L"].gain_up_db < 1.05 * lost
    flap = "df3"  # a fifth less effect asks for a quarter more deflection, where nothing else takes over
    assert after.authority[flap] > before.authority[flap] * 0.95


def test_the_margin_of_one_command_is_where_the_closed_loop_loses_its_stability(late):
    """More gain in the roll axis alone, eigenvalues by eigenvalues, until one grows."""
    loop = condition_at(SCENARIO, AT, {}, design_law_at(SCENARIO, AT, {})).loop
    place = loop.axes.index("L")

    def stable(gain):
        louder = loop.gain.copy()
        louder[place] *= gain
        return replace(loop, gain=louder).stable

    low, high = 1.0, 100.0
    assert not stable(high)
    for _ in range(25):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    assert 20 * np.log10(low) == pytest.approx(late.before.margins["L"].gain_up_db, abs=0.02)

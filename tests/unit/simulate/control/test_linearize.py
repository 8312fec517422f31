"""Exact derivatives at trims: those of differences, of the flight itself, and of physics by hand."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.scenario import read_scenario
from freqid.simulate.control.linearize import STATES, linearize
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import by_kind
from freqid.simulate.motion.derivatives import small_motion

SCENARIO = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0]
EFFECTORS = [effector.name for effector in SCENARIO.effector]
EFFECTS = {  # as the scenario has them, one switched off, two scaled, one switched on
    "u00": {},
    "u36": {"slipstream": 0.0},
    "u55-1500m": {"wing_wake": 0.5, "rotor_inplane_force": 1.7},
    "u85": {"ground_effect": 1.0, "gyroscopic": 0.0},
}


@pytest.fixture(scope="module")
def parameters():
    return jax.tree.map(jnp.asarray, motion.parameters(SCENARIO))


@pytest.fixture(scope="module", params=EFFECTS)
def at(request, parameters):
    """A trim, its linearisation, and the parameters with the effects it was made with."""
    effects = parameters.airframe.effects
    changed = {n: {**effects[n], "strength": np.float64(size)} for n, size in EFFECTS[request.param].items()}
    effects = effects | changed
    mine = parameters._replace(airframe=parameters.airframe._replace(effects=effects))
    trimmed = trim(SCENARIO, mine, SCENARIO.reference_of(request.param))
    return trimmed, linearize(SCENARIO, mine, trimmed), mine


@pytest.fixture(scope="module")
def batch():
    """The function that is differentiated, at many states and positions at once."""
    return jax.jit(jax.vmap(lambda *x: small_motion(*x)[0], in_axes=(None, None, 0, 0)))


def test_derivatives_are_those_of_central_differences(at, batch):
    trimmed, linear, parameters = at
    state = np.concatenate([trimmed.body.velocity, np.zeros(3), trimmed.angles, [0.0]])
    order = np.concatenate(by_kind(SCENARIO.aircraft(), np.arange(len(EFFECTORS))))
    held = np.concatenate([trimmed.positions.surface, trimmed.positions.tilt, trimmed.positions.speed])
    point = np.concatenate([state, held[np.argsort(order)]])
    # the loads are smoothed over 0.02 m/s where the airspeed is zero: well below that
    size = np.concatenate([np.full(3, 2e-3), np.full(3, 2e-3), np.full(3, 2e-3)])
    size = np.concatenate([size, [0.5 if name.startswith("n") else 1e-3 for name in EFFECTORS]])

    def values(shift):
        x = np.concatenate([point + shift, point - shift])
        wrench, rate = batch(parameters, trimmed.around, x[:, :9], x[:, 9:][:, order])
        ahead, behind = np.split(np.hstack([wrench, rate]), 2)
        return (ahead - behind) / (2 * np.diag(shift)[:, None])

    # Richardson: the limit that two steps point to
    found = ((4 * values(np.diag(size / 2)) - values(np.diag(size))) / 3).T
    exact = np.hstack([linear.wrench[:, :6], np.zeros((6, 3)), linear.wrench[:, 6:]])
    # by attitude the wrench, which is in body axes, does not change in calm air
    assert np.abs(found[:6, 6:9]).max() < 1e-6 * np.abs(exact).max()
    assert_columns_agree(exact, found[:6])
    assert_columns_agree(np.hstack([linear.A, linear.B]), found[6:])


def assert_columns_agree(exact, found):
    """Each column to 1e-6 of its largest entry; columns of zeros absolutely."""
    scale = np.abs(exact).max(axis=0)
    assert np.max(np.abs(found - exact) / np.where(scale > 1e-9, scale, 1.0)) < 1e-6


def test_the_matrices_say_which_is_which(at):
    trimmed, linear, _ = at
    assert linear.effectors == tuple(EFFECTORS)
    assert linear.wrench.shape == (6, 6 + len(EFFECTORS))
    assert (linear.A.shape, linear.B.shape) == ((9, 9), (9, len(EFFECTORS)))
    i = {name: k for k, name in enumerate(STATES)}
    phi, theta = trimmed.angles
    # gravity along x by pitch, along y by roll; heading matters to nothing; rates turn the angles
    assert linear.A[i["u"], i["theta"]] == pytest.approx(-9.80665 * np.cos(theta), rel=1e-9)
    assert linear.A[i["v"], i["phi"]] == pytest.approx(9.80665 * np.cos(phi) * np.cos(theta), rel=1e-9)
    assert np.abs(linear.A[:, i["psi"]]).max() < 1e-9
    assert linear.A[i["phi"], i["p"]] == 1.0
    assert linear.A[i["theta"], i["q"]] == pytest.approx(np.cos(phi), rel=1e-12)
    assert not linear.B[6:].any()


def test_forces_become_accelerations_of_the_centre_of_gravity(at):
    """Newton's law by hand: what effectors do to velocities is their force over the mass."""
    _, linear, parameters = at
    rows = slice(0, 3)
    columns = [k for k, name in enumerate(EFFECTORS) if not name.startswith("dw")]  # tilts move the centre
    by_force = linear.wrench[rows, 6:][:, columns] / float(parameters.mass.mass)
    assert np.allclose(linear.B[rows][:, columns], by_force, rtol=1e-9, atol=1e-9 * np.abs(by_force).max())


def test_left_and_right_effectors_do_mirrored_things(at):
    linear = at[1]
    mirror = np.array([1, -1, 1, -1, 1, -1.0])
    scale = np.abs(linear.wrench).max(axis=1)
    for left, right in (("de1", "de2"), ("df3", "df4"), ("dr1", "dr2"), ("n1", "n4"), ("n6", "n7")):
        one, other = (linear.wrench[:, 6 + EFFECTORS.index(name)] for name in (left, right))
        assert np.all(np.abs(one - mirror * other) < 1e-6 * scale)

"""The linear model against differences of the nonlinear equations of motion of the same aircraft."""

import msgspec
import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.core.errors import DataError, UsageError
from freqid.core.scenario import Reference
from freqid.core.vehicle import Rotor

SPIN = {"n1": (1, 3e-3), "n2": (-1, 5e-3)}
ROTORS = tuple(
    Rotor(name=n, spin=s, inertia=J, wing=w)
    for (n, (s, J)), w in zip(SPIN.items(), ("front", "rear"), strict=True)
)
VEHICLE = msgspec.structs.replace(tilt_wing.VEHICLE, rotors=ROTORS)
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")


@pytest.fixture(scope="module")
def model():
    trims = [tilt_wing.trim(u, 1.1, tilt_wing.trim(u, 1.225)["dw1"]) for u in (6.0, 9.0, 14.0)]
    return GlobalModel(line_up([tilt_wing.exact_point(at, f"{at['u']}") for at in trims], "abc"))


def rates(at):
    """Return the time derivatives of `STATES`; rotors keep their speed."""
    loads = tilt_wing.loads({k: np.atleast_1d(v) for k, v in at.items()})[:, 0]
    velocity, turn = (np.array([at[n] for n in names]) for names in ("uvw", "pqr"))
    phi, theta = at["phi"], at["theta"]
    down = np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    inertia = np.diag([3.1, 6.6, 9.2])
    shafts = {"n1": at["dw1"], "n2": at["dw2"]}
    momentum = sum(
        s * J * at[n] * np.array([np.cos(shafts[n]), 0, -np.sin(shafts[n])]) for n, (s, J) in SPIN.items()
    )
    moment = loads[3:] - np.cross(turn, inertia @ turn + momentum)
    accelerations = loads[:3] / 28.6 + 9.80665 * down - np.cross(turn, velocity)
    p, q, r = turn
    angles = [p + np.tan(theta) * (q * np.sin(phi) + r * np.cos(phi)), q * np.cos(phi) - r * np.sin(phi)]
    return np.concatenate([accelerations, np.linalg.solve(inertia, moment), angles])


def test_it_is_the_derivative_of_the_motion(model):
    linear = model.to_statespace(Reference(id="x", u=9.0, rho=1.1), VEHICLE)
    at = tilt_wing.trim(9.0, 1.1, tilt_wing.trim(9.0, 1.225)["dw1"])
    at |= {"phi": 0.0, "theta": np.arctan2(at["w"], at["u"])}
    assert linear.states == STATES
    assert linear.trim["theta"] == pytest.approx(at["theta"], abs=1e-7)
    np.testing.assert_allclose(rates(at), 0, atol=1e-6)
    for names, matrix in ((STATES, linear.A), (linear.inputs, linear.B)):
        for j, name in enumerate(names):
            step = 0.01 if name in SPIN else 1e-5
            difference = (rates(at | {name: at[name] + step}) - rates(at | {name: at[name] - step})) / (
                2 * step
            )
            # The place on the corridor follows speed by a tenth of a percent of what tilting does.
            slack = 0.02 if name == "u" else 2e-5
            np.testing.assert_allclose(matrix[:, j], difference, atol=slack, rtol=1e-5, err_msg=name)


def test_a_condition_between_the_points_has_one_too(model):
    linear = model.to_statespace(Reference(id="new", u=11.0, rho=1.0), VEHICLE)
    assert np.isfinite(linear.A).all()
    assert linear.inputs == ("df", "dr", "n1", "n2", "da")


def test_what_it_cannot_do_without_is_said(model):
    at = Reference(id="x", u=9.0, rho=1.1)
    with pytest.raises(DataError, match="outside the corridor"):
        model.to_statespace(msgspec.structs.replace(at, u=40.0), VEHICLE)
    other = msgspec.structs.replace(
        VEHICLE, effectors=(), wings=(), rotors=(Rotor(name="n9", spin=1, inertia=1e-3),)
    )
    with pytest.raises(DataError, match="no rotor 'n9' among its regressors"):
        model.to_statespace(at, other)
    from dataclasses import replace

    fewer = {r: k for r, k in model.corridor.responses.items() if r != "N"}
    with pytest.raises(UsageError, match="found X Y Z L M in form 'force'"):
        GlobalModel(replace(model.corridor, responses=fewer)).to_statespace(at, VEHICLE)

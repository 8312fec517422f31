"""Ready forms held to the linear equations of motion that numpy has, and to what they are chosen by."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.dynamics.small_motion import STATES, equations_of_motion
from freqid.identify.output_error.forms.form import Loads, find_form, forms, model_of, parted
from freqid.identify.output_error.forms.moments import (
    MOMENTUM,
    pitch_acceleration,
    roll_and_yaw_acceleration,
)
from freqid.identify.output_error.simulation import derivative_of

VEHICLE = Vehicle(
    name="test",
    mass_properties=MassProperties(mass_kg=30.0, inertia=Inertia(xx=2.4, yy=3.1, zz=4.9, xz=0.3)),
    area_m2=1.1,
    span_m=2.0,
    chord_m=0.4,
)
U, W, THETA, RHO = 20.0, 1.5, 0.075, 1.2
SLOPES = np.random.default_rng(0).normal(size=(6, 8)) * np.array([1, 1, 1, 3, 3, 3, 0, 0])
CONSTANTS = {
    "mass_kg": 30.0,
    "Ixx": 2.4,
    "Iyy": 3.1,
    "Izz": 4.9,
    "Ixz": 0.3,
    "area_m2": 1.1,
    "span_m": 2.0,
    "chord_m": 0.4,
    "rho": RHO,
    "u": U,
    "w": W,
    "theta": THETA,
    "V": np.hypot(U, W),
    "alpha": np.arctan2(W, U),
    "qbar": 0.5 * RHO * (U**2 + W**2),
}


def linear(responses, regressors, form="force", extra=()):
    """Return the model, its linearisation about trim with respect to the states, and its inputs there."""
    loads = Loads(tuple((r, regressors) for r in responses), form, ())
    found = find_form(responses, form)
    loads = Loads(loads.regressors, form, tuple(n for n in found.outputs if n in extra) or found.outputs[:2])
    model = model_of(found, loads)
    at = {n: CONSTANTS.get(n, CONSTANTS.get(n.removeprefix("trim_"), 0.0)) for n in model.inputs}
    x = np.array([CONSTANTS.get(s, 0.0) for s in model.states])
    return model, x, np.array([at[n] for n in model.inputs])


def jacobian(model, x, u, values):
    p = np.array([values.get(n, 0.0) for n in model.parameters])
    return np.asarray(jax.jacfwd(derivative_of(model))(x, u, p))


def reference():
    """Return A of x' = A x by the linear equations of motion in numpy."""
    e, a = equations_of_motion(SLOPES, VEHICLE, np.array([U, 0.0, W]), THETA, np.empty((3, 0)), np.zeros(3))
    return np.linalg.solve(e, a)


@pytest.mark.parametrize(
    ("responses", "regressors"), [(("X", "Z", "M"), ("u", "w", "q")), (("Y", "L", "N"), ("v", "p", "r"))]
)
def test_dimensional_forms_are_the_linear_equations_of_motion(responses, regressors):
    model, x, u = linear(responses, regressors)
    rows = ["XYZLMN".index(r) for r in responses]
    values = {
        f"{r}_{n}": SLOPES[i, STATES.index(n)]
        for r, i in zip(responses, rows, strict=True)
        for n in regressors
    }
    weight = 30.0 * 9.80665
    values |= {"X_bias": weight * np.sin(THETA), "Z_bias": -weight * np.cos(THETA)}
    place = [STATES.index(s) for s in model.states]
    np.testing.assert_allclose(
        jacobian(model, x, u, values), reference()[np.ix_(place, place)], rtol=1e-9, atol=1e-9
    )


def test_specific_and_coefficient_forms_are_the_dimensional_one_over_their_sizes():
    values = {"L_p": -6.0, "N_r": -4.0, "Y_p": 2.0}
    model, x, u = linear(("Y", "L", "N"), ("v", "p", "r"))
    force = jacobian(model, x, u, values)
    model, x, u = linear(("Y", "L", "N"), ("v", "p", "r"), "specific")
    over = {"L_p": 2.4, "N_r": 4.9, "Y_p": 30.0}
    np.testing.assert_allclose(jacobian(model, x, u, {n: v / over[n] for n, v in values.items()}), force)
    # coefficients: rates nondimensional, sideslip for lateral velocity
    model, x, u = linear(("Y", "L", "N"), ("beta", "phat", "rhat"), "coefficient")
    speed, qs = CONSTANTS["V"], CONSTANTS["qbar"] * 1.1
    hat = 2.0 / (2 * speed)
    scaled = {
        "L_phat": -6.0 / (qs * 2.0 * hat),
        "N_rhat": -4.0 / (qs * 2.0 * hat),
        "Y_phat": 2.0 / (qs * hat),
    }
    ours = jacobian(model, x, u, scaled)
    np.testing.assert_allclose(ours[1:, 1:], force[1:, 1:], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(ours[0] * speed, force[0] * np.array([0, 1, 1, 1]), rtol=1e-9, atol=1e-9)


def test_the_longitudinal_coefficient_form_is_the_dimensional_one_in_other_states():
    rng = np.random.default_rng(1)
    names = ("u", "w", "q")
    model, x, u = linear(("X", "Z", "M"), names)
    slopes = {f"{r}_{n}": rng.normal() for r in "XZM" for n in names}
    bias = {"X_bias": 25.0, "Z_bias": -290.0}
    force = jacobian(model, x, u, slopes | bias)
    speed, alpha = CONSTANTS["V"], CONSTANTS["alpha"]
    cos, sin = np.cos(alpha), np.sin(alpha)
    # d(u, w, q, theta) / d(V, alpha, q, theta)
    turn = np.eye(4)
    turn[:2, :2] = [[cos, -speed * sin], [sin, speed * cos]]
    other, x2, u2 = linear(("X", "Z", "M"), ("V", "alpha", "qhat"), "coefficient")
    qs = CONSTANTS["qbar"] * 1.1
    scaled = {}
    for r, arm in (("X", 1.0), ("Z", 1.0), ("M", 0.4)):
        by_u, by_w, by_q = (slopes[f"{r}_{n}"] for n in names)
        load = bias.get(f"{r}_bias", 0.0)
        scaled[f"{r}_bias"] = load / (qs * arm)
        # a coefficient stays as dynamic pressure rises with V
        scaled[f"{r}_V"] = (cos * by_u + sin * by_w - 2 * load / speed) / (qs * arm)
        scaled[f"{r}_alpha"] = speed * (cos * by_w - sin * by_u) / (qs * arm)
        scaled[f"{r}_qhat"] = by_q / (qs * arm) * 2 * speed / 0.4
    ours = jacobian(other, x2, u2, scaled)
    start = np.asarray(
        derivative_of(model)(x, u, np.array([(slopes | bias).get(n, 0.0) for n in model.parameters]))
    )
    # the trim is not exact: turning the states adds the turn of the rate itself
    rate = np.zeros((4, 4))
    dcos, dsin = -sin, cos
    rate[0, 1] = dcos * start[0] + dsin * start[1]
    rate[1, 1] = (-cos * start[0] - sin * start[1]) / speed
    rate[1, 0] = -(-sin * start[0] + cos * start[1]) / speed**2
    np.testing.assert_allclose(ours, np.linalg.inv(turn) @ force @ turn + rate, rtol=1e-8, atol=1e-8)


def test_moments_are_those_that_identification_reconstructs():
    rng = np.random.default_rng(3)
    p, q, r = rng.normal(size=3)
    u = {**CONSTANTS, **dict(zip(MOMENTUM, rng.normal(size=6), strict=True))}
    applied = {"L": 3.0, "M": -2.0, "N": 1.5}
    roll, yaw = roll_and_yaw_acceleration(applied, p, q, r, u)
    pitch = pitch_acceleration(applied["M"], p, r, u)
    inertia, rates = VEHICLE.mass_properties.inertia.matrix, np.array([p, q, r])
    momentum = inertia @ rates + [u["hx"], u["hy"], u["hz"]]
    change = inertia @ [roll, pitch, yaw] + [u["hx_rate"], u["hy_rate"], u["hz_rate"]]
    np.testing.assert_allclose(change + np.cross(rates, momentum), list(applied.values()), rtol=1e-12)


def test_forms_are_found_by_responses_and_models_are_shared():
    assert {f.name for f in forms()} == {
        "lateral",
        "lateral, coefficients",
        "longitudinal",
        "longitudinal, coefficients",
        "short period",
    }
    loads = Loads((("Z", ("w", "q")), ("M", ("w", "q"))), "force", ("w", "q"))
    form = find_form(("M", "Z"), "force")
    assert form.name == "short period"
    assert model_of(form, loads) is model_of(form, Loads(loads.regressors, "force", ("w", "q")))
    assert parted(tuple("XYZLMN"), "force") == [("X", "Z", "M"), ("Y", "L", "N")]
    with pytest.raises(UsageError, match="no ready model has the responses L N in form 'force'"):
        parted(("L", "N"), "force")

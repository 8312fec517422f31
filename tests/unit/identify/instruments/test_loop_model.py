"""The fitted closed loop against the one that a design makes of the same numbers, and on a known flight."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.dynamics.small_motion import equations_of_motion, rotor_spin
from freqid.identify.instruments.loop_model import LoopModel

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")
GAINS = {"de": {"theta": 0.35, "q": 0.05, "w": 0.01}, "da": {"phi": -0.3, "p": -0.05}}


@pytest.fixture(scope="module")
def vehicle():
    kinds = {"de": "surface", "da": "surface", "dr": "surface", "n1": "rotor"}
    return Vehicle(
        name="test",
        mass_properties=MassProperties(mass_kg=28.6, inertia=Inertia(xx=2.4, yy=3.1, zz=4.9, xz=0.15)),
        effectors=tuple(Effector(name=n, kind=k, limits=(-1, 900)) for n, k in kinds.items()),
        rotors=(Rotor(name="n1", spin=-1, inertia=0.004, axis=(1.0, 0.0, -0.2)),),
    )


def wrench_of(derivatives, effectors):
    names = ("u", "v", "w", "p", "q", "r", *effectors)
    return np.array([[derivatives[c].get(n, 0.0) for n in names] for c in "XYZLMN"])


def test_it_answers_as_the_loop_of_the_design_does(linear_aircraft, vehicle):
    trim, velocity, theta = {"n1": 420.0}, np.array([20.0, 0.0, 1.0]), 0.05
    effectors = ("de", "da", "dr", "n1")
    lags = {"de": 0.0, "da": 0.0, "dr": 0.0, "n1": 0.0}
    loop = perturbed_aircraft(
        linear_aircraft.DERIVATIVES,
        vehicle,
        u=20.0,
        w=1.0,
        theta=theta,
        gains=GAINS,
        lag_s=lags,
        trim=trim,
    )
    feedback, forward = np.zeros((3, 4, 8)), np.zeros((3, 4))
    forward[0] = 1.0
    for effector, row in GAINS.items():
        for state, gain in row.items():
            feedback[1, effectors.index(effector), STATES.index(state)] = gain
    spin = rotor_spin(vehicle, effectors, trim)
    model = LoopModel(
        vehicle,
        velocity,
        theta,
        spin,
        spin @ np.array([0.0, 0.0, 0.0, 420.0]),
        wrench_of(linear_aircraft.DERIVATIVES, effectors),
        feedback,
        forward,
        np.ones(8, dtype=bool),
    )
    lines = np.array([0.05, 0.4, 1.8])
    tones = np.random.default_rng(0).standard_normal((4, 3, 2)) @ [1.0, 1j]
    expected = loop.rows((*STATES[:6], *effectors)) @ loop.motion(effectors, tones, lines)
    np.testing.assert_allclose(model.response(lines, tones), expected, rtol=1e-9, atol=1e-12)


def test_states_that_rest_do_not_answer(linear_aircraft, vehicle):
    moving = np.isin(STATES, ("u", "w", "q", "theta"))
    forward = np.zeros((3, 4))
    forward[0] = 1.0
    model = LoopModel(
        vehicle,
        np.array([20.0, 0.0, 0.0]),
        0.0,
        np.zeros((3, 4)),
        np.zeros(3),
        wrench_of(linear_aircraft.DERIVATIVES, ("de", "da", "dr", "n1")),
        np.zeros((3, 4, 8)),
        forward,
        moving,
    )
    answer = model.response(np.array([0.5]), np.ones((4, 1), dtype=complex))
    assert answer[[0, 2, 4]].all()
    assert not answer[[1, 3, 5]].any()


def test_by_itself_it_moves_as_its_state_space_with_integrals_does(linear_aircraft, vehicle):
    wrench = wrench_of(linear_aircraft.DERIVATIVES, ("de", "da", "dr", "n1"))
    feedback = np.zeros((3, 4, 8))
    feedback[1, 0, [7, 4]] = 0.35, 0.05  # theta and q to de
    feedback[0, 0, 7] = 0.2  # the integral of theta
    feedback[2, 1, 3] = -0.01  # p' to da
    model = LoopModel(
        vehicle,
        np.array([20.0, 0.0, 1.0]),
        0.05,
        np.zeros((3, 4)),
        np.zeros(3),
        wrench,
        feedback,
        np.ones((3, 4)),
        np.ones(8, dtype=bool),
    )
    full = np.concatenate([wrench[:, :6], np.zeros((6, 2)), wrench[:, 6:]], axis=1)
    E, A = equations_of_motion(full, vehicle, model.velocity, model.theta, model.spin, model.momentum)
    integral, proportional, derivative = feedback
    push = A[:, 8:]
    answers = np.linalg.inv(E[:, :8] - push @ derivative)
    states = np.block(
        [
            [answers @ (A[:, :8] + push @ proportional), answers @ push @ integral],
            [np.eye(8), np.zeros((8, 8))],
        ]
    )
    expected = np.linalg.eigvals(states)
    s, shape = model.free()
    clear = s[np.abs(s) > 1e-3]
    assert len(clear) == (np.abs(expected) > 1e-3).sum()
    for mode in clear:
        assert np.abs(expected - mode).min() < 1e-6 * max(1.0, abs(mode))
    k = int(np.argmax(np.abs(s.imag)))
    theta = shape[4, k] / s[k]  # wings are level: theta' = q
    np.testing.assert_allclose(shape[6, k], (0.35 + 0.2 / s[k]) * theta + 0.05 * shape[4, k], rtol=1e-6)

"""The fitted closed loop against the one that a design makes of the same numbers, and on a known flight."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle
from freqid.design.forecast.modelled import perturbed_aircraft
from freqid.dynamics.small_motion import rotor_spin
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

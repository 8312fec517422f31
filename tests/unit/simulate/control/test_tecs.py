"""The energy controller: at rest in its trim, and in which direction it moves what."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.scenario import read_scenario
from freqid.simulate.control.tecs import Goal, tecs
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import attitude
from freqid.simulate.motion import whole_vehicle as motion

DEP6 = read_scenario(Path(__file__).parents[4] / "scenarios" / "dep6.toml")[0]


@pytest.fixture(scope="module")
def start():
    parameters = jax.tree.map(jnp.asarray, motion.parameters(DEP6))
    at = trim(DEP6, parameters, DEP6.reference_of("u18"))
    return at, tecs(DEP6, parameters.actuators, at)


@pytest.fixture(scope="module")
def ask(start):
    at, law = start
    speed = float(np.linalg.norm(at.body.velocity))
    command = jax.jit(lambda body, memory, goal: law.command(body, memory, goal))

    def call(body=at.body, memory=law.memory, **goal):
        wanted = {"speed": speed, "climb": 0.0, "stopped": 0.0, "held": 0.0} | goal
        return command(
            body, memory, Goal(**{n: jnp.asarray(x) for n, x in wanted.items()}, wind=jnp.zeros(3))
        )

    return speed, call


def test_in_its_trim_it_commands_the_trim_and_remembers_nothing_new(start, ask):
    commands, rates = ask[1]()
    for found, expected in zip(commands, start[0].commands, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_allclose(rates, 0.0, atol=1e-9)


def test_a_climb_takes_power_and_pitch_a_faster_aim_power_and_less_pitch(start, ask):
    """de is up negative: more pitch is a negative change."""
    speed, call = ask
    still = call()[0]
    climb, faster = call(climb=0.1)[0], call(speed=speed + 1.0)[0]
    assert climb.speed[0] > still.speed[0] < faster.speed[0]
    assert climb.surface[0] < still.surface[0] < faster.surface[0]
    # 0.1 rad of climb is as much energy as 0.1 g of acceleration
    gain = DEP6.control["tecs"]["energy"]
    assert float(climb.speed[0] - still.speed[0]) == pytest.approx(gain * 0.1, rel=1e-6)


def test_stopped_rotors_stop_and_pitch_holds_the_speed_alone(ask):
    speed, call = ask
    glide = call(stopped=1.0)[0]
    assert np.all(np.asarray(glide.speed) == 0.0)
    np.testing.assert_allclose(call(stopped=1.0, climb=0.3)[0].surface, glide.surface)
    assert call(stopped=1.0, speed=speed + 1.0)[0].surface[0] > glide.surface[0]  # nose down


def test_while_a_manoeuvre_is_flown_rotors_go_with_the_airspeed(start, ask):
    at, law = start
    _, call = ask
    faster = at.body._replace(velocity=1.1 * at.body.velocity)
    ratio = call(body=faster, held=1.0)[0].speed / law.trim.speed
    np.testing.assert_allclose(ratio, 1.1, rtol=1e-9)


def test_wings_are_levelled_and_the_heading_is_held(start, ask):
    at, _ = start
    _, call = ask
    pitch = float(at.angles[1])
    right = at.body._replace(attitude=attitude.from_euler(0.2, pitch, 0.0))
    away = at.body._replace(attitude=attitude.from_euler(0.0, pitch, 0.2))
    assert call(body=right)[0].surface[1] < 0 > call(body=away)[0].surface[1]

"""Closed-loop flights from anywhere: finite in value and gradient, alone and in a batch."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from freqid.core.scenario import read_scenario
from freqid.simulate.air.surroundings import calm
from freqid.simulate.control.law import Aim, command
from freqid.simulate.control.lq import close_loop
from freqid.simulate.effects import library
from freqid.simulate.loads.quantities import Positions
from freqid.simulate.motion import attitude
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.integrate import integrate
from freqid.simulate.motion.rigid_body import BodyState

SCENARIO = read_scenario(Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml")[0]
DT, STEPS, ALTITUDE = 0.005, 200, 100.0
AIR = calm(1.225)


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, SCENARIO.reference[0])


@pytest.fixture(scope="module")
def ends(loop):
    """End of a second of closed loop, and its gradient by the size of every effect, of a few flights."""
    effects = loop.parameters.airframe.effects
    sizes = {name: effect.size for name, effect in library().items()}

    def end(strengths, velocity, rates, angles, surface, tilt, speed, aimed):
        scaled = {name: {**effects[name], size: strengths[name]} for name, size in sizes.items()}
        parameters = loop.parameters._replace(airframe=loop.parameters.airframe._replace(effects=scaled))
        body = BodyState(jnp.array([0.0, 0.0, -ALTITUDE]), attitude.from_euler(*angles), velocity, rates)
        positions = Positions(surface, tilt, jnp.zeros(2), speed)
        state = motion.start(parameters, body, positions, AIR, DT)
        aim = Aim(aimed, jnp.asarray(ALTITUDE), jnp.zeros(3))

        def step(carry, _):
            state, drift = carry
            commands, rate = command(loop.law, state.moving.body, drift, aim)
            return motion.step(parameters, state, commands, AIR, DT), drift + DT * rate

        _, (state, _) = integrate(
            step, (state, jnp.zeros(3)), jnp.zeros(STEPS), observe=lambda s, _: 0.0, every=STEPS
        )
        body = state.moving.body
        return jnp.concatenate([body.velocity, body.rates, body.attitude, state.moving.speed])

    def gradient(strengths, *start):
        of = lambda s: end(s, *start)  # noqa: E731
        return jax.jvp(of, (strengths,), (jax.tree.map(jnp.ones_like, strengths),))

    compiled = jax.jit(
        jax.vmap(gradient, in_axes=(None, *[0] * 7)),
        compiler_options={"xla_backend_optimization_level": 0},  # half the time to compile
    )
    strengths = {name: jnp.asarray(effects[name][size], dtype=float) for name, size in sizes.items()}
    return lambda *starts: compiled(strengths, *(np.asarray(x, dtype=float) for x in starts))


def starts(velocity, rates, angles, surface, tilt, speed, aimed):
    return (
        np.array(velocity),
        np.array(rates),
        np.array(angles),
        np.full(10, surface),
        *map(np.array, (tilt, [speed] * 8, aimed)),
    )


HOVER = starts([0, 0, 0], [0, 0, 0], [0, 0, 0], 0.0, [1.5, 1.5], 660.0, 0.0)
STOPPED = starts([0, 0, 0], [0, 0, 0], [0, 0, 0], 0.0, [1.5, 1.5], 0.0, 0.0)
STALLED = starts([5, 0, 20], [0.5, 1, -0.5], [0.3, 0.8, 1], 0.5, [0.1, 0.1], 0.0, 12.0)
BACKWARDS = starts([-15, 6, -3], [0, 0, 2], [-0.6, -0.9, 3.1], -0.5, [0.4, 1.2], 900.0, 20.0)


@pytest.fixture(scope="module")
def alone(ends):
    """The fixed members of the batch, beside one more of their own."""
    return ends(*map(np.stack, zip(HOVER, HOVER, STOPPED, BACKWARDS, strict=True)))[0]


def number(low, high):
    return st.one_of(st.just(0.0), st.floats(low, high, allow_subnormal=False))


@pytest.mark.slow
@settings(max_examples=10)
@given(
    st.builds(
        starts,
        st.tuples(number(-30, 30), number(-15, 15), number(-30, 30)),
        st.tuples(*[number(-2, 2)] * 3),
        st.tuples(number(-1, 1), number(-1, 1), number(-3.1, 3.1)),
        number(-0.5, 0.5),
        st.tuples(number(-0.08, 1.8), number(-0.08, 1.8)),
        number(0, 950),
        number(0, 26),
    )
)
@example(STALLED)
def test_a_second_of_closed_loop_and_its_gradient_are_finite(ends, alone, start):
    """Beside hover, rotors at rest in still air, and flow from behind, in one batch."""
    values, slopes = ends(*map(np.stack, zip(start, HOVER, STOPPED, BACKWARDS, strict=True)))
    assert np.all(np.isfinite(values))
    assert np.all(np.isfinite(slopes))
    assert np.linalg.norm(values[:, 6:10], axis=1) == pytest.approx(np.ones(4), abs=1e-9)
    assert np.abs(slopes[1]).max() > 1e-6  # the hover's end depends on the effects
    # what flies beside a flight does not change it
    assert np.allclose(values[1:], alone[1:], rtol=1e-12, atol=1e-12)

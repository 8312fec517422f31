"""The airframe over its envelope and beyond: finite, symmetric, exactly differentiable."""

from __future__ import annotations

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from freqid.core.scenario import read_scenario
from freqid.simulate.loads import airframe, description
from freqid.simulate.loads.quantities import Flow, Positions, Wake

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml"
WEIGHT = 28.6 * 9.80665
# One flat vector of all that the wrench depends on, so that one Jacobian holds every derivative.
PARTS = {
    "velocity": (3, 35.0, -35.0),
    "rates": (3, 3.0, -3.0),
    "surface": (10, 0.7, -0.7),
    "tilt": (2, 1.9, -0.2),
    "tilt_rate": (2, 0.5, -0.5),
    "speed": (8, 950.0, 0.0),
    "arriving": (4, 5.0, -5.0),
}
SIZES = [size for size, _, _ in PARTS.values()]
SURFACE_SWAP = [1, 0, 3, 2, 5, 4, 7, 6, 9, 8]
ROTOR_SWAP = [3, 2, 1, 0, 7, 6, 5, 4]
LENGTH = sum(SIZES)


def arguments(x, height=100.0):
    velocity, rates, surface, tilt, tilt_rate, speed, late = jnp.split(x, np.cumsum(SIZES)[:-1])
    flow = Flow(velocity, rates, jnp.float64(1.2), jnp.float64(height))
    return flow, Positions(surface, tilt, tilt_rate, speed), Wake(late[:2], late[2:])


@pytest.fixture(scope="module")
def la8():
    return description.parameters(read_scenario(SCENARIO)[0])


@pytest.fixture(scope="module")
def load(la8):
    """All outputs at once as one vector: wrench, shaft torques and the shed wake."""

    def evaluate(x, effects):
        aero = airframe.wrench(la8._replace(effects=effects), *arguments(x))
        return jnp.concatenate([*aero.wrench, aero.torque, aero.shed.downwash, aero.shed.blowing])

    return evaluate


@pytest.fixture(scope="module")
def value(load, la8):
    compiled = jax.jit(load)

    def evaluate(x, effects=None):
        return np.asarray(compiled(jnp.asarray(x), effects or la8.effects))

    return evaluate


@pytest.fixture(scope="module")
def jacobian(load, la8):
    """Derivatives to the vector and to every effect parameter."""
    compiled = jax.jit(jax.jacfwd(load, argnums=(0, 1)))
    return lambda x: compiled(jnp.asarray(x), la8.effects)


def number(low: float, high: float):
    return st.one_of(st.just(0.0), st.floats(low, high, allow_subnormal=False))


RANGES = [(low, high) for size, high, low in PARTS.values() for _ in range(size)]
points = st.tuples(*(number(*between) for between in RANGES)).map(np.array)
HOVER = np.concatenate([np.zeros(16), np.full(2, np.pi / 2), np.zeros(2), np.full(8, 660.0), np.zeros(4)])


@settings(max_examples=150)
@given(points)
@example(np.zeros(LENGTH))  # at rest, rotors stopped
@example(HOVER)
@example(np.where(np.arange(LENGTH) < 20, HOVER, 0.0))  # still air, rotors stopped, wings up
@example(np.eye(LENGTH)[0] * -20.0)  # flow from straight behind
@example(np.eye(LENGTH)[2] * 30.0)  # falling flat: 90 degrees
@example(np.eye(LENGTH)[1] * 25.0)  # flow from the side
def test_values_and_gradients_are_finite(value, jacobian, x):
    assert np.all(np.isfinite(value(x)))
    to_x, to_effects = jacobian(x)
    assert np.all(np.isfinite(to_x))
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(to_effects))
    assert np.abs(value(x)[:6]).max() < 40 * WEIGHT


@settings(max_examples=40)
@given(points)
def test_a_batch_gives_what_single_calls_give(value, batch, x):
    xs = np.stack([x, HOVER, np.zeros(LENGTH), np.where(np.arange(LENGTH) < 20, -x, x)])
    for row, single in zip(batch(xs), xs, strict=True):
        np.testing.assert_allclose(row, value(single), rtol=0, atol=1e-10 * WEIGHT)


@pytest.fixture(scope="module")
def batch(load, la8):
    compiled = jax.jit(jax.vmap(load, in_axes=(0, None)))
    return lambda xs: np.asarray(compiled(jnp.asarray(xs), la8.effects))


@settings(max_examples=100)
@given(points)
def test_left_and_right_are_mirror_images(value, x):
    velocity, rates, surface, tilt, tilt_rate, speed, late = np.split(x, np.cumsum(SIZES)[:-1])
    mirrored = np.concatenate(
        [
            velocity * [1, -1, 1],
            rates * [-1, 1, -1],
            surface[SURFACE_SWAP],
            tilt,
            tilt_rate,
            speed[ROTOR_SWAP],
            late[[1, 0, 3, 2]],
        ]
    )
    here, there = value(x), value(mirrored)
    expected = np.concatenate(
        [
            here[:3] * [1, -1, 1],
            here[3:6] * [-1, 1, -1],
            here[6:14][ROTOR_SWAP],
            here[14:16][::-1],
            here[16:18][::-1],
        ]
    )
    np.testing.assert_allclose(there, expected, rtol=0, atol=1e-9 * max(WEIGHT, np.abs(here).max()))


def smooth_point(seed: int) -> np.ndarray:
    """A flying point of the corridor, disturbed; central differences need no kink within their step."""
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0, 26)
    return np.concatenate(
        [
            [speed, *rng.uniform(-2, 2, 2)],
            rng.uniform(-0.5, 0.5, 3),
            rng.uniform(-0.3, 0.3, 10),
            rng.uniform(0, 1.6, 2),
            rng.uniform(-0.2, 0.2, 2),
            rng.uniform(300, 800, 8),
            rng.uniform(-1, 1, 4),
        ]
    )


@pytest.mark.parametrize("seed", range(5))
def test_exact_derivatives_equal_central_differences(value, jacobian, seed):
    x = smooth_point(seed)
    exact = np.asarray(jacobian(x)[0])
    steps = np.repeat([1e-3, 1e-3, 1e-4, 1e-4, 1e-3, 1e-1, 1e-3], SIZES)
    # Errors count by what a usual change of the argument does, against a usual size of the output.
    change = np.repeat([5.0, 0.5, 0.2, 0.3, 0.2, 100.0, 1.0], SIZES)
    usual = np.repeat([WEIGHT, 1.0, 1.0], [6, 8, 4])
    for i, step in enumerate(steps):
        shift = step * np.eye(LENGTH)[i]
        near, far = value(x + shift) - value(x - shift), value(x + 2 * shift) - value(x - 2 * shift)
        central = (8 * near - far) / (12 * step)  # error of fourth order in the step
        assert np.abs((exact[:, i] - central) * change[i] / usual).max() < 1e-6


def test_derivatives_to_effect_strengths_equal_differences(value, la8, jacobian):
    x = smooth_point(7)
    to_effects = jacobian(x)[1]
    for name in ("slipstream", "wing_wake", "rotor_inplane_force"):
        sizes = [{**la8.effects[name], "strength": jnp.float64(1 + h)} for h in (-1e-4, 1e-4)]
        moved = [value(x, la8.effects | {name: size}) for size in sizes]
        central = (moved[1] - moved[0]) / 2e-4
        exact = np.asarray(to_effects[name]["strength"])
        np.testing.assert_allclose(exact, central, rtol=0, atol=1e-6 * WEIGHT)
        assert np.abs(exact[:6]).max() > 1e-3 * WEIGHT  # it does something

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.simulate.motion.integrate import divergence, integrate, rk4

DT = 0.01
TIME = np.arange(200) * DT


def oscillate(state, push):
    """One step of a damped oscillator under a held push."""
    return rk4(lambda s, _: (s[1], push - 4.0 * s[0] - 0.4 * s[1]), state, DT)


def test_time_inside_a_step_reaches_the_derivative():
    step = lambda y, t: rk4(lambda y, elapsed: jnp.cos(t + elapsed) * y, y, DT)  # noqa: E731
    y, end = jax.jit(partial(integrate, step))(jnp.array(1.0), jnp.asarray(TIME))
    assert np.allclose(y, np.exp(np.sin(TIME)), rtol=1e-9)
    assert float(end) == pytest.approx(np.exp(np.sin(2.0)), rel=1e-9)


def test_what_a_derivative_says_beside_is_kept_from_the_start_of_the_step():
    derivative = lambda y, elapsed: (-y, {"y": y, "elapsed": elapsed})  # noqa: E731
    after, aux = rk4(derivative, jnp.array(2.0), 0.1, has_aux=True)
    assert aux == {"y": 2.0, "elapsed": 0.0}
    assert after == rk4(lambda y, _: -y, jnp.array(2.0), 0.1)


def test_keeping_every_tenth_sample_changes_nothing_else():
    start, push = (jnp.array(1.0), jnp.array(0.0)), jnp.sin(jnp.asarray(TIME))
    (all_x, _), end = integrate(oscillate, start, push)
    (some_x, _), same_end = integrate(oscillate, start, push, every=10)
    assert np.array_equal(some_x, all_x[::10])
    assert np.array_equal(end, same_end)
    with pytest.raises(UsageError, match=r"200 steps are no multiple of 30"):
        integrate(oscillate, start, push, every=30)


def test_a_control_law_and_an_excitation_after_it_live_in_the_same_step():
    # x' = x + u is unstable; u = -3 x - integral + excitation, sampled, holds it.
    def step(state, excitation):
        x, integral = state
        command = -3.0 * x - integral + excitation
        return rk4(lambda x, _: x + command, x, DT), integral + DT * x

    look = lambda state, excitation: {"x": state[0], "command": -3 * state[0] - state[1] + excitation}  # noqa: E731
    seen, _ = integrate(step, (jnp.array(0.5), jnp.array(0.0)), jnp.full(2000, 0.2), observe=look)
    assert seen["command"][0] == pytest.approx(-1.3)
    assert abs(seen["x"][-1]) < 1e-3
    assert seen["command"][-1] == pytest.approx(0.0, abs=2e-3)


def test_a_batch_is_the_same_flights_and_their_derivatives_are_exact():
    fly = lambda x0, push: integrate(oscillate, (x0, jnp.zeros(())), push)[0][0]  # noqa: E731
    starts, push = jnp.array([1.0, -0.5]), jnp.stack([jnp.sin(TIME), jnp.cos(TIME)])
    batch = jax.jit(jax.vmap(fly))(starts, push)
    assert np.allclose(batch[1], fly(starts[1], push[1]), rtol=1e-12, atol=1e-14)
    slope = jax.jit(jax.jacfwd(fly))(starts[0], push[0])  # linear: the response to a start of 1 alone
    assert np.allclose(slope, fly(1.0, 0.0 * push[0]), rtol=1e-10, atol=1e-12)


def test_divergence_names_the_first_channel_and_its_time():
    channels = {"q": 0.1 * np.exp(3 * TIME), "theta": TIME.copy(), "u": 20 + 0 * TIME}
    limits = {"q": (-2.0, 2.0), "theta": (-1.5, 1.5)}
    found = divergence(TIME, channels, limits)
    assert found.sample == np.argmax(channels["q"] > 2.0)
    assert str(found) == "the flight diverged at t = 1 s: q is 2.009, expected -2 to 2"
    assert divergence(TIME[:90], {n: c[:90] for n, c in channels.items()}, limits) is None
    channels["u"][40:] = np.nan
    assert str(divergence(TIME, channels, limits)) == (
        "the flight diverged at t = 0.4 s: u is nan, expected a finite value"
    )
    channels["theta"][40:] = -9.0  # at the same sample: what is not a number is further off
    assert divergence(TIME, channels, limits).channel == "u"
    with pytest.raises(UsageError, match=r"no channel 'thet' to limit; did you mean 'theta'"):
        divergence(TIME, channels, {"thet": (0.0, 1.0)})

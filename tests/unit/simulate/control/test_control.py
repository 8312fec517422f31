"""The control law: quiet at its trim, pulling back from everywhere else, and never beyond the limits."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from freqid.core.scenario import read_scenario
from freqid.simulate.control.law import Aim, command
from freqid.simulate.control.lq import close_loop
from freqid.simulate.motion import attitude
from freqid.simulate.motion.rigid_body import BodyState

SCENARIO = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0]


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, SCENARIO.reference_of("u40"))


@pytest.fixture(scope="module")
def law():
    """The compiled law; numbers go in as arrays, so that nothing is compiled twice."""
    compiled = jax.jit(command)

    def ask(law, body, drift=(0.0, 0.0, 0.0), **aim):
        wind = np.asarray(aim.get("wind", np.zeros(3)), dtype=float)
        held = Aim(np.float64(aim["u"]), np.float64(aim["altitude"]), wind)
        plain = jax.tree.map(lambda x: np.asarray(x, dtype=float), (body, np.asarray(drift, dtype=float)))
        return compiled(law, *plain, held)

    return ask


def aim(at):
    return {"u": at.reference.u, "altitude": -float(at.body.position[2])}


def same(found, expected, atol=1e-9):
    for a, b in zip(found, expected, strict=True):
        assert np.allclose(a, b, rtol=0, atol=atol)


def test_at_every_trim_the_law_commands_the_trim(loop, law):
    for at in loop.trims.values():
        commands, drift = law(loop.law, at.body, **aim(at))
        same(commands, at.commands)
        assert np.allclose(drift, 0, atol=1e-12)


def test_between_two_conditions_trim_and_gains_are_their_mean(loop, law):
    low, high = loop.trims["u40"], loop.trims["u45"]
    u = (low.reference.u + high.reference.u) / 2
    k = list(loop.trims).index("u40")
    mean = jax.tree.map(lambda x: (x[k] + x[k + 1]) / 2, loop.law.settings)
    body = BodyState(
        np.array([0, 0, -100.0]), attitude.from_euler(*mean.state[6:]), mean.state[:3], jnp.zeros(3)
    )
    commands, _ = law(loop.law, body, u=u, altitude=100.0)
    same(commands, mean.commands)
    # a little off, the mean gains and allocation answer
    moved = body._replace(velocity=body.velocity + jnp.array([0.1, 0.0, -0.2]))
    asked = -mean.gain[:, [0, 2]] @ np.array([0.1, -0.2])
    commands, drift = law(loop.law, moved, u=u, altitude=100.0)
    same(commands, mean.commands._replace(surface=mean.commands.surface + mean.surface @ asked,
                                          speed=mean.commands.speed + mean.speed @ asked))  # fmt: skip
    assert np.allclose(drift, [0.1, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "axis", "sign"),
    [
        ({"u": 0.5}, "X", -1),  # too fast: pull back
        ({"w": 0.5}, "Z", -1),  # sinking: lift
        ({"climb": 0.5}, "Z", 1),  # too high: let down
        ({"p": 0.1}, "L", -1),
        ({"q": 0.1}, "M", -1),
        ({"r": 0.1}, "N", -1),
        ({"phi": 0.05}, "L", -1),
        ({"theta": 0.05}, "M", -1),
        ({"psi": 0.05}, "N", -1),
    ],
)
def test_the_law_opposes_what_is_off(loop, law, change, axis, sign):
    at = loop.trims["u40"]
    names = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
    off = np.array([change.get(name, 0.0) for name in names])
    phi, theta = at.angles
    k = list(loop.trims).index("u40")
    settings = jax.tree.map(lambda x: np.asarray(x[k]), loop.law.settings)
    velocity = settings.state[:3] + off[:3] - np.cross(off[3:6], settings.centre)
    body = BodyState(
        at.body.position - jnp.array([0, 0, change.get("climb", 0.0)]),
        attitude.from_euler(phi + off[6], theta + off[7], off[8]),
        velocity,
        off[3:6],
    )
    commands, _ = law(loop.law, body, **aim(at))
    moves = np.concatenate([commands.surface - at.commands.surface, commands.speed - at.commands.speed])
    # the moves span the five axes, so they tell what was asked for
    share = np.concatenate([settings.surface, settings.speed])
    asked = dict(zip("XZLMN", np.linalg.lstsq(share, moves, rcond=None)[0], strict=True))
    assert np.sign(asked[axis]) == sign


def test_a_steady_wind_that_is_known_is_no_deviation(loop, law):
    at, wind = loop.trims["u45"], np.array([3.0, -4.0, 0.5])
    carried = at.body.velocity + attitude.to_body(at.body.attitude, jnp.asarray(wind))
    commands, drift = law(loop.law, at.body._replace(velocity=carried), **aim(at), wind=wind)
    same(commands, at.commands)
    assert np.allclose(drift, 0, atol=1e-12)


def test_commands_stay_inside_the_limits_however_far_off(loop, law):
    at = loop.trims["u20"]
    body = at.body._replace(velocity=jnp.array([-30.0, 20.0, 40.0]), rates=jnp.array([5.0, -4.0, 3.0]))
    commands, _ = law(loop.law, body, drift=(50.0, -80.0, 20.0), **aim(at))
    for found, low, high in zip(commands, loop.law.low, loop.law.high, strict=True):
        assert np.all((found >= low) & (found <= high))
    assert np.any(commands.surface == loop.law.low.surface)

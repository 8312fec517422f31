"""The control law's design: it stabilises what is unstable, and asks of the effectors what it means to."""

from pathlib import Path

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
import pytest

from freqid.core.errors import UsageError
from freqid.core.scenario import Reference, read_scenario
from freqid.simulate.control.linearize import linearize
from freqid.simulate.control.lq import close_loop, corridor, design_law
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle as motion

SCENARIO = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0]
KINDS = [effector.kind for effector in SCENARIO.effector]
MOVED = np.array([k for kind in ("surface", "rotor") for k, found in enumerate(KINDS) if found == kind])
AXES = [0, 2, 3, 4, 5]


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, SCENARIO.reference_of("u40"))


@pytest.fixture(scope="module")
def linear(loop):
    return {name: linearize(SCENARIO, loop.parameters, at) for name, at in loop.trims.items()}


@pytest.fixture(scope="module")
def shares(loop):
    """Allocation by condition, shape (effector, axis), and how far each effector counts as going."""
    stacked = np.concatenate([loop.law.settings.surface, loop.law.settings.speed], axis=1)
    act = loop.parameters.actuators
    reach = np.minimum(-np.asarray(act.surface.low), np.asarray(act.surface.high))
    reach = np.concatenate([reach, 0.15 * np.asarray(act.motor.high)])
    return dict(zip(loop.trims, stacked, strict=True)), reach


def test_the_allocation_makes_exactly_the_axes_that_are_asked(linear, shares):
    for name, share in shares[0].items():
        made = linear[name].wrench[AXES][:, 6 + MOVED] @ share
        assert np.allclose(made, np.eye(5), atol=1e-9)


def test_the_allocation_takes_the_least_moves_that_do(linear, shares):
    """No change that makes no wrench shortens it: it has no part in the effect's null space."""
    rng = np.random.default_rng(0)
    for name, share in shares[0].items():
        scaled = linear[name].wrench[AXES][:, 6 + MOVED] * shares[1]
        null = np.linalg.svd(scaled)[2][5:]
        moves = share / shares[1][:, None]
        assert np.abs(null @ moves).max() < 1e-9 * np.abs(moves).max()
        other = moves + null.T @ rng.standard_normal((null.shape[0], 5)) * np.abs(moves).max()
        assert np.allclose(scaled @ other, np.eye(5), atol=1e-9)  # makes the same
        assert np.all(np.linalg.norm(other, axis=0) > np.linalg.norm(moves, axis=0))


def test_the_loop_is_stable_everywhere_and_the_bare_vehicle_somewhere_not(loop, linear, shares):
    bare = {name: np.linalg.eigvals(found.A).real.max() for name, found in linear.items()}
    assert max(bare.values()) > 0.5  # doubles within 1.4 s somewhere
    for k, (name, found) in enumerate(linear.items()):
        gain = np.asarray(loop.law.settings.gain[k])
        drive = found.B[:, MOVED] @ shares[0][name]
        closed = found.A - drive @ gain[:, :9]  # without integrals
        assert np.linalg.eigvals(closed).real.max() < 1e-6


def test_a_corridor_is_of_one_density_by_speed_with_the_condition_itself():
    ids = [at.id for at in corridor(SCENARIO, SCENARIO.reference_of("u36-1500m"))]
    assert ids[0] == "u00-1500m"
    assert all(name.endswith("-1500m") for name in ids)
    assert len(ids) == 16
    own = Reference.of(id="mine", u=15.24, rho=1.225, dw1=0.35, dw2=0.35)  # in place of u50
    along = corridor(SCENARIO, own)
    assert [at.u for at in along] == sorted(at.u for at in along)
    assert own in along
    assert "u50" not in [at.id for at in along]


def test_a_condition_of_the_corridor_that_cannot_be_trimmed_is_left_out():
    odd = Reference.of(id="odd", u=60.0, rho=1.225, dw1=0.0, dw2=0.0)
    scenario = msgspec.structs.replace(SCENARIO, reference=(*SCENARIO.reference[:3], odd))
    assert list(close_loop(scenario, SCENARIO.reference[0]).trims) == ["u00", "u05", "u10"]
    with pytest.raises(UsageError, match="reference 'odd': level flight is not possible"):
        close_loop(scenario, odd)


def test_weights_come_from_the_scenario(loop):
    trims = [loop.trims["u40"]]

    def gain(**lq):
        control = {"lq": SCENARIO.control["lq"] | lq}
        scenario = msgspec.structs.replace(SCENARIO, control=control)
        return np.asarray(design_law(scenario, loop.parameters, trims).settings.gain[0])

    assert np.array_equal(gain(), loop.law.settings.gain[list(loop.trims).index("u40")])
    cautious = gain(force=0.01, moment=0.002)
    assert np.linalg.norm(cautious) < 0.7 * np.linalg.norm(gain())


@pytest.mark.parametrize(
    ("lq", "said"),
    [
        ({"velocty": 1.0}, "velocty"),
        ({"rate": 0.0}, "rate is 0, expected a positive number"),
        ({"angle": "small"}, "angle"),
    ],
)
def test_bad_weights_are_refused_with_their_place(loop, lq, said):
    scenario = msgspec.structs.replace(SCENARIO, control={"lq": lq})
    with pytest.raises(UsageError, match=said) as refused:
        design_law(scenario, loop.parameters, [loop.trims["u40"]])
    assert "[control.lq]" in str(refused.value)


def test_a_vehicle_that_cannot_make_an_axis_says_so(loop):
    """Surfaces that reach nowhere and rotors that blow straight leave axes that cannot be told apart."""
    act = loop.parameters.actuators
    stuck = act.surface._replace(low=0 * act.surface.low)
    still = act.motor._replace(high=np.asarray(act.motor.high) * np.array([1, 0, 0, 1, 0, 0, 0, 0]))
    parameters = loop.parameters._replace(actuators=act._replace(surface=stuck, motor=still))
    with pytest.raises(UsageError, match="reference 'u40': the effectors cannot make the axes X Z L M N"):
        design_law(SCENARIO, parameters, [loop.trims["u40"]])


def test_the_same_trim_gives_the_same_law(loop):
    again = trim(SCENARIO, loop.parameters, SCENARIO.reference_of("u40"))
    law = design_law(SCENARIO, jax.tree.map(jnp.asarray, motion.parameters(SCENARIO)), [again])
    k = list(loop.trims).index("u40")
    for found, expected in zip(
        jax.tree.leaves(law.settings), jax.tree.leaves(loop.law.settings), strict=True
    ):
        assert np.array_equal(found[0], expected[k])


LINEAR = read_scenario(Path(__file__).parents[4] / "scenarios" / "linear.toml")[0]
DEP6 = read_scenario(Path(__file__).parents[4] / "scenarios" / "dep6.toml")[0]


def controlled(scenario, **sections):
    return msgspec.structs.replace(scenario, control=sections)


def test_stated_gains_are_what_the_law_does():
    """de = 0.35 theta + 0.05 q and da = -0.3 phi - 0.05 p of departures from the trim, written out."""
    loop = close_loop(LINEAR, LINEAR.reference_of("u20"))
    settings = jax.tree.map(lambda x: np.asarray(x[0]), loop.law.settings)
    off = np.zeros(13)
    off[[3, 4, 6, 7]] = 0.1, 0.2, 0.03, 0.04  # p q phi theta
    moved = np.concatenate([settings.surface, settings.speed]) @ (-settings.gain @ off)
    np.testing.assert_allclose(moved, [0.35 * 0.04 + 0.05 * 0.2, -0.3 * 0.03 - 0.05 * 0.1, 0, 0], atol=1e-15)


def test_an_aircraft_without_flaps_is_held_by_the_axes_that_it_can_make():
    loop = close_loop(DEP6, DEP6.reference_of("u18"))
    found = linearize(DEP6, loop.parameters, loop.trims["u18"])
    k = list(loop.trims).index("u18")
    share = np.concatenate([loop.law.settings.surface[k], loop.law.settings.speed[k]])
    np.testing.assert_allclose(found.wrench[[0, 3, 4, 5]][:, 6:] @ share, np.eye(4), atol=1e-9)
    closed = found.A - found.B @ share @ np.asarray(loop.law.settings.gain[k])[:, :9]
    assert np.linalg.eigvals(closed).real.max() < 0.05  # what is left is slow; the integrals take it


@pytest.mark.parametrize(
    ("scenario", "sections", "words"),
    [
        (DEP6, {"lq": {}}, "axes X Z L M N of the wrench apart.*without Z"),
        (DEP6, {"lq": {"axes": ["X", "Y"]}}, "expected some of X Z L M N"),
        (DEP6, {"lq": {"axes": ["L", "M", "N"]}}, "holds speed, heading and altitude.*X for the speed"),
        (LINEAR, {"gains": {"ee": {"q": 1.0}}}, "'ee' is unknown.*known names are: da, de"),
        (LINEAR, {"gains": {"de": {"thet": 1.0}}}, "'thet' is unknown.*'theta'"),
        (LINEAR, {"gains": {"de": {"q": "high"}}}, "gain of q is 'high'"),
    ],
)
def test_a_law_that_cannot_be_made_is_refused(scenario, sections, words):
    with pytest.raises(UsageError, match=words):
        close_loop(controlled(scenario, **sections), scenario.reference[0])

"""Flights in closed loop: steady, linear where small, alike alone and in a batch, cut where they diverge."""

from pathlib import Path

import jax
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lsim

from freqid.core.errors import UsageError
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import read_scenario
from freqid.simulate import fly as module
from freqid.simulate.control.linearize import STATES, linearize
from freqid.simulate.control.lq import ClosedLoop, close_loop
from freqid.simulate.control.trim import trim
from freqid.simulate.fly import DT, EVERY, LIMITS, fly, fly_batch, sortie
from freqid.simulate.maneuver import with_effects
from freqid.simulate.motion import attitude
from freqid.simulate.truth import truth_of

SCENARIO = read_scenario(Path(__file__).parents[3] / "scenarios" / "la8.toml")[0]
EFFECTORS = [e.name for e in SCENARIO.effector]
EXCITED = [e for e in SCENARIO.effector if e.kind != "tilt"]
ABORT = SCENARIO.excitation.abort


def multisine(duration=60.0, scale=1.0, seed=0):
    """The scenario's band and amplitudes: neighbours have neighbouring lines; random phases, faded in."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(duration * 50) + 1) / 50
    fade = np.sin(np.pi / 2 * np.clip(time, 0, 1)) ** 2
    rows = []
    for i, effector in enumerate(EXCITED):
        lines = np.arange(3 + i, 109, len(EXCITED))
        angles = 2 * np.pi * np.outer(lines, time) / 60 + rng.uniform(0, 2 * np.pi, (lines.size, 1))
        rms = SCENARIO.excitation.amplitude[effector.name] / np.sqrt(2)
        rows.append(scale * fade * rms * np.sqrt(2 / lines.size) * np.sin(angles).sum(axis=0))
    names, units = zip(*((e.name, e.unit) for e in EXCITED), strict=True)
    return SampledInputs(names, units, time, np.array(rows))


@pytest.fixture(scope="module")
def loop():
    return close_loop(SCENARIO, SCENARIO.reference_of("u40"))


@pytest.fixture(scope="module")
def ready(loop):
    return lambda name, *inputs, **options: sortie(
        SCENARIO, loop, SCENARIO.reference_of(name), *inputs, **options
    )


def motion(flight):
    """Deviations of phi, theta, p, q, r from the start."""
    body = flight.samples.moving.body
    rows = np.hstack([np.asarray(jax.jit(attitude.euler)(body.attitude))[:, :2], body.rates])
    return dict(zip(("phi", "theta", "p", "q", "r"), np.abs(rows - rows[0]).T, strict=True))


def assert_alike(one, other, atol=1e-9):
    for a, b in zip(jax.tree.leaves(one.samples), jax.tree.leaves(other.samples), strict=True):
        assert np.allclose(a, b, rtol=atol, atol=atol)


@pytest.mark.parametrize("name", ["u00", "u36", "u85"])
def test_without_inputs_a_flight_stays_at_its_trim(loop, name):
    effects = loop.parameters.airframe.effects
    effects = effects | {"battery_sag": {**effects["battery_sag"], "strength": np.float64(0.0)}}
    steady = loop.parameters._replace(airframe=loop.parameters.airframe._replace(effects=effects))
    reference = SCENARIO.reference_of(name)
    at = trim(SCENARIO, steady, reference)  # rotors as commanded, whatever the voltage
    law = loop.law._replace(
        settings=loop.law.settings._replace(
            commands=jax.tree.map(lambda x: np.tile(x, (len(loop.trims), 1)), at.commands)
        )
    )
    plan = sortie(SCENARIO, ClosedLoop(steady, {name: at}, law), reference, duration=4.5)
    flight = fly(plan)
    assert flight.divergence is None
    assert flight.time[-1] == pytest.approx(4.5)
    body = flight.samples.moving.body
    assert np.abs(body.velocity - body.velocity[0]).max() < 1e-7
    assert np.abs(body.rates).max() < 1e-7
    assert np.abs(body.position[:, 1:] - body.position[0, 1:]).max() < 1e-7


def test_a_battery_that_runs_down_is_made_up_for(ready):
    flight = fly(ready("u00", duration=4.5))
    body, commands = flight.samples.moving.body, flight.samples.commands
    assert np.all(np.diff(flight.samples.moving.charge) < 0)
    assert 1e-5 < np.abs(body.velocity - body.velocity[0]).max() < 0.01
    assert np.all(commands.speed[-1] > commands.speed[0])


def test_twice_a_small_input_gives_twice_the_response(ready):
    flights = [fly(ready("u45", multisine(4.5, scale))) for scale in (0.0, 0.01, 0.02)]
    still, once, twice = (
        np.hstack([f.samples.moving.body.velocity, f.samples.moving.body.rates]) for f in flights
    )
    size = np.abs(once - still).max(axis=0)
    assert np.all(size > 1e-5)
    assert np.all(np.abs((twice - still) - 2 * (once - still)).max(axis=0) < 0.01 * size)


@pytest.mark.parametrize("name", ["u00", "u45", "u85"])
def test_the_linearisation_predicts_a_small_motion(name):
    """Its matrices, driven by where the effectors were, follow the flight; without the wake's delay, which
    they leave out, and with rotors that do not react to their own acceleration."""
    scenario = with_effects(SCENARIO, {"wing_wake": 0.0, "gyroscopic": 0.0})
    reference = scenario.reference_of(name)
    mine = close_loop(scenario, reference)
    linear = linearize(scenario, mine.parameters, mine.trims[name])

    def flown(scale):
        flight = fly(sortie(scenario, mine, reference, multisine(4.5, scale)))
        truth, _ = truth_of(scenario, flight, excited=(), reference=name)
        states = truth.matrix([f"state/{s}" for s in STATES])
        states[:3] += np.cross(states[3:6], linear.centre, axis=0)
        turning = truth.matrix(["state/pdot", "state/qdot", "state/rdot"])
        return states, truth.matrix([f"effector/{e}" for e in EFFECTORS]), turning

    # of two opposite flights: what is of second order, and the battery, fall out
    x, moved, turning = (0.5 * (up - down) for up, down in zip(flown(0.004), flown(-0.004), strict=True))
    error = (linear.A @ x + linear.B @ moved)[3:6] - turning
    assert np.all(np.abs(error).max(axis=1) < 1e-3 * np.abs(turning).max(axis=1))
    time = DT * EVERY * np.arange(x.shape[1])
    fine = np.linspace(0, time[-1], 8 * time.size - 7)
    system = (linear.A, linear.B, np.eye(9), np.zeros(linear.B.shape))
    predicted = lsim(system, CubicSpline(time, moved.T)(fine), fine)[1][::8].T
    size = np.abs(x).max(axis=1)
    assert np.all(size > 1e-6)
    assert np.all(np.abs(predicted - x).max(axis=1) < 0.01 * size)


@pytest.mark.parametrize("name", ["u00", "u36", "u85"])
def test_a_minute_of_multisines_stays_inside_the_abort_limits(loop, ready, name):
    flight = fly(ready(name, multisine()))
    assert flight.divergence is None
    assert flight.time[-1] == pytest.approx(60.0)
    largest = {channel: values.max() for channel, values in motion(flight).items()}
    assert max(largest.values()) > 0.02  # it was excited
    for channel, limit in ABORT.items():
        assert largest[channel] < limit


@pytest.fixture(scope="module")
def loose(ready):
    """A flight that is excited without feedback, in the middle of the corridor."""
    return fly(ready("u36", multisine(), feedback=False))


def test_without_feedback_the_same_minute_diverges_and_is_cut_there(loose):
    found = loose.divergence
    assert found is not None
    assert found.channel in LIMITS
    assert 0.5 < found.time < 59
    assert f"t = {found.time:.4g} s: {found.channel} is" in str(found)
    assert loose.time[-1] == pytest.approx(found.time - DT * EVERY)
    lengths = {leaf.shape[0] for leaf in jax.tree.leaves((loose.samples, loose.excitation))}
    assert lengths == {loose.time.size}
    values = motion(loose)
    assert max(values["phi"].max(), values["theta"].max()) < 1.5
    # what was kept is what flew, up to the end
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(loose.samples))


def test_a_batch_flies_as_its_members_alone(ready, loose):
    inputs = [multisine(12.0, seed=seed) for seed in range(3)]
    sorties = [
        ready("u00", inputs[0]),
        ready("u70", inputs[1], wind=(2.0, -3.0, 0.0)),
        ready("u36", inputs[2], feedback=False),
    ]
    together = fly_batch(sorties)
    for one, other in zip(map(fly, sorties), together, strict=True):
        assert np.array_equal(one.time, other.time)
        assert one.divergence == other.divergence or str(one.divergence) == str(other.divergence)
        assert_alike(one, other, 1e-8 if one.divergence else 1e-9)


def test_a_flight_in_legs_is_one_flight(ready, monkeypatch):
    plan = ready("u50", multisine(9.9))
    legs = fly(plan)
    monkeypatch.setattr(module, "_LEG", 2000)
    assert_alike(legs, fly(plan), 1e-11)


def test_a_flight_in_hover_drifts_with_a_steady_wind(ready):
    wind = np.array([4.0, -3.0, 0.0])
    flight, calm = (fly(ready("u00", multisine(4.5), wind=w)) for w in (wind, np.zeros(3)))
    # the air is all that it feels: the same motion in it, carried along over the ground
    assert np.allclose(flight.samples.details.flow.velocity, calm.samples.details.flow.velocity, atol=1e-9)
    assert np.allclose(flight.samples.moving.body.rates, calm.samples.moving.body.rates, atol=1e-9)
    drift = flight.samples.moving.body.position - calm.samples.moving.body.position
    assert np.allclose(drift, flight.time[:, None] * wind, atol=1e-8)


def test_the_transition_from_hover_to_cruise_flies_in_a_minute(ready):
    flight = fly(ready("u00", duration=60.0, to=SCENARIO.reference_of("u85")))
    assert flight.divergence is None
    u = flight.samples.details.flow.velocity[:, 0]
    assert u[0] == 0
    assert u[-1] == pytest.approx(25.91, abs=1.5)
    tilt = flight.samples.moving.tilt
    assert tilt[0] == pytest.approx([1.4923] * 2)
    assert tilt[-1] == pytest.approx([0.0960] * 2, abs=0.02)
    height = -flight.samples.moving.body.position[:, 2]
    assert np.abs(height - height[0]).max() < 3.0
    assert motion(flight)["theta"].max() < ABORT["theta"]
    assert motion(flight)["phi"].max() < 0.01  # nothing turns it to a side


def test_excitation_is_added_after_the_law(ready):
    """What is commanded without feedback is the trim's command and the excitation, nothing else."""
    plan = ready("u85", multisine(4.5), feedback=False)
    flight = fly(plan)
    for commands, excitation in zip(flight.samples.commands, flight.excitation, strict=True):
        assert np.allclose(commands - excitation, commands[0] - excitation[0], atol=1e-9)
    assert np.ptp(flight.excitation.speed, axis=0).min() > 5.0
    assert not flight.excitation.tilt.any()


def test_after_the_inputs_end_nothing_is_added(ready):
    flight = fly(ready("u45", multisine(2.0), duration=4.5))
    assert flight.time[-1] == pytest.approx(4.5)
    assert np.any(flight.excitation.surface[190:200])
    assert not np.any(flight.excitation.surface[202:])


@pytest.mark.parametrize("inputs", [False, True])
def test_what_cannot_be_flown_is_refused(ready, inputs):
    if not inputs:
        with pytest.raises(UsageError, match="there is nothing to fly; give inputs or a duration"):
            ready("u45")
        return
    odd = SampledInputs(("de9",), ("rad",), np.arange(3.0), np.zeros((1, 3)))
    with pytest.raises(
        UsageError, match="the inputs excite 'de9', which vehicle 'LA-8 class, notional' does"
    ):
        ready("u45", odd)


def test_a_batch_of_two_durations_is_refused(ready):
    plans = [ready("u45", duration=1.0), ready("u45", duration=2.0)]
    with pytest.raises(UsageError, match="202 and 402 steps cannot fly side by side; give all"):
        fly_batch(plans)


def test_a_seed_repeats_its_turbulence_and_another_does_not(loop, ready):
    effects = loop.parameters.airframe.effects | {"turbulence": {"wind_20ft": np.float64(7.7)}}
    gusty = loop.parameters._replace(airframe=loop.parameters.airframe._replace(effects=effects))
    mine = ClosedLoop(gusty, loop.trims, loop.law)
    plans = [
        sortie(SCENARIO, mine, SCENARIO.reference_of("u45"), duration=4.5, seed=seed) for seed in (1, 1, 2)
    ]
    one, same, other = (fly(plan).samples.moving.body.velocity for plan in plans)
    assert np.array_equal(one, same)
    assert np.abs(one - other).max() > 0.05

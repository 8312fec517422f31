"""One manoeuvre or a batch of them: the closed loop from trim on, and what it truly did.

A flight is cut into legs of one length, so that flights of any duration run through one compiled loop,
stop soon after they diverge and can be stacked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import Reference, Scenario
from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics.precision import doubles
from freqid.simulate.air.surroundings import Surroundings, windy
from freqid.simulate.control.law import Aim
from freqid.simulate.control.lq import ClosedLoop
from freqid.simulate.effects import turbulence
from freqid.simulate.loads.quantities import Positions
from freqid.simulate.motion import attitude, multibody
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import Commands, by_kind
from freqid.simulate.motion.derivatives import HEIGHT
from freqid.simulate.motion.integrate import Divergence, divergence
from freqid.simulate.motion.rigid_body import BodyState
from freqid.simulate.motion.whole_vehicle import Details, Moving, State
from freqid.simulate.tracing import stored

DT = 0.005  # s, of a step
EVERY = 2  # steps for each sample that is kept
_LEG = 1000  # steps that are compiled into one loop

# Beyond these a flight is no manoeuvre any more; velocities, m/s, are of the air relative to the vehicle.
LIMITS = {
    **dict.fromkeys(("phi", "theta"), (-1.4, 1.4)),
    **dict.fromkeys(("p", "q", "r"), (-8.0, 8.0)),
    **dict.fromkeys(("u", "v", "w"), (-60.0, 60.0)),
    "height above ground": (0.0, np.inf),
}


class Sortie(NamedTuple):
    """All that a flight depends on; arrays only, so sorties of equal length can be stacked.

    Attributes
    ----------
    parameters : motion.Parameters
    law : Law or Tecs
        With gains of zero, without feedback.
    state : State
        At the start.
    aim : Aim or Goal of Array, shape (step, ...)
        What that law is to hold.
    excitation : Commands of Array, shape (step, ...)
        Added to what the law commands.
    around : Surroundings of Array, shape (step, ...)
    """

    parameters: motion.Parameters
    law: Any
    state: State
    aim: Any
    excitation: Commands
    around: Surroundings


class Sample(NamedTuple):
    """What is known at one instant; in `Flight` every field has a sample axis in front.

    Attributes
    ----------
    moving, rate : Moving
        The rate of change too.
    details : Details
    commands : Commands
        After excitation.
    angles : Array, shape (3,)
        Roll, pitch and heading, rad.
    felt : Array, shape (3,)
        Specific force of the vehicle's origin, body axes, m/s2.
    wrench : Array, shape (6,)
        Applied force, N, and moment about the centre of gravity, N m.
    """

    moving: Moving
    rate: Moving
    details: Details
    commands: Commands
    angles: jax.Array
    felt: jax.Array
    wrench: jax.Array


@dataclass(frozen=True, eq=False)
class Flight:
    """What a vehicle truly did.

    Attributes
    ----------
    time : ndarray, shape (sample,)
        s, every `EVERY` steps.
    samples : Sample of ndarray, shape (sample, ...)
        Up to the divergence.
    excitation : Commands of ndarray, shape (sample, ...)
        That was added to the law's commands.
    divergence : Divergence or None
    """

    time: Array
    samples: Sample
    excitation: Commands
    divergence: Divergence | None


def sortie(
    scenario: Scenario,
    loop: ClosedLoop,
    reference: Reference,
    inputs: SampledInputs | None = None,
    *,
    duration: float | None = None,
    to: Reference | None = None,
    wind: ArrayLike = (0.0, 0.0, 0.0),
    feedback: bool = True,
    seed: int = 0,
) -> Sortie:
    """Make a flight ready: trimmed at a reference condition, excited after its control law.

    Parameters
    ----------
    scenario : Scenario
    loop : ClosedLoop
        Of the same scenario, with the reference among its trims.
    reference : Reference
        Where it starts.
    inputs : SampledInputs, optional
        Excitation, straight between its samples; of rotors at the battery's nominal voltage.
    duration : float, optional
        s; of the inputs where absent.
    to : Reference, optional
        Condition to be reached at the end, at a steady rate of speed along the corridor; the start
        where absent.
    wind : array_like, shape (3,)
        Mean wind: velocity of the air north, east, down, m/s. Turbulence is an effect of the scenario.
    feedback : bool
        Without it, the trim's commands are held.
    seed : int
        Of the turbulence.

    Raises
    ------
    UsageError
        Where neither inputs nor a positive duration are given, an input is of no effector of the vehicle,
        or the turbulence is outside its model.
    """
    vehicle, trimmed, mean = scenario.aircraft(), loop.trims[reference.id], np.array(wind, dtype=float)
    if duration is None:
        if inputs is None:
            raise UsageError("there is nothing to fly", remedy="give inputs or a duration")
        duration = float(inputs.time[-1])
    if not 0 < duration < np.inf:
        raise UsageError(f"a flight of {duration:g} s cannot be flown", remedy="give a positive duration")
    # the last sample is the state at the end, and whole legs are flown
    steps = round(duration / DT) + EVERY
    time = DT * np.arange(steps, dtype=float)
    signals = np.zeros((steps, len(vehicle.effectors)))
    if inputs is not None:
        names = [effector.name for effector in vehicle.effectors]
        for name, values in zip(inputs.names, inputs.values, strict=True):
            if name not in names:
                raise UsageError(
                    f"the inputs excite '{name}', which vehicle '{vehicle.name}' does not have",
                    remedy=nearest(name, names),
                )
            signals[:, names.index(name)] = np.interp(time, inputs.time, values, right=0.0)
    air = loop.parameters.airframe.effects["turbulence"]
    speed = max(float(np.linalg.norm(trimmed.body.velocity)), float(np.linalg.norm(mean)))
    gusts = turbulence.series(
        {name: float(value) for name, value in air.items()},
        height=HEIGHT,
        airspeed=speed,
        span=vehicle.span_m or 1.0,
        steps=steps,
        dt=DT,
        seed=seed,
    )
    share = np.clip(time / duration, 0.0, 1.0)
    law = loop.law
    if not feedback:
        law = law._replace(settings=law.settings._replace(gain=np.zeros_like(law.settings.gain)))
    # numpy's arrays stand for JAX's, as those of `doubles` do
    around = trimmed.around._replace(wind=mean)  # pyrefly: ignore[bad-argument-type]
    return Sortie(
        parameters=loop.parameters,
        law=law,
        state=_started(loop.parameters, trimmed.body, trimmed.positions, around),
        aim=doubles(
            Aim,
            u=reference.u + share * ((to or reference).u - reference.u),
            altitude=np.full(steps, -trimmed.body.position[2]),
            wind=np.tile(mean, (steps, 1)),
        ),
        excitation=by_kind(vehicle, signals),
        around=windy(mean, gusts, reference.rho, ground=float(trimmed.around.ground)),
    )


def fly(sortie: Sortie) -> Flight:
    """Fly one sortie to its end, or until it leaves `LIMITS`."""
    return _flown(sortie, _leg)[0]


def fly_batch(sorties: Sequence[Sortie]) -> list[Flight]:
    """Fly sorties of equal duration side by side, in one compiled loop.

    Raises
    ------
    UsageError
        Where their durations differ.
    """
    lengths = sorted({s.around.rho.size for s in sorties})
    if len(lengths) > 1:
        raise UsageError(
            f"sorties of {lengths[0]} and {lengths[-1]} steps cannot fly side by side",
            remedy="give all of a batch one duration",
        )
    return _flown(jax.tree.map(lambda *x: np.stack(x), *sorties), _legs)


def _flown(flown: Sortie, leg) -> list[Flight]:
    """Fly leg by leg; stacked sorties by a `leg` that is mapped over them."""
    axis = flown.around.rho.ndim - 1  # of the steps
    count = flown.around.rho.shape[axis]
    schedule = (flown.aim, flown.excitation, flown.around)
    carry = jax.tree.map(np.asarray, (flown.state, flown.law.memory))
    legs = []
    for first in range(0, count, _LEG):
        now = jax.tree.map(lambda x: _cut(x, axis, first), schedule)  # noqa: B023  used at once
        # Arrays of numpy belong to no device: those that a call returned would be compiled for once more.
        samples, carry = jax.tree.map(np.asarray, leg(flown.parameters, flown.law, carry, now))
        legs.append(samples)
        if all(_divergence(one) for one in _each(legs[-1], axis)):
            break
    samples = jax.tree.map(lambda *x: np.concatenate(x, axis), *legs)
    most = count // EVERY
    excitations = _each(jax.tree.map(lambda x: np.asarray(x)[..., ::EVERY, :], flown.excitation), axis)
    return [
        _flight(jax.tree.map(lambda x: x[:most], one), excitation)
        for one, excitation in zip(_each(samples, axis), excitations, strict=True)
    ]


def _each(tree, axis: int) -> list:
    """Return the members of a stacked tree, or the tree itself."""
    if axis == 0:
        return [tree]
    return [jax.tree.map(lambda x: x[i], tree) for i in range(jax.tree.leaves(tree)[0].shape[0])]  # noqa: B023


def _cut(values: ArrayLike, axis: int, first: int) -> Array:
    """Return one leg of inputs; the last value is held to the end of the last leg."""
    piece = np.asarray(values)[(slice(None),) * axis + (slice(first, first + _LEG),)]
    short = _LEG - piece.shape[axis]
    if not short:
        return piece
    width = [(0, 0)] * piece.ndim
    width[axis] = (0, short)
    return np.pad(piece, width, mode="edge")


def _flight(samples: Sample, excitation: Commands) -> Flight:
    """Return a flight up to where it diverged."""
    found = _divergence(samples)
    last = found.sample if found else samples.moving.charge.size
    time = DT * EVERY * np.arange(last, dtype=float)
    samples, excitation = jax.tree.map(lambda x: x[:last], (samples, excitation))
    return Flight(time, samples, excitation, found)


def _divergence(samples: Sample) -> Divergence | None:
    """Return where samples leave the limits, in seconds of their own start."""
    flow = samples.details.flow
    values = np.hstack(
        [samples.angles[:, :2], samples.moving.body.rates, flow.velocity, np.asarray(flow.height)[:, None]]
    )
    channels = dict(zip(LIMITS, values.T, strict=True))
    return divergence(DT * EVERY * np.arange(len(values), dtype=float), channels, LIMITS)


def _advance(parameters: motion.Parameters, law: Any, carry, schedule):
    """Fly one leg; the state is the vehicle's and what the law remembers."""

    def step(carry, now):
        (state, memory), (aim, excitation, around) = carry, now
        commands, rate = law.command(state.moving.body, memory, aim)
        commands = _added(commands, excitation)
        after, seen = motion.seen_step(parameters, state, commands, around, DT)
        return (after, memory + DT * rate), _sample(parameters, state.moving, commands, *seen)

    # Every step knows what happens at its start, so nothing is computed again for the samples.
    carry, samples = jax.lax.scan(step, carry, schedule)
    return jax.tree.map(lambda x: x[::EVERY], samples), carry


def _sample(
    parameters: motion.Parameters, moving: Moving, commands: Commands, rate: Moving, details: Details
) -> Sample:
    """Return what is kept of one instant."""
    body = moving.body
    centre = multibody.traced_centre_of_gravity(parameters.mass, moving.tilt)
    turning = attitude.cross(body.rates, body.velocity)
    return Sample(
        moving,
        rate,
        details,
        commands,
        attitude.euler(body.attitude),
        rate.body.velocity + turning - STANDARD_GRAVITY * attitude.down(body.attitude),
        details.aero.wrench.about(centre),
    )


def _added(commands: Commands, excitation: Commands) -> Commands:
    return jax.tree.map(jnp.add, commands, excitation)


_leg = stored(_advance)


@stored
def _legs(*flown):
    """Fly one leg of stacked sorties."""
    return jax.vmap(_advance)(*flown)


@stored
def _started(
    parameters: motion.Parameters, body: BodyState, positions: Positions, around: Surroundings
) -> State:
    """Return the state of a trimmed vehicle that the wind carries along."""
    carried = body.velocity + attitude.to_body(body.attitude, around.wind)
    return motion.start(parameters, body._replace(velocity=carried), positions, around, DT)

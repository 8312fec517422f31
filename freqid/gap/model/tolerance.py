"""What a good simulation may be wrong by: one sigma each of its parameters, of sensors and of mass.

A tolerance is a prior scatter that every question allows for, never an effect. Its column is what one sigma
makes of the stack, on motion without noise, through the whole pipeline.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Complex
from freqid.core.errors import DataError, ImpossibleSettings, UsageError, nearest
from freqid.core.vehicle import Vehicle
from freqid.gap.model.changes import change
from freqid.gap.model.following import late, slope_of, slower
from freqid.gap.model.replay import Replay
from freqid.gap.model.testable import in_force_of, untestable
from freqid.gap.simulation import LARGEST_SIGMA, Simulation
from freqid.gap.stack.block import Block
from freqid.gap.stack.histories import Histories
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects import along
from freqid.simulate.effects.effect import Effect

DERIVATIVES, DYNAMICS = "derivatives", "dynamics"
_DYNAMICS = ("natural_frequency", "damping")
_SERVO = (*_DYNAMICS, "gain")
_ROTOR = ("thrust", "torque")

UNDECLARED: dict[str, float] = {
    DERIVATIVES: 0.05,
    DYNAMICS: 0.05,
}
"""One sigma for a simulation that declares no parameters of its own: share of each derivative of each
response, and of each actuator's time to follow."""

DEFAULT: dict[str, float] = {
    "mass": 0.01,
    "cg_offset": 0.005,
    "inertia": 0.03,
    "sensor_scale": 0.005,
    "misalignment": 0.005,
    "lever_arm": 0.005,
    "flow_upwash": 0.02,
}
"""One sigma by effect or ``effect.parameter``, in the parameter's unit, where nothing is stated."""

TIMING = ("time_skew", "actuator_delay")
"""Effects whose parameters are known to the log's own clock where nothing is stated: channels are taken
anywhere within a sample of each other, so one sigma is the interval over the root of twelve."""

EACH_FLIGHT: dict[str, float] = {
    "sensor_bias.u": 0.1,
    "sensor_bias.v": 0.1,
    "sensor_bias.w": 0.1,
    "sensor_bias.V": 0.1,
    "sensor_bias.alpha": 0.005,
    "sensor_bias.beta": 0.005,
    "sensor_bias.p": 0.002,
    "sensor_bias.q": 0.002,
    "sensor_bias.r": 0.002,
    "sensor_bias.ax": 0.05,
    "sensor_bias.ay": 0.05,
    "sensor_bias.az": 0.05,
    "sensor_bias.phi": 0.005,
    "sensor_bias.theta": 0.005,
    "sensor_bias.surface": 0.005,
    "sensor_bias.tilt": 0.005,
    "sensor_bias.rotor": 1.0,
    "steady_wind.north": 0.1,
    "steady_wind.east": 0.1,
    "steady_wind.down": 0.1,
}
"""One sigma of offsets that are another in each record, and of the air's own motion on a calm day."""

_POSITIONS = ("surface", "tilt", "rotor")
"""Parameters of `sensor_bias` that are of effectors of a kind."""

_HALF = 0.5**0.5  # of one sigma, where half of its variance is of all of a kind

_PULSE_S = 0.2  # s: the pulse of a command's own size that stands for an unknown rate at the start


def stated(
    table: Mapping[str, float],
    library: Mapping[str, Effect],
    simulation: Simulation | None = None,
    vehicle: Vehicle | None = None,
) -> dict[str, float]:
    """Return all tolerances: those of a scenario's ``[tolerance]`` over the defaults.

    Parameters
    ----------
    table : dict of float
        One sigma by name.
    library : dict of Effect
    simulation : Simulation, optional
        Its own parameters are known names too.
    vehicle : Vehicle, optional
        For names by effector and rotor.

    Raises
    ------
    UsageError
        For a name that is no tolerance.
    DataError
        For a value that is no size, or absurd.
    """
    effects = [e.of(vehicle) for e in library.values()]
    own = dict(simulation.tolerances) if simulation else {}
    known = {
        *DEFAULT,
        *UNDECLARED,
        *EACH_FLIGHT,
        *library,
        *(f"{e.id}.{p}" for e in effects for p in e.parameters),
        *own,
    }
    for e in vehicle.effectors if vehicle else ():
        known |= {f"{e.name}.{what}" for what in (*_SERVO, *(_ROTOR if e.kind == "rotor" else ()))}
    for name, value in table.items():
        if name not in known:
            raise UsageError(f"[tolerance] has no '{name}'", remedy=nearest(name, known))
        if value:
            _refuse_mixed(name, effects)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < LARGEST_SIGMA:
            raise DataError(
                f"[tolerance] {name} is {value!r}, expected one sigma from 0 to {LARGEST_SIGMA:g}",
                remedy="give one standard deviation in the parameter's SI unit; a share for relative ones",
            )
    declared = {name: t.sigma for name, t in own.items()}
    generic = {} if declared else UNDECLARED
    # who states one parameter of an effect has said what is uncertain about it
    single = {t.partition(".")[0] for t in table if "." in t}
    general = {n: s for n, s in DEFAULT.items() if n not in single}
    general |= {n: 0.0 for n in TIMING if n in single}
    return {**general, **generic, **EACH_FLIGHT, **declared, **table}


def _refuse_mixed(name: str, effects: Sequence[Effect]) -> None:
    """Refuse one number for parameters of several units."""
    for e in effects:
        units = dict.fromkeys(p.unit for p in e.parameters.values() if p.scale)
        if e.id == name and e.alternatives and len(units) > 1:
            raise UsageError(
                f"[tolerance] {name} is one number for parameters in {', '.join(units)}",
                remedy=f"state each by itself, such as {name}.{next(iter(e.parameters))}",
            )


def tolerance_columns(
    block: Block, library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> dict[str, Complex]:
    """Return what one sigma of each tolerance makes of a block, shape (row, line), by name.

    The same name in two blocks is the same error.
    """
    found = {name: block.transform(h) for name, h in _shared(block.drawn, library, sizes) if _acts(h)}
    for name, each in _of_one_make(block.trial, sizes).items():
        acting = [n for n in each if n in found]
        found |= {n: _HALF * found[n] for n in acting}
        if acting:
            found[name] = np.sum([found[n] for n in acting], axis=0)
    return found


def _of_one_make(trial: Trial, sizes: Mapping[str, float]) -> dict[str, list[str]]:
    """Return the tolerances that nobody stated of a single effector, by a name of all effectors of its kind.

    Half of the variance is of all, half of each by itself: a wrong data sheet is that of all motors, a worn
    motor is that of one. What is stated of single ones is taken as it is stated.
    """
    own, kinds = trial.simulation.tolerances, trial.maneuver.vehicle.effector_kinds
    names = [n for n, t in own.items() if t.of_make and sizes.get(n, t.sigma) == t.sigma]
    if not own and sizes.get(DYNAMICS):
        names = [f"{n}.{w}" for n in trial.positions for w in _DYNAMICS if f"{n}.{w}" not in sizes]
    alike: dict[str, list[str]] = {}
    for name in names:
        effector, _, what = name.rpartition(".")
        alike.setdefault(f"every {kinds[effector]}.{what}", []).append(name)
    return {name: each for name, each in alike.items() if len(each) > 1}


def own_departures(trial: Trial, sizes: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return by how much one sigma of each tolerance moves the simulation's own parameters.

    Parameters
    ----------
    trial : Trial
    sizes : dict of float
        One sigma by name, where it is not that of the simulation.

    Returns
    -------
    dict of dict of float
        Departures by parameter, by the name that `tolerance_columns` gives.
    """
    found = {n: {n: sizes.get(n, t.sigma)} for n, t in trial.simulation.tolerances.items()}
    for name, each in _of_one_make(trial, sizes).items():
        if all(n in found for n in each):
            for n in each:
                found[n][n] *= _HALF
            found[name] = {n: found[n][n] for n in each}
    return found


def record_columns(
    block: Block, library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> dict[str, Complex]:
    """Return what is unknown in each record by itself, one sigma each: offsets, ends, actuators' starts.

    Repeats are averaged, so one sigma of their mean is smaller by the root of their number.
    """
    share = 1 / np.sqrt(len(block.names))
    unknown = (*_offsets(block.drawn, library, sizes), *_starts(block.drawn))
    found = {name: share * block.transform(h) for name, h in unknown if _acts(h)}
    return found | {name: share * z for name, z in _ends(block).items()}


def offsets_of(
    departures: Mapping[str, float], block: Block, sizes: Mapping[str, float]
) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Return the offsets of a record that some of its unknowns are.

    Parameters
    ----------
    departures : dict of float
        In sigmas, by the name that `record_columns` gives; ends and starts are no offsets.
    block : Block
    sizes : dict of float

    Returns
    -------
    settings : dict of dict of float
        Parameters by effect.
    channels : dict of float
        Offsets of effectors' channels.
    """
    share = 1 / np.sqrt(len(block.names))
    settings: dict[str, dict[str, float]] = {}
    for key, sigmas in departures.items():
        what, _, name = key.partition(".")
        effect, _, parameter = name.partition(".")
        if what == "offset" and parameter:
            settings.setdefault(effect, {})[parameter] = share * sigmas * sizes[name]
    channels: dict[str, float] = {}
    for kind in _POSITIONS:
        for key, some, size in _effectors_off(block.trial, kind, sizes.get(f"sensor_bias.{kind}", 0.0)):
            for channel in some:
                channels[channel] = channels.get(channel, 0.0) + share * departures.get(key, 0.0) * size
    return settings, {n: x for n, x in channels.items() if x}


def _acts(change: Histories) -> bool:
    return bool(np.any(change.direct) or np.any(change.momentum))


def _shared(
    trial: Trial, library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> Iterator[tuple[str, Histories]]:
    own = trial.simulation.tolerances
    servos = [n for n, t in own.items() if t.actuator in trial.positions]
    yield from _own_actuators(trial, {n: sizes.get(n, own[n].sigma) for n in servos})
    others = {n: size for n in own if n not in servos and (size := sizes.get(n, own[n].sigma))}
    yield from trial.departing(others)
    if not own:
        yield from _derivatives(trial, sizes.get(DERIVATIVES, 0.0))
        for name in trial.positions:
            yield from _dynamics(trial, name, dict.fromkeys(_DYNAMICS, sizes.get(DYNAMICS, 0.0)))
    for name in trial.positions:
        asked = {
            w: sizes[f"{name}.{w}"] for w in _SERVO if f"{name}.{w}" in sizes and f"{name}.{w}" not in own
        }
        yield from _dynamics(trial, name, asked)
    for rotor in trial.maneuver.vehicle.rotors:
        for what in _ROTOR:
            key = f"{rotor.name}.{what}"
            if sizes.get(key) and key not in own and f"effector/{rotor.name}" in trial.maneuver.record:
                yield key, _rotor(trial, rotor.name, what) * sizes[key]
    for key, effect, name, size in of_effects(trial, library, sizes):
        with suppress(ImpossibleSettings):  # what no body can be off by is no tolerance
            at = in_force_of(effect, trial.simulation)[name]
            yield (
                key,
                _central(
                    lambda x, e=effect, n=name, a=at: change(e, trial, {n: a + x}, first_order=True), size
                ),
            )


def of_effects(
    trial: Trial, library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> Iterator[tuple[str, Effect, str, float]]:
    """Yield the tolerances that are parameters of effects: name, effect, parameter and one sigma."""
    effectors = trial.maneuver.vehicle.effector_kinds
    for effect in (e.of(trial.maneuver.vehicle) for e in library.values()):
        nested = _together(effect, effectors)
        for name, parameter in effect.parameters.items():
            key = f"{effect.id}.{name}"
            if name in nested[1:] and nested[0] not in effectors.values() and key not in sizes:
                continue  # within the widest one
            clock = by_clock(trial.sent.dt) if effect.id in TIMING else 0.0
            size = sizes.get(key, sizes.get(effect.id, clock if parameter.unit == "s" else 0.0))
            if nested and key not in sizes and (name in nested or name in effectors):
                size *= _HALF  # stated once: half of its variance is of all, half of each by itself
            if key in EACH_FLIGHT or not size or parameter.scale == 0 or untestable(effect, trial):
                continue
            yield key, effect, name, size


def one_sigmas(
    blocks: Sequence[Block], library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> dict[str, float]:
    """Return one sigma of each tolerance, the simulation's own parameters among them.

    Parameters
    ----------
    blocks : sequence of Block
    library : dict of Effect
    sizes : dict of float
        One sigma by name, where it is stated.
    """
    own = own_departures(blocks[0].trial, sizes)
    found = {n: own[n][n] for n in blocks[0].trial.simulation.tolerances}
    return found | {key: size for b in blocks for key, _, _, size in of_effects(b.trial, library, sizes)}


def by_clock(dt: float) -> float:
    """Return one sigma of the time at which a channel was taken, anywhere within a sample, s."""
    return dt / 12**0.5


def _together(effect: Effect, kinds: Mapping[str, str]) -> list[str]:
    """Return the parameters that move several effectors of which each has one too.

    The widest one first, or one for each kind.
    """
    if not effect.alternatives or not any(n in kinds for n in effect.parameters):
        return []
    apart = {kind for n, kind in kinds.items() if n in effect.parameters}
    several = {"effectors", *apart} if effect.stage == "sensor" else set(effect.parameters)
    return [n for n in effect.parameters if n in several and n not in kinds]


def _central(of: Callable[[float], Histories], size: float) -> Histories:
    """Return the change by one sigma, to second order; to one side where nothing can be at the other."""
    up = of(size)
    try:
        return (up - of(-size)) * 0.5
    except ImpossibleSettings:
        return up


def _own_actuators(trial: Trial, sizes: Mapping[str, float]) -> Iterator[tuple[str, Histories]]:
    """Yield one sigma of the simulation's own actuators' parameters, ``de1.gain``.

    An actuator's number moves its own position alone, so those of one kind are departed from at once.
    """
    simulation = trial.simulation
    kinds: dict[str, list[str]] = {}
    for name in sizes:
        kinds.setdefault(name.rpartition(".")[2], []).append(name)
    for names in kinds.values():
        up, down = (trial.positions_with(departures={n: sign * sizes[n] for n in names}) for sign in (1, -1))
        for name in names:
            effector = simulation.tolerances[name].actuator
            yield name, trial.rows(positions={effector: 0.5 * (up[effector] - down[effector])})


def _derivatives(trial: Trial, size: float) -> Iterator[tuple[str, Histories]]:
    """Yield a share of each derivative of each response times what it acts on."""
    if not size or not trial.inputs:
        return
    record = trial.maneuver.record
    moves = np.array([record[name] - record[name].mean() for name in trial.inputs])
    for i, response in enumerate(trial.simulation.responses):
        for j, name in enumerate(trial.inputs):
            direct = np.zeros_like(trial.predicted)
            direct[i] = size * trial.gradient[i, j] * moves[j]
            yield f"{DERIVATIVES}.{response}.{name.partition('/')[2]}", trial.rows(direct)


def _dynamics(trial: Trial, name: str, sizes: Mapping[str, float]) -> Iterator[tuple[str, Histories]]:
    """Yield what an actuator's natural frequency, damping and gain make of its position, one sigma each."""
    own = trial.bare or trial  # what is inside the actuator comes before what acts on its position
    position, dt = own.positions[name], own.maneuver.record.dt
    moved = {}
    if sizes.get("natural_frequency"):
        moved["natural_frequency"] = slower(own, name, sizes["natural_frequency"])
    if sizes.get("damping"):
        moved["damping"] = sizes["damping"] * late(own, name) ** 2 * slope_of(slope_of(position, dt), dt)
    if sizes.get("gain"):
        moved["gain"] = sizes["gain"] * (position - position.mean())
    for what, x in moved.items():
        yield f"{name}.{what}", trial.rows(positions=trial.displaced({name: x}))


def _rotor(trial: Trial, name: str, what: str) -> Histories:
    """Return what a relative error of a rotor's thrust or torque makes of the loads."""
    record, vehicle = trial.maneuver.record, trial.maneuver.vehicle
    rotor = next(r for r in vehicle.rotors if r.name == name)
    if f"effector/{name}" not in trial.inputs:
        return trial.rows()
    replay, axis = Replay(trial.simulation, record, vehicle), along.shaft(record, vehicle, rotor)
    if what == "thrust":
        force = along.thrusts(replay, [rotor]) * axis
        wrench = along.wrench(replay, force, along.hub(record, vehicle, rotor))
    else:
        wrench = np.concatenate([0 * axis, along.torques(replay, [rotor]) * axis])
    return trial.rows(replay.responses(wrench))


def _effectors_off(trial: Trial, kind: str, size: float) -> Iterator[tuple[str, list[str], float]]:
    """Yield the offsets of a kind of effectors: name, channels and one sigma of each.

    They are half off together, half each by itself: a wrong zero of a calibration is that of all, a bent
    linkage is that of one.
    """
    kinds = trial.maneuver.vehicle.effector_kinds
    alike = [e for e in trial.maneuver.record.group("effector") if kinds.get(e) == kind]
    each = size * _HALF if len(alike) > 1 else size
    if len(alike) > 1:
        yield f"offset.every {kind}", [f"effector/{e}" for e in alike], each
    for e in alike:
        yield f"offset.{e}", [f"effector/{e}"], each


def _offsets(
    trial: Trial, library: Mapping[str, Effect], sizes: Mapping[str, float]
) -> Iterator[tuple[str, Histories]]:
    """Yield each sensor's offset."""
    record = trial.maneuver.record
    for key in EACH_FLIGHT:
        stem, _, name = key.partition(".")
        size, effect = sizes.get(key, 0.0), library.get(stem)
        if not size:
            continue
        if name in _POSITIONS:
            for offset, some, each in _effectors_off(trial, name, size):
                channels = [record.channel(n) for n in some]
                moved = [replace(c, values=c.values + each) for c in channels]
                yield offset, trial.relogged(record.with_channels(*moved))
        elif effect is not None and effect.distort is not None and not untestable(effect, trial):
            moved = effect.distort(dict.fromkeys(effect.parameters, 0.0) | {name: size}, record)
            if moved is not record:
                yield f"offset.{stem}.{name}", trial.relogged(moved)


def _starts(trial: Trial) -> Iterator[tuple[str, Histories]]:
    """Yield what another position and another rate at the record's start make of each simulated actuator.

    The simulation is asked itself: with the first sample of a command, or the second one, moved.
    """
    record = trial.sent
    names = [n for n in trial.positions if f"command/{n}" in record]
    for sample, what in ((0, "position"), (1, "rate")):
        channels = []
        for name in names:
            channel = record.channel(f"command/{name}")
            values = channel.values.copy()
            step = max(float(np.std(values)), 1e-6)  # it may have been anywhere that it goes
            values[sample] += step if sample == 0 else step * _PULSE_S / record.dt
            channels.append(replace(channel, values=values))
        after = trial.positions_with(sent=record.with_channels(*channels)) if channels else {}
        for name in names:
            yield f"start.{what}.{name}", trial.rows(positions={name: after[name] - trial.positions[name]})


def _ends(block: Block) -> dict[str, Complex]:
    """Return columns of the noise of end values, which all lines of a differentiated row share."""
    lines, found = block.lines, {}
    measured = block.trial.measured
    for i, row in enumerate(block.rows):
        if not measured.momentum[i].any():
            continue
        power = np.mean(np.abs(block.draws.odd[:, i, 1:]) ** 2, axis=0)
        omega2 = (2 * np.pi * lines.hz[1:]) ** 2
        # of the momentum: power is density omega^2
        density = float(np.sum(power * omega2) / np.sum(omega2**2))
        size = np.sqrt(2 * density / lines.dt) * lines.end_gain / np.sqrt(lines.duration)
        z = np.zeros((len(block.rows), lines.hz.size), dtype=complex)
        z[i] = size
        found[f"ends.{row.name}"] = z
    return found

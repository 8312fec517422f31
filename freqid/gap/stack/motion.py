"""The flight without noise: motion and effectors that owe nothing to the noise of one record.

Whatever is computed on recorded motion shares the noise of the residual and passes for an effect. So every
column is computed on motion of one model: the simulation's own flight under the injected signals; a closed
loop fitted to the record; or, where nothing was injected, a linear response to the measured effectors. Each
stands about the straight lines of the record's channels, for trim attitudes and speeds differ by more than
noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from freqid.core.arrays import Array
from freqid.core.channels import ATTITUDE, COEFFICIENT, FLOW, FORCES, RATES, VELOCITY, WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.dynamics.frames import cross
from freqid.gap.simulation import Departures, Settings, Simulation
from freqid.gap.stack.commands import Commands, commands_of
from freqid.gap.stack.felt import with_attitude_and_felt
from freqid.gap.stack.fitted_loop import fitted_loop
from freqid.gap.stack.kinematic_motion import moved_as_recorded
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.missed_motion import share_missed, with_missed
from freqid.gap.stack.rows import place_of
from freqid.gap.stack.trial import Trial
from freqid.identify.loads.explanatory import history
from freqid.identify.spectra.smoothing import smooth
from freqid.simulate.effects.along import centre

OWN_FLIGHT = "own flight"
MOTION = ("u", "v", "w", "p", "q", "r")
_SYMMETRIC = ("state/u", "state/w", "state/q", "state/theta", "air/V", "air/alpha")
_SMALL = 1e-3  # share of an attitude's motion over which gravity is differentiated
_ROUNDS = 3  # of a fitted response: least squares, then twice with its own response as instruments
_UNLIKE = 1.0  # share of a rate's motion that is missed: from here on it is another flight
_NO_RESPONSE = 0.5  # ... of a plane's: from here on most of it answers to something else than effectors


@dataclass(frozen=True, eq=False)
class Motion:
    """A record's flight without noise.

    Attributes
    ----------
    maneuver : Maneuver
        Every channel of the record; commands and injected signals as they were sent.
    source : str
        ``own flight``, ``fitted loop``, ``fitted response`` or ``smoothed record``; of a response that one
        plane lacks, ``fitted response, in part smoothed``.
    missed : float
        Largest share of a rate's motion in the record that it does not have; noise included.
    flown : bool
        Whether the simulation flew it, whether that was taken or not.
    commands : Commands, optional
        Its commands, where signals were injected.
    """

    maneuver: Maneuver
    source: str
    missed: float
    flown: bool = False
    commands: Commands | None = None

    @property
    def shares_noise(self) -> bool:
        """Whether some of it is the record itself, smoothed: slow noise is left in it."""
        return self.source.endswith(("smoothed", "smoothed record"))

    def trial_of(self, simulation: Simulation) -> Trial:
        """Return a simulation beside this flight."""
        return Trial.of(simulation, self.maneuver, followed=self.commands.moved if self.commands else None)

    def as_commanded(self, maneuver: Maneuver) -> Maneuver:
        """Return a manoeuvre of this flight with its commands as the actuators got them."""
        if self.commands is None:
            return maneuver
        return replace(maneuver, record=self.commands.of(maneuver.record))


def noise_free(
    simulation: Simulation,
    maneuver: Maneuver,
    lines: Lines,
    departures: Departures | None = None,
    effects: Settings | None = None,
    commands: Commands | None = None,
    noise: Mapping[str, Array] | None = None,
) -> Motion:
    """Return the flight of a manoeuvre without its noise.

    Candidates are the simulation's own flight and a closed loop fitted to the record, both corrected by
    `with_missed`. The one that reproduces the record's rates better gives all channels. If the simulation
    cannot fly, or flies something else, the fitted loop does.

    Parameters
    ----------
    simulation : Simulation
    maneuver : Maneuver
    lines : Lines
        On which a closed loop is fitted.
    departures : dict of float, optional
        Of the simulation's own parameters, with which it flies.
    effects : dict of dict of float, optional
        That it has itself and flies with too.
    commands : Commands, optional
        Where they are known.
    noise : dict of ndarray, shape (line,), optional
        Of the record's channels, where the body is to move as the record tells of each line
        (`moved_as_recorded`).
    """
    record = maneuver.record
    found: list[tuple[float, str, dict[str, Array]]] = []
    flown = False
    if record.group("excitation"):
        own = own_flight(simulation, record, departures, effects)
        if own:
            if noise:
                own = moved_as_recorded(record, own, lines, noise)
            own, flown = with_missed(record, own, lines), True
            found.append((share_missed(record, own), OWN_FLIGHT, own))
        loop = fitted_loop(maneuver, lines, found[0][0] if flown else np.inf)
        if loop:
            if noise:
                loop = moved_as_recorded(record, loop, lines, noise)
            loop = with_missed(record, loop, lines, fitted=True)
            found.append((share_missed(record, loop), "fitted loop", loop))
    if not found:
        response, part = _fitted_response(record)
        if response:
            name = "fitted response, in part smoothed" if part else "fitted response"
            found.append((share_missed(record, response), name, response))
    ranked = sorted(found, key=lambda one: one[0])
    if not ranked or ranked[0][0] > _UNLIKE:
        return Motion(_smoothed(simulation, maneuver), "smoothed record", 1.0, flown)
    missed, name, channels = ranked[0]
    clean = _about(record, channels)
    if not record.group("excitation"):
        return Motion(Maneuver(clean, maneuver.vehicle), name, missed, flown)
    if commands is None:
        commands = commands_of(simulation, record, clean, lines)
    return Motion(Maneuver(commands.of(clean, untold=0.0), maneuver.vehicle), name, missed, flown, commands)


def _about(record: FlightRecord, channels: Mapping[str, Array]) -> FlightRecord:
    """Return a record with other channels about its own straight lines; velocity through the air follows."""
    time = record.time - record.time.mean()
    changed = {}
    for name in record.channels:
        group = name.partition("/")[0]
        if group in ("command", "excitation"):
            continue
        measured = np.unwrap(record[name]) if name in ATTITUDE else record[name]
        if name in channels:
            other = np.unwrap(channels[name]) if name in ATTITUDE else channels[name]
            changed[name] = other + np.polyval(np.polyfit(time, measured - other, 1), time)
        elif name not in FLOW:
            changed[name] = np.polyval(np.polyfit(time, measured, 1), time)
    given = [n for n in FLOW if n in record and n not in channels]
    if given and all(n in changed for n in VELOCITY):
        velocity = np.array([changed[n] for n in VELOCITY])
        rates = np.array([changed.get(n, np.zeros(time.size)) for n in RATES])
        for name in given:
            arm = np.subtract(place_of(record.channel(name)), place_of(record.channel(VELOCITY[0])))
            lever = np.broadcast_to(arm[:, None], rates.shape)
            own = air_of(*(velocity + cross(rates, lever)))[name]
            changed[name] = own + np.polyval(np.polyfit(time, record[name] - own, 1), time)
    if "air/qbar" in record and "air/rho" in record:
        speed = changed.get("air/V")
        if speed is None and all(n in changed for n in VELOCITY):
            speed = np.sqrt(sum(changed[n] ** 2 for n in VELOCITY))
        if speed is not None:
            changed["air/qbar"] = 0.5 * changed.get("air/rho", record["air/rho"]) * speed**2
    return record.with_channels(*(replace(record.channel(n), values=x) for n, x in changed.items()))


def air_of(u: Array, v: Array, w: Array) -> dict[str, Array]:
    """Return airspeed, m/s, angle of attack and sideslip, rad, of a velocity through the air, by channel."""
    speed = np.sqrt(u**2 + v**2 + w**2)
    sine = np.clip(v / np.maximum(speed, 1e-9), -1, 1)
    return {"air/V": speed, "air/alpha": np.arctan2(w, u), "air/beta": np.arcsin(sine)}


def own_flight(
    simulation: Simulation,
    record: FlightRecord,
    departures: Departures | None = None,
    effects: Settings | None = None,
) -> dict[str, Array]:
    """Return the simulation's own flight, by channel; nothing where it cannot fly or move its effectors.

    Measured effectors are no substitute for its own: they hold what feedback made of noise.

    Parameters
    ----------
    simulation : Simulation
    record : FlightRecord
    departures : dict of float, optional
        Of its own parameters, with which it flies.
    effects : dict of dict of float, optional
        Of its own, with which it flies.

    Raises
    ------
    DataError
        Where the user's own function flies and diverges, stands still or is not finite, with the time.
    """
    try:
        flown = simulation.fly(record, effects, departures)
    except (DataError, UsageError):
        if simulation.kind == "callable":
            raise
        return {}  # it need not fly to be replayed
    own = {n if "/" in n else f"state/{n}": np.asarray(x, dtype=float) for n, x in (flown or {}).items()}
    if not own:
        return {}
    moving = [n for n in record.group("effector") if np.ptp(record[f"effector/{n}"]) > 0]
    if any(f"effector/{n}" not in own for n in moving):
        if fed_back(record):
            return {}
        positions = simulation.positions(record, None, departures)
        own |= {f"effector/{n}": positions.get(n, record[f"effector/{n}"]) for n in moving}
    return with_attitude_and_felt(record, own)


def own_maneuver(simulation: Simulation, maneuver: Maneuver) -> Maneuver | None:
    """Return the simulation's nominal flight under a record's injected signals; None where it has none.

    About the straight lines of the record's channels. Commands are those of the record.

    Raises
    ------
    DataError
        As `own_flight`.
    """
    own = own_flight(simulation, maneuver.record)
    return Maneuver(_about(maneuver.record, own), maneuver.vehicle) if own else None


def fed_back(record: FlightRecord) -> bool:
    """Return whether commands hold more than the injected signals."""
    for name in record.group("command"):
        sent = record[f"command/{name}"]
        excited = f"excitation/{name}" in record
        injected = record[f"excitation/{name}"] if excited else np.zeros_like(sent)
        if np.std(sent - injected) > 0.05 * max(np.std(injected), 1e-12):
            return True
    return not record.group("command")


def _fitted_response(record: FlightRecord) -> tuple[dict[str, Array], bool]:
    """Return the response of linear models to the measured effectors, fitted to the record.

    Motion in the plane of symmetry and across it by a model each: together they have twice the parameters,
    more than one short record bears, and the fit runs away. A plane that no response is found for, as in
    turbulence without inputs there, is smoothed. Other channels are linear in the states and the effectors.

    Returns
    -------
    dict of ndarray
        By channel; empty where no plane responds.
    bool
        Whether a plane is smoothed.
    """
    inputs = [f"effector/{n}" for n in record.group("effector") if np.ptp(record[f"effector/{n}"]) > 0]
    velocity = VELOCITY if all(n in record for n in VELOCITY) else FLOW
    states = [n for n in (*velocity, *RATES, "state/phi", "state/theta") if _moves(record, n)]
    if not inputs or not states:
        return {}, False
    effectors = smooth(record.matrix(inputs), record.dt).x
    planes = ([n for n in states if n in _SYMMETRIC], [n for n in states if n not in _SYMMETRIC])
    each = [_plane_response(record, plane, effectors) for plane in planes if plane]
    if not any(each):
        return {}, False
    found = {n: x for response in each for n, x in response.items()}
    left = [n for n in states if n not in found]
    if left:
        x = np.array([np.unwrap(record[n]) if n in ATTITUDE else record[n] for n in left])
        found |= dict(zip(left, smooth(x, record.dt).x, strict=True))
    time = record.time / record.time[-1]
    basis = np.array([*found.values(), *effectors, np.ones_like(time), time])
    basis = (basis - basis.mean(axis=1, keepdims=True)) / np.maximum(basis.std(axis=1, keepdims=True), 1e-300)
    basis[-2] = 1.0
    found |= dict(zip(inputs, effectors, strict=True))
    others = [n for n in record.channels if n.startswith(("state/", "air/")) and n not in found]
    for name in others:
        values = np.unwrap(record[name]) if name in ATTITUDE else record[name]
        found[name] = np.linalg.lstsq(basis.T, values, rcond=None)[0] @ basis
    return found, bool(left)


def _plane_response(record: FlightRecord, states: Sequence[str], effectors: Array) -> dict[str, Array]:
    """Return the response of some states to effectors, shape (effector, sample), by channel.

    ``x' = A x + B d + c`` in integral form, so that nothing is differentiated; first by least squares, then
    with its own response as instruments. Of these the response that misses least of the rates is taken;
    none where all miss too much.
    """
    time, dt = record.time - record.time[0], record.dt
    x = np.array([np.unwrap(record[n]) if n in ATTITUDE else record[n] for n in states])
    scale_x, x0 = x.std(axis=1, keepdims=True), x.mean(axis=1, keepdims=True)
    d = effectors - effectors.mean(axis=1, keepdims=True)
    d = d / d.std(axis=1, keepdims=True)
    x = (x - x0) / scale_x
    steady = np.stack([np.ones_like(time), time / time[-1]])
    driven = cumulative_trapezoid(d, dx=dt, initial=0, axis=1)
    instruments = cumulative_trapezoid(x, dx=dt, initial=0, axis=1)
    columns = np.concatenate([instruments, driven, steady])
    least, found = _NO_RESPONSE, {}
    for _ in range(_ROUNDS):
        z = np.concatenate([instruments, driven, steady])
        try:
            theta = np.linalg.solve(z @ columns.T, z @ x.T).T
            response = _simulated(theta[:, : len(x)], theta[:, len(x) : len(x) + len(d)], x, d, dt)
        except np.linalg.LinAlgError:
            break
        if response is None:
            break
        own = dict(zip(states, x0 + scale_x * response, strict=True))
        missed = share_missed(record, own)
        if missed < least:
            least, found = missed, own
        instruments = cumulative_trapezoid(response, dx=dt, initial=0, axis=1)
    return found


def _simulated(a: Array, b: Array, x: Array, d: Array, dt: float) -> Array | None:
    """Return the response from the initial state and the constants that fit best, or None without one.

    A mode that would grow more than twentyfold within the record is an error of the fit, and slowed down.
    """
    count = len(a)
    values, vectors = np.linalg.eig(a)
    fastest = 3 / (dt * x.shape[1])
    if np.real(values).max() > fastest:
        slowed = np.minimum(np.real(values), fastest) + 1j * np.imag(values)
        a = np.real(vectors @ np.diag(slowed) @ np.linalg.inv(vectors))
    whole = expm(
        dt * np.block([[a, b, np.eye(count)], [np.zeros((b.shape[1] + count, 2 * count + b.shape[1]))]])
    )
    step, push, const = (
        whole[:count, :count],
        whole[:count, count : count + b.shape[1]],
        whole[:count, -count:],
    )
    samples = x.shape[1]
    forced = np.zeros((count, samples))
    free, held = np.zeros((2, count, count, samples))
    free[:, :, 0] = np.eye(count)
    middle = 0.5 * (d[:, 1:] + d[:, :-1])
    for k in range(samples - 1):
        forced[:, k + 1] = step @ forced[:, k] + push @ middle[:, k]
        free[:, :, k + 1] = step @ free[:, :, k]
        held[:, :, k + 1] = step @ held[:, :, k] + const
    if not np.isfinite(forced).all() or not np.isfinite(held).all():
        return None
    basis = np.concatenate([free, held], axis=1).transpose(0, 2, 1).reshape(count * samples, 2 * count)
    unknown = np.asarray(np.linalg.lstsq(basis, (x - forced).ravel(), rcond=1e-10)[0], dtype=np.float64)
    return forced + (basis @ unknown).reshape(count, samples)


def _moves(record: FlightRecord, name: str) -> bool:
    return name in record and bool(np.ptp(record[name]) > 0)


def _smoothed(simulation: Simulation, maneuver: Maneuver) -> Maneuver:
    """Return the record's own motion as far as it stands out of the noise: the last resort.

    Specific forces are the simulation's, axis by axis: measured ones would lend their noise to every column
    of a mass.
    """
    record = maneuver.record
    names = [n for n in record.channels if n.startswith(("state/", "air/", "effector/"))]
    moving = [n for n in names if _moves(record, n)]
    if not moving:
        return maneuver
    values = np.array([np.unwrap(record[n]) if n in ATTITUDE else record[n] for n in moving])
    found = dict(zip(moving, smooth(values, record.dt).x, strict=True))
    channels = [replace(record.channel(n), values=x) for n, x in found.items()]
    clean = Maneuver(record.with_channels(*channels), maneuver.vehicle)
    forces = _forces(simulation, clean)
    forces = {n: x for n, x in forces.items() if n in record}
    if not forces:
        return clean
    rates = np.array([clean.record[n] if n in record else np.zeros(record.time.size) for n in RATES])
    at = record.dt * np.arange(record.time.size)
    turning = CubicSpline(at, rates, axis=1)(at, 1)
    arm = _arm_of_accelerometers(clean)
    added: dict[str, Array] = dict(
        zip(FORCES, cross(turning, arm) + cross(rates, cross(rates, arm)), strict=True)
    )
    own = {n: x / maneuver.vehicle.mass_properties.mass_kg + added[n] for n, x in forces.items()}
    kept = {n: x for n, x in found.items() if n not in FORCES}
    return Maneuver(_about(record, {**kept, **own}), maneuver.vehicle)


def _forces(simulation: Simulation, maneuver: Maneuver) -> dict[str, Array]:
    """Return the simulated forces, N, shape (sample,) each, by the channel that feels them."""
    area = maneuver.vehicle.area_m2
    found = {}
    for name, row in zip(simulation.responses, simulation.predict(maneuver.record), strict=True):
        letter = COEFFICIENT.get(name, name)
        if letter not in WRENCH[:3]:
            continue
        channel = FORCES[WRENCH.index(letter)]
        if name == letter:
            found[channel] = row
        elif area is not None:
            found[channel] = row * history(maneuver, "qbar") * area
    return found


def _arm_of_accelerometers(maneuver: Maneuver) -> Array:
    """Return where the accelerometers are from the centre of gravity, m, shape (3, sample)."""
    record = maneuver.record
    place = next(record.channel(n).position_m for n in FORCES if n in record)
    if place is None:
        return np.zeros((3, record.time.size))
    return np.array(place)[:, None] - centre(record, maneuver.vehicle)

"""What the sensors that are checked should show on a flight path, and how errors change it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.frames import cross, specific_force_at
from freqid.core.record import FlightRecord
from freqid.identify.sensors.flight_path import FlightPath, euler_angles, skew
from freqid.identify.spectra.smoothing import local_derivative

FLOW = ("air/V", "air/alpha", "air/beta")
VELOCITY = ("state/u", "state/v", "state/w")
ATTITUDE = ("state/phi", "state/theta", "state/psi")
GROUND = ("state/vn", "state/ve", "state/vd")
INERTIAL = ("state/p", "state/q", "state/r", "state/ax", "state/ay", "state/az")
ANGLES = {*FLOW[1:], *ATTITUDE}
# Beyond this pitch angle Euler angles lose their meaning, and with them what they could tell.
STEEPEST = np.deg2rad(80.0)


@dataclass(frozen=True, eq=False)
class Sensors:
    """The measurements of a record that kinematics tie together.

    Attributes
    ----------
    dt : float
        Sampling interval, s.
    rates, force : ndarray, shape (3, sample)
        p q r, rad/s, and the specific force at one point, m/s2.
    names : tuple of str, length k
        Channels that are compared with what rates and forces integrate to.
    values : ndarray, shape (k, sample)
        SI units; angles without jumps.
    arms : ndarray, shape (k, 3)
        From the accelerometers to each of these sensors, body axes, m.
    """

    dt: float
    rates: Array
    force: Array
    names: tuple[str, ...]
    values: Array
    arms: Array


def sensors_of(record: FlightRecord, cg_m: tuple[float, float, float] | None) -> Sensors:
    """Collect the measurements of a record that a compatibility check can use.

    Parameters
    ----------
    record : FlightRecord
    cg_m : tuple of 3 floats, optional
        Centre of gravity, vehicle axes, m, where sensors without a position are.

    Returns
    -------
    Sensors
        u v w, or airspeed and flow angles where not all of these were logged; attitude, altitude and
        velocity over ground, each where present.

    Raises
    ------
    DataError
        A rate or a specific force is missing, nothing is there to compare them with, positions cannot be
        referred to a centre of gravity, or the aircraft pitches beyond 80 deg.
    """
    rates, force = record.matrix(INERTIAL[:3]), record.matrix(INERTIAL[3:])
    # Where both were logged one is computed from the other; u v w mean something at rest too.
    air = FLOW if any(n in record for n in FLOW) and not all(n in record for n in VELOCITY) else VELOCITY
    others = (*air, *ATTITUDE, "state/alt", *GROUND)
    names = tuple(n for n in others if n in record)
    if not names:
        raise DataError(
            "the record has rates and specific forces but nothing to compare them with",
            remedy="log airspeed, flow angles, attitude or velocity over ground",
        )
    if "state/theta" in names and np.abs(record["state/theta"]).max() > STEEPEST:
        at = record.time[int(np.argmax(np.abs(record["state/theta"])))]
        raise DataError(
            f"channel 'state/theta' passes {np.degrees(STEEPEST):.0f} deg at t = {at:.4g} s, where Euler "
            "angles are lost",
            remedy="cut the record around it",
        )
    places = {n: _place(record, n, cg_m) for n in (*INERTIAL[3:], *names)}
    home = places["state/ax"]
    for row, name in enumerate(INERTIAL[4:], start=1):
        offset = home - places[name]
        if offset.any():  # bring it to where ax is; the only place where a rate is differentiated
            force[row] = specific_force_at(force, rates, local_derivative(rates, record.dt), offset)[row]
    values = record.matrix(names)
    for row, name in enumerate(names):
        if name in ANGLES:
            values[row] = np.unwrap(values[row])
    arms = np.array([places[n] - home for n in names])
    return Sensors(record.dt, rates, force, names, values, arms)


def _place(record: FlightRecord, name: str, cg_m: tuple[float, float, float] | None) -> Array:
    """Return a sensor's position from the centre of gravity, shape (3,), m."""
    position = record.channel(name).position_m
    if position is None:
        return np.zeros(3)
    if cg_m is None:
        raise DataError(
            f"channel '{name}' has a position but the record does not describe its vehicle",
            remedy="import it with --scenario, so that its centre of gravity is known",
        )
    return np.subtract(position, cg_m)


def predicted(path: FlightPath, sensors: Sensors, rates: Array, wind: Array) -> tuple[Array, Array, Array]:
    """Return what ideal sensors would show on a path.

    Parameters
    ----------
    path : FlightPath
    sensors : Sensors
    rates : ndarray, shape (3, sample)
        p q r without their biases, rad/s.
    wind : ndarray, shape (3,)
        Velocity of the air, north, east, down, m/s.

    Returns
    -------
    values : ndarray, shape (k, sample)
        In the order of `sensors.names`.
    by_state : ndarray, shape (k, 7, sample)
        Derivatives by the errors of the path, `flight_path.STATES`.
    by_wind : ndarray, shape (k, 3, sample)
        Derivatives by the wind.
    """
    k, samples = len(sensors.names), path.height.size
    values, by_state, by_wind = np.empty((k, samples)), np.zeros((k, 7, samples)), np.zeros((k, 3, samples))
    to_body = path.turn.transpose(1, 0, 2)
    through_air = path.velocity - wind[:, None]
    relative = np.einsum("ijn,jn->in", to_body, through_air)
    by_turn = np.einsum("ijn,jkn->ikn", to_body, skew(through_air))
    angles = euler_angles(path.turn)
    by_angle = _euler_by_turn(angles)
    for row, (name, arm) in enumerate(zip(sensors.names, sensors.arms, strict=True)):
        swung = cross(rates, np.broadcast_to(arm[:, None], rates.shape))
        if name in FLOW or name in VELOCITY:
            values[row], gradient = _air(name, relative + swung)
            by_state[row, :3] = np.einsum("in,ijn->jn", gradient, by_turn)
            by_state[row, 3:6] = np.einsum("in,ijn->jn", gradient, to_body)
            by_wind[row] = -by_state[row, 3:6]
        elif name in ATTITUDE:
            values[row] = angles[ATTITUDE.index(name)]
            by_state[row, :3] = by_angle[ATTITUDE.index(name)]
        elif name in GROUND:
            axis = GROUND.index(name)
            values[row] = path.velocity[axis] + np.einsum("jn,jn->n", path.turn[axis], swung)
            by_state[row, 3 + axis] = 1.0
        else:
            values[row] = path.height
            by_state[row, 6] = 1.0
    return values, by_state, by_wind


def _air(name: str, velocity: Array) -> tuple[Array, Array]:
    """Return one quantity of the air flow, shape (sample,), and its gradient by u v w, shape (3, sample)."""
    u, v, w = velocity
    zero = np.zeros_like(u)
    if name in VELOCITY:
        axis = VELOCITY.index(name)
        return velocity[axis], np.repeat(np.eye(3)[axis][:, None], u.size, axis=1)
    plane, speed = np.hypot(u, w), np.linalg.norm(velocity, axis=0)
    # At rest angles have no direction to change in: their gradients are bounded there, not infinite.
    plane2, speed2 = np.maximum(plane**2, 1e-6), np.maximum(speed**2, 1e-6)
    if name == "air/V":
        return speed, velocity / np.sqrt(speed2)
    if name == "air/alpha":
        return np.unwrap(np.arctan2(w, u)), np.stack((-w / plane2, zero, u / plane2))
    along = -v / np.sqrt(plane2) / speed2
    return np.arctan2(v, plane), np.stack((u * along, plane / speed2, w * along))


def _euler_by_turn(angles: Array) -> Array:
    """Return derivatives of phi theta psi by small turns about north, east and down, shape (3, 3, sample)."""
    _, theta, psi = angles
    c, s, zero = np.cos(psi), np.sin(psi), np.zeros_like(psi)
    secant, tangent = 1 / np.cos(theta), np.tan(theta)
    return np.array(
        [[c * secant, s * secant, zero], [-s, c, zero], [c * tangent, s * tangent, np.ones_like(psi)]]
    )

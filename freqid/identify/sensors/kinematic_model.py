"""What the sensors should show on a flight path, and how their errors, the unknowns, change it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.channels import ANGLES, ATTITUDE, FLOW, FORCES, GROUND, RATES, VELOCITY
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import body_velocity, cross, flow_angles, specific_force_at
from freqid.identify.sensors.errors import Reading, error_name
from freqid.identify.sensors.flight_path import (
    CAUSES,
    GRAVITY,
    FlightPath,
    attitude_matrix,
    error_growth,
    euler_angles,
    integrate_path,
    running_integral,
    skew,
    turned_by,
)
from freqid.identify.spectra.smoothing import local_derivative

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
    rates, force = record.matrix(RATES), record.matrix(FORCES)
    # u v w mean something at rest too.
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
    places = {n: _place(record, n, cg_m) for n in (*FORCES, *names)}
    home = places["state/ax"]
    for row, name in enumerate(FORCES[1:], start=1):
        offset = home - places[name]
        if offset.any():  # bring it to where ax is; the only place where a rate is differentiated
            force[row] = specific_force_at(force, rates, local_derivative(rates, record.dt), offset)[row]
    values = record.matrix(names)
    for row, name in enumerate(names):
        if name in ANGLES:
            values[row] = np.unwrap(values[row])
    arms = np.array([places[n] - home for n in names])
    return Sensors(record.dt, rates, force, names, values, arms)


# A flow angle, or an airspeed over its size, that is this near what u v w make was computed from them: log
# files keep seven digits, and no two sensors agree to six.
COMPUTED = 1e-5


def computed_flow(record: FlightRecord) -> tuple[str, ...]:
    """Return which of airspeed and flow angles were not measured but computed from u v w."""
    if not all(n in record for n in VELOCITY):
        return ()
    made = dict(zip(FLOW, flow_angles(record.matrix(VELOCITY)), strict=True))
    size = {n: max(1.0, float(np.abs(made[n]).max())) for n in FLOW}
    return tuple(n for n in FLOW if n in record and np.abs(record[n] - made[n]).max() < COMPUTED * size[n])


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


INITIAL = 7  # values that an integration starts from, the first of all unknowns
LARGEST_MOVE = 0.1  # of a delay in one step, s
WINDS = ("wind north", "wind east", "wind down")


@dataclass(frozen=True, eq=False)
class Guess:
    """Values of the unknowns.

    Attributes
    ----------
    attitude : ndarray, shape (3, 3)
        Turn from body to earth axes where the comparison starts; the unknown turns are steps from it.
    values : ndarray, shape (m,)
        All unknowns, SI units; the first three, the turns, are zero.
    """

    attitude: Array
    values: Array

    def back(self, unknowns: NDArray[np.bool_], start: Guess) -> Guess:
        """Return the guess with some unknowns back where they started."""
        return Guess(self.attitude, np.where(unknowns, start.values, self.values))


@dataclass(frozen=True, eq=False)
class Prediction:
    """What the sensors should show over the window that is compared, to first order about a guess.

    Attributes
    ----------
    path : FlightPath
        Over the whole record.
    modelled, residual : ndarray, shape (k, n)
        Channels by the guess, and measured less modelled.
    jacobian : ndarray, shape (m, k, n)
        Derivatives of `modelled` by the unknowns.
    instruments : ndarray, shape (m, k, n)
        `jacobian`, of the air data along the motion that the injected signals alone make, where that is
        known.
    seen : ndarray, shape (k, 10, n)
        Derivatives of `modelled` by errors of the path at the time that is shown, and by wind.
    """

    path: FlightPath
    modelled: Array
    residual: Array
    jacobian: Array
    instruments: Array
    seen: Array


class CompatibilityProblem:
    """Sensors of one record as a least-squares problem in their errors.

    A channel is modelled as ``(1 + scale) true(t - delay) + bias``.

    Parameters
    ----------
    sensors : Sensors
    longest_delay : float
        Longest delay that is tried, s; as much is left out at both ends of the record.
    driven : ndarray, shape (6, sample), optional
        u v w p q r of the motion that the injected signals alone make.

    Attributes
    ----------
    sensors, driven
        As given.
    names : tuple of str, length m
        Seven initial values, then biases of rates and forces, wind, and errors of the other channels.
    window : slice
        Samples that are compared.
    start : Guess
        Initial values as measured, no errors.
    on_air : ndarray of bool, shape (m,)
        Unknowns that are scales and delays of the air data.

    Raises
    ------
    DataError
        The record is too short.
    """

    def __init__(self, sensors: Sensors, longest_delay: float, driven: Array | None = None):
        margin = int(np.ceil(longest_delay / sensors.dt)) + 3  # three more to interpolate and differentiate
        samples = sensors.values.shape[1]
        least = 2 * margin + 200
        if samples < least:
            raise DataError(
                f"the record has {samples} samples, expected at least {least} for a compatibility check with "
                f"delays up to {longest_delay:g} s",
                remedy="use a longer record, or lower longest_delay_s",
            )
        self.sensors, self.window = sensors, slice(margin, samples - margin)
        self.driven = driven
        self.names = (*CAUSES, *_other_unknowns(sensors.names))
        self._index = {name: i for i, name in enumerate(self.names)}
        self._winds = [axis for axis, name in enumerate(WINDS) if name in self._index]
        self.start = self._initial()
        self._delays = np.array([name.endswith("delay") for name in self.names])
        self._longest_delay = longest_delay
        air = [n for n in sensors.names if n in (*FLOW, *VELOCITY)]
        self.on_air = np.isin(self.names, [error_name(n, k) for n in air for k in ("scale", "delay")])

    def moved(self, guess: Guess, unknowns: NDArray[np.bool_], step: Array) -> Guess:
        """Return a guess after a step of some unknowns, of which the first three turn the attitude.

        Delays move by LARGEST_MOVE at most and stop at the longest that the margins of the window allow.
        """
        whole = np.zeros(len(self.names))
        whole[unknowns] = step
        whole[self._delays] = np.clip(whole[self._delays], -LARGEST_MOVE, LARGEST_MOVE)
        values = guess.values + whole
        values[self._delays] = np.clip(values[self._delays], -self._longest_delay, self._longest_delay)
        values[:3] = 0.0
        return Guess(turned_by(whole[:3]) @ guess.attitude, values)

    def blocked(self, guess: Guess, unknowns: NDArray[np.bool_], step: Array) -> list[int]:
        """Return the delays that a step would carry beyond the longest one."""
        whole = np.zeros(len(self.names))
        whole[unknowns] = step
        beyond = np.abs(guess.values + whole) > self._longest_delay
        at_limit = np.abs(guess.values) >= self._longest_delay * (1 - 1e-9)
        return np.flatnonzero(self._delays & at_limit & beyond).tolist()

    def predict(self, guess: Guess) -> Prediction:
        """Integrate the inertial sensors less their biases, and compare the other channels with that."""
        sensors, value = self.sensors, guess.values
        bias = value[INITIAL : len(CAUSES), None]
        rates, force = sensors.rates - bias[:3], sensors.force - bias[3:]
        path = integrate_path(
            rates, force, sensors.dt, self.window.start, guess.attitude, value[3:6], value[6]
        )
        wind = np.zeros(3)
        wind[self._winds] = [value[self._index[WINDS[axis]]] for axis in self._winds]
        errors = dict(zip(self.names, value.tolist(), strict=True))
        modelled, jacobian, seen = self._derived(path, rates, wind, errors)
        instruments = jacobian
        if self.driven is not None:
            air = [row for row, name in enumerate(sensors.names) if name in (*FLOW, *VELOCITY)]
            instruments = jacobian.copy()
            instruments[:, air] = self._derived(*self._alone(guess, wind), wind, errors)[1][:, air]
        residual = sensors.values[:, self.window] - modelled
        for row, name in enumerate(sensors.names):
            if name in ANGLES:  # whole turns apart where each was unwound by itself
                residual[row] -= 2 * np.pi * np.round(residual[row].mean() / (2 * np.pi))
        return Prediction(path, modelled, residual, jacobian, instruments, seen)

    def _derived(
        self, path: FlightPath, rates: Array, wind: Array, errors: Mapping[str, float]
    ) -> tuple[Array, Array, Array]:
        """Return what the sensors show on a path, and its derivatives by unknowns, and by state and wind."""
        sensors = self.sensors
        ideal, by_state, by_wind = predicted(path, sensors, rates, wind)
        by_cause = np.einsum("ksn,scn->kcn", by_state, error_growth(path))
        slope = np.gradient(ideal, sensors.dt, axis=1)
        k, n, m = len(ideal), self.window.stop - self.window.start, len(CAUSES)
        modelled, jacobian = np.empty((k, n)), np.zeros((len(self.names), k, n))
        seen = np.empty((k, by_state.shape[1] + 3, n))
        for row, name in enumerate(sensors.names):
            reading = Reading.of(name, errors)
            gain = 1 + reading.scale
            rows = (ideal[row, None], slope[row, None], by_cause[row], by_state[row], by_wind[row])
            rows = self._delayed(np.concatenate(rows), reading.delay)
            modelled[row], seen[row] = gain * rows[0] + reading.bias, gain * rows[2 + m :]
            jacobian[:m, row] = gain * rows[2 : 2 + m]
            for axis in self._winds:
                jacobian[self._index[WINDS[axis]], row] = seen[row, axis - 3]
            for kind, column in (("scale", rows[0]), ("bias", 1.0), ("delay", -gain * rows[1])):
                at = self._index.get(error_name(name, kind))
                if at is not None:
                    jacobian[at, row] = column
        return modelled, jacobian, seen

    def _alone(self, guess: Guess, wind: Array) -> tuple[FlightPath, Array]:
        """Return the path of the motion that the injected signals alone make, and its rates."""
        assert self.driven is not None
        rates = self.driven[3:] - self.driven[3:].mean(axis=1, keepdims=True)  # their means are biases
        dt, origin = self.sensors.dt, self.window.start
        still = integrate_path(rates, 0 * rates, dt, origin, guess.attitude, np.zeros(3), 0.0)
        velocity = np.einsum("ijn,jn->in", still.turn, self.driven[:3]) + wind[:, None]
        force = np.gradient(velocity, dt, axis=1) - np.array([[0.0], [0.0], [GRAVITY]])
        height = -running_integral(velocity[2:], dt)[0]
        return FlightPath(dt, origin, still.turn, velocity, height - height[origin], force), rates

    def _delayed(self, rows: Array, delay: float) -> Array:
        """Return rows at t - delay over the window, by cubics through four neighbouring samples."""
        shift = -delay / self.sensors.dt
        whole = int(np.floor(shift))
        m = shift - whole
        weights = (
            -m * (m - 1) * (m - 2) / 6,
            (m + 1) * (m - 1) * (m - 2) / 2,
            -(m + 1) * m * (m - 2) / 2,
            (m + 1) * m * (m - 1) / 6,
        )
        first, last = self.window.start + whole, self.window.stop + whole
        parts = (w * rows[..., first + j : last + j] for j, w in enumerate(weights, start=-1))
        return sum(parts, np.zeros(1))

    def _initial(self) -> Guess:
        """Return the start of the comparison as measured, zero for what was not."""
        sensors, at = self.sensors, self.window.start
        near = slice(at - 2, at + 3)
        level = {
            n.partition("/")[2]: v[near].mean() for n, v in zip(sensors.names, sensors.values, strict=True)
        }
        attitude = attitude_matrix(*(level.get(n, 0.0) for n in ("phi", "theta", "psi")))
        body = body_velocity(level.get("V", 0.0), level.get("alpha", 0.0), level.get("beta", 0.0))
        if not any(n in level for n in ("V", "alpha", "beta")):
            body = np.array([level.get(n, 0.0) for n in "uvw"])
        arm = next(
            (a for n, a in zip(sensors.names, sensors.arms, strict=True) if n in (*FLOW, *VELOCITY)), 0.0
        )
        rates = sensors.rates[:, near].mean(axis=1)
        velocity = attitude @ (body - cross(rates, np.broadcast_to(arm, 3)))
        values = np.zeros(len(self.names))
        values[3:6] = velocity
        for axis, name in enumerate(GROUND):
            if name.partition("/")[2] in level:  # the air moves with what is left
                values[3 + axis] = level[name.partition("/")[2]]
                if axis in self._winds:
                    values[self._index[WINDS[axis]]] = values[3 + axis] - velocity[axis]
        values[6] = level.get("alt", 0.0)
        return Guess(attitude, values)


def _other_unknowns(channels: tuple[str, ...]) -> list[str]:
    """Return the unknowns beside initial values and biases of inertial sensors, by what was logged."""
    air = (*FLOW, *VELOCITY)
    names: list[str] = []
    if any(n in air for n in channels):  # wind is what differs between ground and air
        if any(n in GROUND for n in channels):
            names += WINDS
        elif "state/alt" in channels:
            names += WINDS[2:]
    for channel in channels:
        if channel in air:
            names.append(error_name(channel, "scale"))
        if channel in air or channel in ATTITUDE[:2]:  # of heading and altitude the start stands for a bias
            names.append(error_name(channel, "bias"))
        names.append(error_name(channel, "delay"))
    return list(dict.fromkeys(names))

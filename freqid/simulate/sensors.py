"""What an aircraft would log of a flight: the truth through its sensors."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.core.channels import ATTITUDE, FLOW, FORCES, GROUND, RATES, VELOCITY, si_unit, split
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import Scenario
from freqid.core.toml import convert
from freqid.core.vehicle import Strict, Vector, Vehicle
from freqid.dynamics.frames import cross, flow_angles, level_from_body, specific_force_at

_ANGULAR_ACCELERATIONS = ("state/pdot", "state/qdot", "state/rdot")
_PLACED = {*VELOCITY, *GROUND, *FORCES, *FLOW}  # depend on where the sensor is
_TURNING = ("state/phi", "state/psi", "air/alpha")  # may jump by a full turn, which no spline survives
_ORIGIN = (0.0, 0.0, 0.0)
_EXACT = ("command", "excitation")  # groups that the flight computer knows without measuring


class Sensor(Strict, frozen=True):
    """One ``[simulation.sensors.<suite>.<name>]``; errors in the SI unit of its channels.

    Attributes
    ----------
    channels : tuple of str
        What it logs; ``effector/surface``, ``effector/tilt`` and ``effector/rotor`` stand for all of a kind.
    rate_hz : float
        Its own sampling rate.
    noise : float
        One sigma of each sample.
    bias, scale : float
        One sigma of a constant error and of a relative one; drawn once a flight for each channel.
    latency_s : float
        How old a value is when it is logged.
    quantum : float
        Step of its digits; zero for none.
    position_m : tuple of 3 floats, optional
        Of accelerometers and flow sensors in vehicle axes; the vehicle's origin where absent.
    senses : {"air", "ground", "tube"}
        Whether it meets the air (u v w, airspeed, flow angles), sees the ground (vn ve vd, which is all
        that such a sensor can log of velocity), or is a tube along x (airspeed).
    blind_below : float
        Airspeed below which a tube reads zero, m/s.
    upwash : float
        Relative change that the vehicle makes to a flow angle.
    """

    channels: tuple[str, ...]
    rate_hz: float
    noise: float = 0.0
    bias: float = 0.0
    scale: float = 0.0
    latency_s: float = 0.0
    quantum: float = 0.0
    position_m: Vector | None = None
    senses: Literal["air", "ground", "tube"] = "air"
    blind_below: float = 0.0
    upwash: float = 0.0

    def __post_init__(self) -> None:
        if not self.rate_hz > 0:
            raise ValueError(f"rate_hz is {self.rate_hz:g}, expected a positive rate")
        sizes = (self.noise, self.bias, self.scale, self.latency_s, self.quantum, self.blind_below)
        if min(sizes) < 0:
            raise ValueError("expected errors, latency, quantum and blind_below that are not negative")
        for channel in self.channels:
            try:
                split(channel)
            except DataError as error:
                raise ValueError(str(error)) from None
        for channel in {*VELOCITY, *FLOW} & set(self.channels) if self.senses == "ground" else ():
            raise ValueError(
                f"'{channel}' is relative to the air, but senses is 'ground', expected {' '.join(GROUND)}"
            )
        for channel in set(GROUND) & set(self.channels) if self.senses != "ground" else ():
            raise ValueError(f"'{channel}' is over the ground, but senses is '{self.senses}'")


Suite = dict[str, Sensor]


def suite(scenario: Scenario, name: str) -> Suite:
    """Return one sensor suite of a scenario, by sensor name.

    Raises
    ------
    UsageError
        Where there is none of that name, a key is unknown or two sensors log the same channel.
    """
    suites = scenario.simulation.sensors
    if name not in suites:
        raise UsageError(f"the scenario has no sensor suite '{name}'", remedy=nearest(name, suites))
    place = f"[simulation.sensors.{name}"
    sensors = {label: convert(t, Sensor, f"{place}.{label}]") for label, t in suites[name].items()}
    taken: dict[str, str] = {}
    for label, sensor in sensors.items():
        for channel in _logged(sensor, scenario.aircraft()):
            if channel in taken:
                raise UsageError(
                    f"channel '{channel}' is logged by both '{taken[channel]}' and '{label}'",
                    where=f"{place}]",
                    remedy="leave it to one of them",
                )
            taken[channel] = label
    return sensors


def with_scaled_noise(sensors: Suite, noise: float) -> Suite:
    """Return sensors with their noise multiplied; at zero, without any error and as fast as the log."""
    if noise == 0:
        kept = ("channels", "position_m", "senses")
        return {
            label: Sensor(rate_hz=np.inf, **{name: getattr(sensor, name) for name in kept})
            for label, sensor in sensors.items()
        }
    return {
        label: msgspec.structs.replace(sensor, noise=noise * sensor.noise)
        for label, sensor in sensors.items()
    }


def measure(truth: FlightRecord, wind: Array, sensors: Suite, rate_hz: float, seed: int) -> FlightRecord:
    """Return what is logged of a flight.

    Parameters
    ----------
    truth : FlightRecord
        With its vehicle; motion and specific force of the vehicle's origin, angular accelerations,
        positions of the effectors; sampled finely enough for a cubic spline between samples.
    wind : ndarray, shape (3, sample)
        Velocity of the air over the ground, body axes, m/s.
    sensors : dict of Sensor
    rate_hz : float
        Of the log.
    seed : int
        Of all errors; each channel has its own stream, so that one more sensor changes no other.

    Returns
    -------
    FlightRecord
        The sensors' channels, straight between a sensor's own samples where the log is faster, and the
        commands and excitations as they were.

    Raises
    ------
    DataError
        Where the truth lacks a channel that a sensor needs.
    """
    vehicle = truth.vehicle
    if vehicle is None:
        raise DataError("the truth does not describe its vehicle")
    start, stop = truth.time[[0, -1]]
    time = start + np.arange(int(np.floor((stop - start) * rate_hz + 1e-6)) + 1) / rate_hz
    channels = []
    for label, sensor in sensors.items():
        sensed = _sensed(truth, wind, sensor)
        own_rate = min(sensor.rate_hz, rate_hz)
        own = start + np.arange(int(np.ceil((stop - start) * own_rate)) + 1) / own_rate
        for name in _logged(sensor, vehicle):
            signal = sensed[name] if name in sensed else truth[name]
            signal = np.unwrap(signal) if name in _TURNING else signal
            at = np.clip(own - sensor.latency_s, start, stop)
            samples = _with_errors(name, sensor, CubicSpline(truth.time, signal)(at), seed)
            unit = si_unit(name, vehicle.effector_kinds) or truth.channel(name).unit
            place = sensor.position_m or _ORIGIN if name in _PLACED else None
            values = np.interp(time, own, samples)
            channels.append(Channel(name, unit, values, own_rate, f"simulated {label}", place))
    for name, channel in truth.channels.items():
        if split(name)[0] in _EXACT:  # held between steps, so the last one is what counts
            last = np.searchsorted(truth.time, time + 1e-9 * truth.dt, side="right") - 1
            channels.append(Channel(name, channel.unit, channel.values[last], rate_hz, channel.source))
    return FlightRecord(
        time=time,
        channels={channel.name: channel for channel in channels},
        vehicle=vehicle,
        mass_properties=truth.mass_properties,
        reference=truth.reference,
        configuration=truth.configuration,
        provenance={**truth.provenance, "sensor_seed": seed},
    )


def _logged(sensor: Sensor, vehicle: Vehicle) -> list[str]:
    """Return the channels of a sensor, those of a kind spelled out."""
    names = []
    for channel in sensor.channels:
        group, name = split(channel)
        of_kind = [e.name for e in vehicle.effectors if e.kind == name] if group == "effector" else []
        names += [f"{group}/{effector}" for effector in of_kind] or [channel]
    return names


def _sensed(truth: FlightRecord, wind: Array, sensor: Sensor) -> dict[str, Array]:
    """Return the channels that depend on where the sensor is and what it senses, before its errors."""
    sensed: dict[str, Array] = {}
    if not set(sensor.channels) & _PLACED:
        return sensed
    rates, offset = truth.matrix(RATES), np.array(sensor.position_m or _ORIGIN)
    if set(sensor.channels) & set(FORCES):
        force, turning = truth.matrix(FORCES), truth.matrix(_ANGULAR_ACCELERATIONS)
        moved = specific_force_at(force, rates, turning, offset)
        sensed |= dict(zip(FORCES, moved, strict=True))
    velocity = truth.matrix(VELOCITY) + cross(rates, np.broadcast_to(offset[:, None], rates.shape))
    if sensor.senses == "ground":
        over_ground = np.einsum("ijn,jn->in", level_from_body(truth.matrix(ATTITUDE)), velocity + wind)
        return sensed | dict(zip(GROUND, over_ground, strict=True))
    speed, alpha, beta = flow_angles(velocity)
    if sensor.senses == "tube":
        speed = velocity[0]
    bent = (speed, (1 + sensor.upwash) * alpha, (1 + sensor.upwash) * beta)
    return sensed | dict(zip(VELOCITY, velocity, strict=True)) | dict(zip(FLOW, bent, strict=True))


def _with_errors(name: str, sensor: Sensor, values: Array, seed: int) -> Array:
    """Return samples of one channel with the sensor's errors."""
    rng = np.random.default_rng([seed, *name.encode()])
    bias, scale = sensor.bias * rng.standard_normal(), sensor.scale * rng.standard_normal()
    samples = (1 + scale) * values + bias + sensor.noise * rng.standard_normal(values.size)
    if sensor.quantum:
        samples = sensor.quantum * np.round(samples / sensor.quantum)
    if name == "air/V" and sensor.senses == "tube":
        samples = np.where(values < sensor.blind_below, 0.0, samples)
    return samples

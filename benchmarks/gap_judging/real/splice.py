"""Known changes to a real record: a channel late, scaled, biased or turned, mass properties misstated.

Each is made from its definition, on the whole flight before it is cut, and names the effect of
``docs/effects.md`` that it is, with its parameter and size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from freqid.core.record import FlightRecord
from freqid.dynamics.frames import body_velocity, cross

Array = NDArray[np.float64]
Change = Callable[[FlightRecord], FlightRecord]

GROUPS = {
    "rates": ("state/p", "state/q", "state/r"),
    "accelerometers": ("state/ax", "state/ay", "state/az"),
    "attitude": ("state/phi", "state/theta", "state/psi"),
    "velocity": ("state/u", "state/v", "state/w", "air/V", "air/alpha", "air/beta", "air/qbar"),
}


@dataclass(frozen=True)
class Splice:
    """One known change.

    Attributes
    ----------
    label : str
        Part of the case's id.
    effect, parameter : str
        Of ``docs/effects.md``.
    size : float
        In the parameter's unit.
    change : callable
        Makes the changed record of a record.
    place : str, optional
        Effector that it is confined to.
    aliases : tuple of str
        Effects that would say exactly the same of these data.
    """

    label: str
    effect: str
    parameter: str
    size: float
    change: Change = field(repr=False)
    place: str | None = None
    aliases: tuple[str, ...] = ()


def _label(what: str, size: float, unit: str = "") -> str:
    return f"{what}_{size:g}{unit}".replace("-", "m").replace(".", "p")


def _changed(record: FlightRecord, values: dict[str, Array]) -> FlightRecord:
    return record.with_channels(*(replace(record.channel(n), values=x) for n, x in values.items()))


def _delayed(record: FlightRecord, names: Sequence[str], seconds: float) -> FlightRecord:
    """Return a record in which channels are older than their time stamps; at first they rest."""
    time = record.time
    earlier = np.clip(time - seconds, time[0], None)
    whole = round(seconds / record.dt)
    exact = abs(whole * record.dt - seconds) < 1e-6
    late = {}
    for name in names:
        if name not in record:
            continue
        x = record[name]
        late[name] = x[np.maximum(np.arange(x.size) - whole, 0)] if exact else CubicSpline(time, x)(earlier)
    return _changed(record, late)


def late_surface(name: str, seconds: float, only: bool = False) -> Splice:
    """Return one surface's measured position late.

    Parameters
    ----------
    name : str
        Of the effector.
    seconds : float
    only : bool
        Whether no other surface moves in the flight, so that its place cannot matter.
    """
    return Splice(
        label=_label(f"{name}_late", 1000 * seconds, "ms"),
        effect="time_skew",
        parameter="effectors",
        size=seconds,
        change=lambda record: _delayed(record, [f"effector/{name}"], seconds),
        place=None if only else name,
        aliases=("actuator_delay",),
    )


def late_surfaces(seconds: float) -> Splice:
    """Return the positions of all effectors late: the other sign of a delay of all actuators."""

    def change(record: FlightRecord) -> FlightRecord:
        return _delayed(record, [f"effector/{n}" for n in record.group("effector")], seconds)

    label = _label("effectors_late", 1000 * seconds, "ms")
    return Splice(label, "time_skew", "effectors", seconds, change, aliases=("actuator_delay",))


def late_group(group: str, seconds: float) -> Splice:
    """Return the gyros, the accelerometers or the air data late."""
    return Splice(
        label=_label(f"{group}_late", 1000 * seconds, "ms"),
        effect="time_skew",
        parameter=group,
        size=seconds,
        change=lambda record: _delayed(record, GROUPS[group], seconds),
    )


def lost_surface(loss: float, names: Sequence[str], every: bool = False, only: bool = False) -> Splice:
    """Return deflections that read more than the air feels: true is (1 - loss) of measured.

    Parameters
    ----------
    loss : float
        Negative where the air feels more than is measured.
    names : sequence of str
        Effectors; one, unless `every`.
    every : bool
        Whether these are all effectors.
    only : bool
        Whether no other surface moves in the flight, so that its place cannot matter.
    """

    def change(record: FlightRecord) -> FlightRecord:
        read = {f"effector/{n}": record[f"effector/{n}"] / (1 - loss) for n in names}
        return _changed(record, read)

    return Splice(
        label=_label(f"{'effectors' if every else names[0]}_loss", loss),
        effect="surface_effectiveness",
        parameter="loss",
        size=loss,
        change=change,
        place=None if every or only else names[0],
        aliases=("sensor_scale",),
    )


def scaled(channel: str, share: float) -> Splice:
    """Return a sensor that reads too much by a share: ``state/p`` and the like."""
    return Splice(
        label=_label(f"{channel.partition('/')[2]}_scale", share),
        effect="sensor_scale",
        parameter=channel.partition("/")[2],
        size=share,
        change=lambda record: _changed(record, {channel: (1 + share) * record[channel]}),
        aliases=("mass",) if channel == "state/az" else (),
    )


def biased(channel: str, offset: float) -> Splice:
    """Return a sensor that reads too much by a constant."""
    return Splice(
        label=_label(f"{channel.partition('/')[2]}_bias", offset),
        effect="sensor_bias",
        parameter=channel.partition("/")[2],
        size=offset,
        change=lambda record: _changed(record, {channel: record[channel] + offset}),
        aliases=("extra_drag",) if channel == "state/ax" else (),
    )


def turned(axis: str, angle: float) -> Splice:
    """Return gyros and accelerometers mounted askew: their axes are the body's, turned about x, y or z.

    A positive angle turns the sensors right-handed, so what they read is the vector turned back.
    """
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]

    def change(record: FlightRecord) -> FlightRecord:
        read = {}
        for group in ("rates", "accelerometers"):
            names = GROUPS[group]
            if not all(n in record for n in names):
                continue
            a, b = record[names[i]], record[names[j]]
            read[names[i]] = np.cos(angle) * a + np.sin(angle) * b
            read[names[j]] = np.cos(angle) * b - np.sin(angle) * a
        return _changed(record, read)

    return Splice(_label(f"imu_{axis}", angle, "rad"), "misalignment", f"imu_{axis}", angle, change)


def upwash(angle: str, share: float) -> Splice:
    """Return flow angles that read too much, ``alpha`` or ``beta``, and the velocity that goes with them."""

    def change(record: FlightRecord) -> FlightRecord:
        values = {n: record[f"air/{n}"] for n in ("V", "alpha", "beta")}
        values[angle] = (1 + share) * values[angle]
        velocity = body_velocity(values["V"], values["alpha"], values["beta"])
        moved = dict(zip(("state/u", "state/v", "state/w"), velocity, strict=True))
        return _changed(record, {**moved, f"air/{angle}": values[angle]})

    label = _label(f"{angle}_upwash", share)
    return Splice(label, "flow_upwash", angle, share, change, aliases=("sensor_scale",))


def heavier(fraction: float) -> Splice:
    """Return a vehicle that is described lighter than it is by a fraction of the description."""

    def change(record: FlightRecord) -> FlightRecord:
        mass = record.vehicle.mass_properties
        told = msgspec.structs.replace(mass, mass_kg=mass.mass_kg / (1 + fraction))
        return replace(record, vehicle=msgspec.structs.replace(record.vehicle, mass_properties=told))

    return Splice(_label("mass", fraction), "mass", "fraction", fraction, change, aliases=("sensor_scale",))


def stiffer(axis: str, fraction: float) -> Splice:
    """Return a vehicle whose moment of inertia, ``xx yy zz``, is described too small."""

    def change(record: FlightRecord) -> FlightRecord:
        mass = record.vehicle.mass_properties
        value = getattr(mass.inertia, axis) / (1 + fraction)
        told = msgspec.structs.replace(mass, inertia=msgspec.structs.replace(mass.inertia, **{axis: value}))
        return replace(record, vehicle=msgspec.structs.replace(record.vehicle, mass_properties=told))

    return Splice(_label(f"inertia_{axis}", fraction), "inertia", axis, fraction, change)


def dragging(coefficient: float) -> Splice:
    """Return a flight with a drag linear in speed; `coefficient` of it is felt at the mean speed."""

    def change(record: FlightRecord) -> FlightRecord:
        vehicle, speed = record.vehicle, float(record["air/V"].mean())
        per_speed = 0.5 * coefficient * record["air/rho"] * vehicle.area_m2 * speed
        felt = -per_speed * record["state/u"] / vehicle.mass_properties.mass_kg
        return _changed(record, {"state/ax": record["state/ax"] + felt})

    label = _label("linear_drag", coefficient)
    return Splice(label, "extra_drag", "coefficient", coefficient, change, aliases=("sensor_bias",))


def off_lever(forward: float) -> Splice:
    """Return accelerometers that are `forward` metres ahead of where the log has them."""

    def change(record: FlightRecord) -> FlightRecord:
        rates = np.array([record[n] for n in GROUPS["rates"]])
        arm = np.zeros_like(rates)
        arm[0] = forward
        turning = np.array([CubicSpline(record.time, _smooth(x)).derivative()(record.time) for x in rates])
        felt = cross(turning, arm) + cross(rates, cross(rates, arm))
        moved = {n: record[n] + a for n, a in zip(GROUPS["accelerometers"], felt, strict=True)}
        return _changed(record, moved)

    return Splice(_label("lever_x", forward, "m"), "lever_arm", "x", forward, change)


def weak(loss: float) -> Splice:
    """Return rotor speeds that read more than they are: thrust is (1 - loss) of what they say."""

    def change(record: FlightRecord) -> FlightRecord:
        read = [record.channel(f"effector/{n}") for n in record.group("effector")]
        return record.with_channels(*(replace(c, values=c.values / np.sqrt(1 - loss)) for c in read))

    label = f"rotors_weak_{loss:g}".replace(".", "p")
    return Splice(label, "weak_rotor", "loss", loss, change, aliases=("sensor_scale", "mass"))


def blown(north: float) -> Splice:
    """Return velocities over the ground where the air moves north at a steady speed, m/s."""

    def change(record: FlightRecord) -> FlightRecord:
        theta, psi, phi = (record[f"state/{n}"] for n in ("theta", "psi", "phi"))
        along = {
            "state/u": np.cos(theta) * np.cos(psi),
            "state/v": np.sin(phi) * np.sin(theta) * np.cos(psi) - np.cos(phi) * np.sin(psi),
            "state/w": np.cos(phi) * np.sin(theta) * np.cos(psi) + np.sin(phi) * np.sin(psi),
        }
        moved = (replace(record.channel(n), values=record[n] + north * c) for n, c in along.items())
        return record.with_channels(*moved)

    label = f"wind_north_{north:g}".replace(".", "p")
    return Splice(label, "steady_wind", "north", north, change)


def _smooth(x: Array) -> Array:
    """Return a running quadratic of seven samples, which keeps what is below a tenth of the rate."""
    kernel = np.array([-2, 3, 6, 7, 6, 3, -2]) / 21
    padded = np.pad(x, 3, mode="reflect", reflect_type="odd")
    return np.convolve(padded, kernel, mode="valid")

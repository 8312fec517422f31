"""The channels of a record that sensor effects act on, by the short names of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord

# One sigma of a bias that would matter, by channel or by kind of effector.
BIAS = {
    **dict.fromkeys(("ax", "ay", "az"), (0.1, "m/s2")),
    **dict.fromkeys(("p", "q", "r"), (0.01, "rad/s")),
    **dict.fromkeys(("phi", "theta", "psi"), (0.01, "rad")),
    **dict.fromkeys(("u", "v", "w", "vn", "ve", "vd", "V"), (0.3, "m/s")),
    **dict.fromkeys(("alpha", "beta", "surface", "tilt"), (0.01, "rad")),
    "rotor": (5.0, "rad/s"),
}
_AIR = ("V", "alpha", "beta")
KINDS = ("surface", "tilt", "rotor")
AIRSPEED = "airspeed"  # what one pitot tube measures: all velocities relative to the air
_OF_AIRSPEED = ("state/u", "state/v", "state/w", "air/V")
_TURNING = ("state/phi", "state/psi", "air/alpha")  # may jump by a full turn


def channels(name: str, record: FlightRecord) -> tuple[str, ...]:
    """Return the channels of a record that a parameter stands for: one, or all of one airspeed or kind."""
    if name == AIRSPEED:
        found = tuple(c for c in _OF_AIRSPEED if c in record)
        return found if len(found) > 1 else ()
    if name not in KINDS:
        if f"effector/{name}" in record:
            return (f"effector/{name}",)
        channel = f"{'air' if name in _AIR else 'state'}/{name}"
        return (channel,) if channel in record else ()
    kinds = record.vehicle.effector_kinds if record.vehicle else {}
    return tuple(f"effector/{n}" for n in record.group("effector") if kinds.get(n) == name)


def changed(record: FlightRecord, values: Mapping[str, Array]) -> FlightRecord:
    """Return a record with the values of some channels in place of the old ones."""
    return record.with_channels(*(replace(record.channel(n), values=v) for n, v in values.items()))


def each(
    settings: Mapping[str, float], record: FlightRecord, how: Callable[[Array, float], Array]
) -> FlightRecord:
    """Return a record with ``how(values, setting)`` in every channel whose setting is not zero.

    Settings of a kind of effectors and of one of them act one after the other.
    """
    found: dict[str, Array] = {}
    for name, size in settings.items():
        for channel in channels(name, record) if size else ():
            found[channel] = how(found.get(channel, record[channel]), size)
    return changed(record, found)


def unwrapped(record: FlightRecord, channel: str) -> Array:
    """Return a channel without jumps of a full turn."""
    return np.unwrap(record[channel]) if channel in _TURNING else record[channel]

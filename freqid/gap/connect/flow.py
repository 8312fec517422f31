"""The motion through the air that a record holds, at a point of the vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.channels import ATTITUDE, FLOW, GROUND, RATES, VELOCITY
from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.dynamics.frames import body_velocity, cross, level_from_body


def velocity(record: FlightRecord, point_m: ArrayLike) -> Array:
    """Return the velocity of a point of the vehicle relative to the air, body axes, shape (3, sample), m/s.

    Parameters
    ----------
    record : FlightRecord
        With u v w; else airspeed and flow angles; else the velocity over the ground, the air taken as calm.
        Each is moved from where its sensor is.
    point_m : array_like, shape (3,)
        Vehicle axes, m; also where a sensor is that does not state its position.

    Raises
    ------
    DataError
        Where the record has none of these, or lacks angular rates to move a sensor's velocity by.
    """
    if all(name in record for name in VELOCITY):
        names, found = VELOCITY, record.matrix(VELOCITY)
    elif all(f"air/{name}" in record for name in ("V", "alpha")):
        names = ("air/alpha", "air/beta", "air/alpha")  # what tells of v and w is where the vanes are
        beta = record["air/beta"] if "air/beta" in record else np.zeros_like(record.time)
        found = body_velocity(record["air/V"], record["air/alpha"], beta)
    elif all(name in record for name in (*GROUND, *ATTITUDE)):
        names, turn = GROUND, level_from_body(record.matrix(ATTITUDE))
        found = np.einsum("ijn,in->jn", turn, record.matrix(GROUND))
    else:
        raise DataError(
            "the record tells neither u v w, nor V and alpha, nor velocity over the ground with attitude",
            remedy="log one of them; a simulation is replayed on the motion that was flown",
        )
    found = np.array(found)
    for axis, name in enumerate(names):
        place = record.channels[name].position_m if name in record else None
        if place is not None and np.any(offset := np.subtract(point_m, place)):
            rates = record.matrix(RATES)
            found[axis] += cross(rates, np.broadcast_to(offset[:, None], rates.shape))[axis]
    return found


def with_velocity(record: FlightRecord) -> FlightRecord:
    """Return a record that tells u v w of the vehicle's origin, from V, alpha and beta where it did not."""
    if any(name in record for name in VELOCITY) or not all(name in record for name in FLOW):
        return record
    rate = min(record.channel(name).native_rate_hz for name in FLOW)
    origin = (0.0, 0.0, 0.0)
    found = velocity(record, origin)
    return record.with_channels(
        *(
            Channel(name, "m/s", row, rate, "computed from V, alpha and beta", origin)
            for name, row in zip(VELOCITY, found, strict=True)
        )
    )


def density(record: FlightRecord, otherwise: float) -> Array:
    """Return the air density, shape (sample,), kg/m3; a given one where the record does not tell."""
    return record["air/rho"] if "air/rho" in record else np.full(record.time.size, float(otherwise))

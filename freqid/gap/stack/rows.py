"""What was measured less what a simulation says: along the airframe, its actuators and its sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT, FORCES, RATES, RESPONSE, STATE, VELOCITY, WRENCH
from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics.frames import cross
from freqid.gap.stack.histories import Histories, Row
from freqid.identify.loads.wrench import applied_wrench

_ATTITUDE = ("state/phi", "state/theta")


def measured_part(maneuver: Maneuver, responses: Sequence[str], actuators: Sequence[str]) -> Histories:
    """Return all that is measured in a residual: nothing in it depends on the simulation.

    Parameters
    ----------
    maneuver : Maneuver
    responses : sequence of str
        Of the simulation. A wrench component is reconstructed from the motion, unless the record holds it
        as ``response/<name>``; a state is what was logged.
    actuators : sequence of str
        Effectors whose positions the simulation predicts.

    Returns
    -------
    Histories
        Responses, actuators, and where the record has what it takes the kinematic rows: what is left of
        ``v' = f + g - w x v`` at the accelerometers and of the Euler angles' rates. A constant wind does
        not show in them, faults of the sensors do.

    Raises
    ------
    DataError
        Where a channel is missing.
    """
    parts = [_responses(maneuver, responses)]
    record = maneuver.record
    if actuators:
        direct = record.matrix(f"effector/{name}" for name in actuators)
        units = [record.channel(f"effector/{name}").unit for name in actuators]
        rows = tuple(Row(f"actuator/{n}", u, "actuator") for n, u in zip(actuators, units, strict=True))
        parts.append(Histories(rows, direct, np.zeros_like(direct)))
    parts += _kinematics(record)
    return Histories(
        tuple(row for part in parts for row in part.rows),
        np.concatenate([part.direct for part in parts]),
        np.concatenate([part.momentum for part in parts]),
    )


def _responses(maneuver: Maneuver, responses: Sequence[str]) -> Histories:
    record = maneuver.record
    rows, direct = [], np.zeros((len(responses), record.time.size))
    momentum = np.zeros_like(direct)
    rebuilt: dict[str, list[tuple[int, str]]] = {"force": [], "coefficient": []}
    for i, name in enumerate(responses):
        unit = RESPONSE[name][0] if name in RESPONSE else STATE[name][0] if name in STATE else ""
        rows.append(Row(name, unit, "response"))
        if f"response/{name}" in record:
            direct[i] = record[f"response/{name}"]
        elif name in STATE:
            direct[i] = record[f"state/{name}"]
        elif name in WRENCH:
            rebuilt["force"].append((i, name))
        elif name in COEFFICIENT:
            rebuilt["coefficient"].append((i, COEFFICIENT[name]))
        else:
            raise DataError(
                f"the simulation gives '{name}', which is neither a response nor a state",
                remedy="name responses X Y Z L M N, CX CY CZ Cl Cm Cn, or states such as q",
            )
    for form, wanted in rebuilt.items():
        if wanted:
            found = applied_wrench(maneuver, [letter for _, letter in wanted], form=form)  # type: ignore[arg-type]
            at = [i for i, _ in wanted]
            direct[at], momentum[at] = found.direct, found.momentum
    return Histories(tuple(rows), direct, momentum)


def _kinematics(record: FlightRecord) -> list[Histories]:
    """Return the kinematic rows that the record has the channels for."""
    found = []
    if all(n in record for n in (*RATES, *_ATTITUDE)):
        rates, (phi, theta) = record.matrix(RATES), record.matrix(_ATTITUDE)
        if all(n in record for n in (*VELOCITY, *FORCES)):
            found.append(_velocity_rows(record, rates, phi, theta))
        angles = angle_rates(rates, phi, theta)
        names = [n for n in angles if f"state/{n}" in record]
        found.append(
            Histories(
                tuple(Row(f"kinematic/{n}", "rad/s", "kinematic") for n in names),
                -np.array([angles[n] for n in names]),
                np.unwrap(record.matrix(f"state/{n}" for n in names)),
            )
        )
    return found


def _velocity_rows(record: FlightRecord, rates: Array, phi: Array, theta: Array) -> Histories:
    """Return what is left of the velocity's kinematics at the accelerometers, m/s2."""
    velocity = record.matrix(VELOCITY) + cross(rates, np.broadcast_to(sensor_lever(record), rates.shape))
    rows = tuple(Row(f"kinematic/{n}", "m/s2", "kinematic") for n in "uvw")
    felt = record.matrix(FORCES) + gravity_of(phi, theta)
    return Histories(rows, cross(rates, velocity) - felt, velocity)


def angle_rates(rates: Array, phi: Array, theta: Array) -> dict[str, Array]:
    """Return the derivatives of phi, theta and psi, rad/s, of p q r, shape (3, sample), rad/s."""
    p, q, r = rates
    sine, cosine = np.sin(phi), np.cos(phi)
    return {
        "phi": p + np.tan(theta) * (q * sine + r * cosine),
        "theta": q * cosine - r * sine,
        "psi": (q * sine + r * cosine) / np.cos(theta),
    }


def gravity_of(phi: Array, theta: Array) -> Array:
    """Return gravity in body axes, shape (3, sample), m/s2."""
    return STANDARD_GRAVITY * np.stack(
        [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    )


def sensor_lever(record: FlightRecord) -> Array:
    """Return the place of the accelerometers from where velocity is measured, m, shape (3, 1)."""
    return np.subtract(place_of(record.channel("state/ax")), place_of(record.channel("state/u")))[:, None]


def place_of(channel: Channel) -> tuple[float, float, float]:
    """Return where a channel is measured, m in vehicle axes; their origin where it states no place."""
    return channel.position_m or (0.0, 0.0, 0.0)

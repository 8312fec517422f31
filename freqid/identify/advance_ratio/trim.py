"""The propellers' advance ratio that a manoeuvre was flown at."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, pi

import numpy as np

from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, Maneuver
from freqid.identify.loads.explanatory import history

STOPPED = 50.0
"""Advance ratio from which a propeller counts as stopped: it turns once in 50 diameters and blows nothing."""


def trim_advance_ratio(maneuver: Maneuver) -> float:
    """Return ``J = 2 pi V / (Omega d)`` from the means of airspeed and of the propellers' speeds.

    Parameters
    ----------
    maneuver : Maneuver
        Of a vehicle whose rotors state their diameter; several turn together.

    Returns
    -------
    float
        inf where the propellers are stopped, which is a valid unblown point.

    Raises
    ------
    DataError
        Where the vehicle has no propeller, one states no diameter, or its speed or the airspeed was not
        logged.

    Notes
    -----
    Propellers of unlike diameter count by ``Omega d``, the mean tip speed but for a factor.
    """
    vehicle, record = maneuver.vehicle, maneuver.record
    if not vehicle.rotors:
        raise DataError(
            f"vehicle '{vehicle.name}' describes no propeller, so it has no advance ratio",
            remedy="add [[rotor]] with diameter_m to the scenario",
        )
    speeds = []
    for rotor in vehicle.rotors:
        if rotor.diameter_m is None or not 0 < rotor.diameter_m < inf:
            raise DataError(
                f"rotor '{rotor.name}' of vehicle '{vehicle.name}' states no diameter, so its advance ratio "
                "cannot be had",
                remedy="add diameter_m to its [[rotor]] in the scenario",
            )
        if f"effector/{rotor.name}" not in record:
            raise DataError(
                f"channel 'effector/{rotor.name}' is missing, so the advance ratio of rotor '{rotor.name}' "
                "cannot be had",
                remedy="log its speed, and import it as an effector",
            )
        speeds.append(rotor.diameter_m * float(record[f"effector/{rotor.name}"].mean()))
    speed, airspeed = float(np.mean(speeds)), float(history(maneuver, "V").mean())
    for rotor, one in zip(vehicle.rotors, speeds, strict=True):
        if one < 0 and airspeed <= STOPPED * -one / (2 * pi):
            raise DataError(
                f"channel 'effector/{rotor.name}' is negative in the mean, expected a speed from zero up",
                remedy="import the speed without its sign; spin of its [[rotor]] says the direction",
            )
    if airspeed == speed == 0:
        raise DataError(
            "neither the vehicle nor a propeller moves, so there is no advance ratio",
            remedy="log the airspeed and the propellers' speeds",
        )
    if airspeed > STOPPED * speed / (2 * pi):
        return inf
    return 2 * pi * airspeed / speed


def flown_trim(maneuvers: Sequence[Maneuver]) -> tuple[dict[str, float], str]:
    """Return what is known of the trim that manoeuvres were flown at, for a point model.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
        At one condition.

    Returns
    -------
    trim : dict of str to float
        ``V`` m/s, ``alpha`` rad and ``advance_ratio``, as far as they can be had; means weighted with
        the durations, the advance ratio from those of its inverse.
    why : str
        Why there is no advance ratio; empty where there is.
    """
    weights = [m.record.duration for m in maneuvers]
    trim: dict[str, float] = {}
    for name in ("V", "alpha"):
        try:
            trim[name] = float(np.average([history(m, name).mean() for m in maneuvers], weights=weights))
        except DataError:
            continue
    try:
        each = np.array([trim_advance_ratio(m) for m in maneuvers])
    except DataError as error:
        return trim, error.message
    # the inverse of zero, as in hover, is infinite, and that of infinity zero
    inverse = np.average(np.divide(1.0, each, out=np.full(len(each), inf), where=each > 0), weights=weights)
    trim["advance_ratio"] = float(1 / inverse) if inverse > 0 else inf
    return trim, ""


def excited(record: FlightRecord) -> FlightRecord:
    """Return the part of a record in which signals are injected: there the trim is the one that is flown.

    Parameters
    ----------
    record : FlightRecord

    Returns
    -------
    FlightRecord
        All of it where it logged no excitation.
    """
    injected = [record[f"excitation/{name}"] for name in record.group("excitation")]
    on = np.flatnonzero(np.any(injected, axis=0)) if injected else np.zeros(0)
    if on.size < 2:
        return record
    return record.cut(float(record.time[on[0]]), float(record.time[on[-1]]))

"""Which parameters a record cannot give because nobody measured how fast the aircraft met the air."""

from __future__ import annotations

from collections.abc import Sequence

from freqid.core.errors import DataError
from freqid.core.identification import Identification, factors_of
from freqid.core.record import FlightRecord, Maneuver

VELOCITY, FLOW, GROUND = ("u", "v", "w"), ("V", "alpha", "beta"), ("vn", "ve", "vd")
# What each needs of the velocity through the air where it was not logged itself.
_FROM_SPEED = ("qbar", "phat", "qhat", "rhat")


def refuse_without_air(maneuvers: Sequence[Maneuver], settings: Identification, estimator: str) -> None:
    """Refuse, by name, parameters that need a velocity through the air which the records do not hold.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
    settings : Identification
    estimator : str
        Instruments need the whole motion, whatever the regressors are.

    Raises
    ------
    DataError
        Naming the regressors, the responses they belong to, and why.
    """
    for maneuver in maneuvers:
        record = maneuver.record
        wanted: dict[str, list[str]] = {}
        for response in settings.responses:
            for name in dict.fromkeys(f for n in settings.regressors_of(response) for f in factors_of(n)):
                if not _can_be_had(maneuver, name):
                    wanted.setdefault(name, []).append(response)
        if wanted:
            by_responses: dict[tuple[str, ...], list[str]] = {}
            for name, responses in wanted.items():
                by_responses.setdefault(tuple(responses), []).append(name)
            said = " and ".join(f"{' '.join(n)} of {' '.join(r)}" for r, n in by_responses.items())
            raise DataError(f"parameters by {said} cannot be had: {_why(maneuver)}", remedy=_remedy(record))
        if settings.response_source == "reconstruct":
            for needed, name in (("coefficients", "qbar"), ("stability axes", "alpha")):
                asked = settings.form == "coefficient" if name == "qbar" else settings.axes == "stability"
                if asked and not _can_be_had(maneuver, name):
                    remedy = "ask for form 'force' and body axes, or fly with air data"
                    raise DataError(f"{needed} cannot be had: {_why(maneuver)}", remedy=remedy)
        if estimator == "instruments" and not _whole(record):
            raise DataError(
                f"instruments cannot be had: they are driven through the whole motion, and {_why(maneuver)}",
                remedy=f"use --estimator least-squares, or {_remedy(record)}",
            )


def _can_be_had(maneuver: Maneuver, name: str) -> bool:
    """Tell whether a regressor was logged or can be computed; what is no air quantity is not judged here.

    Airspeed and flow angles of a sensor off the centre of gravity need the whole velocity to get there.
    """
    record = maneuver.record
    if f"state/{name}" in record or (f"air/{name}" in record and not _elsewhere(maneuver, name)):
        return True
    if name in (*VELOCITY, *FLOW):
        return _whole(record)
    return name not in _FROM_SPEED or _can_be_had(maneuver, "V")


def _elsewhere(maneuver: Maneuver, name: str) -> bool:
    """Tell whether a flow sensor is not at the centre of gravity."""
    if name not in FLOW:
        return False
    place = maneuver.record.channel(f"air/{name}").position_m
    return place is not None and tuple(place) != tuple(maneuver.vehicle.mass_properties.cg_m)


def _whole(record: FlightRecord) -> bool:
    return all(f"state/{n}" in record for n in VELOCITY) or all(f"air/{n}" in record for n in FLOW)


def _why(maneuver: Maneuver) -> str:
    """Say what is known of the velocity in place of all of it."""
    record = maneuver.record
    logged = [n for g, names in (("state", VELOCITY), ("air", FLOW)) for n in names if f"{g}/{n}" in record]
    part = (
        f"of the air the record holds {' '.join(logged)} alone, not u v w or V alpha beta" if logged else ""
    )
    if all(f"state/{n}" in record for n in GROUND):
        ground = "velocity is known over the ground only (vn ve vd), and the wind is unknown"
        return f"{ground}; {part}" if part else ground
    return part or "the record holds no velocity through the air, neither u v w nor V alpha beta"


def _remedy(record: FlightRecord) -> str:
    ways = ["leave them out of the regressors", "fly with air data"]
    if all(f"state/{n}" in record for n in GROUND):
        ways.insert(0, "find the wind from the flight itself with --align fit")
    return ", or ".join(ways)

"""What the injected signals alone would have made of a flight: motion that owes nothing to noise and gusts.

Gusts move an aircraft, and feedback sends that motion on to its effectors: a signature that is computed from
them goes with what the gusts did, and passes for an effect. The injected signals do not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from freqid.core.errors import DataError, UsageError
from freqid.core.frames import cross
from freqid.core.identification import Identification
from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.lines import Lines
from freqid.gap.quiet import MOTION
from freqid.gap.residual import angle_rates, gravity_of, sensor_lever
from freqid.gap.simulation import Simulation
from freqid.identify.instruments import driven_maneuvers

Array = NDArray[np.float64]

_ALIKE = 0.1  # of the rates' motion, that a simulation's own flight may miss before another is looked for
_USELESS = 1.5  # from which it is no flight of the kind; gusts alone make about one
_NO_CLOSER = 1.4  # times what a fitted loop misses
_FED_BACK = 0.05  # of the injected signals, that commands may hold beside them
_RATES = ("state/p", "state/q", "state/r")
_ANGLES = ("state/phi", "state/psi")
_VELOCITY = ("state/u", "state/v", "state/w")
_FELT = ("state/ax", "state/ay", "state/az")


def driven(simulation: Simulation, maneuver: Maneuver, lines: Lines) -> dict[str, Array]:
    """Return what the injected signals alone would have made of a manoeuvre, by channel.

    The simulation's own flight; where the response of a closed loop that is fitted to the record is clearly
    closer, each channel of whichever comes closer to it, and that response alone where the simulation does
    not fly. Nothing where neither resembles the record. What a simulation that is a little off may do goes
    with the motion of the aircraft, not with its own: along its own, a scatter of its tables passes for a
    mass. But a loop has no drag to speak of, nor forces that are nearly in balance.

    Parameters
    ----------
    simulation : Simulation
    maneuver : Maneuver
    lines : Lines
        On which a closed loop is fitted.
    """
    record = maneuver.record
    if not record.group("excitation"):
        return {}
    try:
        flown = simulation.fly(record)
    except (DataError, UsageError):  # it need not fly to be replayed
        flown = None
    own = {name if "/" in name else f"state/{name}": x for name, x in (flown or {}).items()}
    if own and not any(name.startswith("effector/") for name in own) and _fed_back(record):
        own = {}  # it flew the record's commands, and with them what the law made of gusts
    missed = _missed(record, own)
    if missed < _ALIKE:
        return own
    loop = _by_fitted_loop(maneuver, lines)
    # where a loop fitted to the record hardly comes closer, gusts are what is missed
    found = own if missed < _NO_CLOSER * _missed(record, loop) else _nearer(record, own, loop)
    # a fitted loop holds no slow motion: it stands for the record where it explains every rate
    return found if _missed(record, found) < (_USELESS if found is own else 1) else {}


def _nearer(record: FlightRecord, own: dict[str, Array], loop: dict[str, Array]) -> dict[str, Array]:
    """Return all channels, those that both have of the one that misses less of the record's."""
    found = loop | own
    for name in loop.keys() & own.keys():
        if name in record and _share_missed(record, name, loop) < _share_missed(record, name, own):
            found[name] = loop[name]
    return found


def _missed(record: FlightRecord, found: dict[str, Array]) -> float:
    """Return the largest share of a rate's motion that is not in what stands for it; infinite of nothing."""
    named = [n for n in _RATES if n in record and n in found]
    return max([0.0 if found else np.inf, *(_share_missed(record, n, found) for n in named)])


def _share_missed(record: FlightRecord, name: str, found: dict[str, Array]) -> float:
    """Return the share of a channel's changes, less a straight line, that is not in what stands for it."""
    time = record.time - record.time.mean()
    measured, other = (np.unwrap(x) if name in _ANGLES else x for x in (record[name], found[name]))
    moved, left = (np.std(x - np.polyval(np.polyfit(time, x, 1), time)) for x in (measured, measured - other))
    return float(left / max(moved, 1e-300))


def _fed_back(record: FlightRecord) -> bool:
    """Return whether commands hold more than the injected signals."""
    for name in record.group("excitation"):
        injected = record[f"excitation/{name}"]
        sent = f"command/{name}" if f"command/{name}" in record else ""
        if sent and np.std(record[sent] - injected) > _FED_BACK * np.std(injected):
            return True
    others = (n for n in record.group("command") if n not in record.group("excitation"))
    return any(np.ptp(record[f"command/{n}"]) > 0 for n in others)


def _by_fitted_loop(maneuver: Maneuver, lines: Lines) -> dict[str, Array]:
    """Return motion and effectors of a fitted closed loop, with the attitude and forces felt of that motion.

    Nothing where the record has too little for a loop (`freqid.identify.instruments`).
    """
    record = maneuver.record
    moving = tuple(n for n in record.group("effector") if np.ptp(record[f"effector/{n}"]) > 0)
    try:
        (found,) = driven_maneuvers([maneuver], lines.hz, Identification(regressors=(*MOTION, *moving)))
    except (DataError, UsageError, ValueError, np.linalg.LinAlgError):
        return {}
    names = [*(f"state/{n}" for n in MOTION), *(f"effector/{n}" for n in moving)]
    return {name: found.record[name] for name in names} | _of_motion(record, found.record)


def _of_motion(record: FlightRecord, moved: FlightRecord) -> dict[str, Array]:
    """Return the attitude and the specific force, where they were measured, that go with a motion."""
    attitude = {n: f"state/{n}" for n in ("phi", "theta", "psi") if f"state/{n}" in record}
    if not {"phi", "theta"} <= set(attitude):
        return {}
    rates, dt = moved.matrix(_RATES), record.dt
    slopes = angle_rates(rates, record["state/phi"], record["state/theta"])
    time = record.time - record.time.mean()
    found = {}
    for name, path in attitude.items():
        angle = cumulative_trapezoid(slopes[name], dx=dt, initial=0)
        level = np.unwrap(record[path]).mean()
        found[path] = level + angle - np.polyval(np.polyfit(time, angle, 1), time)
    if all(n in record for n in (*_VELOCITY, *_FELT)):
        lever = np.broadcast_to(sensor_lever(record), rates.shape)
        velocity = moved.matrix(_VELOCITY) + cross(rates, lever)
        gravity = gravity_of(found["state/phi"], found["state/theta"])
        felt = np.gradient(velocity, dt, axis=1) + cross(rates, velocity) - gravity
        found |= dict(zip(_FELT, felt, strict=True))
    return found

"""Motion of a closed loop that is fitted to a record, for a simulation that cannot fly.

A rigid body under a control law answers at once to its effectors. Gyros that are late in the record are not
late in it, and the fit then turns that delay into a wrong stability. So the loop is fitted to channels that
are taken to be late by what lets it miss least of the record, and its own are made as late.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import FORCES, RATES, VELOCITY
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.sections.identification import Identification
from freqid.dynamics.frames import cross
from freqid.gap.stack.felt import with_attitude_and_felt
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.missed_motion import noise_of_rates, share_missed
from freqid.identify.instruments.driven import MOTION, driven_loop
from freqid.identify.instruments.loop_model import LoopModel
from freqid.simulate.effects.along import centre
from freqid.simulate.effects.signals import logged_late

Late = Mapping[tuple[str, ...], float]
"""How late sensors are, s, by those that are late together."""

_SENSORS: tuple[tuple[str, ...], ...] = (RATES, VELOCITY, FORCES)
_STEPS = (0.04, 0.02, 0.01)  # s, in which their delays are looked for
_LATEST = 0.5  # s
_SLOWEST = 1.0  # turn within the record: what is slower is a straight line
_GROWTH = 20.0  # within the record, from which on a mode is an error of the fit


def fitted_loop(maneuver: Maneuver, lines: Lines, rival: float = np.inf) -> dict[str, Array]:
    """Return motion and effectors of a fitted closed loop, by channel; empty where none can be fitted.

    Driven by the injected signals, from the initial state that fits best.

    Parameters
    ----------
    maneuver : Maneuver
        With injected signals.
    lines : Lines
        On which the loop is fitted.
    rival : float
        Share of the rates' changes that another motion misses: a loop that misses more as it is, is not
        worth the search for delays.
    """
    record = maneuver.record
    noise = noise_of_rates(record)

    def missed_with(late: Late) -> tuple[float, dict[str, Array]]:
        """Return the share of the rates that a loop misses where some sensors are late, and its motion."""
        moved = _flown(maneuver, lines, late)
        rates = {n: logged_late(moved[n], record.dt, late[RATES]) for n in RATES if n in moved}
        return share_missed(record, rates, noise) if moved else np.inf, moved

    late = dict.fromkeys(_SENSORS, 0.0)
    missed, found = missed_with(late)
    if not found:
        return {}
    for step in _STEPS if missed < rival else ():
        better = True
        while better:
            better = False
            for group in _SENSORS:
                for one in (step, -step):
                    other = {**late, group: late[group] + one}
                    if abs(other[group]) > _LATEST:
                        continue
                    now, moved = missed_with(other)
                    if now < missed:
                        missed, late, found, better = now, other, moved, True
                        break
    found = with_attitude_and_felt(_earlier(record, late), found, linear=True)
    return {
        n: logged_late(x, record.dt, next((late[g] for g in late if n in g), 0.0)) for n, x in found.items()
    }


def _flown(maneuver: Maneuver, lines: Lines, late: Late) -> dict[str, Array]:
    """Return a loop's motion and effectors where some sensors are late, s; empty where none can be fitted.

    As the aircraft moved, not as these sensors say.
    """
    record = _earlier(maneuver.record, late)
    moving = tuple(n for n in record.group("effector") if np.ptp(record[f"effector/{n}"]) > 0)
    hz = lines.hz[lines.driven] if lines.driven.any() else lines.hz[1:]
    settings = Identification(regressors=(*MOTION, *moving))
    try:
        loop, driven = driven_loop(replace(maneuver, record=record), hz, settings)
    except (DataError, UsageError, ValueError):
        return {}
    names = [*(f"state/{n}" for n in MOTION), *(f"effector/{n}" for n in moving)]
    level = np.array([record[n].mean() if n in record else 0.0 for n in names])[:, None]
    motion = level + driven + _free(loop, driven, names, record)
    moved = dict(zip(names, motion, strict=True))
    rates, middle = np.array([moved[n] for n in RATES]), centre(record, maneuver.vehicle)
    for axis, name in enumerate(VELOCITY):  # from the centre of gravity to the sensor
        place = record.channel(name).position_m if name in record else None
        if place is not None:
            moved[name] = moved[name] + cross(rates, np.array(place)[:, None] - middle)[axis]
    return moved


def _earlier(record: FlightRecord, late: Late) -> FlightRecord:
    """Return a record without some delays of its sensors."""
    channels = [
        replace(record.channel(n), values=logged_late(record[n], record.dt, -x))
        for group, x in late.items()
        for n in group
        if x and n in record
    ]
    return record.with_channels(*channels) if channels else record


def _free(loop: LoopModel, driven: Array, names: list[str], record: FlightRecord) -> Array:
    """Return what the state at the record's start leaves of a loop's motion, shape (6 + n, sample).

    As it fits what the driven motion misses best, straight lines apart, each channel over its own misses.
    """
    s, shape = loop.free()
    time = record.time - record.time[0]
    whole = time[-1]
    kept = (s.real * whole < np.log(_GROWTH)) & (np.abs(s) * whole > 2 * np.pi * _SLOWEST)
    kept &= (np.abs(s) * record.dt < 1) & (s.imag >= 0)
    s, shape = s[kept], shape[:, kept]
    waves = shape[:, :, None] * np.exp(s[:, None] * time)
    columns = np.concatenate([waves.real, -waves.imag[:, s.imag > 0]], axis=1)  # (channel, column, sample)
    there = [i for i, n in enumerate(names) if n in record]
    missed = np.array([record[names[i]] for i in there]) - driven[there]
    line = np.linalg.qr(np.vander(time / whole, 2))[0]
    missed, seen = (x - (x @ line) @ line.T for x in (missed, columns[there]))
    size = missed.std(axis=1)
    moves = size > 0
    if not s.size or not moves.any():
        return np.zeros_like(driven)
    seen, missed = seen[moves] / size[moves, None, None], missed[moves] / size[moves, None]
    gram, moment = (seen @ seen.swapaxes(1, 2)).sum(axis=0), (seen @ missed[:, :, None]).sum(axis=0)[:, 0]
    weights = np.linalg.lstsq(gram, moment, rcond=1e-10)[0]
    return np.einsum("ncs,c->ns", columns, weights)

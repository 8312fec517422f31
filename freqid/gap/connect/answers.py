"""Checks of what a user's simulation returns, before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import RESPONSE, STATE
from freqid.core.errors import DataError, nearest
from freqid.core.record import FlightRecord

KNOWN = {**RESPONSE, **STATE}

_DIVERGED = 100.0
"""Of a channel's largest value in the record, or of one SI unit: a flight beyond this is none any more."""


def stacked(
    found: Any, time: Array, where: str, expected: Sequence[str] = ()
) -> tuple[tuple[str, ...], Array]:
    """Return the names and the rows of a dictionary of predicted responses.

    Parameters
    ----------
    found : object
        Should be a dictionary of arrays of the record's length.
    time : ndarray, shape (sample,)
    where : str
        Which simulation, for errors.
    expected : sequence of str, optional
        Names that must be there, and their order; all that are there where empty.

    Returns
    -------
    names : tuple of str
        Among the record's responses and states.
    rows : ndarray, shape (response, sample)

    Raises
    ------
    DataError
        Where it is no dictionary, is empty, has a name that no channel has, lacks one, or an array has
        another shape, no numbers, or is not finite.
    """
    if not isinstance(found, Mapping):
        raise DataError(
            f"the simulation returned {type(found).__name__}, expected a dictionary of arrays by response",
            where=where,
            remedy='return {"X": array, ...}',
        )
    for name in found:
        if name not in KNOWN:
            raise DataError(
                f"the simulation returned '{name}', which is no response and no state",
                where=where,
                remedy=nearest(str(name), KNOWN),
            )
    names = tuple(expected) or tuple(found)
    if not names:
        raise DataError("the simulation returned no response", where=where, remedy="return at least one")
    missing = [name for name in names if name not in found]
    if missing:
        raise DataError(
            f"the simulation returned no '{missing[0]}', which it says it predicts",
            where=where,
            remedy=f"it returned {', '.join(map(str, found)) or 'nothing'}",
        )
    return names, np.array([row(found[name], name, time, where) for name in names])


def row(values: Any, name: str, time: Array, where: str) -> Array:
    """Return one predicted signal, shape (sample,); a single number is held. Errors as in `stacked`."""
    try:
        given = np.asarray(values)
        found = np.asarray(np.real(given), dtype=float)
    except (TypeError, ValueError):
        raise DataError(
            f"what the simulation returned as '{name}' is no array of numbers but {type(values).__name__}",
            where=where,
            remedy=f"return one number a sample, an array of shape {time.shape}",
        ) from None
    if np.iscomplexobj(given):
        raise DataError(
            f"what the simulation returned as '{name}' is complex, expected real numbers",
            where=where,
            remedy="return the real part if that is what is meant",
        )
    if found.ndim == 0:
        found = np.full(time.shape, float(found))
    if found.shape != time.shape:
        raise DataError(
            f"what the simulation returned as '{name}' has shape {found.shape}, expected {time.shape}",
            where=where,
            remedy="return one number for each sample of `time`",
        )
    bad = np.flatnonzero(~np.isfinite(found))
    if bad.size:
        raise DataError(
            f"what the simulation returned as '{name}' is not finite in {bad.size} of {time.size} samples, "
            f"first at t = {time[bad[0]]:.4g} s",
            where=where,
            remedy="check what it does with the states and positions of that time",
        )
    return found


def signals(returned: Any, time: Array, names: Mapping[str, str | None], where: str) -> dict[str, Array]:
    """Return a dictionary of signals, checked.

    Parameters
    ----------
    returned : object
        Should be a dictionary of arrays of the record's length.
    time : ndarray, shape (sample,)
    names : dict of str
        Names that may be there, with another name that each gets, or None.
    where : str
        Which function, for errors.

    Raises
    ------
    DataError
        Where it is no dictionary, has an unknown name, or an array as in `stacked`.
    """
    if not isinstance(returned, Mapping):
        raise DataError(
            f"it returned {type(returned).__name__}, expected a dictionary of arrays by name",
            where=where,
            remedy='return {"q": array, ...}, one number a sample',
        )
    out: dict[str, Array] = {}
    for name, values in returned.items():
        if name not in names:
            raise DataError(
                f"it returned '{name}', which is no channel of the record or the vehicle",
                where=where,
                remedy=nearest(str(name), names),
            )
        out[names[name] or name] = row(values, str(name), time, where)
    return out


def check_moving(names: Sequence[str], rows: Array, record: FlightRecord, where: str) -> None:
    """Refuse responses that are all constant on a record that moves.

    Parameters
    ----------
    names : sequence of str
    rows : ndarray, shape (response, sample)
    record : FlightRecord
    where : str

    Raises
    ------
    DataError
    """
    if rows.shape[1] < 2 or np.ptp(rows, axis=1).any() or not _moves(record, ("effector",)):
        return
    raise DataError(
        f"the simulation returned the constant {rows[0, 0]:.4g} as '{names[0]}', and nothing that moves, "
        "while effectors of the record move",
        where=where,
        remedy="compute the responses from state and effector, sample by sample",
    )


def check_flight(flight: Mapping[str, Array], record: FlightRecord, where: str) -> None:
    """Refuse a flight that diverges, or stands still while the record's inputs move.

    Parameters
    ----------
    flight : dict of ndarray, shape (sample,)
        States by name; effectors and commands as ``group/name``.
    record : FlightRecord
    where : str

    Raises
    ------
    DataError
        With the time.
    """
    remedy = "give it a control law or smaller inputs, or leave out fly: then its linearised motion is used"
    states = {n: x for n, x in flight.items() if "/" not in n}
    if not states:
        raise DataError("it returned no state", where=where, remedy="return states by name, such as 'q'")
    for name, values in states.items():
        flown = np.abs(record[f"state/{name}"]).max() if f"state/{name}" in record else 1e3
        beyond = np.flatnonzero(np.abs(values) > _DIVERGED * max(1.0, float(flown)))
        if beyond.size:
            k = beyond[0]
            raise DataError(
                f"the simulation's own flight diverges: {name} is {values[k]:.3g} {KNOWN[name][0]} "
                f"at t = {record.time[k]:.4g} s",
                where=where,
                remedy=remedy,
            )
    changes = np.any([np.diff(x) != 0 for x in states.values()], axis=0)
    last = int(np.flatnonzero(changes)[-1]) + 1 if changes.any() else 0
    injected = "excitation" if record.group("excitation") else "command"
    if last < record.time.size - 2 and _moves(record, (injected,), last):
        raise DataError(
            f"the simulation's own flight stands still from t = {record.time[last]:.4g} s on, while the "
            "record's inputs move",
            where=where,
            remedy=remedy,
        )


def _moves(record: FlightRecord, groups: Sequence[str], start: int = 0) -> bool:
    """Return whether any channel of some groups changes from a sample on."""
    return any(np.ptp(record[f"{g}/{n}"][start:]) > 0 for g in groups for n in record.group(g))

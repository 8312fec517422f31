"""Derivatives of a simulation that can only be asked again: central differences along a record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, VELOCITY
from freqid.core.record import FlightRecord
from freqid.dynamics.frames import flow_angles

_SHARE = 0.1  # of a channel's rms about its mean that is stepped
_LEAST = 1e-4  # of its size, or of one unit, for a channel that stands still


def central(predict: Callable[[FlightRecord], Array], record: FlightRecord, inputs: Sequence[str]) -> Array:
    """Return the derivatives of a prediction by channels, shape (response, input, sample).

    Parameters
    ----------
    predict : callable
        ``predict(record)``, shape (response, sample).
    record : FlightRecord
    inputs : sequence of str
        Channels; each is stepped over the whole record, air data along with the velocities they follow.

    Raises
    ------
    DataError
        Where the record lacks a channel.
    """
    columns = []
    for name in inputs:
        step = size(record[name])
        above, below = (predict(moved(record, name, sign * step)) for sign in (1, -1))
        columns.append((above - below) / (2 * step))
    return np.stack(columns, axis=1)


def by_parameters(
    predict: Callable[..., Array],
    record: FlightRecord,
    sizes: Mapping[str, float],
    about: Mapping[str, float] | None = None,
) -> Array:
    """Return half the difference between predictions with each parameter above and below.

    Parameters
    ----------
    predict : callable
        ``predict(record, departures=...)``, shape (response, sample).
    record : FlightRecord
    sizes : dict of float
        By parameter.
    about : dict of float, optional
        Departures from nominal, about which these are; nominal where absent.

    Returns
    -------
    ndarray, shape (parameter, response, sample)
    """
    at, changes = dict(about or {}), []
    for name, x in sizes.items():
        above, below = (
            predict(record, departures={**at, name: at.get(name, 0.0) + sign * x}) for sign in (1, -1)
        )
        changes.append((above - below) / 2)
    return np.array(changes)


def size(values: Array) -> float:
    """Return by how much a channel is stepped, in its unit."""
    return max(_SHARE * float(values.std()), _LEAST * max(1.0, float(np.abs(values).max())))


def moved(record: FlightRecord, name: str, step: float) -> FlightRecord:
    """Return a record with one channel changed by a constant, and the air data that follow from it."""
    channel = record.channel(name)
    changed = {name: channel.values + step}
    if name in VELOCITY and all(n in record for n in VELOCITY):
        before = record.matrix(VELOCITY)
        after = before.copy()
        after[VELOCITY.index(name)] += step
        change = np.subtract(flow_angles(after), flow_angles(before))
        changed |= {n: record[n] + row for n, row in zip(FLOW, change, strict=True) if n in record}
    if "air/qbar" in record and "air/V" in record and "air/rho" in record and name != "air/qbar":
        rho, speed = (changed.get(n, record[n]) for n in ("air/rho", "air/V"))
        old = record["air/rho"] * record["air/V"] ** 2
        changed["air/qbar"] = record["air/qbar"] + (rho * speed**2 - old) / 2
    return record.with_channels(*(replace(record.channel(n), values=v) for n, v in changed.items()))

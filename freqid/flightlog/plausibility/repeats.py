"""Channels that repeat their samples: frozen for a while, latched at a lower rate, constant throughout."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import FLOW, FORCES, RATES, VELOCITY
from freqid.core.record import FlightRecord
from freqid.flightlog.plausibility.finding import Finding

SENSORS = (*RATES, *FORCES, *VELOCITY, *FLOW, "state/phi", "state/theta")
"""Channels that no aircraft in flight holds still; others may rest."""
LONGER = 10.0  # times the usual run: a frozen sensor is not one that changes seldom
MOST_FROZEN = 0.01  # of the record that a frozen stretch may last and cost no more than itself
LEAST_S, LEAST_SAMPLES = 0.25, 10  # of a run that counts as frozen
STEPS = 3.0  # times the smallest changes (their 5 % quantile) that half of all are, at least, unless coarse
USUAL = 0.99  # quantile of the runs' lengths that is called usual
MOVING = 0.5  # share of the other sensors that must change meanwhile: else it is the log that stands still
CHANGES = 20  # changes needed to tell a rate
REGULAR = 0.9  # share of the intervals between changes that are as a latch makes them
SLOWER = 0.75  # of the claimed rate, from which on a channel is called latched


def stuck(record: FlightRecord) -> Iterator[Finding]:
    """Yield sensors that stop changing for much longer than they ever do, while others go on.

    Notes
    -----
    Noise and resolution decide how often a healthy sensor repeats a sample, so a run of equal samples is
    held against the channel's own other runs, and not against a fixed time. A channel that moves by single
    steps of its resolution may rest in calm air; it is not judged.
    """
    moving = [name for name in SENSORS if name in record and np.ptp(record[name]) > 0]
    for name in moving:
        start, length = _runs(record[name])
        usual = float(np.quantile(length, USUAL, method="inverted_cdf")) if length.size > 100 else 1.0
        usual = max(usual, float(np.median(length)))
        longest = int(np.argmax(length))
        count = int(length[longest])
        if count < max(LONGER * usual, LEAST_SAMPLES) or count * record.dt < LEAST_S:
            continue
        if _coarse(np.abs(np.diff(record[name][start]))):
            continue
        first, last = int(start[longest]), int(start[longest]) + count - 1
        others = [n for n in moving if n != name]
        still = sum(np.ptp(record[n][first : last + 1]) == 0 for n in others)
        if not others or len(others) - still < MOVING * len(others):
            continue
        begin, end = float(record.time[first]), float(record.time[last])
        channel = record.channel(name)
        yield Finding(
            "error" if count > MOST_FROZEN * record.time.size else "warning",
            "stuck",
            (name,),
            f"'{name}' stands at {channel.values[first]:.6g} {channel.unit} in {count} samples in a row, "
            f"from t = {begin:.6g} to {end:.6g} s, where it usually repeats {usual:.0f} and "
            f"{len(others) - still} of {len(others)} other sensors move",
            f"cut the record around {begin:.4g}:{end:.4g} s with --cut, or leave '{name}' out of the map",
            {"samples": count, "usual": usual, "value": float(channel.values[first])},
            (begin, end),
        )


def constant(record: FlightRecord, explained: Mapping[str, str]) -> Iterator[Finding]:
    """Yield sensors that never change while others do.

    Parameters
    ----------
    record : FlightRecord
    explained : mapping of str to str
        What other channels say that such a channel should do, by its name; it is then an error.
    """
    present = [name for name in SENSORS if name in record]
    still = [name for name in present if np.ptp(record[name]) == 0]
    if len(still) > MOVING * len(present):
        return
    for name in still:
        channel = record.channel(name)
        yield Finding(
            "error" if name in explained else "warning",
            "stuck",
            (name,),
            f"'{name}' is {channel.values[0]:.6g} {channel.unit} in all {record.time.size} samples"
            + (f", although {explained[name]}" if name in explained else ", expected a sensor to move"),
            f'correct column of [[channel]] name = "{name}" in the map, or leave it out',
            {"samples": record.time.size, "value": float(channel.values[0])},
        )


def latched(record: FlightRecord) -> Iterator[Finding]:
    """Yield channels whose values are repeated at a higher rate than they change.

    Notes
    -----
    A latch changes at intervals that differ by no more than one sample, and by many steps of the channel's
    resolution; a quantised channel that hardly moves changes now and then, by one step.
    """
    for name, channel in record.channels.items():
        if name.startswith(("excitation/", "response/")):
            continue
        moved = channel.values[1:] != channel.values[:-1]
        changes = np.count_nonzero(moved)
        # Most channels change with every sample; told at once, as arrays of a long log fill the memory.
        if changes < CHANGES or 2 * np.count_nonzero(moved[1:] & moved[:-1]) > changes:
            continue
        at = np.flatnonzero(moved)
        between = np.diff(at)
        usual = float(np.median(between))
        if usual < 1 / SLOWER or _coarse(np.abs(channel.values[at + 1] - channel.values[at])):
            continue
        regular = float(np.mean(np.abs(between - usual) <= 1.0))
        rate = 1 / (record.dt * float(np.mean(between[np.abs(between - usual) <= 1.0])))
        if regular < REGULAR or rate > SLOWER * channel.native_rate_hz:
            continue
        yield Finding(
            "warning",
            "latched",
            (name,),
            f"'{name}' changes {rate:.4g} times a second, at regular intervals, but claims to be logged at "
            f"{channel.native_rate_hz:.4g} Hz",
            f'set rate_hz = {rate:.3g} of [[channel]] name = "{name}" in the map',
            {"rate_hz": rate, "claimed_hz": channel.native_rate_hz, "regular": regular},
        )


def _coarse(size: NDArray[np.float64]) -> bool:
    """Tell whether changes are mostly single steps of the resolution: of noise, half are 10 times the 5 %."""
    return bool(np.median(size) < STEPS * np.quantile(size, 0.05))


def _runs(x: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return starts and lengths of the runs of equal samples."""
    start = np.concatenate(([0], np.flatnonzero(np.diff(x)) + 1))
    return start, np.diff(start, append=x.size)

"""Injected multisines found again in a record: their period, their lines, and what is measured on these."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, Maneuver
from freqid.identify.loads.explanatory import history
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.model.line_equations import plan_of
from freqid.identify.response.local_response import ResponseLines
from freqid.identify.spectra.fourier import FourierPlan
from freqid.identify.spectra.trend import remove_trend

EXCITED = 0.03  # of an injected signal's largest harmonic: below, a line is not its own
# Noise lines beyond the outermost harmonics, which keep the ends' windows from being one-sided.
_MARGIN = 4
_SAME_PERIOD = 0.02  # share of a signal's power that repeats of a period may differ by, fades included


def injected_signals(record: FlightRecord) -> tuple[str, ...]:
    """Return the effectors that a record's injected signals excite."""
    return tuple(n for n in record.group("excitation") if np.ptp(record[f"excitation/{n}"]) > 0)


def repeated_period(signals: Array, dt: float) -> float | None:
    """Return the period that signals repeat after, s; None where they do not.

    Parameters
    ----------
    signals : ndarray, shape (m, sample)
    dt : float
        s.
    """
    x = signals / np.maximum(np.sqrt(np.mean(signals**2, axis=1, keepdims=True)), 1e-300)
    n = x.shape[1]
    spectrum = np.sum(np.abs(np.fft.rfft(x, 2 * n)) ** 2, axis=0)
    product = np.fft.irfft(spectrum, 2 * n)[:n]
    energy = np.cumsum(np.sum(x**2, axis=0))
    lag = np.arange(n - 1)
    front, back = energy[n - 1 - lag], energy[-1] - np.concatenate([[0.0], energy])[lag]
    differing = 1 - 2 * product[lag] / np.maximum(front + back, 1e-300)
    away = np.flatnonzero(differing > 0.5)  # past the neighbourhood of no shift at all
    if not away.size:
        return None
    # at least half a period has to be repeated for the repeat to say anything
    same = np.flatnonzero((differing < _SAME_PERIOD) & (lag > away[0]) & (lag < 0.75 * n))
    if not same.size:
        return None
    first = same[: np.argmax(np.diff(same, append=same[-1] + 2) > 1) + 1]
    return float(dt * first[np.argmin(differing[first])])


def period_of(record: FlightRecord) -> float:
    """Return the period after which a record's injected signals repeat, s.

    Raises
    ------
    DataError
        Where they do not.
    """
    found = repeated_period(record.matrix(f"excitation/{n}" for n in injected_signals(record)), record.dt)
    if found is None:
        raise DataError(
            "the injected signals do not repeat in the record, so their period is not known",
            remedy="state the period, or the scenario that the inputs were designed with",
        )
    return found


def output_history(maneuver: Maneuver, name: str) -> tuple[Array, Array]:
    """Return an output as ``direct + d(momentum)/dt``, shape (sample,) each, SI units."""
    if name in WRENCH:
        wrench = applied_wrench(maneuver, (name,))
        return wrench.direct[0], wrench.momentum[0]
    values = maneuver.record[name] if "/" in name else history(maneuver, name)
    return values, np.zeros_like(values)


def injected_lines(
    maneuver: Maneuver,
    number: int,
    excited: tuple[str, ...],
    group: str,
    outputs: Sequence[str],
    period_s: float,
) -> ResponseLines:
    """Return one record's transforms on the lines of whole periods, the last ones that are excited.

    Parameters
    ----------
    maneuver : Maneuver
    number : int
        Of the record, for `Lines`.
    excited : tuple of str
        Effectors with injected signals, in this record or in another.
    group : {"effector", "command"}
        Of the inputs.
    outputs : sequence of str
        As in `output_history`.
    period_s : float

    Raises
    ------
    DataError
        Where a channel is missing, or the signals last less than a period.
    """
    record, dt = maneuver.record, maneuver.record.dt
    r = np.zeros((len(excited), record.time.size))
    for row, n in zip(r, excited, strict=True):
        if f"excitation/{n}" in record:
            row[:] = record[f"excitation/{n}"]
    active = np.flatnonzero(np.any(r != 0, axis=0))
    last = min(int(active[-1]) + 1, record.time.size - 1)  # signals end at zero, on the period
    periods = int((last - active[0] + 2) * dt / period_s + 1e-6)
    if periods < 1:
        raise DataError(
            f"the injected signals last {(last - active[0]) * dt:.6g} s, less than their period, "
            f"{period_s:g} s",
            remedy="use the whole manoeuvre, or state the period that was flown",
        )
    span = periods * period_s
    first = max(last - round(span / dt), 0)
    kept = slice(first, last + 1)
    u = record.matrix(f"{group}/{n}" for n in excited)
    direct, momentum = map(np.array, zip(*(output_history(maneuver, n) for n in outputs), strict=True))
    # a plain sum is exact for what is periodic; end corrections would leak a little of all lines into each
    size = np.fft.rfft(r[:, first:last])[:, periods::periods]
    numbers = periods * np.arange(1, size.shape[1] + 1)
    large = np.abs(size) > EXCITED * np.abs(size).max(axis=1, keepdims=True)
    # an effector that rests in this record has no lines of its own here
    large &= np.any(r[:, kept] != 0, axis=1)[:, None]
    mine = numbers[large.any(axis=0)]
    lines = np.arange(max(mine[0] - _MARGIN, 1), min(mine[-1] + _MARGIN, int(0.499 * span / dt)) + 1)
    # harmonics that carry little are neither excited nor free of what is not linear
    faint = (lines % periods == 0) & ~np.isin(lines, mine)
    lines = lines[~faint] if periods > 1 else lines[np.isin(lines, mine)]
    f = lines / span
    scale = 1 / np.sqrt(span)
    plan = plan_of(last + 1 - first, dt, tuple(f.tolist()))
    z = _transform(plan, direct[:, kept])
    if momentum.any():
        z = z + plan.derivative(remove_trend(momentum[:, kept], dt, "endpoints").x)
    member = np.zeros((len(excited), f.size), dtype=bool)
    for row, power in zip(member, large, strict=True):
        row[:] = np.isin(lines, numbers[power])
    return ResponseLines(
        hz=f,
        record=np.full(f.size, number),
        excited=member,
        r=scale * plan(r[:, kept]),
        u=scale * _transform(plan, u[:, kept]),
        y=scale * z,
    )


def _transform(plan: FourierPlan, x: Array) -> NDArray[np.complex128]:
    return plan(remove_trend(x, plan.dt, "line").x)

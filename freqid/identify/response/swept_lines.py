"""Responses at one frequency from sweeps and other transient inputs, on the lines of whole records.

A sweep starts and ends at rest, so that the transform of the whole stretch has no leakage: ``U = G_ur R`` and
``Y = G_yr R`` at every line. Windows cut the sweep and leak at the lowest octave, whatever their weights.
Polynomial terms for transients, right for multisines, cannot be told from a sweep's smooth spectrum. The
closed loop's responses to the injected signal are well damped, so these are taken as polynomials, not those
of the aircraft (docs/theory/frequency-response.md, benchmarks/sweeps.py).

References
----------
R. Pintelon, J. Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., Wiley, 2012,
sec. 2.6 (closed loop: both sides' responses to the reference) and ch. 7 (local polynomials).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array, Complex
from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.identify.response.injected_lines import output_history
from freqid.identify.response.local_response import (
    LEAST_FREEDOM,
    SINGULAR,
    LocalResponse,
    ResponseLines,
    coherences,
    scaled,
    terms,
)

RELATIVE_WIDTH = 0.16
"""Width of a window over its frequency. Narrower where the record's lines are few."""

TAIL = 0.5  # of a sweep's length that is kept after it at most: responses die out, noise goes on
_REST_S = 0.5  # s, at either end of a stretch, whose mean is taken as its level there
DRIFT = 0.1
"""Share of its range by which a channel's level may differ between both ends of a stretch. What is left of a
response that dies out is less; a channel that integrates the input ends up elsewhere by more."""

SWEPT = 0.05
"""Of an injected signal's largest line: below, a sweep is taken not to excite a frequency."""


def stretches(signals: Array) -> list[slice]:
    """Return the samples of each sweep, from its start to where the next one starts, or shortly after it.

    Parameters
    ----------
    signals : ndarray, shape (m, sample)
        Injected signals. Those that overlap share a stretch.
    """
    active = np.any(signals != 0, axis=0)
    spans = [(int(on[0]), int(on[-1])) for row in signals if (on := np.flatnonzero(row)).size]
    merged: list[list[int]] = []
    for first, last in sorted(spans):
        if merged and first <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], last)
        else:
            merged.append([first, last])
    starts = [first for first, _ in merged[1:]] + [active.size]
    return [
        slice(max(first - 1, 0), min(after, last + 1 + int(TAIL * (last - first + 1))))
        for (first, last), after in zip(merged, starts, strict=True)
    ]


def swept_lines(
    maneuver: Maneuver,
    part: slice,
    number: int,
    injected: Array,
    group: str,
    excited: Sequence[str],
    outputs: Sequence[str],
) -> tuple[ResponseLines, NDArray[np.bool_]]:
    """Return the transforms of one stretch on its lines, multiples of one over its length, and what drifts.

    Parameters
    ----------
    maneuver : Maneuver
    part : slice
        One of `stretches`.
    number : int
        Of the stretch, for `ResponseLines`.
    injected : ndarray, shape (m, sample)
        Of the whole record.
    group : {"effector", "command"}
    excited : sequence of str, length m
    outputs : sequence of str
        As in `output_history`.

    Returns
    -------
    lines : ResponseLines
    drifting : ndarray of bool, shape (o,)
        Outputs that end elsewhere than they began.

    Notes
    -----
    From a channel that drifts the line through the levels at both ends is removed: where it integrates the
    input, as a heading may, that is the exact correction of its finite transform.
    """
    record = maneuver.record
    samples = record.time[part].size
    dt, length = record.dt, samples * record.dt
    k = np.arange(1, (samples - 1) // 2 + 1)
    hz = k / length
    scale = dt / np.sqrt(length)

    def transform(rows: Array) -> Complex:
        return np.asarray(
            scale * np.fft.rfft(_level(rows[:, part], dt)[0], axis=1)[:, k], dtype=np.complex128
        )

    direct, momentum = map(np.array, zip(*(output_history(maneuver, n) for n in outputs), strict=True))
    r = np.asarray(scale * np.fft.rfft(injected[:, part], axis=1)[:, k], dtype=np.complex128)
    large = np.abs(r) > SWEPT * np.abs(r).max(axis=1, keepdims=True)
    for row in large:  # dips between are excited too
        if row.any():
            on = np.flatnonzero(row)
            row[on[0] : on[-1] + 1] = True
    lines = ResponseLines(
        hz=hz,
        record=np.full(hz.size, number),
        excited=large,
        r=r,
        u=transform(record.matrix(f"{group}/{n}" for n in excited)),
        y=transform(direct) + 2j * np.pi * hz * transform(momentum),
    )
    return lines, _level(direct[:, part], dt)[1]


def swept_response(lines: ResponseLines, at_hz: float, order: int) -> LocalResponse:
    """Solve for the responses at one frequency.

    Parameters
    ----------
    lines : ResponseLines
        With as many inputs as injected signals.
    at_hz : float
    order : int
        Degree of the polynomials in frequency.

    Raises
    ------
    DataError
        Where there are not lines enough, or the injected signals do not move the inputs apart.

    Notes
    -----
    ``[U; Y] = sum_p G_p R (f - f0)^p + V``, least squares, then ``G = G_y G_u^-1``. To first order its error
    is that of ``V_y - G V_u``, whose power the residual of ``Y - G U`` gives, with as many degrees of freedom
    as there are more lines than unknowns.
    """
    chosen, x = _window(lines, at_hz, order)
    r, u, y = lines.r[:, chosen], lines.u[:, chosen], lines.y[:, chosen]
    columns, size = scaled(r)
    columns = terms(columns, x ** np.arange(order + 1)[:, None])
    inverse = np.asarray(np.linalg.pinv(columns, rcond=SINGULAR), dtype=np.complex128)
    dual = inverse[:, np.arange(len(r)) * (order + 1)] / size
    moved = u @ dual
    if np.linalg.cond(moved / np.maximum(np.abs(moved).max(axis=1, keepdims=True), 1e-300)) > 1 / SINGULAR:
        raise DataError(
            f"the injected signals do not move the inputs apart near {at_hz:.4g} Hz",
            remedy="sweep one input after the other, at rest between, or leave out inputs that follow others",
        )
    dual = np.asarray(np.linalg.solve(moved.T, dual.T).T, dtype=np.complex128)
    value = y @ dual
    error = y - value @ u
    left = error - (error @ inverse) @ columns
    freedom = float(chosen.size - np.linalg.matrix_rank(columns, tol=SINGULAR))
    noise = np.sum(np.abs(left) ** 2, axis=1) / freedom
    coherence, partial = coherences(lines, chosen, columns, inverse, order + 1, value, noise)
    variance = noise[:, None] * np.sum(np.abs(dual) ** 2, axis=0)
    density = (order + 1) / np.ptp(lines.hz[chosen])
    return LocalResponse(value, variance, freedom, coherence, partial, np.full(len(y), np.nan), density)


def _window(lines: ResponseLines, at_hz: float, order: int) -> tuple[NDArray[np.int64], Array]:
    """Return the lines near a frequency in every stretch, and their distance, at most one in size."""
    near = []
    for number in np.unique(lines.record):
        mine = np.flatnonzero(lines.record == number)
        driving = int(lines.excited[:, mine].any(axis=1).sum())
        distance = np.abs(lines.hz[mine] - at_hz)
        least = (order + 1) * driving + LEAST_FREEDOM
        count = max(least, int(np.sum(distance <= 0.5 * RELATIVE_WIDTH * at_hz)))
        if mine.size < least:
            raise DataError(
                f"a sweep of {1 / lines.hz[mine[0]]:.4g} s has {mine.size} lines, of which polynomials of "
                f"degree {order} need {least}",
                remedy="lower the order, or fly longer sweeps",
            )
        near.append(mine[np.argsort(distance, kind="stable")[:count]])
    chosen = np.concatenate(near)
    away = lines.hz[chosen] - at_hz
    return chosen, away / np.abs(away).max()


def _level(rows: Array, dt: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return rows without their first level, without the line to the last where they drift, and which do."""
    samples = rows.shape[1]
    count = min(max(round(_REST_S / dt), 1), samples // 4 or 1)
    first, last = rows[:, :count].mean(axis=1), rows[:, -count:].mean(axis=1)
    drifting = np.abs(last - first) > DRIFT * np.ptp(rows, axis=1)
    rise = np.where(drifting, last - first, 0.0)
    middle = 0.5 * (count - 1)
    slope = rise / (samples - 1 - 2 * middle)
    return rows - first[:, None] - slope[:, None] * (np.arange(samples) - middle), drifting

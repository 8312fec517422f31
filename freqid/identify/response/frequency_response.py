"""Frequency responses from flown manoeuvres: many inputs at once from multisines, one from a sweep.

Under feedback the inputs follow sensor noise and gusts, and ratios of spectra mistake the inverse of the
control law for the aircraft. What the injected signals explain of both sides is free of that
(docs/theory/frequency-response.md).

Short windows give many averages, long ones reach low frequencies; at each frequency they are weighted by
their random errors.

References
----------
M. B. Tischler, R. K. Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., AIAA, 2012, ch. 7
(windowed spectra, random error) and ch. 10 (composite windows; here their weighted mean).
J. S. Bendat, A. G. Piersol, *Random Data*, 4th ed., Wiley, 2010, sec. 9.2 (errors of frequency responses).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from freqid.core.arrays import Array
from freqid.core.channels import RESPONSE, WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.identify.loads.explanatory import unit_of
from freqid.identify.response.injected_lines import injected_lines, injected_signals, period_of
from freqid.identify.response.local_response import ResponseLines, local_response
from freqid.identify.spectra.fourier import FourierPlan

ORDER = 2
"""Degree of the polynomials in frequency; two follow a resonance that spans a few lines."""


def estimate_frequency_response(
    maneuvers: Sequence[Maneuver],
    inputs: Sequence[str] | None,
    outputs: Sequence[str],
    *,
    period_s: float | None = None,
    band_hz: tuple[float, float] | None = None,
    order: int = ORDER,
    poles: int = 0,
    lines: int | None = None,
) -> FrequencyResponse:
    """Estimate the responses to all effectors that orthogonal multisines excite.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
        At one condition, with the injected signals in their group ``excitation``.
    inputs : sequence of str, optional
        Effectors, whose positions are the inputs, or ``command/<name>``; all that are excited where absent.
        The others are inputs all the same, so that what feedback makes of them is told apart.
    outputs : sequence of str
        X Y Z L M N as reconstructed, channels as ``state/q``, or regressors as ``q`` and ``alpha``.
    period_s : float, optional
        Of the multisines; found in the injected signals where absent.
    band_hz : tuple of 2 floats, optional
        Frequencies that are returned, all excited lines where absent.
    order : int
        Degree of the local polynomials.
    poles : int
        Degree of a local denominator that all inputs share, 0 for none; two where signals have few lines and
        the aircraft has resonances between them.
    lines : int, optional
        Lines of each injected signal that a window takes in; ``order + 2`` where absent.

    Returns
    -------
    FrequencyResponse
        On the lines that are excited; nan beyond the outermost lines of an input's signal.

    Raises
    ------
    UsageError
        Where records hold no injected signals, or an input is none that is excited.
    DataError
        Where a channel is missing, no period is found, or lines are too few.
    """
    excited = _excited(maneuvers)
    group, asked = _inputs(inputs, excited, maneuvers[0].record)
    if order < 0 or poles < 0:
        raise UsageError(f"the order is {order} with {poles} poles, expected 0 or more")
    parts = [
        injected_lines(m, i, excited, group, outputs, period_s or period_of(m.record))
        for i, m in enumerate(maneuvers)
    ]
    joined = ResponseLines(
        *(
            np.concatenate([getattr(part, name) for part in parts], axis=-1)
            for name in ("hz", "record", "excited", "r", "u", "y")
        )
    )
    some = joined.excited.any(axis=0)
    low, high = band_hz or (0.0, np.inf)
    at = np.unique(np.round(joined.hz[some], 12))
    at = at[(at >= low - 1e-9) & (at <= high + 1e-9)]
    if not at.size:
        raise DataError(f"no line between {low:g} and {high:g} Hz is excited")
    found = [local_response(joined, f, order, lines or order + 2, poles) for f in at]
    ends = np.array([(joined.hz[row].min(), joined.hz[row].max()) for row in joined.excited])
    # half the mean spacing beyond the last line is still interpolation as polynomials go
    count = joined.excited.sum(axis=1) / len(maneuvers)
    reach = 0.5 * (ends[:, 1] - ends[:, 0]) / np.maximum(count - 1, 1) + 1e-9
    inside = (at >= (ends[:, 0] - reach)[:, None]) & (at <= (ends[:, 1] + reach)[:, None])
    known = np.where(inside, 1.0, np.nan)
    freedom = np.array([one.degrees_of_freedom for one in found])
    result = FrequencyResponse(
        inputs=excited,
        outputs=tuple(outputs),
        input_units=tuple(maneuvers[0].record.channel(f"{group}/{n}").unit for n in excited),
        output_units=tuple(_output_unit(maneuvers[0], n) for n in outputs),
        frequencies_hz=at,
        value=np.stack([one.value for one in found], axis=-1) * known,
        std_error=np.sqrt(np.stack([one.variance for one in found], axis=-1) / 2) * known,
        degrees_of_freedom=np.tile(freedom, (len(outputs), 1)),
        coherence=np.stack([one.coherence for one in found], axis=-1) * known,
        partial_coherence=np.stack([one.partial_coherence for one in found], axis=-1) * known,
        misfit=np.stack([one.misfit for one in found], axis=-1),
        method="multisine",
        remarks=_remarks(maneuvers, excited, group),
    )
    return result.of(asked, tuple(outputs))


def _output_unit(maneuver: Maneuver, name: str) -> str:
    if name in WRENCH:
        return RESPONSE[name][0]
    return maneuver.record.channel(name).unit if "/" in name else unit_of(maneuver, name)


def _excited(maneuvers: Sequence[Maneuver]) -> tuple[str, ...]:
    found = tuple(dict.fromkeys(n for m in maneuvers for n in injected_signals(m.record)))
    if not found:
        raise UsageError(
            "responses under feedback need the injected signals, but the records hold none in "
            "excitation/<effector>",
            remedy="import them with the log, or estimate one input's response by windows",
        )
    return found


def _inputs(
    inputs: Sequence[str] | None, excited: tuple[str, ...], record: FlightRecord
) -> tuple[str, tuple[str, ...]]:
    """Return the group that inputs are of, and the names of those asked for."""
    names, groups = [], set()
    for name in inputs or ():
        group, _, bare = name.rpartition("/")
        if bare not in excited:
            raise UsageError(
                f"input '{name}' has no injected signal, which its response needs",
                remedy=f"choose among {', '.join(excited)}",
            )
        if group not in ("", "effector", "command"):
            raise UsageError(
                f"input '{name}' is of group '{group}'", remedy="inputs are effectors or command/<name>"
            )
        names.append(bare)
        groups.add(group)
    if len(groups) > 1:
        raise UsageError("inputs mix positions and commands", remedy="ask for one kind at a time")
    group = (groups or {""}).pop()
    if not group:
        group = "effector" if all(f"effector/{n}" in record for n in excited) else "command"
    return group, tuple(names) or excited


def _remarks(maneuvers: Sequence[Maneuver], excited: tuple[str, ...], group: str) -> tuple[str, ...]:
    """Say which effectors move without a signal of their own: theirs is counted for the others."""
    record = maneuvers[0].record
    others = [n for n in record.group(group) if n not in excited and np.ptp(record[f"{group}/{n}"]) > 0]
    if not others:
        return ()
    return (
        f"{', '.join(others)} move without an injected signal: what they do is counted for the inputs that "
        "they follow.",
    )


OVERLAP = 0.8
WINDOWS = (0.5, 0.33, 0.2, 0.12)
"""Lengths of the windows, as shares of the shortest record."""

SHORTEST = 2.0  # periods of a frequency that a window must hold to say anything about it


def window_response(
    input_: Sequence[ArrayLike],
    output: Sequence[ArrayLike],
    dt: float,
    frequencies_hz: ArrayLike,
    *,
    injected: Sequence[ArrayLike] | None = None,
    windows_s: Sequence[float] | None = None,
    names: tuple[str, str] = ("input", "output"),
    units: tuple[str, str] = ("1", "1"),
) -> FrequencyResponse:
    """Estimate the response of one output to one input.

    Parameters
    ----------
    input_, output : sequence of array_like, shape (sample,)
        Of each record.
    dt : float
        s.
    frequencies_hz : array_like, shape (M,)
        Hz, ascending; those that no window reaches are nan.
    injected : sequence of array_like, shape (sample,), optional
        Signal that was injected; with it as instrument feedback does not bias the estimate. Without it the
        response is that of least squares on the input, right where nothing is fed back.
    windows_s : sequence of float, optional
        s; `WINDOWS` of the shortest record where absent.
    names, units : tuple of 2 str
        Of input and output.

    Returns
    -------
    FrequencyResponse
        With coherence between output and input, or injected signal.

    Raises
    ------
    DataError
        Where no window reaches any of the frequencies.

    Notes
    -----
    With window i's random error ``e_i = sqrt(1 - c) / sqrt(2 n c)``, c the coherence and n the windows that
    do not overlap, spectra are averaged with weights ``(e_i / e_min)^-4``.
    """
    f = np.asarray(frequencies_hz, dtype=float)
    u, y = ([np.asarray(x, dtype=float) for x in part] for part in (input_, output))
    r = u if injected is None else [np.asarray(x, dtype=float) for x in injected]
    least = dt * min(x.size - 1 for x in u)
    lengths = windows_s or [share * least for share in WINDOWS]
    spectra, error, count = [], [], []
    for length in lengths:
        samples = round(length / dt) + 1
        reached = f * length >= SHORTEST
        if samples < 8 or not reached.any():
            continue
        found, windows = _spectra(r, u, y, dt, samples, f[reached])
        if windows < 2:
            continue
        whole = np.full((6, f.size), np.nan, dtype=complex)
        whole[:, reached] = found
        spectra.append(whole)
        count.append(sum(x.size for x in u) / samples)
        error.append(_random_error(whole, count[-1]))
    if not spectra:
        raise DataError(
            f"no window of {', '.join(f'{x:.3g}' for x in lengths)} s holds {SHORTEST:g} periods of "
            f"{f[-1]:g} Hz and fits twice into a record of {least:.4g} s",
            remedy="raise the frequencies or use longer records",
        )
    error, spectra = np.array(error), np.array(spectra)
    error = np.where(np.isfinite(error), np.maximum(error, 1e-9), np.inf)
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(np.isfinite(error), (error / error.min(axis=0)) ** -4.0, 0.0)
        weight = weight / weight.sum(axis=0)
        mean = np.nansum(weight[:, None] * np.nan_to_num(spectra), axis=0)
        mean[:, ~np.isfinite(weight).all(axis=0)] = np.nan
        rr, ru, ry, _, yy, _ = mean
        coherence = np.clip(np.abs(ry) ** 2 / (rr.real * yy.real), 0.0, 1.0)
        averages = np.sum(np.nan_to_num(weight) * np.array(count)[:, None], axis=0)
        value = ry / ru
        std = np.abs(value) * _random_error(mean, averages)
    shape = (1, 1, f.size)
    return FrequencyResponse(
        inputs=names[:1],
        outputs=names[1:],
        input_units=units[:1],
        output_units=units[1:],
        frequencies_hz=f,
        value=value.reshape(shape),
        std_error=std.reshape(shape),
        degrees_of_freedom=np.maximum(averages - 1, 1.0)[None],
        coherence=coherence.reshape(shape),
        partial_coherence=coherence.reshape(shape),
        misfit=np.full((1, f.size), np.nan),
        method="windows",
        remarks=()
        if injected is not None
        else ("Without the injected signal feedback biases this response.",),
    )


def _spectra(
    r: list[Array], u: list[Array], y: list[Array], dt: float, samples: int, f: Array
) -> tuple[NDArray[np.complex128], int]:
    """Return rr, ru, ry, uu, yy and uy of one window length, shape (6, M), and the number of windows."""
    plan = FourierPlan(samples, dt, f)
    taper = np.hanning(samples)
    step = max(round((1 - OVERLAP) * (samples - 1)), 1)
    total, windows = np.zeros((6, f.size), dtype=complex), 0
    for one in zip(r, u, y, strict=True):
        signals = np.array(one)
        signals = signals - signals.mean(axis=1, keepdims=True)
        for start in range(0, signals.shape[1] - samples + 1, step):
            R, U, Y = cast(NDArray[np.complex128], plan(signals[:, start : start + samples] * taper))
            R_ = R.conj()
            total += [R_ * R, R_ * U, R_ * Y, U.conj() * U, Y.conj() * Y, U.conj() * Y]
            windows += 1
    return np.asarray(total / max(windows, 1), dtype=np.complex128), windows


def _random_error(spectra: NDArray[np.complex128], averages: Array | float) -> Array:
    """Return the normalised random error of S_ry / S_ru, shape (M,): of the noise ``v = y - G u``."""
    rr, ru, ry, uu, yy, uy = spectra
    with np.errstate(invalid="ignore", divide="ignore"):
        G = ry / ru
        noise = np.maximum((yy - 2 * (G.conj() * uy).real + np.abs(G) ** 2 * uu).real, 0.0)
        return np.sqrt(noise * rr.real / (2 * averages)) / np.abs(ry)

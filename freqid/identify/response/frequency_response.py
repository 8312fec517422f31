"""Frequency responses from flown manoeuvres: many inputs at once by multisines, or one sweep after another.

Under feedback the inputs follow sensor noise and gusts, and ratios of spectra mistake the inverse of the
control law for the aircraft. What the injected signals explain of both sides is free of that
(docs/theory/frequency-response.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.channels import RESPONSE, WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.identify.loads.explanatory import unit_of
from freqid.identify.regress.two_stage import LEAST_STRENGTH
from freqid.identify.response.injected_lines import injected_lines, injected_signals, period_of
from freqid.identify.response.local_response import LocalResponse, ResponseLines, local_response
from freqid.identify.response.swept_lines import stretches, swept_lines, swept_response

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
        Where some records hold injected signals and others do not, a channel is missing, no period is found,
        or lines are too few.
    """
    excited = _excited(maneuvers)
    _all_hold_signals(maneuvers)
    group, asked = _inputs(inputs, excited, maneuvers[0].record)
    if order < 0 or poles < 0:
        raise UsageError(f"the order is {order} with {poles} poles, expected 0 or more")
    parts = [
        injected_lines(m, i, excited, group, outputs, period_s or period_of(m.record))
        for i, m in enumerate(maneuvers)
    ]
    joined = _joined(parts)
    at = _between(joined, band_hz)
    found = [local_response(joined, f, order, lines or order + 2, poles) for f in at]
    # half the mean spacing beyond the last line is still interpolation as polynomials go
    count = joined.excited.sum(axis=1) / len(maneuvers)
    ends = _ends(joined)
    reach = 0.5 * (ends[:, 1] - ends[:, 0]) / np.maximum(count - 1, 1) + 1e-9
    inside = (at >= (ends[:, 0] - reach)[:, None]) & (at <= (ends[:, 1] + reach)[:, None])
    units = _units(maneuvers[0], excited, group, outputs)
    remarks = _remarks(maneuvers, excited, group) + _weak(found, at, inside, excited)
    result = _result(found, at, inside, excited, outputs, units, "multisine", remarks)
    return result.of(asked, tuple(outputs))


SWEPT_FREQUENCIES = 60
"""Frequencies of a sweep's response, even on a logarithmic axis."""


def estimate_swept_response(
    maneuvers: Sequence[Maneuver],
    inputs: Sequence[str] | None,
    outputs: Sequence[str],
    *,
    band_hz: tuple[float, float] | None = None,
    order: int = ORDER,
) -> FrequencyResponse:
    """Estimate the responses to effectors swept one after the other, or moved otherwise from rest to rest.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
        At one condition. With injected signals in ``excitation`` feedback does not bias the responses; where
        no record has any, the inputs themselves take their place.
    inputs : sequence of str, optional
        As in `estimate_frequency_response`; needed where nothing is injected.
    outputs : sequence of str
    band_hz : tuple of 2 floats, optional
        What the sweeps excite where absent.
    order : int
        Degree of the local polynomials.

    Returns
    -------
    FrequencyResponse
        At `SWEPT_FREQUENCIES`; nan where an input's own sweep has no power.

    Raises
    ------
    UsageError
        Where nothing is injected and no inputs are named, or an input is none that is excited.
    DataError
        Where a channel is missing, a sweep is too short, or sweeps overlap so that inputs are not told apart.
    """
    if order < 0:
        raise UsageError(f"the order is {order}, expected 0 or more")
    remarks: tuple[str, ...]
    injects = any(injected_signals(m.record) for m in maneuvers)
    if injects:
        _all_hold_signals(maneuvers)
        excited = _excited(maneuvers)
        group, asked = _inputs(inputs, excited, maneuvers[0].record)
        remarks = _remarks(maneuvers, excited, group)
    else:
        if not inputs:
            raise UsageError(
                "the records hold no injected signals, which would say what inputs were swept",
                remedy="name the inputs with --input, or import the injected signals with the log",
            )
        group, asked = _inputs(inputs, tuple(n.rpartition("/")[2] for n in inputs), maneuvers[0].record)
        excited = asked
        remarks = ("Without the injected signals feedback biases these responses.",)
    parts, drifting, open_ = [], np.zeros(len(outputs), dtype=bool), False
    for m in maneuvers:
        record = m.record
        source = "excitation" if injects else group
        injected = np.array(
            [
                record[f"{source}/{n}"] if f"{source}/{n}" in record else np.zeros(record.time.size)
                for n in excited
            ]
        )
        cuts = stretches(injected) if injects else [slice(0, record.time.size)]
        open_ |= injects and bool(np.any(injected[:, [0, -1]]))
        injected = injected if injects else injected - injected.mean(axis=1, keepdims=True)
        for cut in cuts:
            lines, drifts = swept_lines(m, cut, len(parts), injected, group, excited, outputs)
            parts.append(lines)
            drifting |= drifts
    if open_:
        remarks += (
            "A record begins or ends while a signal is injected: the part of the response that is cut off "
            "biases the lowest frequencies.",
        )
    joined = _joined(parts)
    ends = _ends(joined)
    low, high = band_hz or (float(ends[:, 0].min()), float(ends[:, 1].max()))
    low, high = max(low, float(ends[:, 0].min())), min(high, float(ends[:, 1].max()))
    if not low < high:
        raise DataError(
            f"the sweeps excite {ends[:, 0].min():.4g} to {ends[:, 1].max():.4g} Hz, nothing of the band",
            remedy="give a band inside, or none",
        )
    at = np.geomspace(low, high, SWEPT_FREQUENCIES)
    # an output that integrates the input is steep at low frequencies; its derivative is smooth
    slope = np.where(drifting[:, None], 2j * np.pi * joined.hz, 1.0)
    joined = replace(joined, y=joined.y * slope)
    found = [swept_response(joined, f, order) for f in at]
    back = np.where(drifting[:, None, None], 1 / (2j * np.pi * at), 1.0)
    inside = (at >= ends[:, :1] * (1 - 1e-9)) & (at <= ends[:, 1:] * (1 + 1e-9))
    units = _units(maneuvers[0], excited, group, outputs)
    result = _result(found, at, inside, excited, outputs, units, "sweeps", remarks)
    result = replace(result, value=result.value * back, std_error=result.std_error * np.abs(back))
    return result.of(asked, tuple(outputs))


def _joined(parts: Sequence[ResponseLines]) -> ResponseLines:
    return ResponseLines(
        *(
            np.concatenate([getattr(part, name) for part in parts], axis=-1)
            for name in ("hz", "record", "excited", "r", "u", "y")
        )
    )


def _ends(lines: ResponseLines) -> Array:
    """Return the outermost frequencies of each injected signal, shape (m, 2), Hz."""
    return np.array([(lines.hz[row].min(), lines.hz[row].max()) for row in lines.excited])


def _between(lines: ResponseLines, band_hz: tuple[float, float] | None) -> Array:
    """Return the excited lines within a band, Hz."""
    low, high = band_hz or (0.0, np.inf)
    at = np.unique(np.round(lines.hz[lines.excited.any(axis=0)], 12))
    at = at[(at >= low - 1e-9) & (at <= high + 1e-9)]
    if not at.size:
        raise DataError(f"no line between {low:g} and {high:g} Hz is excited")
    return at


def _units(
    maneuver: Maneuver, excited: Sequence[str], group: str, outputs: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return (
        tuple(maneuver.record.channel(f"{group}/{n}").unit for n in excited),
        tuple(_output_unit(maneuver, n) for n in outputs),
    )


def _result(
    found: Sequence[LocalResponse],
    at: Array,
    inside: NDArray[np.bool_],
    excited: tuple[str, ...],
    outputs: Sequence[str],
    units: tuple[tuple[str, ...], tuple[str, ...]],
    method: str,
    remarks: tuple[str, ...],
) -> FrequencyResponse:
    """Put what was found at each frequency together; `inside` is where an input's own signal has power."""
    known = np.where(inside, 1.0, np.nan)

    def over(name: str) -> Array:
        return np.stack([getattr(one, name) for one in found], axis=-1)

    freedom = np.array([one.degrees_of_freedom for one in found])
    return FrequencyResponse(
        inputs=excited,
        outputs=tuple(outputs),
        input_units=units[0],
        output_units=units[1],
        frequencies_hz=at,
        value=np.asarray(over("value") * known, dtype=np.complex128),
        std_error=np.sqrt(over("variance") / 2) * known,
        degrees_of_freedom=np.tile(freedom, (len(outputs), 1)),
        coherence=over("coherence") * known,
        partial_coherence=over("partial_coherence") * known,
        misfit=over("misfit"),
        method=method,
        remarks=remarks,
        independent=np.minimum(np.array([one.density for one in found]) * _spacing(at), 1.0),
    )


def _spacing(at: Array) -> Array:
    """Return the band that each frequency stands for, Hz; all of it for a single one."""
    if at.size < 2:
        return np.full(at.size, np.inf)
    edges = np.concatenate([[at[0]], 0.5 * (at[1:] + at[:-1]), [at[-1]]])
    return np.diff(edges)


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
            remedy="import them with the log, or use --sweeps, whose responses feedback then biases",
        )
    return found


def _all_hold_signals(maneuvers: Sequence[Maneuver]) -> None:
    without = sum(not injected_signals(m.record) for m in maneuvers)
    if without:
        raise DataError(
            f"{without} of {len(maneuvers)} records hold no injected signals and the others do",
            remedy="import them with the log, or give the records apart",
        )


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


def _weak(
    found: Sequence[LocalResponse], at: Array, inside: NDArray[np.bool_], excited: tuple[str, ...]
) -> tuple[str, ...]:
    """Say which inputs the injected signals hardly move apart from the others, and where."""
    strength = np.array([one.strength for one in found], dtype=float).T
    weak = inside & (strength < LEAST_STRENGTH)
    if not weak.any():
        return ()
    names = [n for n, row in zip(excited, weak, strict=True) if row.any()]
    span = at[weak.any(axis=0)]
    share = weak.sum() / inside.sum()
    return (
        f"From {span[0]:.3g} to {span[-1]:.3g} Hz the injected signals hardly move {', '.join(names)} apart "
        f"from what gusts and feedback do (first-stage F below {LEAST_STRENGTH:g}, {share:.0%} of inputs and "
        "frequencies): responses there may lean towards those without instruments, by more than their errors "
        "say. Fly longer, more often or with larger signals.",
    )

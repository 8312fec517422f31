"""Frequency responses from flown manoeuvres: many inputs at once from multisines, one from a sweep.

Under feedback the inputs follow sensor noise and gusts, and ratios of spectra mistake the inverse of the
control law for the aircraft. What the injected signals explain of both sides is free of that
(docs/theory/frequency-response.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.channels import RESPONSE, WRENCH
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.identify.loads.explanatory import unit_of
from freqid.identify.response.injected_lines import injected_lines, injected_signals, period_of
from freqid.identify.response.local_response import Lines, local_response

ORDER = 2
"""Degree of the polynomials in frequency; two follow a resonance that spans a few lines."""


def frequency_response(
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
    joined = Lines(
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

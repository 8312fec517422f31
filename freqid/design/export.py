"""Designs for other tools: samples as CSV and MATLAB file, tones as C header and Lua table.

The C and Lua files evaluate the sum of sines at any time, so that a flight computer needs no samples.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scipy.io import savemat

from freqid.core.errors import UsageError
from freqid.core.results.design import MultisineDesign, SampledInputs
from freqid.core.store import replacing

# MATLAB files begin with 116 bytes of text, in which the writer puts the date; ours are the same every day.
MATLAB_HEADER = b"MATLAB 5.0 MAT-file, written by freqid".ljust(116)


def write_csv(path: Path, inputs: SampledInputs) -> None:
    """Write samples as comma-separated values, one row a moment, numbers to the last digit.

    Parameters
    ----------
    path : Path
    inputs : SampledInputs
        Columns are ``time_s``, then ``<effector>_<unit>``.

    Raises
    ------
    DataError
        Where the file cannot be written; so do the other writers here.
    """
    head = ["time_s", *(f"{n}_{u}" for n, u in zip(inputs.names, inputs.units, strict=True))]
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(np.vstack([inputs.time, inputs.values]).T.tolist())


def write_mat(path: Path, inputs: SampledInputs) -> None:
    """Write samples as a MATLAB 5 file, columns in time as MATLAB's tools expect them.

    Parameters
    ----------
    path : Path
    inputs : SampledInputs
        Variables are ``t`` (sample, 1), ``u`` (sample, effector) and the cells ``names`` and ``units``.
    """
    variables = {
        "t": inputs.time[:, None],
        "u": inputs.values.T,
        "names": np.array(inputs.names, dtype=object)[None],
        "units": np.array(inputs.units, dtype=object)[None],
    }
    with replacing(path) as temporary:
        savemat(str(temporary), variables, appendmat=False, do_compression=True)
        with temporary.open("r+b") as file:
            file.write(MATLAB_HEADER)


def write_c_header(path: Path, design: MultisineDesign, *, prefix: str = "multisine") -> None:
    """Write a header in C99 with the tones as constants and a function that evaluates a signal.

    Parameters
    ----------
    path : Path
    design : MultisineDesign
    prefix : str
        Begins every name in it: ``double multisine_value(int signal, double t)`` is the excitation at t
        seconds after its start, zero before and after; ``multisine_name`` and ``multisine_unit`` say
        what a signal is; `MULTISINE_SIGNALS` counts them.

    Raises
    ------
    UsageError
        Where the prefix is no C identifier.
    """
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", prefix):
        raise UsageError(f"prefix '{prefix}' is no C identifier", remedy="use letters, digits and _")
    first = np.cumsum([0, *(signal.index.size for signal in design.signals)]).tolist()
    index, amplitude, phase = (
        np.concatenate([getattr(signal, part) for signal in design.signals]).tolist()
        for part in ("index", "amplitude", "phase")
    )
    upper = prefix.upper()
    text = f"""\
/* {_summary(design)}
 * Sum of amplitude sin(2 pi harmonic t / period + phase) over the tones of a signal, SI units. C99. */
#ifndef {upper}_H
#define {upper}_H

#include <math.h>

#define {upper}_SIGNALS {len(design.signals)}
#define {upper}_PERIOD_S {design.period_s!r}
#define {upper}_DURATION_S {design.duration_s!r}

/* Tones of signal i are first[i] to first[i + 1] - 1. */
static const int {prefix}_first[{len(first)}] = {_braced(first)};
static const int {prefix}_harmonic[{len(index)}] = {_braced(index)};
static const double {prefix}_amplitude[{len(index)}] = {_braced(amplitude)};
static const double {prefix}_phase[{len(index)}] = {_braced(phase)};

static inline const char *{prefix}_name(int signal)
{{
    static const char *const name[{len(design.signals)}] = {_braced(map(_quoted, design.names))};
    return signal >= 0 && signal < {upper}_SIGNALS ? name[signal] : "";
}}

static inline const char *{prefix}_unit(int signal)
{{
    static const char *const unit[{len(design.signals)}] = {_braced(_quoted(s.unit) for s in design.signals)};
    return signal >= 0 && signal < {upper}_SIGNALS ? unit[signal] : "";
}}

/* Excitation of a signal t seconds after the start; zero before the start and after the end. */
static inline double {prefix}_value(int signal, double t)
{{
    const double two_pi = 6.283185307179586;
    double cycle, sum = 0.0;
    int i;
    if (signal < 0 || signal >= {upper}_SIGNALS || !(t >= 0.0 && t <= {upper}_DURATION_S)) {{
        return 0.0;
    }}
    cycle = fmod(t / {upper}_PERIOD_S, 1.0);
    for (i = {prefix}_first[signal]; i < {prefix}_first[signal + 1]; i++) {{
        sum += {prefix}_amplitude[i] * sin(two_pi * {prefix}_harmonic[i] * cycle + {prefix}_phase[i]);
    }}
    return sum;
}}

#endif
"""
    _write_text(path, text)


def write_lua(path: Path, design: MultisineDesign) -> None:
    """Write a Lua module: a table of the tones with a function that evaluates a signal.

    Parameters
    ----------
    path : Path
        ``local multisine = require("...")``, then ``multisine.value(i, t)`` is the excitation of signal i,
        counted from 1, t seconds after its start, zero before and after.
    design : MultisineDesign

    Notes
    -----
    For Lua 5.3 and later. Autopilots run Lua in single precision: there the angle is reduced to one turn
    before the sine is taken, which keeps its error near 1e-7 of a turn times the harmonic.
    """
    signals = "".join(
        f"""\
        {{
            name = {_quoted(signal.name)},
            unit = {_quoted(signal.unit)},
            harmonic = {_braced(signal.index.tolist(), 16)},
            amplitude = {_braced(signal.amplitude.tolist(), 16)},
            phase = {_braced(signal.phase.tolist(), 16)},
        }},
"""
        for signal in design.signals
    )
    text = f"""\
-- {_summary(design)}
-- Sum of amplitude sin(2 pi harmonic t / period + phase) over the tones of a signal, SI units.
local multisine = {{
    period_s = {design.period_s!r},
    duration_s = {design.duration_s!r},
    signals = {{
{signals}    }},
}}

-- Excitation of signal i, counted from 1, t seconds after the start; zero before and after.
function multisine.value(i, t)
    local signal = multisine.signals[i]
    if signal == nil or not (t >= 0 and t <= multisine.duration_s) then
        return 0.0
    end
    local cycle = (t / multisine.period_s) % 1
    local sum = 0.0
    for j = 1, #signal.harmonic do
        local turn = (signal.harmonic[j] * cycle) % 1
        sum = sum + signal.amplitude[j] * math.sin(2 * math.pi * turn + signal.phase[j])
    end
    return sum
end

return multisine
"""
    _write_text(path, text)


def _summary(design: MultisineDesign) -> str:
    low, high = design.band_hz
    return (
        f"freqid multisines: {len(design.signals)} signals, {low:g} to {high:g} Hz, "
        f"{design.periods} periods of {design.period_s:g} s"
    )


def _braced(items: Iterable[object], indent: int = 4) -> str:
    """Return a list as C and Lua both write it; a float's repr has all its digits."""
    words, lines = [str(item) for item in items], [""]
    for word in words:
        if len(lines[-1]) + len(word) > 90 - indent:
            lines.append("")
        lines[-1] += f"{word}, "
    margin = "\n" + " " * indent
    return "{" + margin + margin.join(line.rstrip() for line in lines).rstrip(",") + "}"


def _quoted(text: str) -> str:
    """Return a string literal of C and Lua."""
    if not text.isprintable():
        raise UsageError(f"the name {text!r} holds unprintable characters", remedy="rename the effector")
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")

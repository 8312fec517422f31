"""What a log holds: every channel with its rate, unit and gaps, and a column map that is proposed for it."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freqid.core.channels import si_unit
from freqid.core.errors import DataError, UsageError
from freqid.core.units import parse_unit
from freqid.flightlog.column_map import SHIPPED
from freqid.flightlog.names import recognise
from freqid.flightlog.read import reader_of
from freqid.flightlog.resample import LONGEST_GAP
from freqid.flightlog.signal import Signal


@dataclass(frozen=True)
class Listed:
    """One channel of a log.

    Attributes
    ----------
    name, unit : str
        As the log has them; the unit is empty where it states none.
    samples : int
        That are finite.
    rate_hz : float
        From the median interval; NaN with fewer than two samples.
    jitter_s : float
        RMS deviation of single intervals from the median, s.
    gaps : tuple of (float, float)
        Start and length, s, of dropouts longer than a few intervals.
    low, high : float
        Smallest and largest value.
    clock : bool
        Whether it is the clock of a table.
    source : str
        Where a MATLAB file keeps its clock.
    label : str
        What the log says that it is, where its name is a place.
    epoch : {"", "unix"}
        What its time counts from, where the log says so.
    """

    name: str
    unit: str
    samples: int
    rate_hz: float
    jitter_s: float
    gaps: tuple[tuple[float, float], ...]
    low: float
    high: float
    clock: bool = False
    source: str = ""
    label: str = ""
    epoch: str = ""


@dataclass(frozen=True)
class Listing:
    """A whole log.

    Attributes
    ----------
    path : Path
    channels : tuple of Listed
    map : str
        TOML of the proposed column map.
    """

    path: Path
    channels: tuple[Listed, ...]
    map: str

    def __str__(self) -> str:
        """Return the channels as comments above the proposed map: the whole is a map that can be used."""
        rows = [("channel", "rate", "jitter", "unit", "gaps", "from", "to")]
        for c in self.channels:
            gaps = f"{len(c.gaps)}, {sum(g for _, g in c.gaps):.3g} s" if c.gaps else "-"
            rate, jitter = f"{c.rate_hz:.4g} Hz", f"{1e3 * c.jitter_s:.2g} ms"
            rows.append((c.name, rate, jitter, c.unit or "?", gaps, f"{c.low:.5g}", f"{c.high:.5g}"))
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        lines = [
            "  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows
        ]
        return "\n".join(["# " + line for line in (str(self.path), *lines)]) + "\n\n" + self.map


def list_log(path: Path, effectors: Collection[str] = ()) -> Listing:
    """List the channels of a log and propose a column map.

    Parameters
    ----------
    path : Path
        Of a kind that does not say itself what its channels are.
    effectors : collection of str
        Names of the aircraft's effectors, which columns are compared with.

    Raises
    ------
    DataError
        Where the file cannot be read or is of an unknown kind.
    UsageError
        Where it needs no map.
    """
    path = Path(path)
    reader = reader_of(path)
    if reader.signals is None:
        raise UsageError("needs no column map", where=str(path), remedy="import it without --map")
    try:
        channels = tuple(_listed(signal) for signal in reader.signals(path))
    except DataError as error:
        raise error.at(str(path)) from None
    # every message of an autopilot's log has a clock of its own: one clock is another log with like names
    shipped = "" if any(c.clock for c in channels) else _shipped_map([c.name for c in channels])
    proposal = shipped if shipped else _proposed(channels, effectors)
    return Listing(path, channels, proposal)


def _listed(signal: Signal) -> Listed:
    known = np.isfinite(signal.values) & np.isfinite(signal.time)
    own, values = signal.time[known], signal.values[known]
    if own.size < 2:
        nan = float("nan")
        low = float(values[0]) if values.size else nan
        return Listed(signal.name, signal.unit, own.size, nan, nan, (), low, low, label=signal.label)
    steps = np.diff(own)
    step = float(np.median(steps))
    single = steps[steps < 1.5 * step]
    long = np.flatnonzero(steps > LONGEST_GAP * step)
    return Listed(
        name=signal.name,
        unit=signal.unit,
        samples=own.size,
        rate_hz=1 / step if step > 0 else float("nan"),
        jitter_s=float(np.sqrt(np.mean((single - step) ** 2))) if single.size else float("nan"),
        gaps=tuple((float(own[i]), float(steps[i])) for i in long),
        low=float(values.min()),
        high=float(values.max()),
        clock=signal.note == "clock",
        source=signal.note.removeprefix("clock ") if signal.note.startswith("clock ") else "",
        label=signal.label,
        epoch=signal.epoch,
    )


def _shipped_map(names: Sequence[str]) -> str:
    """Return the map that comes with freqid for an autopilot's log, or an empty text."""
    topics = {name.partition(".")[0].partition("[")[0] for name in names}
    if "vehicle_attitude" in topics:
        surfaces = "actuator_servos" in topics
        several = {"actuator_motors.control[3]"} <= set(names)
        kind = (
            "tiltwing" if "tiltrotor_extra_controls" in topics else "quadplane" if several else "fixed-wing"
        )
        name = f"px4-{kind if surfaces else 'multirotor'}"
    elif {"ATT", "IMU"} <= topics:
        plane = "AETR" in topics or "NTUN" in topics or "TECS" in topics
        kind = "tiltwing" if "TILT" in topics else "quadplane" if "QTUN" in topics else "fixed-wing"
        name = f"ardupilot-{kind if plane else 'multirotor'}"
    else:
        return ""
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    return (
        f"# Proposed: the map {name} that comes with freqid (--map {name}). Adapt it to the vehicle.\n{text}"
    )


def _proposed(channels: Sequence[Listed], effectors: Collection[str]) -> str:
    """Return a map of the channels whose names are understood; the others are listed as comments."""
    clock = next((c for c in channels if c.clock or (c.source and c.samples > 1)), None)
    parts, unknown, taken = [], [], set()
    if clock is not None:
        if clock.source:
            epoch = f"epoch = {_quoted(clock.epoch)}\n" if clock.epoch else ""
            parts.append(f'[time]\nvariable = {_quoted(clock.source)}\nunit = "s"\n{epoch}')
        else:
            parts.append(f"[time]\ncolumn = {_spot(clock.name)}\nunit = {_quoted(clock.unit)}\n")
    for c in channels:
        if c.clock or not (c.samples or c.label):
            continue
        channel, unit = recognise(c.label or c.name, c.unit, effectors)
        if not channel or channel in taken or not _fits(channel, unit) or c.samples < 2:
            said = ", ".join(text for text in (c.label, unit) if text)
            unknown.append(f"{c.name}{f' ({said})' if said else ''}")
            continue
        taken.add(channel)
        where = f"variable = {_quoted(c.name)}" if c.source else f"column = {_spot(c.name)}"
        own = f"time = {_quoted(c.source)}\n" if c.source and clock and c.source != clock.source else ""
        stated = f"unit = {_quoted(unit)}\n" if unit else 'unit = ""  # the log does not say: state it\n'
        parts.append(f'[[channel]]\nname = "{channel}"\n{where}\n{own}{stated}')
    text = "# Proposed by the names of the columns: check every line, signs above all.\n\n" + "\n".join(parts)
    if unknown:
        text += "\n# Not mapped:\n" + "\n".join(f"#   {name}" for name in unknown) + "\n"
    return text


def _fits(channel: str, unit: str) -> bool:
    """Tell whether a unit measures what a channel is; an effector may be of several kinds."""
    if not unit:
        return True
    try:
        dimension = parse_unit(unit).dimension
    except DataError:
        return False
    si = si_unit(channel)
    return si is None or parse_unit(si).dimension == dimension


def _spot(name: str) -> str:
    return name if name.isdecimal() else _quoted(name)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)

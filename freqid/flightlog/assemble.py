"""Logged columns, whichever tool logged them, made into a FlightRecord."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, MutableMapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import EFFECTOR_UNITS, si_unit
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, Configuration, FlightRecord, check_time
from freqid.core.units import parse_unit, to_si
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.flightlog.column_map import MASS_PROPERTIES
from freqid.flightlog.resample import METHOD, Gridded, onto_grid
from freqid.flightlog.shelf import Shelf
from freqid.flightlog.spikes import find_spikes

# Effectors whose kind nobody stated, and pilots' controls, take the SI unit of their dimension.
_EFFECTOR_SI = (*dict.fromkeys(EFFECTOR_UNITS.values()), "m")
_RATES_HZ = (1e-3, 1e6)  # outside, the clock's unit is wrong: microseconds read as seconds, say
_SLOWEST_LOG_HZ = 1.0  # of the log's own clock; slower is one in milliseconds, read as seconds


@dataclass(frozen=True)
class Column:
    """One logged quantity before it becomes a channel.

    Attributes
    ----------
    name : str
        Of the channel or mass property.
    values : ndarray, shape (sample,)
        As logged, NaN where the log is blank; mass properties may have a single value.
    unit : str
        As logged.
    source : str
    sign : int
    position_m : tuple of 3 floats, optional
    rate_hz : float, optional
        Rate of the source where it is known to be lower than the log's.
    time : ndarray, shape (sample,), optional
        The channel's own clock, s; the log's where absent.
    """

    name: str
    values: NDArray[np.float64]
    unit: str
    source: str
    sign: int = 1
    position_m: tuple[float, float, float] | None = None
    rate_hz: float | None = None
    time: NDArray[np.float64] | None = None


def assemble(
    path: Path,
    reader: str,
    time: Column | None,
    columns: Iterable[Column],
    mass: Sequence[Column] = (),
    *,
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
    despike: bool = False,
    vehicle: Vehicle | None = None,
    reference: str = "",
    configuration: Configuration | None = None,
    provenance: dict[str, Any] | None = None,
) -> FlightRecord:
    """Convert columns to SI, cut and resample where asked, and check the whole as a record.

    Parameters
    ----------
    path : Path
        The log, named in errors and provenance.
    reader : str
        The layout that was read, for the provenance.
    time : Column, optional
        The clock of all columns that have none of their own.
    columns : iterable of Column
        Channels. Each is dropped once it is converted, so that a generator keeps one raw column in memory.
    mass : sequence of Column
        Mass properties; the mean over the record is kept.
    cut : tuple of 2 floats, optional
        Start and stop on the log's clock, s. Applied first, so that a fault outside does no harm.
    resample_hz : float, optional
        Rate of the record. Without it the log must be uniform and complete, and have one clock. Where a
        channel drops out, the record is the longest stretch that all channels have; provenance lists all of
        these as ``whole_spans_s``.
    despike : bool
        Leave single outlying samples out, count them, and bridge them as missing ones are.
    vehicle : Vehicle, optional
        Gives the kinds of the effectors, and goes into the record.
    reference, configuration
        As in the record.
    provenance : dict, optional
        What else the reader knows.

    Raises
    ------
    DataError
        Where time, a unit or a channel is not fit for a record; the file is named.
    UsageError
        Where `cut` is not inside the log, `resample_hz` is out of range, or spikes are to be left out without
        resampling.
    """
    if despike and resample_hz is None:
        raise UsageError(
            "spikes are left out and bridged, which is resampling",
            where=str(path),
            remedy="state --resample too",
        )
    try:
        with np.errstate(all="ignore"):  # what overflows is not finite, and refused as that
            log_clock = _si_values(time, "s") if time is not None else np.empty(0)
            kinds = vehicle.effector_kinds if vehicle else {}
            facts, signals = _signals(columns, log_clock, kinds, cut, uniform=resample_hz is None)
            history: dict[str, Any] = {
                "source": {"file": Path(path).name, "sha256": _sha256(Path(path)), "reader": reader},
                **(provenance or {}),
            }
            if cut is not None:
                history["cut_s"] = list(cut)
            if despike:
                history["spikes"] = {name: n for name in signals if (n := _leave_out_spikes(signals, name))}
            if resample_hz is None:
                _check_one_clock(signals)
                clock = next(iter(signals.values()))[0]
                values = {name: x for name, (_, x) in signals.items()}
                native = dict.fromkeys(values, (clock.size - 1) / float(clock[-1] - clock[0]))
            else:
                found = onto_grid(signals, resample_hz)
                clock, values, native = found.time, found.values, found.native_rate_hz
                history |= _resampling(found, resample_hz)
            return FlightRecord(
                time=clock,
                channels={
                    name: Channel(
                        name=name,
                        unit=unit,
                        values=values[name],
                        native_rate_hz=min(native[name], c.rate_hz or np.inf),
                        source=c.source,
                        position_m=c.position_m,
                    )
                    for name, (unit, c) in facts.items()
                },
                vehicle=vehicle,
                mass_properties=_mass_properties(
                    mass, _rows(log_clock, cut) if log_clock.size else slice(None)
                ),
                reference=reference,
                configuration=configuration or Configuration(),
                provenance=history,
            )
    except (DataError, UsageError) as error:
        raise error.at(str(path)) from None


_Signals = MutableMapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
_EMPTY = np.empty(0)


def _signals(
    columns: Iterable[Column],
    log_clock: NDArray[np.float64],
    kinds: dict[str, str],
    cut: tuple[float, float] | None,
    *,
    uniform: bool,
) -> tuple[dict[str, tuple[str, Column]], _Signals]:
    """Return each channel's SI unit and column, without its values, and its time and values in SI, cut."""
    facts: dict[str, tuple[str, Column]] = {}
    signals: _Signals = {} if uniform else Waiting()
    clocks: dict[
        int, tuple[NDArray[np.float64], slice, NDArray[np.float64]]
    ] = {}  # raw, rows, cut and checked
    for column in columns:
        raw = log_clock if column.time is None else column.time
        if id(raw) not in clocks:
            try:
                rows = _rows(raw, cut)
                least = _SLOWEST_LOG_HZ if column.time is None else _RATES_HZ[0]
                _check_clock(raw[rows], least, uniform=uniform)
            except (DataError, UsageError) as error:
                whose = "" if column.time is None else f"clock of channel '{column.name}': "
                raise type(error)(whose + error.message, remedy=error.remedy) from None
            clocks[id(raw)] = raw, rows, raw[rows]
        _, rows, clock = clocks[id(raw)]
        unit = _si(column, kinds)
        x = _si_values(column, unit)
        if x.shape != raw.shape:
            raise DataError(f"channel '{column.name}' has shape {x.shape}, time has {raw.shape}")
        signals[column.name] = clock, x[rows]
        facts[column.name] = unit, replace(column, values=_EMPTY, time=None)
    if not signals:
        raise DataError("holds no channel that is not zero throughout", remedy="check the log")
    return facts, signals


class Waiting(MutableMapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]):
    """Signals that wait to be resampled, their values on a shelf."""

    def __init__(self) -> None:
        self._time: dict[str, NDArray[np.float64]] = {}
        self._values = Shelf()

    def __getitem__(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._time[name], self._values[name]

    def __setitem__(self, name: str, signal: tuple[NDArray[np.float64], NDArray[np.float64]]) -> None:
        self._time[name], self._values[name] = signal

    def __delitem__(self, name: str) -> None:
        del self._time[name], self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(list(self._time))

    def __len__(self) -> int:
        return len(self._time)


def _check_one_clock(signals: _Signals) -> None:
    """Refuse channels that were sampled at times of their own; the same times twice are one clock."""
    (first, (clock, _)), *others = signals.items()
    for name, (time, _) in others:
        if time is not clock and not np.array_equal(time, clock):
            a, b = ((t.size - 1) / float(t[-1] - t[0]) for t in (clock, time))
            raise DataError(
                f"channels have clocks of their own: '{first}' at {a:.4g} Hz, '{name}' at {b:.4g} Hz",
                remedy="put them on one with --resample RATE",
            )


def _leave_out_spikes(signals: _Signals, name: str) -> int:
    """Mark the spikes of one channel as missing and return their number."""
    time, x = signals[name]
    spikes = find_spikes(x)
    if spikes.any():
        signals[name] = time, np.where(spikes, np.nan, x)
    return int(spikes.sum())


def _resampling(found: Gridded, rate_hz: float) -> dict[str, Any]:
    """Return what resampling took, for the provenance."""
    history: dict[str, Any] = {
        "resampled": {
            "rate_hz": rate_hz,
            "method": METHOD,
            "filled_samples": found.filled,
            "jitter_s": found.jitter_s,
        }
    }
    if found.dropouts:
        history["dropouts"] = [{"channel": c, "start_s": a, "stop_s": b} for c, a, b in found.dropouts]
        history["whole_spans_s"] = [list(span) for span in found.spans]
    return history


def _sha256(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _si(column: Column, kinds: dict[str, str]) -> str:
    """Return the SI unit of a channel; an effector of unknown kind has the one of its dimension."""
    known = si_unit(column.name, kinds)
    if known is not None:
        return known
    try:
        found = effector_si(column.unit)
    except DataError as error:
        raise DataError(f"channel '{column.name}': {error.message}", remedy=error.remedy) from None
    if found is not None:
        return found
    raise DataError(
        f"channel '{column.name}': found unit '{column.unit}', expected one that converts to "
        + ", ".join(f"'{u}'" for u in _EFFECTOR_SI),
        remedy="correct the unit",
    )


def effector_si(unit: str) -> str | None:
    """Return the SI unit of an effector of unknown kind that was logged in `unit`; None where none fits.

    Raises
    ------
    DataError
        Where the unit is not understood.
    """
    dimension = parse_unit(unit).dimension
    return next((si for si in _EFFECTOR_SI if parse_unit(si).dimension == dimension), None)


def _si_values(column: Column, si: str) -> NDArray[np.float64]:
    """Return the values in SI, with the sign of the map."""
    try:
        unit = to_si(column.unit, si, "")
    except DataError as error:
        kind = "mass property" if column.name in MASS_PROPERTIES else "channel"
        message = error.message.removeprefix(": ")
        raise DataError(f"{kind} '{column.name}': {message}", remedy=error.remedy) from None
    values = (column.sign * unit.factor) * np.asarray(column.values, dtype=np.float64)
    if unit.offset:
        values += column.sign * unit.offset  # in place: a long log fills the memory
    return values


def _rows(clock: NDArray[np.float64], cut: tuple[float, float] | None) -> slice:
    """Return the samples of a cut: all from the first to the last inside it, faulty ones included."""
    if cut is None:
        return slice(None)
    start, stop = cut
    finite = clock[np.isfinite(clock)]
    slack = 0.5 * float(np.median(np.abs(np.diff(finite)))) if finite.size > 1 else 0.0
    inside = np.flatnonzero((clock >= start - slack) & (clock <= stop + slack))
    if not inside.size or start < finite.min() - slack or stop > finite.max() + slack:
        span = f"{finite.min():g}:{finite.max():g} s" if finite.size else "no finite time"
        raise UsageError(f"cut {start:g}:{stop:g} s is not inside the log, which runs {span}")
    return slice(int(inside[0]), int(inside[-1]) + 1)


def _check_clock(clock: NDArray[np.float64], least_hz: float, *, uniform: bool) -> None:
    """Check that time increases at a credible rate, and uniformly unless it is to be resampled."""
    increasing = clock.size > 1 and bool(np.isfinite(clock).all() and (np.diff(clock) > 0).all())
    if uniform or not increasing:
        check_time(clock)
    step = float(np.median(np.diff(clock)))
    if not 1 / _RATES_HZ[1] <= step <= 1 / least_hz:
        raise DataError(
            f"time advances by {step:.3g} s a sample, expected between {1 / _RATES_HZ[1]:g} and "
            f"{1 / least_hz:g} s",
            remedy="correct the unit of time",
        )


def _mass_properties(mass: Sequence[Column], rows: slice) -> MassProperties | None:
    """Return the mean mass properties of the record, or None where none are logged."""
    mean = {}
    for column in mass:
        values = _si_values(column, MASS_PROPERTIES[column.name])
        values = values[rows] if values.size > 1 else values
        known = values[~np.isnan(values)]  # blank cells of a slower column
        if not known.size or not np.isfinite(known).all():
            raise DataError(f"mass property '{column.name}' is not finite", remedy="repair the log")
        mean[column.name] = float(known.mean())
    if not mean:
        return None
    missing = [name for name in ("mass", "Ixx", "Iyy", "Izz") if name not in mean]
    if missing:
        raise DataError(
            f"mass properties {missing} are missing, expected at least mass, Ixx, Iyy and Izz",
            remedy="map them too, or leave all mass properties to the scenario",
        )
    inertia = {axes: mean.get(f"I{axes}", 0.0) for axes in ("xx", "yy", "zz", "xz", "xy", "yz")}
    cg = (mean.get("cg_x", 0.0), mean.get("cg_y", 0.0), mean.get("cg_z", 0.0))
    try:
        return MassProperties(mass_kg=mean["mass"], cg_m=cg, inertia=Inertia(**inertia))
    except ValueError as error:
        raise DataError(f"the logged mass properties do not fit together: {error}") from None

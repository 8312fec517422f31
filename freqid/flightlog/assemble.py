"""Logged columns, whichever tool logged them, made into a FlightRecord."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import EFFECTOR_UNITS, si_unit
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, Configuration, FlightRecord, check_time
from freqid.core.units import parse_unit, to_si
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.flightlog.column_map import MASS_PROPERTIES, ColumnMap, Place
from freqid.flightlog.resample import METHOD, onto_grid

# Effectors whose kind nobody stated, and pilots' controls, take the SI unit of their dimension.
_EFFECTOR_SI = (*dict.fromkeys(EFFECTOR_UNITS.values()), "m")
_RATES_HZ = (1e-3, 1e6)  # outside, the clock's unit is wrong: microseconds read as seconds, say


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
    """

    name: str
    values: NDArray[np.float64]
    unit: str
    source: str
    sign: int = 1
    position_m: tuple[float, float, float] | None = None
    rate_hz: float | None = None


def assemble(
    path: Path,
    reader: str,
    time: Column,
    columns: Sequence[Column],
    mass: Sequence[Column] = (),
    *,
    cut: tuple[float, float] | None = None,
    resample_hz: float | None = None,
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
    time : Column
    columns, mass : sequence of Column
        Channels and mass properties; of the latter the mean over the record is kept.
    cut : tuple of 2 floats, optional
        Start and stop on the log's clock, s. Applied first, so that a fault outside does no harm.
    resample_hz : float, optional
        Rate of the record. Without it the log must be uniform and complete.
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
        Where `cut` is not inside the log, or `resample_hz` is out of range.
    """
    try:
        if not columns:
            raise DataError("holds no channel that is not zero throughout", remedy="check the log")
        with np.errstate(all="ignore"):  # what overflows is not finite, and refused as that
            clock = _si_values(time, "s")
            rows = _rows(clock, cut)
            clock = clock[rows]
            _check_clock(clock, uniform=resample_hz is None)
            kinds = vehicle.effector_kinds if vehicle else {}
            units = {c.name: _si(c, kinds) for c in columns}
            values = {c.name: _si_values(c, units[c.name]) for c in columns}
            for name, x in values.items():
                if x.shape != time.values.shape:
                    raise DataError(f"channel '{name}' has shape {x.shape}, time has {time.values.shape}")
            values = {name: x[rows] for name, x in values.items()}
            history: dict[str, Any] = {
                "source": {
                    "file": Path(path).name,
                    "sha256": hashlib.sha256(Path(path).read_bytes()).hexdigest(),
                    "reader": reader,
                },
                **(provenance or {}),
            }
            if cut is not None:
                history["cut_s"] = list(cut)
            if resample_hz is None:
                native = dict.fromkeys(values, (clock.size - 1) / float(clock[-1] - clock[0]))
            else:
                clock, values, native, filled = onto_grid(clock, values, resample_hz)
                history["resampled"] = {"rate_hz": resample_hz, "method": METHOD, "filled_samples": filled}
            return FlightRecord(
                time=clock,
                channels={
                    c.name: Channel(
                        name=c.name,
                        unit=units[c.name],
                        values=values[c.name],
                        native_rate_hz=min(native[c.name], c.rate_hz or np.inf),
                        source=c.source,
                        position_m=c.position_m,
                    )
                    for c in columns
                },
                vehicle=vehicle,
                mass_properties=_mass_properties(mass, rows),
                reference=reference,
                configuration=configuration or Configuration(),
                provenance=history,
            )
    except (DataError, UsageError) as error:
        raise error.at(str(path)) from None


def assemble_map(
    path: Path,
    reader: str,
    column_map: ColumnMap,
    pick: Callable[[Place], NDArray[np.float64]],
    **options: Any,
) -> FlightRecord:
    """Assemble what a column map names; `pick` returns the values at one of its places.

    Parameters
    ----------
    path, reader
        As in `assemble`.
    column_map : ColumnMap
    pick : callable
        Raises DataError where the log has no such place.
    **options
        Passed to `assemble`.
    """

    def column(name: str, place: Any) -> Column:
        try:
            values = pick(place)
        except DataError as error:
            raise error.at(str(path)) from None
        spot = [f"column {place.column!r}"] if place.column is not None else []
        spot += [f"variable {place.variable!r}"] if place.variable is not None else []
        sign = getattr(place, "sign", 1)
        return Column(
            name=name,
            values=values,
            unit=place.unit,
            source=f"{Path(path).name}: {' of '.join(spot)}, {place.unit}{', sign -1' if sign < 0 else ''}",
            sign=sign,
            position_m=getattr(place, "position_m", None),
            rate_hz=getattr(place, "rate_hz", None),
        )

    entries = column_map.record
    return assemble(
        path,
        reader,
        column("time", column_map.time),
        [column(place.name, place) for place in column_map.channel],
        [column(place.name, place) for place in column_map.mass_property],
        reference=entries.reference,
        configuration=Configuration(entries.tail, entries.firmware, entries.parameter_hash),
        **options,
    )


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
    return column.sign * (unit.factor * np.asarray(column.values, dtype=np.float64) + unit.offset)


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


def _check_clock(clock: NDArray[np.float64], uniform: bool) -> None:
    """Check that time increases at a credible rate, and uniformly unless it is to be resampled."""
    increasing = clock.size > 1 and bool(np.isfinite(clock).all() and (np.diff(clock) > 0).all())
    if uniform or not increasing:
        check_time(clock)
    step = float(np.median(np.diff(clock)))
    if not 1 / _RATES_HZ[1] <= step <= 1 / _RATES_HZ[0]:
        raise DataError(
            f"time advances by {step:.3g} s a sample, expected between {1 / _RATES_HZ[1]:g} and "
            f"{1 / _RATES_HZ[0]:g} s",
            remedy="correct the unit of time",
        )


def _mass_properties(mass: Sequence[Column], rows: slice) -> MassProperties | None:
    """Return the mean mass properties of the record, or None where none are logged."""
    mean = {}
    for column in mass:
        values = _si_values(column, MASS_PROPERTIES[column.name])
        mean[column.name] = float(np.mean(values[rows] if values.size > 1 else values))
        if not np.isfinite(mean[column.name]):
            raise DataError(f"mass property '{column.name}' is not finite", remedy="repair the log")
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
    except (ValueError, np.linalg.LinAlgError) as error:
        raise DataError(f"the logged mass properties do not fit together: {error}") from None

"""A flight as it was logged, the stretch that a model is made from, and its file (``freqid-record``)."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.channels import KNOWN, effector_unit, si_unit, split
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.layout import Attribute, get_fields, put_fields
from freqid.core.units import to_si
from freqid.core.vehicle import MassProperties, Vehicle
from freqid.core.viewable import Viewable

_TIME_TOLERANCE = 1e-3  # of one sample: what decimal places in a log leave of a uniform clock


@dataclass(frozen=True)
class Channel:
    """One logged quantity on the record's time base, in SI units.

    Attributes
    ----------
    name : str
        ``group/name``, as in the file: ``state/u``, ``effector/de1``.
    unit : str
        SI unit.
    values : ndarray, shape (sample,)
    native_rate_hz : float
        Rate at which the source logged it; its Nyquist frequency bounds what it can tell.
    source : str
        Where it comes from: file and column, or how it was computed.
    position_m : tuple of 3 floats, optional
        Position of the sensor in vehicle axes, m; the centre of gravity where absent.
    """

    name: str
    unit: str
    values: NDArray[np.float64]
    native_rate_hz: float
    source: str
    position_m: tuple[float, float, float] | None = None

    def __repr__(self) -> str:
        return f"<Channel {self.name!r} in {self.unit}: {self.values.size} samples>"

    @cached_property
    def not_finite(self) -> NDArray[np.intp]:
        """Samples that are not finite; a channel is in many records and is looked at once."""
        return np.flatnonzero(~np.isfinite(self.values))


@dataclass(frozen=True)
class Configuration:
    """Which airframe flew, with which software."""

    tail: str = ""
    firmware: str = ""
    parameter_hash: str = ""


@dataclass(frozen=True)
class FlightRecord(Viewable):
    """One flight or manoeuvre on a uniform time base.

    Attributes
    ----------
    time : ndarray, shape (sample,)
        Seconds, uniformly spaced.
    channels : mapping of str to Channel
        By ``group/name``.
    vehicle : Vehicle, optional
        What the aircraft is known to be.
    mass_properties : MassProperties, optional
        Of this flight; they override the vehicle's.
    reference : str
        Id of the reference condition flown, empty where none is stated.
    configuration : Configuration
    provenance : dict
        How the record came to be: source files, resampling, cuts. JSON-compatible.

    Raises
    ------
    DataError
        Where time is not finite, increasing and uniform, or a channel is not finite or has
        another number of samples.
    """

    time: NDArray[np.float64]
    channels: Mapping[str, Channel]
    vehicle: Vehicle | None = None
    mass_properties: MassProperties | None = None
    reference: str = ""
    configuration: Configuration = Configuration()
    provenance: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        time: NDArray[np.float64],
        values: Mapping[str, NDArray[np.float64] | float],
        vehicle: Vehicle | None = None,
        *,
        units: Mapping[str, str] | None = None,
        positions_m: Mapping[str, tuple[float, float, float]] | None = None,
        reference: str = "",
    ) -> FlightRecord:
        """Make a record of arrays that are in memory already.

        Parameters
        ----------
        time : array_like, shape (sample,)
            Seconds, uniformly spaced.
        values : mapping of str to array_like, shape (sample,)
            By ``group/name``: ``state/q``, ``air/rho``, ``effector/de1`` (measured), ``command/de1``,
            ``excitation/de1`` (the injected signal alone). A number stands for a constant.
        vehicle : Vehicle, optional
            Of a scenario: ``fq.read_scenario("mine.toml").aircraft()``.
        units : mapping of str to str, optional
            By channel, of those whose values are not in SI: ``{"state/phi": "deg"}``.
        positions_m : mapping of str to tuple of 3 floats, optional
            Positions of sensors in vehicle axes, m, by channel; the centre of gravity where absent.
        reference : str
            Id of the reference condition flown.

        Raises
        ------
        DataError
            As for a record; for a unit that measures something else.
        UsageError
            For a vehicle that is none; for an effector whose unit cannot be known; for a unit or a position
            of a channel that is not there.

        Examples
        --------
        >>> import numpy as np
        >>> t = np.arange(0, 60, 0.02)
        >>> FlightRecord.of(t, {"state/phi": 2.0, "state/q": np.sin(t)}, units={"state/phi": "deg"})
        <FlightRecord: 2 channels, 59.98 s at 50 Hz>
        """
        _check_vehicle(vehicle)
        for name in [*(units or {}), *(positions_m or {})]:
            if name not in values:
                raise UsageError(f"there are no values of '{name}'", remedy=nearest(name, values))
        clock = np.asarray(time, dtype=float)
        check_time(clock)
        kinds = vehicle.effector_kinds if vehicle else {}
        rate = float((clock.size - 1) / (clock[-1] - clock[0]))
        channels = {}
        for name, value in values.items():
            given = (units or {}).get(name)
            si = si_unit(name, kinds) or (effector_unit(given) if given else None)
            if si is None:
                raise UsageError(
                    f"the unit of '{name}' is not known",
                    remedy=f'give units={{"{name}": "rad"}}, or the vehicle',
                )
            convert = to_si(given or si, si, name)
            array = np.asarray(value, dtype=float)
            array = np.full(clock.shape, array) if array.ndim == 0 else array
            array = convert.factor * array + convert.offset
            channels[name] = Channel(name, si, array, rate, "array", (positions_m or {}).get(name))
        return cls(clock, channels, vehicle, reference=reference)

    def __repr__(self) -> str:
        at = f" at {self.reference!r}" if self.reference else ""
        return (
            f"<FlightRecord{at}: {len(self.channels)} channels, {self.duration:.6g} s "
            f"at {1 / self.dt:.6g} Hz>"
        )

    def __post_init__(self) -> None:
        check_time(self.time)
        self._check(self.channels)

    def _check(self, channels: Mapping[str, Channel]) -> None:
        for name, channel in channels.items():
            split(name)
            if channel.values.shape != self.time.shape:
                raise DataError(
                    f"channel '{name}' has shape {channel.values.shape}, expected {self.time.shape} like time"
                )
            bad = channel.not_finite
            if bad.size:
                raise DataError(
                    f"channel '{name}' is not finite in {bad.size} of {self.time.size} samples, "
                    f"first at t = {self.time[bad[0]]:.4g} s",
                    remedy="cut the record around them or repair the log first",
                )

    @cached_property
    def dt(self) -> float:
        """Sample interval, s."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of names, time and samples: the same for the same flight, wherever its file is."""
        digest = hashlib.sha256(np.ascontiguousarray(self.time).tobytes())
        for name in sorted(self.channels):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(self.channels[name].values).tobytes())
        return digest.hexdigest()

    @property
    def duration(self) -> float:
        """Time from the first to the last sample, s."""
        return float(self.time[-1] - self.time[0])

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def channel(self, name: str) -> Channel:
        """Return one channel.

        Parameters
        ----------
        name : str
            ``group/name``, as ``state/q``.

        Raises
        ------
        DataError
            Where the record has none of that name; the nearest names are suggested.
        """
        try:
            return self.channels[name]
        except KeyError:
            group, _, short = name.partition("/")
            # a name that is right has no near one: another channel is no stand-in
            right = short in KNOWN.get(group, ())
            remedy = "log it, or map the column that holds it" if right else nearest(name, self.channels)
            raise DataError(f"channel '{name}' is missing", remedy=remedy) from None

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.channel(name).values

    def matrix(self, names: Iterable[str]) -> NDArray[np.float64]:
        """Return several channels as one array, shape (channel, sample), SI.

        Parameters
        ----------
        names : iterable of str
            Each as ``group/name``.

        Raises
        ------
        DataError
            Where one is missing.
        """
        return np.array([self[name] for name in names])

    def group(self, group: str) -> tuple[str, ...]:
        """Return the names without group of all channels of a group, in the record's order.

        Parameters
        ----------
        group : str
            ``state``, ``air``, ``effector``, ``command``, ``excitation``, ``power`` or ``response``.
        """
        return tuple(n.partition("/")[2] for n in self.channels if n.startswith(group + "/"))

    def with_channels(self, *channels: Channel) -> FlightRecord:
        """Return the record with channels added or replaced.

        Parameters
        ----------
        *channels : Channel
            On the same time base.
        """
        new = {c.name: c for c in channels}
        record = copy(self)  # of which time and all other channels are checked
        record.__dict__.pop("fingerprint", None)
        record.__dict__["channels"] = {**self.channels, **new}
        record._check(new)
        return record

    def check_band(self, names: Iterable[str], f_max: float) -> None:
        """Check that channels can tell anything up to a frequency.

        Parameters
        ----------
        names : iterable of str
            Channels, each as ``group/name``.
        f_max : float
            Hz.

        Raises
        ------
        DataError
            Naming the first channel whose Nyquist frequency, of its native rate or of the record, is lower.
        """
        for name in names:
            rate = min(self.channel(name).native_rate_hz, 1 / self.dt)
            if f_max > 0.5 * rate * (1 + 1e-9):
                raise DataError(
                    f"the band reaches {f_max:g} Hz, but channel '{name}' was logged at {rate:.6g} Hz "
                    f"and tells nothing above its Nyquist frequency, {0.5 * rate:.6g} Hz",
                    remedy="lower the band or leave the channel out",
                )

    def cut(self, start: float, stop: float) -> FlightRecord:
        """Return the samples from one time to another, both included.

        Parameters
        ----------
        start, stop : float
            On the record's clock, s.

        Raises
        ------
        UsageError
            Where the interval is not inside the record.
        """
        first, last = float(self.time[0]), float(self.time[-1])
        slack = 0.5 * self.dt
        if not first - slack <= start < stop <= last + slack:
            raise UsageError(
                f"cut {start:g}:{stop:g} s is not inside the record, which runs {first:g}:{last:g} s"
            )
        low, high = np.searchsorted(self.time, [start - slack, stop + slack])
        if high - low < 2:
            raise UsageError(f"cut {start:g}:{stop:g} s holds fewer than two samples")
        channels = {n: replace(c, values=c.values[low:high]) for n, c in self.channels.items()}
        provenance = {**self.provenance, "cut_s": [start, stop]}
        return replace(self, time=self.time[low:high], channels=channels, provenance=provenance)


@dataclass(frozen=True)
class Maneuver(Viewable):
    """The stretch of a flight that a point model is made from.

    Attributes
    ----------
    record : FlightRecord
        Cut to the manoeuvre.
    vehicle : Vehicle
        The record's, with the record's own mass properties in place.
    """

    record: FlightRecord
    vehicle: Vehicle

    def __repr__(self) -> str:
        return f"<Maneuver of {self.vehicle.name!r}: {self.record!r}>"

    @classmethod
    def of(
        cls, record: FlightRecord, vehicle: Vehicle | None = None, span: tuple[float, float] | None = None
    ) -> Maneuver:
        """Cut a manoeuvre out of a record.

        Parameters
        ----------
        record : FlightRecord
        vehicle : Vehicle, optional
            Used in place of the record's.
        span : tuple of 2 floats, optional
            Start and stop on the record's clock, s; the whole record where absent.

        Raises
        ------
        DataError
            Where neither the record nor the caller describes the vehicle.
        """
        described = vehicle or record.vehicle
        if described is None:
            raise DataError(
                "the record does not describe its vehicle",
                remedy="import it with --scenario, or name a scenario now",
            )
        if record.mass_properties is not None:
            described = msgspec.structs.replace(described, mass_properties=record.mass_properties)
        return cls(record.cut(*span) if span else record, described)


def parse_span(text: str) -> tuple[float, float]:
    """Read a span written ``START:STOP``, in seconds.

    Raises
    ------
    UsageError
        Where it is not two numbers, the smaller one first.
    """
    parts = text.split(":")
    try:
        start, stop = (float(part) for part in parts)
    except ValueError:
        start, stop = 0.0, 0.0
    if not start < stop:
        raise UsageError(f"a span is START:STOP in seconds such as 12.5:72.5, not '{text}'")
    return start, stop


def _check_vehicle(vehicle: object) -> None:
    if not isinstance(vehicle, Vehicle | None):
        raise UsageError(
            f"the record's vehicle is a {type(vehicle).__name__}, expected a Vehicle",
            remedy="give it scenario.aircraft(), with the effectors and mass properties",
        )


def check_time(time: NDArray[np.float64]) -> None:
    """Check that a time base is finite, increasing and uniform.

    Raises
    ------
    DataError
        Naming the first sample where it is not.
    """
    if time.ndim != 1 or time.size < 2:
        raise DataError(f"time has shape {time.shape}, expected one axis of at least two samples")
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise DataError(f"time is not finite at sample {bad[0]}")
    steps = np.diff(time)
    for fault, found in (("repeats", steps == 0), ("runs backward", steps < 0)):
        if found.any():
            at = int(np.argmax(found))
            raise DataError(
                f"time {fault} at sample {at + 1} (t = {time[at]:.6g} then {time[at + 1]:.6g} s), "
                "expected it to increase",
                remedy="repair the clock of the log or cut around the fault",
            )
    step = (time[-1] - time[0]) / (time.size - 1)
    # The clock may be large beside the step (seconds of day): allow for its own rounding too.
    if not np.isfinite(step):
        raise DataError(f"time runs from {time[0]:g} to {time[-1]:g} s, too far for one record")
    slack = _TIME_TOLERANCE * step + 4 * np.spacing(np.abs(time).max())
    off = np.abs(steps - np.median(steps)) > 2 * slack
    if off.any():
        at = int(np.argmax(off))
        raise DataError(
            f"time is not uniform: {steps[at]:.6g} s after t = {time[at]:.6g} s where the usual step is "
            f"{np.median(steps):.6g} s ({int(off.sum())} such steps)",
            remedy="import with --resample RATE, or cut around the dropout",
        )


FORMAT = "freqid-record"
_HEADER = {
    "reference": Attribute("@reference"),
    **{
        name: Attribute(f"@{name}", json=True)
        for name in ("configuration", "provenance", "vehicle", "mass_properties")
    },
}


def write_record(path: Path, record: FlightRecord, scenario_sha256: str = "", *, kind: str = FORMAT) -> None:
    """Write a record, whole or not at all.

    Parameters
    ----------
    path : Path
    record : FlightRecord
    scenario_sha256 : str
        Of the scenario that described the vehicle.
    kind : str
        Format that the file says it has.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    UsageError
        Where the record's vehicle is none: no file of it could be read again.
    """
    store.write(path, kind, lambda file: put_record(file, record), scenario_sha256)


def put_record(file: h5py.Group, record: FlightRecord) -> None:
    """Write a record into an open file, or a group of one."""
    _check_vehicle(record.vehicle)
    time = store.put(file, "time", record.time, "s")
    time.make_scale("time")
    for channel in record.channels.values():
        group, name = split(channel.name)
        dataset = store.put(file.require_group(group), name, channel.values, channel.unit)
        dataset.dims[0].attach_scale(time)
        dataset.attrs["native_rate_hz"] = channel.native_rate_hz
        # it names the log, and the name of a file need not be UTF-8
        dataset.attrs["source"] = channel.source.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
        if channel.position_m is not None:
            dataset.attrs["position_m"] = channel.position_m
    # HDF5 lists by name; the order in which the channels were logged is kept here
    store.put_json(file, "channel_order", list(record.channels))
    put_fields(file, record, _HEADER)


def read_record(path: Path, *, kind: str = FORMAT) -> FlightRecord:
    """Read a record, or another `kind` of file of the same layout.

    Raises
    ------
    DataError
        Where the file is no intact record.
    """
    with store.reading(path, kind) as file:
        return get_record(file)


def get_record(file: h5py.Group) -> FlightRecord:
    """Read a record from an open file, or a group of one."""
    channels = {}
    for name in store.get_json(file, "channel_order") or _listed(file):
        dataset = store.dataset(file, name)
        unit = store.get_text(dataset, "units")
        if not unit:
            raise DataError(f"channel '{name}' has no unit", remedy="add the attribute 'units'")
        position = store.floats(dataset, "position_m")
        (native_rate_hz,) = store.floats(dataset, "native_rate_hz")
        si = si_unit(name) or effector_unit(unit)
        convert = to_si(unit, si, name)
        if len(position) not in (0, 3):
            raise DataError(f"channel '{name}' has a position_m of {len(position)} numbers, expected three")
        channels[name] = Channel(
            name=name,
            unit=si,
            values=convert.factor * store.array(file, name) + convert.offset,
            native_rate_hz=native_rate_hz,
            source=store.get_text(dataset, "source"),
            position_m=(position[0], position[1], position[2]) if position else None,
        )
    return FlightRecord(
        time=store.array(file, "time"), channels=channels, **get_fields(file, FlightRecord, _HEADER)
    )


def _listed(file: h5py.Group) -> list[str]:
    """Return the channels of a file that another program wrote without their order."""
    return [f"{g}/{n}" for g, group in file.items() if isinstance(group, h5py.Group) for n in group]

"""PX4's ULog files, by pyulog: every topic has its own clock."""

from __future__ import annotations

import hashlib
import io
import mmap
import re
import struct
from collections.abc import Iterable, Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.extras import extra
from freqid.core.record import FlightRecord
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.mapped import assemble_map
from freqid.flightlog.read import Reader
from freqid.flightlog.signal import NotLogged, Signal

MAGIC = b"ULog\x01\x12\x35"
_HEADER = 16
# Message types of the published format: flags, format, information, parameters, subscriptions, data, text ...
_TYPES = frozenset(b"BFIMPQARDLCSO")
_FIELD = re.compile(r"^(?P<message>\w+?)(?:\[(?P<instance>\d+)\])?\.(?P<field>.+)$")


def read_ulog(
    path: Path, column_map: ColumnMap | None, *, cut: tuple[float, float] | None = None, **options: Any
) -> FlightRecord:
    """Read the mapped fields of a ULog file.

    Parameters
    ----------
    path : Path
    column_map : ColumnMap
        Columns are ``topic.field``, of a further instance ``topic[1].field``. None is refused.
    cut : tuple of 2 floats, optional
        s since the autopilot's boot. A log that is damaged or truncated outside it may be read.
    **options
        As in `assemble`.

    Raises
    ------
    DataError
        Where pyulog is not installed; the file is truncated, damaged, holds two logs, or a topic twice;
        a mapped field is missing; or the fields do not make a record.
    UsageError
        Where there is no map; as `assemble`.

    Notes
    -----
    The time of a sample is its topic's ``timestamp_sample``, when the sensor measured, where the topic has
    one; else ``timestamp``, when it was published.
    """
    if column_map is None:
        raise UsageError(
            "a ULog file needs a column map",
            where=str(path),
            remedy="name one that comes with freqid, such as --map px4-multirotor, or make one with --list",
        )
    try:
        log = ULogFile(Path(path), _topics(column_map), whole=cut is None)
    except DataError as error:
        raise error.at(str(path)) from None

    def pick(place: Place) -> Signal:
        if not isinstance(place.column, str):
            raise DataError("a ULog file has no numbered columns", remedy="write column = 'topic.field'")
        return log.signal(place.column)

    return assemble_map(
        Path(path),
        "ulog",
        column_map,
        pick,
        cut=cut,
        provenance={"clocks": log.clocks},
        configuration=log.configuration,
        **options,
    )


def _topics(column_map: ColumnMap) -> list[str]:
    """Return the topics that a map names."""
    matches = (_FIELD.match(str(column)) for column in (*column_map.columns(), *column_map.sources()))
    return sorted({match["message"] for match in matches if match})


class ULogFile:
    """An open log.

    Parameters
    ----------
    path : Path
    topics : iterable of str, optional
        To be read; all where absent.
    whole : bool
        Whether a truncated or damaged file is refused.

    Attributes
    ----------
    clocks : dict of str to str
        By topic, the field that its times are from, of topics that were asked for.
    configuration : tuple of 3 str
        Identifier of the autopilot, its software and the hash of its parameters.
    """

    def __init__(self, path: Path, topics: Iterable[str] | None = None, *, whole: bool = True) -> None:
        pyulog = extra("pyulog", "logs", str(path))
        self.clocks: dict[str, str] = {}
        self._times: dict[tuple[str, int], NDArray[np.float64]] = {}
        check_messages(path, whole=whole)
        try:
            with redirect_stdout(io.StringIO()):  # it prints what it thinks of the file
                log = pyulog.ULog(str(path), None if topics is None else list(topics))
        except Exception as error:  # a damaged byte can make it raise almost anything
            raise DataError(
                f"no intact ULog file ({type(error).__name__})",
                remedy="copy it again from the vehicle",
            ) from None
        if whole and log.file_corruption:
            raise DataError("has damaged messages", remedy="copy it again, or read a whole part with --cut")
        self._data: dict[tuple[str, int], Any] = {}
        for data in log.data_list:
            if (data.name, data.multi_id) in self._data:
                raise DataError(
                    f"topic '{data.name}' instance {data.multi_id} is logged twice",
                    remedy="two logs were mixed; use the one of this flight",
                )
            self._data[data.name, data.multi_id] = data.data
        about = log.msg_info_dict
        settings = sorted((name, repr(value)) for name, value in log.initial_parameters.items())
        parameters = hashlib.sha256(repr(settings).encode()).hexdigest()[:16] if settings else ""
        self.configuration = (str(about.get("sys_uuid", "")), str(about.get("ver_sw", "")), parameters)

    def signal(self, column: str) -> Signal:
        """Return one field.

        Raises
        ------
        NotLogged
            Where the log has no such topic, instance or field.
        DataError
            Where the topic has no time.
        """
        match = _FIELD.match(column)
        if match is None:
            raise DataError(f"column '{column}' is not of the form topic.field")
        key = match["message"], int(match["instance"] or 0)
        if key not in self._data:
            raise NotLogged(
                f"topic '{key[0]}' instance {key[1]} is not in the log",
                remedy=nearest(key[0], {name for name, _ in self._data}),
            )
        fields = self._data[key]
        if match["field"] not in fields:
            raise NotLogged(
                f"topic '{key[0]}' has no field '{match['field']}'", remedy=nearest(match["field"], fields)
            )
        return Signal(column, self._time(key), np.asarray(fields[match["field"]], dtype=np.float64))

    def _time(self, key: tuple[str, int]) -> NDArray[np.float64]:
        """Return the clock of a topic, s; one array for all of its fields."""
        if key not in self._times:
            fields = self._data[key]
            sampled = fields.get("timestamp_sample")
            named = "timestamp_sample" if sampled is not None and (sampled > 0).all() else "timestamp"
            if named not in fields:
                raise DataError(f"topic '{key[0]}' has no timestamp")
            self.clocks[key[0]] = named
            self._times[key] = 1e-6 * fields[named].astype(np.float64)
        return self._times[key]

    def signals(self) -> Iterator[Signal]:
        """Yield every field of every topic."""
        for (name, instance), fields in self._data.items():
            topic = f"{name}[{instance}]" if instance else name
            for field in fields:
                if not field.startswith(("timestamp", "_padding")):
                    yield self.signal(f"{topic}.{field}")


def check_messages(path: Path, *, whole: bool) -> None:
    """Follow a file from message to message to its end.

    Raises
    ------
    DataError
        Where it is no ULog file; a second log follows in it; or, if `whole`, it ends inside a message or
        a message of unknown type follows.
    """
    if path.stat().st_size < _HEADER or not _starts_with_magic(path):
        raise DataError("is no ULog file, it does not begin as one", remedy="check the path")
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:
        at, size, unpack = _HEADER, len(raw), struct.Struct("<HB").unpack_from
        while at < size:
            if raw[at : at + len(MAGIC)] == MAGIC:
                raise _joined(raw[:at], raw[at:], at)
            length, kind = unpack(raw, at) if at + 3 <= size else (0, 0)
            if kind and kind not in _TYPES:
                if whole:
                    raise DataError(
                        f"is damaged at byte {at}: a message of unknown type {kind}",
                        remedy="copy it again from the vehicle, or read a whole part with --cut START:STOP",
                    )
                return
            if not kind or at + 3 + length > size:
                if whole:
                    raise DataError(
                        f"is truncated: it ends inside the message at byte {at} of {size}",
                        remedy="copy it again from the vehicle, or read a whole part with --cut START:STOP",
                    )
                return
            at += 3 + length


def _starts_with_magic(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _joined(first: bytes, second: bytes, at: int) -> DataError:
    """Return the error of a file that holds two logs, with the vehicles where they differ."""
    import pyulog

    names = []
    for part in (first, second):
        try:
            with redirect_stdout(io.StringIO()):
                names.append(str(pyulog.ULog(io.BytesIO(part)).msg_info_dict.get("sys_uuid", "")))
        except Exception:  # the second log may be damaged too
            names.append("")
    if names[0] != names[1]:
        who = f"the logs of two vehicles are mixed ('{names[0]}' and '{names[1]}')"
    else:
        who = "two logs are joined"
    return DataError(f"{who}: a second one begins at byte {at}", remedy="split the file there")


def ulog_signals(path: Path) -> Iterator[Signal]:
    """Yield all fields of a log; for listing."""
    try:
        log = ULogFile(Path(path), whole=False)
    except DataError as error:
        raise error.at(str(path)) from None
    yield from log.signals()


READER = Reader((".ulg", ".ulog"), read_ulog, signals=ulog_signals)

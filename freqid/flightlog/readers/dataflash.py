"""ArduPilot's DataFlash logs: pymavlink finds the messages, their fields are decoded together."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.extras import extra
from freqid.core.record import FlightRecord
from freqid.core.units import parse_unit
from freqid.flightlog.column_map import ColumnMap, Place
from freqid.flightlog.mapped import assemble_map
from freqid.flightlog.read import Reader
from freqid.flightlog.resample import LONGEST_GAP
from freqid.flightlog.signal import NotLogged, Signal

MAGIC = b"\xa3\x95"
_HEADER = 3  # two magic bytes and the message's type
_FMT = 0x80
# numpy's type by the letter of the format; texts and arrays are not decoded.
_NUMBERS = {
    **{"b": "<i1", "B": "<u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8"},
    **{
        "f": "<f4",
        "d": "<f8",
        "g": "<f2",
        "c": "<i2",
        "C": "<u2",
        "e": "<i4",
        "E": "<u4",
        "L": "<i4",
        "M": "<i1",
    },
}
_SIZES = {"a": 64, "n": 4, "N": 16, "Z": 64}
_BLOCK = 100_000  # messages decoded at a time
_FIELD = re.compile(r"^(?P<message>\w+?)(?:\[(?P<instance>\d+)\])?\.(?P<field>\w+)$")
_INSTANCES = ("I", "Instance", "C", "IMU")  # of logs that do not say which field counts instances
_VEHICLES = ("SYSID_THISMAV", "MAV_SYSID", "BRD_SERIAL_NUM")
# Where the system-identification mode injects, by its parameter SID_AXIS, and the unit of its signal.
CHIRP_AXES = {
    1: ("input_roll", "deg"),
    2: ("input_pitch", "deg"),
    3: ("input_yaw", "deg"),
    4: ("recover_roll", "deg"),
    5: ("recover_pitch", "deg"),
    6: ("recover_yaw", "deg"),
    7: ("rate_roll", "deg/s"),
    8: ("rate_pitch", "deg/s"),
    9: ("rate_yaw", "deg/s"),
    10: ("mixer_roll", "1"),
    11: ("mixer_pitch", "1"),
    12: ("mixer_yaw", "1"),
    13: ("mixer_thrust", "1"),
}


def read_dataflash(path: Path, column_map: ColumnMap | None, **options: Any) -> FlightRecord:
    """Read the mapped fields of a DataFlash log.

    Parameters
    ----------
    path : Path
    column_map : ColumnMap
        Columns are ``message.field``, of a further instance ``message[1].field``. ``SID.<axis>`` is what the
        system-identification mode injects there, zero while it does not. None is refused.
    **options
        As in `assemble`.

    Raises
    ------
    DataError
        Where pymavlink is not installed; the file is no DataFlash log, holds two, or a message twice; a
        mapped field is missing; or the fields do not make a record.
    UsageError
        Where there is no map; as `assemble`.
    """
    if column_map is None:
        raise UsageError(
            "a DataFlash log needs a column map",
            where=str(path),
            remedy="name one that comes with freqid, as --map ardupilot-multirotor, or make one with --list",
        )
    try:
        log = DataFlashFile(Path(path))
    except DataError as error:
        raise error.at(str(path)) from None

    def pick(place: Place) -> Signal:
        if not isinstance(place.column, str):
            raise DataError(
                "a DataFlash log has no numbered columns", remedy="write column = 'message.field'"
            )
        return log.signal(place.column)

    return assemble_map(
        Path(path),
        "dataflash",
        column_map,
        pick,
        configuration=log.configuration,
        provenance=log.about,
        **options,
    )


class DataFlashFile:
    """An open log.

    Attributes
    ----------
    configuration : tuple of 3 str
        Identifier of the vehicle, its software and the hash of its parameters.
    about : dict
        The chirps of the system-identification mode, for the provenance.
    """

    def __init__(self, path: Path) -> None:
        reader = extra("pymavlink.DFReader", "logs", str(path))
        if not _starts_with_magic(path):
            raise DataError("is no DataFlash log, it does not begin as one", remedy="check the path")
        self._log = reader.DFReader_binary.__new__(reader.DFReader_binary)
        self._log.init_clock = lambda: None  # each field has its times; looking for a clock may not end
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                self._log.__init__(str(path))
        except Exception as error:  # a damaged byte can make it raise almost anything
            raise DataError(
                f"no intact DataFlash log ({type(error).__name__})", remedy="copy it again from the vehicle"
            ) from None
        finally:
            if hasattr(self._log, "filehandle"):
                self._log.filehandle.close()  # the mapping of the file stays
        self._raw = np.frombuffer(self._log.data_map, dtype=np.uint8)
        self._offsets: dict[str, NDArray[np.int64]] = {}
        self._formats: dict[str, Any] = {}
        for kind, fmt in self._log.formats.items():
            at = np.array(self._log.offsets[kind], dtype=np.int64)
            at = at[at + fmt.len <= self._raw.size]  # the last message may be half written
            if not at.size:
                continue
            if fmt.name in self._formats:
                raise DataError(
                    f"message '{fmt.name}' is defined twice", remedy="two logs were mixed; use one of them"
                )
            self._formats[fmt.name], self._offsets[fmt.name] = fmt, at
        self._times: dict[tuple[str, int | None], NDArray[np.float64]] = {}
        parameters = self._parameters()
        self._check_one_log(parameters)
        hashed = hashlib.sha256(repr(sorted(parameters.items())).encode()).hexdigest()[:16]
        vehicle = next((f"{n} {v[-1]:g}" for n in _VEHICLES if (v := parameters.get(n))), "")
        texts = self._texts("MSG", "Message")
        software = next((t for t in texts if t.startswith("Ardu") or t.startswith("Blimp")), "")
        self.configuration = (vehicle, software, hashed if parameters else "")
        self._chirps = self._find_chirps()
        self.about = (
            {"chirps": {n: len(ends) for n, (_, _, ends) in self._chirps.items()}} if self._chirps else {}
        )

    def _parameters(self) -> dict[str, list[float]]:
        """Return the values of each parameter, in the order in which they were logged."""
        found: dict[str, list[float]] = {}
        if "PARM" in self._formats:
            names = self._texts("PARM", "Name")  # none where a damaged format has another field
            for name, value in zip(names, self._numbers("PARM", "Value").tolist(), strict=bool(names)):
                found.setdefault(name, []).append(value)
        return found

    def _check_one_log(self, parameters: dict[str, list[float]]) -> None:
        """Refuse two logs in one file: the format of formats is written once, at the beginning."""
        own = int((self._raw[self._offsets["FMT"] + _HEADER] == _FMT).sum()) if "FMT" in self._offsets else 0
        for name in _VEHICLES:
            values = sorted(set(parameters.get(name, ())))
            if own > 1 and len(values) > 1:
                raise DataError(
                    f"the logs of two vehicles are mixed: {name} is {values[0]:g} and {values[1]:g}",
                    remedy="use the log of one",
                )
        if own > 1:
            raise DataError("two logs are joined: its formats are defined twice", remedy="use one of them")

    def _place(self, message: str, field: str) -> tuple[int, str]:
        """Return where a field stands in its message, bytes, and the letter of its format."""
        fmt, at = self._formats[message], 0
        for letter, name in zip(fmt.format, fmt.columns, strict=False):
            if name == field:
                return at, letter
            at += np.dtype(_NUMBERS[letter]).itemsize if letter in _NUMBERS else _SIZES[letter]
        raise NotLogged(f"message '{message}' has no field '{field}'", remedy=nearest(field, fmt.columns))

    def _bytes(self, message: str, at: int, size: int) -> Iterator[NDArray[np.uint8]]:
        offsets = self._offsets[message] + _HEADER + at
        for first in range(0, offsets.size, _BLOCK):
            yield self._raw[offsets[first : first + _BLOCK, None] + np.arange(size)]

    def _numbers(self, message: str, field: str) -> NDArray[np.float64]:
        """Return a numeric field of all messages of a kind, in the units of the log."""
        at, letter = self._place(message, field)
        if letter not in _NUMBERS:
            raise DataError(f"field '{message}.{field}' holds no numbers", remedy="map another one")
        kind = np.dtype(_NUMBERS[letter])
        parts = [
            np.ascontiguousarray(part).view(kind)[:, 0] for part in self._bytes(message, at, kind.itemsize)
        ]
        fmt = self._formats[message]
        factor = fmt.msg_mults[fmt.columns.index(field)] or 1.0
        return np.concatenate(parts).astype(np.float64) * factor

    def _texts(self, message: str, field: str) -> list[str]:
        if message not in self._formats or field not in self._formats[message].columns:
            return []
        at, letter = self._place(message, field)
        rows = (row for part in self._bytes(message, at, _SIZES.get(letter, 1)) for row in part)
        return [row.tobytes().partition(b"\0")[0].decode("latin-1") for row in rows]

    def _instances(self, message: str) -> NDArray[np.float64] | None:
        """Return which instance each message is of, or None where they are not counted."""
        fmt = self._formats[message]
        named = fmt.instance_field or next((n for n in _INSTANCES if n in fmt.columns), None)
        if named is None or fmt.format[fmt.columns.index(named)] not in "bBM":
            return None
        return self._numbers(message, named)

    def signal(self, column: str) -> Signal:
        """Return one field, or one axis of the system-identification mode.

        Raises
        ------
        NotLogged
            Where the log has none.
        DataError
            Where the message has no time.
        """
        match = _FIELD.match(column)
        if match is None:
            raise DataError(f"column '{column}' is not of the form message.field")
        message, field = match["message"], match["field"]
        if message == "SID":
            if field not in self._chirps:
                raise NotLogged(f"the log has no chirp on '{field}'", remedy=nearest(field, self._chirps))
            time, values, ends = self._chirps[field]
            unit = next(unit for name, unit in CHIRP_AXES.values() if name == field)
            return Signal(column, time, values, unit, f"{len(ends)} chirps of the system-identification mode")
        if message not in self._formats:
            raise NotLogged(f"message '{message}' is not in the log", remedy=nearest(message, self._formats))
        values = self._numbers(message, field)
        instances = self._instances(message)
        wanted = None
        if instances is not None:
            wanted = int(match["instance"] or instances.min())
            values = values[instances == wanted]
        if (instances is None and int(match["instance"] or 0) > 0) or not values.size:
            raise NotLogged(f"message '{message}' has no instance {match['instance']}")
        unit = self._formats[message].get_unit(field)
        return Signal(column, self._time(message, wanted, instances), values, unit if _known(unit) else "")

    def _time(
        self, message: str, wanted: int | None, instances: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """Return the clock of one instance of a message, s; one array for all of its fields."""
        if (message, wanted) not in self._times:
            columns = self._formats[message].columns
            named = next((n for n in ("TimeUS", "TimeMS") if n in columns), None)
            if named is None:
                raise DataError(f"message '{message}' has no time", remedy="map another one")
            time = self._numbers(message, named) * (1e-6 if named == "TimeUS" else 1e-3)
            self._times[message, wanted] = time if instances is None else time[instances == wanted]
        return self._times[message, wanted]

    def _find_chirps(
        self,
    ) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64], list[tuple[float, float]]]]:
        """Return the injected signal of each axis: time, values, and the chirps' starts and stops, s.

        ``SIDS`` says at each start which axis is excited, ``SIDD`` logs the signal while it is. Outside,
        nothing is injected: zeros at the rate of the signal fill the rest of the log.
        """
        if not {"SIDS", "SIDD"} <= set(self._formats):
            return {}
        starts, axes = self._numbers("SIDS", "TimeUS") * 1e-6, self._numbers("SIDS", "Ax")
        time, values = self._numbers("SIDD", "TimeUS") * 1e-6, self._numbers("SIDD", "Targ")
        if time.size < 2 or (np.diff(time) <= 0).any():
            return {}
        step = float(np.median(np.diff(time)))
        # The message that announces a chirp may be written a sample after the first of its signal.
        axis = axes[np.maximum(np.searchsorted(starts, time + step, side="right") - 1, 0)]
        clock = next((n for n in ("RATE", "ATT", "IMU") if n in self._formats), "SIDD")
        span = self._numbers(clock, "TimeUS")[[0, -1]] * 1e-6
        found = {}
        for number in np.unique(axis):
            if int(number) not in CHIRP_AXES:
                continue
            own, injected = time[axis == number], values[axis == number]
            edges = np.flatnonzero(np.diff(own) > LONGEST_GAP * step)
            ends = list(
                zip(own[np.r_[0, edges + 1]].tolist(), own[np.r_[edges, own.size - 1]].tolist(), strict=True)
            )
            stops = [min(span[0], own[0]) - step, *(stop for _, stop in ends)]
            begins = [*(start for start, _ in ends), max(span[1], own[-1]) + step]
            quiet = [
                np.arange(1, round((begin - stop) / step)) * step + stop
                for stop, begin in zip(stops, begins, strict=True)
            ]
            every = np.concatenate([own, *quiet])
            signal = np.concatenate([injected, np.zeros(every.size - own.size)])
            order = np.argsort(every, kind="stable")
            found[CHIRP_AXES[int(number)][0]] = every[order], signal[order], ends
        return found

    def signals(self) -> Iterator[Signal]:
        """Yield every numeric field of every message that has a time, and the chirps."""
        for axis in self._chirps:
            yield self.signal(f"SID.{axis}")
        for message, fmt in self._formats.items():
            if not {"TimeUS", "TimeMS"} & set(fmt.columns):
                continue
            instances = self._instances(message)
            several = np.unique(instances).astype(int).tolist() if instances is not None else [None]
            for instance in several:
                name = message if instance is None else f"{message}[{instance}]"
                for letter, field in zip(fmt.format, fmt.columns, strict=False):
                    if letter in _NUMBERS and field not in ("TimeUS", "TimeMS", fmt.instance_field):
                        yield self.signal(f"{name}.{field}")


def _known(unit: str) -> bool:
    try:
        parse_unit(unit)
    except DataError:
        return False
    return True


def _starts_with_magic(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def dataflash_signals(path: Path) -> Iterator[Signal]:
    """Yield all numeric fields of a log; for listing."""
    try:
        log = DataFlashFile(Path(path))
    except DataError as error:
        raise error.at(str(path)) from None
    yield from log.signals()


READER = Reader((".bin", ".log"), read_dataflash, signals=dataflash_signals)

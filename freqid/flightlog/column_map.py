"""The column map: which column of a log is which channel, in which unit and with which sign."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Literal

from freqid.core.channels import ATTITUDE, VELOCITY, split
from freqid.core.errors import DataError, nearest
from freqid.core.toml import read_toml
from freqid.core.vehicle import Strict, Vector

MASS_PROPERTIES = {
    "mass": "kg",
    "cg_x": "m",
    "cg_y": "m",
    "cg_z": "m",
    "Ixx": "kg m2",
    "Iyy": "kg m2",
    "Izz": "kg m2",
    "Ixz": "kg m2",
    "Ixy": "kg m2",
    "Iyz": "kg m2",
}


class Place(Strict, frozen=True):
    """Where a quantity stands in a log, and in which unit.

    Attributes
    ----------
    column : int or str, optional
        Number, counted from 1, or the name in the header (in MATLAB files: in the labels; in autopilots'
        logs: ``message.field``, of a further instance ``message[1].field``).
    variable : str, optional
        MATLAB files only: the variable, with dots into structs; the map's own where absent.
    unit : str
        Unit as logged. Never assumed: a map without one is refused.
    """

    column: int | str | None = None
    variable: str | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        if self.column is None and self.variable is None:
            raise ValueError("neither column nor variable is stated, expected one of them or both")
        if isinstance(self.column, int) and self.column < 1:
            raise ValueError(f"column is {self.column}, expected a number counted from 1")


class TimePlace(Place, frozen=True):
    """Section ``[time]``.

    Attributes
    ----------
    epoch : {"", "unix", "gps"}
        What the clock counts from, if from one of these: the record's time then starts with the log, and the
        date goes into the provenance. In unit ``"date"`` the column holds dates and times of day as text.
    week : int or str, optional
        Column of the GPS week, where the clock counts the seconds of the week.
    """

    epoch: Literal["", "unix", "gps"] = ""
    week: int | str | None = None


class ChannelPlace(Place, frozen=True, kw_only=True):
    """One ``[[channel]]``.

    Attributes
    ----------
    name : str
        ``group/name`` of the channel.
    sign : {1, -1}
        -1 where the log counts the quantity the other way round.
    position_m : tuple of 3 floats, optional
        Position of the sensor in vehicle axes, m.
    rate_hz : float, optional
        Rate at which the source measured, where the log repeats its values at a higher one.
    scale, offset : float
        The quantity in `unit` is ``scale * logged + offset``: 25 deg at a servo command of one, say.
    time : int or str, optional
        Tables and structs only: where this channel's own clock stands, in the unit of ``[time]``.
    otherwise : tuple of str
        Columns that are taken, the first that the log has, where it lacks `column`.
    optional : bool
        Whether the channel is left out where the log has none of these.
    """

    name: str
    sign: Literal[1, -1] = 1
    position_m: Vector | None = None
    rate_hz: float | None = None
    scale: float = 1.0
    offset: float = 0.0
    time: int | str | None = None
    otherwise: tuple[str, ...] = ()
    optional: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.scale != 0 and isfinite(self.scale) and isfinite(self.offset)):
            raise ValueError(
                f"scale is {self.scale:g} and offset {self.offset:g}, expected finite numbers, scale not zero"
            )
        if self.rate_hz is not None and not (self.rate_hz > 0 and isfinite(self.rate_hz)):
            raise ValueError(f"rate_hz is {self.rate_hz:g}, expected a positive rate")
        if self.position_m is not None and not all(isfinite(x) for x in self.position_m):
            raise ValueError(f"position_m is {list(self.position_m)}, expected finite numbers")


class MassPlace(Place, frozen=True, kw_only=True):
    """One ``[[mass_property]]``: a column, or scalar variable, whose mean over the record is used.

    Attributes
    ----------
    name : str
        One of mass, cg_x, cg_y, cg_z, Ixx, Iyy, Izz, Ixz, Ixy, Iyz.
    sign : {1, -1}
    """

    name: Literal["mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz", "Ixy", "Iyz"]
    sign: Literal[1, -1] = 1


class AttitudePlace(Strict, frozen=True, kw_only=True):
    """Section ``[attitude]``: roll, pitch and heading from a quaternion.

    Attributes
    ----------
    quaternion : tuple of 4 str
        Columns of w, x, y, z, the turn that takes forward-right-down to north-east-down.
    """

    quaternion: tuple[str, str, str, str]


class VelocityPlace(Strict, frozen=True, kw_only=True):
    """Section ``[velocity]``: ``u v w`` from the velocity over the ground, by the attitude.

    Attributes
    ----------
    ned : tuple of 3 str
        Columns of north, east and down, m/s.
    attitude : tuple of 3 str, optional
        Columns of roll, pitch and heading; the quaternion of ``[attitude]`` where absent.
    attitude_unit : str
    wind : tuple of 2 str, optional
        Columns of the air's velocity north and east, m/s, that the autopilot estimates; still air where the
        log has none.
    """

    ned: tuple[str, str, str]
    attitude: tuple[str, str, str] | None = None
    attitude_unit: str = "deg"
    wind: tuple[str, str] | None = None


class RotorPlace(Strict, frozen=True, kw_only=True):
    """One ``[[rotor]]``: its speed from the ESC's telemetry, else from the command and the battery's voltage.

    Attributes
    ----------
    name : str
        The channel is ``effector/<name>``.
    telemetry : str, optional
        Column of the measured speed; not used where it is zero throughout.
    telemetry_unit : str
    telemetry_scale : float
        Mechanical by logged speed: two over the number of magnet poles where electrical speed is logged.
    command : str, optional
        Column of the command to the motor.
    off, full : float
        Command at which the motor stands, and at full.
    voltage : str, optional
        Column of the battery's voltage, V.
    full_speed_rpm, full_voltage : float, optional
        Speed at full command and that voltage. Without them the speed is relative, of unit 1: command times
        voltage over the mean voltage.
    """

    name: str
    telemetry: str | None = None
    telemetry_unit: str = "rpm"
    telemetry_scale: float = 1.0
    command: str | None = None
    off: float = 0.0
    full: float = 1.0
    voltage: str | None = None
    full_speed_rpm: float | None = None
    full_voltage: float | None = None

    def __post_init__(self) -> None:
        if self.telemetry is None and self.command is None:
            raise ValueError(f"rotor '{self.name}' has neither telemetry nor command, expected one of them")
        if (self.full_speed_rpm is None) != (self.full_voltage is None):
            raise ValueError(f"rotor '{self.name}': full_speed_rpm and full_voltage are stated together")
        if self.full == self.off:
            raise ValueError(f"rotor '{self.name}': off and full are both {self.full:g}")


class RecordEntries(Strict, frozen=True):
    """Section ``[record]``: which airframe flew, with which software, at which reference condition."""

    tail: str = ""
    firmware: str = ""
    parameter_hash: str = ""
    reference: str = ""


class ColumnMap(Strict, frozen=True):
    """A whole map.

    Attributes
    ----------
    time : TimePlace, optional
        Absent for autopilots' logs, where every message has its own clock.
    channel : tuple of ChannelPlace
    mass_property : tuple of MassPlace
    attitude : AttitudePlace, optional
    velocity : VelocityPlace, optional
    rotor : tuple of RotorPlace
    record : RecordEntries
    variable : str, optional
        MATLAB files only: the matrix that columns are taken from; the file's only one where absent.
    labels : str, optional
        MATLAB files only: the cell array that names the matrix's columns.
    """

    time: TimePlace | None = None
    channel: tuple[ChannelPlace, ...] = ()
    mass_property: tuple[MassPlace, ...] = ()
    attitude: AttitudePlace | None = None
    velocity: VelocityPlace | None = None
    rotor: tuple[RotorPlace, ...] = ()
    record: RecordEntries = RecordEntries()
    variable: str | None = None
    labels: str | None = None

    def __post_init__(self) -> None:
        derived = [f"effector/{rotor.name}" for rotor in self.rotor]
        derived += ATTITUDE if self.attitude else ()
        derived += VELOCITY if self.velocity else ()
        channels = [place.name for place in self.channel]
        masses: list[str] = [place.name for place in self.mass_property]
        for kind, names in (("channel", [*channels, *derived]), ("mass_property", masses)):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"{kind} names {twice} more than once, expected each name once")
        if self.velocity and not (self.attitude or self.velocity.attitude):
            raise ValueError("[velocity] needs an attitude, expected [attitude] or its own key attitude")
        if not (channels or derived):
            raise ValueError("no channel is mapped, expected at least one [[channel]]")

    def columns(self) -> list[int | str]:
        """Return the columns of clocks, channels and mass properties, each as often as the map names it."""
        named = [self.time.column, self.time.week] if self.time else []
        for place in self.channel:
            named += [place.column, place.time, *place.otherwise]
        named += [place.column for place in self.mass_property]
        return [column for column in named if column is not None]

    def sources(self) -> list[str]:
        """Return the columns that attitude, velocity and rotors are made from."""
        named: list[str | None] = [*self.attitude.quaternion] if self.attitude else []
        if self.velocity:
            named += [*self.velocity.ned, *(self.velocity.attitude or ()), *(self.velocity.wind or ())]
        for rotor in self.rotor:
            named += [rotor.telemetry, rotor.command, rotor.voltage]
        return [column for column in named if column is not None]


SHIPPED = Path(__file__).parent / "maps"


def find_map(name: Path | str) -> Path:
    """Return the path of a map, or of a shipped map that is named without path and suffix.

    Raises
    ------
    DataError
        For a plain name that is neither; the shipped maps are listed.

    Examples
    --------
    >>> find_map("px4-multirotor").name
    'px4-multirotor.toml'
    """
    path = Path(name)
    if path.parent == Path() and not path.suffix and not path.exists():
        shipped = SHIPPED / f"{path}.toml"
        if not shipped.is_file():
            known = nearest(str(path), (p.stem for p in SHIPPED.glob("*.toml")))
            raise DataError(
                "is neither a file nor a map that comes with freqid", where=str(path), remedy=known
            )
        return shipped
    return path


def read_column_map(path: Path | str) -> ColumnMap:
    """Read and validate a column map.

    Parameters
    ----------
    path : path or str
        TOML file, or the name of a map that comes with freqid.

    Raises
    ------
    DataError
        Where the file cannot be read or is no TOML, or for a channel of an unknown name; the nearest
        names are suggested.
    UsageError
        For an unknown key or a wrong value, with its path.
    """
    column_map, _ = read_toml(find_map(path), ColumnMap)
    try:
        for name in (
            *(p.name for p in column_map.channel),
            *(f"effector/{r.name}" for r in column_map.rotor),
        ):
            split(name)
    except DataError as error:
        raise error.at(str(path)) from None
    return column_map

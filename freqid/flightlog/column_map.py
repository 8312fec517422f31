"""The column map: which column of a log is which channel, in which unit and with which sign."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Literal

from freqid.core.channels import split
from freqid.core.errors import DataError
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
        Number, counted from 1, or the name in the header (in MATLAB files: in the labels).
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
    """

    name: str
    sign: Literal[1, -1] = 1
    position_m: Vector | None = None
    rate_hz: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
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
    time : Place
    channel : tuple of ChannelPlace
    mass_property : tuple of MassPlace
    record : RecordEntries
    variable : str, optional
        MATLAB files only: the matrix that columns are taken from; the file's only one where absent.
    labels : str, optional
        MATLAB files only: the cell array that names the matrix's columns.
    """

    time: Place
    channel: tuple[ChannelPlace, ...]
    mass_property: tuple[MassPlace, ...] = ()
    record: RecordEntries = RecordEntries()
    variable: str | None = None
    labels: str | None = None

    def __post_init__(self) -> None:
        for kind, places in (("channel", self.channel), ("mass_property", self.mass_property)):
            names = [place.name for place in places]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"{kind} names {twice} more than once, expected each name once")
        if not self.channel:
            raise ValueError("no channel is mapped, expected at least one [[channel]]")


def read_column_map(path: Path) -> ColumnMap:
    """Read and validate a column map.

    Parameters
    ----------
    path : Path
        TOML file.

    Raises
    ------
    DataError
        Where the file cannot be read or is no TOML, or for a channel of an unknown name; the nearest
        names are suggested.
    UsageError
        For an unknown key or a wrong value, with its path.
    """
    column_map, _ = read_toml(path, ColumnMap)
    try:
        for place in column_map.channel:
            split(place.name)
    except DataError as error:
        raise error.at(str(path)) from None
    return column_map

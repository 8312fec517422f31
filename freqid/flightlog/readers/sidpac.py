"""SIDPAC's 90-column MATLAB files, read into a record and written from one.

Names and units are those that the files carry themselves (``fds.varlab``, ``fds.varunits``).
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.units import parse_unit
from freqid.core.vehicle import MassProperties, Vehicle
from freqid.flightlog.assemble import Column, assemble, effector_si
from freqid.flightlog.column_map import ColumnMap
from freqid.flightlog.read import Reader
from freqid.flightlog.readers.matlab import load_variables, lookup, numeric, texts

WIDTH = 90

# column (from 1), its name there, its unit there, our channel
CHANNELS = (
    (2, "V", "fps", "air/V"),
    (3, "beta", "deg", "air/beta"),
    (4, "alpha", "deg", "air/alpha"),
    (5, "p", "dps", "state/p"),
    (6, "q", "dps", "state/q"),
    (7, "r", "dps", "state/r"),
    (8, "phi", "deg", "state/phi"),
    (9, "the", "deg", "state/theta"),
    (10, "psi", "deg", "state/psi"),
    (11, "ax", "g", "state/ax"),  # at the centre of gravity
    (12, "ay", "g", "state/ay"),
    (13, "az", "g", "state/az"),
    (14, "el", "deg", "effector/de"),
    (15, "ail", "deg", "effector/da"),
    (16, "rdr", "deg", "effector/dr"),
    (17, "tef", "deg", "effector/tef"),
    (18, "lef", "deg", "effector/lef"),
    (27, "qbar", "psf", "air/qbar"),
    (28, "mach", "", "air/mach"),
    (29, "rho", "slug/ft3", "air/rho"),
    (30, "alt", "ft", "state/alt"),
    (31, "lonstk", "in", "command/lonstk"),
    (32, "latstk", "in", "command/latstk"),
    (33, "rudped", "in", "command/rudped"),
    (34, "thtl", "deg", "command/thtl"),
    (38, "thrust", "lbf", "effector/thrust1"),
    (39, "", "lbf", "effector/thrust2"),  # the files leave its label blank
    (42, "pdot", "dps2", "state/pdot"),
    (43, "qdot", "dps2", "state/qdot"),
    (44, "rdot", "dps2", "state/rdot"),
    (58, "ptv", "deg", "effector/ptv"),
    (59, "qtv", "deg", "effector/qtv"),
    (60, "rtv", "deg", "effector/rtv"),
    (61, "CX", "", "response/CX"),
    (62, "CY", "", "response/CY"),
    (63, "CZ", "", "response/CZ"),
    (64, "Cl", "", "response/Cl"),
    (65, "Cm", "", "response/Cm"),
    (66, "Cn", "", "response/Cn"),
    (71, "phat", "", "air/phat"),
    (72, "qhat", "", "air/qhat"),
    (73, "rhat", "", "air/rhat"),
    (74, "u", "fps", "state/u"),
    (75, "v", "fps", "state/v"),
    (76, "w", "fps", "state/w"),
)

# Fuselage stations count aft and waterlines up, so x and z change sign in vehicle axes. Their Ixz
# is the integral of + x z dm, as ours, and both signs change together.
MASS = (
    (45, "xcg", "in", "cg_x", -1),
    (46, "ycg", "in", "cg_y", 1),
    (47, "zcg", "in", "cg_z", -1),
    (48, "mass", "slug", "mass", 1),
    (49, "Ixx", "slug-ft2", "Ixx", 1),
    (50, "Iyy", "slug-ft2", "Iyy", 1),
    (51, "Izz", "slug-ft2", "Izz", 1),
    (52, "Ixz", "slug-ft2", "Ixz", 1),
)
GEOMETRY = ((77, "sarea", "ft2", "area_m2"), (78, "bspan", "ft", "span_m"), (79, "cbar", "ft", "chord_m"))

# As measured, where the sensor is: a record that says where its accelerometers are writes them here.
MEASURED_ACCELERATION = {"state/ax": (53, "axm"), "state/ay": (54, "aym"), "state/az": (55, "azm")}

# Blank in the layout; further effectors are written here under their own name and read by it.
SPARE = (*range(19, 27), 35, 36, 37, 40, 41, *range(80, 91))

# Units that the files spell in a way of their own.
SPELLED = {"": "1", "dps2": "deg/s2", "sec": "s"}


_SPARE_UNITS = {"rad": "deg", "rad/s": "rad/s", "N": "lbf", "1": "", "m": "in"}  # by the channel's SI unit
_UNNAMED = "unnamed"


def is_sidpac(path: Path, column_map: ColumnMap | None = None) -> bool:
    """Tell whether a MATLAB file holds a SIDPAC data matrix; with a map it is read by that."""
    return column_map is None and _matrix_name(load_variables(path)) is not None


def read_sidpac(path: Path, column_map: None = None, **options: Any) -> FlightRecord:
    """Read a SIDPAC file by its standard columns.

    Parameters
    ----------
    path : Path
        MATLAB file with ``fdata`` (sample x 90), and ``t`` and ``fds`` where present.
    column_map : None
        The columns are SIDPAC's.
    **options
        `cut`, `resample_hz`, `vehicle` as in `assemble`.

    Returns
    -------
    FlightRecord
        Without the columns that are zero throughout. Mass properties are the means of their columns, the
        centre of gravity turned from stations in inches (aft, right, up) into vehicle axes. Unless
        `vehicle` is given, a vehicle of that mass and reference geometry describes the aircraft.

    Raises
    ------
    DataError
        Where the file is no intact SIDPAC file, or states other units than the layout.
    UsageError
        As `assemble`.
    """
    variables = load_variables(path)
    try:
        name = _matrix_name(variables)
        if name is None:
            raise DataError(f"holds no fdata with {WIDTH} columns", remedy="read it with a column map")
        fdata = numeric(variables, name)
        labels = _of_width(texts(lookup(variables, "fds.varlab")))
        units = [u.strip(" ()") for u in _of_width(texts(lookup(variables, "fds.varunits")))]
        time = _time(variables, fdata)
        layout = [*CHANNELS, *((n, label, unit, ours) for n, label, unit, ours, _ in MASS)]
        for number, label, unit, _ in layout:
            _check_unit(number, label, units[number - 1], unit)
    except DataError as error:
        raise error.at(str(path)) from None

    def column(number: int, ours: str, unit: str, sign: int = 1) -> Column:
        return Column(
            name=ours,
            values=fdata[:, number - 1],
            unit=SPELLED.get(unit, unit),
            source=f"{Path(path).name}: SIDPAC column {number}, {SPELLED.get(unit, unit)}",
            sign=sign,
        )

    used = {n for n in range(1, WIDTH + 1) if fdata[:, n - 1].any()}
    claimed = {1, *(n for n, *_ in CHANNELS), *(n for n, *_ in MASS), *(n for n, *_ in GEOMETRY)}
    columns = [column(n, ours, unit) for n, _, unit, ours in CHANNELS if n in used]
    named = {ours for *_, ours in CHANNELS}
    for number in sorted(used & set(SPARE)):
        ours, unit = f"effector/{labels[number - 1]}", units[number - 1]
        if re.fullmatch(r"[A-Za-z]\w*", labels[number - 1]) and ours not in named and _steers(unit):
            columns.append(column(number, ours, unit))
            named.add(ours)
            claimed.add(number)
    described = {48, 49, 50, 51} <= used
    mass = [column(n, ours, unit, sign) for n, _, unit, ours, sign in MASS] if described else []
    start = float(fdata[0, 0]) - float(time[0])  # of Python, which does not warn of infinities
    about = {
        "aircraft": _text(variables, "fds.aircraft") or _UNNAMED,
        "maneuver": _text(variables, "fds.maneuver"),
        "description": _text(variables, "fds.description"),
        "clock_s": start if np.isfinite(start) else 0.0,
        "columns_not_read": sorted(used - claimed),
    }
    clock = Column("time", time, "s", "t")
    record = assemble(path, "sidpac", clock, columns, mass, provenance={"sidpac": about}, **options)
    if record.vehicle is not None or record.mass_properties is None:
        return record
    geometry: dict[str, Any] = {ours: _geometry(fdata[:, n - 1], unit) for n, _, unit, ours in GEOMETRY}
    return replace(
        record, vehicle=Vehicle(name=about["aircraft"], mass_properties=record.mass_properties, **geometry)
    )


def write_sidpac(record: FlightRecord, path: Path) -> tuple[str, ...]:
    """Write a record in SIDPAC's standard columns, whole or not at all.

    Parameters
    ----------
    record : FlightRecord
        Accelerations away from the centre of gravity go into the columns of measured acceleration.
        Effectors that the layout does not name go into its spare columns, with their own labels.
    path : Path
        MATLAB v5 file with ``fdata``, ``t``, ``dt`` and ``fds``.

    Returns
    -------
    tuple of str
        Channels that the layout has no place for.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    fdata = np.zeros((record.time.size, WIDTH))
    labels, units = [""] * WIDTH, [""] * WIDTH
    about = record.provenance.get("sidpac", {})

    def fill(number: int, label: str, unit: str, si_values: NDArray[np.float64] | float) -> None:
        fdata[:, number - 1] = si_values / parse_unit(SPELLED.get(unit, unit)).factor
        labels[number - 1], units[number - 1] = label, unit

    fill(1, "time", "sec", record.time + about.get("clock_s", 0.0))
    mass = record.mass_properties or (record.vehicle.mass_properties if record.vehicle else None)
    home = {ours: (number, label, unit) for number, label, unit, ours in CHANNELS}
    spare = list(SPARE)
    left_out = []
    for name, channel in record.channels.items():
        group, _, short = name.partition("/")
        if name in MEASURED_ACCELERATION and not _at_cg(channel.position_m, mass):
            fill(*MEASURED_ACCELERATION[name], "g", channel.values)
        elif name in home:
            fill(*home[name], channel.values)
        elif group == "effector" and spare and channel.unit in _SPARE_UNITS:
            fill(spare.pop(0), short, _SPARE_UNITS[channel.unit], channel.values)
        else:
            left_out.append(name)
    if mass is not None:
        properties = {
            "mass": mass.mass_kg,
            **{f"I{a}": getattr(mass.inertia, a) for a in ("xx", "yy", "zz", "xz")},
        }
        properties |= zip(("cg_x", "cg_y", "cg_z"), mass.cg_m, strict=True)
        for number, label, unit, ours, sign in MASS:
            fill(number, label, unit, sign * properties[ours])
    for number, label, unit, ours in GEOMETRY:
        fill(number, label, unit, getattr(record.vehicle, ours, None) or 0.0)
    fds = {
        "aircraft": record.vehicle.name if record.vehicle else _UNNAMED,
        "maneuver": about.get("maneuver", ""),
        "description": about.get("description", ""),
        "varlab": _cells(f"  {label} " for label in labels),
        "varunits": _cells(f" ({unit}) " if unit else "   " for unit in units),
        **{label: fdata[0, number - 1] for number, label, _, _ in GEOMETRY},
    }
    content = {"fdata": fdata, "t": record.time[:, None], "dt": record.dt, "fds": fds}
    with store.replacing(path) as temporary, open(temporary, "wb") as file:
        # scipy takes an open file too, its stubs do not say so
        savemat(file, content, format="5", oned_as="column")  # pyrefly: ignore[bad-argument-type]
    return tuple(left_out)


def _matrix_name(variables: dict[str, Any]) -> str | None:
    for name in ("fdata", "fds.fdata"):
        found = lookup(variables, name)
        if isinstance(found, np.ndarray) and found.ndim == 2 and found.shape[1] == WIDTH:
            return name
    return None


def _time(variables: dict[str, Any], fdata: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the file's own ``t``, or column 1, after comparing it with ``dt``."""
    name = next((n for n in ("t", "fds.t") if np.size(lookup(variables, n)) > 1), None)
    time = fdata[:, 0] if name is None else numeric(variables, name)
    if time.shape != fdata.shape[:1]:
        raise DataError(f"t has shape {time.shape}, fdata has {fdata.shape[0]} samples")
    dt = numeric(variables, "dt") if "dt" in variables else np.empty(0)
    if dt.size == 1 and time.size > 1:
        with np.errstate(all="ignore"):
            step = float(np.median(np.diff(time)))
        if not abs(step - dt[0]) <= 1e-3 * abs(dt[0]):
            raise DataError(
                f"dt is {dt[0]:g} s, but t advances by {step:g} s", remedy="correct one of the two"
            )
    return time


def _check_unit(number: int, label: str, found: str, expected: str) -> None:
    """Refuse a file that labels a column in another unit than the layout's."""
    if not found or found.lower() == expected:
        return
    layout = parse_unit(SPELLED.get(expected, expected))
    if not _understood(found) or parse_unit(SPELLED.get(found, found)) != layout:
        raise DataError(
            f"column {number} ({label or 'unnamed'}) is labelled in '{found}', "
            f"expected '{expected or 'no unit'}' as in the SIDPAC layout",
            remedy="read it with a column map",
        )


def _understood(unit: str) -> bool:
    try:
        parse_unit(SPELLED.get(unit, unit))
    except DataError:
        return False
    return True


def _steers(unit: str) -> bool:
    """Tell whether an effector can have a unit; temperatures and the like in spare columns are not read."""
    return _understood(unit) and effector_si(SPELLED.get(unit, unit)) is not None


def _of_width(found: list[str]) -> list[str]:
    """Return one text for every column; files without labels have none."""
    return found if len(found) == WIDTH else [""] * WIDTH


def _text(variables: dict[str, Any], name: str) -> str:
    found = lookup(variables, name)
    if isinstance(found, np.ndarray) and found.size == 1 and found.dtype.kind in "fiu":
        return f"{found.item():g}"  # manoeuvres may be numbered
    return found.strip() if isinstance(found, str) else ""


def _geometry(values: NDArray[np.float64], unit: str) -> float | None:
    with np.errstate(all="ignore"):
        mean = float(np.mean(values)) * parse_unit(unit).factor
    return mean if np.isfinite(mean) and mean > 0 else None


def _at_cg(position_m: tuple[float, float, float] | None, mass: MassProperties | None) -> bool:
    return position_m is None or (mass is not None and tuple(position_m) == tuple(mass.cg_m))


def _cells(found: Any) -> NDArray[np.object_]:
    """Return texts as MATLAB's column cell array."""
    return np.array(list(found), dtype=object)[:, None]


READER = Reader((".mat",), read_sidpac, is_sidpac)

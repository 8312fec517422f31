"""A user's control law: a TOML, MAT or Python file, or a python-control object (docs/margins.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, FreqidError, UsageError, nearest
from freqid.core.toml import read_toml
from freqid.core.units import to_si
from freqid.core.vehicle import Strict, Vehicle
from freqid.dynamics.control_law import ControlLaw, LawAt, LawSchedule
from freqid.dynamics.linear_loop import Actuation
from freqid.dynamics.small_motion import SIGNALS

Numbers = dict[str, dict[str, float]]
Matrix = list[list[float]]


class ActuatorTable(Strict, frozen=True):
    """One ``[actuator.NAME]``: from the command of an effector to its position.

    Attributes
    ----------
    gain : float
    delay_s : float
    frequency_hz : float, optional
        Natural frequency of a second-order servo; none where absent.
    damping : float
    lag_s : float
        Of a first-order lag.
    """

    gain: float = 1.0
    delay_s: float = 0.0
    frequency_hz: float | None = None
    damping: float = 0.7
    lag_s: float = 0.0

    def __post_init__(self) -> None:
        if self.delay_s < 0 or self.lag_s < 0 or (self.frequency_hz or 1.0) <= 0:
            raise ValueError("delay_s and lag_s are zero or more, and frequency_hz is positive")


class Matrices(Strict, frozen=True):
    """One ``[state_space]``: ``x' = A x + B y``, ``axes = C x + D y``, in the units of the file."""

    A: Matrix = msgspec.field(default_factory=list)
    B: Matrix = msgspec.field(default_factory=list)
    C: Matrix = msgspec.field(default_factory=list)
    D: Matrix = msgspec.field(default_factory=list)


class LawTable(Strict, frozen=True):
    """What a law does at one condition.

    Attributes
    ----------
    gains, integral_gains : dict
        By axis and signal: per unit of the signal, and of its integral over time in s.
    state_space : Matrices, optional
        In place of both.
    allocation : dict
        By effector and axis.
    """

    gains: Numbers = msgspec.field(default_factory=dict)
    integral_gains: Numbers = msgspec.field(default_factory=dict)
    state_space: Matrices | None = None
    allocation: Numbers = msgspec.field(default_factory=dict)


class ConditionTable(LawTable, frozen=True, kw_only=True):
    """One ``[[condition]]`` of a law that is scheduled by speed."""

    u: float


class LoopFile(LawTable, frozen=True, kw_only=True):
    """A loop file.

    Attributes
    ----------
    signals, commands, axes : dict of str to str
        Units by name, in the order of the matrices; without axes, the commands are the axes.
    name : str
    sign : {1, -1}
        -1 where the command is minus what the gains say.
    actuator : dict of ActuatorTable
        By effector; ``default`` for those that are not named.
    condition : tuple of ConditionTable
    """

    signals: dict[str, str]
    commands: dict[str, str]
    axes: dict[str, str] = msgspec.field(default_factory=dict)
    name: str = ""
    sign: int = 1
    actuator: dict[str, ActuatorTable] = msgspec.field(default_factory=dict)
    condition: tuple[ConditionTable, ...] = ()

    def __post_init__(self) -> None:
        if self.sign not in (1, -1):
            raise ValueError(f"sign is {self.sign}, expected 1 or -1")
        if not self.signals or not self.commands:
            raise ValueError("[signals] and [commands] name one or more each")


def law_of(given: Any, vehicle: Vehicle) -> tuple[LawAt, str]:
    """Return a law as a function of the condition, and its name.

    Parameters
    ----------
    given : path, python-control object, ControlLaw, LawSchedule, or a callable
        A callable is called with speed, m/s, and density, kg/m3, and returns a python-control object.
    vehicle : Vehicle
        For the kinds, and so the SI units, of effectors.

    Raises
    ------
    UsageError, DataError
        For names, units or shapes that do not fit, with the file and the key.
    """
    if isinstance(given, str | Path):
        return _from_file(str(given), vehicle)
    if isinstance(given, ControlLaw):
        return (lambda u, rho, scheduled: given), given.name or "law"
    if isinstance(given, LawSchedule):
        return (lambda u, rho, scheduled: given.at(u)), given.laws[0].name or "law"
    if hasattr(given, "input_labels"):  # before callable: these objects are called with frequencies
        law = _of_object(given)
        return (lambda u, rho, scheduled: law), law.name or "law"
    if callable(given):
        return (lambda u, rho, scheduled: _of_object(given(u, rho))), getattr(given, "__name__", "law")
    raise UsageError(
        f"found {type(given).__name__}, expected a control law",
        remedy="give a loop file, a python-control system with names, or a scenario",
    )


def _from_file(text: str, vehicle: Vehicle) -> tuple[LawAt, str]:
    file, _, name = text.partition(".py:")
    if name:
        from freqid.gap.connect.callable import import_file

        path = Path(f"{file}.py")
        if not path.is_file():
            raise DataError("no such file", where=str(path), remedy="check the path")
        found = getattr(import_file(path), name, None)
        if found is None:
            raise UsageError(f"has no '{name}'", where=str(path), remedy="name what it defines")
        try:
            return law_of(found, vehicle)[0], f"{path.name}:{name}"
        except FreqidError as error:
            raise error.at(text) from None
    path = Path(text)
    try:
        if path.suffix == ".mat":
            schedule = _read_mat(path, vehicle)
        elif path.suffix == ".toml":
            schedule = schedule_of(read_toml(path, LoopFile)[0], vehicle)
        else:
            raise UsageError(
                "is no loop file",
                where=text,
                remedy="give LOOP.toml, LOOP.mat, FILE.py:NAME or SCENARIO.toml",
            )
    except FreqidError as error:
        raise error.at(text) from None
    return (lambda u, rho, scheduled: schedule.at(u)), schedule.laws[0].name or path.stem


def schedule_of(file: LoopFile, vehicle: Vehicle) -> LawSchedule:
    """Return the laws of a loop file, SI.

    Raises
    ------
    UsageError
        For names that are not the file's or the vehicle's, or matrices that do not fit.
    DataError
        For units that do not fit.
    """
    if not file.condition:
        return LawSchedule((0.0,), (_law(file, file, vehicle),))
    for key in ("gains", "integral_gains", "state_space"):
        if getattr(file, key):
            raise UsageError(f"{key} stands beside [[condition]]", remedy="move it into the conditions")
    return LawSchedule(
        tuple(c.u for c in file.condition), tuple(_law(file, c, vehicle) for c in file.condition)
    )


def _law(file: LoopFile, at: LawTable, vehicle: Vehicle) -> ControlLaw:
    signals, effectors = tuple(file.signals), tuple(file.commands)
    axes = tuple(file.axes) or effectors
    by_signal = _factors(file.signals, SIGNALS, "signals")
    by_effector = _factors(file.commands, {e.name: e.unit for e in vehicle.effectors}, "commands")
    # an axis is whatever its user takes it to be: its unit is a name, and cancels
    by_axis = np.ones(len(axes)) if file.axes else by_effector
    if at.state_space is not None:
        if at.gains or at.integral_gains:
            raise UsageError("gains stand beside state_space", remedy="give one of the two")
        k = len(at.state_space.A)
        A, B, C, D = (
            _matrix(getattr(at.state_space, name), shape)
            for name, shape in (
                ("A", (k, k)),
                ("B", (k, len(signals))),
                ("C", (len(axes), k)),
                ("D", (len(axes), len(signals))),
            )
        )
    else:
        D = _table(at.gains, axes, signals, "gains")
        C = _table(at.integral_gains, axes, signals, "integral_gains")
        integrated = np.flatnonzero(C.any(axis=0))
        A, B, C = np.zeros((integrated.size,) * 2), np.eye(len(signals))[integrated], C[:, integrated]
    share = at.allocation or file.allocation
    if bool(share) != bool(file.axes):
        raise UsageError("[axes] and [allocation] need each other", remedy="give both, or neither")
    mixing = _table(share, effectors, axes, "allocation") if share else np.eye(len(axes))
    if share:
        mixing = by_effector[:, None] * mixing
    return ControlLaw(
        signals,
        axes,
        effectors,
        A,
        B / by_signal,
        file.sign * by_axis[:, None] * C,
        file.sign * by_axis[:, None] * D / by_signal,
        mixing,
        _actuation(file.actuator, effectors),
        file.name,
    )


def _factors(units: Mapping[str, str], known: Mapping[str, str], key: str) -> Array:
    """Return SI per unit by name.

    Raises
    ------
    UsageError
        For a name that the aircraft does not have.
    DataError
        For a unit of another kind.
    """
    for name in units:
        if name not in known:
            what = "the aircraft has no effector" if key == "commands" else "no sensor measures"
            raise UsageError(f"[{key}]: {what} '{name}'", remedy=nearest(name, known))
    found = [to_si(unit, known[name], f"[{key}] {name}") for name, unit in units.items()]
    return np.array([unit.factor for unit in found])


def _table(numbers: Numbers, rows: Sequence[str], columns: Sequence[str], key: str) -> Array:
    table = np.zeros((len(rows), len(columns)))
    for row, values in numbers.items():
        if row not in rows:
            raise UsageError(
                f"[{key}.{row}]: '{row}' is not among the file's names", remedy=nearest(row, rows)
            )
        for column, value in values.items():
            if column not in columns:
                raise UsageError(
                    f"[{key}.{row}]: '{column}' is not among the file's names",
                    remedy=nearest(column, columns),
                )
            table[rows.index(row), columns.index(column)] = value
    return table


def _matrix(rows: Any, shape: tuple[int, int]) -> Array:
    """Return a matrix as it is, zero where it is absent; `ControlLaw` checks its shape."""
    if not np.size(rows):
        return np.zeros(shape)
    try:
        return np.atleast_2d(np.array(rows, dtype=float))
    except ValueError:
        raise UsageError(
            "a matrix of state_space has rows of different length", remedy="correct it"
        ) from None


def _actuation(tables: Mapping[str, ActuatorTable], effectors: Sequence[str]) -> Actuation:
    for name in tables:
        if name not in (*effectors, "default"):
            raise UsageError(f"[actuator.{name}]: the law does not move it", remedy=nearest(name, effectors))
    each = [tables.get(n, tables.get("default", ActuatorTable())) for n in effectors]
    return Actuation(
        gain=np.array([a.gain for a in each]),
        delay=np.array([a.delay_s for a in each]),
        frequency=np.array([2 * np.pi * a.frequency_hz if a.frequency_hz else np.inf for a in each]),
        damping=np.array([a.damping for a in each]),
        share=np.ones(len(each)),
        lag=np.array([a.lag_s for a in each]),
        lag_2=np.zeros(len(each)),
    )


def _read_mat(path: Path, vehicle: Vehicle) -> LawSchedule:
    """Return the law of a MAT file: ``A B C D signals commands``, and units where they are not SI."""
    from freqid.flightlog.readers.matlab import load_variables, texts

    held = load_variables(path)
    for name in ("D", "signals", "commands"):
        if name not in held:
            raise DataError(
                f"has no variable '{name}'",
                remedy="save A, B, C, D, and the cell arrays of names signals and commands",
            )
    names = {key: texts(held[key]) for key in ("signals", "commands")}
    si = {"signals": SIGNALS, "commands": {e.name: e.unit for e in vehicle.effectors}}
    units = {}
    for key, of in names.items():
        unit_key = f"{key[:-1]}_units"
        stated = texts(held[unit_key]) if unit_key in held else [si[key].get(n, "1") for n in of]
        if len(stated) != len(of):
            raise DataError(f"has {len(of)} {key} and {len(stated)} {unit_key}", remedy="give one for each")
        units[key] = dict(zip(of, stated, strict=True))
    k = round(np.size(held.get("A", ())) ** 0.5)
    size = {"A": (k, k), "B": (k, -1), "C": (-1, k), "D": (len(names["commands"]), -1)}
    matrices = {}
    for m in ("A", "B", "C", "D"):
        try:
            values = np.asarray(held.get(m, ()), dtype=float)
        except (TypeError, ValueError):
            raise DataError(
                f"variable '{m}' is no matrix of numbers",
                remedy="save A, B, C and D as [A, B, C, D] = ssdata(law)",
            ) from None
        if values.size:  # the reader drops axes of length one
            matrices[m] = (values if values.ndim == 2 else values.reshape(size[m])).tolist()
    sign = int(np.ravel(np.asarray(held.get("sign", 1.0), dtype=float))[0])
    law = LoopFile(
        signals=units["signals"],
        commands=units["commands"],
        sign=sign,
        state_space=Matrices(**matrices),
    )
    return schedule_of(law, vehicle)


def _of_object(system: Any) -> ControlLaw:
    """Return the law of a python-control system from signals to commands, SI."""
    if isinstance(system, ControlLaw):
        return system
    if not hasattr(system, "input_labels"):
        raise UsageError(
            f"found {type(system).__name__}, expected a python-control system",
            remedy="return control.ss(A, B, C, D, inputs=[...], outputs=[...])",
        )
    if getattr(system, "dt", 0):
        raise UsageError(
            f"the law is discrete, at steps of {system.dt:g} s, expected a continuous one",
            remedy="convert it (Tustin), and put the delay of half a step into it",
        )
    if not hasattr(system, "A"):
        import control

        system = control.ss(system, inputs=system.input_labels, outputs=system.output_labels)
    A, B, C, D = (np.asarray(getattr(system, m), dtype=float) for m in "ABCD")
    effectors = tuple(system.output_labels)
    ideal, eye = Actuation.ideal(len(effectors)), np.eye(len(effectors))
    return ControlLaw(tuple(system.input_labels), effectors, effectors, A, B, C, D, eye, ideal, system.name)

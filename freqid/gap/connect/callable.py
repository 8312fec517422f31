"""A user's Python function as a simulation: ``FILE.py:NAME``."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import STATE
from freqid.core.errors import DataError, FreqidError, UsageError, nearest
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.vehicle import Vehicle
from freqid.gap.connect import answers
from freqid.gap.connect.differences import central
from freqid.gap.simulation import Settings
from freqid.identify.explanatory import history

Array = NDArray[np.float64]

_AIR = ("V", "alpha", "beta", "qbar")  # computed where the record does not have them
_MOTION = ("u", "v", "w")


@dataclass(frozen=True, eq=False)
class CallableSimulation:
    """A function ``NAME(time, state, effector, air, parameters) -> {"X": array, ...}``.

    Methods as in `freqid.gap.simulation.Simulation`. Optional attributes of the function: ``responses``
    (tuple of names), ``vehicle`` (a `Vehicle`, or the path of a scenario), ``effects`` (settings of effects
    that it models itself, handed back as `parameters`), ``positions(time, command, parameters)`` and
    ``fly(record, parameters)``, dictionaries both.

    Attributes
    ----------
    function : callable
    name : str
        ``FILE.py:NAME``.
    responses : tuple of str
    vehicle : Vehicle or None
    effects : dict of dict of float
    source : str
        File in which an error's line is looked for.
    """

    function: Callable[..., Any]
    name: str
    responses: tuple[str, ...] = ()
    vehicle: Vehicle | None = None
    effects: Settings = None  # type: ignore[assignment]
    source: str = ""
    kind: Literal["callable"] = "callable"
    parts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.effects is None:
            object.__setattr__(self, "effects", {})

    def predict(self, record: FlightRecord, effects: Settings | None = None) -> Array:
        """Return the responses on the record, shape (response, sample)."""
        return self._answer(record, effects)[1]

    def probed(self, record: FlightRecord) -> CallableSimulation:
        """Return the simulation with the responses that it has on a record, unless it states them."""
        return self if self.responses else replace(self, responses=self._answer(record, None)[0])

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives by central differences, shape (response, input, sample)."""
        return central(self.predict, record, inputs)

    def positions(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array]:
        """Return what its ``positions`` makes of the commands; empty without that or without commands."""
        answer = getattr(self.function, "positions", None)
        command = {n: record[f"command/{n}"].copy() for n in record.group("command")}
        if answer is None or not command:
            return {}
        found = self._called(answer, record.time.copy(), command, self._parameters(effects))
        return self._signals(found, record.time, tuple(command), "positions")

    def fly(self, record: FlightRecord, effects: Settings | None = None) -> dict[str, Array] | None:
        """Return the states of its own flight; None without ``fly``."""
        answer = getattr(self.function, "fly", None)
        if answer is None:
            return None
        found = self._called(answer, record, self._parameters(effects))
        return self._signals(found, record.time, tuple(STATE), "fly")

    def _answer(self, record: FlightRecord, effects: Settings | None) -> tuple[tuple[str, ...], Array]:
        state, effector, air = arguments(record, self.vehicle)
        found = self._called(
            self.function, record.time.copy(), state, effector, air, self._parameters(effects)
        )
        return answers.stacked(found, record.time, self.name, self.responses)

    def _parameters(self, changed: Settings | None) -> dict[str, dict[str, float]]:
        names = {**self.effects, **(changed or {})}
        return {i: {**self.effects.get(i, {}), **(changed or {}).get(i, {})} for i in names}

    def _signals(self, found: Any, time: Array, known: Sequence[str], what: str) -> dict[str, Array]:
        where = f"{self.name}.{what}"
        if not isinstance(found, Mapping):
            raise DataError(
                f"{what} returned {type(found).__name__}, expected a dictionary of arrays by name",
                where=where,
            )
        for name in found:
            if name not in known:
                raise DataError(
                    f"{what} returned '{name}', which is not known",
                    where=where,
                    remedy=nearest(str(name), known),
                )
        return {str(n): answers.row(values, str(n), time, where) for n, values in found.items()}

    def _called(self, function: Callable[..., Any], *given: Any) -> Any:
        try:
            with np.errstate(all="ignore"):  # what is not finite is said with its time
                return function(*given)
        except FreqidError:
            raise
        except Exception as error:
            raise DataError(
                f"the simulation raised {_described(error, self.source)}",
                where=self.name,
                remedy="see that it runs on this record's channels: "
                "state, effector and air hold what was logged",
            ) from error


def arguments(
    record: FlightRecord, vehicle: Vehicle | None = None
) -> tuple[dict[str, Array], dict[str, Array], dict[str, Array]]:
    """Return state, effector and air of a record by name, as a user's function gets them.

    Velocities and flow angles of sensors that state a position are those of the centre of gravity, where
    the vehicle is known; V, alpha, beta and qbar are computed where they were not logged.
    """
    described = vehicle or record.vehicle
    state, effector, air = (
        {n: record[f"{group}/{n}"].copy() for n in record.group(group)}
        for group in ("state", "effector", "air")
    )
    if described is not None:
        maneuver = Maneuver.of(record, described)
        for group, names in ((state, _MOTION), (air, _AIR)):
            for name in names:
                try:
                    group[name] = history(maneuver, name)
                except DataError:  # neither logged nor computable: the function may not need it
                    continue
    return state, effector, air


def load(text: str) -> CallableSimulation:
    """Load ``FILE.py:NAME``.

    Raises
    ------
    UsageError
        Where nothing in the file is callable by that name.
    DataError
        Where there is no such file, or it cannot be run.
    """
    file, _, name = text.rpartition(":")
    path = Path(file)
    if not file or not name:
        raise UsageError(f"'{text}' names no function", remedy="write FILE.py:NAME")
    if not path.is_file():
        raise DataError("there is no such file", where=file, remedy="check the path before the colon")
    module = _imported(path)
    function = getattr(module, name, None)
    if not callable(function):
        known = [n for n, v in vars(module).items() if callable(v) and not n.startswith("_")]
        raise UsageError(f"it defines no function '{name}'", where=file, remedy=nearest(name, known))
    responses = tuple(getattr(function, "responses", ()))
    for response in responses:
        if response not in answers.KNOWN:
            raise DataError(
                f"'{response}' among the responses is no response and no state",
                where=text,
                remedy=nearest(str(response), answers.KNOWN),
            )
    vehicle = getattr(function, "vehicle", None)
    if isinstance(vehicle, str | Path):
        vehicle = read_scenario(path.parent / vehicle)[0].aircraft()
    effects = getattr(function, "effects", {})
    return CallableSimulation(function, text, responses, vehicle, effects, str(path))


def _imported(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(f"freqid_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise UsageError("it is no Python file", where=str(path), remedy="write FILE.py:NAME")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    sys.path.insert(0, str(path.parent.resolve()))  # its neighbours
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise DataError(f"the file cannot be run: {_described(error, str(path))}", where=str(path)) from error
    finally:
        sys.path.pop(0)
    return module


def _described(error: Exception, source: str) -> str:
    """Return an exception's name and words, and the line of the user's file where it was raised."""
    words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    if isinstance(error, SyntaxError):
        return words
    own = [
        f for f in traceback.extract_tb(error.__traceback__) if source and Path(f.filename) == Path(source)
    ]
    place = f" (line {own[-1].lineno} of {Path(source).name})" if own else ""
    return words + place

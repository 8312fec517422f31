"""A user's Python function as a simulation: ``FILE.py:NAME``."""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import STATE
from freqid.core.errors import DataError, FreqidError, UsageError, nearest
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.scenario import read_scenario
from freqid.core.vehicle import Vehicle
from freqid.gap.connect import answers
from freqid.gap.connect.differences import by_parameters, central
from freqid.gap.connect.what_is_read import Answers
from freqid.gap.simulation import LARGEST_SIGMA, Departures, Settings, Tolerance, checked_departures
from freqid.identify.loads.explanatory import motion_of_centre

_AIR = ("V", "alpha", "beta", "qbar")  # computed where the record does not have them
_MOTION = ("u", "v", "w")


@dataclass(frozen=True, eq=False)
class CallableSimulation:
    """A function ``NAME(time, state, effector, air, parameters) -> {"X": array, ...}``.

    Methods as in `freqid.gap.simulation.Simulation`. Optional attributes of the function: ``responses``
    (tuple of names), ``vehicle`` (a `Vehicle`, or the path of a scenario), ``effects`` (settings of effects
    that it models itself), ``tolerances`` (``{name: (sigma, unit)}`` of its own parameters), ``gyroscopic``
    (bool), ``positions(time, command, parameters)`` and ``fly(record, parameters)``, dictionaries both.
    `parameters` holds the effects' settings by effect and the departures of its own parameters by name.

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
    tolerances : dict of Tolerance
        Those that the function states where left out.
    gyroscopic : bool or None
        What the function states where left out.

    Raises
    ------
    DataError
        Where the function's ``tolerances``, ``gyroscopic``, ``positions`` or ``fly`` are not of their form.
    """

    function: Callable[..., Any]
    name: str
    responses: tuple[str, ...] = ()
    vehicle: Vehicle | None = None
    effects: Settings = field(default_factory=dict)
    source: str = ""
    kind: Literal["callable"] = "callable"
    parts: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = None  # type: ignore[assignment]
    gyroscopic: bool | None = None
    _moved: Answers[dict[str, Array]] = field(default_factory=Answers, init=False, repr=False)

    def __post_init__(self) -> None:
        def fill(name: str, value: Any) -> None:
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

        for hook in ("positions", "fly"):
            given = self._hook(hook)
            if given is not None and not callable(given):
                raise DataError(
                    f"{hook} is {type(given).__name__}, expected a function",
                    where=self.name,
                    remedy=f"give a function, or leave out {hook}",
                )
        fill("tolerances", _tolerances(self.function, self.effects, self.name))
        fill("gyroscopic", _gyroscopic(self.function, self.name))

    @property
    def can_fly(self) -> bool:
        """Whether the function has ``fly``."""
        return self._hook("fly") is not None

    @property
    def has_actuators(self) -> bool:
        """Whether the function has ``positions``."""
        return self._hook("positions") is not None

    def acting_with(self, effects: Settings) -> CallableSimulation:
        """Return the simulation with effects of its own at other settings."""
        return replace(self, effects={**self.effects, **effects})

    def predict(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> Array:
        """Return the responses on the record, shape (response, sample)."""
        return self._answer(record, effects, departures)[1]

    def probed(self, record: FlightRecord) -> CallableSimulation:
        """Return the simulation with the responses that it has on a record, unless it states them."""
        return self if self.responses else replace(self, responses=self._answer(record)[0])

    def sensitivity(
        self, record: FlightRecord, sizes: Departures, departures: Departures | None = None
    ) -> Array:
        """Return what departures of its own parameters make, shape (parameter, response, sample)."""
        return by_parameters(self.predict, record, sizes, departures)

    def gradient(self, record: FlightRecord, inputs: Sequence[str]) -> Array:
        """Return derivatives by central differences, shape (response, input, sample)."""
        return central(self.predict, record, inputs)

    def positions(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array]:
        """Return what its ``positions`` makes of the commands; empty without that or without commands."""
        command = {n: record[f"command/{n}"].copy() for n in record.group("command")}
        hook = self._hook("positions")
        if hook is None or not command:
            return {}

        def ask(parameters: dict[str, Any]) -> dict[str, Array]:
            made = self._called(hook, record.time.copy(), command, parameters)
            return answers.signals(made, record.time, dict.fromkeys(command), f"{self.name}.positions")

        made = self._moved.of(record, self._parameters(effects, departures), ask)
        return {n: x.copy() for n, x in made.items()}

    def fly(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> dict[str, Array] | None:
        """Return the states, and positions and commands if any, of its own flight; None without ``fly``."""
        hook = self._hook("fly")
        if hook is None:
            return None
        where, parameters = f"{self.name}.fly", self._parameters(effects, departures)
        flown = self._called(hook, record, parameters, during=record)
        described = self.vehicle or record.vehicle
        effectors = [e.name for e in described.effectors] if described else []
        effectors += [*record.group("effector"), *record.group("command")]
        moving = [f"{group}/{name}" for group in ("effector", "command") for name in effectors]
        names = {**{f"state/{n}": n for n in STATE}, **dict.fromkeys(STATE), **dict.fromkeys(moving)}
        flight = answers.signals(flown, record.time, names, where)
        answers.check_flight(flight, record, where)
        return flight

    def _hook(self, name: str) -> Callable[..., Any] | None:
        """Return a function that the function has as an attribute, such as ``fly``; None without it."""
        return getattr(self.function, name, None)

    def _answer(
        self, record: FlightRecord, effects: Settings | None = None, departures: Departures | None = None
    ) -> tuple[tuple[str, ...], Array]:
        state, effector, air = arguments(record, self.vehicle)
        parameters = self._parameters(effects, departures)
        returned = self._called(self.function, record.time.copy(), state, effector, air, parameters)
        names, rows = answers.stacked(returned, record.time, self.name, self.responses)
        answers.check_moving(names, rows, record, self.name)
        return names, rows

    def _parameters(self, changed: Settings | None, departures: Departures | None) -> dict[str, Any]:
        """Return settings by effect and departures by name, as the function gets them."""
        changed = changed or {}
        settings = {i: {**self.effects.get(i, {}), **changed.get(i, {})} for i in {**self.effects, **changed}}
        own = checked_departures(departures, self.tolerances, self.name)
        return {**settings, **dict.fromkeys(self.tolerances, 0.0), **own}

    def _called(self, function: Callable[..., Any], *given: Any, during: FlightRecord | None = None) -> Any:
        try:
            with np.errstate(all="ignore"):  # a sample that is not finite is reported with its time
                return function(*given)
        except FreqidError:
            raise
        except (Exception, SystemExit) as error:  # a script of the user's may leave
            if during is not None:
                start, stop = during.time[[0, -1]]
                raise DataError(
                    f"the simulation's own flight from t = {start:.4g} to {stop:.4g} s raised "
                    + _described(error, self.source),
                    where=f"{self.name}.fly",
                    remedy="let it fly from its own trim under the record's excitation, or leave out fly",
                ) from error
            raise DataError(
                f"the simulation raised {_described(error, self.source)}",
                where=self.name,
                remedy="see that it runs on this record's channels: "
                "state, effector, air and command hold what was logged",
            ) from error


def _tolerances(function: Callable[..., Any], effects: Settings, where: str) -> dict[str, Tolerance]:
    """Return what a function states of its own parameters: ``{name: (sigma, unit)}``."""
    stated = getattr(function, "tolerances", {})
    if not isinstance(stated, Mapping):
        raise DataError(
            f"tolerances is {type(stated).__name__}, expected a dictionary",
            where=where,
            remedy='write tolerances = {"lift_slope": (0.3, "1/rad")}',
        )
    tolerances = {}
    for name, value in stated.items():
        if not (isinstance(name, str) and isinstance(value, tuple | list) and len(value) == 2):
            raise DataError(
                f"tolerance {name!r} is {value!r}, expected a pair of one sigma and its unit",
                where=where,
                remedy='write tolerances = {"lift_slope": (0.3, "1/rad")}',
            )
        if name in effects:
            raise DataError(
                f"tolerance '{name}' has the name of an effect of the same function",
                where=where,
                remedy="give the parameter another name: both are keys of `parameters`",
            )
        try:
            tolerances[name] = Tolerance(*value)
        except DataError as error:
            raise error.at(f"{where}.tolerances['{name}']") from None
        if not tolerances[name].sigma:
            raise DataError(
                f"tolerance '{name}' has sigma 0",
                where=where,
                remedy="leave out what is known exactly, or give one standard deviation",
            )
        # a number without unit may be a share or a derivative of a coefficient, which can be tens
        sigma = tolerances[name].sigma
        if tolerances[name].unit == "1" and sigma > LARGEST_SIGMA:
            raise DataError(
                f"tolerance '{name}' has sigma {sigma:g}, expected at most {LARGEST_SIGMA:g}",
                where=where,
                remedy="give one standard deviation in the parameter's own unit, or name that unit",
            )
    return tolerances


def _gyroscopic(function: Callable[..., Any], where: str) -> bool | None:
    """Return whether a function leaves the rotors' gyroscopic moments to the rigid body; None if unstated."""
    stated = getattr(function, "gyroscopic", None)
    if stated is not None and not isinstance(stated, bool):
        raise DataError(
            f"gyroscopic is {stated!r}, expected True or False",
            where=where,
            remedy="True where the wrench is without the rotors' gyroscopic moments, False where it has them",
        )
    return stated


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
        motion = motion_of_centre(Maneuver.of(record, described))
        for group, names in ((state, _MOTION), (air, _AIR)):
            group |= {n: motion[n] for n in names if n in motion}  # the function may not need the others
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
    module = import_file(path)
    function = getattr(module, name, None)
    if not callable(function):
        known = [n for n, v in vars(module).items() if callable(v) and not n.startswith("_")]
        raise UsageError(f"it defines no function '{name}'", where=file, remedy=nearest(name, known))
    return simulation_of(function, text, str(path))


def simulation_of(
    function: Callable[..., Any], name: str | None = None, source: str | None = None
) -> CallableSimulation:
    """Return a function as a simulation.

    Parameters
    ----------
    function : callable
    name : str, optional
        For messages; the function's own where absent.
    source : str, optional
        File that it is from; a scenario that it names is looked for beside it.

    Raises
    ------
    DataError
        Where what the function states of itself is not of its form.
    """
    name = str(name or getattr(function, "__qualname__", type(function).__name__))
    source = str(source or getattr(getattr(function, "__code__", None), "co_filename", ""))
    stated = getattr(function, "responses", ())
    if not isinstance(stated, tuple | list):
        raise DataError(
            f"responses is {stated!r}, expected a tuple of names",
            where=name,
            remedy='write responses = ("X", "Z", "M")',
        )
    responses = tuple(stated)
    for response in responses:
        if not isinstance(response, str) or response not in answers.KNOWN:
            raise DataError(
                f"'{response}' among the responses is no response and no state",
                where=name,
                remedy=nearest(str(response), answers.KNOWN),
            )
    vehicle = getattr(function, "vehicle", None)
    if isinstance(vehicle, str | Path):
        vehicle = read_scenario(Path(source).parent / vehicle)[0].aircraft()
    if vehicle is not None and not isinstance(vehicle, Vehicle):
        raise DataError(
            f"vehicle is {type(vehicle).__name__}, expected a Vehicle or the path of a scenario",
            where=name,
            remedy='write vehicle = "my_aircraft.toml", beside this file',
        )
    effects = getattr(function, "effects", {})
    if not isinstance(effects, Mapping) or not all(map(_are_settings, effects.values())):
        raise DataError(
            f"effects is {effects!r}, expected settings by effect",
            where=name,
            remedy='write effects = {"extra_drag": {"coefficient": 0.1}}',
        )
    return CallableSimulation(function, name, responses, vehicle, effects, source)


def _are_settings(value: Any) -> bool:
    return isinstance(value, Mapping) and all(isinstance(x, int | float) for x in value.values())


def import_file(path: Path) -> Any:
    """Run a user's Python file and return it as a module.

    Raises
    ------
    UsageError, DataError
        Where it is no Python file, or raises anything.
    """
    spec = importlib.util.spec_from_file_location(f"freqid_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise UsageError("it is no Python file", where=str(path), remedy="write FILE.py:NAME")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    folder = str(path.parent.resolve())
    sys.path.insert(0, folder)  # its neighbours
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise DataError(f"the file cannot be run: {_described(error, str(path))}", where=str(path)) from error
    finally:
        with suppress(ValueError):  # the file may have changed the path itself
            sys.path.remove(folder)
    return module


def _described(error: BaseException, source: str) -> str:
    """Return an exception's name and words, and the line of the user's file where it was raised."""
    words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    if isinstance(error, SyntaxError):
        return words
    own = [
        f for f in traceback.extract_tb(error.__traceback__) if source and Path(f.filename) == Path(source)
    ]
    place = f" (line {own[-1].lineno} of {Path(source).name})" if own else ""
    return words + place

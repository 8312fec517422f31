"""What a job is given: files or objects, each with the name that errors and results call it by."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord, Maneuver, read_record
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario, read_scenario
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification

if TYPE_CHECKING:
    from freqid.blend.global_model import GlobalModel

File = Path | str
Flight = FlightRecord | Maneuver | File
Tell = Callable[[str], None]
"""Told what is being done, a few words at a time."""


def silent(text: str) -> None:
    """Say nothing."""


def scenario_of(given: Scenario | File) -> Scenario:
    """Return a scenario, read where a path or the name of a shipped one is given.

    Raises
    ------
    DataError, UsageError
        As `freqid.core.scenario.read_scenario`.
    """
    return given if isinstance(given, Scenario) else read_scenario(given)[0]


def name_of(scenario: Scenario) -> str:
    """Return the scenario's file; the name of its vehicle where it was made in Python."""
    return scenario.file or scenario.vehicle.name


def source_of(scenario: Scenario | None) -> dict[str, str]:
    """Return where a scenario is from, as the provenance of a result has it."""
    return {"file": scenario.file, "sha256": scenario.sha256} if scenario else {"file": "", "sha256": ""}


def excitation_of(scenario: Scenario) -> Excitation:
    """Return the excitation of a scenario.

    Raises
    ------
    UsageError
        Where it has none.
    """
    if scenario.excitation is None:
        raise UsageError("section [excitation] is missing", where=name_of(scenario), remedy="add it")
    return scenario.excitation


def identification_of(scenario: Scenario) -> Identification:
    """Return what a scenario identifies.

    Raises
    ------
    UsageError
        Where it does not say.
    """
    if scenario.identification is None:
        raise UsageError(
            "section [identification] is missing",
            where=name_of(scenario),
            remedy="name at least its regressors",
        )
    return scenario.identification


def several(given: Any) -> list[Any]:
    """Return what is given as a list: one thing, or an iterable of them."""
    if isinstance(given, str | Path) or not isinstance(given, Iterable):
        return [given]
    return list(given)


def flight_of(given: Any) -> FlightRecord | Maneuver:
    """Return a flight, read where a path is given; of a simulated one, what it logged.

    Raises
    ------
    DataError
        Where the file is no intact record.
    UsageError
        For something that is no flight.
    """
    if isinstance(given, str | Path):
        return read_record(Path(given))
    if isinstance(given, FlightRecord | Maneuver):
        return given
    logged = getattr(given, "record", None)
    if isinstance(logged, FlightRecord):
        return logged
    raise UsageError(
        f"found {type(given).__name__}, expected a flight",
        remedy="give a FlightRecord, a Maneuver, or the path of a record",
    )


def record_of(given: Any) -> FlightRecord:
    """Return the record of a flight; errors as `flight_of`."""
    flight = flight_of(given)
    return flight.record if isinstance(flight, Maneuver) else flight


def maneuver_of(given: Any, scenario: Scenario | None = None) -> Maneuver:
    """Return a manoeuvre of the scenario's vehicle, or of the record's own without a scenario.

    Raises
    ------
    DataError
        Where nobody describes the vehicle, or the file is no intact record.
    """
    flight = flight_of(given)
    if isinstance(flight, Maneuver):
        return flight
    return Maneuver.of(flight, scenario.aircraft() if scenario else None)


def names_of(flights: Sequence[Any], first: int = 1) -> list[str]:
    """Return the files of flights; ``flight 1`` and so on for objects."""
    return [str(f) if isinstance(f, str | Path) else f"flight {i}" for i, f in enumerate(flights, first)]


def model_of(given: Any) -> tuple[PointModel | GlobalModel, str]:
    """Return a point model or a global model, read where a path is given, and its file, else ``model``.

    Raises
    ------
    DataError
        Where the file is damaged or none of freqid's.
    UsageError
        For something else.
    """
    from freqid.blend.global_model import GlobalModel
    from freqid.workflows.files import read

    named = isinstance(given, str | Path)
    model = read(given) if named else given
    if not isinstance(model, PointModel | GlobalModel):
        raise UsageError(
            f"found a {type(model).__name__}, expected a point or a global model",
            where=str(given) if named else None,
            remedy="identify one with identify-point, or blend several with global-blend",
        )
    return model, str(given) if named else "model"


def point_of(given: PointModel | File) -> PointModel:
    """Return a point model, read where a path is given."""
    from freqid.core.results.point import read_point

    return given if isinstance(given, PointModel) else read_point(Path(given))

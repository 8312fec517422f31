"""A simulation of the user's is connected, and checked for mistakes of bookkeeping."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from freqid.core.blas import on_one_thread
from freqid.core.errors import GateFailed
from freqid.core.scenario import Scenario
from freqid.gap import connect as adapters
from freqid.gap import flights as gap_flights
from freqid.gap.bookkeeping.check import Finding, check
from freqid.gap.simulation import Simulation
from freqid.workflows.inputs import File, Flight, names_of, record_of, scenario_of, several


@dataclass(frozen=True, eq=False, repr=False)
class ConnectedSimulation:
    """A simulation with the scenario that describes its vehicle, tolerances and band.

    What a diagnosis asks of the simulation itself, `freqid.gap.simulation.Simulation` lists; all of that is
    to be had here too, ``name``, ``responses`` and ``can_fly`` for three.

    Attributes
    ----------
    simulation : Simulation
    scenario : Scenario, optional
    """

    simulation: Simulation
    scenario: Scenario | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.simulation, name)

    def __repr__(self) -> str:
        s = self.simulation
        abilities = [
            word for word, able in (("flies", s.can_fly), ("has actuators", s.has_actuators)) if able
        ]
        return (
            f"<{s.kind} simulation {s.name!r}: {' '.join(s.responses)}"
            + "".join(f", {word}" for word in abilities)
            + ">"
        )


Connected = ConnectedSimulation | Simulation | Callable[..., Any] | str


def connect(
    sim: str | Callable[..., Any] | None = None,
    *,
    scenario: Scenario | File | None = None,
    predictions: File | Sequence[File] = (),
    record: Flight | None = None,
) -> ConnectedSimulation:
    """Connect a simulation: a Python function, an FMU, JSBSim, a scenario, or recorded predictions.

    Parameters
    ----------
    sim : str or callable, optional
        ``FILE.py:NAME``, ``MODEL.fmu``, ``jsbsim:AIRCRAFT``, ``SCENARIO.toml`` or the name of a shipped one,
        ``FILE.h5`` of recorded predictions; or the function itself (docs/connecting.md).
    scenario : Scenario, path or name, optional
        Describes the vehicle of a simulation that does not, with tolerances and band; by itself, the
        simulation.
    predictions : path, or several
        Recorded predictions in place of a simulation.
    record : FlightRecord, Maneuver or path, optional
        On which a function that does not state its responses is asked for them.

    Returns
    -------
    ConnectedSimulation

    Raises
    ------
    UsageError
        Where none or several are given, the words name no kind of simulation, or a function does not say
        what it predicts.
    DataError
        Where a file is missing or cannot be used, or an extra that the kind needs is not installed.

    Examples
    --------
    >>> sim = connect("la8")
    >>> sim.responses
    ('X', 'Y', 'Z', 'L', 'M', 'N')
    """
    described = scenario_of(scenario) if scenario is not None else None
    files = [Path(p) for p in several(predictions)]
    flown = record_of(record) if record is not None else None
    found = adapters.connect(sim, scenario=described, predictions=files, record=flown)
    if described is None and isinstance(getattr(found, "scenario", None), Scenario):
        described = found.scenario  # type: ignore[attr-defined]  # a scenario that is its own simulation
    return ConnectedSimulation(found, described)


def resolve_simulation(
    given: Connected | None,
    *,
    scenario: Scenario | None = None,
    predictions: Sequence[File] = (),
    record: Flight | None = None,
) -> tuple[Simulation, Scenario | None]:
    """Return a simulation, connected where words or a function are given, and what describes its vehicle."""
    if isinstance(given, ConnectedSimulation):
        return given.simulation, scenario or given.scenario
    if given is None or isinstance(given, str) or not hasattr(given, "predict"):
        words: Any = given
        found = connect(words, scenario=scenario, predictions=predictions, record=record)
        return found.simulation, scenario or found.scenario
    return given, scenario  # type: ignore[return-value]


@on_one_thread
def check_simulation(
    simulation: Connected | None,
    flights: Flight | Iterable[Flight],
    *,
    scenario: Scenario | File | None = None,
    predictions: File | Sequence[File] = (),
    own: bool = False,
) -> BookkeepingCheck:
    """Lay a simulation beside flights and name mistakes of units, signs, axes, points, order and clock.

    Parameters
    ----------
    simulation : ConnectedSimulation, callable or str
        As `connect` takes or returns it.
    flights : FlightRecord, Maneuver or path, or several
    scenario : Scenario, path or name, optional
        Describes the vehicle; without a simulation, it is the simulation.
    predictions : path, or several
        Recorded predictions in place of a simulation.
    own : bool
        The flights are the simulation's own: nothing may be left.

    Returns
    -------
    BookkeepingCheck
        True where nothing was found; its ``findings`` have a fault, a sentence and a remedy each.

    Raises
    ------
    UsageError, DataError
        As `connect`; where records lack what the responses are made of.

    Examples
    --------
    >>> check_simulation("model.py:wrench", "flight.h5").findings  # doctest: +SKIP
    ()
    """
    given = several(flights)
    records = [record_of(flight) for flight in given]
    described = scenario_of(scenario) if scenario is not None else None
    found, its = resolve_simulation(
        simulation, scenario=described, predictions=several(predictions), record=records[0]
    )
    stated = described or (its if isinstance(simulation, ConnectedSimulation) else None)
    vehicle = stated.aircraft() if stated else None
    names = names_of(given)
    used = gap_flights.maneuvers(records, names, found, gap_flights.vehicle_of(records, found, vehicle))
    gap_flights.refuse_unmeasured(used, names, found)
    if found.kind == "callable":  # what else it has is asked once, so that it is known to work
        found.positions(records[0])
        found.fly(records[0])
    findings = check(found, records, vehicle, own=own)
    return BookkeepingCheck(found.name, found.kind, tuple(found.responses), tuple(findings))


@dataclass(frozen=True)
class BookkeepingCheck:
    """Mistakes of bookkeeping between a simulation and flights; true where there are none.

    Attributes
    ----------
    simulation, kind : str
    responses : tuple of str
    findings : tuple of Finding
        Largest first.
    """

    simulation: str
    kind: str
    responses: tuple[str, ...]
    findings: tuple[Finding, ...]

    def __bool__(self) -> bool:
        return not self.findings

    def __str__(self) -> str:
        lines = [f"{self.simulation} predicts {' '.join(self.responses)}.", *map(finding_line, self.findings)]
        return "\n".join(lines if self.findings else [*lines, "No mistake of bookkeeping was found."])

    def refuse(self) -> None:
        """Raise where there are mistakes.

        Raises
        ------
        GateFailed
            With their number.
        """
        if count := len(self.findings):
            raise GateFailed(
                f"{count} mistake{'s' if count > 1 else ''} of bookkeeping between simulation and flight",
                remedy="mend and check again before a gap is diagnosed",
            )


def finding_line(finding: Finding) -> str:
    """Return a finding as an indented line."""
    share = f" ({100 * finding.explained:.0f} % of the residual)" if finding.explained else ""
    return f"  {finding.fault}: {finding.sentence}{share}; {finding.remedy}."

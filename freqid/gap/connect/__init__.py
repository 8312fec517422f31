"""How simulations of every kind are connected: one adapter a file, imported when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario, find_scenario, read_scenario
from freqid.core.vehicle import Vehicle
from freqid.gap.simulation import Simulation

KINDS = "FILE.py:NAME, MODEL.fmu, jsbsim:AIRCRAFT, SCENARIO.toml or predictions FILE.h5"


def connect(
    sim: str | Callable[..., Any] | None = None,
    *,
    scenario: Scenario | Path | str | None = None,
    predictions: Sequence[Path] = (),
    record: FlightRecord | None = None,
) -> Simulation:
    """Return a simulation from the words of the command line, or from a Python function.

    Parameters
    ----------
    sim : str or callable, optional
        ``FILE.py:NAME``, ``MODEL.fmu``, ``jsbsim:AIRCRAFT`` (a name or an aircraft's XML file),
        ``SCENARIO.toml`` or the name of a shipped one, or ``FILE.h5`` of recorded predictions, several with
        commas between. A function as `callable.CallableSimulation` describes it.
    scenario : Scenario, path or name, optional
        Describes the vehicle of a simulation that does not; by itself, the simulation.
    predictions : sequence of Path, optional
        Recorded predictions in place of a simulation.
    record : FlightRecord, optional
        On which a function is evaluated once to learn its responses, if it does not state them.

    Raises
    ------
    UsageError
        Where none or several are given, or the words name no kind of simulation.
    DataError
        Where a file is missing or cannot be used, or an extra that the kind needs is not installed.
    """
    if sim is not None and predictions:
        raise UsageError("both a simulation and recorded predictions are given", remedy="give one of them")
    described = read_scenario(scenario)[0] if isinstance(scenario, str | Path) else scenario
    beside = described.aircraft() if described else None
    if predictions:
        from freqid.gap.connect import predictions as recorded

        return recorded.load(predictions, beside)
    if sim is None:
        if described is None:
            raise UsageError("no simulation is given", remedy=f"give --sim {KINDS}, or --predictions P.h5")
        from freqid.gap.connect.scenario import ScenarioSimulation

        return ScenarioSimulation(described, name=described.file or described.vehicle.name)
    if not isinstance(sim, str):
        return _of_function(sim, beside, record)
    if find_scenario(sim).suffix == ".toml":
        from freqid.gap.connect.scenario import ScenarioSimulation

        return ScenarioSimulation(read_scenario(sim)[0], name=sim)
    if sim.startswith("jsbsim:"):
        from freqid.gap.connect import jsbsim

        return jsbsim.load(sim.removeprefix("jsbsim:"), beside)
    if sim.endswith(".h5"):
        from freqid.gap.connect import predictions as recorded

        return recorded.load([Path(part) for part in sim.split(",")], beside)
    if sim.endswith(".fmu"):
        from freqid.gap.connect import fmu

        return fmu.load(Path(sim), beside)
    if ".py" in sim:
        return _of_function(sim, beside, record)
    raise UsageError(f"'{sim}' names no kind of simulation", remedy=f"write {KINDS}")


def _of_function(
    sim: str | Callable[..., Any], beside: Vehicle | None, record: FlightRecord | None
) -> Simulation:
    from freqid.gap.connect import callable as functions

    found = functions.load(sim) if isinstance(sim, str) else functions.simulation_of(sim)
    if beside is not None:
        found = replace(found, vehicle=beside)
    if not found.responses:
        if record is None:
            name = found.name.rpartition(":")[2]
            raise UsageError(
                "the function does not state its responses",
                where=found.name,
                remedy=f"add {name}.responses = ('X', ...)",
            )
        found = found.probed(record)
    return found

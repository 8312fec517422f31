"""``freqid check-simulation``: mistakes of bookkeeping, before a gap is called physics."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from freqid.cli import options


@click.command("check-simulation")
@click.argument("records", nargs=-1, required=True, type=click.Path(path_type=Path))
@options.simulation("Describes the vehicle; without --sim, the simulation.")
@click.option("--own", is_flag=True, help="RECORDS are the simulation's own flights: nothing may be left.")
@options.as_json
def command(
    records: tuple[Path, ...],
    sim: str | None,
    predictions: tuple[Path, ...],
    scenario: Path | None,
    own: bool,
    json_: bool,
) -> None:
    """Lay a simulation beside RECORDS and name mistakes of units, signs, axes, points, order and clock.

    A mistake is named where taking it back makes nearly all of a residual go. Ends with exit code 4 where
    there is one.
    """
    from freqid.core.errors import GateFailed
    from freqid.core.record import read_record
    from freqid.core.scenario import read_scenario
    from freqid.gap import flights
    from freqid.gap.bookkeeping.check import check
    from freqid.gap.connect import connect

    flown = [read_record(path) for path in records]
    simulation = connect(sim, scenario=scenario, predictions=predictions, record=flown[0])
    vehicle = read_scenario(scenario)[0].aircraft() if scenario is not None else None
    names = [str(path) for path in records]
    used = flights.maneuvers(flown, names, simulation, flights.vehicle_of(flown, simulation, vehicle))
    flights.refuse_unmeasured(used, names, simulation)
    if simulation.kind == "callable":  # what else it has is asked once, so that it is known to work
        simulation.positions(flown[0])
        simulation.fly(flown[0])
    findings = check(simulation, flown, vehicle, own=own)
    result = {
        "simulation": simulation.name,
        "kind": simulation.kind,
        "responses": list(simulation.responses),
        "findings": [asdict(finding) for finding in findings],
    }
    lines = [f"{simulation.name} predicts {' '.join(simulation.responses)}."]
    for finding in findings:
        share = f" ({100 * finding.explained:.0f} % of the residual)" if finding.explained else ""
        lines.append(f"  {finding.fault}: {finding.sentence}{share}; {finding.remedy}.")
    if not findings:
        lines.append("No mistake of bookkeeping was found.")
    options.emit(json_, result, "\n".join(lines))
    if findings:
        count = len(findings)
        raise GateFailed(
            f"{count} mistake{'s' if count > 1 else ''} of bookkeeping between simulation and flight",
            remedy="mend and check again before a gap is diagnosed",
        )

"""``freqid check-simulation``: mistakes of bookkeeping, before a gap is called physics."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from freqid.cli import options


@click.command("check-simulation")
@click.argument("records", nargs=-1, required=True, type=options.FILE)
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
    from freqid.workflows.connect import check_simulation

    found = check_simulation(sim, records, scenario=scenario, predictions=predictions, own=own)
    options.emit(json_, asdict(found), str(found))
    found.refuse()

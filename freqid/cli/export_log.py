"""``freqid export-log``: a flight record becomes a file of another tool."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli.options import FILE, as_json, emit, keep_inputs, output


@click.command("export-log")
@click.argument("record", type=FILE)
@output("the record's name with .mat")
@as_json
def command(record: Path, destination: Path | None, json_: bool) -> None:
    """Write RECORD as a MATLAB file in the 90-column SIDPAC layout, in SIDPAC's units."""
    from freqid.core.record import read_record
    from freqid.workflows.import_log import export_log

    destination = destination or record.with_suffix(".mat")
    flight = read_record(record)
    keep_inputs(destination, record)
    left_out = export_log(flight, destination)
    text = f"{destination}: {flight.time.size} samples in SIDPAC columns"
    if left_out:
        text += f"\nSIDPAC has no column for {', '.join(left_out)}"
    emit(json_, {"path": str(destination), "left_out": left_out}, text)

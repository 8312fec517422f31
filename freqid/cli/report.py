"""``freqid report``: a point model, a gap, or two simulations compared become a page that a team reviews."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli.options import as_json, emit, keep_inputs, output


@click.command("report")
@click.argument("model", type=click.Path(path_type=Path))
@output("the model's name with .html")
@click.option("--record", type=click.Path(path_type=Path), help="The record, where it has been moved.")
@click.option("--scenario", type=click.Path(path_type=Path), help="Its gates enter the verdict.")
@as_json
def command(
    model: Path, destination: Path | None, record: Path | None, scenario: Path | None, json_: bool
) -> None:
    """Write one self-contained HTML page about MODEL.

    A point model, the diagnosis of a gap, or a comparison of two simulations.
    """
    from freqid.core import gap_file, rivals_file, store

    if store.kind_of(model) == rivals_file.FORMAT:
        from freqid.report.rivals_page import write_rivals_page

        destination = destination or model.with_suffix(".html")
        keep_inputs(destination, model)
        write_rivals_page(destination, rivals_file.read_rivals(model))
        emit(json_, {"path": str(destination)}, str(destination))
        return
    if store.kind_of(model) == gap_file.FORMAT:
        from freqid.report.gap_page import write_gap_page

        destination = destination or model.with_suffix(".html")
        keep_inputs(destination, model)
        write_gap_page(destination, gap_file.read_gap(model))
        emit(json_, {"path": str(destination)}, str(destination))
        return
    from freqid.core.point_file import read_point
    from freqid.core.record_file import read_record
    from freqid.core.scenario import read_scenario
    from freqid.report.page import write_report

    point = read_point(model)
    if record is None:
        used = point.provenance.get("record")
        record = Path(used) if isinstance(used, str) and Path(used).is_file() else None
    gates = read_scenario(scenario)[0].gates if scenario else None
    destination = destination or model.with_suffix(".html")
    keep_inputs(destination, model, record, scenario)
    write_report(destination, point, read_record(record) if record else None, gates=gates)
    emit(json_, {"path": str(destination)}, str(destination))

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
    from freqid.core import store
    from freqid.core.results import gap, rivals
    from freqid.report.kit.rendering import write_text

    destination = destination or model.with_suffix(".html")
    kind = store.kind_of(model)
    if kind == rivals.FORMAT:
        from freqid.report.gap.rivals_page import build_rivals_page

        keep_inputs(destination, model)
        text = build_rivals_page(rivals.read_rivals(model))
    elif kind == gap.FORMAT:
        from freqid.report.gap.page import build_gap_page

        keep_inputs(destination, model)
        text = build_gap_page(gap.read_gap(model))
    else:
        from freqid.core.record import read_record
        from freqid.core.results.point import read_point
        from freqid.core.scenario import read_scenario
        from freqid.report.point.page import build_page

        point = read_point(model)
        if record is None:
            used = point.provenance.get("record")
            record = Path(used) if isinstance(used, str) and Path(used).is_file() else None
        gates = read_scenario(scenario)[0].gates if scenario else None
        keep_inputs(destination, model, record, scenario)
        text = build_page(point, read_record(record) if record else None, gates=gates)
    write_text(destination, text)
    emit(json_, {"path": str(destination)}, str(destination))

"""``freqid report``: a result becomes a page that a team reviews."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli.options import FILE, as_json, emit, keep_inputs, output


@click.command("report")
@click.argument("result", metavar="RESULT", type=FILE)
@output("the result's name with .html")
@click.option(
    "--record",
    type=FILE,
    help="Of a point model its record, where it has been moved; of a global model one that no point is made "
    "from, to predict.",
)
@click.option("--scenario", type=FILE, help="Its gates enter the verdict.")
@as_json
def command(
    result: Path, destination: Path | None, record: Path | None, scenario: Path | None, json_: bool
) -> None:
    """Write one self-contained HTML page about RESULT.

    A point model, a global model, laws against advance ratio, a quick look, margins, the diagnosis of a gap,
    a comparison of two simulations, frequency responses, or a prediction and its score.
    """
    from freqid.views.page import page

    destination = destination or result.with_suffix(".html")
    drawn = page(result, record=record, scenario=scenario)
    keep_inputs(destination, result, record, scenario)
    drawn.save(destination)
    emit(json_, {"path": str(destination)}, str(destination))

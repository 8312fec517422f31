"""``freqid study``: the whole chain of a scenario, from inputs to the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options


@click.command("study")
@click.argument("scenario", type=options.FILE)
@click.option(
    "-o",
    "--output",
    "folder",
    type=options.FILE,
    help="Folder of everything; default: the scenario's name with -study, in reports/.",
)
@click.option(
    "--at",
    default="",
    callback=options.parsed(options.names),
    help="Conditions to fly, as u20,u45,u70; all of the scenario without it.",
)
@click.option(
    "--hold-out",
    "held_out",
    default="",
    callback=options.parsed(options.names),
    help="Of them, those that the global model is judged at and not made from.",
)
@click.option("--sensors", default="research", show_default=True, help="Sensor suite of the scenario.")
@click.option(
    "--noise", type=click.FloatRange(min=0), default=1.0, show_default=True, help="Multiple of its noise."
)
@options.estimator
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--jobs", type=int, default=2, show_default=True, help="Processes at once; -1 for one a core.")
@options.as_json
def command(
    scenario: Path,
    folder: Path | None,
    json_: bool,
    **asked: Any,
) -> None:
    """Design inputs, fly and identify SCENARIO's conditions, blend a global model, and write a page of it.

    What is done is kept: a second run, or one after a stop, goes on from there.
    """
    from freqid.cli.study_texts import study_result, study_table
    from freqid.views.page import page
    from freqid.workflows.study import study

    folder = folder or Path("reports") / f"{scenario.stem}-study"
    results = study(scenario, folder, tell=lambda text: click.echo(f"{text} ...", err=True), **asked)
    drawn = page(results).save(folder / "index.html")
    options.emit(json_, study_result(results, folder), f"{study_table(results)}\nThe report is {drawn}")

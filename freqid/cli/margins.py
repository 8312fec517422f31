"""``freqid margins``: stability margins, modes and trim authority of a model under a control law."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE
from freqid.cli.progress import line


def _places(text: str) -> tuple[str | float, ...]:
    """Return ids of points, and speeds, m/s, that stand with commas between them."""
    found: list[str | float] = []
    for name in options.names(text):
        try:
            found.append(float(name))
        except ValueError:
            found.append(name)
    return tuple(found)


@click.command("margins")
@click.argument("model", metavar="MODEL", type=FILE)
@click.argument("loop", metavar="LOOP")
@options.output("the model's name with -margins.h5")
@click.option(
    "--at",
    default="",
    callback=options.parsed(_places),
    help="Points of the model, conditions of the scenario whose law it is, or speeds in m/s, as u20,u45 or "
    "12.5,30; all points of the model without it.",
)
@click.option("--scenario", type=FILE, help="Vehicle in place of the one that the model states.")
@click.option(
    "--draws",
    type=click.IntRange(min=0),
    default=200,
    show_default=True,
    help="Models drawn from the covariance for the intervals; 0 for none.",
)
@options.seed("Of the draws.")
@click.option(
    "--level",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.95,
    show_default=True,
    help="Of the intervals.",
)
@click.option(
    "--beside",
    multiple=True,
    type=FILE,
    help="Another global model, or a scenario whose simulation is linearised, to show beside; may be "
    "repeated.",
)
@options.page_option("the margins along the corridor")
@options.as_json
def command(model: Path, loop: str, destination: Path | None, page: bool, json_: bool, **asked: Any) -> None:
    """Say what the uncertainty of MODEL means for the control law LOOP.

    MODEL is a global model or a point model. LOOP is a loop file (TOML or MAT), FILE.py:NAME of a
    python-control system (its code is run, with all your rights), or a scenario, whose own law and
    actuators are then taken (docs/margins.md).
    """
    from freqid.cli.margins_texts import margins_result, margins_table
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.models.margins import margins

    destination = destination or model.with_name(f"{model.stem}-margins.h5")
    sources = (model, Path(loop), asked["scenario"], *asked["beside"])
    drawn = options.page_beside(destination, page, *sources)
    tell = line()
    found = margins(model, loop, **asked, tell=tell)
    tell("")
    save(found, destination)
    if drawn:
        page_of(found).save(drawn)
    text = f"{margins_table(found)}\n{options.written(destination, drawn)}"
    options.emit(json_, margins_result(found), text)

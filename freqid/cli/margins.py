"""``freqid margins``: stability margins, modes and trim authority of a model under a control law."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli import options
from freqid.cli.options import FILE
from freqid.cli.progress import line


@click.command("margins")
@click.argument("model", metavar="MODEL", type=FILE)
@click.argument("loop", metavar="LOOP")
@click.option(
    "-o", "--output", "destination", type=FILE, help="Result; default: the model's name with -margins.h5."
)
@click.option(
    "--at",
    default="",
    callback=options.parsed(options.names),
    help="Points of the model or speeds in m/s, as u20,u45 or 12.5,30; all its points without it.",
)
@click.option("--scenario", type=FILE, help="Vehicle in place of the one that the model states.")
@click.option(
    "--draws",
    type=click.IntRange(min=0),
    default=200,
    show_default=True,
    help="Models drawn from the covariance for the intervals; 0 for none.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the draws.")
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
def command(
    model: Path,
    loop: str,
    destination: Path | None,
    at: tuple[str, ...],
    scenario: Path | None,
    draws: int,
    seed: int,
    level: float,
    beside: tuple[Path, ...],
    page: bool,
    json_: bool,
) -> None:
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
    drawn = destination.with_suffix(".html") if page else None
    options.keep_inputs((destination, drawn), model, Path(loop), scenario, *beside)
    tell = line()
    found = margins(
        model,
        loop,
        [_place(name) for name in at],
        scenario=scenario,
        draws=draws,
        seed=seed,
        level=level,
        beside=beside,
        tell=tell,
    )
    tell("")
    save(found, destination)
    if drawn:
        page_of(found).save(drawn)
    options.emit(json_, margins_result(found), f"{margins_table(found)}\n{destination}")


def _place(text: str) -> str | float:
    """Return a speed, or the id of a point."""
    try:
        return float(text)
    except ValueError:
        return text

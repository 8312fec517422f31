"""``freqid quicklook``: a log held against its design, minutes after landing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("quicklook")
@click.argument("log", type=FILE)
@click.argument("design", type=FILE)
@click.option("--scenario", type=FILE, help="Limits of the effectors, and the regressors to judge.")
@click.option(
    "--map", "columns", type=FILE, help="TOML map of columns to channels, for a log that needs one."
)
@click.option("--resample", "resample_hz", type=float, help="Put all channels of a log on this rate, Hz.")
@click.option("--at", default="", help="Id of the reference condition that was flown.")
@click.option(
    "--accuracy",
    type=click.FloatRange(min=0, min_open=True),
    default=0.2,
    show_default=True,
    help="Standard error over the estimate that a parameter is asked for.",
)
@options.output("the log's name with -quicklook.h5")
@options.page_option("the inputs")
@options.as_json
def command(
    log: Path,
    design: Path,
    destination: Path | None,
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Tell whether LOG, flown with DESIGN, is usable or must be repeated, and why.

    Looks for the injection, its start, what effectors achieved of their commands, saturation, log rates and
    the accuracy of the parameters so far. Exit code 4 where the flight must be repeated.
    """
    from freqid.cli.quicklook_texts import quicklook_result, quicklook_text
    from freqid.core.errors import GateFailed
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.quicklook import quicklook

    destination = destination or log.with_name(f"{log.stem}-quicklook.h5")
    drawn = options.page_beside(destination, page, log, design, asked["scenario"], asked["columns"])
    look = quicklook(log, design, **asked)
    save(look, destination, scenario=asked["scenario"])
    if drawn:
        page_of(look).save(drawn)
    text = f"{quicklook_text(look)}\n{options.written(destination, drawn)}"
    options.emit(json_, quicklook_result(look), text)
    if not look.usable:
        raise GateFailed(
            f"repeat, because {'; '.join(look.reasons)}",
            where=str(log),
            remedy="what was found is written all the same",
        )

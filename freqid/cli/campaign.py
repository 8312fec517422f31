"""``freqid campaign``: Monte Carlo over conditions, seeds, effects and tolerances, here or on a cluster."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli import options


@click.command("campaign")
@click.argument("campaign", type=options.FILE)
@click.option(
    "-o",
    "--output",
    "folder",
    type=options.FILE,
    help="Folder of everything; default: the campaign's name, in reports/.",
)
@click.option("--axis", default="", help="Setting to show results against, in place of the file's.")
@click.option("--by", default="", help="Setting or column with one curve for each of its values, likewise.")
@options.jobs
@click.option(
    "--workers",
    type=click.IntRange(min=0),
    default=0,
    help="In their place, a dask cluster of so many processes on this machine.",
)
@click.option("--scheduler", default="", help="In their place, a dask scheduler that runs: tcp://HOST:8786.")
@options.page_option("coverage, bias, detections and false alarms against the axis")
@options.as_json
def command(
    campaign: Path,
    folder: Path | None,
    axis: str,
    by: str,
    jobs: int,
    workers: int,
    scheduler: str,
    page: bool,
    json_: bool,
) -> None:
    """Do every combination of CAMPAIGN's settings with every seed, and show how good the results are.

    CAMPAIGN is a TOML file that names a stage (fly, identify, blend, diagnose, or FILE.py:NAME, a function of
    your own, which is run) and what varies. Rows go to Parquet files in FOLDER/rows, all settings in every
    row. What is done is kept: a second run, or one after a stop, goes on from there.
    """
    from freqid.cli import progress
    from freqid.cli.monte_carlo_texts import monte_carlo_table
    from freqid.views.page import page as page_of
    from freqid.workflows.monte_carlo.run import monte_carlo

    folder = folder or Path("reports") / campaign.stem
    found = monte_carlo(
        campaign,
        folder,
        axis=axis,
        by=by,
        jobs=jobs,
        workers=workers,
        scheduler=scheduler,
        tell=lambda text: click.echo(f"{text} ...", err=True),
        progress=progress.paced("cases"),
    )
    text = monte_carlo_table(found)
    if page:
        text += f"\nThe page is {page_of(found).save(folder / 'index.html')}"
    options.emit(json_, {"folder": str(folder)} | found.to_json(), text)

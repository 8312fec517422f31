"""``freqid report``: results become a page that a team reviews."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli import options, progress
from freqid.cli.options import FILE


@click.command("report")
@click.argument("results", metavar="RESULT...", nargs=-1, required=True, type=FILE)
@options.output("the first result's name with .html")
@click.option(
    "--record",
    type=FILE,
    help="Of a point model its record, where it has been moved; of a global model one that no point is made "
    "from, to predict.",
)
@click.option("--scenario", type=FILE, help="Draws the vehicle; its gates enter the verdict.")
@click.option(
    "--against",
    multiple=True,
    type=FILE,
    help="An older set of files, or the -review.h5 of an older report, to say what changed; may be repeated.",
)
@options.as_json
def command(
    results: tuple[Path, ...],
    destination: Path | None,
    record: Path | None,
    scenario: Path | None,
    against: tuple[Path, ...],
    json_: bool,
) -> None:
    """Write one self-contained HTML page about RESULT..., in any mixture.

    Designs, records, quick looks, point and global models, laws against advance ratio, frequency responses,
    margins, predictions and scores, diagnoses of gaps, comparisons, and folders of studies. One result has
    its own page. Several, or a study, make one page: the decision first, then a part for each, and a file
    -review.h5 beside it that a later report may be compared with.
    """
    from freqid.views.page import page
    from freqid.workflows.files import save

    folder = results[0].is_dir()
    destination = destination or (results[0] / "index.html" if folder else results[0].with_suffix(".html"))
    beside = destination.with_name(f"{destination.stem}-review.h5")
    options.keep_inputs((destination, beside), *results, record, scenario, *against)
    tell = progress.line()
    drawn = page(list(results), record=record, scenario=scenario, against=against, tell=tell)
    tell("")
    drawn.save(destination)
    table, text = {"path": str(destination)}, str(destination)
    if drawn.review is not None:
        save(drawn.review, beside)
        table |= {"review": str(beside), **drawn.review.to_json()}
        lines = [f"{d.subject}: {d.answer} ({d.because.rstrip('.')})" for d in drawn.review.decisions]
        text = "\n".join([*lines, str(beside), text])
    options.emit(json_, table, text)

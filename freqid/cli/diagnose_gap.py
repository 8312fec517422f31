"""``freqid diagnose-gap``: whether simulation and flights differ, where, by which effect, and how far."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("diagnose-gap")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=FILE)
@options.output("the first record's name with -gap.h5")
@options.simulation("Vehicle, tolerances and band; without --sim, the simulation.", several=True)
@click.option(
    "--holdout",
    "held_out",
    multiple=True,
    type=FILE,
    help="Flight on which closures are scored; may be repeated. Without it, RECORDs take turns.",
)
@click.option(
    "--effect", "effects", multiple=True, help="Effect to close the gap with; may be repeated: together."
)
@options.own_effects
@options.band("the scenario's, else what is injected; the mean and what is slower than LOW count too")
@click.option(
    "--tolerance",
    "tolerances",
    multiple=True,
    metavar="NAME=SIGMA",
    callback=options.parsed(options.sigma("--tolerance", "mass=0.01")),
    help="One sigma of what is no gap, over the scenario's [tolerance]; may be repeated.",
)
@click.option(
    "--level",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.02,
    show_default=True,
    help="At which a gap is called one: so many false alarms.",
)
@click.option(
    "--draws",
    type=click.IntRange(min=100),
    default=500,
    show_default=True,
    help="Of flights without a gap, with noise and tolerances, for the level.",
)
@options.seed("Of the draws.")
@click.option(
    "--next-flight/--no-next-flight",
    "plan",
    default=True,
    help="Where several explanations remain, propose the tests that would tell them apart.",
)
@click.option(
    "--self-test",
    is_flag=True,
    help="Try the diagnosis on each effect inserted into this simulation and these flights.",
)
@click.option("--anyway", is_flag=True, help="Go on where mistakes of bookkeeping are found.")
@options.page_option("the diagnosis")
@options.as_json
def command(
    records: tuple[Path, ...],
    destination: Path | None,
    sim: tuple[str, ...],
    predictions: tuple[Path, ...],
    held_out: tuple[Path, ...],
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Diagnose the gap between a simulation and the flights RECORD....

    Says whether there is a gap beyond noise and tolerances, where it is, which effect of the library makes
    it, and how much of it goes once that effect is added: on flights held out, or on the flights in turn.
    Looks for mistakes of bookkeeping first and stops there with exit code 4 where it finds any.

    With two simulations, --sim A --sim B or --sim A --predictions B.h5, says which of them is nearer to the
    flights, where, and whether that is beyond noise and tolerances.
    """
    from freqid.cli import gap_texts, progress, rivals_texts
    from freqid.views.page import page as page_of
    from freqid.workflows.compare import compare_simulations, pair_of
    from freqid.workflows.diagnose import BookkeepingMistakes, diagnose_gap
    from freqid.workflows.files import save

    pair = pair_of(sim, predictions, held_out, asked["effects"])
    if pair:
        options.refuse_beside("two simulations", "self_test", "draws", "anyway")
    default = f"{records[0].stem}-{'rivals' if pair else 'gap'}.h5"
    destination = destination or records[0].with_name(default)
    design = destination.with_name(f"{destination.stem}-next.h5")
    sources = (*records, *held_out, *predictions, asked["scenario"], asked["own_effects"])
    drawn = options.page_beside(destination, page, *sources)
    options.keep_inputs(design, *sources)
    tell = progress.line()
    asked |= {"tolerances": dict(asked["tolerances"]), "tell": tell}
    if pair:
        shared = ("scenario", "own_effects", "band_hz", "tolerances", "level", "seed", "tell")
        found = compare_simulations(*pair, records, **{name: asked[name] for name in shared})
        table, text = found.to_json(), rivals_texts.rivals_text(found)
    else:
        asked |= {"held_out": held_out, "predictions": predictions, "next_design": design}
        try:
            found = diagnose_gap(sim[0] if sim else None, records, **asked)
        except BookkeepingMistakes as stopped:
            report = gap_texts.bookkeeping_text(stopped.verdict, stopped.findings)
            options.emit(json_, stopped.table, report)
            raise
        table = found.to_json() | {"bookkeeping": [asdict(f) for f in found.bookkeeping]}
        text = gap_texts.diagnosis_text(found.diagnosis)
    save(found, destination)
    if drawn:
        tell("drawing")
        page_of(found).save(drawn)
    tell("")
    table |= {"file": str(destination), "page": str(drawn or "")}
    options.emit(json_, table, f"{text}\n\n{options.written(destination, drawn)}")

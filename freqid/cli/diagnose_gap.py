"""``freqid diagnose-gap``: whether simulation and flights differ, where, by which effect, and how far."""

from __future__ import annotations

from collections.abc import Sequence
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
    multiple=True,
    type=FILE,
    help="Flight on which closures are scored; may be repeated. Without it, RECORDs take turns.",
)
@click.option(
    "--effect", "effects", multiple=True, help="Effect to close the gap with; may be repeated: together."
)
@click.option("--effects", "own_effects", type=FILE, help="Python file with effects of your own.")
@options.band("the scenario's, else what the injected signals drive")
@click.option(
    "--tolerance",
    "given",
    multiple=True,
    metavar="NAME=SIGMA",
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
@click.option("--seed", type=int, default=0, show_default=True, help="Of the draws.")
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
    holdout: tuple[Path, ...],
    band: str | None,
    given: tuple[str, ...],
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Diagnose the gap between a simulation and the flights RECORD....

    Says whether there is a gap beyond noise and tolerances, where it is, which effect of the library makes
    it, and how much of it goes on flights that were not used once that effect is added. Looks for mistakes
    of bookkeeping first and stops there with exit code 4 where it finds any.

    With two simulations, --sim A --sim B or --sim A --predictions B.h5, says which of them is nearer to the
    flights, where, and whether that is beyond noise and tolerances.
    """
    from freqid.cli import gap_texts, progress, rivals_texts
    from freqid.views.page import page as page_of
    from freqid.workflows.compare import compare_simulations
    from freqid.workflows.connect import connect
    from freqid.workflows.diagnose import BookkeepingMistakes, diagnose_gap
    from freqid.workflows.files import save

    two = _two(sim, predictions, holdout, asked["effects"])
    default = f"{records[0].stem}-{'rivals' if two else 'gap'}.h5"
    destination = destination or records[0].with_name(default)
    drawn = destination.with_suffix(".html") if page else None
    design = destination.with_name(f"{destination.stem}-next.h5")
    sources = (*records, *holdout, *predictions, asked["scenario"], asked["own_effects"])
    options.keep_inputs((destination, drawn, design), *sources)
    tell = progress.line()
    asked |= {"band_hz": options.band_hz(band), "tolerances": _sigmas(given), "tell": tell}
    if two:
        pair = [*sim, *([connect(predictions=predictions)] if predictions else [])]
        shared = ("scenario", "own_effects", "band_hz", "tolerances", "level", "seed", "tell")
        found = compare_simulations(pair[0], pair[1], records, **{name: asked[name] for name in shared})
        table, text = found.to_json(), rivals_texts.rivals_text(found)
    else:
        one = sim[0] if sim else None
        try:
            found = diagnose_gap(
                one, records, held_out=holdout, predictions=predictions, next_design=design, **asked
            )
        except BookkeepingMistakes as stopped:
            said = gap_texts.bookkeeping_text(stopped.verdict, stopped.findings)
            options.emit(json_, stopped.table, said)
            raise
        table = found.to_json() | {"bookkeeping": [asdict(f) for f in found.bookkeeping]}
        text = gap_texts.diagnosis_text(found.diagnosis)
    save(found, destination)
    if drawn:
        tell("drawing")
        page_of(found).save(drawn)
    tell("")
    table |= {"file": str(destination), "page": str(drawn or "")}
    options.emit(json_, table, f"{text}\n\n{destination}" + (f"\n{drawn}" if drawn else ""))


def _two(
    sims: Sequence[str], predictions: Sequence[Path], holdout: Sequence[Path], effects: Sequence[str]
) -> bool:
    """Say whether two simulations are compared; refuse more, and what is asked of one alone."""
    from freqid.core.errors import UsageError

    count = len(sims) + bool(predictions)
    if count > 2:
        raise UsageError(f"{count} simulations are given", remedy="compare two at a time")
    if count == 2 and holdout:
        raise UsageError(
            "--holdout is for closures, and two simulations are compared as they are",
            remedy="name all flights as records",
        )
    if count == 2 and effects:
        raise UsageError(
            "--effect is for one simulation, and two are given",
            remedy="diagnose each by itself with --effect",
        )
    return count == 2


def _sigmas(given: Sequence[str]) -> dict[str, float]:
    """Return the tolerances of ``--tolerance`` by name."""
    from freqid.core.errors import UsageError

    found = {}
    for word in given:
        name, _, value = word.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise UsageError(f"--tolerance is NAME=SIGMA such as mass=0.01, not '{word}'") from None
    return found

"""``freqid design-inputs``: a scenario becomes inputs that are safe to fly, a page and a test card."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("design-inputs")
@click.argument("scenario", type=FILE)
@options.output("design.h5 in reports/")
@click.option(
    "--input",
    "waveform",
    type=click.Choice(["multisine", "doublet", "3-2-1-1", "sweep"]),
    default="multisine",
    show_default=True,
    help="Multisines on all effectors at once, or a classic input on one after the other.",
)
@click.option(
    "--at", default="", help="Reference condition: its own excitation, limits counted from its tilts."
)
@options.seed("The same seed gives the same design.")
@click.option("--model", type=FILE, help="Point model, to forecast accuracy and motion.")
@click.option(
    "--optimal",
    type=click.Choice(["A", "D"]),
    help="Scale amplitudes for the least variance (A) or volume (D) of uncertainty within all limits.",
)
@click.option(
    "--reach",
    multiple=True,
    metavar="RESPONSE.REGRESSOR=ERROR",
    help="Fly as few periods as reach this standard error, SI or with % of the parameter; repeatable.",
)
@click.option(
    "--longest",
    "longest_s",
    type=float,
    default=600.0,
    show_default=True,
    help="Longest manoeuvre for --reach, s.",
)
@click.option(
    "--swapped",
    "swap",
    multiple=True,
    metavar="EFFECTOR:EFFECTOR",
    help="Also write a second set in which these two exchange their harmonics; repeatable.",
)
@click.option("--study/--no-study", default=True, help="Compare periods of 40 to 120 s on the page.")
@click.option("--page/--no-page", default=True, help="Write the page and the test card beside the design.")
@click.option("--csv", is_flag=True, help="Also write the samples as CSV.")
@click.option("--mat", is_flag=True, help="Also write the samples as a MATLAB file.")
@click.option("--c-header", is_flag=True, help="Also write a C header that evaluates the signals.")
@click.option("--lua", is_flag=True, help="Also write a Lua table that evaluates the signals.")
@options.as_json
def command(
    scenario: Path,
    destination: Path | None,
    study: bool,
    page: bool,
    csv: bool,
    mat: bool,
    c_header: bool,
    lua: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Design orthogonal, phase-optimised multisines, or classic inputs, for the effectors of SCENARIO.

    Writes DESIGN.h5 and beside it a page with all plots, and a test card as text and HTML.
    """
    from freqid.cli import progress
    from freqid.views.designs import write_design_files
    from freqid.workflows.design import design_inputs, refuse_unfit

    destination = destination or Path("reports") / "design.h5"
    options.page_beside(destination, page, scenario, asked["model"])
    refuse_unfit(asked["waveform"], {"--c-header": c_header, "--lua": lua})
    formats = {".csv": csv, ".mat": mat, ".h": c_header, ".lua": lua}
    found = design_inputs(
        scenario,
        study=study and page,
        progress=progress.bar("signals", "signal"),
        watch=progress.watched,
        **asked,
    )
    wanted = [suffix for suffix, given in formats.items() if given]
    options.emit(json_, *write_design_files(found, destination, wanted, documents=page))

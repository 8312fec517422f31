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
    help="Of them, those that the global model is judged at and not made from; of a campaign, manoeuvres as "
    "m03,m12.",
)
@click.option("--sensors", default="research", show_default=True, help="Sensor suite of the scenario.")
@click.option(
    "--noise", type=click.FloatRange(min=0), default=1.0, show_default=True, help="Multiple of its noise."
)
@click.option(
    "--turbulence",
    type=click.FloatRange(min=0),
    help="Of a campaign: multiple of light turbulence; 1 without it.",
)
@click.option("--flights", type=options.FILE, help="Folder of real flights, in place of simulated ones.")
@click.option("--map", "columns", type=options.FILE, help="Of logs among them: map of their columns.")
@click.option("--resample", "resample_hz", type=float, help="Put these logs on this rate, Hz.")
@click.option(
    "--validate",
    default="",
    callback=options.parsed(options.names),
    help="Flights, by name, that validate and are not modelled; the last of each condition without it.",
)
@options.estimator
@options.seed()
@options.jobs
@options.page_option("the study")
@options.as_json
def command(
    scenario: Path,
    folder: Path | None,
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Design inputs, fly and identify SCENARIO's conditions, blend a global model, and write a page of it.

    A scenario with [campaign] is flown in one flight through all its trims, and laws of the propellers'
    advance ratio are fitted. With --flights nothing is designed or simulated: real flights are sorted to the
    conditions, identified, blended and judged. Exit code 4 says that all is written but a gate is missed.

    What is done is kept: a second run, or one after a stop, goes on from there.
    """
    from freqid.blend.semi_local.advance_ratio_study import CampaignStudy
    from freqid.cli.advance_ratio_texts import advance_ratio_result, advance_ratio_table
    from freqid.cli.study_texts import study_result, study_table
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.inputs import scenario_of
    from freqid.workflows.studies.studied import refuse_missed_study_gates
    from freqid.workflows.studies.study import study

    folder = folder or Path("reports") / f"{scenario.stem}-study"

    def tell(text: str) -> None:
        click.echo(f"{text} ...", err=True)

    results = study(scenario, folder, tell=tell, **asked)
    path = folder / "index.html"
    if page:
        drawn = (
            page_of(results)
            if isinstance(results, CampaignStudy)
            else page_of([folder], scenario=scenario, tell=tell)
        )
        drawn.save(path)
        if drawn.review is not None:
            save(drawn.review, folder / "index-review.h5")
    if isinstance(results, CampaignStudy):
        found = results.model("global"), results.scores
        result, text = {"folder": str(folder)} | advance_ratio_result(*found), advance_ratio_table(*found)
    else:
        result, text = study_result(results, folder), study_table(results)
    options.emit(json_, result, f"{text}\nThe report is {path}" if page else text)
    refuse_missed_study_gates(results, scenario_of(scenario), str(folder))

"""``freqid check``: what a scenario still lacks for each command, and a drawing of its aircraft."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli import options


@click.command("check")
@click.argument("scenario", type=options.FILE)
@click.option("--at", default="", help="Reference whose tilts are drawn; the first where absent.")
@options.output("the scenario's name with -three-view.svg; .png and .pdf are drawn too")
@click.option("--draw/--no-draw", default=True, help="Draw the aircraft from three sides.")
@options.as_json
def command(scenario: Path, at: str, destination: Path | None, draw: bool, json_: bool) -> None:
    """Say what SCENARIO lacks for each command, and the point that moments are about; draw the aircraft."""
    from freqid.workflows.inputs import scenario_of
    from freqid.workflows.scenarios.check_scenario import check_scenario, three_view_of

    described = scenario_of(scenario)
    found = check_scenario(described)
    result, text = found.to_json(), str(found)
    if draw:
        from freqid.views.aircraft import draw_aircraft

        destination = destination or three_view_of(described)
        options.keep_inputs(destination, scenario)
        written = draw_aircraft(described, destination, at)
        result["files"] = [str(destination)] if written else []
        text += (
            f"\n\n{destination}"
            if written
            else "\n\nNothing is drawn: no [[rotor]], [[surface]] or airframe has a place."
        )
    options.emit(json_, result, text)

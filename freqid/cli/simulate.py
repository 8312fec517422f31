"""``freqid simulate``: a flight in place of the aircraft, logged as the aircraft would log it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE
from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario

_FROM_ZERO = click.FloatRange(min=0)


@click.command("simulate")
@click.argument("scenario", type=FILE)
@click.argument("design", type=FILE, required=False)
@options.output("the condition's name with .h5, in reports/")
@click.option("--at", help="Reference condition to start from; needed where there are several.")
@click.option("--to", help="Fly on to this condition, for example through the transition.")
@click.option("--duration", type=float, help="Seconds to fly; as long as DESIGN where not given.")
@click.option(
    "--campaign",
    is_flag=True,
    help="Fly all trims of [campaign] in one flight, DESIGN at each; without it the scenario's multisines.",
)
@click.option("--sensors", default="research", show_default=True, help="Sensor suite of the scenario.")
@click.option(
    "--noise",
    type=_FROM_ZERO,
    is_flag=False,
    flag_value=1.0,
    default=0.0,
    help="Let the sensors err; a number multiplies their noise.",
)
@click.option(
    "--turbulence",
    type=_FROM_ZERO,
    is_flag=False,
    flag_value=7.7,
    default=0.0,
    help="Fly in turbulence; m/s of wind at 20 ft, 7.7 (light) where only the flag is given.",
)
@options.seed("Of wind, gusts and sensor errors.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME=VALUE",
    help="Set an effect's size, or NAME.PARAMETER=VALUE; may be repeated.",
)
@options.own_effects
@click.option("--feedback/--no-feedback", default=True, help="Without it the trim's commands are held.")
@click.option("--page/--no-page", default=True, help="Draw the flight, in an HTML page beside the record.")
@options.as_json
def command(
    scenario: Path,
    design: Path | None,
    destination: Path | None,
    campaign: bool,
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Fly the vehicle of SCENARIO, excited by DESIGN after its control law, and write what it logs.

    The truth goes to a file of its own, RECORD.truth.h5, which no other command reads. RECORD.html shows
    the flight, true excursions and effectors beside their limits, the aircraft and its trims. A campaign
    has no page; ``freqid import-log RECORD --split`` cuts its manoeuvres.
    """
    from freqid.cli.flight_texts import flight_result, flight_text
    from freqid.simulate.truth import truth_path
    from freqid.views.page import page as page_of
    from freqid.workflows.fly import simulate, start_of
    from freqid.workflows.inputs import scenario_of

    described = scenario_of(scenario)
    if campaign:
        _fly_campaign(described, scenario, design, destination, json_, asked)
        return
    start = start_of(described, asked["at"])
    destination = destination or Path("reports") / f"{start.id}.h5"
    sources = (scenario, design, asked["own_effects"])
    drawn = options.page_beside(destination, page, *sources)
    options.keep_inputs(truth_path(destination), *sources)
    flown = simulate(described, design, **asked)
    flown.save(destination)
    result = flight_result(flown, destination)
    if drawn:
        result["page"] = str(page_of(flown, record=destination).save(drawn))
    flown.refuse_divergence(str(destination))
    options.emit(json_, result, flight_text(result))


def _fly_campaign(
    scenario: Scenario,
    file: Path,
    design: Path | None,
    destination: Path | None,
    json_: bool,
    asked: dict[str, Any],
) -> None:
    from freqid.cli.flight_texts import campaign_result, campaign_text
    from freqid.simulate.truth import truth_path
    from freqid.workflows.fly_trim_sequence import simulate_campaign

    single = {"at": "--at", "to": "--to", "duration": "--duration"}
    for name, option in single.items():
        if asked.pop(name) is not None:
            raise UsageError(f"{option} is of a single manoeuvre", remedy="leave it out of a --campaign")
    if not asked.pop("feedback"):
        raise UsageError("--no-feedback is of a single manoeuvre", remedy="leave it out of a --campaign")
    destination = destination or Path("reports") / f"{file.stem}-campaign.h5"
    options.keep_inputs((destination, truth_path(destination)), file, design, asked["own_effects"])
    flown = simulate_campaign(scenario, design, **asked)
    flown.save(destination)
    flown.refuse_divergence(str(destination))
    result = campaign_result(flown, destination)
    options.emit(json_, result, campaign_text(result))

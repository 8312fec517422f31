"""``freqid simulate``: a flight in place of the aircraft, logged as the aircraft would log it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid.cli import options

if TYPE_CHECKING:
    from freqid.core.record import FlightRecord


@click.command("simulate")
@click.argument("scenario", type=click.Path(path_type=Path))
@click.argument("design", type=click.Path(path_type=Path), required=False)
@options.output("the condition's name with .h5, in reports/")
@click.option("--at", "condition", help="Reference condition to start from; needed where there are several.")
@click.option("--to", help="Fly on to this condition, for example through the transition.")
@click.option("--duration", type=float, help="Seconds to fly; as long as DESIGN where not given.")
@click.option("--sensors", default="research", show_default=True, help="Sensor suite of the scenario.")
@click.option(
    "--noise",
    type=click.FloatRange(min=0),
    is_flag=False,
    flag_value=1.0,
    default=0.0,
    help="Let the sensors err; a number multiplies their noise.",
)
@click.option(
    "--turbulence",
    type=click.FloatRange(min=0),
    is_flag=False,
    flag_value=7.7,
    default=0.0,
    help="Fly in turbulence; m/s of wind at 20 ft, 7.7 (light) where only the flag is given.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of wind, gusts and sensor errors.")
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="NAME=VALUE",
    help="Set an effect's size, or NAME.PARAMETER=VALUE; may be repeated.",
)
@click.option(
    "--effects",
    "own_effects",
    type=click.Path(path_type=Path),
    help="Python file with effects of your own, set like the others.",
)
@click.option("--feedback/--no-feedback", default=True, help="Without it the trim's commands are held.")
@click.option("--page/--no-page", default=True, help="Draw the flight, in an HTML page beside the record.")
@options.as_json
def command(
    scenario: Path,
    design: Path | None,
    destination: Path | None,
    condition: str | None,
    to: str | None,
    duration: float | None,
    sensors: str,
    noise: float,
    turbulence: float,
    seed: int,
    effects: tuple[str, ...],
    own_effects: Path | None,
    feedback: bool,
    page: bool,
    json_: bool,
) -> None:
    """Fly the vehicle of SCENARIO, excited by DESIGN after its control law, and write what it logs.

    The truth goes to a file of its own, RECORD.truth.h5, which no other command reads. RECORD.html shows
    the flight, true excursions and effectors beside their limits, the aircraft and its trims.
    """
    from freqid.cli.flight_page import write_page
    from freqid.core.errors import DataError, UsageError
    from freqid.core.record import write_record
    from freqid.core.results.design import read_inputs
    from freqid.core.scenario import read_scenario
    from freqid.simulate.control.lq import close_loop
    from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects
    from freqid.simulate.truth import beside, write_truth

    described, sha256 = read_scenario(scenario)
    identifiers = [reference.id for reference in described.reference]
    if condition is None and len(identifiers) != 1:
        raise UsageError(
            f"the scenario has {len(identifiers)} reference conditions",
            where=str(scenario),
            remedy=f"choose one with --at, such as --at {identifiers[0]}" if identifiers else "add one",
        )
    start = described.reference_of(condition or identifiers[0])
    destination = destination or Path("reports") / f"{start.id}.h5"
    drawn = destination.with_suffix(".html") if page else None
    for result in (destination, beside(destination), drawn):
        if result:
            options.keep_inputs(result, scenario, design, own_effects)
    inputs = read_inputs(design) if design else None
    settings = _settings(effects, own_effects)
    if turbulence:
        settings["turbulence"] = turbulence
    described = with_effects(described, settings)
    loop = close_loop(described, start)
    flown = fly_maneuver(
        described,
        start,
        inputs,
        Conditions(sensors, noise, feedback=feedback, seed=seed),
        loop=loop,
        duration=duration,
        to=described.reference_of(to) if to else None,
    )
    write_record(destination, flown.record, sha256)
    write_truth(beside(destination), flown.truth, sha256)
    result = _result(destination, flown.truth, described.excitation.abort if described.excitation else {})
    if drawn:
        write_page(
            drawn,
            described,
            loop,
            flown,
            result["excursions"],
            record=destination.name,
            design=design.name if design else "",
            to=to or "",
            scenario_sha256=sha256,
        )
        result["page"] = str(drawn)
    if flown.divergence:
        raise DataError(
            str(flown.divergence),
            where=str(destination),
            remedy="the record holds the flight up to there; lower the inputs, or fly with feedback",
        )
    options.emit(json_, result, _text(result))


def _settings(effects: tuple[str, ...], own: Path | None) -> dict[str, Any]:
    """Return effect settings from ``NAME=VALUE`` and ``NAME.PARAMETER=VALUE``; a file's effects count too."""
    from freqid.core.errors import UsageError
    from freqid.simulate import effects as library
    from freqid.simulate.effects.files import load_file

    for effect in load_file(own).values() if own else ():
        library.register(effect)
    settings: dict[str, Any] = {}
    for text in effects:
        name, _, value = text.partition("=")
        identifier, _, parameter = name.partition(".")
        try:
            number = float(value)
        except ValueError:
            raise UsageError(
                f"--effect is NAME=VALUE with a number, such as wing_wake=0.5, not '{text}'"
            ) from None
        parameter = parameter or library.find(identifier).size
        settings.setdefault(identifier, {})[parameter] = number
    return settings


def _result(destination: Path, truth: FlightRecord, abort: dict[str, float]) -> dict[str, Any]:
    """Return what is worth knowing of a flight."""
    import numpy as np

    from freqid.simulate.truth import beside

    watched = dict.fromkeys(("u", "v", "w", "p", "q", "r", "phi", "theta", *abort))
    excursions = {}
    for name in watched:
        values = truth[f"state/{name}"]
        largest = float(np.max(np.abs(values - values[0])))
        excursions[name] = {"largest": largest, "unit": truth.channel(f"state/{name}").unit}
        if name in abort:
            excursions[name] |= {"limit": abort[name], "inside": largest <= abort[name]}
    return {
        "record": str(destination),
        "truth": str(beside(destination)),
        "reference": truth.reference,
        "duration_s": truth.duration,
        "excursions": excursions,
    }


def _text(result: dict[str, Any]) -> str:
    lines = [
        f"{result['record']}: {result['duration_s']:g} s from {result['reference']}; "
        f"the truth is in {result['truth']}",
        "largest excursions from the start:",
    ]
    for name, found in result["excursions"].items():
        limit = ""
        if "limit" in found:
            limit = f"  of {found['limit']:g}" + ("" if found["inside"] else "  BEYOND THE ABORT LIMIT")
        lines.append(f"  {name:6s}{found['largest']:9.3g} {found['unit']:6s}{limit}")
    return "\n".join(lines)

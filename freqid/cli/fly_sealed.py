"""``freqid fly-sealed``: flights with an effect that only a sealed file names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options, progress
from freqid.cli.options import FILE


@click.command("fly-sealed")
@click.argument("scenario", type=FILE)
@click.argument("design", type=FILE, required=False)
@click.option(
    "-o", "--output", "folder", type=FILE, help="Folder of the flights and seal.h5; default: reports/sealed."
)
@click.option(
    "--at", required=True, callback=options.parsed(options.names), help="Conditions to fly, as u30,u45."
)
@click.option("--duration", type=float, help="Seconds of each flight; as long as DESIGN where not given.")
@click.option("--sensors", default="research", show_default=True, help="Sensor suite of the scenario.")
@click.option(
    "--noise", type=click.FloatRange(min=0), default=1.0, show_default=True, help="Multiple of its noise."
)
@options.seed("Draws the effect, its place and size.")
@options.as_json
def command(scenario: Path, folder: Path | None, json_: bool, **asked: Any) -> None:
    """Fly SCENARIO's aircraft with an effect that SCENARIO does not have, drawn by the seed.

    Only seal.h5 names the effect. Diagnose the flights with diagnose-gap, then open the seal with open-seal.
    """
    from freqid.workflows.reviews.sealed_trial import fly_sealed

    flown = fly_sealed(scenario, folder or Path("reports/sealed"), tell=progress.line(), **asked)
    result = {
        "records": [str(path) for path in flown.records],
        "seal": str(flown.seal),
        "checksum": flown.checksum,
    }
    lines = [*map(str, flown.records), f"{flown.seal}: the effect, sealed under {flown.checksum}"]
    options.emit(json_, result, "\n".join(lines))

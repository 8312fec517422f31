"""``freqid new-scenario``: a commented scenario to fill in, from effectors or from a log."""

from __future__ import annotations

from pathlib import Path

import click

from freqid.cli import options


@click.command("new-scenario")
@click.option(
    "--effectors",
    callback=options.parsed(options.names),
    help="Names, as de1,de2,n1, or with their kind: left:tilt,fan:rotor. Kinds: surface, tilt, rotor, "
    "thrust, throttle.",
)
@click.option("--log", type=options.FILE, help="A record, or a text table: its channels name the effectors.")
@click.option("--name", default="My aircraft", show_default=True, help="Of the aircraft.")
@options.output("scenario.toml")
@options.as_json
def command(
    effectors: tuple[str, ...] | None, log: Path | None, name: str, destination: Path | None, json_: bool
) -> None:
    """Write a scenario that can be read as it is, with a comment at each line that is to be filled in."""
    from freqid.workflows.scenarios.new_scenario import new_scenario, write_scenario

    text, destination = (
        new_scenario(effectors or (), log=log, name=name),
        destination or Path("scenario.toml"),
    )
    write_scenario(destination, text)
    options.emit(
        json_,
        {"files": [str(destination)]},
        f"{destination}\nFill in the lines that say so; `freqid check {destination}` lists them.",
    )

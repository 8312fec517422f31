"""``freqid open-seal``: whether a diagnosis named the effect that was sealed before it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("open-seal")
@click.argument("seal", type=FILE)
@click.argument("gap", type=FILE)
@options.output("the diagnosis's name with -trial.h5")
@options.as_json
def command(seal: Path, gap: Path, destination: Path | None, json_: bool) -> None:
    """Open SEAL, which fly-sealed wrote, and say whether the diagnosis GAP was right, wrong or undecided."""
    from freqid.workflows.files import save
    from freqid.workflows.reviews.sealed_trial import open_seal

    destination = destination or gap.with_name(f"{gap.stem}-trial.h5")
    options.keep_inputs(destination, seal, gap)
    outcome = open_seal(seal, gap)
    save(outcome, destination)
    table = {**asdict(outcome), "covered": outcome.covered, "file": str(destination)}
    options.emit(json_, table, f"{outcome.sentence}\n{destination}")

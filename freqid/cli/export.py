"""``freqid export``: a model or record becomes a file that another tool reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli.options import FILE, as_json, emit, keep_inputs, output

FORMATS = ("mat", "csv", "json", "daveml", "jsbsim", "python", "sidpac")


@click.command("export")
@click.argument("models", nargs=-1, required=True, type=FILE)
@click.option(
    "--to", type=click.Choice(FORMATS), required=True, help="Format; docs/exports.md says what is in it."
)
@output("MODEL's name with .mat .csv .json .dml .py; of jsbsim a folder of that name")
@click.option("--scenario", type=FILE, help="Of jsbsim: where mass and inertia are from.")
@click.option(
    "--table-error",
    type=float,
    help="Of daveml and jsbsim, for a global model: largest error of tables, relative to the size of a "
    "response along the corridor; 1e-3 without it.",
)
@click.option("--overwrite", is_flag=True, help="Replace what is there.")
@as_json
def command(
    models: tuple[Path, ...], to: Any, destination: Path | None, json_: bool, overwrite: bool, **asked: Any
) -> None:
    """Write MODELS for another tool: MATLAB, tables, JSON, DAVE-ML, JSBSim, Python, SIDPAC.

    A model is what identify-point and global-blend write, a record what import-log and simulate write. The
    folder of a study stands for all its models. Several models make one table as csv.
    """
    from freqid.workflows.export import default_path, export

    destination = destination or default_path(models[0], to)
    keep_inputs(destination, *models)
    given = models[0] if len(models) == 1 else models
    done = export(given, destination, to, overwrite=overwrite, **asked)
    lines = [f"{', '.join(map(str, done.paths))}: {done.kind} as {to}"]
    if done.table_errors:
        errors = ", ".join(f"{r} {size:.3g} {unit}" for r, (size, unit) in done.table_errors.items())
        lines.append(f"tables are off by at most {errors}")
    if done.left_out:
        lines.append(f"SIDPAC has no column for {', '.join(done.left_out)}")
    result = {
        "paths": [str(path) for path in done.paths],
        "to": to,
        "kind": done.kind,
        "table_errors": {r: {"largest": size, "unit": unit} for r, (size, unit) in done.table_errors.items()},
        "left_out": list(done.left_out),
    }
    emit(json_, result, "\n".join(lines))

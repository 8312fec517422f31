"""``freqid global-blend``: point models along the corridor become one global model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli.options import FILE, as_json, emit, keep_inputs


@click.command("global-blend")
@click.argument("points", nargs=-1, required=True, type=FILE)
@click.option("-o", "--output", "destination", type=FILE, required=True, help="Global model.")
@click.option(
    "--densities",
    type=click.Choice(["apart", "together"]),
    default="apart",
    show_default=True,
    help="A line for each air density, or all points on one line in equivalent speed.",
)
@click.option("--predict", "held_out", type=FILE, help="A record that no point is made from, to score.")
@click.option(
    "--outside",
    type=click.Choice(["refuse", "hold"]),
    default="refuse",
    show_default=True,
    help="What to do where that record leaves the corridor.",
)
@as_json
def command(
    points: tuple[Path, ...],
    destination: Path,
    densities: Any,
    held_out: Path | None,
    outside: Any,
    json_: bool,
) -> None:
    """Blend POINTS, models of identify-point, into one model over the transition corridor.

    Points of several densities are tested for agreement after similarity has carried one to the other.
    """
    from freqid.blend.consistency import density_agreement
    from freqid.cli.blend_texts import blend_result, blend_table
    from freqid.workflows.blend import blend, predict
    from freqid.workflows.files import save

    keep_inputs(destination, *points, held_out)
    model = blend(points, densities=densities)
    predicted = predict(model, held_out, outside=outside) if held_out else {}
    found = (model.corridor, density_agreement(model), predicted)
    save(model, destination)
    emit(json_, blend_result(*found), f"{blend_table(*found)}\n{destination}")

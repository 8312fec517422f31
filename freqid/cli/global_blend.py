"""``freqid global-blend``: point models along the corridor become one global model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid.cli.options import as_json, emit, keep_inputs

if TYPE_CHECKING:
    from freqid.blend.consistency import Agreement
    from freqid.core.results.corridor import Corridor
    from freqid.core.results.point import Fit


@click.command("global-blend")
@click.argument("points", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", "destination", type=click.Path(path_type=Path), required=True, help="Global model."
)
@click.option(
    "--densities",
    type=click.Choice(["apart", "together"]),
    default="apart",
    show_default=True,
    help="A line for each air density, or all points on one line in equivalent speed.",
)
@click.option(
    "--predict",
    "held_out",
    type=click.Path(path_type=Path),
    help="A record that no point is made from, to score.",
)
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
    from freqid.blend.global_model import GlobalModel
    from freqid.blend.line_up import line_up
    from freqid.blend.predict import replay
    from freqid.core.errors import DataError
    from freqid.core.record import Maneuver, read_record
    from freqid.core.results.corridor import write_global
    from freqid.core.results.point import read_point

    keep_inputs(destination, *points, held_out)
    corridor = line_up([read_point(p) for p in points], [str(p) for p in points], densities)
    model = GlobalModel(corridor)
    predicted = {}
    if held_out:
        try:
            predicted = replay(model, Maneuver.of(read_record(held_out)), outside=outside)
        except DataError as error:
            raise error.at(str(held_out)) from None
    agreement = density_agreement(model)
    write_global(destination, corridor)
    text = f"{_table(corridor, agreement, predicted)}\n{destination}"
    emit(json_, _for_machines(corridor, agreement, predicted), text)


def _for_machines(
    corridor: Corridor, agreement: list[Agreement], predicted: dict[str, Fit]
) -> dict[str, Any]:
    from dataclasses import asdict

    responses = {}
    for name, knots in corridor.responses.items():
        columns = zip(knots.regressors, knots.estimate.tolist(), knots.std_error.tolist(), strict=True)
        parameters = {x: {"estimate": value, "std_error": error} for x, value, error in columns}
        parameters["bias"] = {"estimate": knots.bias.tolist(), "std_error": knots.bias_std_error.tolist()}
        responses[name] = {"parameters": parameters, "units": knots.unit}
    return {
        "reference": {
            "id": list(corridor.ids),
            "u": corridor.u.tolist(),
            "rho": corridor.rho.tolist(),
            "dw1": corridor.tilt[0].tolist(),
            "dw2": corridor.tilt[1].tolist(),
            "line": corridor.line.tolist(),
        },
        "vehicle": corridor.vehicle,
        "form": corridor.form,
        "responses": responses,
        "agreement": [asdict(one) for one in agreement],
        "prediction": {
            name: {"r2": fit.r2, "rmse": fit.rms, "mean": float(fit.residual.mean())}
            for name, fit in predicted.items()
        },
    }


def _table(corridor: Corridor, agreement: list[Agreement], predicted: dict[str, Fit]) -> str:
    """Return what was blended, how densities agree and what was predicted, as text."""
    lines = []
    for i in range(corridor.line.max() + 1):
        on = corridor.line == i
        lines.append(
            f"line {i + 1}: {on.sum()} points, u {corridor.u[on][0]:.4g} to {corridor.u[on][-1]:.4g} m/s, "
            f"rho {corridor.rho[on].mean():.4g} kg/m3"
        )
    lines += [
        f"{one.response}: rho {one.rho[1]:.4g} against {one.rho[0]:.4g} kg/m3 at {one.points} points: "
        f"chi-square {one.chi_square:.4g} of {one.degrees_of_freedom}, p {one.p:.2g}, "
        f"difference {100 * one.difference:.2g} %"
        for one in agreement
    ]
    lines += [
        f"{name} [{corridor[name].unit}]  predicted R2 {fit.r2:.4f}  rmse {fit.rms:.4g}, its mean "
        f"{fit.residual.mean():.4g}"
        for name, fit in predicted.items()
    ]
    return "\n".join(lines)

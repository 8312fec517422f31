"""``freqid study``: the whole chain of a scenario, from inputs to the report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid.cli.options import as_json, emit

if TYPE_CHECKING:
    from freqid.blend.campaign import StudyResults
    from freqid.identify.point import Estimator


@click.command("study")
@click.argument("scenario", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    "folder",
    type=click.Path(path_type=Path),
    help="Folder of everything; default: the scenario's name with -study, in reports/.",
)
@click.option("--at", "conditions", help="Conditions to fly, as u20,u45,u70; all of the scenario without it.")
@click.option("--hold-out", help="Of them, those that the global model is judged at and not made from.")
@click.option("--sensors", default="research", show_default=True, help="Sensor suite of the scenario.")
@click.option(
    "--noise", type=click.FloatRange(min=0), default=1.0, show_default=True, help="Multiple of its noise."
)
@click.option(
    "--estimator",
    type=click.Choice(["instruments", "least-squares"]),
    help="In place of the scenario's.",
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--jobs", type=int, default=2, show_default=True, help="Processes at once; -1 for one a core.")
@as_json
def command(
    scenario: Path,
    folder: Path | None,
    conditions: str | None,
    hold_out: str | None,
    sensors: str,
    noise: float,
    estimator: Estimator | None,
    seed: int,
    jobs: int,
    json_: bool,
) -> None:
    """Design inputs, fly and identify SCENARIO's conditions, blend a global model, and write a page of it.

    What is done is kept: a second run, or one after a stop, goes on from there.
    """
    from freqid.report.rendering import write_text
    from freqid.report.study_page import build_study_page
    from freqid.study.chain import Campaign, study

    folder = folder or Path("reports") / f"{scenario.stem}-study"
    folder.mkdir(parents=True, exist_ok=True)
    campaign = Campaign(
        scenario=scenario,
        folder=folder,
        references=_names(conditions),
        held_out=_names(hold_out),
        sensors=sensors,
        noise=noise,
        estimator=estimator,
        seed=seed,
        jobs=jobs,
    )
    results = study(campaign, say=lambda text: click.echo(f"{text} ...", err=True))
    page = folder / "index.html"
    write_text(page, build_study_page(results))
    emit(json_, _for_machines(results, folder), f"{_table(results)}\nThe report is {page}")


def _names(text: str | None) -> tuple[str, ...]:
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


def _for_machines(results: StudyResults, folder: Path) -> dict[str, Any]:
    """Return figures of merit by condition and response."""
    points = {
        p.model.reference.id: {
            name: {
                "r2": r.r2,
                "distortion": r.distortion,
                "rmse": p.modelling_rmse(name),
                "validation_rmse": p.prediction_rmse(name),
            }
            for name, r in p.model.responses.items()
        }
        for p in results.points
    }
    held_out = {
        h.reference.id: {"global_rmse": dict(h.global_rmse), "point_rmse": dict(h.point_rmse)}
        for h in results.held_out
    }
    return {"folder": str(folder), "points": points, "held_out": held_out}


def _table(results: StudyResults) -> str:
    """Return the coefficients of determination by condition and response."""
    names = list(results.points[0].model.responses)
    lines = ["R2      " + "".join(f"{name:>9s}" for name in names)]
    for point in results.points:
        model = point.model
        lines.append(f"{model.reference.id:10s}" + "".join(f"{model[name].r2:9.4f}" for name in names)[2:])
    return "\n".join(lines)

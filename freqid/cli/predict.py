"""``freqid predict``: what a model says of a flight before it is flown, sealed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("predict")
@click.argument("model", type=FILE)
@click.argument("design", type=FILE)
@options.output("the design's name with -prediction.h5")
@click.option(
    "--scenario", type=FILE, required=True, help="Vehicle, [control], [simulation.actuators] and [noise]."
)
@click.option("--at", default="", help="Reference condition, for a global model.")
@click.option("--sensors", default="", help="Sensor suite whose noise stands in where [noise] states none.")
@click.option(
    "--turbulence",
    type=click.FloatRange(min=0),
    is_flag=False,
    flag_value=7.7,
    default=0.0,
    help="Let the bands hold gusts; m/s of wind at 20 ft, 7.7 (light) where only the flag is given.",
)
@click.option("--residual", type=FILE, help="Point model whose residual a global model's bands hold.")
@click.option(
    "--loop", help="Law and actuators in place of the scenario's: a loop file, FILE.py:NAME or a scenario."
)
@click.option("--feedback/--no-feedback", default=True, help="Without it the trim's commands are held.")
@click.option(
    "--draws",
    type=click.IntRange(min=2),
    default=100,
    show_default=True,
    help="Models drawn from the covariance.",
)
@options.seed("Of these.")
@options.page_option("the bands")
@options.as_json
def command(
    model: Path, design: Path, destination: Path | None, page: bool, json_: bool, **asked: Any
) -> None:
    """Predict with MODEL what the aircraft will do when DESIGN is flown, before it is flown.

    The file holds time histories with 95 % bands of states, effectors and wrench, the parameters and what is
    assumed, under a checksum. `freqid score` holds the flight against it, and refuses a file that was edited.
    """
    from freqid.cli.prediction_texts import prediction_result, prediction_text
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.models.seal import predict_flight

    destination = destination or design.with_name(f"{design.stem}-prediction.h5")
    sources = (model, design, asked["scenario"], asked["residual"], asked["loop"] and Path(asked["loop"]))
    drawn = options.page_beside(destination, page, *sources)
    prediction = predict_flight(model, design, **asked)
    save(prediction, destination)
    if drawn:
        page_of(prediction).save(drawn)
    for remark in prediction.remarks:
        click.echo(f"warning: {remark}.", err=True)
    text = f"{prediction_text(prediction)}\n{options.written(destination, drawn)}"
    options.emit(json_, prediction_result(prediction), text)

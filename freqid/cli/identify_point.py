"""``freqid identify-point``: a flight record becomes a point model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE

_CHOICES = {
    "--method": ["frequency", "time", "output-error", "filter-error"],
    "--form": ["force", "specific", "coefficient"],
    "--axes": ["body", "stability"],
}


@click.command("identify-point")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=FILE)
@options.output("the first record's name with -point.h5")
@click.option("--scenario", type=FILE, required=True, help="What to identify, and how.")
@click.option("--at", default="", help="Id of the reference condition; the record's own where absent.")
@click.option(
    "--cut",
    multiple=True,
    callback=options.parsed(options.span),
    help="Use START:STOP only, seconds on the record's clock; several make several manoeuvres of one record.",
)
@click.option(
    "--responses",
    callback=options.parsed(options.names),
    help="Some of X,Y,Z,L,M,N, in place of the scenario's.",
)
@click.option(
    "--regressors",
    callback=options.parsed(options.names),
    help="Regressors of all responses, as u,w,q,de1, in place of the scenario's.",
)
@options.choices(_CHOICES, "In place of the scenario's.")
@options.estimator
@click.option(
    "--select",
    "structure",
    flag_value="stepwise",
    help="Keep, for each response, only the regressors that explain something.",
)
@click.option(
    "--nonlinear",
    type=click.Choice(["none", "products"]),
    help="In place of the scenario's. Products of regressors are added where noise lines say that a response "
    "is not linear.",
)
@click.option(
    "--kinematics",
    type=click.Choice(["off", "report", "correct"]),
    default="off",
    show_default=True,
    help="Check first whether the sensors agree with each other: biases, scales, delays, wind, gusts; "
    "'correct' takes out what the data say is there and adds its uncertainty to the parameters'.",
)
@click.option(
    "--align",
    type=click.Choice(["off", "report", "fit"]),
    default="off",
    show_default=True,
    help="Find how late each group of sensors is, and the steady wind where velocity is known over the "
    "ground only; 'fit' takes them out and adds their uncertainty to the parameters'.",
)
@click.option("--predict", "held_out", type=FILE, help="Another record, to predict and score.")
@options.as_json
def command(
    records: tuple[Path, ...],
    destination: Path | None,
    scenario: Path,
    held_out: Path | None,
    json_: bool,
    **asked: Any,
) -> None:
    """Identify the applied forces and moments of RECORDs as linear functions about a reference.

    Several records, flown at one condition, make one model. Exit code 4 says that the model is written but
    misses a gate of the scenario.
    """
    from freqid.cli.point_texts import point_result, point_table
    from freqid.cli.progress import bar
    from freqid.workflows.files import save
    from freqid.workflows.inputs import scenario_of
    from freqid.workflows.models.identify import identify_point, refuse_missed_gates

    described = scenario_of(scenario)
    model = identify_point(
        records,
        described,
        held_out=held_out,
        tell=lambda text: click.echo(text, err=True),
        progress=bar,
        **asked,
    )
    destination = destination or records[0].with_name(f"{records[0].stem}-point.h5")
    options.keep_inputs(destination, *records, scenario, held_out)
    save(model, destination)
    for remark in model.remarks:
        click.echo(f"warning: {remark}", err=True)
    options.emit(json_, point_result(model), f"{point_table(model)}\n{destination}")
    refuse_missed_gates(model, described, str(destination))

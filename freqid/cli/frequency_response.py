"""``freqid frequency-response``: flight records become frequency responses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from freqid.cli import options
from freqid.cli.options import FILE


@click.command("frequency-response")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=FILE)
@click.option(
    "-o", "destination", type=FILE, help="Result; default: the first record's name with -response.h5."
)
@click.option("--scenario", type=FILE, help="For the vehicle, and the multisines' period.")
@click.option(
    "--input", "inputs", multiple=True, help="Effector, or command/NAME; all that are excited if absent."
)
@click.option(
    "--output",
    "outputs",
    multiple=True,
    required=True,
    help="One of X Y Z L M N, a channel as state/q, or a regressor as q or alpha; may be repeated.",
)
@click.option(
    "--period", "period_s", type=click.FloatRange(min=0, min_open=True), help="Of the multisines, s."
)
@options.band("all lines that are excited if absent")
@click.option(
    "--order", type=click.IntRange(min=0), default=2, show_default=True, help="Of the local polynomials."
)
@click.option(
    "--poles",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Of a local denominator; 2 where many effectors share the lines and modes lie between them.",
)
@click.option(
    "--sweeps",
    is_flag=True,
    help="For sweeps, chirps and doublets, one input after the other, from rest to rest.",
)
@click.option("--model", type=FILE, help="Point or global model, whose response is put beside.")
@click.option(
    "--sim", "simulation", type=FILE, help="Scenario, whose simulation's linearised response is put beside."
)
@click.option(
    "--fit",
    multiple=True,
    metavar="M/N|state-space",
    help="Transfer function of order M over N with a delay, for every pair, or the scenario's ready forms.",
)
@options.page_option("the responses")
@options.as_json
def command(
    records: tuple[Path, ...],
    destination: Path | None,
    page: bool,
    json_: bool,
    **asked: Any,
) -> None:
    """Estimate frequency responses from RECORDs of one condition, with their random errors.

    Orthogonal multisines give the responses to all effectors at once, with the injected signals as
    instruments: feedback does not bias them. --sweeps does the same for inputs that are swept in turn.
    --model and --sim put other responses beside them, with the cost J and the bounds of unnoticeable added
    dynamics.
    """
    from freqid.cli.response_texts import response_result, response_table
    from freqid.views.page import page as page_of
    from freqid.workflows.files import save
    from freqid.workflows.models.frequency_response import frequency_response

    destination = destination or records[0].with_name(f"{records[0].stem}-response.h5")
    sources = (*records, asked["scenario"], asked["model"], asked["simulation"])
    drawn = options.page_beside(destination, page, *sources)
    response = frequency_response(records, **asked)
    save(response, destination)
    if drawn:
        page_of(response).save(drawn)
    for remark in response.remarks:
        click.echo(f"warning: {remark}", err=True)
    text = f"{response_table(response)}\n{options.written(destination, drawn)}"
    options.emit(json_, response_result(response), text)

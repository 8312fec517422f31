"""``freqid frequency-response``: flight records become frequency responses."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid import __version__
from freqid.cli import options

if TYPE_CHECKING:
    from freqid.core.record import Maneuver
    from freqid.core.results.frequency_response import FrequencyResponse


@click.command("frequency-response")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "destination",
    type=click.Path(path_type=Path),
    help="Result; default: the first record's name with -response.h5.",
)
@click.option(
    "--scenario", type=click.Path(path_type=Path), help="For the vehicle, and the multisines' period."
)
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
@click.option("--period", type=click.FloatRange(min=0, min_open=True), help="Of the multisines, s.")
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
    "--windows",
    is_flag=True,
    help="For sweeps and doublets: one input and one output by overlapped windows; needs --band.",
)
@options.page("the responses")
@options.as_json
def command(
    records: tuple[Path, ...],
    destination: Path | None,
    scenario: Path | None,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    period: float | None,
    band: str | None,
    order: int,
    poles: int,
    windows: bool,
    page: bool,
    json_: bool,
) -> None:
    """Estimate frequency responses from RECORDs of one condition, with their random errors.

    Orthogonal multisines give the responses to all effectors at once, with the injected signals as
    instruments: feedback does not bias them.
    """
    from dataclasses import replace

    from freqid.core.errors import DataError, UsageError
    from freqid.core.record import Maneuver, read_record
    from freqid.core.results.frequency_response import write_frequency_response
    from freqid.core.scenario import read_scenario
    from freqid.identify.response.frequency_response import frequency_response

    described, sha256 = read_scenario(scenario) if scenario else (None, "")
    vehicle = described.aircraft() if described else None
    flights = [read_record(record) for record in records]
    span = options.band_hz(band) if band is not None else None
    if period is None and described is not None and described.excitation is not None:
        period = described.excitation.period_s
    try:
        maneuvers = [Maneuver.of(flight, vehicle) for flight in flights]
        if windows:
            if len(inputs) != 1 or len(outputs) != 1 or span is None:
                raise UsageError("--windows needs one --input, one --output and --band")
            response = _by_windows(maneuvers, inputs[0], outputs[0], span)
        else:
            response = frequency_response(
                maneuvers, inputs or None, outputs, period_s=period, band_hz=span, order=order, poles=poles
            )
    except DataError as error:
        raise error.at(" and ".join(map(str, records))) from None
    response = replace(
        response,
        provenance={
            "records": [str(record) for record in records],
            "scenario": {"file": str(scenario or ""), "sha256": sha256},
            "order": order,
            "poles": poles,
            "freqid_version": __version__,
        },
    )
    destination = destination or records[0].with_name(f"{records[0].stem}-response.h5")
    drawn = destination.with_suffix(".html") if page else None
    for result in (destination, drawn):
        if result:
            options.keep_inputs(result, *records, scenario)
    write_frequency_response(destination, response, sha256)
    if drawn:
        from freqid.report.kit.rendering import write_text
        from freqid.report.response.page import build_frequency_response_page

        write_text(drawn, build_frequency_response_page(response, maneuvers[0].vehicle.name))
    for remark in response.remarks:
        click.echo(f"warning: {remark}", err=True)
    options.emit(json_, _for_machines(response), f"{_table(response)}\n{destination}")


def _by_windows(
    maneuvers: list[Maneuver], input_: str, output: str, band: tuple[float, float]
) -> FrequencyResponse:
    """Return the response to one input, with the injected signal as instrument where all records have it."""
    import numpy as np

    from freqid.core.errors import DataError
    from freqid.identify.response.frequency_response import window_response
    from freqid.identify.response.injected_lines import output_history

    path = input_ if "/" in input_ else f"effector/{input_}"
    injected_path = f"excitation/{path.rpartition('/')[2]}"
    dt = maneuvers[0].record.dt
    if any(abs(m.record.dt - dt) > 1e-6 * dt for m in maneuvers):
        raise DataError("the records have different sampling rates", remedy="import them with --resample")
    outputs, injected = [], []
    for m in maneuvers:
        direct, momentum = output_history(m, output)
        outputs.append(direct + np.gradient(momentum, m.record.dt) if momentum.any() else direct)
        if injected_path in m.record:
            injected.append(m.record[injected_path])
    return window_response(
        [m.record[path] for m in maneuvers],
        outputs,
        dt,
        np.geomspace(*band, 60),
        injected=injected if len(injected) == len(maneuvers) else None,
        names=(input_, output),
        units=(maneuvers[0].record.channel(path).unit, _unit(maneuvers[0], output)),
    )


def _unit(maneuver: Maneuver, output: str) -> str:
    from freqid.core.channels import RESPONSE
    from freqid.identify.loads.explanatory import unit_of

    if output in RESPONSE:
        return RESPONSE[output][0]
    return maneuver.record.channel(output).unit if "/" in output else unit_of(maneuver, output)


def _for_machines(response: FrequencyResponse) -> dict[str, Any]:
    def plain(values: Any) -> list[float | None]:
        return [float(v) if isfinite(v) else None for v in values]

    pairs = {}
    for o, output in enumerate(response.outputs):
        pairs[output] = {
            input_: {
                "real": plain(response.value[o, i].real),
                "imag": plain(response.value[o, i].imag),
                "std_error": plain(response.std_error[o, i]),
                "random_error": plain(response.random_error[o, i]),
                "coherence": plain(response.coherence[o, i]),
                "partial_coherence": plain(response.partial_coherence[o, i]),
                "units": f"{response.output_units[o]} per {response.input_units[i]}",
            }
            for i, input_ in enumerate(response.inputs)
        } | {"misfit": plain(response.misfit[o])}
    return {
        "method": response.method,
        "frequencies_hz": response.frequencies_hz.tolist(),
        "responses": pairs,
        "remarks": list(response.remarks),
    }


def _table(response: FrequencyResponse) -> str:
    """Return one line for each pair."""
    from freqid.report.response.page import summary_rows

    lines = ["output    input     lines  coherence (lowest)  random error  misfit"]
    for row in summary_rows(response):
        misfit = "-" if row["misfit"] is None else f"{row['misfit']:.2f}"
        lines.append(
            f"{row['output']:<10}{row['input']:<10}{row['lines']:>5}  {row['coherence']:>9.3f} "
            f"({row['lowest']:.3f}) {100 * row['error']:>13.2f} %  {misfit:>6}"
        )
    return "\n".join(lines)

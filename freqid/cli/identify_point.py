"""``freqid identify-point``: a flight record becomes a point model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid import __version__
from freqid.cli.options import as_json, emit, keep_inputs, output

if TYPE_CHECKING:
    from freqid.core.models import Fit, PointModel, ResponseModel


@click.command("identify-point")
@click.argument("record", type=click.Path(path_type=Path))
@output("the record's name with -point.h5")
@click.option("--scenario", type=click.Path(path_type=Path), required=True, help="What to identify, and how.")
@click.option("--at", "reference", help="Id of the reference condition; the record's own where absent.")
@click.option("--cut", help="Use START:STOP only, seconds on the record's clock.")
@click.option("--responses", help="Some of X,Y,Z,L,M,N, in place of the scenario's.")
@click.option("--regressors", help="Regressors of all responses, as u,w,q,de1, in place of the scenario's.")
@click.option("--method", type=click.Choice(["frequency", "time"]), help="In place of the scenario's.")
@click.option("--form", type=click.Choice(["force", "specific", "coefficient"]), help="Likewise.")
@click.option("--axes", type=click.Choice(["body", "stability"]), help="Likewise.")
@click.option(
    "--predict", "held_out", type=click.Path(path_type=Path), help="Another record, to predict and score."
)
@as_json
def command(
    record: Path,
    destination: Path | None,
    scenario: Path,
    reference: str | None,
    cut: str | None,
    responses: str | None,
    regressors: str | None,
    method: str | None,
    form: str | None,
    axes: str | None,
    held_out: Path | None,
    json_: bool,
) -> None:
    """Identify the applied forces and moments of RECORD as linear functions about a reference.

    Exit code 4 says that the model is written but misses a gate of the scenario.
    """
    from dataclasses import replace

    from freqid.core.errors import DataError, GateFailed, UsageError
    from freqid.core.models import missed_gates
    from freqid.core.point_file import write_point
    from freqid.core.record import Maneuver, parse_span
    from freqid.core.record_file import read_record
    from freqid.core.scenario import overridden, read_scenario
    from freqid.identify.point import identify_point, predict

    described, sha256 = read_scenario(scenario)
    if described.identification is None:
        raise UsageError(
            "section [identification] is missing", where=str(scenario), remedy="name at least its regressors"
        )
    settings = overridden(
        described.identification,
        responses=_names(responses),
        regressors=_names(regressors),
        method=method,
        form=form,
        axes=axes,
    )
    flight = read_record(record)
    at = reference or flight.reference
    try:
        maneuver = Maneuver.of(flight, described.aircraft(), None if cut is None else parse_span(cut))
        model = identify_point(
            maneuver,
            settings,
            excitation=described.excitation,
            reference=described.reference_of(at) if at else None,
        )
    except DataError as error:
        raise error.at(str(record)) from None
    sources = {
        "record": str(record),
        "cut": cut,
        "log": flight.provenance,
        "scenario": {"file": str(scenario), "sha256": sha256},
        "freqid_version": __version__,
    }
    predicted = {}
    if held_out:
        try:
            predicted = predict(model, Maneuver.of(read_record(held_out), described.aircraft()), settings)
        except DataError as error:
            raise error.at(str(held_out)) from None
        sources["predicted"] = str(held_out)
    model = replace(model, provenance=sources, prediction=predicted)

    destination = destination or record.with_name(f"{record.stem}-point.h5")
    keep_inputs(destination, record, scenario, held_out)
    write_point(destination, model, sha256)
    emit(json_, _for_machines(model), f"{_table(model)}\n{destination}")
    missed = [
        f"{m.figure} of {m.response} is {m.found:.5g}, the gate is {m.gate:g}"
        for m in missed_gates(model, described.gates)
    ]
    if missed:
        raise GateFailed(
            "; ".join(missed), where=str(destination), remedy="the model is written all the same"
        )


def _names(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _for_machines(model: PointModel) -> dict[str, Any]:
    import msgspec

    def figures(response: ResponseModel) -> dict[str, Any]:
        parameters = {
            name: {"estimate": response[name][0], "std_error": response[name][1]}
            for name in (*response.regressors, "bias")
        }
        return {
            "parameters": parameters,
            "r2": response.r2,
            "pse": response.pse,
            "rmse": response.rmse,
            "units": response.unit,
            "condition_number": response.condition_number,
            "inseparable": response.inseparable,
        }

    def score(fit: Fit) -> dict[str, float]:
        return {"r2": fit.r2, "rmse": fit.rms}

    reference = {k: v if v == v else None for k, v in msgspec.to_builtins(model.reference).items()}
    return {
        "reference": reference,
        "method": model.method,
        "form": model.form,
        "responses": {name: figures(response) for name, response in model.responses.items()},
        "prediction": {name: score(fit) for name, fit in model.prediction.items()},
    }


def _table(model: PointModel) -> str:
    """Return the model as text: one block a response."""
    from freqid.core.point_file import per

    lines = []
    for name, response in model.responses.items():
        head = f"{name} [{response.unit}]  R2 {response.r2:.4f}  rmse {response.rmse:.4g}"
        if name in model.prediction:
            head += f"  predicted R2 {model.prediction[name].r2:.4f}"
        lines.append(head)
        units = [per(response.unit, unit) for unit in response.regressor_units] + [response.unit]
        for parameter, unit in zip((*response.regressors, "bias"), units, strict=True):
            estimate, error = response[parameter]
            lines.append(f"  {parameter:<10} {estimate:>13.6g} +- {2 * error:<11.3g} {unit}")
        lines += [f"  the data cannot separate {' and '.join(group)}" for group in response.inseparable]
    lines.append("(+- is two standard errors)")
    return "\n".join(lines)

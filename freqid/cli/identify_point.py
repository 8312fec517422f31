"""``freqid identify-point``: a flight record becomes a point model."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from freqid import __version__
from freqid.cli.data_compatibility import checked, identified
from freqid.cli.options import as_json, emit, keep_inputs, output

if TYPE_CHECKING:
    from freqid.core.record import FlightRecord
    from freqid.core.results.point import Fit, PointModel, ResponseModel
    from freqid.identify.point import Estimator


@click.command("identify-point")
@click.argument("records", metavar="RECORD...", nargs=-1, required=True, type=click.Path(path_type=Path))
@output("the first record's name with -point.h5")
@click.option("--scenario", type=click.Path(path_type=Path), required=True, help="What to identify, and how.")
@click.option("--at", "reference", help="Id of the reference condition; the record's own where absent.")
@click.option(
    "--cut",
    "cuts",
    multiple=True,
    help="Use START:STOP only, seconds on the record's clock; several make several manoeuvres of one record.",
)
@click.option("--responses", help="Some of X,Y,Z,L,M,N, in place of the scenario's.")
@click.option("--regressors", help="Regressors of all responses, as u,w,q,de1, in place of the scenario's.")
@click.option("--method", type=click.Choice(["frequency", "time"]), help="In place of the scenario's.")
@click.option("--form", type=click.Choice(["force", "specific", "coefficient"]), help="Likewise.")
@click.option("--axes", type=click.Choice(["body", "stability"]), help="Likewise.")
@click.option(
    "--estimator",
    type=click.Choice(["least-squares", "instruments"]),
    help="In place of the scenario's. Instruments are not biased by noise in the regressors; they need the "
    "injected signals.",
)
@click.option(
    "--select", is_flag=True, help="Keep, for each response, only the regressors that explain something."
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
    help="Check first whether the sensors agree with each other: biases, scales, delays, wind.",
)
@click.option(
    "--align",
    "align_by",
    type=click.Choice(["off", "report", "fit"]),
    default="off",
    show_default=True,
    help="Find how late each group of sensors is, and the steady wind where velocity is known over the "
    "ground only; 'fit' takes them out and adds their uncertainty to the parameters'.",
)
@click.option(
    "--predict", "held_out", type=click.Path(path_type=Path), help="Another record, to predict and score."
)
@as_json
def command(
    records: tuple[Path, ...],
    destination: Path | None,
    scenario: Path,
    reference: str | None,
    cuts: tuple[str, ...],
    responses: str | None,
    regressors: str | None,
    method: str | None,
    form: str | None,
    axes: str | None,
    estimator: Estimator | None,
    select: bool,
    nonlinear: str | None,
    kinematics: str,
    align_by: str,
    held_out: Path | None,
    json_: bool,
) -> None:
    """Identify the applied forces and moments of RECORDs as linear functions about a reference.

    Several records, flown at one condition, make one model. Exit code 4 says that the model is written but
    misses a gate of the scenario.
    """
    from dataclasses import replace

    from freqid.core.errors import DataError, GateFailed, UsageError
    from freqid.core.record import Maneuver, parse_span, read_record
    from freqid.core.results.point import missed_gates, write_point
    from freqid.core.scenario import read_scenario
    from freqid.core.toml import overridden
    from freqid.identify.point import lines_of, predict
    from freqid.identify.sensors.alignment import align

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
        structure="stepwise" if select else None,
        nonlinear=nonlinear,
    )
    stretches = _stretches(records, cuts)
    flights = [read_record(record) for record, _ in stretches]
    at = reference or _flown_at(flights)
    spans = [None if cut is None else parse_span(cut) for _, cut in stretches]
    maneuvers = [Maneuver.of(f, described.aircraft(), span) for f, span in zip(flights, spans, strict=True)]
    compatibility: dict[str, Any] = {}
    files = [record for record, _ in stretches]
    if kinematics != "off":
        maneuvers, compatibility = checked(maneuvers, files, correct=kinematics == "correct")
    try:
        model, alignment = identified(
            align_by,
            maneuvers,
            files,
            settings,
            excitation=described.excitation,
            reference=described.reference_of(at) if at else None,
            estimator=estimator,
        )
    except DataError as error:
        raise error.at(" and ".join(map(str, records))) from None
    used = [
        {"record": str(record), "cut": cut, "log": flight.provenance}
        for (record, cut), flight in zip(stretches, flights, strict=True)
    ]
    sources = {
        **(used[0] if len(used) == 1 else {"manoeuvres": used}),
        "scenario": {"file": str(scenario), "sha256": sha256},
        "freqid_version": __version__,
    }
    if compatibility:
        sources["kinematics"] = compatibility
    if alignment:
        sources["alignment"] = alignment
    sources |= {key: model.provenance[key] for key in ("structure",) if key in model.provenance}
    predicted = {}
    if held_out:
        try:
            other = Maneuver.of(read_record(held_out), described.aircraft())
            if align_by == "fit":
                other, _ = align(other, settings, lines_of(settings, described.excitation))
            predicted = predict(model, other, settings)
        except DataError as error:
            raise error.at(str(held_out)) from None
        sources["predicted"] = str(held_out)
    model = replace(model, provenance=sources, prediction=predicted)

    destination = destination or records[0].with_name(f"{records[0].stem}-point.h5")
    keep_inputs(destination, *records, scenario, held_out)
    write_point(destination, model, sha256)
    for remark in model.remarks:
        click.echo(f"warning: {remark}", err=True)
    emit(json_, _for_machines(model), f"{_table(model)}\n{destination}")
    missed = [
        f"{m.figure} of {m.response} is {m.found:.5g}, the gate is {m.gate:g}"
        for m in missed_gates(model, described.gates)
    ]
    if missed:
        raise GateFailed(
            "; ".join(missed), where=str(destination), remedy="the model is written all the same"
        )


def _flown_at(flights: list[FlightRecord]) -> str:
    """Return the reference that all records name."""
    from freqid.core.errors import UsageError

    named = sorted({flight.reference for flight in flights if flight.reference})
    if len(named) > 1:
        raise UsageError(
            f"the records were flown at different references, {' and '.join(named)}",
            remedy="identify each condition by itself, or name one with --at",
        )
    return named[0] if named else ""


def _stretches(records: tuple[Path, ...], cuts: tuple[str, ...]) -> list[tuple[Path, str | None]]:
    """Return the manoeuvres asked for: whole records, one cut of each, or several cuts of one."""
    from freqid.core.errors import UsageError

    if not cuts:
        return [(record, None) for record in records]
    if len(records) > 1 and len(cuts) != len(records):
        raise UsageError(
            f"{len(cuts)} --cut came with {len(records)} records, expected one for each record or none"
        )
    return list(zip(records if len(records) > 1 else records * len(cuts), cuts, strict=True))


def _names(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    return tuple(part.strip() for part in text.split(",") if part.strip())


def _for_machines(model: PointModel) -> dict[str, Any]:
    import msgspec

    def figures(response: ResponseModel) -> dict[str, Any]:
        parameters: dict[str, dict[str, Any]] = {
            name: {"estimate": response[name][0], "std_error": response[name][1]}
            for name in (*response.regressors, "bias")
        }
        beside = response.errors_in_variables
        if beside is not None:
            for j, name in enumerate(response.regressors):
                difference = float(response.normalised_difference[j])
                parameters[name] |= {
                    "least_squares": {
                        "estimate": float(beside.estimate[j]),
                        "std_error": float(beside.std_error[j]),
                    },
                    "normalised_difference": difference if isfinite(difference) else None,
                }
        return {
            "parameters": parameters,
            "r2": response.r2,
            "pse": response.pse,
            "rmse": response.rmse,
            "units": response.unit,
            "condition_number": response.condition_number,
            "distortion": response.distortion,
            "inseparable": response.inseparable,
            "differing": response.differing,
        }

    def score(fit: Fit) -> dict[str, float]:
        return {"r2": fit.r2, "rmse": fit.rms}

    reference = {k: v if v == v else None for k, v in msgspec.to_builtins(model.reference).items()}
    return {
        "reference": reference,
        "method": model.method,
        "form": model.form,
        "estimator": model.estimator,
        "remarks": model.remarks,
        "responses": {name: figures(response) for name, response in model.responses.items()},
        "structure": model.provenance.get("structure", {}),
        "prediction": {name: score(fit) for name, fit in model.prediction.items()},
    }


def _table(model: PointModel) -> str:
    """Return the model as text: one block a response."""
    from freqid.core.results.point import per

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
        beside = response.errors_in_variables
        if beside is not None and response.differing:
            said = ", ".join(
                f"{n} {beside.estimate[response.regressors.index(n)]:.6g}" for n in response.differing
            )
            lines.append(f"  least squares differs beyond noise: {said}")
        lines += _chosen(model.provenance.get("structure", {}).get(name, {}))
        lines += [f"  the data cannot separate {' and '.join(group)}" for group in response.inseparable]
    lines.append("(+- is two standard errors)")
    return "\n".join(lines)


def _chosen(account: dict[str, Any]) -> list[str]:
    """Return what was left out of a response and what was added to it, one line each."""
    from freqid.identify.model.selection import DISTORTED, F_KEPT

    lines = []
    if account.get("left_out"):
        said = ", ".join(f"{name} {f:.2g}" for name, f in account["left_out"].items())
        lines.append(f"  left out, F below {F_KEPT:g}: {said}")
    if "products" in account:
        level = f"residual power over noise {account['distortion']:.3g}"
        if account["products"]:
            said = ", ".join(f"{name} (F {f:.3g})" for name, f in account["products"].items())
            lines.append(f"  not linear, {level}: added {said}")
        elif account["distortion"] > DISTORTED:
            lines.append(f"  not linear, {level}, but no product explains it")
    return lines

"""A point model as the terminal shows it: for machines, and for people."""

from __future__ import annotations

from math import isfinite
from typing import Any

from freqid.core.results.fit import Fit
from freqid.core.results.point import DISTORTED, PointModel, ResponseModel, per
from freqid.identify.model.selection import F_TO_STAY


def point_result(model: PointModel) -> dict[str, Any]:
    """Return a model for machines."""

    def number(value: float) -> float | None:
        """Return a figure; none where there is none, as the error of a parameter at its bound."""
        return value if isfinite(value) else None

    def figures(response: ResponseModel) -> dict[str, Any]:
        parameters: dict[str, dict[str, Any]] = {
            name: {"estimate": number(response[name][0]), "std_error": number(response[name][1])}
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
            "r2": number(response.r2),
            "pse": number(response.pse),
            "rmse": number(response.rmse),
            "units": response.unit,
            "condition_number": response.condition_number,
            "distortion": response.distortion,
            "inseparable": response.inseparable,
            "differing": response.differing,
        }

    def score(fit: Fit) -> dict[str, float]:
        return {"r2": fit.r2, "rmse": fit.rms}

    likelihood = {k: v for k, v in model.provenance.items() if k == "output_error"}
    reference = {k: v if v == v else None for k, v in model.reference.to_json().items()}
    return {
        "reference": reference,
        "method": model.method,
        "form": model.form,
        "estimator": model.estimator,
        "remarks": model.remarks,
        "responses": {name: figures(response) for name, response in model.responses.items()},
        "structure": model.provenance.get("structure", {}),
        **likelihood,
        "prediction": {name: score(fit) for name, fit in model.prediction.items()},
    }


def point_table(model: PointModel) -> str:
    """Return the model as text: one block a response."""
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
        lines += _chosen(model.provenance.get("structure", {}).get(name, {}))
        lines += [f"  {text}" for text in response.warnings]
    lines.append("(+- is two standard errors)")
    return "\n".join(lines)


def _chosen(account: dict[str, Any]) -> list[str]:
    """Return what was left out of a response and what was added to it, one line each."""
    lines = []
    if account.get("left_out"):
        limits = account.get("left_out_limits", {})
        listing = ", ".join(
            f"{name} {f:.2g}" + (" (within {:.3g} to {:.3g})".format(*limits[name]) if name in limits else "")
            for name, f in account["left_out"].items()
        )
        lines.append(f"  left out, F below {F_TO_STAY:g}: {listing}")
    if "products" in account:
        level = f"residual power over noise {account['distortion']:.3g}"
        if account["products"]:
            listing = ", ".join(f"{name} (F {f:.3g})" for name, f in account["products"].items())
            lines.append(f"  not linear, {level}: added {listing}")
        elif account["distortion"] > DISTORTED:
            lines.append(f"  not linear, {level}, but no product explains it")
    return lines

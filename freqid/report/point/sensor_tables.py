"""What a check of kinematics found of the sensors, as a model's provenance tells it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from freqid.core.results.point import PointModel
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import NONE, exact, measured_values, number, pretty_unit

SURE = 3.0
"""Standard errors from which a sensor is said to err."""


class _Error(msgspec.Struct):
    estimate: float
    std_error: float
    units: str
    probability: float | None = None
    applied: float | None = None
    applied_std_error: float | None = None


class _Gusts(msgspec.Struct):
    std: float
    lower: float
    upper: float


class _Account(msgspec.Struct):
    """Of one record, as `identify-point --kinematics` writes it."""

    corrected: bool
    errors: dict[str, _Error]
    undetermined: dict[str, list[str]] = {}
    gusts: _Gusts | None = None
    told_by: str = ""


def sensor_accounts(model: PointModel) -> dict[str, _Account]:
    """Return by record what was found of its sensors; empty where nothing was checked."""
    try:
        return msgspec.convert(model.provenance.get("kinematics", {}), dict[str, _Account])
    except msgspec.ValidationError:  # a provenance that another program wrote
        return {}


def sensor_tables(model: PointModel) -> list[dict[str, Any]]:
    """Return one table for each record that was checked."""
    tables = []
    for record, account in sensor_accounts(model).items():
        rows = []
        for name, error in account.errors.items():
            std_error, estimate = measured_values(error.std_error, error.estimate)
            t = error.estimate / error.std_error if error.std_error else float("nan")
            rows.append(
                {
                    "name": name,
                    "estimate": exact(error.estimate, estimate),
                    "error": exact(error.std_error, std_error),
                    "t": number(t),
                    "sure": abs(t) > SURE,
                    "unit": pretty_unit(error.units),
                    "chance": NONE if error.probability is None else number(error.probability),
                    "applied": _applied(error),
                }
            )
        undetermined = [
            {"name": name, "with": ", ".join(others) or NONE} for name, others in account.undetermined.items()
        ]
        tables.append(
            {
                "record": record,
                "corrected": account.corrected,
                "rows": rows,
                "untold": undetermined,
                "weighed": any(e.applied is not None for e in account.errors.values()),
                "gusts": account.gusts,
                "told_by": account.told_by,
            }
        )
    return tables


def _applied(error: _Error) -> str:
    """Return what was taken out of a channel, with its standard error."""
    if error.applied is None or error.applied_std_error is None:
        return NONE
    return " ± ".join(reversed(measured_values(error.applied_std_error, error.applied)))


def sensor_findings(model: PointModel) -> list[Finding]:
    """Return whether the sensors agree, and whether the records were corrected."""
    accounts = sensor_accounts(model)
    if not accounts:
        return []
    sure = {
        name: None
        for account in accounts.values()
        for name, error in account.errors.items()
        if abs(error.estimate) > SURE * error.std_error and not name.startswith("wind")
    }
    if not sure:
        return [finding("good", "The sensors agree with each other, as far as kinematics tell.")]
    corrected = all(account.corrected for account in accounts.values())
    return [
        finding(
            "note" if corrected else "bad",
            "Kinematics find errors of the sensors beyond {:g} standard errors, {} before modelling: {}.",
            SURE,
            "corrected" if corrected else "which were not corrected",
            listed(map(code, sure)),
        )
    ]


def longest_cut(errors: Mapping[str, _Error]) -> float:
    """Return by how much a correction for delays shortens a record, s."""
    # models of earlier versions say "skew"
    delays = [error.estimate for name, error in errors.items() if name.endswith(("delay", "skew"))]
    return max(0.0, -min(delays, default=0.0)) + max(0.0, max(delays, default=0.0))

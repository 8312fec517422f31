"""The rows of a study's tables: its conditions, the errors there, and what was held out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from freqid.blend.campaign import StudiedPoint, StudyResults
from freqid.core.scenario import Reference
from freqid.report.noise_verdict import reaches_ceiling
from freqid.report.notation import NONE, exact, number, percent, pretty_unit, share, short, symbol
from freqid.report.study_results import densities
from freqid.report.study_verdict import GOOD_R2, MOST_VALIDATION, most_allowed
from freqid.report.tables import ESTIMATOR


def facts(results: StudyResults) -> list[tuple[str, str]]:
    """Return what the study is about, label and text."""
    references = [p.model.reference for p in results.points]
    speeds = [at.u for at in references if math.isfinite(at.u)]
    held = len(results.held_out)
    told = [
        ("Vehicle", results.vehicle.name),
        ("Sensors", f"{results.sensors}, {short(results.noise)} × their noise"),
        ("Estimator", ESTIMATOR.get(results.estimator, results.estimator)),
        ("Conditions", f"{len(references)}{f', {held} held out of the global model' if held else ''}"),
    ]
    if speeds:
        told.append(("Reference u", f"{short(min(speeds))} to {short(max(speeds))} m/s"))
    levels = [short(rho) for rho in densities(results.points) if math.isfinite(rho)]
    if levels:
        told.append(("Air density", f"{' and '.join(levels)} kg/m³"))
    design = results.design
    told += [
        ("Effectors excited", str(len(design.signals))),
        ("Manoeuvre", f"{design.periods} × {short(design.period_s)} s"),
        ("Band", f"{short(design.band_hz[0])} to {short(design.band_hz[1])} Hz"),
    ]
    return told


def heads(results: StudyResults) -> list[dict[str, Any]]:
    """Return symbol and unit of each response, for the heads of tables."""
    model = results.points[0].model
    return [
        {"symbol": symbol(r, results.form), "unit": pretty_unit(model[r].unit)} for r in results.responses
    ]


def condition_rows(results: StudyResults) -> list[dict[str, Any]]:
    """Return one row for each condition: R2, prediction against fit, estimators, separability."""
    rows = []
    for point in results.points:
        model = point.model
        ceilings = {r: model[r].r2_ceiling or math.nan for r in results.responses}
        differing = [len(model[r].differing) for r in results.responses]
        both = any(model[r].errors_in_variables is not None for r in results.responses)
        apart = np.concatenate([point.from_linear(r) for r in results.responses])
        apart = apart[np.isfinite(apart)]
        condition = max(model[r].condition_number for r in results.responses)
        near = float(np.mean(np.abs(apart) <= 2)) if apart.size else math.nan
        rows.append(
            _where(model.reference)
            | {
                "r2": [
                    {
                        "text": exact(model[r].r2, share(model[r].r2)),
                        "ceiling": exact(ceiling, share(ceiling)),
                        "low": not (model[r].r2 >= GOOD_R2 or reaches_ceiling(model[r])),
                    }
                    for r, ceiling in ceilings.items()
                ],
                "ratio": _worst(point, results.responses),
                "differing": str(sum(differing)) if both else NONE,
                "linear": exact(near, percent(near)),
                "condition": exact(condition, number(condition)),
            }
        )
    return rows


def error_rows(results: StudyResults) -> list[dict[str, Any]]:
    """Return one row for each condition: errors of fit and prediction of every response."""
    rows = []
    for point in results.points:
        cells = []
        for r in results.responses:
            fitted, predicted = point.modelling_rmse(r), point.prediction_rmse(r)
            cells.append(
                {
                    "fitted": exact(fitted, number(fitted)),
                    "predicted": exact(predicted, number(predicted)),
                    "far": point.validation_ratio(r) > MOST_VALIDATION,
                }
            )
        rows.append({"id": point.id, "cells": cells})
    return rows


def differing_rows(results: StudyResults) -> list[dict[str, Any]]:
    """Return by condition and response the parameters whose two estimates differ beyond noise."""
    return [
        {"id": p.id, "cells": [" ".join(p.model[r].differing) for r in results.responses]}
        for p in results.points
        if any(p.model[r].differing for r in results.responses)
    ]


def held_out_rows(results: StudyResults) -> list[dict[str, Any]]:
    """Return one row for each held-out manoeuvre: error of the global over that of a point model."""
    rows = []
    for h in results.held_out:
        most = most_allowed(results, h)
        cells = []
        for r in results.responses:
            ratio = h.ratio(r)
            errors = [h.global_rmse.get(r, math.nan), h.point_rmse.get(r, math.nan)]
            cells.append(
                {
                    "ratio": exact(ratio, number(ratio)),
                    "far": ratio > most,
                    "errors": " / ".join(number(e) for e in errors),
                }
            )
        rows.append(_where(h.reference) | {"cells": cells, "most": short(most)})
    return rows


def _where(at: Reference) -> dict[str, Any]:
    """Return the cells that say which condition a row is about."""
    front, rear = (short(round(math.degrees(tilt), 1)) for tilt in (at.dw1, at.dw2))
    return {
        "id": at.id,
        "u": f"{at.u:.2f}" if math.isfinite(at.u) else NONE,
        "rho": short(at.rho),
        "tilt": front if front == rear else f"{front} / {rear}",
    }


def _worst(point: StudiedPoint, responses: tuple[str, ...]) -> dict[str, Any]:
    """Return the largest ratio of prediction to fit over the responses."""
    ratios = {r: point.validation_ratio(r) for r in responses}
    ratios = {r: value for r, value in ratios.items() if math.isfinite(value)}
    if not ratios:
        return {"text": NONE, "of": "", "far": False}
    worst = max(ratios, key=lambda r: ratios[r])
    return {
        "text": exact(ratios[worst], number(ratios[worst])),
        "of": symbol(worst, point.model.form),
        "far": ratios[worst] > MOST_VALIDATION,
    }

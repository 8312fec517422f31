"""One self-contained page about a study: the whole chain of a scenario at several conditions."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np

from freqid import __version__
from freqid.blend.corridor_study import (
    GOOD_R2,
    MOST_HELD_OUT,
    MOST_NEW_DENSITY,
    MOST_VALIDATION,
    StudiedPoint,
    StudyResults,
    most_allowed,
)
from freqid.core.results.design import MultisineDesign
from freqid.core.scenario import Reference
from freqid.core.vehicle import Vehicle
from freqid.design.multisine.signals import sample, samples_per_period
from freqid.identify.regress.estimators import label_of
from freqid.report.design import figures as design_figures
from freqid.report.design.signal_pictures import signal_pictures
from freqid.report.kit.effectors import effector_groups
from freqid.report.kit.notation import NONE, exact, number, percent, pretty_unit, share, short, symbol
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import Sheet, render
from freqid.report.study.corridor import error_pictures, parameter_pictures, remaining_pictures
from freqid.report.study.pictures import (
    convergence_pictures,
    fitted_conditions,
    history_pictures,
    several_pictures,
)
from freqid.report.study.results import densities
from freqid.report.study.verdict import study_verdict


def study_facts(results: StudyResults) -> list[tuple[str, str]]:
    """Return what the study is about, label and text."""
    references = [p.model.reference for p in results.points]
    speeds = [at.u for at in references if math.isfinite(at.u)]
    held = len(results.held_out)
    facts = [
        ("Vehicle", results.vehicle.name),
        ("Sensors", f"{results.sensors}, {short(results.noise)} × their noise")
        if results.sensors
        else ("Flights", "real, none simulated"),
        ("Estimator", label_of(results.estimator)),
        ("Conditions", f"{len(references)}{f', {held} held out of the global model' if held else ''}"),
    ]
    if speeds:
        facts.append(("Reference u", f"{short(min(speeds))} to {short(max(speeds))} m/s"))
    levels = [short(rho) for rho in densities(results.points) if math.isfinite(rho)]
    if levels:
        facts.append(("Air density", f"{' and '.join(levels)} kg/m³"))
    design = results.design
    if design is not None:
        facts += [
            ("Effectors excited", str(len(design.signals))),
            ("Manoeuvre", f"{design.periods} × {short(design.period_s)} s"),
            ("Band", f"{short(design.band_hz[0])} to {short(design.band_hz[1])} Hz"),
        ]
    if results.own_designs:
        facts.append(
            ("Own excitation", "; ".join(f"{i}: {_size(d)}" for i, d in results.own_designs.items()))
        )
    return facts


def _size(design: MultisineDesign) -> str:
    low, high = (short(f) for f in design.band_hz)
    return (
        f"{len(design.signals)} effectors, {design.periods} × {short(design.period_s)} s, {low} to {high} Hz"
    )


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
                        "low": not (model[r].r2 >= GOOD_R2 or model[r].reaches_ceiling),
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
    tilts: dict[str, list[str]] = {}
    for name, tilt in at.scheduled.items():
        tilts.setdefault(short(round(math.degrees(tilt), 1)), []).append(name)
    return {
        "id": at.id,
        "u": f"{at.u:.2f}" if math.isfinite(at.u) else NONE,
        "rho": short(at.rho),
        "tilt": "; ".join(f"{', '.join(names)} {angle}" for angle, names in tilts.items()) or NONE,
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


PARTS = ("conditions", "corridor", "held-out", "fits", "length", "inputs")
"""Sections of the page of a study."""
_POINTS = 16  # samples per shortest period: drawn, not judged


def build_study_page(results: StudyResults, parts: Collection[str] = PARTS) -> Sheet:
    """Return the page of a study: one HTML text that fetches nothing, the same for the same results.

    Parameters
    ----------
    results : StudyResults
    parts : collection of str
        Of `PARTS`; a report has some of them elsewhere.
    """
    followed = results.followed()
    middle = followed[len(followed) // 2]
    others = [p for p in followed if p is not middle]
    length = "length" in parts
    return render(
        "study.html",
        title=results.vehicle.name or "Unnamed vehicle",
        count=len(results.points),
        version=__version__,
        findings=study_verdict(results, truth=len(parts) == len(PARTS)) if length else [],
        facts=study_facts(results) if length else [],
        heads=heads(results),
        conditions=condition_rows(results) if "conditions" in parts else [],
        errors=error_rows(results),
        differing=differing_rows(results),
        parameters=sum(len(middle.model[r].regressors) for r in results.responses),
        noise_known=any(r.r2_ceiling is not None for p in results.points for r in p.model.responses.values()),
        linearised=any(p.linear for p in results.points),
        most_validation=MOST_VALIDATION,
        error_pictures=error_pictures(results) if "conditions" in parts else [],
        corridor=parameter_pictures(results) if "corridor" in parts else [],
        remaining=remaining_pictures(results) if "corridor" in parts else [],
        blended=results.model is not None,
        held_out=held_out_rows(results) if "held-out" in parts else [],
        most_held_out=MOST_HELD_OUT,
        most_new_density=MOST_NEW_DENSITY,
        shown=middle.id,
        fits=[*fitted_conditions(results, middle), *several_pictures(results)] if "fits" in parts else [],
        other_fits=[
            {"id": p.id, "pictures": fitted_conditions(results, p)} for p in others if "fits" in parts
        ],
        convergence=convergence_pictures(results) if length else [],
        histories=history_pictures(results, middle) if length else [],
        other_histories=[
            {"id": p.id, "pictures": history_pictures(results, p)} for p in others if p.history and length
        ],
        inputs=_inputs(results) if "inputs" in parts else [],
        own_inputs=[
            {"id": i, "picture": _spectra(design, results.vehicle, f"spectra-{place}")}
            for place, (i, design) in enumerate(results.own_designs.items())
            if design is not results.design and "inputs" in parts
        ],
        provenance={**(results.design.provenance if results.design else {}), **results.provenance},
    )


def _inputs(results: StudyResults) -> list[Picture]:
    """Draw the spectra of all effectors and their signals over one period."""
    design, vehicle = results.design, results.vehicle
    if design is None:
        return []
    index = np.concatenate([s.index for s in design.signals])
    samples = samples_per_period(index, _POINTS)
    time = np.linspace(0.0, design.period_s, samples + 1)
    values = np.array([sample(s.index, s.amplitude, s.phase, samples) for s in design.signals])
    values = np.append(values, values[:, :1], axis=1)  # a period ends as it starts
    when = f"one period of {design.periods}"
    signals = signal_pictures(design, vehicle, time, values, when, "Each group has one scale.")
    return [_spectra(design, vehicle, "spectra"), *signals]


def _spectra(design: MultisineDesign, vehicle: Vehicle, key: str) -> Picture:
    return picture(
        design_figures.harmonic_map(design, effector_groups(design.names, vehicle), ()),
        key,
        "Spectra of all effectors, and which effector has which harmonic",
        f"{len(design.signals)} effectors at once. A line that one effector has alone tells its effect from "
        "all others.",
    )

"""One self-contained page about a global model: envelope, points, curves and a predicted flight."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray

from freqid import __version__
from freqid.blend.consistency import Agreement
from freqid.blend.corridor_study import distinct_densities, same_density
from freqid.blend.global_model import GlobalModel
from freqid.core.arrays import Array
from freqid.core.channels import AIR, STATE
from freqid.core.results.corridor import Corridor
from freqid.core.results.fit import Fit
from freqid.core.results.point import per
from freqid.identify.regress.confidence_interval import confidence_interval
from freqid.report.kit.corridor import (
    SPEED,
    Panel,
    ParameterBand,
    Points,
    blended_bands,
    derivative_name,
    parameters_along,
)
from freqid.report.kit.figures import fits_over_time
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import (
    NONE,
    exact,
    formula,
    measured_values,
    number,
    percent,
    plain_symbol,
    pretty_unit,
    share,
    short,
    shown_unit,
    symbol,
)
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

LEVEL = 0.95
CHANCE = 0.01
"""Probability below which densities are said to differ."""
WEAK_THEIL = 0.3
"""Theil's coefficient from which a prediction is called weak: Jategaonkar, 2nd ed., ch. 11."""
_STRETCH = 20.0  # s of a prediction that are drawn
_STRONGEST = 4  # effectors of a response that are drawn first


def build_global_page(
    model: GlobalModel,
    agreement: Sequence[Agreement] = (),
    predicted: Mapping[str, Fit] | None = None,
    flight: str = "",
) -> str:
    """Return the page of a global model: one HTML text that fetches nothing, the same for the same model.

    Parameters
    ----------
    model : GlobalModel
    agreement : sequence of Agreement
        Between the points of its densities, where there are several.
    predicted : mapping of str to Fit, optional
        By response: history of a flight that the model was not made from, as `freqid.predict` returns it.
    flight : str
        What that flight is called.
    """
    corridor, predicted = model.corridor, predicted or {}
    return render(
        "global.html",
        title=corridor.vehicle or "Unnamed vehicle",
        count=len(corridor.ids),
        responses=len(corridor.responses),
        version=__version__,
        findings=_verdict(model, agreement, predicted, flight),
        facts=_facts(model),
        places=_places(model),
        variables=[f"{name} ({shown_unit(name, unit)[0]})" for name, unit in _scheduled(corridor)],
        points=_point_rows(corridor),
        drawn=_drawn(model, first=True),
        others=_drawn(model, first=False),
        tables=[_table(corridor, r) for r in corridor.responses],
        ids=corridor.ids,
        level=percent(LEVEL),
        agreement=_agreement_rows(model, agreement),
        flight=flight,
        scores=_scores(corridor, predicted),
        predictions=_predictions(corridor, predicted, flight),
        limits=_limits(model),
        provenance=json.loads(json.dumps(corridor.provenance, sort_keys=True)),  # as a file keeps it
    )


def _verdict(
    model: GlobalModel, agreement: Sequence[Agreement], predicted: Mapping[str, Fit], flight: str
) -> tuple[Finding, ...]:
    said = [
        *_validation(model.corridor, predicted, flight),
        *_densities_agree(model, agreement),
        _widest(model),
    ]
    said.append(_known(model.corridor))
    said.sort(key=lambda f: ("bad", "note", "good").index(f.kind))
    return tuple(said)


def _validation(corridor: Corridor, predicted: Mapping[str, Fit], flight: str) -> list[Finding]:
    if not predicted:
        text = (
            "No flight was held out: nothing on this page says how well the model predicts between its "
            "points. Give one that no point is made from."
        )
        return [finding("note", text)]
    theil = {r: fit.inside(_highest(corridor)).theil for r, fit in predicted.items()}
    weak = {r: value for r, value in theil.items() if not value <= WEAK_THEIL}
    if not weak:
        worst = max(theil, key=lambda r: theil[r])
        text = (
            "{} was not used and is predicted: Theil's coefficient is {} at most ({}), and 0.3 is still good."
        )
        return [finding("good", text, code(flight), number(theil[worst], 2), symbol(worst, corridor.form))]
    named = listed(Markup("{} ({})").format(symbol(r, corridor.form), number(v, 2)) for r, v in weak.items())
    text = "{} was not used and is predicted weakly: Theil's coefficient is above {:g} in {}."
    return [finding("bad", text, code(flight), WEAK_THEIL, named)]


def _densities_agree(model: GlobalModel, agreement: Sequence[Agreement]) -> list[Finding]:
    if not agreement:
        return []
    apart = [one for one in agreement if not one.p >= CHANCE / len(agreement)]
    if not apart:
        least = min(agreement, key=lambda one: one.p)
        text = "Points of several densities agree within their errors; the least likely is {} (p = {})."
        return [finding("good", text, symbol(least.response, model.corridor.form), number(least.p, 2))]
    named = listed(
        Markup("{} by {}").format(symbol(one.response, model.corridor.form), percent(one.difference))
        for one in apart
    )
    text = "Points of several densities differ beyond their errors in {} of what moves the response."
    return [finding("note", text, named)]


def _widest(model: GlobalModel) -> Finding:
    corridor = model.corridor
    gaps = []
    for i in range(corridor.line.max() + 1):
        on = np.flatnonzero(corridor.line == i)
        place = _place(corridor)[on]
        k = int(np.argmax(np.diff(place)))
        gaps.append((float(np.diff(place)[k]), corridor.ids[on[k]], corridor.ids[on[k + 1]]))
    widest, one, other = max(gaps)
    unit, factor = _axis_unit(corridor)
    return finding(
        "note",
        "The widest gap is {} {}, from {} to {}. Between points the curves are interpolated; their bands are "
        "those of the points and leave out what an interpolation may miss.",
        short(factor * widest),
        unit,
        code(one),
        code(other),
    )


def _known(corridor: Corridor) -> Finding:
    far = [np.abs(r.estimate) > 2 * r.std_error for r in corridor.responses.values()]
    total, known = sum(x.size for x in far), sum(int(x.sum()) for x in far)
    kind = "good" if known >= 0.9 * total else "note"
    text = "{} of {} estimates at the points differ from zero by more than 2σ."
    return finding(kind, text, known, total)


def _facts(model: GlobalModel) -> list[tuple[str, str]]:
    corridor = model.corridor
    unit, factor = _axis_unit(corridor)
    place = factor * _place(corridor)
    forms = {"force": "forces and moments", "specific": "per mass and inertia", "coefficient": "coefficients"}
    facts = [
        ("Vehicle", corridor.vehicle),
        ("Points", str(len(corridor.ids))),
        ("Runs along", f"{corridor.along}, {short(place.min())} to {short(place.max())} {unit}"),
        ("Air density", _span(corridor.rho, "kg/m³")),
        ("Lines", f"{corridor.line.max() + 1}, by density"),
        ("Responses", ", ".join(plain_symbol(r, corridor.form) for r in corridor.responses)),
        ("Form", forms.get(corridor.form, corridor.form)),
    ]
    if corridor.along != "u":
        facts.insert(3, ("Speed", _span(corridor.u, "m/s")))
    if np.isfinite(corridor.highest_hz):
        facts.append(("Identified up to", f"{short(corridor.highest_hz)} Hz"))
    return facts


def _limits(model: GlobalModel) -> list[tuple[str, str]]:
    """Return what is done where the model knows less, label and text."""
    corridor, tolerance = model.corridor, model.tolerance
    lines = corridor.line.max() + 1
    between = (
        "linear in density between the lines; beyond the outermost ones density acts through similarity alone"
        if lines > 1
        else "through similarity alone: same advance ratio and tilt, speeds by the root of the density"
    )
    beside = f"{short(tolerance.speed)} m/s of equivalent speed"
    if _scheduled(corridor):
        beside += f" and {short(float(np.degrees(tolerance.tilt)))} deg of each scheduled angle"
    return [
        ("Between points", "shape-preserving cubics (PCHIP) of every parameter and of the trim"),
        ("At other densities", between),
        ("Beside the corridor", f"parameters of its nearest place, up to {beside} away"),
        (
            "Farther away",
            "refused, or held at the nearest place where that is asked for: extrapolated, and said so",
        ),
        ("Effectors and states", "linear about the trim, so larger motions than were flown are extrapolated"),
    ]


def _span(values: Array, unit: str) -> str:
    low, high = short(float(values.min())), short(float(values.max()))
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _place(corridor: Corridor) -> Array:
    """Return where knots are along the corridor: true speed, or what else it runs along, SI."""
    return corridor.u if corridor.along == "u" else corridor.coordinate


def _axis_unit(corridor: Corridor) -> tuple[str, float]:
    """Return the unit that places are shown in, and how many of it an SI unit is."""
    if corridor.along == "u":
        return "m/s", 1.0
    unit = corridor.scheduled_units[corridor.scheduled.index(corridor.along)]
    shown, factor = shown_unit(corridor.along, unit)
    return pretty_unit(shown), factor


def _axis(corridor: Corridor) -> str:
    return SPEED if corridor.along == "u" else f"{corridor.along} ({_axis_unit(corridor)[0]})"


def _scheduled(corridor: Corridor) -> list[tuple[str, str]]:
    """Return names and units of what is set along the corridor beside speed and changes there."""
    rows = zip(corridor.scheduled, corridor.scheduled_units, corridor.schedule, strict=True)
    return [(name, unit) for name, unit, row in rows if np.ptp(row) > 0]


def _levels(corridor: Corridor) -> dict[str, NDArray[np.intp]]:
    """Return the knots of each density by ascending place, the densest air first."""
    found = {}
    for level in distinct_densities(corridor.rho.tolist()):
        own = np.flatnonzero([same_density(rho, level) for rho in corridor.rho.tolist()])
        found[f"ρ = {short(level)} kg/m³"] = own[np.argsort(_place(corridor)[own])]
    return found


def _density(model: GlobalModel, own: NDArray[np.intp]) -> float:
    """Return the density of a line that some knots are on, or their mean where they share one with others."""
    mean = float(model.corridor.rho[own].mean())
    return next((line.rho for line in model.lines if same_density(line.rho, mean)), mean)


def _points(corridor: Corridor, value: Array, half: Array) -> list[Points]:
    """Return a quantity at all knots, by density."""
    factor = _axis_unit(corridor)[1]
    return [
        Points(
            factor * _place(corridor)[own],
            value[own],
            half[own],
            np.full(own.size, np.nan),
            np.ones(own.size, dtype=bool),
        )
        for own in _levels(corridor).values()
    ]


def _places(model: GlobalModel) -> list[Picture]:
    """Draw what is set along the corridor: tilts, flaps, speed where the corridor runs along another."""
    corridor = model.corridor
    rows = [
        (name, unit, corridor.schedule[corridor.scheduled.index(name)])
        for name, unit in _scheduled(corridor)
        if name != corridor.along
    ]
    if corridor.along != "u":
        rows.append(("u", "m/s", corridor.u))
    if not rows:
        return []
    factor = _axis_unit(corridor)[1]
    panels = []
    for name, unit, row in rows:
        shown, scale = shown_unit(name, unit)
        bands = []
        for own in _levels(corridor).values():
            place = np.linspace(_place(corridor)[own[0]], _place(corridor)[own[-1]], 49)
            if own.size < 2 or not place[0] < place[-1]:
                bands.append(None)
                continue
            line = model.reference(place, _density(model, own))[name]
            bands.append(ParameterBand(factor * place, scale * line, np.zeros(place.size)))
        panels.append(
            Panel(name, pretty_unit(shown), _points(corridor, scale * row, np.zeros(row.size)), bands)
        )
    figure = parameters_along(panels, list(_levels(corridor)), _axis(corridor))
    said = "What is set along the corridor: dots at the points, lines as the model takes it between them."
    return [picture(figure, "places", "What is set along the corridor", said)]


def _point_rows(corridor: Corridor) -> list[dict[str, Any]]:
    files = corridor.provenance.get("files", [])  # of files of earlier releases the order is not known
    rows = []
    for k, identifier in enumerate(corridor.ids):
        set_there = []
        for name, unit in _scheduled(corridor):
            _, factor = shown_unit(name, unit)
            set_there.append(short(factor * float(corridor.schedule[corridor.scheduled.index(name), k])))
        known = [np.abs(r.estimate[:, k]) > 2 * r.std_error[:, k] for r in corridor.responses.values()]
        rows.append(
            {
                "id": identifier,
                "u": short(float(corridor.u[k])),
                "rho": short(float(corridor.rho[k])),
                "set": set_there,
                "line": int(corridor.line[k]) + 1,
                "known": f"{sum(int(x.sum()) for x in known)} of {sum(x.size for x in known)}",
                "file": files[k] if len(files) == len(corridor.ids) else "",
            }
        )
    return rows


def _drawn(model: GlobalModel, *, first: bool) -> list[Picture]:
    """Draw parameters of each response along the corridor: those that say most `first`, or all others."""
    pictures = []
    for number_, r in enumerate(model.corridor.responses):
        main = _main(model.corridor, r)
        names = main if first else [n for n in model.corridor[r].regressors if n not in main]
        if not names:
            continue
        shown = plain_symbol(r, model.corridor.form)
        kind = "Parameters" if first else "The other parameters"
        text = (
            "{}: states, the effectors with the largest t, and the response at the trim."
            if first
            else "{}: the other parameters."
        )
        pictures.append(
            picture(
                _figure(model, r, names),
                f"{'main' if first else 'other'}{number_}",
                f"{kind} of {shown} along the corridor",
                Markup(text).format(symbol(r, model.corridor.form)),
                [plain_symbol(r, model.corridor.form)],
            )
        )
    return pictures


def _main(corridor: Corridor, response: str) -> list[str]:
    knots = corridor[response]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.nanmedian(np.abs(knots.estimate / knots.std_error), axis=1)
    states = [n for n in knots.regressors if n in STATE or n in AIR]
    others = [n for n in knots.regressors if n not in states]
    others.sort(key=lambda n: -t[knots.regressors.index(n)])
    return [*states, *others[:_STRONGEST], "bias"]


def _figure(model: GlobalModel, response: str, names: Sequence[str]) -> Figure:
    corridor, knots = model.corridor, model.corridor[response]
    factor = _axis_unit(corridor)[1]
    levels = _levels(corridor)
    bands = [
        {
            name: ParameterBand(factor * band.u, band.value, band.half)
            for name, band in blended_bands(model, response, _density(model, own)).items()
        }
        for own in levels.values()
    ]
    panels = []
    for name in names:
        value, error, unit = knots.bias, knots.bias_std_error, "1"
        if name != "bias":
            j = knots.regressors.index(name)
            value, error, unit = knots.estimate[j], knots.std_error[j], knots.regressor_units[j]
        panels.append(
            Panel(
                derivative_name(response, name, corridor.form),
                per(knots.unit, unit),
                _points(corridor, value, 2 * error),
                [band.get(name) for band in bands],
            )
        )
    return parameters_along(panels, list(levels), _axis(corridor))


def _table(corridor: Corridor, response: str) -> dict[str, Any]:
    """Return estimates and limits of one response at all points, one row for each parameter."""
    knots = corridor[response]
    values = np.vstack([knots.estimate, knots.bias])
    errors = np.vstack([knots.std_error, knots.bias_std_error])
    units = (*knots.parameter_units, knots.unit)
    rows = []
    for name, unit, value, error in zip(
        (*knots.regressors, "at the trim"), units, values, errors, strict=True
    ):
        cells = []
        for x, s in zip(value.tolist(), error.tolist(), strict=True):
            limits = map(float, confidence_interval(x, s, level=LEVEL))
            _, estimate, low, high = measured_values(s, x, *limits)
            cells.append({"estimate": exact(x, estimate), "limits": f"{low} to {high}"})
        rows.append({"name": name, "unit": pretty_unit(unit), "cells": cells})
    return {"symbol": symbol(response, corridor.form), "rows": rows}


def _agreement_rows(model: GlobalModel, agreement: Sequence[Agreement]) -> list[dict[str, str | Markup]]:
    return [
        {
            "symbol": symbol(one.response, model.corridor.form),
            "rho": f"{short(one.rho[1])} against {short(one.rho[0])}",
            "points": str(one.points),
            "chi": f"{number(one.chi_square)} of {one.degrees_of_freedom}",
            "p": number(one.p, 2),
            "difference": percent(one.difference),
        }
        for one in agreement
    ]


def _highest(corridor: Corridor) -> float:
    return corridor.highest_hz if np.isfinite(corridor.highest_hz) else float("inf")


def _scores(corridor: Corridor, predicted: Mapping[str, Fit]) -> list[dict[str, Any]]:
    rows = []
    for r, whole in predicted.items():
        fit = whole.inside(_highest(corridor))
        mean = float(fit.residual.mean())
        rows.append(
            {
                "symbol": symbol(r, corridor.form),
                "unit": pretty_unit(corridor[r].unit),
                "r2": exact(fit.r2, share(fit.r2)),
                "theil": exact(fit.theil, number(fit.theil, 2)),
                "rms": exact(fit.rms, number(fit.rms)),
                "mean": exact(mean, number(mean)) if np.isfinite(mean) else NONE,
                "far": not fit.theil <= WEAK_THEIL,
            }
        )
    return rows


def _predictions(corridor: Corridor, predicted: Mapping[str, Fit], flight: str) -> list[Picture]:
    if not predicted:
        return []
    end = float(next(iter(predicted.values())).axis[-1])
    span = (0.5 * end, min(0.5 * end + _STRETCH, end)) if end > _STRETCH else (0.0, end)
    fits = {formula(r, corridor.form): (corridor[r].unit, fit) for r, fit in predicted.items()}
    said = Markup("<code>{}</code>, which no point is made from: {:g} s of it, each about its measured mean.")
    return [
        picture(
            fits_over_time(fits, span, "predicted"),
            "predicted",
            "Responses over time: measured and predicted by the global model",
            said.format(flight, span[1] - span[0]),
        )
    ]

"""One self-contained page about a point model, for the people who review it."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from freqid import __version__
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord, parse_span
from freqid.core.results.fit import Fit
from freqid.core.results.point import ErrorsInVariables, PointModel, ResponseModel, per
from freqid.core.scenario import Gates
from freqid.identify.model.problem import numbered
from freqid.identify.regress.two_stage import LEAST_STRENGTH
from freqid.report.kit import figures, notation
from freqid.report.kit.notation import (
    NONE,
    exact,
    formula,
    meaning,
    measured_values,
    number,
    percent,
    plain_symbol,
    pretty_unit,
    share,
    symbol,
    tenths,
    with_unit,
)
from freqid.report.kit.pictures import Picture, collinearity_pictures, data_pictures, key_of, picture
from freqid.report.kit.rendering import render
from freqid.report.point.sensor_tables import longest_cut, sensor_accounts, sensor_tables
from freqid.report.point.tables import channel_table, fit_summary, parameter_table, point_facts, scores
from freqid.report.point.verdict import point_verdict


def difference_table(model: PointModel) -> dict[str, Any] | None:
    """Return differences of the two estimates by regressor and response, and how strong each instrument is.

    Returns
    -------
    dict or None
        ``heads``, symbols of the responses; ``rows`` with ``name``, ``strength``, ``weak`` and ``cells``;
        ``critical``, the least difference that is beyond noise; ``estimates``, rows of both by response.
        None where one estimator stands alone.
    """
    both = {name: r for name, r in model.responses.items() if r.errors_in_variables is not None}
    if not both:
        return None
    rows = []
    for regressor in dict.fromkeys(name for response in both.values() for name in response.regressors):
        cells, strength = [], np.inf
        for response in both.values():
            beside = response.errors_in_variables
            if beside is None or regressor not in response.regressors:
                cells.append({"text": NONE, "far": False})
                continue
            j = response.regressors.index(regressor)
            value = float(response.normalised_difference[j])
            cells.append({"text": exact(value, tenths(value)), "far": abs(value) > beside.critical[j]})
            strength = min(strength, float(beside.strength[j]))
        rows.append(
            {
                "name": regressor,
                "cells": cells,
                "strength": exact(strength, number(strength)),
                "weak": strength < LEAST_STRENGTH,
            }
        )
    critical = [r.errors_in_variables.critical for r in both.values() if r.errors_in_variables is not None]
    return {
        "heads": [symbol(name, model.form) for name in both],
        "rows": rows,
        "critical": number(float(np.min(np.concatenate(critical)))),
        "strong": f"{LEAST_STRENGTH:g}",
        "estimates": [
            {"symbol": symbol(name, model.form), "rows": _both(response, response.errors_in_variables)}
            for name, response in both.items()
            if response.errors_in_variables is not None
        ],
    }


def _both(response: ResponseModel, beside: ErrorsInVariables) -> list[dict[str, Any]]:
    """Return the two estimates of each parameter, beside each other."""
    rows = []
    for j, name in enumerate(response.regressors):
        error, other_error = float(response.std_error[j]), float(beside.std_error[j])
        estimate, other = float(response.estimate[j]), float(beside.estimate[j])
        apart = float(response.normalised_difference[j])
        texts, others = measured_values(error, estimate), measured_values(other_error, other)
        rows.append(
            {
                "name": name,
                "estimate": exact(estimate, texts[1]),
                "error": exact(error, texts[0]),
                "other": exact(other, others[1]),
                "other_error": exact(other_error, others[0]),
                "apart": exact(apart, tenths(apart)),
                "far": name in response.differing,
                "unit": pretty_unit(per(response.unit, response.regressor_units[j])),
            }
        )
    return rows


def maneuvers_of(model: PointModel) -> int:
    """Return how many manoeuvres a model was made from, as far as it holds their fits."""
    held = {fit for response in model.responses.values() for fit in response.fit}
    return max(sum(name.startswith(kind) for name in held) for kind in ("time", "frequency"))


def fit_pictures(model: PointModel, name: str, maneuver: int = 0) -> list[Picture]:
    """Draw one response of one manoeuvre as measured and as the model gives it, in frequency and time."""
    response = model[name]
    label, words = formula(name, model.form), meaning(name, model.form) or plain_symbol(name, model.form)
    which = f" of manoeuvre {maneuver + 1}" if maneuver else ""
    key = f"{key_of(model, name)}{f'-{maneuver + 1}' if maneuver else ''}"
    pictures = []
    if fit := response.fit.get(numbered("frequency", maneuver)):
        pictures.append(
            picture(
                figures.fit_over_frequency(fit, label, response.unit),
                f"{key}-frequency",
                f"{words}{which}: measured, model and residual over frequency",
                Markup(
                    "In frequency, {} lines: the residual holds {} of the measured energy, half of it "
                    "below {} Hz. {}"
                ).format(
                    fit.axis.size,
                    percent(_residual_fraction(fit)),
                    number(_median_frequency(fit)),
                    _hint(fit),
                ),
                [plain_symbol(name, model.form)],
            )
        )
    if fit := response.fit.get(numbered("time", maneuver)):
        pictures.append(
            picture(
                figures.fit_over_time(fit, label, response.unit),
                f"{key}-time",
                f"{words}{which}: measured, model and residual over time",
                Markup("In time: {}{}").format(
                    _time_score(fit, response),
                    " Both are shown up to the highest line of the fit." if pictures else "",
                ),
                [plain_symbol(name, model.form)],
            )
        )
    return pictures


def prediction_pictures(model: PointModel) -> list[Picture]:
    """Draw each response over a manoeuvre that was not used, as measured and as predicted."""
    return [
        picture(
            figures.fit_over_time(
                model.prediction[name], formula(name, model.form), model[name].unit, "prediction"
            ),
            f"{key_of(model, name)}-prediction",
            f"{meaning(name, model.form) or name}: measured and predicted over another manoeuvre",
            Markup("{}: {}").format(
                symbol(name, model.form), _time_score(model.prediction[name], model[name])
            ),
            [plain_symbol(name, model.form)],
        )
        for name in model.responses
        if name in model.prediction
    ]


def parameter_picture(model: PointModel, name: str) -> Picture:
    """Draw the parameters of a response by what they contribute to it, with their 2-sigma bars."""
    response = model[name]
    size, beside = response.regressor_rms, response.errors_in_variables
    return picture(
        figures.parameter_bars(
            response.regressors,
            response.estimate * size,
            2 * response.std_error * size,
            with_unit("Contribution, rms", response.unit),
            None if beside is None else beside.estimate * size,
        ),
        f"{key_of(model, name)}-parameters",
        f"Parameters of {plain_symbol(name, model.form)} with 2-sigma bars",
        Markup(
            "What each parameter of {} contributes in this manoeuvre, with 2σ bars. "
            "Grey: the bar includes zero.{}"
        ).format(
            symbol(name, model.form),
            "" if beside is None else " A ring off the end of its bar: noise has biased least squares.",
        ),
        [plain_symbol(name, model.form)],
    )


def _hint(fit: Fit) -> str:
    if fit.noise is None:
        return "Lines where it comes near the measured magnitude are not explained."
    return "Dotted: what noise leaves on average. Where the residual stays above, it is more than noise."


def _time_score(fit: Fit, response: ResponseModel) -> str:
    spread = float(np.std(fit.measured))
    unit = "" if response.unit == "1" else f" {pretty_unit(response.unit)}"
    part = f", {percent(fit.rms / spread)} of the measured" if spread else ""
    return f"R²\u00a0{share(fit.r2)}; residual rms {number(fit.rms)}{unit}{part}."


def _residual_fraction(fit: Fit) -> float:
    total = float(np.sum(np.abs(fit.measured) ** 2))
    return float(np.sum(np.abs(fit.residual) ** 2)) / total if total else float("nan")


def _median_frequency(fit: Fit) -> float:
    """Return the frequency below which half of the residual's energy lies, Hz."""
    energy = np.cumsum(np.abs(fit.residual) ** 2)
    return float(fit.axis[np.searchsorted(energy, 0.5 * energy[-1])])


def build_page(model: PointModel, record: FlightRecord | None = None, *, gates: Gates | None = None) -> str:
    """Return the page of a point model: one HTML text that fetches nothing.

    Parameters
    ----------
    model : PointModel
    record : FlightRecord, optional
        That the model was made from: its channels are drawn.
    gates : Gates, optional
        What the scenario asks for; it enters the verdict.

    Returns
    -------
    str
        The same for the same arguments; no time of day enters.

    Raises
    ------
    DataError
        Where the record is not as long as the one that the model was made from.
    """
    provenance = _provenance(model, record)
    if record is not None:
        record = _as_used(model, record)
    return render(
        "report.html",
        title=model.vehicle or "Unnamed vehicle",
        reference=model.reference.id,
        version=__version__,
        findings=point_verdict(model, gates),
        facts=point_facts(model, record),
        summary=fit_summary(model, gates),
        data=data_pictures(model, record) if record is not None else [],
        channels=channel_table(record) if record is not None else [],
        responses=[
            {
                "name": name,
                "symbol": notation.symbol(name, model.form),
                "meaning": notation.meaning(name, model.form),
                "scores": scores(model, name),
                "fits": fit_pictures(model, name),
                "other_fits": [
                    {"number": m + 1, "pictures": fit_pictures(model, name, m)}
                    for m in range(1, maneuvers_of(model))
                ],
                "parameters": parameter_table(model, name),
                "bars": parameter_picture(model, name),
            }
            for name in model.responses
        ],
        predictions=prediction_pictures(model),
        predicted=model.provenance.get("predicted"),
        collinearity=collinearity_pictures(model),
        differences=difference_table(model),
        sensors=sensor_tables(model),
        level=f"{100 * model.confidence:g}",
        chance=f"{100 * (1 - model.confidence):.2g}",
        provenance=provenance,
    )


def _as_used(model: PointModel, record: FlightRecord) -> FlightRecord:
    """Return the stretch of the record that the model says it was made from."""
    cut = model.provenance.get("cut")
    if isinstance(cut, str) and record.duration > model.duration + record.dt:
        record = record.cut(*parse_span(cut))
    # A correction for delays takes from the ends what not all channels cover; it is drawn as measured.
    shorter = sum(longest_cut(account.errors) for account in sensor_accounts(model).values())
    if not -record.dt <= record.duration - model.duration <= shorter + 3 * record.dt:
        raise DataError(
            f"the record lasts {record.duration:.6g} s, but the model was made from {model.duration:.6g} s",
            remedy="give the record that the model was made from, or none",
        )
    return record


def _provenance(model: PointModel, record: FlightRecord | None) -> dict[str, Any]:
    if record is None or record.provenance in model.provenance.values():
        return model.provenance
    return {**model.provenance, "provenance of the record": record.provenance}

"""The figures of each response: what was fitted, what was predicted, and its parameters."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from freqid.core.results.point import Fit, PointModel, ResponseModel
from freqid.identify.model.problem import numbered
from freqid.report.kit import figures
from freqid.report.kit.notation import (
    formula,
    meaning,
    number,
    percent,
    plain_symbol,
    pretty_unit,
    share,
    symbol,
    with_unit,
)
from freqid.report.kit.pictures import Picture, key_of, picture


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
                    fit.axis.size, percent(_energy_left(fit)), number(_median_frequency(fit)), _hint(fit)
                ),
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


def _energy_left(fit: Fit) -> float:
    total = float(np.sum(np.abs(fit.measured) ** 2))
    return float(np.sum(np.abs(fit.residual) ** 2)) / total if total else float("nan")


def _median_frequency(fit: Fit) -> float:
    """Return the frequency below which half of the residual's energy lies, Hz."""
    energy = np.cumsum(np.abs(fit.residual) ** 2)
    return float(fit.axis[np.searchsorted(energy, 0.5 * energy[-1])])

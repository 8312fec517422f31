"""Which figures a study calls for, of what, and the captions that say what to see in each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from freqid.blend.corridor_study import StudiedPoint, StudyResults
from freqid.core.results.fit import Fit
from freqid.core.results.point import per
from freqid.core.vehicle import Vehicle
from freqid.identify.in_flight.parameter_history import ParameterHistory
from freqid.report.kit.corridor import derivative_name
from freqid.report.kit.effectors import effector_groups
from freqid.report.kit.figures import fits_over_time
from freqid.report.kit.notation import formula, number, percent, plain_symbol, short, symbol
from freqid.report.kit.pictures import Picture, picture
from freqid.report.study import figures
from freqid.report.study.results import settled, settled_share
from freqid.report.study.verdict import settled_by, settled_time

_STRONGEST = 6  # parameters of a response whose convergence is drawn
_SHORT = 8.0  # s, where conditions stand beside each other
_STRETCH = 20.0  # s of a manoeuvre that are drawn: longer, and the lines are one
_SIDE_BY_SIDE = 3  # responses in a figure against time


def convergence_pictures(results: StudyResults) -> list[Picture]:
    """Draw how many parameters have settled, and the error of prediction, against the length flown."""
    followed = [p for p in results.followed() if p.history]
    if not followed:
        return []
    curves = {p.id: settled_share(p.history) for p in followed}
    times = ", ".join(f"{number(settled_time(*curve))} s ({name})" for name, curve in curves.items())
    pictures = []
    names = [r for r in results.responses if all(r in p.validation_rmse for p in followed)]
    for part in parts(names, _SIDE_BY_SIDE):
        panels = {
            formula(r, results.form): (
                followed[0].model[r].unit,
                {p.id: (p.validation_time, p.validation_rmse[r]) for p in followed},
            )
            for r in part
        }
        pictures.append(
            picture(
                figures.errors_over_time(panels, settled_by(results)),
                f"validation{results.responses.index(part[0])}",
                f"Error of prediction against the length of the manoeuvre: {', '.join(part)}",
                f"{_named(results, part)}: validation RMSE of the model made from the first seconds alone. "
                f"Where a line is level, flying longer would not predict better.{_dotted(results)}",
                responses=[plain_symbol(r, results.form) for r in part],
            )
        )
    pictures.append(
        picture(
            figures.settled_over_time(curves, settled_by(results)),
            "settled",
            "Share of parameters that have settled against the length of the manoeuvre",
            f"A parameter has settled when it stays within 2σ of its final value. 95 % have after {times}. "
            f"By least squares sample by sample, as in flight.{_dotted(results)}",
        )
    )
    return pictures


def history_pictures(results: StudyResults, point: StudiedPoint) -> list[Picture]:
    """Draw the strongest parameters of each response of one condition against the length flown."""
    place = results.points.index(point)
    pictures = []
    for i, r in enumerate(results.responses):
        if r not in point.history:
            continue
        history = point.history[r]
        t = np.abs(history.estimate[-1]) / history.std_error[-1]
        groups = _kinds(history.regressors, results.vehicle)
        strongest = [max(places, key=lambda j: t[j]) for places in groups][:_STRONGEST]
        courses = [
            figures.Course(
                derivative_name(r, history.regressors[j], results.form),
                per(history.unit, history.regressor_units[j]),
                history.time,
                history.estimate[:, j],
                history.std_error[:, j],
            )
            for j in strongest
        ]
        pictures.append(
            picture(
                figures.parameters_over_time(courses, settled_by(results)),
                f"history{place}-{i}",
                f"Parameters of {plain_symbol(r, results.form)} against time at {point.id}",
                Markup(
                    "{} at <code>{}</code>: the last of all its parameters to settle is <code>{}</code>, "
                    "after {} s.{}"
                ).format(symbol(r, results.form), point.id, *_last(history), _dotted(results)),
                responses=[plain_symbol(r, results.form)],
                conditions=[point.id],
            )
        )
    return pictures


def fitted_conditions(results: StudyResults, point: StudiedPoint) -> list[Picture]:
    """Draw all responses of one condition in frequency, and fit and prediction over a stretch of time."""
    place, model = results.points.index(point), point.model
    spectra = _fits(results, point, {r: f.fit.get("frequency") for r, f in model.responses.items()})
    histories = _fits(results, point, {r: f.fit.get("time") for r, f in model.responses.items()})
    predictions = _fits(results, point, dict(model.prediction))
    pictures = []
    if spectra:
        left = {k: 1 - fit.r2 for k, (_, fit) in spectra.items()}
        worst = max(left, key=lambda k: left[k])
        pictures.append(
            picture(
                figures.fits_over_frequency(spectra),
                f"lines{place}",
                f"Responses over frequency at {point.id}: measured, model and residual",
                Markup(
                    "<code>{}</code> in frequency. The model leaves most in {}, {} of its energy; a residual "
                    "that {} over frequency is noise, one with peaks is not."
                ).format(
                    point.id,
                    _plain(worst),
                    percent(left[worst]),
                    "is level" if spectra[worst][1].noise is None else "keeps to the dotted line",
                ),
                conditions=[point.id],
            )
        )
    for fits, key, what in ((histories, "time", "fit"), (predictions, "predicted", "prediction")):
        if not fits:
            continue
        end = float(next(iter(fits.values()))[1].axis[-1])
        span = (0.5 * end, min(0.5 * end + _STRETCH, end)) if end > _STRETCH else (0.0, end)
        scores = {k: fit.r2 for k, (_, fit) in fits.items()}
        worst = min(scores, key=lambda k: scores[k])
        of = "the manoeuvre it was made from" if key == "time" else "a manoeuvre that was not used"
        pictures.append(
            picture(
                fits_over_time(fits, span, "model" if key == "time" else "prediction"),
                f"{key}{place}",
                f"Responses over time at {point.id}: measured and {what}",
                Markup(
                    "<code>{}</code>, {} over {}: {:g} s of it, each about its mean, up to the highest line. "
                    "Lowest R² of the whole: {} ({})."
                ).format(point.id, what, of, span[1] - span[0], f"{scores[worst]:.3f}", _plain(worst)),
                conditions=[point.id],
            )
        )
    return pictures


def several_pictures(results: StudyResults) -> list[Picture]:
    """Draw the predictions at all followed conditions beside each other, where there are several."""
    fits = {
        p.id: {formula(r, results.form): p.model.prediction[r] for r in results.responses}
        for p in results.followed()
        if set(results.responses) <= set(p.model.prediction)
    }
    if len(fits) < 2:
        return []
    units = {formula(r, results.form): results.points[0].model[r].unit for r in results.responses}
    end = min(float(fit.axis[-1]) for of in fits.values() for fit in of.values())
    span = (0.5 * end, min(0.5 * end + _SHORT, end))
    return [
        picture(
            figures.fits_by_condition(fits, units, span),
            "several",
            f"Predictions at {', '.join(fits)}: measured and predicted",
            f"Prediction of manoeuvres that were not used, {span[1] - span[0]:g} s of them, on one scale for "
            "each response: what is small at one condition may lead at another.",
            conditions=list(fits),
        )
    ]


def _last(history: ParameterHistory) -> tuple[str, str]:
    """Return which parameter settles last, and after how many seconds."""
    unsettled = (~settled(history)).sum(axis=0)
    return history.regressors[int(unsettled.argmax())], short(float(history.time[unsettled.max()]))


def _kinds(names: Sequence[str], vehicle: Vehicle) -> list[list[int]]:
    """Return the places of regressors that are alike: states, and each group of effectors."""
    kinds = vehicle.effector_kinds
    moved = [i for i, n in enumerate(names) if n in kinds]
    states = [i for i, n in enumerate(names) if n not in kinds]
    groups = effector_groups([names[i] for i in moved], vehicle) if moved else {}
    return [group for group in (states, *([moved[k] for k in g] for g in groups.values())) if group]


def parts(names: Sequence[str], size: int) -> list[list[str]]:
    """Split names into parts of one size, the last of what is left."""
    return [list(names[i : i + size]) for i in range(0, len(names), size)]


def _fits(
    results: StudyResults, point: StudiedPoint, found: Mapping[str, Fit | None]
) -> dict[str, tuple[str, Fit]]:
    return {
        formula(r, results.form): (point.model[r].unit, fit)
        for r in results.responses
        if (fit := found.get(r)) is not None
    }


def _named(results: StudyResults, names: Sequence[str]) -> str:
    return ", ".join(plain_symbol(r, results.form) for r in names)


def _plain(label: str) -> str:
    return re.sub(r"[$_\\]", "", label)


def _dotted(results: StudyResults) -> str:
    by = settled_by(results)
    return "" if by is None else f" Dotted: {number(by)} s, 40 s into the second period."

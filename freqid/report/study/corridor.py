"""The figures of a study along the corridor: errors and parameters against the reference speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from freqid.blend.corridor_study import StudiedPoint, StudyResults, same_density
from freqid.core.arrays import Array
from freqid.core.results.point import per
from freqid.report.kit.corridor import (
    LOOKS,
    SPEED,
    Panel,
    Points,
    blended_bands,
    derivative_name,
    draw_key,
    parameters_along,
)
from freqid.report.kit.drawing import (
    INK,
    few_ticks,
    name_panel,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.effectors import effector_groups
from freqid.report.kit.notation import formula, number, percent, plain_symbol, short, symbol
from freqid.report.kit.pictures import Picture, picture
from freqid.report.study.pictures import parts
from freqid.report.study.results import densities


@styled
def errors_over_speed(
    panels: Mapping[str, tuple[str, Sequence[tuple[Array, Array, Array]]]], names: Sequence[str]
) -> Figure:
    """Draw the errors of fit and prediction at every condition.

    Parameters
    ----------
    panels : mapping of str to (unit, curves)
        By response as matplotlib writes it; curves by density are (u, modelling, validation).
    names : sequence of str
        Of the densities.
    """
    figure, drawn = stacked_panels([0.8] * len(panels), legend=1 + (len(names) > 1))
    for axes, (label, (unit, curves)) in zip(drawn, panels.items(), strict=True):
        for (colour, marker), (u, modelled, predicted) in zip(LOOKS, curves, strict=False):
            look = {"color": colour, "marker": marker, "markersize": 4.2}
            axes.plot(u, predicted, linewidth=0.8, linestyle=(0, (4, 3)), markerfacecolor="white", **look)
            axes.plot(u, modelled, linewidth=0.8, **look)
        highest = np.concatenate([np.concatenate(curve[1:]) for curve in curves])
        axes.set_ylim(0, 1.15 * float(np.nanmax(highest, initial=0.0)) or 1.0)
        axes.margins(x=0.03)
        name_panel(axes, label, unit)
        few_ticks(axes)
    look = {"color": INK, "marker": "o", "markersize": 4.2, "linewidth": 0.8}
    dashed = {"linestyle": (0, (4, 3)), "markerfacecolor": "white"}
    handles = [
        Line2D([], [], label="modelling", **look),
        Line2D([], [], label="validation", **look, **dashed),
    ]
    draw_key(figure, handles, names)
    _share_speed(drawn)
    return figure


def _share_speed(panels: Sequence[Axes]) -> None:
    panels[-1].set_xlabel(SPEED)
    panels[-1].xaxis.set_major_formatter(plain)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)


_SYMMETRIC, _LATERAL = ("u", "w", "q"), ("v", "p", "r")
_STATES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys("XZM", _SYMMETRIC),
    **dict.fromkeys("YLN", _LATERAL),
}


def error_pictures(results: StudyResults) -> list[Picture]:
    """Draw the errors of fit and prediction of every response against the reference speed."""
    levels = _by_density(results)
    pictures = []
    for part in parts(results.responses if levels else (), 3):
        panels = {}
        for r in part:
            curves = [
                (
                    np.array([p.model.reference.u for p in points]),
                    np.array([p.modelling_rmse(r) for p in points]),
                    np.array([p.prediction_rmse(r) for p in points]),
                )
                for points in levels.values()
            ]
            panels[formula(r, results.form)] = (results.points[0].model[r].unit, curves)
        pictures.append(
            picture(
                errors_over_speed(panels, list(levels)),
                f"errors{results.responses.index(part[0])}",
                f"Modelling and validation RMSE against reference speed: {', '.join(part)}",
                _overfit(results, part),
                [plain_symbol(r, results.form) for r in part],
            )
        )
    return pictures


def _overfit(results: StudyResults, part: list[str]) -> Markup:
    """Say how much larger errors of prediction are than those of the fit."""
    named = Markup(", ").join(symbol(r, results.form) for r in part)
    ratios = {(r, p.id): p.validation_ratio(r) for p in results.points for r in part}
    ratios = {at: ratio for at, ratio in ratios.items() if np.isfinite(ratio)}
    if not ratios:
        return Markup("{}: no manoeuvre was predicted.").format(named)
    worst = max(ratios, key=lambda key: ratios[key])
    return Markup(
        "{}: errors of prediction are {} times those of the fit in the median, {} at most ({} at "
        "<code>{}</code>); much more would say that the models have learnt noise."
    ).format(
        named,
        number(float(np.median(list(ratios.values())))),
        number(ratios[worst]),
        symbol(worst[0], results.form),
        worst[1],
    )


def parameter_pictures(results: StudyResults) -> list[Picture]:
    """Draw of each response the parameters that say most.

    These are its states, of each group of effectors the one with the largest t, and the response at the
    trim.
    """
    return [
        picture(
            _draw(results, r, _main_parameters(results, r)),
            f"corridor{place}",
            f"Parameters of {plain_symbol(r, results.form)} against reference speed",
            Markup("{}: {}").format(symbol(r, results.form), _agreement(results, r)),
            [plain_symbol(r, results.form)],
        )
        for place, r in enumerate(results.responses if _by_density(results) else ())
    ]


def _agreement(results: StudyResults, response: str) -> Markup:
    """Say how far the parameters of a response are from the linearised simulation."""
    apart = {
        (name, p.id): abs(distance)
        for p in results.points
        for name, distance in zip(p.model[response].regressors, p.from_linear(response).tolist(), strict=True)
        if np.isfinite(distance)
    }
    if not apart:
        return Markup("{} parameters at each condition, these drawn.").format(
            len(results.points[0].model[response].regressors)
        )
    name, at = max(apart, key=lambda key: apart[key])
    near = percent(float(np.mean(np.array(list(apart.values())) <= 2)))
    return Markup(
        "{} of all its parameters lie within 2σ of the linearised simulation; the farthest is "
        "<code>{}</code> at <code>{}</code>, by {}σ{}."
    ).format(near, name, at, number(apart[name, at], 2), _why(results, response, name, at))


def _why(results: StudyResults, response: str, name: str, at: str) -> str:
    """Return why a parameter is off, where flights without noise tell."""
    for p in results.points:
        for miss in p.misses(response) if p.id == at else ():
            if miss.parameter == name:
                return f", of which {miss.cause} makes {number(abs(miss.parts[miss.cause]), 2)}"
    return ""


def remaining_pictures(results: StudyResults) -> list[Picture]:
    """Draw of each response the parameters that `parameter_pictures` leaves out, if there are any."""
    pictures = []
    for place, r in enumerate(results.responses if _by_density(results) else ()):
        every = dict.fromkeys(n for p in results.points for n in p.model[r].regressors)
        names = [n for n in every if n not in _main_parameters(results, r)]
        shown = plain_symbol(r, results.form)
        if names:
            pictures.append(
                picture(
                    _draw(results, r, names),
                    f"remaining{place}",
                    f"The other parameters of {shown} against reference speed",
                    f"{shown}: the other {len(names)} parameters.",
                    [shown],
                )
            )
    return pictures


def _main_parameters(results: StudyResults, response: str) -> list[str]:
    return [*_states(results, response), *_strongest_effectors(results, response), "bias"]


def _draw(results: StudyResults, response: str, names: list[str]) -> Figure:
    levels = _by_density(results)
    bands = [
        blended_bands(results.model, response, points[0].model.reference.rho) if results.model else {}
        for points in levels.values()
    ]
    units = {"bias": "1"}
    for p in results.points:
        units |= dict(zip(p.model[response].regressors, p.model[response].regressor_units, strict=True))
    panels = [
        Panel(
            derivative_name(response, name, results.form),
            per(results.points[0].model[response].unit, units[name]),
            [_points(results, points, response, name) for points in levels.values()],
            [band.get(name) for band in bands],
        )
        for name in names
    ]
    return parameters_along(panels, list(levels))


def _points(results: StudyResults, points: list[StudiedPoint], response: str, name: str) -> Points:
    have = [p for p in points if name in ("bias", *p.model[response].regressors)]
    found = np.array([p.model[response][name] for p in have]).reshape(-1, 2)
    known = [p.linear.get(response, {}).get(name, np.nan) for p in have]
    u = np.array([p.model.reference.u for p in have])
    ids = [p.id for p in have] if results.model is None else results.model.corridor.ids
    return Points(u, found[:, 0], 2 * found[:, 1], np.array(known), np.array([p.id in ids for p in have]))


def _by_density(results: StudyResults) -> dict[str, list[StudiedPoint]]:
    """Return the points of known speed by density, the densest first, each by ascending speed."""
    placed = tuple(p for p in results.points if np.isfinite(p.model.reference.u))
    found = {}
    for level in densities(placed):
        points = [p for p in placed if same_density(p.model.reference.rho, level)]
        points.sort(key=lambda p: p.model.reference.u)
        found[f"ρ = {short(level)} kg/m³"] = points
    return found


def _states(results: StudyResults, response: str) -> list[str]:
    """Return the states that a response depends on by symmetry, or the first three it has."""
    kinds = results.vehicle.effector_kinds
    states = [n for n in results.points[0].model[response].regressors if n not in kinds]
    usual = [n for n in _STATES.get(response, ()) if n in states]
    return usual or states[:3]


def _strongest_effectors(results: StudyResults, response: str) -> list[str]:
    """Return of each group of effectors the one whose parameter has the largest t, in the median."""
    names = [n for n in results.points[0].model[response].regressors if n in results.vehicle.effector_kinds]
    t = {n: [] for n in names}
    for response_model in (p.model[response] for p in results.points):
        for n, value in zip(response_model.regressors, response_model.t_statistic.tolist(), strict=True):
            if n in t:
                t[n].append(abs(value))
    groups = effector_groups(names, results.vehicle) if names else {}
    return [max((names[i] for i in places), key=lambda n: np.median(t[n])) for places in groups.values()]

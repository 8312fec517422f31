"""The figures of a study along the corridor: errors and parameters against the reference speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from freqid.blend.campaign import StudiedPoint, StudyResults, same_density
from freqid.blend.global_model import GlobalModel
from freqid.blend.similarity import equivalent
from freqid.core.arrays import Array
from freqid.core.results.point import per
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    WIDTH,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.effectors import effector_groups
from freqid.report.kit.notation import formula, number, percent, plain_symbol, short, symbol
from freqid.report.kit.pictures import Picture, picture
from freqid.report.study.pictures import derivative_name, parts
from freqid.report.study.results import densities

LOOKS = ((BLUE, "o"), (ORANGE, "s"), ("#009E73", "D"), ("#CC79A7", "^"))
"""Colour and marker by density, the densest air first."""

SPEED = "Reference u (m/s)"
_LEFT, _RIGHT, _TOP, _BOTTOM, _ACROSS, _DOWN = 0.62, 0.12, 0.26, 0.42, 0.66, 0.36
_PANEL = 0.95  # inches


@dataclass(frozen=True, eq=False)
class Points:
    """A quantity at the conditions of one density, by ascending speed.

    Attributes
    ----------
    u : ndarray, shape (n,)
        m/s.
    value, half : ndarray, shape (n,)
        Estimate and half length of its bar, in the panel's unit.
    known : ndarray, shape (n,)
        What the estimate should be; nan where that is not known.
    blended : ndarray of bool, shape (n,)
        Whether the global model is made from it.
    """

    u: Array
    value: Array
    half: Array
    known: Array
    blended: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ParameterBand:
    """A quantity of the global model at one density.

    Attributes
    ----------
    u, value, half : ndarray, shape (m,)
        m/s; blended value and half width of its band, in the panel's unit.
    """

    u: Array
    value: Array
    half: Array


@dataclass(frozen=True, eq=False)
class Panel:
    """One parameter along the corridor.

    Attributes
    ----------
    label, unit : str
        The parameter and its SI unit.
    points : sequence of Points, by density
    bands : sequence of Band or None, by density
    """

    label: str
    unit: str
    points: Sequence[Points]
    bands: Sequence[ParameterBand | None]


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
    _draw_key(figure, handles, names)
    _share_speed(drawn)
    return figure


@styled
def parameters_over_speed(panels: Sequence[Panel], names: Sequence[str]) -> Figure:
    """Draw parameters along the corridor, two panels beside each other.

    Point estimates have 2-sigma bars, the global model a line in a 2-sigma band, and what is known of
    the linearised simulation a cross.

    Parameters
    ----------
    panels : sequence of Panel
    names : sequence of str
        Of the densities.
    """
    known = any(np.isfinite(p.known).any() for panel in panels for p in panel.points)
    blended = any(band is not None for panel in panels for band in panel.bands)
    held = any((~p.blended).any() for panel in panels for p in panel.points)
    figure, drawn = _grid(len(panels), legend=1 + (len(names) > 1))
    speeds = np.concatenate([p.u for panel in panels for p in panel.points])
    margin = 0.05 * float(np.ptp(speeds)) or 1.0
    ends = float(speeds.min()) - margin, float(speeds.max()) + margin
    for axes, panel in zip(drawn, panels, strict=True):
        for (colour, _), band in zip(LOOKS, panel.bands, strict=False):
            if band is not None:
                low, high = band.value - band.half, band.value + band.half
                axes.fill_between(band.u, low, high, color=colour, alpha=0.18, linewidth=0)
                axes.plot(band.u, band.value, color=colour, linewidth=0.9)
        for (colour, marker), points in zip(LOOKS, panel.points, strict=False):
            axes.plot(*_bars(points), color=colour, linewidth=0.8)
            look = {"linestyle": "none", "marker": marker, "markersize": 3.2, "color": colour}
            for used, face in ((points.blended, colour), (~points.blended, "white")):
                axes.plot(points.u[used], points.value[used], markerfacecolor=face, **look)
            if np.isfinite(points.known).any():
                look = {"color": INK, "markersize": 4.0, "markeredgewidth": 0.8, "zorder": 5}
                axes.plot(points.u, points.known, "x", **look)
        axes.set_xlim(*ends)
        _scale(axes, panel)
        name_panel(axes, literal(panel.label, 20), panel.unit)
        few_ticks(axes)
    dot = {"color": INK, "marker": "o", "markersize": 3.2, "linestyle": "none"}
    handles = [Line2D([], [], label="point, ±2σ", **dot)]
    if held:
        handles.append(Line2D([], [], markerfacecolor="white", label="held out", **dot))
    if blended:
        handles.append(Line2D([], [], color=INK, linewidth=0.9, label="global, ±2σ"))
    if known:
        handles.append(
            Line2D([], [], color=INK, marker="x", markersize=4.4, linestyle="none", label="linearised")
        )
    _draw_key(figure, handles, names)
    for axes in drawn[-2:]:
        axes.set_xlabel(SPEED)
    return figure


def _bars(points: Points) -> tuple[Array, Array]:
    """Return the 2-sigma bars as one broken line, which is small to write."""
    u = np.repeat(points.u, 3)
    ends = np.array([points.value - points.half, points.value + points.half, np.full(points.u.size, np.nan)])
    return u, ends.T.ravel()


def _scale(axes: Axes, panel: Panel) -> None:
    """Show zero and all values; the few bars that are much longer than that run out of the panel."""
    axes.axhline(0, color=GREY, linewidth=0.6)
    values = np.concatenate([np.concatenate([p.value, p.known]) for p in panel.points])
    bars = np.concatenate([p.half for p in panel.points])
    values = values[np.isfinite(values)]
    low, high = min(0.0, values.min(initial=0)), max(0.0, values.max(initial=0))
    bars = bars[np.isfinite(bars)]
    longest = min(bars.max(initial=0.0), max(1.5 * (high - low), 2 * float(np.median([*bars, 0.0]))))
    room = max(longest, 0.06 * (high - low)) or 1.0
    axes.set_ylim(low - (room if low < 0 else 0.5 * room), high + (room if high > 0 else 0.5 * room))


def _grid(count: int, legend: int) -> tuple[Figure, list[Axes]]:
    """Return a figure of panels in two columns, row by row, and its axes."""
    rows = -(-count // 2)
    above = _TOP + 0.2 * legend
    total = above + rows * _PANEL + (rows - 1) * _DOWN + _BOTTOM
    wide = (WIDTH - _LEFT - _RIGHT - _ACROSS) / 2
    figure, panels = Figure(figsize=(WIDTH, total)), []
    for i in range(count):
        x = _LEFT + (i % 2) * (wide + _ACROSS)
        y = total - above - _PANEL - (i // 2) * (_PANEL + _DOWN)
        place = (x / WIDTH, y / total, wide / WIDTH, _PANEL / total)
        axes = figure.add_axes(place)
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.xaxis.set_major_formatter(plain)
        axes.tick_params(labelbottom=i >= count - 2)
        panels.append(axes)
    return figure, panels


def _draw_key(figure: Figure, handles: list[Line2D], names: Sequence[str]) -> None:
    """Say above the panels what the marks mean, and below that what the densities look like."""
    if len(names) < 2:
        handles[0].set_color(BLUE)
        draw_legend(figure, handles)
        return
    draw_legend(figure, handles)
    look = {"linestyle": "none", "markersize": 4.2}
    lines = [
        Line2D([], [], color=colour, marker=marker, label=literal(name, 24), **look)
        for (colour, marker), name in zip(LOOKS, names, strict=False)
    ]
    figure.legend(
        handles=lines,
        loc="upper right",
        ncols=len(lines),
        bbox_to_anchor=(1 - _RIGHT / WIDTH, 1 - 0.22 / figure.get_figheight()),
        borderaxespad=0.0,
    )


def _share_speed(panels: Sequence[Axes]) -> None:
    panels[-1].set_xlabel(SPEED)
    panels[-1].xaxis.set_major_formatter(plain)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)


_SYMMETRIC, _LATERAL = ("u", "w", "q"), ("v", "p", "r")
_STATES = dict.fromkeys("XZM", _SYMMETRIC) | dict.fromkeys("YLN", _LATERAL)
_CURVE = 49  # points of a blended curve


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
        "<code>{}</code> at <code>{}</code>, by {}σ."
    ).format(near, name, at, number(apart[name, at], 2))


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
                )
            )
    return pictures


def _main_parameters(results: StudyResults, response: str) -> list[str]:
    return [*_states(results, response), *_strongest_effectors(results, response), "bias"]


def _draw(results: StudyResults, response: str, names: list[str]) -> Figure:
    levels = _by_density(results)
    bands = [_bands(results.model, response, points) for points in levels.values()]
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
    return parameters_over_speed(panels, list(levels))


def _points(results: StudyResults, points: list[StudiedPoint], response: str, name: str) -> Points:
    have = [p for p in points if name in ("bias", *p.model[response].regressors)]
    found = np.array([p.model[response][name] for p in have]).reshape(-1, 2)
    known = [p.linear.get(response, {}).get(name, np.nan) for p in have]
    u = np.array([p.model.reference.u for p in have])
    ids = [p.id for p in have] if results.model is None else results.model.corridor.ids
    return Points(u, found[:, 0], 2 * found[:, 1], np.array(known), np.array([p.id in ids for p in have]))


def _bands(model: GlobalModel | None, response: str, points: list[StudiedPoint]) -> dict[str, ParameterBand]:
    """Return the blended parameters at one density by regressor, as far as the corridor goes there."""
    rho = points[0].model.reference.rho
    if model is None or response not in model.names or not np.isfinite(rho):
        return {}
    lines = [line for line in model.lines if same_density(line.rho, rho)] or model.lines
    nearest = float(np.clip(rho, model.lines[0].rho, model.lines[-1].rho))
    scale = [float(equivalent(rho)) * np.sqrt(line.rho / nearest) for line in lines]
    low = max(line.knots[0] / k for line, k in zip(lines, scale, strict=True))
    high = min(line.knots[-1] / k for line, k in zip(lines, scale, strict=True))
    if not low < high:
        return {}
    u = np.linspace(low, high, _CURVE)
    blended = model.parameters(response, model.reference(u, rho))
    return {
        name: ParameterBand(u, value, 2 * error)
        for name, value, error in zip(blended.names, blended.estimate, blended.std_error, strict=True)
    }


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

"""Figures of laws against advance ratio, and of manoeuvres as different models have them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from freqid.core.results.advance_ratio import AdvanceRatioModel, TrimCluster
from freqid.core.results.fit import Fit
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    draw_history,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    plain,
    share_time,
    stacked_panels,
    styled,
)
from freqid.report.kit.notation import shown_unit

CLUSTERS = (BLUE, ORANGE, "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
"""Colours of clusters in ascending angle of attack (Okabe & Ito)."""
KINDS = {
    "local": "#009E73",
    "global": ORANGE,
    "semi-local": "#CC79A7",
    "one-shot": BLUE,
    "equation error": ORANGE,
    "output error": BLUE,
}


@styled
def derivatives_over_advance_ratio(model: AdvanceRatioModel, names: Sequence[str]) -> Figure:
    """Draw derivatives against advance ratio by cluster: local estimates, laws, 95 % intervals.

    Parameters
    ----------
    model : AdvanceRatioModel
    names : sequence of str
        One panel each. The unblown limit stands at the right, behind a gap, as J is infinite there.
    """
    figure, panels = stacked_panels([1.05] * len(names), legend=1)
    finite = np.concatenate([c.local.advance_ratio for c in model.clusters])
    finite = finite[np.isfinite(finite)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.5, 1.0)
    stopped = high + 0.18 * (high - low or 1.0)
    for axes, name in zip(panels, names, strict=True):
        for k, cluster in enumerate(model.clusters):
            if name in cluster.laws:
                _draw_law(axes, cluster, name, CLUSTERS[k % len(CLUSTERS)], stopped, k)
        unit = model.clusters[0].local.units[model.clusters[0].local.place(name)]
        name_panel(axes, literal(name, 20), unit)
        few_ticks(axes)
        axes.axvline(0.5 * (high + stopped), color=GREY, linewidth=0.6, linestyle=(0, (2, 2)))
    ticks = [t for t in panels[-1].get_xticks() if low - 0.05 <= t <= high + 0.02]
    panels[-1].set_xticks([*ticks, stopped], [*(plain(round(t, 10)) for t in ticks), "stopped"])
    panels[-1].set_xlim(low - 0.05 * (high - low or 1.0), stopped + 0.1 * (high - low or 1.0))
    panels[-1].set_xlabel("Advance ratio J = V / (n d)")
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    handles = [
        Line2D([], [], color=CLUSTERS[k % len(CLUSTERS)], marker="o", markersize=3,
               label=f"{np.degrees(c.alpha):.1f}°")
        for k, c in enumerate(model.clusters)
    ]  # fmt: skip
    draw_legend(figure, handles)
    return figure


def _draw_law(axes: Axes, cluster: TrimCluster, name: str, colour: str, stopped: float, k: int) -> None:
    law, local = cluster[name], cluster.local
    j = local.advance_ratio
    place = local.place(name)
    told = np.isfinite(local.estimate[:, place])
    blown = told & np.isfinite(j)
    if blown.any():
        grid = np.linspace(law.lowest, law.highest, 80)
        low, high = law.interval(grid)
        axes.fill_between(grid, low, high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(grid, law.value(grid), color=colour, linewidth=1.1)
    aside = 0.012 * (k - 1)  # clusters stand beside each other at one place of the axis
    low, high = law.interval(np.inf)
    axes.vlines(stopped + aside, low, high, color=colour, alpha=0.35, linewidth=4)
    axes.plot(stopped + aside, law.unblown, color=colour, marker="_", markersize=6, linestyle="none")
    for rows, where in (
        (blown, j[blown]),
        (told & np.isinf(j), stopped + aside + np.zeros(int((told & np.isinf(j)).sum()))),
    ):
        axes.errorbar(
            where,
            local.estimate[rows, place],
            2 * local.std_error[rows, place],
            color=colour,
            linestyle="none",
            marker="o",
            markersize=2.6,
            elinewidth=0.7,
        )


@styled
def histories_by_model(
    fits: Mapping[str, Mapping[str, Fit]], labels: Mapping[str, tuple[str, str]], kinds: Sequence[str]
) -> Figure:
    """Draw quantities in time: measured, and as several models have them.

    Parameters
    ----------
    fits : mapping of str to mapping of str to Fit
        By model and quantity.
    labels : mapping of str to (str, str)
        What a panel is called and its SI unit, by quantity; one panel each.
    kinds : sequence of str
        Models that are drawn.
    """
    figure, panels = stacked_panels([0.85] * len(labels), legend=1)
    lines: list[Line2D] = []
    for axes, (name, (label, unit)) in zip(panels, labels.items(), strict=True):
        first = fits[kinds[0]][name]
        shown, factor = shown_unit(f"state/{name}", unit)
        lines = [
            draw_history(
                axes, first.axis, factor * first.measured, INK, linewidth=1.6, alpha=0.45, label="measured"
            )
        ]
        lines += [
            draw_history(axes, fits[kind][name].axis, factor * fits[kind][name].modelled, KINDS[kind],
                         linewidth=0.9, label=kind)
            for kind in kinds
        ]  # fmt: skip
        name_panel(axes, label, shown)
        few_ticks(axes)
    share_time(panels, next(iter(fits[kinds[0]].values())).axis)
    draw_legend(figure, lines)
    return figure


@styled
def held_out_misfits(ids: Sequence[str], misfit: Mapping[str, np.ndarray]) -> Figure:
    """Draw the misfit of every held-out manoeuvre by model, on a logarithmic axis."""
    figure, (axes,) = stacked_panels([1.7], legend=1)
    at = np.arange(len(ids))
    lines = []
    for k, (kind, values) in enumerate(misfit.items()):
        aside = 0.14 * (k - (len(misfit) - 1) / 2)
        lines += axes.plot(
            at + aside, values, color=KINDS[kind], marker="o", markersize=3.5, linestyle="none", label=kind
        )
    axes.axhline(1.0, color=GREY, linewidth=0.8)
    axes.set_yscale("log")
    axes.set_title("Misfit per derivative")
    axes.set_xticks(at, [literal(i, 8) for i in ids])
    draw_legend(figure, lines)
    return figure

"""Figures: data in, a matplotlib Figure out; nothing is read, computed or written here.

Every figure has the width of half a page, so that two stand side by side on a desk and one below the
other on a phone without a change of scale. What a panel shows stands above it, with its unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.core.results.fit import Fit
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ON_COLOUR,
    ORANGE,
    PALE,
    WIDTH,
    draw_history,
    draw_legend,
    draw_noise,
    few_ticks,
    literal,
    name_panel,
    plain,
    share_frequency,
    share_time,
    shown_values,
    stacked_panels,
    styled,
)
from freqid.report.kit.notation import shown_unit

_STRIP = 0.62  # inches, of one of many histories


@dataclass(frozen=True)
class Spectrum:
    """Finite Fourier transforms of several channels on the same lines.

    Attributes
    ----------
    names : tuple of str
        One for each row.
    units : tuple of str
        SI units of the time histories; the transform carries a further second.
    frequencies_hz : ndarray, shape (frequency,)
    values : ndarray of complex, shape (channel, frequency)
        Integral of ``x(t) exp(-j 2 pi f t)`` over the record.
    duration : float
        Length T of the record, s.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    frequencies_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    duration: float


@styled
def fits_over_time(fits: Mapping[str, tuple[str, Fit]], span: tuple[float, float], modelled: str) -> Figure:
    """Draw several responses over a stretch of time, measured and modelled, each about its mean.

    Parameters
    ----------
    fits : mapping of str to (unit, Fit)
        By response as matplotlib writes it; real, in time.
    span : tuple of (start, end)
        s.
    modelled : str
        What the model's line is called.
    """
    figure, panels = stacked_panels([_STRIP] * len(fits), legend=1)
    drawn: list[Line2D] = []
    time = np.array(span)
    for axes, (label, (unit, fit)) in zip(panels, fits.items(), strict=True):
        inside = (fit.axis >= span[0]) & (fit.axis <= span[1])
        time, mean = fit.axis[inside], fit.measured.mean()
        drawn = [
            draw_history(axes, time, fit.measured[inside] - mean, GREY, linewidth=2.0, label="measured"),
            draw_history(axes, time, fit.modelled[inside] - mean, BLUE, linewidth=0.9, label=modelled),
        ]
        name_panel(axes, f"{label}, R² {fit.r2:.3f}", unit)
        few_ticks(axes)
    draw_legend(figure, drawn)
    share_time(panels, time)
    return figure


@styled
def channel_strips(record: FlightRecord, names: Sequence[str]) -> Figure:
    """Draw channels over time, one strip each.

    Parameters
    ----------
    record : FlightRecord
    names : sequence of str
        Channels as ``group/name``. Behind an effector its command is drawn where there is one.
    """
    figure, panels = stacked_panels([0.56] * len(names))
    for axes, name in zip(panels, names, strict=True):
        channel = record.channel(name)
        behind = name.replace("effector/", "command/", 1)
        if behind != name and behind in record:
            draw_history(
                axes, record.time, shown_values(record.channel(behind)), GREY, linewidth=1.6, alpha=0.6
            )
        draw_history(axes, record.time, shown_values(channel), BLUE, linewidth=0.9)
        name_panel(axes, literal(name.partition("/")[2], 40), shown_unit(name, channel.unit)[0])
        few_ticks(axes)
    share_time(panels, record.time)
    return figure


@styled
def amplitude_strips(spectrum: Spectrum) -> Figure:
    """Draw the amplitude of the sine that each line of each channel amounts to.

    Parameters
    ----------
    spectrum : Spectrum
        Channels as ``group/name``.
    """
    figure, panels = stacked_panels([0.56] * len(spectrum.names))
    f = spectrum.frequencies_hz
    separate = f.size < 2 or np.diff(f).min() * spectrum.duration > 1 - 1e-6
    for axes, name, unit, values in zip(panels, spectrum.names, spectrum.units, spectrum.values, strict=True):
        shown, factor = shown_unit(name, unit)
        amplitude = 2 / spectrum.duration * factor * np.abs(values)
        if separate:  # lines that the record resolves stand alone
            axes.vlines(f, 0, amplitude, color=BLUE, linewidth=1.2)
        else:
            axes.plot(f, amplitude, color=BLUE)
        axes.set_ylim(bottom=0)
        name_panel(axes, literal(name.partition("/")[2], 40), shown)
        few_ticks(axes)
    share_frequency(panels, f)
    return figure


@styled
def fit_over_frequency(fit: Fit, label: str, unit: str) -> Figure:
    """Draw magnitudes of measured, model, residual and noise, and the phase that separates the first two.

    Parameters
    ----------
    fit : Fit
        Complex, on lines; its noise is drawn where there is some.
    label, unit : str
        Response as matplotlib writes it (`notation.formula`), and its SI unit.
    """
    figure, (magnitude, phase) = stacked_panels([1.75, 0.75], legend=1)
    f = fit.axis
    dots = {"linestyle": "none", "marker": "o", "markeredgewidth": 0}
    (left,) = magnitude.plot(f, np.abs(fit.residual), color=ORANGE, linewidth=0.9, label="residual")
    (model,) = magnitude.plot(f, np.abs(fit.modelled), color=BLUE, linewidth=1.2, label="model")
    (flown,) = magnitude.plot(f, np.abs(fit.measured), color=INK, markersize=2.6, label="measured", **dots)
    magnitude.set_ylim(bottom=0)
    draw_legend(figure, [flown, model, left, *draw_noise(magnitude, fit)])
    name_panel(magnitude, f"Magnitude of {label}", "s" if unit == "1" else f"{unit} s")
    turned = np.angle(fit.modelled * np.conj(fit.measured), deg=True)
    phase.plot(f, turned, color=BLUE, markersize=2.2, **dots)
    bound = next(b for b in (15, 45, 90, 180) if np.abs(turned).max(initial=0) <= b)
    phase.set_ylim(-1.08 * bound, 1.08 * bound)
    phase.set_yticks([-bound, 0, bound])
    phase.yaxis.set_major_formatter(plain)
    name_panel(phase, "Phase, model less measured", "deg")
    share_frequency([magnitude, phase], f)
    return figure


@styled
def fit_over_time(fit: Fit, label: str, unit: str, modelled: str = "model") -> Figure:
    """Draw measured and model over time, and the residual below on its own scale.

    Parameters
    ----------
    fit : Fit
        Real, in time.
    label, unit : str
        Response as matplotlib writes it (`notation.formula`), and its SI unit.
    modelled : str
        What the model's line is called.
    """
    figure, (both, below) = stacked_panels([1.75, 0.75], legend=1)
    flown = draw_history(both, fit.axis, fit.measured, GREY, linewidth=2.0, label="measured")
    model = draw_history(both, fit.axis, fit.modelled, BLUE, linewidth=0.9, label=modelled)
    left = draw_history(below, fit.axis, fit.residual, ORANGE, linewidth=0.8, label="residual")
    draw_legend(figure, [flown, model, left])
    name_panel(both, label, unit)
    name_panel(below, "Residual", unit)
    few_ticks(below)
    share_time([both, below], fit.axis)
    return figure


@styled
def parameter_bars(
    names: Sequence[str], value: Array, half: Array, label: str, beside: Array | None = None
) -> Figure:
    """Draw parameters that are on one scale, each with its 2-sigma bar.

    Parameters
    ----------
    names : sequence of str, length p
    value, half : ndarray, shape (p,)
        Bar and half length of its 2-sigma bar, in the unit of the label.
    label : str
        Of the axis, with unit.
    beside : ndarray, shape (p,), optional
        By least squares, where the bars are by instruments.
    """
    above = 0.1 if beside is None else 0.36
    figure, (axes,) = stacked_panels([0.23 * len(names) + 0.1], top=above, left=0.76)
    row = np.arange(len(names))
    known = np.isfinite(value) & np.isfinite(half)
    value, half = np.where(known, value, 0.0), np.where(known, half, 0.0)
    clear = np.abs(value) > half
    colours = np.where(clear, BLUE, PALE)
    axes.barh(row, value, height=0.62, color=colours.tolist())
    axes.errorbar(
        value, row, xerr=half, linestyle="none", ecolor=INK, elinewidth=1.0, capsize=2.2, capthick=1.0
    )
    axes.axvline(0, color=INK, linewidth=0.8)
    if beside is not None:
        ring = {"marker": "o", "markersize": 4.6, "markerfacecolor": "none", "markeredgewidth": 1.2}
        rings = axes.plot(beside, row, color=ORANGE, linestyle="none", label="least squares", **ring)
        draw_legend(figure, [Patch(color=BLUE, label="instruments ± 2σ"), *rings])
    axes.set_yticks(row, [literal(name, 14) for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="y", visible=False)
    axes.spines["left"].set_visible(False)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(plain)
    axes.set_xlabel(label)
    return figure


@styled
def correlation_map(names: Sequence[str], correlation: Array) -> Figure:
    """Draw the correlation of the parameters' errors as a lower triangle of coloured cells.

    Parameters
    ----------
    names : sequence of str, length p
    correlation : ndarray, shape (p, p)
    """
    count, short = len(names), [literal(name, 14) for name in names]
    margin = 0.2 + 0.075 * max(map(len, short))
    side = min(0.46 * count, WIDTH - margin - 0.12)
    # The empty half of the square holds the scale, where the first rows are short enough for it.
    width = margin + max(side + 0.12, 0.55 + 2 * side / count + 1.65)
    height = 0.08 + side + margin
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((margin / width, margin / height, side / width, side / height))
    steps = np.linspace(-1, 1, 22)
    colours = LinearSegmentedColormap.from_list("blue-grey-orange", [BLUE, "#f0f0f0", ORANGE])
    look: dict[str, Any] = {"cmap": colours, "norm": BoundaryNorm(steps, 256), "edgecolors": "white"}
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    i, j = np.tril_indices(count, -1)
    below = list(np.column_stack([j, i])[:, None, :] + corners)
    itself = list(np.arange(count)[:, None, None] + corners)
    axes.add_collection(PolyCollection(below, array=correlation[i, j], linewidths=0.8, **look))
    axes.add_collection(PolyCollection(itself, facecolors=PALE, edgecolors="white", linewidths=0.8))
    axes.set(xlim=(0, count), ylim=(count, 0))
    # Many rows leave room for one digit, and only the large values matter.
    few = count <= 8
    for row, column in zip(i, j, strict=True):
        value = correlation[row, column]
        if abs(value) >= (0.0 if few else 0.45):
            text = f"{value:.2f}".replace("-", "−") if few else f"{abs(value):.1f}".lstrip("0")
            ink = "white" if abs(value) > 0.75 else ON_COLOUR
            axes.text(column + 0.5, row + 0.5, text, ha="center", va="center", color=ink)
    axes.set_yticks(np.arange(count) + 0.5, short)
    axes.set_xticks(np.arange(count) + 0.5, short, rotation=90)

    scale = figure.add_axes((1 - 1.6 / width, 1 - 0.5 / height, 1.48 / width, 0.1 / height))
    scale.pcolormesh(steps, [0, 1], 0.5 * (steps[1:] + steps[:-1])[None, :], linewidth=0.2, **look)
    scale.set_xticks([-1, 0, 1], ["−1", "0", "1"])
    scale.set_yticks([])
    scale.set_title("Correlation")
    for panel in (axes, scale):
        panel.tick_params(length=0)
        panel.grid(visible=False)
        panel.spines[:].set_visible(False)
    return figure

"""Figures as the page holds them: the same places with fewer bytes, and panels that say what they span."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from freqid.core.results.fit import Fit
from freqid.report.kit import figures
from freqid.report.kit.drawing import WIDTH, draw_legend, stacked_panels, styled
from freqid.report.kit.svg import inline_svg, relative

POINT = st.tuples(st.floats(-50, 900), st.floats(-50, 900))


def places(path: str) -> list[tuple[float, float]]:
    """Follow path data of commands M, L, Q, C absolute or l, q, c relative, number by number."""
    found, at, start, command = [], (0.0, 0.0), (0.0, 0.0), "M"
    tokens = re.findall(r"[MLQCZlqcz]|-?(?:\d+\.?\d*|\.\d+)", path)
    i = 0
    while i < len(tokens):
        if tokens[i].isalpha():
            command = tokens[i]
            i += 1
            if command in "Zz":
                at = start
                continue
        count = {"M": 1, "L": 1, "Q": 2, "C": 3}[command.upper()]
        origin = at if command.islower() else (0.0, 0.0)
        for _ in range(count):
            at = origin[0] + float(tokens[i]), origin[1] + float(tokens[i + 1])
            found.append(at)
            i += 2
        if command == "M":
            start = at
    return found


@given(st.lists(st.tuples(st.sampled_from("LQC"), POINT, POINT, POINT), max_size=40), POINT, st.booleans())
def test_relative_paths_go_to_the_same_places(steps, first, closed):
    path = f"M {first[0]:.6f} {first[1]:.6f} "
    for command, *points in steps:
        used = points[: {"L": 1, "Q": 2, "C": 3}[command]]
        path += f"{command} " + " ".join(f"{x:.6f} {y:.6f}" for x, y in used) + "\n"
    path += "z" if closed else ""
    short = relative(path)
    assert len(short) <= len(path)
    # rounded once each to a hundredth, however many steps led there
    assert np.array(places(short)) == pytest.approx(np.array(places(path)), abs=0.0051)


def test_times_of_long_lines_keep_a_thousandth():
    x = np.linspace(44.64, 283.0, 400)
    path = "M" + " L".join(f" {a:.6f} {100 + np.sin(a):.6f}" for a in x)
    fine = np.array(places(relative(path, finer=True)))
    assert np.abs(fine[:, 0] - x).max() <= 0.00051
    assert np.abs(np.array(places(relative(path)))[:, 0] - x).max() > 0.002


def test_panels_over_time_say_what_they_span_and_others_do_not():
    t = np.arange(100) * 0.1 + 5
    in_time = inline_svg(figures.fit_over_time(Fit(t, np.sin(t), np.cos(t)), "M", "N m"), "k", "label")
    spans = re.findall(r'class="time" data-span="([^"]+)"', in_time)
    assert spans == ["5 14.9", "5 14.9"]
    f = np.arange(1, 30) / 20
    z = np.exp(1j * f)
    in_frequency = inline_svg(figures.fit_over_frequency(Fit(f, z, 0.9 * z), "M", "N m"), "k", "label")
    assert 'class="time"' not in in_frequency
    for text in (in_time, in_frequency):
        ElementTree.fromstring(text)


def test_lines_of_a_figure_pass_through_the_data():
    t = np.arange(50) * 0.1
    y = np.where(t < 2.5, 0.0, 1.0)
    figure = figures.fit_over_time(Fit(t, y, 0 * y), "M", "N m")
    axes = figure.axes[0]
    expected = axes.transData.transform(np.column_stack([t, y])) * 72 / figure.dpi
    expected[:, 1] = 72 * figure.get_figheight() - expected[:, 1]
    svg = ElementTree.fromstring(inline_svg(figure, "k", "label"))
    (measured,) = [
        e.get("d", "") for e in svg.iter("path") if e.get("stroke-width") == "2" and e.get("clip-path")
    ]
    assert np.array(places(measured)) == pytest.approx(expected, abs=0.0051)


def test_a_legend_that_needs_more_rows_makes_the_figure_higher_and_leaves_panels_as_they_are():
    @styled
    def drawn(names):
        figure, (axes,) = stacked_panels([1.0], legend=1)
        draw_legend(figure, [axes.plot([0, 1], label=name)[0] for name in names])
        return figure, axes.get_window_extent().height

    low, height = drawn(["a", "b"])
    high, same = drawn([f"a rather long name {i}" for i in range(4)])
    assert same == pytest.approx(height)
    assert high.get_figheight() > low.get_figheight() + 0.1
    high.canvas.draw()
    box = high.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= 72 * WIDTH * high.dpi / 72 + 1
    assert box.y0 >= high.axes[0].get_window_extent().y1

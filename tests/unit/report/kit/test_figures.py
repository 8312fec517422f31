from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from freqid.core.results.fit import Fit
from freqid.report.kit import figures
from freqid.report.kit.drawing import envelope
from freqid.report.kit.figures import Spectrum
from freqid.report.kit.pictures import inline_svg

F = np.arange(1, 31) / 20
Z = np.exp(3j * F) / F


def titles(figure: Figure) -> list[str]:
    return [axes.get_title(loc="left") for axes in figure.axes]


@given(st.integers(2, 4000), st.integers(1, 400), st.integers(0, 2**31))
def test_an_envelope_keeps_ends_and_extremes(samples, columns, seed):
    values = np.random.default_rng(seed).standard_normal(samples)
    time = np.arange(samples) * 0.1
    t, x = envelope(time, values, columns)
    assert t[0] == time[0]
    assert t[-1] == time[-1]
    assert np.all(np.diff(t) > 0)
    assert x.min() == values.min()
    assert x.max() == values.max()
    assert np.array_equal(x, values[np.searchsorted(time, t)])
    assert t.size <= max(5 * columns, 3 * columns + 2)


def test_channels_are_drawn_in_degrees_and_rpm(record):
    figure = figures.channel_strips(record, ["state/p", "effector/da", "effector/n1"])
    assert titles(figure) == ["p (deg/s)", "da (deg)", "n1 (rpm)"]
    assert figure.axes[-1].get_xlabel() == "Time (s)"
    roll, aileron, rotor = (axes.lines for axes in figure.axes)
    assert np.ptp(roll[0].get_ydata()) == pytest.approx(np.rad2deg(np.ptp(record["state/p"])))
    assert [len(roll), len(aileron), len(rotor)] == [1, 2, 1]  # the aileron's command behind it
    assert np.max(aileron[0].get_ydata()) == pytest.approx(np.rad2deg(record["command/da"].max()))
    assert np.max(rotor[0].get_ydata()) == pytest.approx(record["effector/n1"].max() * 30 / np.pi)


def test_amplitudes_are_those_of_the_sines():
    values = np.array([0.5 * 20 * 0.1 * np.ones(F.size)], dtype=complex)  # 0.1 rad for 20 s
    spectrum = Spectrum(("effector/da",), ("rad",), F, values, 20.0)
    (axes,) = figures.amplitude_strips(spectrum).axes
    heights = [segment[1, 1] for segment in axes.collections[0].get_segments()]
    assert heights == pytest.approx([np.rad2deg(0.1)] * F.size)
    assert (axes.get_title(loc="left"), axes.get_xlabel()) == ("da (deg)", "Frequency (Hz)")


def test_a_fit_over_frequency_shows_magnitude_and_phase():
    figure = figures.fit_over_frequency(Fit(F, Z, 0.9 * Z * np.exp(0.1j)), "N", "N m")
    assert titles(figure) == ["Magnitude of N (N m s)", "Phase, model less measured (deg)"]
    lines = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    assert lines["measured"] == pytest.approx(np.abs(Z))
    assert lines["model"] == pytest.approx(0.9 * np.abs(Z))
    assert lines["residual"] == pytest.approx(np.abs(Z - 0.9 * Z * np.exp(0.1j)))
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx(np.full(F.size, np.rad2deg(0.1)))


def test_a_fit_over_time_shows_the_residual_apart():
    t = np.arange(100) * 0.1
    figure = figures.fit_over_time(Fit(t, np.sin(t), 0.5 * np.sin(t)), "$C_n$", "1", "prediction")
    assert titles(figure) == ["$C_n$", "Residual"]
    assert [line.get_label() for line in figure.axes[0].lines] == ["measured", "prediction"]
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx(0.5 * np.sin(t))


def test_bars_have_the_length_of_two_sigma_and_are_grey_across_zero():
    value, half = np.array([3.0, -0.5]), np.array([1.0, 0.75])
    (axes,) = figures.parameter_bars(["a", "b"], value, half, "Contribution (N)").axes
    assert [bar.get_width() for bar in axes.patches] == [3.0, -0.5]
    assert axes.patches[0].get_facecolor() != axes.patches[1].get_facecolor()
    (whiskers,) = [c for c in axes.collections if len(c.get_segments()) == 2]
    assert [s[:, 0].tolist() for s in whiskers.get_segments()] == [[2.0, 4.0], [-1.25, 0.25]]
    assert axes.get_xlabel() == "Contribution (N)"


@pytest.mark.parametrize("count", [1, 2, 5, 21])
def test_labels_of_a_correlation_map_do_not_overlap(count):
    names = [f"de{j}" for j in range(count)]
    correlation = np.linspace(-1, 1, count**2).reshape(count, count)
    figure = figures.correlation_map(names, correlation)
    figure.canvas.draw()
    axes, scale = figure.axes
    cells = axes.transData.transform([(count, 0), (2, 2)])
    # the cells of the rows beside the scale end before it begins
    box = scale.get_tightbbox()
    lowest = axes.transData.inverted().transform((0, box.y0))[1]
    reach = axes.transData.transform((min(np.ceil(lowest), count), 0))[0]
    assert reach <= box.x0
    assert cells[0, 0] <= figure.bbox.x1
    for texts in (axes.get_xticklabels(), axes.get_yticklabels()):
        boxes = [text.get_window_extent() for text in texts]
        assert not any(a.overlaps(b) for a, b in itertools.pairwise(boxes))
        assert all(figure.bbox.x0 <= b.x0 and figure.bbox.y0 <= b.y0 for b in boxes)


def test_the_same_figure_twice_in_a_page_shares_no_id():
    def svg(key: str) -> str:
        return inline_svg(figures.fit_over_frequency(Fit(F, Z, 0.9 * Z), "N", "N m"), key, "a label")

    first, again, second = svg("a"), svg("a"), svg("b")
    assert first == again
    ids = [set(re.findall(r' id="([^"]+)"', text)) for text in (first, second)]
    assert ids[0]
    assert not ids[0] & ids[1]
    assert set(re.findall(r'(?:url\(#|href="#)([^)"]+)', first)) == ids[0]


def test_a_figure_is_lines_and_selectable_text():
    svg = inline_svg(figures.fit_over_frequency(Fit(F, Z, 0.9 * Z), "a<b & $", "N m"), "k", 'x "y" <z>')
    assert svg.startswith("<svg ")
    assert 'aria-label="x &#34;y&#34; &lt;z&gt;"' in svg
    assert "Magnitude of a&lt;b &amp; $ (N m s)</text>" in svg
    assert "<image" not in svg
    assert "<style" not in svg
    assert "font-family" not in svg


def test_a_report_draws_the_same_whatever_matplotlib_is_set_to(monkeypatch):
    import matplotlib as mpl

    def svg() -> str:
        return inline_svg(figures.fit_over_frequency(Fit(F, Z, 0.9 * Z), "N", "N m"), "k", "label")

    expected = svg()
    with mpl.rc_context({"font.size": 20, "lines.linewidth": 5, "svg.hashsalt": "z", "axes.grid": False}):
        assert svg() == expected

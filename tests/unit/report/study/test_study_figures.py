"""Figures of a study: what is drawn is what was found, and nothing lies over anything else."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from test_study_page import DENSITIES, HELD, SPEEDS, results, truth

from freqid.blend.similarity import equivalent
from freqid.report.kit.figures import fits_over_time
from freqid.report.study import corridor, figures
from freqid.report.study.corridor import _draw


def boxes(figure: Figure) -> list[tuple[str, Bbox]]:
    """Return every text that a figure shows, and where it is in pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    texts = [t for legend in figure.legends for t in legend.get_texts()]
    for axes in figure.axes:
        texts += [axes._left_title, axes.xaxis.label, *axes.texts]  # type: ignore[attr-defined]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    texts = [t for t in texts if t.get_visible() and t.get_text().strip()]
    return [(t.get_text(), t.get_window_extent(canvas.get_renderer())) for t in texts]


def drawn_parameters(response: str, names: list[str]) -> Figure:
    return _draw(results(), response, names)


def test_parameters_along_the_corridor_are_those_of_models_truth_and_blend():
    figure = drawn_parameters("Z", ["w", "de1", "bias"])
    assert [axes.get_title(loc="left") for axes in figure.axes] == [
        "Z per w (N/(m/s))",
        "Z per de1 (N/rad)",
        "Z at the trim (N)",
    ]
    axes = figure.axes[1]
    points = [p for p in results().points if p.model.reference.rho == DENSITIES[0]]
    estimate = np.array([p.model["Z"]["de1"] for p in points])
    (bars,) = [
        line
        for line in axes.lines
        if line.get_color() == corridor.LOOKS[0][0] and np.isnan(line.get_ydata()).any()
    ]
    ends = np.reshape(bars.get_ydata(), (3, 3))
    assert ends[:, 0] == pytest.approx(estimate[:, 0] - 2 * estimate[:, 1])
    assert ends[:, 1] == pytest.approx(estimate[:, 0] + 2 * estimate[:, 1])
    crosses = [line for line in axes.lines if line.get_marker() == "x"]
    for line, rho in zip(crosses, DENSITIES, strict=True):
        assert line.get_xdata() == pytest.approx(SPEEDS)
        assert line.get_ydata() == pytest.approx([truth("Z", u, rho)["de1"] for u in SPEEDS])
    open_marks = [
        line for line in axes.lines if line.get_markerfacecolor() == "white" and len(line.get_xdata())
    ]
    assert [line.get_xdata().tolist() for line in open_marks] == [[14.0]]
    assert HELD == "u14-1"  # the only one that the global model is not made from
    assert not any(line.get_marker() == "x" for line in figure.axes[2].lines)  # no truth of the trim


def test_the_blended_curve_passes_through_its_points_and_its_band_has_their_width():
    axes = drawn_parameters("N", ["v"]).axes[0]
    for (colour, _), rho in zip(corridor.LOOKS, DENSITIES, strict=False):
        (curve,) = [line for line in axes.lines if line.get_color() == colour and len(line.get_xdata()) > 20]
        u, value = curve.get_xdata(), curve.get_ydata()
        assert (u[0], u[-1]) == pytest.approx((SPEEDS[0], SPEEDS[-1]))
        ends = [p.model["N"]["v"] for p in results().points if p.model.reference.rho == rho]
        assert (value[0], value[-1]) == pytest.approx((ends[0][0], ends[-1][0]))
    first = axes.collections[0].get_paths()[0].vertices
    at_start = first[np.isclose(first[:, 0], SPEEDS[0])][:, 1]
    estimate, error = results().points[0].model["N"]["v"]
    assert np.ptp(at_start) == pytest.approx(4 * error)
    assert float(equivalent(DENSITIES[0])) == 1.0


def test_errors_over_speed_show_fit_and_prediction():
    u = np.array([1.0, 2.0])
    curves = [(u, np.array([3.0, 4.0]), np.array([5.0, 6.0]))]
    figure = corridor.errors_over_speed({"Z": ("N", curves)}, ["one"])
    dashed, solid = figure.axes[0].lines
    assert (list(dashed.get_ydata()), dashed.get_markerfacecolor()) == ([5.0, 6.0], "white")
    assert list(solid.get_ydata()) == [3.0, 4.0]
    assert figure.axes[0].get_ylim()[0] == 0
    assert figure.axes[0].get_xlabel() == "Reference u (m/s)"


def course(label: str = "Z per w") -> figures.Course:
    time = np.arange(10.0, 121.0)
    value = -5 + 40 * np.exp(-time / 5)
    return figures.Course(label, "N/(m/s)", time, value, 3 / np.sqrt(time))


def test_a_parameter_over_time_has_its_band_its_end_and_a_scale_that_the_start_does_not_set():
    axes = figures.parameters_over_time([course()], 100.0).axes[0]
    band = axes.collections[0].get_paths()[0].vertices
    at_end = band[band[:, 0] == 120][:, 1]
    assert np.ptp(at_end) == pytest.approx(4 * 3 / np.sqrt(120))
    level = {float(line.get_ydata()[0]) for line in axes.lines if len(set(line.get_ydata())) == 1}
    last = course().value[-1]
    assert level >= {last - 6 / np.sqrt(120), last + 6 / np.sqrt(120)}
    low, high = axes.get_ylim()
    assert -8 < low < last - 6 / np.sqrt(120)
    assert last + 6 / np.sqrt(120) < high < -2
    assert any(list(line.get_xdata()) == [100.0, 100.0] for line in axes.lines)
    assert axes.get_xlabel() == "Length of the manoeuvre (s)"


@pytest.mark.parametrize("names", [["u", "w", "q", "de1", "n1", "bias"], ["w"], ["w", "q", "bias"]])
def test_no_text_along_the_corridor_lies_over_another(names):
    assert_apart(drawn_parameters("Z", names))


def test_no_text_over_time_lies_over_another():
    assert_apart(figures.parameters_over_time([course(), course("N per dr1")], 100.0))
    curves = {
        name: (course().time, np.linspace(0, 1, 111)) for name in ("u10-1500m", "u45-1500m", "u85-1500m")
    }
    assert_apart(figures.settled_over_time(curves, 100.0))
    point = results().points[0]
    fits = {r: (m.unit, m.fit["time"]) for r, m in point.model.responses.items()}
    assert_apart(fits_over_time(fits, (20.0, 40.0), "prediction"))
    lines = {r: (m.unit, m.fit["frequency"]) for r, m in point.model.responses.items()}
    assert_apart(figures.fits_over_frequency(lines))


def test_a_stretch_of_time_shows_its_samples_about_the_mean_of_all():
    fit = results().points[0].model["Z"].fit["time"]
    axes = fits_over_time({"Z": ("N", fit)}, (20.0, 30.0), "model").axes[0]
    measured, modelled = axes.lines
    inside = (fit.axis >= 20) & (fit.axis <= 30)
    assert measured.get_ydata() == pytest.approx(fit.measured[inside] - fit.measured.mean())
    assert modelled.get_ydata() == pytest.approx(fit.modelled[inside] - fit.measured.mean())
    assert axes.get_title(loc="left") == f"Z, R² {fit.r2:.3f} (N)"


def test_conditions_beside_each_other_share_the_scale_of_a_response():
    points = results().points[:3]
    fits = {p.id: {r: p.model.prediction[r] for r in ("Z", "N")} for p in points}
    figure = figures.fits_by_condition(fits, {"Z": "N", "N": "N m"}, (20.0, 28.0))
    assert_apart(figure)
    for row, response in enumerate(("Z", "N")):
        panels = figure.axes[3 * row : 3 * row + 3]
        assert len({axes.get_ylim() for axes in panels}) == 1
        for axes, point in zip(panels, points, strict=True):
            fit = point.model.prediction[response]
            inside = (fit.axis >= 20) & (fit.axis <= 28)
            assert axes.lines[0].get_ydata() == pytest.approx((fit.measured - fit.measured.mean())[inside])
            assert np.abs(axes.lines[0].get_ydata()).max() < axes.get_ylim()[1]
    assert [axes.texts[0].get_text() for axes in figure.axes[:3]] == [p.id for p in points]


def assert_apart(figure: Figure) -> None:
    found = boxes(figure)
    width, height = figure.get_size_inches() * figure.dpi
    for text, box in found:
        assert box.x0 >= 0, text
        assert box.x1 <= width, text
        assert box.y0 >= 0, text
        assert box.y1 <= height, text
    for (one, a), (other, b) in itertools.combinations(found, 2):
        assert not a.overlaps(b), (one, other)

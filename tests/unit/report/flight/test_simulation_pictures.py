"""The aircraft as drawn has the described shape and legible names; trims and films show their numbers."""

from __future__ import annotations

from itertools import combinations
from math import atan, degrees, pi
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from simulated_flights import film_record, scenario_of

from freqid.core.scenario import Airframe, Scenario, read_scenario
from freqid.core.vehicle import Effector, Inertia, Surface, Wing
from freqid.dynamics.mass import centre_of_gravity
from freqid.report.flight.aircraft import (
    REAR,
    SIDE,
    TOP,
    outline,
    silhouette,
    three_view,
    tilted_shaft,
)
from freqid.report.flight.page import FRAMES, filmstrip, largest_thrust
from freqid.report.flight.trims import TrimCurve, effectors_with_equal_trims, trim_curves

LEVEL, UPRIGHT = {"dw1": 0.0, "dw2": 0.0}, {"dw1": pi / 2, "dw2": pi / 2}


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return scenario_of(Path("scenarios/la8.toml"))


def area(corners: np.ndarray) -> float:
    x, y = corners
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def arrows(axes: Axes) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return start and end of every arrow."""
    drawn = [text for text in axes.texts if isinstance(text, Annotation) and text.arrow_patch is not None]
    return [(np.array(arrow.xyann), np.array(arrow.xy)) for arrow in drawn]


def texts(figure: Figure) -> list[tuple[str, Axes, Bbox]]:
    """Return every text that is shown: itself, its axes and its box in pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    found = []
    for axes in figure.axes:
        shown = [*axes.texts, axes.xaxis.label, axes.yaxis.label, axes._left_title]  # type: ignore[attr-defined]
        shown += axes.get_legend().get_texts() if axes.get_legend() else []
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            shown += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        shown = [text for text in shown if text.get_visible() and text.get_text().strip()]
        found += [(text.get_text(), axes, text.get_window_extent(renderer)) for text in shown]
    return found


@pytest.mark.parametrize(("name", "chord"), [("front", 0.33), ("rear", 0.33)])
def test_a_level_wing_has_the_described_area_from_above_and_none_that_matters_upright(scenario, name, chord):
    (level,) = [p for p in outline(scenario, LEVEL) if p.kind == "wing" and p.name == name]
    (upright,) = [p for p in outline(scenario, UPRIGHT) if p.kind == "wing" and p.name == name]
    assert area(silhouette(level, TOP)) == pytest.approx(1.83 * chord, rel=1e-9)
    assert area(silhouette(upright, REAR)) == pytest.approx(1.83 * chord, rel=1e-9)
    assert area(silhouette(upright, TOP)) < 0.15 * 1.83 * chord


def test_discs_are_lines_from_their_edge_and_circles_along_their_shaft(scenario):
    for tilt, open_in, edge_in in ((LEVEL, REAR, TOP), (UPRIGHT, TOP, REAR)):
        discs = [p for p in outline(scenario, tilt) if p.kind == "rotor"]
        assert [d.name for d in discs] == [f"n{i}" for i in range(1, 9)]
        for disc in discs:
            assert area(silhouette(disc, open_in)) == pytest.approx(pi * 0.2032**2, rel=4e-3)
            line = silhouette(disc, edge_in)
            assert line.shape == (2, 2)
            assert np.ptp(line, axis=1).max() == pytest.approx(0.4064, rel=3e-3)


def test_hubs_turn_about_the_tilt_axis(scenario):
    vehicle = scenario.aircraft()
    for rotor, (x, z) in (("n1", (0.62, -0.20)), ("n8", (-0.62, -0.35))):
        described = next(r for r in vehicle.rotors if r.name == rotor)
        hub, ahead = tilted_shaft(vehicle, described, UPRIGHT)
        np.testing.assert_allclose(hub, [x, described.position_m[1], z], atol=1e-12)
        np.testing.assert_allclose(ahead, [0, 0, -1], atol=1e-12)


def test_the_centre_of_gravity_moves_with_the_wings(scenario):
    # Two wings of 4.5 kg, whose centres of gravity lie 0.06 m ahead of their tilt axes.
    moved = centre_of_gravity(scenario.aircraft(), UPRIGHT) - centre_of_gravity(scenario.aircraft(), LEVEL)
    np.testing.assert_allclose(moved, 9.0 / 28.6 * 0.06 * np.array([-1, 0, -1]), atol=1e-12)


def test_the_fuselage_has_its_volume(scenario):
    (body,) = [p for p in outline(scenario, LEVEL) if p.kind == "fuselage"]
    length, width = np.ptp(body.points[0]), np.ptp(body.points[2])
    assert pi / 6 * length * width**2 == pytest.approx(0.035, rel=0.08)


@pytest.mark.parametrize("tilt", [0.0, 0.384, 0.8727, 1.4923])
def test_every_effector_is_named_and_no_two_names_overlap(scenario, tilt):
    figure = three_view(scenario, {"dw1": tilt, "dw2": tilt})
    shown = texts(figure)
    said = " ".join(text for text, _, _ in shown)
    for effector in scenario.effector:
        assert effector.name in said
    for (first, one, a), (second, other, b) in combinations(shown, 2):
        assert not a.overlaps(b), f"{first} and {second}" + ("" if one is other else ", in two panels")
    whole = figure.bbox
    for text, _, box in shown:
        assert whole.contains(box.x0, box.y0), text
        assert whole.contains(box.x1, box.y1), text


def test_surfaces_are_drawn_where_the_scenario_places_them_without_an_airframe():
    own = read_scenario(Path("scenarios/tiltrotor.toml"))[0]
    parts = {p.name: p for p in outline(own, {}) if p.kind == "surface"}
    assert set(parts) == {"ail_l", "ail_r", "rv_l", "rv_r", "flap"}
    left, right = (parts[n].points for n in ("rv_l", "rv_r"))
    np.testing.assert_array_equal(left * [[1], [-1], [1]], right)  # mirrored
    rise = np.ptp(right[2]) / np.ptp(right[1])
    assert degrees(atan(rise)) == pytest.approx(40, abs=1)  # the V that the example flies leans by 0.70 rad
    assert np.ptp(right[0]) == pytest.approx(0.1)
    figure = three_view(own, {})
    assert {"rv_l", "rv_r", "flap"} <= {text for text, _, _ in texts(figure)}


def test_a_surface_on_a_tilting_wing_turns_with_it():
    elevon = Effector("ele", "surface", (-0.5, 0.5))
    place = Surface("ele", hinge_m=((-0.3, 0.0, 0.0), (-0.3, 1.0, 0.0)), chord_m=0.1, wing="w")
    tilt = Effector("nac", "tilt", (0.0, 1.6))
    body = Airframe("x", 1.0, Inertia(xx=1, yy=1, zz=1))
    wing = Wing("w", "nac", (0.0, 0.0, 0.0))
    made = Scenario(body, effector=(elevon, tilt), wing=(wing,), surface=(place,))
    (part,) = [p for p in outline(made, {"nac": pi / 2}) if p.name == "ele"]
    # A quarter turn with the nose up: what was behind the axis is below it.
    np.testing.assert_allclose(sorted(part.points[2]), [0.3, 0.3, 0.4, 0.4], atol=1e-12)
    np.testing.assert_allclose(part.points[0], 0, atol=1e-12)


@pytest.mark.parametrize(("tilt", "panel", "axes", "sense"), [(UPRIGHT, 0, TOP, 1), (LEVEL, 1, REAR, -1)])
def test_arrows_turn_with_the_rotors(scenario, tilt, panel, axes, sense):
    # Seen against its shaft a right-handed rotor turns anticlockwise, from behind clockwise.
    vehicle = scenario.aircraft()
    figure = three_view(scenario, tilt)
    drawn = arrows(figure.axes[panel])
    assert len(drawn) == 8
    for rotor in vehicle.rotors:
        hub = axes @ tilted_shaft(vehicle, rotor, tilt)[0]
        start, end = min(drawn, key=lambda ends: float(np.linalg.norm(ends[1] - hub)))
        (x, y), (dx, dy) = start - hub, end - start
        assert np.sign(x * dy - y * dx) == sense * rotor.spin


def curves(scenario: Scenario) -> list[TrimCurve]:
    u = np.array([0.0, 10.0, 20.0])
    made = []
    for rho, share in ((1.225, 1.0), (1.06, 1.1)):
        positions = {}
        for effector in scenario.effector:
            rear = effector.name in ("de3", "de4", "df3", "df4")
            shape = {"surface": np.array([0.0, 0.2, 0.1]), "tilt": np.array([1.5, 0.5, 0.1])}
            values = shape.get(effector.kind, share * np.array([700.0, 500.0, 600.0]))
            positions[effector.name] = -values if rear else values
        made.append(TrimCurve(rho, u, np.array([0.0, 0.01, 0.02]), positions, np.array([5e3, 2e3, 3e3])))
    return made


def test_effectors_that_move_alike_share_a_line(scenario):
    vehicle, made = scenario.aircraft(), curves(scenario)
    groups = effectors_with_equal_trims(vehicle, "surface", made)
    assert groups == [["de1", "de2"], ["de3", "de4"], ["df1", "df2"], ["df3", "df4"], ["dr1", "dr2"]]
    made[1].positions["n3"][1] += 20.0  # at one density only
    assert effectors_with_equal_trims(vehicle, "rotor", made) == [
        ["n1", "n2", "n4", "n5", "n6", "n7", "n8"],
        ["n3"],
    ]


def test_trim_curves_show_values_and_margins(scenario):
    figure = trim_curves(scenario.aircraft(), curves(scenario))
    panels = {axes.get_title(loc="left"): axes for axes in figure.axes}
    speed = panels["Rotor speed (rpm)"].lines[1]  # the thin air
    np.testing.assert_allclose(
        np.asarray(speed.get_ydata(), float), 1.1 * np.array([700, 500, 600]) * 30 / pi
    )
    assert speed.get_linestyle() != panels["Rotor speed (rpm)"].lines[0].get_linestyle()
    margin = next(
        line
        for line in panels["Smallest margin to a limit (% of the range)"].lines
        if line.get_label() == "rotor"
    )
    np.testing.assert_allclose(np.asarray(margin.get_ydata(), float), 100 * np.array([250, 450, 350]) / 950)
    np.testing.assert_allclose(
        np.asarray(panels["Electrical power (kW)"].lines[0].get_ydata(), float), [5, 2, 3]
    )
    for (first, one, a), (second, other, b) in combinations(texts(figure), 2):
        assert not a.overlaps(b), f"{first} and {second}, {one is other}"


def test_a_film_shows_the_aircraft_as_it_was(scenario):
    truth, thrust = film_record(scenario)
    figure = filmstrip(scenario, truth, thrust)
    frames = [axes for axes in figure.axes if not axes.get_xticks().size]
    assert len(frames) == FRAMES
    words = [text.get_text() for text in frames[-1].texts if text.get_text()]
    assert words == ["20.0 s\nu 20.0 m/s\ntilt 5.7°\npitch −2.9°"]
    # The largest sum over a wing, at the start, is one length; an arrow half as strong is half as long.
    assert largest_thrust(scenario.aircraft(), thrust) == pytest.approx(4 * 40.0)
    for frame, strength in ((frames[0], 1.0), (frames[-1], 0.5)):
        lengths = [np.linalg.norm(end - start) for start, end in arrows(frame)]
        np.testing.assert_allclose(lengths, 0.8 * strength, rtol=1e-9)
    # Nose up is up on paper: the last frame is 0.05 rad nose down at a tilt of 0.1 rad.
    direction = np.subtract(*reversed(arrows(frames[-1])[0]))
    assert np.arctan2(direction[1], direction[0]) == pytest.approx(0.1 - 0.05)
    assert np.allclose(SIDE @ [1, 0, 0], [1, 0])

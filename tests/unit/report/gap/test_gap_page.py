"""The page of a gap: what it must show of a made-up diagnosis, and what it leaves out where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_gap import made_up
from test_page import Page

from freqid.cli.gap_texts import diagnosis_text
from freqid.report.gap.figures import (
    before_after_frequency,
    before_after_time,
    heat_panels,
    increment_bars,
    residual_spectra,
)
from freqid.report.gap.page import build_gap_page
from freqid.report.kit.notation import sentence


@pytest.fixture(scope="module")
def page():
    return build_gap_page(made_up())


def test_the_verdict_comes_first_and_every_part_follows(page):
    order = [
        page.index(words)
        for words in (
            "A gap beyond noise.",
            "<h2>What counts as no gap",
            "<h2>Where",
            "<h2>Your sensors",
            "<h2>Which effect",
            "Not tested, so not ruled out",
            "<h2>How far the gap shrinks",
            "<h2>Residual spectra",
            "<h2>Derivative increments",
            "<h2>Provenance",
        )
    ]
    assert order == sorted(order)
    assert page.count("<svg") == 10  # three maps, two of effects, two of c, two spectra, increments
    assert page.count("<figcaption>") == 10


def test_numbers_stand_with_their_units_and_reasons(page):
    assert "0.450 (0.400 to 0.500)" in page
    assert "needs rotor, which is not there" in page
    assert "These data cannot separate mass, sensor_scale." in page
    assert "as flown it costs 3.0 deg" in page
    for label in ("Frequency (Hz)", "Time (s)", "Z (N)", "M (N m)", "Z (N/√Hz)", "Probability (%)"):
        assert label in page, label


def test_page_text_and_table_say_the_same(page):
    d = made_up().diagnosis
    text, table = diagnosis_text(d), d.to_json()
    both = (
        d.verdict,
        "the size of mass is at the end of what is physical",
        "onset=0.2",
        "0.75 (0.65 to 0.85)",  # the effect alone
        "0.30 (0.20 to 0.40)",  # tolerances alone
        "0.80 (0.70 to 0.90)",
        "+12.5 nats",
        "derivatives.Z.w",
        "sensor_bias",
        "lift_slope",
        "needs rotor, which is not there",
        "a remark",
    )
    for words in both:
        assert words in text, words
        assert words in page or sentence(words) in page, words
    assert table["verdict"] == d.verdict
    assert table["which"]["withdrawn"] == d.which.withdrawn
    assert table["how_far"]["tolerances_only"]["G"] == 0.3
    assert table["how_far"]["log_score"] == 12.5
    assert table["gap"]["form_errors"] == {"Z": 0.02}
    assert table["sensors"][0]["fault"] == "sensor_bias"
    assert {t["name"] for t in table["tolerances"]} == {"mass", "lift_slope"}


def test_where_there_is_no_gap_no_map_is_drawn():
    nothing = made_up(exists=False)
    nothing = replace(nothing, diagnosis=replace(nothing.diagnosis, where=(), how_far=()), before_after=())
    page = build_gap_page(nothing)
    assert "<h2>Where" not in page
    assert "<h2>How far" not in page
    assert page.count("<svg") == 5
    assert '<li id="finding-1" class="good">' in page


def test_the_map_shows_shares_in_per_cent_and_leaves_nothing_blank_that_matters():
    table = np.array([[[0.6, 0.004], [0.396, 0.0]]])
    (axes,) = heat_panels(["u10"], ["Z", "M"], ["low", "high"], table, 0.6, "Band").axes
    assert {t.get_text() for t in axes.texts} == {"60", "40"}
    assert [t.get_text() for t in axes.get_yticklabels()] == ["Z", "M"]


def test_the_stretch_that_is_drawn_is_where_the_effect_does_most():
    one = made_up().before_after[0]
    time = np.arange(600) / 10
    flat = np.zeros((2, 600))
    after = flat.copy()
    after[:, 400:500] = 1.0
    one = replace(one, time=time, measured=flat, before=flat, after=after)
    low, high = before_after_time(one, [0, 1]).axes[-1].get_xlim()
    assert high - low == pytest.approx(12.0, abs=0.2)
    assert low <= 40.0 <= 49.9 <= high


def test_clear_increments_set_the_scale():
    increments = made_up().increments
    (axes,) = increment_bars(increments).axes
    assert [t.get_text() for t in axes.get_yticklabels()] == ["M by de", "Z by w"]
    assert axes.get_xlim()[1] > 28


def test_a_number_fits_its_cell_however_many_columns_there_are():
    columns = [f"n{k}" for k in range(19)]
    figure = heat_panels(["all"], ["Z"], columns, np.full((1, 1, 19), 1.0), 1.0, "Signal")
    figure.canvas.draw()
    (axes,) = figure.axes
    cell = axes.transData.transform([[0, 0], [1, 0]])
    for text in axes.texts:
        assert text.get_text() == "100"
        assert text.get_window_extent().width < cell[1, 0] - cell[0, 0]


def steady():
    """Return the made-up diagnosis with a gap of 40 N in the mean, 39 of which go, and nothing else."""
    found = made_up()
    one = found.before_after[0]
    still = np.zeros_like(one.measured)
    offset = np.array([[40.0], [0.0]])
    rest = np.zeros_like(one.before_hz)
    rest[0, 0] = -126.5
    spectra = tuple(replace(s, explained=rest, residual=rest, noise=0 * s.noise + 1.0) for s in found.spectra)
    one = replace(one, measured=still - offset, before=still, after=still - 39.0 / 40.0 * offset)
    one = replace(
        one, measured_hz=rest, before_hz=0 * rest, after_hz=rest * 39.0 / 40.0, noise=0 * one.noise + 1
    )
    held = np.zeros_like(found.cells.detectability)
    held[0, 0, :, 1] = 1.0
    cells = replace(found.cells, detectability=held)
    return replace(found, spectra=spectra, before_after=(one,), cells=cells)


def test_a_gap_in_the_mean_stands_beside_an_rmse_that_leaves_it_out():
    found = steady()
    changes = found.mean_errors()
    assert (changes["Z"].before, changes["Z"].after, changes["M"].before) == pytest.approx((40.0, 1.0, 0.0))
    assert found.share_at_rest() == pytest.approx(1.0)
    page = build_gap_page(found)
    assert "Of what is explained here, 100 % lies at zero frequency." in page
    assert "RMSE, in the response's unit: of what changes in time up to 1.9 Hz, the mean left out" in page
    cells = next(t for t in Page(page).cells if any(c[0] == "Mean off before" for c in t[0]))
    row = dict(zip([c[0] for c in cells[0]][:6], [c[0] for c in cells[1]][:6], strict=True))
    assert row["Mean off before"] == "40.0"
    assert cells[1][5][0] == "1.00"
    assert "Mean of measured less simulated: Z −40.0 before and −1.00 after (N)" in page


def test_the_mean_is_drawn_at_zero_beside_a_logarithmic_axis():
    found = steady()
    for figure in (
        residual_spectra(found.spectra[0], [0]),
        before_after_frequency(found.before_after[0], [0]),
    ):
        (axes,) = figure.axes
        figure.canvas.draw()
        labels = {t.get_text(): x for x, t in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)}
        left, right = axes.get_xlim()
        assert left < labels["0"] < found.spectra[0].hz[1] < right
        highest = max((y, x) for line in axes.lines for x, y in zip(*line.get_data(), strict=True) if y > 1)
        assert highest == (126.5, labels["0"])
        assert axes.get_ylim()[1] > 126.5


def test_no_signal_is_named_or_drawn_for_a_gap_that_none_drives():
    found = steady()
    (place,) = found.cells.places()
    assert (place.response, place.input) == ("Z", "")
    page = build_gap_page(found)
    assert 'id="figure-map-input"' not in page
    assert "all driven lines together hold 0 % of what is detectable" in page
    held = found.cells.detectability.copy()
    held[0, 0, :, 0] = 0.2  # 17 % on the lines of de
    places = replace(found.cells, detectability=held).places()
    assert [(p.response, p.input) for p in places] == [("Z", ""), ("Z", "de")]

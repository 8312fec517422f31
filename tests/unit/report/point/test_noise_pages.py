"""What noise does to a point model, on its page: both estimates, what noise allows, the sensors' account."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from test_page import Page

from freqid.core.results.point import ErrorsInVariables, PointModel
from freqid.report.kit import figures
from freqid.report.point.page import build_page, difference_table
from freqid.report.point.sensor_tables import longest_cut, sensor_accounts, sensor_findings
from freqid.report.point.tables import fit_summary
from freqid.report.point.verdict import noise_findings


def by_instruments(model: PointModel, off: dict[str, float]) -> PointModel:
    """Return the model with least squares beside it, `off` standard errors below in the first parameter."""
    responses = {}
    for name, response in model.responses.items():
        away = np.zeros(4)
        away[0] = off.get(name, 0.0)
        beside = ErrorsInVariables(
            estimate=response.estimate - away * response.std_error,
            std_error=0.9 * response.std_error,
            difference_std_error=0.5 * response.std_error,
            critical=np.full(4, 2.6),
            strength=np.array([40.0, 900.0, 5000.0, 12.5]),
        )
        responses[name] = replace(response, errors_in_variables=beside)
    return replace(model, responses=responses, estimator="instruments")


def with_noise(model: PointModel, name: str, r2: float, ceiling: float, distortion: float) -> PointModel:
    """Return the model with a level of noise on its lines that makes the ceiling."""
    fit = model[name].fit["frequency"]
    level = np.sqrt((1 - ceiling) * np.mean(np.abs(fit.measured) ** 2))
    fits = {"frequency": replace(fit, noise=np.full(fit.axis.size, level)), "time": model[name].fit["time"]}
    changed = replace(model[name], fit=fits, r2=r2, r2_ceiling=ceiling, distortion=distortion)
    return replace(model, responses={**model.responses, name: changed})


def said(findings) -> list[tuple[str, str]]:
    return [(finding.kind, finding.text.striptags()) for finding in findings]


def test_least_squares_alone_is_said_to_be_so(model):
    assert said(noise_findings(model)) == [
        ("note", "Estimates are by least squares alone, which noise in the regressors biases.")
    ]


def test_estimates_that_differ_are_named_and_the_farthest_is_measured(model):
    sentences = said(noise_findings(by_instruments(model, {"Y": 3.0, "N": -1.5})))
    assert sentences[0] == (
        "note",
        "Estimates are by instruments. Noise in the regressors biases least squares: 2 of 12 parameters "
        "differ beyond noise (CY: beta; Cn: beta). The farthest is beta of CY, by 3.0 of its standard "
        "errors.",
    )
    assert sentences[1] == (
        "good",
        "The injected signals move every regressor: first-stage F is at least 12.5 (dr), 10 is enough.",
    )
    agreed = said(noise_findings(by_instruments(model, {"Y": 1.2})))  # 2.4 of the difference, 2.6 is critical
    assert agreed[0] == ("good", "Least squares and instruments agree within noise in all 12 parameters.")


def test_the_table_holds_differences_and_marks_those_beyond_noise(model):
    table = difference_table(by_instruments(model, {"Y": 3.0, "N": -1.5}))
    assert table is not None
    assert [row["name"] for row in table["rows"]] == ["beta", "p", "da", "dr"]
    beta = table["rows"][0]
    assert [re.sub("<.*?>", "", str(cell["text"])) for cell in beta["cells"]] == ["6.0", "0.0", "−3.0"]
    assert [cell["far"] for cell in beta["cells"]] == [True, False, True]
    assert not any(cell["far"] for row in table["rows"][1:] for cell in row["cells"])
    both = table["estimates"][0]["rows"][0]
    assert float(re.findall('value="(.*?)"', both["other"])[0]) == pytest.approx(
        model["Y"].estimate[0] - 3 * model["Y"].std_error[0]
    )
    assert difference_table(model) is None


def test_responses_with_regressors_of_their_own_leave_dashes(model):
    response = by_instruments(model, {})["L"]
    beside = response.errors_in_variables
    assert beside is not None
    first = slice(0, 1)
    fields = ("estimate", "std_error", "difference_std_error", "critical", "strength")
    alone = replace(
        response,
        regressors=("phat",),
        regressor_units=("1",),
        estimate=response.estimate[first],
        std_error=response.std_error[first],
        errors_in_variables=ErrorsInVariables(**{f: getattr(beside, f)[first] for f in fields}),
    )
    mixed = by_instruments(model, {})
    table = difference_table(replace(mixed, responses={**mixed.responses, "L": alone}))
    assert table is not None
    assert [row["name"] for row in table["rows"]] == ["beta", "p", "da", "dr", "phat"]
    assert table["rows"][-1]["cells"][0]["text"] == "–"
    assert table["rows"][0]["cells"][1]["text"] == "–"


def test_r2_is_held_against_what_noise_allows(model):
    near = with_noise(model, "N", r2=0.955, ceiling=0.97, distortion=1.2)
    assert (
        "good",
        "R² reaches what noise allows in every response, but for 0.02 or chance; the least is 0.970 in Cn.",
    ) in said(noise_findings(near))
    far = with_noise(model, "N", r2=0.90, ceiling=0.97, distortion=3.25)
    sentences = said(noise_findings(far))
    assert (
        "note",
        "R² falls short of what noise allows by more than 0.02 and more than by chance in Cn "
        "(0.900 of 0.970).",
    ) in sentences
    assert any("in Cn (3.25 times)" in text for _, text in sentences)
    # 48 lines of level noise: 1 - R2 scatters by sqrt(2 / 48) of itself
    assert with_noise(model, "N", r2=0.36, ceiling=0.5, distortion=1.3)["N"].reaches_ceiling
    assert not with_noise(model, "N", r2=0.25, ceiling=0.5, distortion=1.5)["N"].reaches_ceiling
    assert not model["N"].reaches_ceiling


def test_the_summary_has_the_columns_that_the_model_can_fill(model):
    assert (fit_summary(model, None)["with_noise"], fit_summary(model, None)["both"]) == (False, False)
    full = fit_summary(with_noise(by_instruments(model, {"N": 3.0}), "N", 0.96, 0.97, 1.2), None)
    assert (full["with_noise"], full["both"]) == (True, True)
    assert [row["differing"] for row in full["rows"]] == ["0 of 4", "0 of 4", "1 of 4"]
    assert [row["ceiling"] for row in full["rows"]][:2] == ["–", "–"]


def test_the_noise_on_the_lines_is_drawn(model):
    fit = with_noise(model, "N", 0.96, 0.97, 1.2)["N"].fit["frequency"]
    lines = {line.get_label(): line for line in figures.fit_over_frequency(fit, "N", "1").axes[0].lines}
    np.testing.assert_array_equal(lines["noise"].get_ydata(), fit.noise)
    bars = figures.parameter_bars(["a", "b"], np.ones(2), np.ones(2), "N", np.array([0.5, 2.0]))
    rings = [line for line in bars.axes[0].lines if line.get_label() == "least squares"]
    assert np.asarray(rings[0].get_xdata()).tolist() == [0.5, 2.0]


KINEMATICS = {
    "flight.h5": {
        "corrected": True,
        "errors": {
            "ax bias": {"estimate": 0.31, "std_error": 0.02, "units": "m/s2"},
            "alpha delay": {"estimate": 0.05, "std_error": 0.03, "units": "s"},
            "u delay": {"estimate": -0.07, "std_error": 0.03, "units": "s"},
            "wind east": {"estimate": 3.0, "std_error": 0.1, "units": "m/s"},
        },
        "undetermined": {"V scale": ["wind east", "V bias"]},
    }
}


def test_the_sensors_account_is_told(model):
    checked = replace(model, provenance={"kinematics": KINEMATICS})
    assert said(sensor_findings(checked)) == [
        (
            "note",
            "Kinematics find errors of the sensors beyond 3 standard errors, corrected before modelling: "
            "ax bias.",
        )
    ]
    page = Page(build_page(replace(checked, prediction={})))
    (table,) = [t for t in page.cells if t[0][0][0] == "Sensor error" and len(t[0]) == 5]
    assert [row[0][0] for row in table[1:]] == ["ax bias", "alpha delay", "u delay", "wind east"]
    assert table[1][1][1] == 0.31
    (untold,) = [t for t in page.cells if t[0][0][0] == "Sensor error" and len(t[0]) == 2]
    assert [text for text, _ in untold[1]] == ["V scale", "wind east, V bias"]
    left = {"flight.h5": {**KINEMATICS["flight.h5"], "corrected": False}}
    assert sensor_findings(replace(model, provenance={"kinematics": left}))[0].kind == "bad"
    assert sensor_findings(replace(model, provenance={"kinematics": "elsewhere"})) == []


def test_a_record_shortened_by_the_correction_is_still_drawn(model, record):
    checked = replace(model, responses={"N": model["N"]}, prediction={})
    checked = replace(checked, provenance={"kinematics": KINEMATICS}, duration=record.duration - 0.12)
    assert longest_cut(sensor_accounts(checked)["flight.h5"].errors) == pytest.approx(0.12)
    assert 'id="data"' in build_page(checked, record)


def test_remarks_and_every_manoeuvre_are_shown(model):
    response = model["N"]
    fits = {**response.fit, "frequency 2": response.fit["frequency"], "time 2": response.fit["time"]}
    two = replace(
        model, responses={"N": replace(response, fit=fits)}, prediction={}, remarks=("reference 'x' is off.",)
    )
    text = build_page(two)
    page = Page(text)
    assert page.faults == []
    labels = [figure["aria-label"] for figure in page.all("svg")]
    assert sum("of manoeuvre 2" in (label or "") for label in labels) == 2
    assert "Reference &#39;x&#39; is off." in text
    assert "2 manoeuvres of 40 and 40 s" in text


def test_the_page_of_a_model_by_instruments_is_well_formed(model):
    text = build_page(with_noise(by_instruments(model, {"Y": 3.0}), "N", 0.96, 0.97, 1.2))
    page = Page(text)
    assert page.faults == []
    assert page.open == []
    links = {a["href"] for a in page.all("a")}
    assert "#noise" in links
    assert links <= {f"#{a['id']}" for _, a in page.elements if "id" in a}

"""``identify-point --method output-error|filter-error`` as a user runs it, and the same from Python."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import freqid as fq
from freqid.core.results.point import read_point

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
SCENARIO, MAP = SCENARIOS / "linear.toml", SCENARIOS / "maps" / "linear.toml"


def options(point: Path) -> list[object]:
    return ["--scenario", SCENARIO, "--method", "output-error", "-o", point, "--json"]


@pytest.fixture(scope="module")
def record(linear_logs, tmp_path_factory):
    path = tmp_path_factory.mktemp("output_error") / "flight.h5"
    fq.save(fq.read_log(linear_logs["noisy"], columns=MAP, scenario=SCENARIO, at="u20"), path)
    return path


def test_a_point_model_by_output_error_is_nearer_than_equation_error(
    freqid, record, tmp_path, linear_aircraft
):
    truth = linear_aircraft.DERIVATIVES["M"]
    point = tmp_path / "point.h5"
    code, out, err = freqid("identify-point", record, *options(point), "--responses", "X,Z,M")
    assert code == 0, err
    said = json.loads(out)
    assert (said["method"], said["estimator"]) == ("output-error", "maximum-likelihood")
    account = said["output_error"]["longitudinal"]
    assert account["converged"]
    assert set(account["whiteness"]) == {"u", "w", "q", "theta", "ax", "az"}
    model = read_point(point)
    assert model.provenance["output_error"]["longitudinal"]["steps"] == account["steps"]
    plain = fq.identify_point(record, SCENARIO, responses=("X", "Z", "M"))
    for name in ("w", "de"):
        assert abs(model["M"][name][0] - truth[name]) < abs(plain["M"][name][0] - truth[name])
        assert abs(model["M"][name][0] - truth[name]) < 4 * model["M"][name][1]
    assert model["M"].r2 > 0.8
    assert [remark for remark in model.remarks if "not white" in remark]
    assert "warning: residuals of" in err
    page = tmp_path / "page.html"
    code, _, err = freqid("report", point, "--scenario", SCENARIO, "-o", page)
    assert code == 0, err
    assert "output error, time domain" in page.read_text()


def test_all_six_responses_are_two_models(freqid, record, tmp_path):
    point = tmp_path / "point.h5"
    code, out, err = freqid("identify-point", record, *options(point), "--form", "specific")
    assert code == 0, err
    said = json.loads(out)
    assert list(said["responses"]) == ["X", "Y", "Z", "L", "M", "N"]
    assert set(said["output_error"]) == {"longitudinal", "lateral"}


def test_options_that_do_not_fit_are_one_sentence(freqid, record):
    options = ["identify-point", record, "--scenario", SCENARIO, "--method", "output-error"]
    for more, words in (
        (["--align", "fit"], "--align fit came with method 'output-error'"),
        (["--select"], "structure is 'stepwise' with method 'output-error'"),
        (["--responses", "L,N"], "no ready model has the responses L N"),
        (["--axes", "stability"], "output error is for body axes"),
    ):
        code, _, err = freqid(*options, *more)
        assert code == 2, err
        assert words in err
        assert len(err.strip().splitlines()) == 1


def test_the_same_from_python_is_saved_and_read_again(record, tmp_path):
    found = fq.identify_output_error(
        record, SCENARIO, responses=("Z", "M"), regressors=("w", "q", "de"), fixed={"Z_q": -12.0}
    )
    assert found.model == "short period"
    assert found.point is not None
    assert found.point["Z"]["q"] == (-12.0, 0.0)
    assert found.units[found.names.index("M_de")] == "N m/rad"
    path = fq.save(found, tmp_path / "found.h5")
    again = fq.read(path)
    assert again.names == found.names
    np.testing.assert_array_equal(again.estimate, found.estimate)
    assert again.remarks == found.remarks
    assert again.whiteness == pytest.approx(found.whiteness)
    np.testing.assert_array_equal(again.fit["q"].modelled, found.fit["q"].modelled)
    assert len(found.to_frame()) == len(found.names)
    assert found.plot().axes
    assert "<table" in found._repr_html_()


def test_lines_come_from_the_scenario(record):
    found = fq.identify_output_error(record, SCENARIO, responses=("Y", "L", "N"), domain="frequency")
    assert found.domain == "frequency"
    assert found.converged
    axis = found.fit["p"].axis
    assert (axis[0], axis[-1]) == pytest.approx((0.05, 1.8), abs=0.01)
    assert found["L_p"][0] == pytest.approx(-16.0, abs=4 * found["L_p"][1])

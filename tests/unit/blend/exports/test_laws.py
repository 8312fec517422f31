"""An advance-ratio model as Python file, JSON, MATLAB and table."""

import csv
import json
import runpy
import sys

import numpy as np
import pytest
from blown_campaign import campaign
from scipy.io import loadmat

import freqid as fq
from freqid.blend.exports.python_file import write_python
from freqid.blend.semi_local.parametric import global_model


@pytest.fixture(scope="module")
def model():
    return global_model(campaign(3), vehicle="blown")


def test_the_python_file_has_the_laws(model, tmp_path, capsys, monkeypatch):
    path = tmp_path / "blown.py"
    write_python(path, model, "0")
    module = runpy.run_path(str(path))
    assert module["self_check"]()
    assert "good" in capsys.readouterr().out
    for alpha in (0.03, 0.12):
        for j in (0.4, 0.83, 3.0, np.inf):
            expected = model.derivatives(j, alpha)
            assert module["derivatives"](j, alpha) == pytest.approx(expected, rel=1e-12)
            errors = {n: float(law.std_error_at(j)) for n, law in model.cluster_at(alpha).laws.items()}
            assert module["standard_error"](j, alpha) == pytest.approx(errors, rel=0.02)
    assert module["derivatives"](0.1, 0.03) == pytest.approx(model.derivatives(0.1, 0.03, outside="hold"))
    assert module["outside"](0.1, 0.03) == list(model.names)
    assert module["outside"](0.5, 0.03) == []
    monkeypatch.setattr(sys, "argv", ["blown.py"])
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(path), run_name="__main__")
    assert left.value.code == 0


def test_tables_hold_estimates_and_laws_at_the_same_places(model, tmp_path):
    done = fq.export(model, tmp_path / "b.csv", "csv")
    assert (done.kind, done.table_errors) == ("an advance-ratio model", {})
    with (tmp_path / "b.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert len(table) == 4 * 2 * 15  # four derivatives, two clusters of 14 manoeuvres and the unblown limit
    cluster = model.clusters[0]
    row = next(r for r in table if (r["condition"], r["derivative"]) == (cluster.local.ids[3], "Cm.de"))
    j = float(row["advance_ratio"])
    assert float(row["estimate"]) == cluster.local.estimate[3, 3]
    assert float(row["law_value"]) == cluster["Cm.de"].value(j)
    limit = next(r for r in table if r["condition"] == "unblown limit" and r["derivative"] == "Cm.de")
    assert (limit["advance_ratio"], limit["estimate"]) == ("inf", "")
    assert float(limit["law_value"]) == cluster["Cm.de"].unblown


def test_json_and_matlab_hold_the_laws(model, tmp_path):
    fq.export(model, tmp_path / "b.json", "json")
    fq.export(model, tmp_path / "b.mat", "mat")
    found = json.loads((tmp_path / "b.json").read_text(), parse_constant=pytest.fail)
    matlab = loadmat(tmp_path / "b.mat", simplify_cells=True)["model"]
    for k, cluster in enumerate(model.clusters):
        assert found["clusters"][k]["manoeuvres"]["advance_ratio"].count("inf") == 2  # stopped propellers
        for i, law in enumerate(cluster.laws.values()):
            for one in (found["clusters"][k]["laws"][i], matlab["clusters"][k]["laws"][i]):
                assert one["unblown"] == law.unblown
                np.testing.assert_array_equal(np.atleast_1d(one["rate"]), law.rate)


@pytest.mark.parametrize("to", ["daveml", "jsbsim", "sidpac"])
def test_what_needs_a_wrench_refuses_laws(model, tmp_path, to):
    with pytest.raises(
        fq.FreqidError, match=f"an advance-ratio model cannot be exported to {to}, which takes"
    ):
        fq.export(model, tmp_path / "x", to)

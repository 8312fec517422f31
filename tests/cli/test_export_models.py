"""``freqid export`` as a user meets it: every format, what it prints, and one sentence for each mistake."""

import json
import subprocess
import sys

import exported
import numpy as np
import pytest
import tilt_wing

import freqid as fq
from freqid.cli.main import COMMANDS
from freqid.core.results.design import SampledInputs
from freqid.workflows.export import FORMATS, TAKES

SCENARIO = """
[vehicle]
name = "{name}"
mass_kg = 28.6
inertia = {{ xx = 3.1, yy = 6.6, zz = 9.2 }}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "points").mkdir()
    fq.save(exported.point(), tmp_path / "points" / "u9.h5")
    fq.save(exported.one_line(), tmp_path / "model.h5")
    fq.save(tilt_wing.fly(tilt_wing.trim(9.0, 1.225), seed=1, duration=2.0).record, tmp_path / "flight.h5")
    (tmp_path / "craft.toml").write_text(SCENARIO.format(name="tilt-wing"))
    (tmp_path / "other.toml").write_text(SCENARIO.format(name="kite"))
    return tmp_path


def test_the_command_knows_all_formats():
    import freqid.cli.export as command

    assert command.FORMATS == FORMATS == tuple(TAKES)
    assert "export" in COMMANDS
    assert "export-log" not in COMMANDS


def test_every_format_of_a_global_model(freqid, folder):
    endings = {"mat": ".mat", "csv": ".csv", "json": ".json", "daveml": ".dml", "python": ".py"}
    for to, ending in endings.items():
        code, out, err = freqid("export", folder / "model.h5", "--to", to)
        assert (code, err) == (0, "")
        assert out.startswith(f"{folder / 'model'}{ending}: a global model as {to}\n")
        assert (folder / f"model{ending}").stat().st_size > 1000
        assert ("tables are off by at most X 0.0" in out) == (to == "daveml")
    options = ["--scenario", folder / "craft.toml", "-o", folder / "craft", "--table-error", "1e-2", "--json"]
    code, out, err = freqid("export", folder / "model.h5", "--to", "jsbsim", *options)
    assert (code, err) == (0, "")
    written = json.loads(out)
    assert [p.rpartition("/")[2] for p in written["paths"]] == [
        "craft.xml",
        "craft-aerodynamics.xml",
        "start.xml",
    ]
    assert written["table_errors"]["Z"]["unit"] == "N"
    done = subprocess.run([sys.executable, folder / "model.py"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_study_is_exported_whole(freqid, folder):
    code, out, err = freqid("export", folder, "--to", "csv", "-o", folder / "tables")
    assert (code, err) == (0, "")
    assert "1 point models and a global model as csv" in out
    assert sorted(p.name for p in (folder / "tables").iterdir()) == ["model.csv", "points.csv"]
    code, _, err = freqid("export", folder, "--to", "json", "-o", folder / "json")
    assert (code, err) == (0, "")
    assert json.loads((folder / "json" / "points" / "u9.json").read_text())["condition"]["id"] == "u9"
    code, _, err = freqid("export", folder / "tables", "--to", "csv", "-o", folder / "none")
    assert (code, "holds no points/*.h5 and no model.h5" in err) == (2, True)
    code, _, err = freqid("export", folder, "--to", "csv", "-o", folder / "tables")
    assert (code, "tables: is not empty; change -o, or give --overwrite." in err) == (2, True)


def test_several_points_make_one_table_and_nothing_else(freqid, folder):
    both = [folder / "points" / "u9.h5", folder / "model.h5"]
    code, out, _ = freqid("export", *both, "--to", "csv", "-o", folder / "both.csv")
    assert (code, "2 models as csv" in out) == (0, True)
    code, _, err = freqid("export", *both, "--to", "json", "-o", folder / "both.json")
    assert (code, "2 results are given, and only models as csv share a file" in err) == (2, True)


CRAFT = ["model.h5", "--to", "jsbsim", "--scenario"]
MISTAKES = [
    (["model.h5", "--to", "xlsx"], 2, "'xlsx' is not one of 'mat', 'csv'"),
    (
        ["flight.h5", "--to", "daveml"],
        2,
        "flight.h5: a record cannot be exported to daveml, which takes",
    ),
    (["flight.h5", "--to", "json"], 2, "use mat, csv, sidpac."),
    (["model.h5", "--to", "sidpac"], 2, "a global model cannot be exported to sidpac, which takes a record;"),
    (
        ["model.h5", "--to", "jsbsim"],
        2,
        "needs mass and inertia, which the model does not have; give the",
    ),
    (
        [*CRAFT, "other.toml"],
        2,
        "describes 'kite', the model is of 'tilt-wing'",
    ),
    (["model.h5", "--to", "json", "-o", "flight.h5"], 2, "flight.h5: is there already; change -o, or give"),
    (["model.h5", "--to", "json", "-o", "model.h5", "--overwrite"], 2, "would replace its own input"),
    (["model.h5", "--to", "json", "-o", "points"], 2, "points: is a folder, expected the name of a file"),
    (
        [*CRAFT, "craft.toml", "-o", "points"],
        2,
        "points: the folder is not empty",
    ),
    (
        [*CRAFT, "craft.toml", "-o", "flight.h5"],
        2,
        "aircraft is a folder",
    ),
    (
        ["points/u9.h5", "--to", "daveml", "--table-error", "1e-3"],
        2,
        "is for a global model as daveml",
    ),
    (["model.h5", "--to", "daveml", "--table-error", "7"], 2, "a table error of 7 is asked for; ask for"),
    (["model.h5", "--to", "daveml", "--table-error", "0"], 2, "a table error of 0 is asked for; ask for"),
    (["model.h5", "--to", "csv", "--scenario", "craft.toml"], 2, "csv takes nothing from a scenario"),
    (["gone.h5", "--to", "csv"], 3, "gone.h5"),
]


@pytest.mark.parametrize(("words", "code", "said"), MISTAKES, ids=[" ".join(m[0]) for m in MISTAKES])
def test_a_mistake_is_one_sentence(freqid, folder, monkeypatch, words, code, said):
    monkeypatch.chdir(folder)
    before = sorted(folder.rglob("*"))
    found, out, err = freqid("export", *words)
    assert (found, out) == (code, "")
    assert said in err
    assert sorted(folder.rglob("*")) == before


def test_existing_files_are_replaced_when_that_is_asked_for(freqid, folder):
    target = folder / "points.csv"
    target.write_text("old")
    code, _, _ = freqid("export", folder / "points" / "u9.h5", "--to", "csv", "-o", target, "--overwrite")
    assert code == 0
    assert target.read_text().startswith("condition,u,rho,dw1,dw2,response,parameter,unit,estimate")


def test_what_is_no_model_is_refused(tmp_path):
    inputs = SampledInputs(np.arange(3.0), ("de",), ("rad",), np.zeros((1, 3)))
    with pytest.raises(fq.FreqidError, match="a SampledInputs cannot be exported; give a model or a record"):
        fq.export(inputs, tmp_path / "x.csv", "csv")
    with pytest.raises(fq.FreqidError, match="there is no format 'exel'; known names are: csv"):
        fq.export(exported.point(), tmp_path / "x", "exel")

"""``freqid study``: the whole chain at two conditions, its files, and going on where it stopped."""

import json
from pathlib import Path

import pytest

import freqid as fq
from freqid.blend.global_model import GlobalModel
from freqid.core.results.corridor import read_global
from freqid.core.results.design import read_design
from freqid.core.results.point import read_point
from freqid.workflows.studies import study as studies
from freqid.workflows.studies import units

LA8 = Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml"
LINEAR = LA8.with_name("linear.toml")


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    """The LA-8 class aircraft with a quick design: what is studied here is the chain."""
    path = tmp_path_factory.mktemp("scenario") / "quick.toml"
    text = LA8.read_text().replace('allocation = "propulsors-low"', 'allocation = "interleaved"\nstarts = 1')
    text = text.replace("net_load = { X = 1, Y = 1, Z = 1, L = 1, M = 1, N = 1 }", "")
    path.write_text(text)
    return path


def test_a_study_leaves_models_and_a_page_and_is_not_done_twice(freqid, scenario, tmp_path):
    folder = tmp_path / "study"
    options = ["--at", "u40,u45,u50", "--hold-out", "u45", "--jobs", "1", "--json", "-o", folder]
    code, out, _ = freqid("study", scenario, *options)
    assert code == 0
    said = json.loads(out)
    assert set(said["points"]) == {"u40", "u45", "u50"}
    for figures in said["points"].values():
        assert figures["L"]["r2"] > 0.99
        assert figures["M"]["r2"] > 0.98
    held_out = said["held_out"]["u45"]
    assert all(held_out["global_rmse"][r] < 1.5 * held_out["point_rmse"][r] for r in "XYZLMN")
    point = read_point(folder / "points" / "u40.h5")
    assert (point.estimator, point.reference.id) == ("instruments", "u40")
    assert GlobalModel(read_global(folder / "model.h5")).names == ("X", "Y", "Z", "L", "M", "N")
    page = (folder / "index.html").read_text()
    assert "<svg" in page
    assert "u45" in page
    assert "<dt>held out</dt>" in page

    def made(folder):
        units = folder / "units"
        return {path.relative_to(units): path.stat().st_mtime_ns for path in units.rglob("*.h5")}

    before = made(folder)
    assert len(before) == 2 + 6 + 3
    moved = tmp_path / "moved" / "study"  # the folder and the scenario lie elsewhere now
    moved.parent.mkdir()
    folder.rename(moved)
    (tmp_path / "moved" / "other.toml").write_bytes(scenario.read_bytes())
    code, out, _ = freqid("study", tmp_path / "moved" / "other.toml", *options[:-1], moved, "--no-page")
    assert code == 0
    assert json.loads(out) == said | {"folder": str(moved)}
    assert made(moved) == before


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--at", "u40"], "two conditions or more, 1 is left"),
        (["--at", "u40,u50", "--hold-out", "u50"], "two conditions or more, 1 is left"),
        (["--at", "u40,u41"], "no reference 'u41'"),
        (["--at", "u40,u50", "--sensors", "reserch"], "no sensor suite 'reserch'"),
    ],
)
def test_what_cannot_be_studied_is_said_before_anything_is_flown(freqid, scenario, tmp_path, options, said):
    code, _, err = freqid("study", scenario, *options, "-o", tmp_path / "study")
    assert code == 2
    assert said in err
    assert not (tmp_path / "study" / "units").exists()


def test_each_condition_is_designed_for_and_flown_by_what_is_stated_for_it(monkeypatch, tmp_path):
    text = LINEAR.read_text() + '\n[[reference]]\nid = "u24"\nu = 24.0\nrho = 1.2\n'
    text += "[excitation.at.u24]\nperiod_s = 40.0\n"
    (tmp_path / "two.toml").write_text(text)
    asked = {}

    class Enough(Exception):
        pass

    def run(campaign, unit, inputs, suffix):
        asked[unit.__name__] = inputs
        if unit is units.identify:
            raise Enough
        paths = [tmp_path / f"{unit.__name__}-{i}.h5" for i in range(len(inputs))]
        for path, one in zip(paths, inputs, strict=True):
            if unit is units.design:
                units.design(path, scenario=str(tmp_path / "two.toml"), **one)
        return paths

    monkeypatch.setattr(studies, "_run", run)
    with pytest.raises(Enough):
        fq.study(tmp_path / "two.toml", tmp_path / "out", at=("u20", "u24"))
    assert [(one["seed"], one.get("at", "")) for one in asked["design"]] == [
        (0, ""),
        (0, "u24"),
        (1, ""),
        (1, "u24"),
    ]
    flown = {(Path(one["design"]).stem, one["reference"]) for one in asked["fly"]}
    assert flown == {("design-0", "u20"), ("design-1", "u24"), ("design-2", "u20"), ("design-3", "u24")}
    assert read_design(tmp_path / "out" / "design-u24.h5").period_s == 40.0
    assert read_design(tmp_path / "out" / "design.h5").period_s != 40.0

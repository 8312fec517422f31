"""``freqid global-blend --by advance-ratio`` from point files to the model's file, and its errors."""

import json
from dataclasses import replace

import numpy as np
import pytest
from blown_campaign import campaign, point_models, truth
from click.testing import CliRunner

import freqid as fq
from freqid.cli.main import _exit_code, main
from freqid.core.results.point import write_point


@pytest.fixture(scope="module")
def points(tmp_path_factory):
    folder = tmp_path_factory.mktemp("points")
    paths = []
    for model in point_models(campaign(4, alphas=(0.05,))):
        paths.append(folder / f"{model.reference.id}.h5")
        write_point(paths[-1], model)
    return paths


def run(*arguments):
    words = ["global-blend", "--no-page", *map(str, arguments)]
    return CliRunner().invoke(main, words, standalone_mode=False)


def test_laws_are_printed_and_saved(points, tmp_path):
    target = tmp_path / "laws.h5"
    done = run(*points, "--by", "advance-ratio", "-o", target, "--json")
    assert done.exception is None
    said = json.loads(done.output)
    law = said["clusters"][0]["laws"]["Cm.de"]
    assert law["form"] != "mean"
    assert law["unblown"]["lower"] < -1.1 < law["unblown"]["upper"]
    assert not law["unblown"]["extrapolated"]
    assert abs(sum(f["probability"] for f in law["forms"].values()) - 1) < 1e-9
    read = fq.read(target)
    for j in (0.4, 0.8, np.inf):
        assert read.derivatives(j, 0.05)["Cm.de"] == pytest.approx(truth(j, 0.05)[3], rel=0.03)
    again = tmp_path / "again.h5"
    fq.save(read, again)
    np.testing.assert_array_equal(fq.read(again).clusters[0]["Cm.0"].draws, read.clusters[0]["Cm.0"].draws)


def test_a_semi_local_model_holds_what_it_is_told_and_models_are_judged(points, tmp_path):
    target = tmp_path / "semi.h5"
    options = ["--by", "advance-ratio", "--kind", "semi-local", "--hold", "Cm.0"]
    done = run(*points[1:], *options, "--held-out", points[0], "-o", target)
    assert done.exception is None
    assert "misfit of 1 held-out manoeuvres" in done.output
    assert " held" in done.output
    assert fq.read(target).held == ("Cm.0",)


def test_a_sensor_error_widens(points):
    plain, wide = (
        fq.blend_by_advance_ratio(points[::2], sensor_errors=errors) for errors in ({}, {"V": 0.3})
    )
    assert wide.clusters[0]["Cm.de"].std_error > 1.5 * plain.clusters[0]["Cm.de"].std_error


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--by", "advance-ratio", "--predict", "x.h5"], "--predict does not go with --by advance-ratio"),
        (["--clusters", "2"], "--clusters does not go with --by corridor"),
        (["--by", "advance-ratio", "--hold", "Cm.0"], "only a semi-local one holds any"),
        (["--by", "advance-ratio", "--sensor-error", "V"], "NAME=SIGMA"),
        (["--by", "advance-ratio", "--clusters", "9"], "14 manoeuvres make 4 at most"),
    ],
)
def test_options_that_do_not_fit_are_usage_errors(points, tmp_path, capsys, options, message):
    code = _exit_code(["global-blend", *map(str, points), "-o", str(tmp_path / "x.h5"), *options])
    assert code == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"form": "force"}, "expected 'coefficient'"),
        (
            {"trim": {}, "no_advance_ratio": "rotor 'n1' of vehicle 'blown' states no diameter"},
            "states no advance ratio: rotor 'n1' of vehicle 'blown' states no diameter",
        ),
        ({"trim": {"advance_ratio": 0.5}}, "states no trim angle of attack"),
        ({"vehicle": "another"}, "the point has vehicle 'another', the first one 'blown'"),
    ],
)
def test_points_that_tell_no_law_are_data_errors(points, tmp_path, capsys, change, message):
    bad = tmp_path / "bad.h5"
    write_point(bad, replace(fq.read(points[1]), **change))
    target = tmp_path / "laws.h5"
    code = _exit_code(["global-blend", str(points[0]), str(bad), "--by", "advance-ratio", "-o", str(target)])
    assert code == 3
    said = capsys.readouterr().err
    assert message in said
    assert "bad.h5" in said
    assert not target.exists()


def test_too_few_and_single_trims_are_said_and_means_are_written(points, tmp_path):
    target = tmp_path / "laws.h5"
    done = run(*points[:2], *points[4:6], "--by", "advance-ratio", "-o", target)  # two trims, twice each
    assert done.exception is None
    assert "one exponential needs 4 different advance ratios, 2 are there" in done.output
    assert {law.form for law in fq.read(target).clusters[0].laws.values()} == {"mean"}
    single = run(*points[:2], "--by", "advance-ratio", "-o", target)
    assert "manoeuvres are of one trim" in single.output

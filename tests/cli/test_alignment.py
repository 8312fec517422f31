"""A record that knows only velocity over the ground: refused by name, or aligned."""

import json
from pathlib import Path

import pytest
from late_sensors import TRUTH, late

from freqid.core.record import Maneuver, write_record
from freqid.core.results.point import read_point
from freqid.core.scenario import read_scenario
from freqid.flightlog.read import read_log

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
SCENARIO = SCENARIOS / "linear.toml"


@pytest.fixture(scope="module")
def flown(linear_logs, tmp_path_factory):
    vehicle = read_scenario(SCENARIO)[0].aircraft()
    log = read_log(linear_logs["clean"], SCENARIOS / "maps" / "linear.toml", vehicle=vehicle)
    path = tmp_path_factory.mktemp("late") / "late.h5"
    write_record(path, late(Maneuver.of(log), 2).record)
    return path


def test_parameters_of_the_air_are_refused_by_name(freqid, flown, tmp_path):
    for options in ((), ("--align", "report"), ("--kinematics", "off")):
        code, out, err = freqid(
            "identify-point", flown, "--scenario", SCENARIO, *options, "-o", tmp_path / "p.h5"
        )
        assert (code, out) == (3, "")
        assert "late.h5: parameters by u w of X Z M and v of Y L N cannot be had" in err
        assert "velocity is known over the ground only (vn ve vd), and the wind is unknown" in err
        assert "--align fit" in err
        assert "alignment would find" in err if "report" in options else "would" not in err
    assert not (tmp_path / "p.h5").exists()


def test_aligned_they_are_had_and_the_model_says_how(freqid, flown, tmp_path):
    point = tmp_path / "point.h5"
    code, out, err = freqid(
        "identify-point",
        flown,
        "--scenario",
        SCENARIO,
        "--align",
        "fit",
        "-o",
        point,
        "--predict",
        flown,
        "--json",
    )
    assert code == 0
    assert "late.h5: sensors aligned" in err
    assert "rotor delay" in err
    said = json.loads(out)
    assert said["prediction"]["Z"]["r2"] > 0.9
    account = read_point(point).provenance["alignment"][str(flown)]
    assert set(account) == set(TRUTH)
    for name, row in account.items():
        assert abs(row["estimate"] - TRUTH[name]) < 4 * row["std_error"]

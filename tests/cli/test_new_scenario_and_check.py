"""``new-scenario`` writes what can be read and ``check`` says what it lacks."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from freqid.core.scenario import read_scenario
from freqid.workflows.scenarios.new_scenario import guess_kind

TILTROTOR = Path(__file__).resolve().parents[2] / "scenarios" / "tiltrotor.toml"
MIXED = "ail_l,ail_r,rudder,nac_l,nac_r,n1,n2,thr,left:tilt,fan:thrust"


def test_the_skeleton_of_a_list_is_read_and_lists_what_to_fill_in(freqid, tmp_path):
    path = tmp_path / "mine.toml"
    code, out, _ = freqid("new-scenario", "--effectors", MIXED, "--name", 'My "own"', "-o", path)
    assert code == 0
    assert str(path) in out
    scenario = read_scenario(path)[0]
    assert {e.name: e.kind for e in scenario.effector} == {
        "ail_l": "surface",
        "ail_r": "surface",
        "rudder": "surface",
        "nac_l": "tilt",
        "nac_r": "tilt",
        "n1": "rotor",
        "n2": "rotor",
        "thr": "throttle",
        "left": "tilt",
        "fan": "thrust",
    }
    assert [w.tilt for w in scenario.wing] == ["nac_l", "nac_r", "left"]
    assert [set(r.scheduled) for r in scenario.reference] == [{"nac_l", "nac_r", "left"}] * 2
    code, out, _ = freqid("check", path, "--json", "-o", tmp_path / "three.svg")
    assert code == 0
    found = json.loads(out)
    assert found["missing"]["design-inputs"] == []
    assert found["missing"]["identify-point"] == []
    assert any("[control]" in sentence for sentence in found["missing"]["simulate"])
    lines = path.read_text().splitlines()
    numbers = [one["line"] for one in found["placeholders"]]
    assert numbers == [i for i, text in enumerate(lines, 1) if "fill in" in text and not text.startswith("#")]
    assert (tmp_path / "three.svg").read_text().count("<path") > 10


def test_what_is_to_be_filled_in_is_listed_by_section_and_rotors_find_their_mounts(freqid, tmp_path):
    path = tmp_path / "mine.toml"
    names = "de,nac_fl,nac_fr,nac_rr,rot_fr:rotor,rot_fl:rotor,rot_rr:rotor"
    freqid("new-scenario", "--effectors", names, "-o", path)
    carriers = re.findall(r'# wing = "(\w+)"', path.read_text())
    assert carriers == ["mount_nac_fr", "mount_nac_fl", "mount_nac_rr"]
    _, out, _ = freqid("check", path, "--no-draw")
    assert "[[effector]] de             limits, rate_limit (lines" in out
    assert "[excitation.amplitude]      all (line" in out
    assert re.search(r"study --flights +ready", out)
    assert re.search(r"\nstudy +missing: \[control\]", out)


def test_a_skeleton_is_designed_for_as_it_is(freqid, tmp_path):
    path = tmp_path / "mine.toml"
    freqid("new-scenario", "--effectors", "de,da,dr,n1", "-o", path)
    code, _, err = freqid("design-inputs", path, "--no-page", "-o", tmp_path / "design.h5")
    assert (code, err.count("freqid:")) == (0, 0)


def test_the_test_card_says_where_speed_and_tilts_are(freqid, tmp_path):
    path = tmp_path / "mine.toml"
    freqid("new-scenario", "--effectors", "de,nac:tilt,n1", "-o", path)
    path.write_text(path.read_text().replace("nac = 0.0 # rad", "nac = 0.5 # rad"))
    code, _, err = freqid("design-inputs", path, "--at", "u15", "--no-study", "-o", tmp_path / "design.h5")
    assert code == 0, err
    assert "u15: u 15 m/s, nac 28.65 deg\n" in (tmp_path / "design-card.txt").read_text()


def test_effectors_of_a_log_are_found_by_their_columns(freqid, tmp_path):
    log = tmp_path / "flight.csv"
    log.write_text(
        "time,u [m/s],q [deg/s],elev (deg),rpm_1,rpm_1_cmd,battery,nac [deg],de injected\n1"
        + ",2" * 8
        + "\n2"
        + ",3" * 8
    )
    code, out, err = freqid("new-scenario", "--log", log, "-o", tmp_path / "s.toml")
    assert code == 0, err
    scenario = read_scenario(tmp_path / "s.toml")[0]
    assert {e.name: e.kind for e in scenario.effector} == {"elev": "surface", "n1": "rotor", "nac": "tilt"}


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--effectors", "de1,blob"], "the name 'blob' does not tell"),
        (["--effectors", "blob,de1,lump"], "the names 'blob', 'lump' do not tell"),
        (["--effectors", "de1:surfase"], "did you mean 'surface'"),
        (["--effectors", "q:surface"], "'q' has the name of a state"),
        ([], "no effector is named"),
    ],
)
def test_what_cannot_be_described_is_refused(freqid, tmp_path, options, says):
    code, out, err = freqid("new-scenario", *options, "-o", tmp_path / "s.toml")
    assert (code, out) == (2, "")
    assert says in err
    assert not (tmp_path / "s.toml").exists()


def test_a_file_is_never_replaced(freqid, tmp_path):
    (tmp_path / "s.toml").write_text("mine")
    code, _, err = freqid("new-scenario", "--effectors", "de", "-o", tmp_path / "s.toml")
    assert code == 2
    assert "is there already" in err
    assert (tmp_path / "s.toml").read_text() == "mine"


def test_check_says_what_is_missing_for_which_command(freqid, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(
        '[vehicle]\nname = "a"\nmass_kg = 2.0\ncg_m = [0.1, 0, 0.2]\ninertia = { xx = 1, yy = 1, zz = 1 }\n'
        '[[effector]]\nname = "nac"\nkind = "tilt"\nlimits = [0, 1]\n'
        '[[reference]]\nid = "a"\nu = 3\nrho = 1.2\nnac = 1.4\n'
        '[excitation]\nband_hz = [0.1, 1]\nperiod_s = 10\neffectors = ["nac"]\n'
        '[identification]\nregressors = ["u", "blob"]\n'
    )
    code, out, _ = freqid("check", path, "-o", tmp_path / "a.svg")
    assert code == 0
    assert re.search(r"design-inputs +missing: reference 'a' sets nac = 1.4, outside its limits", out)
    assert re.search(r"identify-point +missing: \[\[effector\]\] of regressor blob", out)
    assert re.search(r"global-blend +missing: .*two conditions or more, found 1", out)
    assert re.search(r"import-log +ready", out)
    assert "as described    x 0.1000  y 0.0000  z 0.2000" in out
    assert "no [[wing]] turns with nac" in out
    assert "Nothing is drawn" in out
    assert not (tmp_path / "a.svg").exists()


@pytest.mark.parametrize("name", ["A\\B", "two\nlines", 'My "own"'])
def test_a_name_stays_as_it_is_in_what_is_written(freqid, tmp_path, name):
    path = tmp_path / "named.toml"
    assert freqid("new-scenario", "--effectors", "de1,n1", "--name", name, "-o", path)[0] == 0
    assert read_scenario(path)[0].vehicle.name == name


def test_an_effector_that_toml_cannot_hold_is_refused(freqid, tmp_path):
    path = tmp_path / "s.toml"
    code, _, err = freqid("new-scenario", "--effectors", 'de"1:surface', "-o", path)
    assert code == 2
    assert "has a name with other signs" in err
    assert not path.exists()


def test_check_names_the_file_whose_wing_has_no_place(freqid, tmp_path):
    path = tmp_path / "s.toml"
    text = TILTROTOR.read_text()
    assert "cg_m = [0.51, 0.95, -0.05]\n" in text
    path.write_text(text.replace("cg_m = [0.51, 0.95, -0.05]\n", ""))
    code, _, err = freqid("check", path, "--no-draw")
    assert code == 2
    assert err.startswith(f"freqid: {path}: wing 'nacelle_fr' has a mass of 2 kg but no centre of gravity")


def test_check_says_that_wings_outweigh_their_vehicle(freqid, tmp_path):
    path = tmp_path / "s.toml"
    text = TILTROTOR.read_text()
    heavy = re.sub(r"(?s)(\[\[wing\]\].*?\nmass_kg = )[\d.]+", r"\g<1>40.0", text)
    assert heavy != text
    path.write_text(heavy)
    code, out, _ = freqid("check", path, "--no-draw")
    assert code == 0
    assert re.search(r"identify-point +missing: vehicle .* without its wings has a mass of -", out)
    assert re.search(r"diagnose-gap +missing: .*without its wings has a mass of -", out)


def test_names_as_people_write_them():
    by_kind = {
        "surface": [
            "de",
            "de1",
            "da",
            "dr2",
            "df3",
            "elevator",
            "aileron_l",
            "ruddervator",
            "flap",
            "rv_l",
            "tef",
        ],
        "rotor": ["n1", "n12", "rpm_3", "motor2", "rotor_fl", "prop", "omega_4"],
        "tilt": ["dw1", "nac_l", "tilt_front", "nacelle"],
        "throttle": ["throttle", "thr1", "thtl"],
        "thrust": ["thrust", "T1"],
        "": ["blob", "gear", "x"],
    }
    for kind, names in by_kind.items():
        assert {n: guess_kind(n) for n in names} == dict.fromkeys(names, kind)

"""``freqid simulate`` as a user runs it."""

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from freqid.core.scenario import read_scenario
from freqid.simulate.truth import read_truth

LA8 = Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml"
SCENARIO = read_scenario(LA8)[0]
SHORT = ("--at", "u45", "--duration", "4.5", "--no-page")


@pytest.fixture
def refused(freqid, tmp_path):
    """Run a command that must fail before it writes; return its one sentence."""

    def call(*arguments, code=2):
        output = tmp_path / "refused.h5"
        found, out, err = freqid("simulate", *arguments, "-o", output)
        assert (found, out) == (code, "")
        assert not output.exists()
        assert not output.with_suffix(".truth.h5").exists()
        assert "Traceback" not in err
        said = [line for line in err.splitlines() if line and not line.startswith(("Usage:", "Try '"))]
        assert len(said) == 1, err
        return said[0]

    return call


@pytest.fixture
def changed(tmp_path):
    """Write the scenario with a piece of its text replaced."""

    def write(old, new):
        text = LA8.read_text()
        assert old in text
        (tmp_path / "changed.toml").write_text(text.replace(old, new))
        return tmp_path / "changed.toml"

    return write


@pytest.fixture
def design(freqid, tmp_path):
    """Write doublets for one effector."""

    def write(effector="de1"):
        toml = tmp_path / "one.toml"
        toml.write_text(
            '[vehicle]\nname = "One"\nmass_kg = 10.0\ninertia = {xx = 1.0, yy = 1.0, zz = 1.0}\n'
            "[excitation]\nband_hz = [0.5, 2.0]\nperiod_s = 4.0\namplitude = 0.05\n"
            f'[[effector]]\nname = "{effector}"\nkind = "surface"\nlimits = [-0.4, 0.4]\nrate_limit = 3.0\n'
        )
        path = tmp_path / "design.h5"
        code, _, err = freqid("design-inputs", toml, "--input", "doublet", "--no-page", "-o", path)
        assert code == 0, err
        return path

    return write


def test_a_flight_is_written_as_the_aircraft_would_log_it(freqid, design, tmp_path):
    record = tmp_path / "flight.h5"
    plan = design()
    options = ["--at", "u45", "--noise", "--seed", "3", "--effect", "wing_wake=0.5"]
    code, out, err = freqid("simulate", LA8, plan, *options, "--json", "-o", record)
    assert (code, err) == (0, "")
    said = json.loads(out)
    assert said["record"] == str(record)
    assert said["truth"] == str(tmp_path / "flight.truth.h5")
    assert said["reference"] == "u45"
    assert said["excursions"]["phi"]["limit"] == 0.52
    assert said["excursions"]["phi"]["inside"] is True
    with h5py.File(record) as file, h5py.File(plan) as planned:
        assert file.attrs["format"] == "freqid-record"
        assert file.attrs["reference"] == "u45"
        states = {"u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az", "alt"}
        assert set(file["state"]) == states
        assert set(file["effector"]) == set(file["command"]) == {e.name for e in SCENARIO.effector}
        assert set(file["excitation"]) == {"de1"}
        assert set(file["power"]) == {"voltage", "current"}
        assert set(file["air"]) <= {"rho", "V", "alpha", "beta", "qbar"}
        assert np.ptp(np.diff(file["time"])) < 1e-9
        assert tuple(file["state/ax"].attrs["position_m"]) == (0.15, 0.0, 0.05)
        assert said["duration_s"] == pytest.approx(planned["time"][-1], abs=0.02)
        flown = np.interp(file["time"], planned["time"], planned["excitation/de1"])
        inside = slice(1, -2)
        assert np.abs(file["excitation/de1"][inside] - flown[inside]).max() < 0.02
    truth = read_truth(tmp_path / "flight.truth.h5")
    assert truth.provenance["simulation"]["effects"]["wing_wake"] == {"strength": 0.5}
    assert truth.provenance["simulation"]["seed"] == 3


def test_the_record_holds_nothing_of_the_truth(freqid, tmp_path):
    from freqid.simulate.effects import library

    record = tmp_path / "flight.h5"
    effect = ("--effect", "slipstream=0.7", "--turbulence", "--noise")
    assert freqid("simulate", LA8, *SHORT, *effect, "-o", record)[0] == 0
    raw = record.read_bytes()
    described = {"mass", "mass_properties", "inertia", "rate_limit"}  # words of the vehicle's description too
    for word in (*(set(library()) - described), "wind", "strength", "response", "pdot", "effects"):
        assert word.encode() not in raw, word
    assert b"slipstream" in record.with_suffix(".truth.h5").read_bytes()


def test_identification_refuses_a_truth_in_one_sentence(freqid, tmp_path):
    assert freqid("simulate", LA8, *SHORT, "-o", tmp_path / "flight.h5")[0] == 0
    truth = tmp_path / "flight.truth.h5"
    code, out, err = freqid("identify-point", truth, "--scenario", LA8, "-o", tmp_path / "point.h5")
    assert (code, out) == (3, "")
    assert len(err.strip().splitlines()) == 1
    assert "freqid-truth" in err
    assert "freqid-record" in err
    assert not (tmp_path / "point.h5").exists()


def test_the_same_command_gives_the_same_flight(freqid, tmp_path):
    paths = [tmp_path / f"{name}.h5" for name in "ab"]
    for path in paths:
        options = ("--sensors", "owner", "--noise", "2", "--turbulence", "--seed", 1)
        assert freqid("simulate", LA8, *SHORT, *options, "-o", path)[0] == 0
    with h5py.File(paths[0]) as a, h5py.File(paths[1]) as b:
        for name in ("state/vn", "state/q", "effector/de1", "air/V"):
            assert np.array_equal(a[name][()], b[name][()])


def test_a_transition_is_flown_and_told_in_words(freqid, tmp_path):
    code, out, err = freqid(
        *("simulate", LA8, "--at", "u00", "--to", "u85", "--duration", "60", "--no-page"),
        *("-o", tmp_path / "t.h5"),
    )
    assert (code, err) == (0, "")
    assert "t.h5: 60 s from u00; the truth is in" in out
    assert "BEYOND" not in out
    with h5py.File(tmp_path / "t.h5") as file:
        assert file["state/u"][-1] > 24
        assert file["effector/dw1"][-1] < 0.12


def test_a_flight_that_diverges_leaves_its_record_up_to_there(freqid, tmp_path):
    record = tmp_path / "loose.h5"
    code, out, err = freqid(
        *("simulate", LA8, "--at", "u20", "--duration", "60", "--no-feedback", "--turbulence", "--no-page"),
        *("-o", record),
    )
    assert (code, out) == (3, "")
    found = re.search(r"the flight diverged at t = (\S+) s: (\w+) is (\S+), expected (\S+) to (\S+);", err)
    assert found, err
    assert "the record holds the flight up to there; lower the inputs, or fly with feedback" in err
    time, channel, value, low, high = float(found[1]), found[2], *map(float, found.groups()[2:])
    assert not low <= value <= high
    assert 1.0 < time < 59
    with h5py.File(record) as file:
        assert file["time"][-1] == pytest.approx(time, abs=0.04)
    truth = read_truth(record.with_suffix(".truth.h5"))
    assert truth.time[-1] == pytest.approx(time, abs=0.02)
    assert np.abs(truth[f"state/{channel}"]).max() <= high
    assert "diverged" in truth.provenance["simulation"]
    # the record is whole for whoever reads it next: what is refused is the estimate, not the file
    code, _, err = freqid("export", record, "--to", "sidpac", "-o", tmp_path / "loose.mat")
    assert (code, err) == (0, "")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--effect", "slipsteam=0.5"], r"effect 'slipsteam' is unknown; .*slipstream"),
        (["--effect", "slipstream.size=0.5"], r"effect 'slipstream' has no parameter 'size'; .*strength"),
        (["--effect", "slipstream"], r"--effect is NAME=VALUE with a number, .* not 'slipstream'"),
        (["--effect", "slipstream=much"], r"not 'slipstream=much'"),
        (["--sensors", "reserch"], r"no sensor suite 'reserch'; .*research"),
        (["--effect", "slipstream=nan"], r"slipstream.*give a finite number"),
        (["--noise=-1"], r"-1"),
        (["--turbulence=-1"], r"-1"),
        (["--duration", "-3"], r"a flight of -3 s cannot be flown"),
        (["--duration", "0"], r"a flight of 0 s cannot be flown; give a positive duration"),
        (["--duration", "nan"], r"a flight of nan s cannot be flown"),
        (["--at", "u44"], r"u44.*u45|u44.*u40"),
        (["--to", "u99"], r"u99"),
    ],
)
def test_what_is_asked_wrongly_is_answered_in_one_sentence(refused, options, said):
    assert re.search(said, refused(LA8, *SHORT, *options))


def test_a_condition_must_be_chosen_where_there_are_several(refused):
    said = refused(LA8, "--duration", "4.5")
    assert "the scenario has 32 reference conditions; choose one with --at, such as --at u00" in said


def test_without_inputs_a_duration_is_needed(refused):
    assert "there is nothing to fly; give inputs or a duration" in refused(LA8, "--at", "u45")


def test_hover_without_wind_has_no_turbulence(refused):
    said = refused(LA8, "--at", "u00", "--duration", "4.5", "--turbulence")
    assert "turbulence needs an airspeed of at least 1 m/s" in said


def test_inputs_for_another_vehicle_are_refused(refused, design):
    said = refused(LA8, design("elevator"), "--at", "u45")
    assert "the inputs excite 'elevator', which vehicle 'LA-8 class, notional' does not have" in said


def test_a_file_that_is_no_design_is_refused(refused):
    assert "la8.toml" in refused(LA8, LA8, "--at", "u45", code=3)


@pytest.mark.parametrize("name", ["scenario", "design"])
def test_the_result_never_replaces_its_inputs(freqid, changed, design, name):
    toml, plan = changed("u = 0\n", "u = 0.0\n"), design()
    target = {"scenario": toml, "design": plan}[name]
    before = target.read_bytes()
    code, _, err = freqid("simulate", toml, plan, "--at", "u45", "-o", target)
    assert code == 2
    assert f"the result would replace its own input {target}; change -o" in err
    assert target.read_bytes() == before


def test_a_truth_never_replaces_an_input(freqid, design):
    plan = design()
    hidden = plan.rename(plan.with_name("x.truth.h5"))
    code, _, err = freqid("simulate", LA8, hidden, "--at", "u45", "-o", hidden.with_name("x.h5"))
    assert code == 2
    assert "the result would replace its own input" in err


def test_a_scenario_without_an_airframe_says_what_is_missing(refused, tmp_path):
    text = LA8.read_text()
    start, end = text.index("[simulation.airframe]"), text.index("[simulation.actuators.surface]")
    (tmp_path / "bare.toml").write_text(text[:start] + text[end:])
    said = refused(tmp_path / "bare.toml", *SHORT)
    assert "the scenario has no [simulation.airframe]; describe the airframe there" in said


def test_an_unknown_weight_of_the_control_law_is_refused(refused, changed):
    said = refused(changed("settling_s = 3.0", "setling_s = 3.0"), *SHORT)
    assert "setling_s" in said
    assert "[control.lq]" in said


def test_a_condition_that_cannot_be_flown_says_why_and_what_can(refused, changed):
    cruise = "u = 25.91\ndw1 = 0.0960 # 5.5 deg\ndw2 = 0.0960\nrho = 1.225"
    fast = changed(cruise, "u = 60\ndw1 = 0\ndw2 = 0\nrho = 1.225")
    said = refused(fast, "--at", "u85", "--duration", "4.5")
    assert re.search(
        r"reference 'u85': level flight is not possible: the forward force cannot be balanced, -350 N is "
        r"left \(125 % of the weight\); the nearest that was found to fly is u = \S+ m/s with tilts",
        said,
    )
    weak = changed("resistance_ohm = 0.015", "resistance_ohm = 0.15")
    assert "rotor 'n1' would need a command of" in refused(weak, "--at", "u00", "--duration", "4.5")


@pytest.fixture
def campaign(tmp_path):
    """Write dep6 with a campaign of two trims, or with some text replaced."""

    def write(old="", new=""):
        text = (LA8.parent / "dep6.toml").read_text()
        first = text.index("[[campaign.trim]]")
        rest = text.index("# --- control")
        trims = "[[campaign.trim]]\nspeed = 17.0\nclimb_rad = 0.1\n[[campaign.trim]]\nspeed = 16.5\n"
        trims += 'climb_rad = -0.09\nrotors = "stopped"\n'
        text = text[:first] + trims + text[rest:]
        assert old in text
        (tmp_path / "six.toml").write_text(text.replace(old, new))
        return tmp_path / "six.toml"

    return write


def test_a_campaign_is_flown_and_its_manoeuvres_are_cut_out(freqid, campaign, tmp_path):
    flight = tmp_path / "flight.h5"
    words = ("--campaign", "--noise", "--turbulence", "1", "--seed", "3", "--no-page", "-o", flight)
    code, out, err = freqid("simulate", campaign(), *words)
    assert (code, err) == (0, "")
    table = [line.split() for line in out.splitlines()[3:]]
    assert [row[-1] == "stopped" for row in table] == [False, True]
    assert [float(row[2]) for row in table] == pytest.approx([17.0, 16.5], abs=0.5)
    assert read_truth(tmp_path / "flight.truth.h5").duration == pytest.approx(80.0, abs=0.1)
    code, out, err = freqid("import-log", flight, "--split", "-o", tmp_path / "m.h5")
    assert (code, err) == (0, "")
    assert sorted(p.name for p in tmp_path.glob("m-*.h5")) == ["m-1.h5", "m-2.h5"]
    (tmp_path / "m-3.h5").touch()  # of a longer flight, cut earlier
    (tmp_path / "m-old.h5").touch()
    code, out, err = freqid("import-log", flight, "--split", "-o", tmp_path / "m.h5")
    assert code == 0
    assert err.strip() == f"{tmp_path / 'm-3.h5'} is older: it is no manoeuvre of this log as it is cut now."


def test_a_campaign_of_one_trim_is_flown_and_said_to_be_one(freqid, campaign, tmp_path):
    one = campaign('[[campaign.trim]]\nspeed = 16.5\nclimb_rad = -0.09\nrotors = "stopped"\n', "")
    code, out, _ = freqid("simulate", one, "--campaign", "--json", "--no-page", "-o", tmp_path / "f.h5")
    assert code == 0
    said = json.loads(out)
    assert len(said["trims"]) == 1
    assert len(said["remarks"]) == 1
    assert "one trim shows nothing" in said["remarks"][0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--at", "u18"), "--at is of a single manoeuvre"),
        (("--duration", "5"), "--duration is of a single manoeuvre"),
        (("--no-feedback",), "--no-feedback is of a single manoeuvre"),
    ],
)
def test_options_of_a_single_manoeuvre_do_not_go_with_a_campaign(refused, campaign, words, said):
    assert said in refused(campaign(), "--campaign", *words)


def test_a_campaign_that_is_not_described_is_one_sentence(refused, campaign):
    assert "no [campaign]" in refused(LA8, "--campaign")
    assert "climb_rad is 30" in refused(campaign("climb_rad = 0.1", "climb_rad = 30.0"), "--campaign")
    assert "did you mean 'speed'" in refused(campaign("speed = 17.0", "sped = 17.0"), "--campaign")

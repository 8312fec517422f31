"""``freqid design-inputs`` as a user runs it."""

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from page_script import without_script

from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.results.design import read_design, read_inputs
from freqid.core.results.point import write_point
from freqid.core.scenario import read_scenario
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import ModelledAircraft
from freqid.design.forecast.standard_errors import forecast
from freqid.design.multisine.merit import merit, truncated
from freqid.design.multisine.orthogonal_set import design_multisines, sampled
from freqid.flightlog.read import read_log
from freqid.identify.point import identify_point

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
LA8 = SCENARIOS / "la8.toml"
LINEAR = SCENARIOS / "linear.toml"
SMALL = """
[vehicle]
name = "Small"
mass_kg = 10.0
inertia = {xx = 1.0, yy = 1.0, zz = 1.0}
[excitation]
band_hz = [0.1, 2.0]
period_s = 20.0
amplitude = 0.1
"""
EFFECTOR = """
[[effector]]
name = "%s"
kind = "surface"
limits = [-0.4, 0.4]
rate_limit = 3.0
effectiveness = { L = %g, M = 2.0 }
"""


@pytest.fixture
def scenario(tmp_path):
    def write(change=lambda text: text):
        text = SMALL + "".join(EFFECTOR % (f"e{i}", (-1) ** i) for i in range(1, 5))
        (tmp_path / "s.toml").write_text(change(text))
        return tmp_path / "s.toml"

    return write


def test_a_scenario_becomes_a_design_with_everything_beside_it(freqid, scenario, tmp_path):
    toml = scenario(lambda t: t.replace("amplitude = 0.1", "amplitude = 0.1\nnet_load = { L = 1, M = 1 }"))
    options = ["--csv", "--mat", "--c-header", "--lua", "--no-study", "--json", "-o", tmp_path / "d.h5"]
    code, out, err = freqid("design-inputs", toml, *options)
    assert (code, err) == (0, "")
    said = json.loads(out)
    assert {Path(f).name for f in said["files"]} == {
        *("d.h5", "d.csv", "d.mat", "d.h", "d.lua", "d.html", "d-card.txt", "d-card.html")
    }
    assert said["max_correlation"] < 1e-10
    assert said["condition_number"] == pytest.approx(1, abs=1e-9)
    with h5py.File(tmp_path / "d.h5") as file:
        assert file.attrs["format"] == "freqid-design"
        time, signals = file["time"][()], np.array([file[f"excitation/{n}"][()] for n in said["effectors"]])
        assert set(file["harmonic/e1"]) == {"index", "amplitude", "phase"}
    assert time[-1] == pytest.approx(40.0)
    assert np.abs(signals[:, [0, -1]]).max() < 1e-6 * 0.1
    norm = np.linalg.norm(signals[:, :-1], axis=1)
    correlation = signals[:, :-1] @ signals[:, :-1].T / np.outer(norm, norm)
    assert np.abs(correlation - np.eye(4)).max() < 1e-10
    for figures, row in zip(said["effectors"].values(), signals, strict=True):
        assert figures["rms"] == pytest.approx(0.1 / np.sqrt(2))
        assert np.abs(row).max() <= figures["peak"] * 1.0012  # what 64 points per period can miss
    back = read_design(tmp_path / "d.h5")
    np.testing.assert_allclose(sampled(back).values, signals, atol=1e-12)


def test_the_same_seed_gives_the_same_design_and_another_seed_another(scenario):
    described, _ = read_scenario(scenario())
    first, again, other = (
        design_multisines(described.excitation, described.effector, seed=s).signals[0].phase
        for s in (0, 0, 1)
    )
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1e-3


def test_a_broken_off_manoeuvre_is_judged_by_what_was_flown(scenario):
    described, _ = read_scenario(scenario())
    design = design_multisines(described.excitation, described.effector)
    parts = truncated(design, steps=8)
    inputs = sampled(design)
    n = round(parts.time[4] / design.dt_s)
    flown = inputs.values[:, :n]
    c = flown @ flown.T / np.outer(np.linalg.norm(flown, axis=1), np.linalg.norm(flown, axis=1))
    assert parts.max_correlation[4] == pytest.approx(np.abs(c - np.eye(4)).max(), abs=0.02)
    assert parts.max_correlation[-1] < 1e-10
    assert np.all(merit(design).rpf < 1.3)


def test_the_la8_scenario_keeps_propulsors_low_and_stays_within_limits():
    described, _ = read_scenario(LA8)
    assert described.excitation.allocation == "propulsors-low"
    quick = {"allocation": {e.name: (3 + i, 21 + i) for i, e in enumerate(described.effector[:18])}}
    import msgspec

    excitation = msgspec.structs.replace(described.excitation, **quick)
    design = design_multisines(excitation, described.effector)
    assert design.names == tuple(e.name for e in described.effector if e.kind != "tilt")
    assert len(design.names) == 18


BAD = {
    "too few harmonics": (("period_s = 20.0", "period_s = 1.0"), "period_s to"),
    "band above Nyquist": (("period_s = 20.0", "period_s = 20.0\ndt_s = 0.5"), "Nyquist"),
    "amplitude beyond a limit": (("amplitude = 0.1", "amplitude = 0.9"), "the limits allow 0.4 about"),
    "too fast": (("rate_limit = 3.0", "rate_limit = 0.1"), "lower excitation.amplitude to"),
    "duplicate names": (('name = "e2"', 'name = "e1"'), "['e1'] more than once"),
    "unknown effector": (("amplitude = 0.1", "amplitude = {e7 = 0.1}"), "'e7', which is not described"),
    "shared harmonic": (
        ("amplitude = 0.1", "amplitude = 0.1\nallocation = {e1=[2,3],e2=[3,4],e3=[5],e4=[6]}"),
        "share harmonic 3",
    ),
    "no effectiveness": (
        ("amplitude = 0.1", "amplitude = 0.1\nnet_load = {Y = 1}"),
        "effectiveness",
    ),
    "negative amplitude": (("amplitude = 0.1", "amplitude = -0.1"), "expected it positive"),
    "amplitude whose square is zero": (("amplitude = 0.1", "amplitude = 1e-308"), "expected it positive"),
    "more harmonics than memory": (("period_s = 20.0", "period_s = 1e9"), "expected at most 10000"),
    "too many samples": (("period_s = 20.0", "period_s = 20.0\ndt_s = 1e-9"), "expected fewer periods"),
    "no spectrum": (("amplitude = 0.1", "amplitude = 0.1\nspectrum = []"), "spectrum is empty"),
    "nothing left": (("amplitude = 0.1", "amplitude = 0.1\nforbidden_hz = [[0, 5]]"), "may have power: 0,"),
    "unknown abort": (("amplitude = 0.1", "amplitude = 0.1\nabort = {thta = 1}"), "did you mean 'theta'"),
    "band upside down": (("[0.1, 2.0]", "[2.0, 0.1]"), "expected 0 < low < high"),
}


@pytest.mark.parametrize("fault", BAD)
def test_a_bad_request_is_exit_code_2_with_a_sentence_and_no_file(freqid, scenario, tmp_path, fault):
    (old, new), says = BAD[fault]

    def spoil(text):
        return text.replace(old, new, 1) if fault != "no effectiveness" else _bare(text.replace(old, new, 1))

    code, out, err = freqid("design-inputs", scenario(spoil), "-o", tmp_path / "out" / "d.h5", "--no-page")
    assert code == 2, err
    assert says in err
    assert "s.toml" in err
    assert out == ""
    assert not (tmp_path / "out").exists()


def _bare(text):
    return "\n".join(line for line in text.splitlines() if not line.startswith("effectiveness"))


@pytest.fixture(scope="module")
def point(linear_logs, tmp_path_factory):
    """A point model of the linear aircraft, and its file."""
    described, _ = read_scenario(LINEAR)
    columns = SCENARIOS / "maps" / "linear.toml"
    record = read_log(linear_logs["noisy"], columns, vehicle=described.aircraft())
    reference = described.reference_of("u20")
    model = identify_point(
        Maneuver.of(record), described.identification, excitation=described.excitation, reference=reference
    )
    path = tmp_path_factory.mktemp("point") / "point.h5"
    write_point(path, model)
    return model, path


@pytest.fixture
def quick(freqid, tmp_path):
    """Run the command on the linear aircraft, with shorter periods, and return what it says and its file."""
    toml = tmp_path / "quick.toml"
    toml.write_text(LINEAR.read_text().replace("period_s = 60.0", "period_s = 20.0\nstarts = 3"))

    def call(*arguments):
        code, out, err = freqid(
            "design-inputs", toml, "-o", tmp_path / "d.h5", "--json", "--no-study", *arguments
        )
        return code, json.loads(out) if code == 0 else err, tmp_path / "d.h5"

    return call


def test_optimal_amplitudes_use_what_the_limits_leave_and_no_more(quick, point):
    model, path = point
    code, said, file = quick("--model", path, "--optimal", "D", "--no-page")
    assert code == 0, said
    design, (described, _) = read_design(file), read_scenario(LINEAR)
    loop = ModelledAircraft.of(model, described).loop
    limits = {"de": 0.5, "da": 0.5, "dr": 0.5} | {x: 0.5 * a for x, a in described.excitation.abort.items()}
    trim = {n: model["Y" if n in ("da", "dr") else "X"] for n in ("de", "da", "dr")}
    for name, response in trim.items():
        limits[name] -= abs(response.trim[response.regressors.index(name)])
    share = excursions(design, loop, tuple(limits)).peak / list(limits.values())
    assert 0.99 < share.max() <= 1 + 1e-9
    named = [n for n, s in zip(limits, share, strict=True) if s > 0.99]
    assert set(named) <= set(said["amplitudes"]["binding"])
    assert said["amplitudes"]["criterion"] == "D"
    for name, factor in said["amplitudes"]["scale"].items():
        assert said["effectors"][name]["rms"] == pytest.approx(
            factor * described.excitation.amplitude[name] / np.sqrt(2)
        )
    plain = quick("--model", path, "--no-page")[1]
    for response, row in plain["forecast"].items():
        better = [said["forecast"][response][x]["std_error"] / row[x]["std_error"] for x in row]
        assert max(better) < 0.5  # amplitudes rise by factors of 3 to 5


def test_excursions_of_the_scenario_hold_optimal_amplitudes_back(freqid, point, tmp_path):
    text = LINEAR.read_text().replace(
        "period_s = 60.0", "period_s = 20.0\nstarts = 3\nexcursions = {theta = 0.02}"
    )
    (tmp_path / "s.toml").write_text(text)
    options = ("--model", point[1], "--optimal", "A", "--no-page", "--json", "-o", tmp_path / "d.h5")
    code, out, err = freqid("design-inputs", tmp_path / "s.toml", *options)
    assert code == 0, err
    said = json.loads(out)
    assert "theta" in said["amplitudes"]["binding"]
    assert said["expected"]["theta"]["peak"] == pytest.approx(0.02, rel=2e-3)
    assert said["expected"]["theta"]["spread"] > 0


def test_reach_flies_as_few_periods_as_suffice(quick, point):
    model, path = point
    described = read_scenario(LINEAR)[0]
    _, plain, file = quick("--model", path, "--no-page")
    aircraft = ModelledAircraft.of(model, described)
    row = forecast(read_design(file), aircraft.loop, aircraft.settings, aircraft.noise)["M"]
    of_two = float(row.std_error[row.regressors.index("de")])
    assert plain["forecast"]["M"]["de"]["std_error"] == pytest.approx(of_two)
    share = 100 * of_two * np.sqrt(2 / 5) * 1.05 / abs(model["M"]["de"][0])
    code, said, file = quick("--model", path, "--reach", f"M.de={share}%", "--reach", "Y.v=1e3", "--no-page")
    assert code == 0, said
    assert (said["periods"], said["duration_s"]) == (5, 100.0)
    assert read_design(file).periods == 5
    assert read_inputs(file).time[-1] == pytest.approx(100.0)
    assert said["forecast"]["M"]["de"]["std_error"] <= share / 100 * abs(model["M"]["de"][0])


def test_swapped_combs_become_a_second_design(quick):
    code, said, file = quick("--swapped", "de:dr", "--csv")
    assert code == 0, said
    first, second = read_design(file), read_design(file.with_stem("d-swapped"))
    a, b = ({s.name: s for s in d.signals} for d in (first, second))
    assert a["de"].index.tolist() == b["dr"].index.tolist() == said["swapped"]["effectors"]["dr"]["harmonics"]
    assert a["dr"].index.tolist() == b["de"].index.tolist()
    assert a["da"].index.tolist() == b["da"].index.tolist()
    assert merit(second).max_correlation < 1e-10
    assert merit(second).rms == pytest.approx(merit(first).rms)
    assert {Path(f).name for f in said["swapped"]["files"]} == {
        *("d-swapped.h5", "d-swapped.csv", "d-swapped.html", "d-swapped-card.txt", "d-swapped-card.html")
    }


@pytest.mark.parametrize("waveform", ["doublet", "3-2-1-1", "sweep"])
def test_classic_inputs_move_one_effector_after_the_other(quick, point, waveform):
    code, said, file = quick("--input", waveform, "--model", point[1], "--csv", "--mat")
    assert code == 0, said
    flown = read_inputs(file)
    amplitude = {"de": 0.06, "da": 0.05, "dr": 0.06, "n1": 25.0}
    assert flown.names == tuple(said["effectors"]) == tuple(amplitude)
    assert np.abs(flown.values).max(axis=1) == pytest.approx(list(amplitude.values()), rel=1e-3)
    moved = flown.values != 0
    assert moved.sum(axis=0).max() == 1
    order = flown.names.index
    turns = np.argmax(moved, axis=0)[moved.any(axis=0)]
    assert [flown.names[i] for i in turns[np.flatnonzero(np.diff(turns, prepend=-1))]] == [*amplitude] * 2
    assert order("da") == 1
    assert said["duration_s"] == pytest.approx(flown.time[-1])
    assert {Path(f).suffix for f in said["files"]} == {".h5", ".csv", ".mat", ".html", ".txt"}
    assert 0 < said["expected"]["theta"]["peak"] < 0.35
    text = file.with_suffix(".html").read_text()
    assert "http" not in without_script(text)
    assert "no signal exceeds a limit or a slew rate" in text
    assert waveform in file.with_name("d-card.txt").read_text()
    with pytest.raises(DataError, match=f"holds a {waveform}, expected multisines"):
        read_design(file)
    with h5py.File(file) as stored:
        assert stored.attrs["waveform"] == waveform
        assert "harmonic" not in stored


def test_steps_ramp_as_fast_as_the_slowest_effector_can(freqid, scenario, tmp_path):
    toml = scenario(lambda t: t.replace("rate_limit = 3.0", "rate_limit = 0.5", 1))
    code, _, err = freqid("design-inputs", toml, "--input", "3-2-1-1", "--no-page", "-o", tmp_path / "d.h5")
    assert code == 0, err
    flown = read_inputs(tmp_path / "d.h5")
    assert np.abs(np.diff(flown.values)).max() / 0.02 == pytest.approx(0.5)


REFUSED = {
    "--optimal A": "--optimal needs a model",
    "--reach M.de=1": "--reach needs a model",
    "--input doublet --optimal A": "--optimal is for multisines, not for --input doublet",
    "--input sweep --c-header": "--c-header is for multisines",
    "--swapped de:dx": "no effector 'dx'",
    "--swapped de": "found 'de', expected EFFECTOR:EFFECTOR",
    "--model POINT --reach M.de": "found 'M.de', expected RESPONSE.REGRESSOR=ERROR",
    "--model POINT --reach M.dr=1": "response 'M' has no parameter 'dr'",
    "--model POINT --reach M.de=0": "a standard error of 0 is wanted of 'de' in 'M'",
    "--model POINT --reach M.de=1e-6": "out of reach: 30 periods, 600 s, reach",
    "--model POINT --reach M.de=1 --longest 10": "longer than the 10 s allowed",
    "--model POINT --reach M.de=1 --longest nan": "longest manoeuvre is nan s",
}


@pytest.mark.parametrize("options", REFUSED)
def test_what_an_option_cannot_do_is_said(quick, point, options):
    words = [str(point[1]) if word == "POINT" else word for word in options.split()]
    code, said, file = quick(*words)
    assert code == 2, said
    assert REFUSED[options] in said
    assert not file.exists()


UNREACHABLE = {
    # By fault: the rate limit, the key, its value, how the advice is found, and what is worse than it.
    "too few harmonics": (3.0, "period_s = 20.0", 1.0, r"period_s to ([\d.]+) s", 0.99),
    "too large": (30.0, "amplitude = 0.1", 0.9, r"at most ([\d.]+) is feasible", 1.01),
    "too fast": (0.3, "amplitude = 0.1", 0.3, r"lower excitation.amplitude to ([\d.]+)", 1.01),
}


@pytest.mark.parametrize("fault", UNREACHABLE)
def test_the_nearest_feasible_value_is_feasible(freqid, scenario, tmp_path, fault):
    rate, key, value, advice, worse = UNREACHABLE[fault]

    def design(value):
        def spoil(text):
            return text.replace("rate_limit = 3.0", f"rate_limit = {rate}").replace(
                key, f"{key.split()[0]} = {value}"
            )

        return freqid("design-inputs", scenario(spoil), "--no-page", "-o", tmp_path / "d.h5")

    code, _, err = design(value)
    assert code == 2
    nearest = float(re.search(advice, err)[1])
    assert design(nearest)[0] == 0
    assert design(worse * nearest)[0] == 2

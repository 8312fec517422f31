"""``freqid design-inputs`` as a user runs it."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from freqid.cli.main import run
from freqid.core.design_file import read_design
from freqid.core.scenario import read_scenario
from freqid.design.multisine import design_multisines, merit, sampled, truncated

LA8 = Path(__file__).resolve().parents[2] / "scenarios" / "la8.toml"
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
def freqid(capsys):
    def call(*arguments):
        with pytest.raises(SystemExit) as left:
            run([str(a) for a in arguments])
        captured = capsys.readouterr()
        return left.value.code, captured.out, captured.err

    return call


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
    "amplitude beyond a limit": (("amplitude = 0.1", "amplitude = 0.9"), "at most 0.4"),
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

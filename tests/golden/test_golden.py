"""The results of whole commands, as ``--json`` prints them, held to values of an earlier release.

The values are no truth, the oracles of the other tests are: these say that a change of the program's
inside changed no result. Where a change is wanted, write the files anew and read the difference::

    FREQID_WRITE_GOLDEN=1 python -m pytest tests/golden
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import pytest

from freqid.cli.main import run
from freqid.core.record import read_record

HERE = Path(__file__).resolve().parent
SCENARIOS = HERE.parents[1] / "scenarios"
LINEAR, MAP, LA8 = SCENARIOS / "linear.toml", SCENARIOS / "maps" / "linear.toml", SCENARIOS / "la8.toml"
DIRECT, SEARCHED = 1e-9, 1e-6  # relative; the second where an optimiser's end is in the result
ALIKE = (
    0.05  # of optima that are equally good: which of them a search ends in, the processor's rounding decides
)
QUICK = ["--no-page", "--json"]


def differences(now, golden, relative, where=""):
    """Yield where two results differ, and what they hold there."""
    if isinstance(golden, dict) and isinstance(now, dict):
        if set(now) != set(golden):
            yield f"{where}: keys {sorted(set(now) ^ set(golden))}"
        for key in set(now) & set(golden):
            yield from differences(now[key], golden[key], relative, f"{where}.{key}")
    elif isinstance(golden, list) and isinstance(now, list):
        if len(now) != len(golden):
            yield f"{where}: {len(now)} entries, {len(golden)} before"
        for i, (a, b) in enumerate(zip(now, golden, strict=False)):
            yield from differences(a, b, relative, f"{where}[{i}]")
    elif type(now) is float and type(golden) in (float, int):
        if not math.isclose(now, golden, rel_tol=relative, abs_tol=1e-12):
            yield f"{where}: {now!r}, {golden!r} before"
    elif now != golden:
        yield f"{where}: {now!r}, {golden!r} before"


def hold(name, now, relative=DIRECT):
    """Compare a result with its golden file, or write that file where that is asked for."""
    path = HERE / f"{name}.json"
    if os.environ.get("FREQID_WRITE_GOLDEN"):
        path.write_text(json.dumps(now, indent=1) + "\n")
    assert list(differences(now, json.loads(path.read_text()), relative)) == []


@pytest.fixture
def result(capsys):
    """Run one command in this process; return what it prints as JSON, without the folder's name."""

    def call(folder, *arguments):
        with pytest.raises(SystemExit) as left:
            run([str(a) for a in arguments])
        out, err = capsys.readouterr()
        assert left.value.code in (0, 4), err  # a missed gate is a result
        printed = out.replace(f"{folder}", "FOLDER").replace(f"{SCENARIOS}", "SCENARIOS")
        return json.loads(printed[printed.index("{") :])

    return call


@pytest.fixture(scope="module")
def linear(linear_logs, tmp_path_factory):
    """A folder with one noisy flight of the linear aircraft."""
    folder = tmp_path_factory.mktemp("golden")
    words = ["import-log", linear_logs["noisy"], "--map", MAP, "--scenario", LINEAR, "--at", "u20"]
    with pytest.raises(SystemExit) as left:
        run([*map(str, words), "-o", f"{folder}/flight.h5"])
    assert left.value.code == 0
    return folder


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("design-linear", [LINEAR]),
        ("design-linear-classic", [LINEAR, "--input", "3-2-1-1"]),
    ],
)
def test_design_inputs(result, tmp_path, name, options):
    words = ["design-inputs", *options, "-o", tmp_path / "design.h5", "--no-study", *QUICK]
    hold(name, result(tmp_path, *words), SEARCHED)


def test_an_optimal_design(result, linear, tmp_path):
    model = tmp_path / "model.h5"
    result(tmp_path, "identify-point", linear / "flight.h5", "--scenario", LINEAR, "-o", model, "--json")
    words = ["design-inputs", LINEAR, "--optimal", "A", "--model", model, "-o", tmp_path / "design.h5"]
    found = result(tmp_path, *words, "--no-study", *QUICK)
    hold("design-linear-optimal", {"keys": sorted(found), "forecast": found["forecast"]}, ALIKE)


@pytest.mark.parametrize(
    ("name", "options", "relative"),
    [
        ("point-linear", [], DIRECT),
        ("point-linear-time", ["--method", "time", "--form", "coefficient"], DIRECT),
        ("point-linear-select", ["--select", "--axes", "stability"], DIRECT),
        ("point-linear-sensors", ["--kinematics", "correct", "--align", "fit"], SEARCHED),
        ("point-linear-instruments", ["--estimator", "instruments"], DIRECT),
    ],
)
def test_identify_point(result, linear, tmp_path, name, options, relative):
    words = ["identify-point", linear / "flight.h5", "--scenario", LINEAR, "-o", tmp_path / "point.h5"]
    hold(name, result(linear, *words, *options, "--json"), relative)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("response-linear", ["--output", "M", "--output", "q", "--input", "de"]),
        ("response-linear-poles", ["--output", "state/q", "--input", "de", "--poles", "2"]),
    ],
)
def test_frequency_response(result, linear, tmp_path, name, options):
    words = ["frequency-response", linear / "flight.h5", "--scenario", LINEAR, "-o", tmp_path / "f.h5"]
    hold(name, result(linear, *words, *options, *QUICK))


def test_swept_response_and_its_fit(result, tmp_path):
    """The linear aircraft, its effectors swept one after the other."""
    design, flight = tmp_path / "sweeps.h5", tmp_path / "swept.h5"
    result(tmp_path, "design-inputs", LINEAR, "--input", "sweep", "-o", design, *QUICK)
    result(tmp_path, "simulate", LINEAR, design, "-o", flight, *QUICK)
    words = ["frequency-response", flight, "--scenario", LINEAR, "--sweeps", "--output", "q", "--input", "de"]
    hold("response-linear-sweeps", result(tmp_path, *words, "--fit", "1/2", *QUICK), SEARCHED)


def test_a_study_its_points_blended_and_a_flight_through_the_corridor(result, tmp_path, monkeypatch):
    """The LA-8 class aircraft with phases as they are drawn: where a search ends depends on the processor."""
    monkeypatch.setattr(
        "freqid.design.multisine.phases.descend", lambda peak, phase, ratio, *_: (phase, ratio)
    )
    scenario, folder = tmp_path / "quick.toml", tmp_path / "study"
    text = LA8.read_text().replace('allocation = "propulsors-low"', 'allocation = "interleaved"\nstarts = 1')
    text = text.replace("net_load = { X = 1, Y = 1, Z = 1, L = 1, M = 1, N = 1 }", "")
    scenario.write_text(text.replace("period_s = 60.0", "period_s = 40.0"))
    words = ["study", scenario, "--at", "u40,u50", "--jobs", "1", "-o", folder, *QUICK]
    hold("study-la8", result(tmp_path, *words), SEARCHED)
    points = [folder / "points" / f"{at}.h5" for at in ("u40", "u50")]
    words = ["global-blend", *points, "-o", tmp_path / "model.h5", "--densities", "together"]
    words += ["--json", "--no-page"]
    hold("blend-la8", result(tmp_path, *words), SEARCHED)
    words = ["simulate", scenario, "-o", tmp_path / "gusts.h5", "--at", "u40", "--duration", "5"]
    words += ["--noise", "1", "--turbulence", "7.7", "--effect", "mass=0.05", *QUICK]
    now = result(tmp_path, *words)
    logged = read_record(tmp_path / "gusts.h5").channels.items()
    hold("simulate-la8", {**now, "last": {n: float(c.values[-1]) for n, c in logged}}, SEARCHED)


def test_diagnose_gap(result, fly_worn, tmp_path):
    """Which accounts are kept, and what is believed to two decimals: the method itself is still moving."""
    fly_worn(tmp_path, 0.5, (1, 2))
    words = ["diagnose-gap", tmp_path / "flight1.h5", tmp_path / "flight2.h5", "-o", tmp_path / "gap.h5"]
    words += ["--sim", f"{tmp_path}/linear_simulation.py:wrench", "--scenario", LINEAR, *QUICK]
    now = result(tmp_path, *words, "--no-next-flight", "--draws", "100")
    believed = {n: round(p, 2) for n, p in now["which"]["probabilities"].items() if p > 0.01}
    hold("gap-linear", {"keys": sorted(now), "exists": now["gap"]["exists"], "probabilities": believed})

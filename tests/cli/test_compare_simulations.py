"""``freqid diagnose-gap`` with two simulations, on flights of a linear aircraft with a worn elevator."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from freqid.core.record import Channel, read_record, write_record
from freqid.core.results.rivals import read_rivals

LOSS = 0.8
MODELS = f"""
from linear_simulation import wrench

def good(time, state, effector, air, parameters):
    return wrench(time, state, effector, air, parameters)

def worn(time, state, effector, air, parameters):
    felt = 0.02 + {1 - LOSS} * (effector["de"] - 0.02)
    return wrench(time, state, {{**effector, "de": felt}}, air, parameters)

def pitch(time, state, effector, air, parameters):
    return {{"M": worn(time, state, effector, air, parameters)["M"]}}

def turn(time, state, effector, air, parameters):
    return {{"CL": 0 * time}}

good.responses = worn.responses = wrench.responses
"""


@pytest.fixture(scope="module")
def folder(script, fly_worn, tmp_path_factory):
    """Two flights of the worn aircraft, models, and recorded predictions of the model that knows it."""
    there = tmp_path_factory.mktemp("rivals")
    (there / "models.py").write_text(MODELS)
    fly_worn(there, LOSS, (1, 2))
    model = script("examples/linear_simulation.py").wrench
    for seed in (1, 2):
        record = read_record(there / f"flight{seed}.h5")
        state, effector = ({n: record[f"{g}/{n}"] for n in record.group(g)} for g in ("state", "effector"))
        effector["de"] = 0.02 + (1 - LOSS) * (effector["de"] - 0.02)
        loads = model(record.time, state, effector, {}, {})
        made = {
            f"response/{n}": Channel(f"response/{n}", "N" if n in "XYZ" else "N m", x, 50.0, "SITL")
            for n, x in loads.items()
        }
        known = {n: c for n, c in record.channels.items() if n.startswith("excitation/")}
        write_record(there / f"said{seed}.h5", replace(record, channels={**made, **known}))
    return there


@pytest.fixture
def compare(freqid, folder, tmp_path):
    """Compare simulations on both flights; return exit code, stdout, stderr and the result's path."""

    def call(*words, page=False):
        told = [str(w).replace("MODELS", f"{folder}/models.py") for w in words]
        output, more = tmp_path / "rivals.h5", [] if page else ["--no-page"]
        flights = [folder / "flight1.h5", folder / "flight2.h5"]
        return *freqid("diagnose-gap", *flights, *told, "-o", output, *more), output

    return call


def test_the_nearer_one_is_told_first_then_where_and_in_a_file_and_a_page(compare, freqid, tmp_path):
    code, out, err, path = compare("--sim", "MODELS:good", "--sim", "MODELS:worn", page=True)
    assert code == 0, err
    first, _, rest = out.partition("\n")
    assert first.startswith("B (")
    assert "is nearer beyond noise and tolerances: " in first
    assert "in M, " in first
    assert first.endswith("is nearer nowhere.")
    assert "misfit A" in rest
    found = read_rivals(path)
    assert found.nearer == "B"
    assert found.verdict == first
    assert {c.response for c in found.contests if c.nearer} <= {"X", "Z", "M"}  # the elevator makes no other
    page = path.with_suffix(".html").read_text()
    assert "Misfits of A and B by response" in page
    code, _, _ = freqid("report", path, "-o", tmp_path / "again.html")
    assert code == 0
    assert (tmp_path / "again.html").read_text() == page


def test_the_same_twice_is_equal(compare):
    code, out, _, _ = compare("--sim", "MODELS:good", "--sim", "MODELS:good", "--json")
    table = json.loads(out)
    assert code == 0
    assert table["identical"]
    assert table["nearer"] == ""
    assert table["contests"] == []
    assert "cannot tell" in table["verdict"]


def test_responses_in_common_are_compared(compare):
    code, out, _, _ = compare("--sim", "MODELS:good", "--sim", "MODELS:pitch", "--json")
    table = json.loads(out)
    assert code == 0
    assert {c["response"] for c in table["contests"]} == {"M"}
    assert any("A alone predicts X, Y, Z, L, N" in remark for remark in table["remarks"])


@pytest.mark.parametrize("way", ["--predictions", "--sim"])
def test_recorded_predictions_are_one_of_two(compare, folder, way):
    said = [folder / "said1.h5", folder / "said2.h5"]
    words = ["--predictions", said[0], "--predictions", said[1]]
    if way == "--sim":
        words = ["--sim", f"{said[0]},{said[1]}"]
    code, out, err, _ = compare("--sim", "MODELS:good", *words, "--json")
    assert code == 0, err
    assert json.loads(out)["nearer"] == "B"


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (("--sim", "MODELS:good", "--sim", "MODELS:worn", "--sim", "MODELS:pitch"), 2, "3 simulations"),
        (("--sim", "MODELS:good", "--sim", "MODELS:worn", "--effect", "mass"), 2, "--effect is for one"),
        (("--sim", "MODELS:good", "--sim", "MODELS:worn", "--holdout", "x.h5"), 2, "--holdout is for"),
        (("--sim", "MODELS:good", "--sim", "MODELS:none"), 2, "no function 'none'"),
        (("--sim", "MODELS:good", "--sim", "MODELS:turn"), 3, "CL"),
        (("--sim", "MODELS:good", "--sim", "absent.h5"), 3, "absent.h5"),
    ],
)
def test_what_cannot_be_compared_is_refused(compare, words, code, sentence):
    found, _, err, path = compare(*words)
    assert found == code
    assert sentence in err
    assert not path.exists()

"""``freqid frequency-response`` as a user runs it."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from freqid.core.record import write_record
from freqid.core.results.frequency_response import read_frequency_response

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracle"))
import closed_loop_plant as plant


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("responses") / "flown.h5"
    write_record(path, plant.fly(gust=0.1, sensor=0.1).record, "")
    return path


def test_responses_are_told_written_and_drawn(freqid, record, tmp_path):
    output = tmp_path / "r.h5"
    code, out, err = freqid(
        "frequency-response", record, "--output", "q", "--output", "state/u", "--json", "-o", output
    )
    assert (code, err) == (0, "")
    found = json.loads(out)
    pair = found["responses"]["q"]["de1"]
    f = np.array(found["frequencies_hz"])
    value = np.array(pair["real"]) + 1j * np.array(pair["imag"])
    truth = plant.response(f)[2, 0]
    # three of the stated standard deviations hold nearly all of both parts
    off = np.abs(value - truth) / np.array(pair["std_error"])
    assert np.mean(off < 3) > 0.95
    assert pair["units"] == "rad/s per rad"
    kept = read_frequency_response(output)
    assert kept.outputs == ("q", "state/u")
    np.testing.assert_array_equal(kept.value[0, 0], value)
    page = output.with_suffix(".html").read_text()
    assert page.count("<svg") == 4
    assert "http://" not in page.replace("http://www.w3.org", "")


def test_only_what_is_asked_for_is_given_and_the_rest_is_still_accounted_for(freqid, record, tmp_path):
    def value(*more):
        code, out, _ = freqid(
            "frequency-response",
            record,
            "--output",
            "q",
            *more,
            "--json",
            "--no-page",
            "-o",
            tmp_path / "r.h5",
        )
        assert code == 0
        return json.loads(out)["responses"]["q"]

    one = value("--input", "de2", "--band", "0.2:1")
    assert list(one) == ["de2", "misfit"]
    both = value("--band", "0.2:1")
    assert one["de2"] == both["de2"]
    assert not (tmp_path / "r.html").exists()


def test_sweeps_of_both_inputs_in_one_record(freqid, tmp_path):
    path = tmp_path / "swept.h5"
    write_record(path, plant.fly_sweeps(duration=60.0).record, "")
    code, out, err = freqid(
        *("frequency-response", path, "--sweeps", "--output", "q", "--band", "0.05:1", "--no-page"),
        *("-o", tmp_path / "w.h5"),
    )
    assert (code, err) == (0, "")
    found = read_frequency_response(tmp_path / "w.h5")
    assert (found.method, found.inputs) == ("sweeps", ("de1", "de2"))
    ratio = found.value[0] / plant.response(found.frequencies_hz)[2]
    assert np.abs(20 * np.log10(np.abs(ratio))).max() < 0.1
    assert "de2" in out


def test_a_fit_is_told_written_and_drawn(freqid, record, tmp_path):
    """The plant has three poles; one sample of delay is half of one by the hold that the law makes."""
    output = tmp_path / "r.h5"
    code, out, err = freqid(
        *("frequency-response", record, "--output", "q", "--input", "de1", "--fit", "2/3", "-o", output)
    )
    assert (code, err) == (0, "")
    found = read_frequency_response(output).fits[0]
    assert found.parameters == ("b0", "b1", "b2", "a0", "a1", "a2", "tau")
    assert np.all(found.insensitivity <= found.cramer_rao * (1 + 1e-9))
    a2, a1, a0 = np.poly(plant.A)[1:]
    for name, exact in (("a0", a0), ("a1", a1), ("a2", a2)):
        estimate, bound = found[name]
        assert abs(estimate - exact) < 4 * bound
    unstable = [
        max(roots.real) for roots in (np.roots([1.0, *found.estimate[[5, 4, 3]]]), np.linalg.eigvals(plant.A))
    ]
    assert unstable[0] == pytest.approx(unstable[1], abs=0.15)
    assert found["tau"][0] == pytest.approx(plant.DT / 2, abs=0.02)
    assert "Cramer-Rao  insensitivity" in out
    page = output.with_suffix(".html").read_text()
    assert page.count("<svg") == 2  # and the mismatch between flight and fit
    assert "Insensitivity" in page


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("--output", "q", "--input", "dx"), 2, "'dx' has no injected signal"),
        (("--output", "nothing"), 3, "nothing"),
        (("--output", "q", "--band", "2:1"), 2, "LOW:HIGH"),
        (("--output", "q", "--fit", "two"), 2, "neither orders M/N"),
        (("--output", "q", "--fit", "state-space"), 2, "give --scenario"),
        (("--output", "q", "--fit", "3/1"), 2, "at most one order more"),
        (("--output", "q", "--fit", "1/2", "--band", "0.3:0.34"), 3, "lower the orders"),
        (("--output", "q", "--sweeps", "--band", "5:8"), 3, "nothing of the band"),
        (("--output", "q", "--sim", "la8"), 2, "do not name the condition"),
        (("--output", "q", "--period", "1000"), 3, "less than their period"),
        (("--output", "q", "--order", "30"), 3, "lower the order"),
    ],
)
def test_what_cannot_be_done_is_said(freqid, record, tmp_path, arguments, code, said):
    found, out, err = freqid("frequency-response", record, *arguments, "-o", tmp_path / "no.h5")
    assert (found, out) == (code, "")
    assert said in err
    assert not (tmp_path / "no.h5").exists()

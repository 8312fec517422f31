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


def test_a_sweep_by_windows(freqid, record, tmp_path):
    code, out, err = freqid(
        *("frequency-response", record, "--windows", "--input", "de1", "--output", "q", "--band", "0.2:1"),
        *("--no-page", "-o", tmp_path / "w.h5"),
    )
    assert (code, err) == (0, "")
    assert read_frequency_response(tmp_path / "w.h5").method == "windows"
    assert "de1" in out


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("--output", "q", "--input", "dx"), 2, "'dx' has no injected signal"),
        (("--output", "nothing"), 3, "nothing"),
        (("--output", "q", "--band", "2:1"), 2, "LOW:HIGH"),
        (("--output", "q", "--windows"), 2, "--windows needs"),
        (("--output", "q", "--period", "1000"), 3, "less than their period"),
        (("--output", "q", "--order", "30"), 3, "lower the order"),
    ],
)
def test_what_cannot_be_done_is_said(freqid, record, tmp_path, arguments, code, said):
    found, out, err = freqid("frequency-response", record, *arguments, "-o", tmp_path / "no.h5")
    assert (found, out) == (code, "")
    assert said in err
    assert not (tmp_path / "no.h5").exists()

"""``freqid margins`` as a user runs it."""

import json

import margins_case
import pytest

import freqid as fq


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("margins")
    fq.save(margins_case.aircraft(), folder / "aircraft.h5")
    (folder / "loop.toml").write_text(margins_case.LOOP)
    return folder


def test_margins_are_told_written_and_drawn(freqid, files):
    code, out, err = freqid(
        "margins", files / "aircraft.h5", files / "loop.toml", "--at", "u6,9", "--draws", "20", "--json"
    )
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert [c["id"] for c in found["conditions"]] == ["u6", "9 m/s"]
    phase = found["conditions"][0]["figures"]["margins/da/phase_deg"]
    assert phase["lo"] < phase["estimate"] < phase["hi"]
    assert phase["unit"] == "deg"
    assert found["conditions"][1]["figures"]["margins/dr/gain_down_db"]["estimate"] == "inf"
    kept = fq.read(files / "aircraft-margins.h5")
    assert kept["u6"]["margins/da/phase_deg"][0] == phase["estimate"]
    assert "<svg" in (files / "aircraft-margins.html").read_text()


def test_the_table_has_the_least_margins(freqid, files):
    code, out, err = freqid(
        "margins", files / "aircraft.h5", files / "loop.toml", "--at", "u9", "--draws", "0", "--no-page"
    )
    assert (code, err) == (0, "")
    assert "attitude hold: least margins over dr da" in out
    assert " da " in out.splitlines()[2]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["aircraft.h5", "loop.toml", "--at", "40"], 3, "u = 40 m/s is outside the corridor"),
        (["aircraft.h5", "loop.toml", "--at", "u7"], 2, "the model has no point 'u7'"),
        (["aircraft.h5", "none.toml"], 3, "none.toml: cannot be read"),
        (["aircraft.h5", "aircraft.h5"], 2, "is no loop file"),
        (["loop.toml", "loop.toml"], 2, "loop.toml"),
        (["aircraft.h5", "loop.toml", "--draws", "3"], 2, "3 draws give no interval"),
    ],
)
def test_bad_input_ends_in_a_sentence(freqid, files, arguments, code, words):
    paths = [files / a if "." in a else a for a in arguments]
    found, out, err = freqid("margins", *paths, "-o", files / "bad.h5")
    assert (found, out) == (code, "")
    assert words in err
    assert not (files / "bad.h5").exists()


def test_a_result_is_never_its_own_page(freqid, files):
    """Each command that draws beside its result refuses before it works."""
    page, files = files / "own.html", [files / "aircraft.h5", files / "loop.toml"]
    design = ("--scenario", files[1])
    for words in (
        ("margins", *files),
        ("predict", *files, *design),
        ("score", *files),
        ("quicklook", *files),
        ("frequency-response", files[0], "--output", "q"),
        ("global-blend", files[0]),
        ("diagnose-gap", files[0]),
    ):
        code, out, err = freqid(*words, "-o", page)
        assert (code, out) == (2, ""), words
        assert f"{page}: the result is no page; the page is written beside it" in err, words
    assert not page.exists()

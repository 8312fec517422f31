"""What options cannot take: one sentence and exit code 2, before anything is written."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    "command",
    [
        ("design-inputs", "linear.toml"),
        ("diagnose-gap", "flight.h5"),
        ("fly-sealed", "la8"),
        ("margins", "model.h5"),
        ("predict", "model.h5"),
        ("simulate", "la8"),
        ("study", "la8"),
    ],
)
def test_a_seed_is_no_negative_number(freqid, command):
    code, _, err = freqid(*command, "--seed", -1)
    assert code == 2
    assert "Invalid value for '--seed': -1 is not in the range x>=0" in err


@pytest.mark.parametrize("command", [("study", "la8"), ("campaign", "campaign.toml")])
@pytest.mark.parametrize(("jobs", "said"), [(0, "0 processes do nothing"), (-2, "is not in the range x>=-1")])
def test_there_is_at_least_one_process(freqid, command, jobs, said):
    code, _, err = freqid(*command, "--jobs", jobs)
    assert code == 2
    assert said in err


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("import-log", "log.csv", "--list", "-o", "flight.h5"), "-o does nothing beside --list"),
        (("import-log", "log.csv", "--list", "--split"), "--split does nothing beside --list"),
        (
            ("diagnose-gap", "flight.h5", "--sim", "a.py:f", "--sim", "b.py:f", "--self-test"),
            "--self-test does nothing beside two simulations",
        ),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(freqid, command, said):
    code, _, err = freqid(*command)
    assert code == 2
    assert said in err

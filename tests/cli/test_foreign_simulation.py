"""The example of docs/tolerances.md: a user's own simulation, its gap found and its null left alone."""

from __future__ import annotations

import json
import shutil

import pytest

LATE = 0.06  # s


@pytest.fixture
def diagnose(freqid, script, tmp_path, monkeypatch):
    """Fly the example's airplane with its elevator late, and return what is said of it."""
    example = script("examples/foreign_simulation.py")
    shutil.copy(example.__file__, tmp_path)
    monkeypatch.chdir(tmp_path)

    def call(late):
        example.write_flights(tmp_path, late)
        words = "diagnose-gap flight1.h5 flight2.h5 --holdout flight3.h5 --sim foreign_simulation.py:wrench"
        code, out, _ = freqid(*words.split(), "--no-page", "--no-next-flight", "--json", "-o", "gap.h5")
        assert code == 0
        return json.loads(out)

    return call


@pytest.mark.slow
def test_a_late_elevator_is_named_with_its_size(diagnose):
    table = diagnose(LATE)
    assert table["gap"]["exists"]
    assert table["which"]["named"] == ["actuator_delay"]
    found = table["which"]["parameters"]["actuator_delay"]["elevator"]
    assert found["estimate"] == pytest.approx(LATE, abs=0.005)
    assert {t["name"] for t in table["tolerances"] if t["source"] == "simulation"} >= {
        "elevator.gain",
        "drag",
    }


def test_an_airplane_that_is_off_by_its_tolerances_is_left_alone(diagnose):
    table = diagnose(0.0)
    assert not table["gap"]["exists"]
    assert table["which"]["named"] == []

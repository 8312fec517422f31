"""Progress where stderr is a file: a line now and then, with the time since the start."""

import pytest

from freqid.cli import progress


@pytest.fixture
def clock(monkeypatch):
    """What the clock shows, s."""
    shown = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: shown[0])
    return shown


def test_steps_of_a_long_run_are_told_with_their_time(clock, capsys):
    tell = progress.line()
    for at, step in (
        (101.0, "reading"),
        (112.0, "replaying"),
        (115.0, "weighing"),
        (180.0, "closing"),
        (999.0, ""),
    ):
        clock[0] = at
        tell(step)
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == "12 s: replaying\n1 min 20 s: closing\n"


def test_a_short_run_tells_nothing(clock, capsys):
    tell = progress.line()
    clock[0] = 109.0
    tell("replaying")
    assert capsys.readouterr().err == ""

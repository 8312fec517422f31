"""The example of docs/python.md runs as it is written, on an LA-8 cut down to what flies in seconds."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import freqid as fq
from freqid.workflows import diagnose

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"
FEW = ("surface_effectiveness", "mass")  # effects that are asked about: all take a minute


def test_the_example_of_the_docs_runs(short_flights, monkeypatch, capsys):
    every = diagnose.effects_with(None)
    monkeypatch.setattr(diagnose, "effects_with", lambda own: {name: every[name] for name in FEW})
    monkeypatch.chdir(short_flights)
    (example,) = re.findall(r"^```py\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    names = {"paths": ["u85.h5", "u102.h5"], "other": fq.read("flight3.h5")}
    exec(compile(example, str(PAGE), "exec"), names)

    model, gap, aircraft = names["model"], names["gap"], names["aircraft"]
    assert gap.verdict in capsys.readouterr().out
    # the flight went through a log and back: its model is that of the record itself
    same = fq.identify_point("flight1.h5", "la8.toml", align="fit")
    assert model["M"]["de1"] == pytest.approx(same["M"]["de1"], rel=1e-6)
    # between two points the elevator pushes as they say on either side
    trim, moved = (aircraft.wrench(u=30.0, **more).values[:, 0] for more in ({}, {"de1": 0.05}))
    slope = (moved - trim)[aircraft.names.index("M")] / (0.05 - aircraft.reference(30.0, 1.225)["de1"][0])
    ends = sorted(fq.read(path)["M"]["de1"][0] for path in names["paths"])
    assert ends[0] < slope < ends[1]
    # elevators that do 60 % too little are beyond noise
    assert gap.gap.exists
    assert fq.read("gap.h5").verdict == gap.verdict
    for written in ("multisine.h", "gap.html"):
        assert Path(written).stat().st_size > 1000

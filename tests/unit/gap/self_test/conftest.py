"""Diagnoses of two short flights of the linear aircraft by a few effects; by default it has no gap."""

from __future__ import annotations

from pathlib import Path

import pytest

from freqid.cli.main import run
from freqid.core.record import read_record
from freqid.core.scenario import read_scenario
from freqid.gap import flights
from freqid.gap.connect import connect
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import library as shipped

PROJECT = Path(__file__).resolve().parents[4]
EFFECTS = ("mass", "surface_effectiveness", "sensor_scale", "cg_offset", "time_skew", "unsteady_lift")


@pytest.fixture(scope="session")
def library():
    every = shipped()
    return {n: every[n] for n in EFFECTS}


@pytest.fixture(scope="session")
def diagnosed(linear_aircraft, library, tmp_path_factory):
    """Fly two flights, log some columns late by so many samples, import and diagnose them."""

    def call(late=(), samples=0):
        folder = tmp_path_factory.mktemp("self_test")
        scenario = PROJECT / "scenarios" / "linear.toml"
        records = []
        for seed in (1, 2):
            log = folder / f"flight{seed}.csv"
            table = linear_aircraft.fly(seed=seed, period=20.0, periods=1)
            for name in late:
                table[name] = table[name].shift(samples).bfill()
            table.to_csv(log, index=False)
            words = ["import-log", log, "--scenario", scenario, "--at", "u20"]
            words += ["--map", PROJECT / "scenarios/maps/linear.toml", "-o", folder / f"flight{seed}.h5"]
            with pytest.raises(SystemExit) as left:
                run([str(w) for w in words])
            assert left.value.code == 0
            records.append(read_record(folder / f"flight{seed}.h5"))
        described, _ = read_scenario(scenario)
        function = f"{PROJECT / 'examples' / 'linear_simulation.py'}:wrench"
        simulation = connect(function, scenario=scenario, record=records[0])
        vehicle = flights.vehicle_of(records, simulation, described.aircraft())
        names = ["flight1", "flight2"]
        flown = flights.maneuvers(records, names, simulation, vehicle)
        tolerances = stated(described.tolerance, library)
        question = Question(library, tolerances, (0.05, 1.8), draws=2000, close=False)
        return diagnose(simulation, flown, question, names=names)

    return call


@pytest.fixture(scope="session")
def findings(diagnosed):
    return diagnosed()


@pytest.fixture(scope="session")
def used(findings):
    """The blocks and columns that the evidence is of."""
    return findings.blocks, findings.columns

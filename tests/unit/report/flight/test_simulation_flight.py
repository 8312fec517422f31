"""The page that ``freqid simulate`` writes beside a record agrees with the flight it is of."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from simulated_flights import ROOT
from test_page import Page

from freqid.cli.simulate import command
from freqid.report.flight import page as simulation_page
from freqid.report.flight.tables import SimulatedFlight
from freqid.views import flight as flight_page

CONDITIONS = ("u45", "u50", "u45-1500m", "u50-1500m")


@dataclass
class Written:
    """What one run of the command left."""

    result: dict
    page: Page
    flight: SimulatedFlight


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Written:
    """Fly 2 s of a scenario that is cut down to four conditions."""
    folder = tmp_path_factory.mktemp("simulated")
    text = (ROOT / "scenarios" / "la8.toml").read_text(encoding="utf-8")
    path = folder / "short.toml"
    path.write_text(
        re.sub(r'\[\[reference\]\]\nid = "(.*)"\n(?:.+\n)*', lambda m: m[0] * (m[1] in CONDITIONS), text),
        encoding="utf-8",
    )
    flights = []
    with pytest.MonkeyPatch.context() as patch:
        original = simulation_page.build_simulation_page
        patch.setattr(
            simulation_page,
            "build_simulation_page",
            lambda flight: (flights.append(flight), original(flight))[1],
        )
        options = ["--at", "u45", "--to", "u50", "--duration", "2", "--json", "-o", str(folder / "r.h5")]
        ran = CliRunner().invoke(command, [str(path), *options], catch_exceptions=False)
    result = json.loads(ran.output)
    return Written(result, Page(Path(result["page"]).read_text(encoding="utf-8")), flights[0])


def test_the_page_stands_beside_the_record(written):
    assert Path(written.result["page"]) == Path(written.result["record"]).with_suffix(".html")
    assert (written.page.faults, written.page.open) == ([], [])
    assert any("instants" in a["aria-label"] for a in written.page.all("svg"))
    largest = {row[0][0]: row[2][1] for row in written.page.cells[0][1:]}
    expected = math.degrees(written.result["excursions"]["theta"]["largest"])
    assert largest["theta"] == pytest.approx(expected, rel=1e-12)


def test_trims_of_both_densities_are_those_that_are_flown(written):
    here, thin = written.flight.trims
    assert (here.rho, thin.rho) == (1.225, 1.0581)
    for curve in (here, thin):
        np.testing.assert_allclose(curve.u, [13.72, 15.24])
    truth = written.flight.truth
    # Power, pitch and effectors at the start come by another way, through the motion's equations.
    start = truth["power/voltage"][0] * truth["power/current"][0]
    assert here.power[0] == pytest.approx(start, rel=1e-9)
    assert here.pitch[0] == pytest.approx(truth["state/theta"][0], abs=1e-9)
    for name, values in here.positions.items():
        assert values[0] == pytest.approx(truth[f"effector/{name}"][0], rel=1e-9, abs=1e-9)
    weight = 28.6 * 9.80665
    thrust = written.flight.thrust[:, 0]
    assert thrust.shape == (8,)
    assert 0.05 * weight < thrust.sum() < weight  # most of it is carried by the wings


def test_a_condition_without_trim_is_left_out(written, monkeypatch):
    from freqid.core.errors import UsageError
    from freqid.simulate.control import trim as trims

    def refuse(scenario, parameters, reference):
        if reference.id == "u50-1500m":
            raise UsageError("level flight is not possible")
        return reference

    monkeypatch.setattr(trims, "trim", refuse)
    at = written.flight.scenario.reference_of("u45")
    first = type("Trimmed", (), {"reference": at})()
    loop = type("Loop", (), {"trims": {"u45": first}, "parameters": None})()
    (others,) = flight_page._others(written.flight.scenario, loop)
    assert [found.id for found in others] == ["u45-1500m"]

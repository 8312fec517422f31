"""A record made from a linear model, and the point model identified from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.record import Channel, Configuration, FlightRecord, Maneuver
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.identify.point import identify_point

REGRESSORS = ("beta", "p", "da", "dr")
TRUTH = {"Y": (-0.85, 0.0, 0.0, 0.33), "L": (-0.11, -0.57, -0.22, 0.02), "N": (0.08, -0.05, 0.0, -0.13)}


@pytest.fixture(scope="session")
def record() -> FlightRecord:
    rng = np.random.default_rng(7)
    time = np.arange(2001) * 0.02
    histories = {}
    for j, name in enumerate(REGRESSORS):
        lines = (2 + j + 4 * np.arange(12)) / time[-1]
        phases = rng.uniform(0, 2 * np.pi, lines.size)
        histories[name] = 0.02 * np.sin(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)
    groups = {"beta": "air", "p": "state", "da": "effector", "dr": "effector"}
    units = {"p": "rad/s"}
    channels = [
        Channel(f"{groups[name]}/{name}", units.get(name, "rad"), values, 50.0, f"log.csv: {name}")
        for name, values in histories.items()
    ]
    channels.append(Channel("command/da", "rad", histories["da"] * 1.02, 50.0, "log.csv: da_cmd"))
    channels.append(Channel("effector/n1", "rad/s", 600 + 20 * histories["dr"], 50.0, "log.csv: rpm"))
    for response, truth in TRUTH.items():
        clean = np.array(truth) @ np.array([histories[name] for name in REGRESSORS])
        name = {"Y": "CY", "L": "Cl", "N": "Cn"}[response]
        noise = 0.05 * clean.std() * rng.standard_normal(time.size)
        channels.append(Channel(f"response/{name}", "1", clean + noise + 0.01, 50.0, "computed"))
    surface = {"kind": "surface", "limits": (-0.5, 0.5)}
    vehicle = Vehicle(
        name="Test aircraft",
        mass_properties=MassProperties(mass_kg=10.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.5)),
        effectors=(Effector(name="da", **surface), Effector(name="dr", **surface)),
    )
    return FlightRecord(
        time,
        {channel.name: channel for channel in channels},
        vehicle=vehicle,
        configuration=Configuration(tail="T-1", firmware="fw 2", parameter_hash="c0ffee"),
        provenance={"source": {"file": "log.csv", "sha256": "ab" * 32}},
    )


@pytest.fixture(scope="session")
def model(record: FlightRecord) -> PointModel:
    settings = Identification(
        responses=("Y", "L", "N"),
        regressors=REGRESSORS,
        response_source="record",
        form="coefficient",
        nuisance="constant",
        frequencies_hz=tuple((np.arange(2, 50) / record.duration).tolist()),
    )
    found = identify_point(Maneuver.of(record), settings, reference=Reference(id="cruise", u=50.0, rho=1.1))
    time = found["N"].fit["time"]
    prediction = {"N": Fit(time.axis, time.measured, 0.9 * time.modelled)}
    sources = {"record": "reports/one.h5", "predicted": "reports/two.h5", "log": record.provenance}
    return replace(found, prediction=prediction, provenance=sources)

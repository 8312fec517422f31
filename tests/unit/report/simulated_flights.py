"""Flights of the LA-8 class aircraft that no simulation has flown: plain curves whose numbers are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord
from freqid.core.scenario import Scenario, read_scenario

ROOT = Path(__file__).resolve().parents[3]


def scenario_of(path: Path) -> Scenario:
    return read_scenario(ROOT / path)[0]


def film_record(scenario: Scenario, excited: tuple[str, ...] = ()) -> tuple[FlightRecord, np.ndarray]:
    """Return a truth of 20 s from hover to 20 m/s, and thrusts that halve on the way."""
    time = np.linspace(0, 20, 2001)
    share = time / time[-1]
    still = np.zeros(time.size)
    values = {f"state/{name}": still for name in ["u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "alt"]}
    values |= {"state/u": 20 * share, "state/theta": -0.05 * share, "state/q": 0.1 * np.sin(time)}
    values |= {"power/voltage": 48 - share, "power/current": 90 - 60 * share}
    for effector in scenario.effector:
        fixed = {"surface": 0.1 * np.sin(time), "rotor": 600 - 100 * share, "tilt": 1.5 - 1.4 * share}
        values[f"effector/{effector.name}"] = fixed[effector.kind]
        values[f"command/{effector.name}"] = fixed[effector.kind] + 0.01
    values |= {f"excitation/{name}": 0.02 * np.sin(3 * time) for name in excited}
    kinds = scenario.aircraft().effector_kinds
    channels = {
        name: Channel(name, si_unit(name, kinds) or "", row, 100.0, "made") for name, row in values.items()
    }
    how = {
        "effects": {"slipstream": {"strength": 1.0}, "turbulence": {"wind_20ft": 3.0}},
        "wind_m_s": [3.0, 4.0, 0.0],
        "seed": 5,
        "noise": 1.0,
        "sensors": "owner",
        "feedback": True,
    }
    truth = FlightRecord(
        time,
        channels,
        vehicle=scenario.aircraft(),
        reference="u00",
        provenance={"simulation": how},
    )
    return truth, np.outer(np.full(8, 40.0), 1 - 0.5 * share)

"""Flights of the LA-8 class simulation that several benchmarks measure, flown once and kept.

Each is one manoeuvre at one condition, in still air; sensors and wind are added afterwards, as often as is
wanted. A steady wind carries the vehicle along and changes nothing relative to the air, because the control
law holds speed in it. Truths are kept in the system's folder for temporary files.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np
from _la8 import PATH, SCENARIO, SHA256

import freqid as fq
from freqid.core.errors import DataError
from freqid.core.results.design import read_inputs
from freqid.core.scenario import Reference
from freqid.simulate import runner, sensors
from freqid.simulate.air.dryden import steady_wind
from freqid.simulate.maneuver import LOG_RATE, Conditions, fly_maneuver
from freqid.simulate.truth import read_truth, write_truth
from freqid.workflows.studies import units

FOLDER = Path(tempfile.gettempdir()) / "freqid-la8-flights"
SEA, MIDDLE, HIGH = 1.225, 1.1392, 1.0581  # kg/m3: 0, 750 and 1500 m of the standard atmosphere
REFERENCES = tuple(at for at in SCENARIO.reference if at.rho == SEA)
# Between the scenario's speeds, m/s, at tilts that fly level with a level body to the nearest half degree.
BETWEEN = (
    ("u02", 0.762, 80.0),
    ("u07", 2.286, 70.5),
    ("u12", 3.810, 62.0),
    ("u17", 5.334, 54.0),
    ("u22", 6.858, 47.0),
    ("u27", 8.382, 40.5),
    ("u33", 10.06, 34.0),
    ("u38", 11.58, 28.5),
    ("u42", 12.95, 24.5),
    ("u47", 14.48, 20.5),
    ("u52", 16.00, 17.0),
    ("u58", 17.83, 13.5),
    ("u66", 20.12, 10.5),
    ("u73", 22.40, 8.0),
    ("u81", 24.69, 6.5),
)


@lru_cache(maxsize=1)
def corridors() -> dict[str, tuple[Reference, ...]]:
    """Return all conditions, by corridor of one density and one schedule of tilt.

    ``"sea level"`` has those of `BETWEEN` too; ``"1500 m"`` is the scenario's and ``"750 m"`` like it, both
    tilted by true speed; ``"1500 m, equivalent"`` is tilted by equivalent speed.
    """
    between = tuple(
        Reference.of(id=name, u=u, rho=SEA, dw1=float(np.radians(tilt)), dw2=float(np.radians(tilt)))
        for name, u, tilt in BETWEEN
    )
    faster = np.sqrt(SEA / HIGH)

    def moved(suffix: str, rho: float, factor: float = 1.0) -> tuple[Reference, ...]:
        change = msgspec.structs.replace
        return tuple(change(at, id=at.id + suffix, u=factor * at.u, rho=rho) for at in REFERENCES)

    return {
        "sea level": tuple(sorted(REFERENCES + between, key=lambda at: at.u)),
        "750 m": moved("-750m", MIDDLE),
        "1500 m": tuple(at for at in SCENARIO.reference if at.rho == HIGH),
        "1500 m, equivalent": moved("-1500m-eas", HIGH, faster),
    }


def reference_of(identifier: str) -> Reference:
    """Return one condition."""
    return {at.id: at for along in corridors().values() for at in along}[identifier]


def fly(path: Path, *, reference: str, corridor: str, among: list[list[float]], design: Path) -> None:
    """Write the truth of one manoeuvre; `among` makes a changed corridor another unit of work."""
    scenario = msgspec.structs.replace(SCENARIO, reference=corridors()[corridor])
    at = reference_of(reference)
    flown = fly_maneuver(scenario, at, read_inputs(design), Conditions(), loop=_loop(corridor))
    if flown.divergence:
        raise DataError(str(flown.divergence), where=reference, remedy="lower the inputs")
    write_truth(path, flown.truth, SHA256)


@lru_cache(maxsize=4)
def _loop(corridor: str):
    from freqid.simulate.control.lq import close_loop

    along = corridors()[corridor]
    return close_loop(msgspec.structs.replace(SCENARIO, reference=along), along[0])


def flights(ids: Sequence[str], seed: int = 0, jobs: int = 2) -> dict[str, fq.FlightRecord]:
    """Return truths by condition; `seed` is that of the multisines."""
    here = {"scenario_sha256": SHA256, "suffix": ".h5", "beside": {"scenario": PATH}}
    design = runner.run_units(units.design, [{"seed": seed}], FOLDER, **here)[0]
    inputs = [
        {
            "reference": at.id,
            "corridor": corridor,
            "among": [[at.u, at.rho, at["dw1"]] for at in along],
            "design": design,
        }
        for corridor, along in corridors().items()
        for at in along
        if at.id in ids
    ]
    paths = runner.run_units(fly, inputs, FOLDER, scenario_sha256=SHA256, suffix=".truth.h5", jobs=jobs)
    found = {str(i["reference"]): path for i, path in zip(inputs, paths, strict=True)}
    return {i: read_truth(found[i]) for i in ids}


def measured(
    truth: fq.FlightRecord, seed: int, noise: float = 1.0, suite: str = "research", **changed: sensors.Sensor
) -> fq.FlightRecord:
    """Return what a suite logs of a flight, some of its sensors changed.

    With ``"owner"`` on a day of its own for each seed, with ``"owner, still air"`` without wind.
    """
    described = {**sensors.suite(SCENARIO, suite.partition(",")[0]), **changed}
    wind = np.zeros((3, truth.time.size))
    if suite == "owner":
        wind = blowing(truth, steady_wind(SCENARIO, suite, seed))
    return sensors.measure(truth, wind, sensors.with_scaled_noise(described, noise), LOG_RATE, seed)


def blowing(truth: fq.FlightRecord, wind: np.ndarray) -> np.ndarray:
    """Return a level wind north, east in the body axes of a flight, shape (3, sample)."""
    phi, theta, psi = truth.matrix(f"state/{n}" for n in ("phi", "theta", "psi"))
    along = np.cos(psi) * wind[0] + np.sin(psi) * wind[1]
    across = np.cos(psi) * wind[1] - np.sin(psi) * wind[0]
    rolled = np.sin(theta) * along
    return np.stack(
        [
            np.cos(theta) * along,
            np.sin(phi) * rolled + np.cos(phi) * across,
            np.cos(phi) * rolled - np.sin(phi) * across,
        ]
    )

"""Flights of the LA-8 class simulation that several benchmarks measure, flown once and kept.

Each is one manoeuvre at one condition, in still air; sensors and wind are added afterwards, as often as is
wanted. A steady wind carries the vehicle along and changes nothing relative to the air, because the control
law holds speed in it. Truths are kept in the system's folder for temporary files.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec
import numpy as np

from freqid.core.design_file import read_inputs
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.scenario import Reference, Scenario, read_scenario
from freqid.simulate import runner, sensors
from freqid.simulate.maneuver import LOG_RATE, Conditions, fly_maneuver
from freqid.simulate.truth import read_truth, write_truth
from freqid.simulate.turbulence import steady_wind
from freqid.study import work

PATH = Path(__file__).resolve().parents[1] / "scenarios" / "la8.toml"
SCENARIO, SHA256 = read_scenario(PATH)
FOLDER = Path(tempfile.gettempdir()) / "freqid-la8-flights"
SEA, MIDDLE, HIGH = 1.225, 1.1392, 1.0581  # kg/m3: 0, 750 and 1500 m of the standard atmosphere
REFERENCES = tuple(at for at in SCENARIO.reference if at.rho == SEA)
# Conditions that the scenario does not have: between its speeds, at tilts that fly level with a level body to
# the nearest half degree.
EXTRA = (
    ("u02", 0.762, 80.0),
    ("u05", 1.524, 75.0),
    ("u07", 2.286, 70.5),
    ("u15", 4.572, 57.5),
    ("u25", 7.620, 44.0),
    ("u33", 10.06, 34.0),
    ("u38", 11.58, 28.5),
    ("u42", 12.95, 24.5),
    ("u47", 14.48, 20.5),
    ("u52", 16.0, 17.0),
    ("u58", 17.83, 13.5),
    ("u66", 20.12, 10.5),
    ("u73", 22.40, 8.0),
    ("u77", 23.47, 7.5),
    ("u81", 24.69, 6.5),
)


def added() -> tuple[Reference, ...]:
    """Return the conditions that the scenario lacks: those of `EXTRA`, and its own speeds at 750 m."""
    between = tuple(
        Reference(id=name, u=u, rho=SEA, dw1=np.radians(tilt), dw2=np.radians(tilt))
        for name, u, tilt in EXTRA
    )
    middle = tuple(msgspec.structs.replace(at, id=f"{at.id}-750m", rho=MIDDLE) for at in REFERENCES)
    return between + middle


@lru_cache(maxsize=1)
def finer() -> Scenario:
    """Return the scenario with `added` conditions."""
    return msgspec.structs.replace(SCENARIO, reference=(*SCENARIO.reference, *added()))


def fly(path: Path, *, reference: str, at: tuple[float, float, float], design: str) -> None:
    """Write the truth of one manoeuvre; `at` makes a changed condition another unit of work."""
    scenario = finer()
    here = scenario.reference_of(reference)
    flown = fly_maneuver(scenario, here, read_inputs(Path(design)), Conditions(), loop=_loop(here.rho))
    if flown.divergence:
        raise DataError(str(flown.divergence), where=reference, remedy="lower the inputs")
    write_truth(path, flown.truth, SHA256)


@lru_cache(maxsize=3)
def _loop(rho: float):
    from freqid.simulate.lq import close_loop

    return close_loop(finer(), next(at for at in finer().reference if at.rho == rho))


def flights(ids: Sequence[str], seed: int = 0, jobs: int = 2) -> dict[str, FlightRecord]:
    """Return truths by condition; `seed` is that of the multisines."""
    shared = [{"scenario": str(PATH), "seed": seed}]
    design = runner.run(work.design, shared, FOLDER, scenario_sha256=SHA256, suffix=".h5")[0]
    found = [finer().reference_of(i) for i in ids]
    inputs = [
        {"reference": at.id, "at": (at.u, at.rho, round(at.dw1, 6)), "design": str(design)} for at in found
    ]
    paths = runner.run(fly, inputs, FOLDER, scenario_sha256=SHA256, suffix=".truth.h5", jobs=jobs)
    return {i: read_truth(path) for i, path in zip(ids, paths, strict=True)}


def measured(
    truth: FlightRecord, seed: int, noise: float = 1.0, suite: str = "research", **changed: sensors.Sensor
) -> FlightRecord:
    """Return what a suite logs of a flight, some of its sensors changed.

    With ``"owner"`` on a day of its own for each seed, with ``"owner, still air"`` without wind.
    """
    described = {**sensors.suite(SCENARIO, suite.partition(",")[0]), **changed}
    wind = np.zeros((3, truth.time.size))
    if suite == "owner":
        wind = blowing(truth, steady_wind(SCENARIO, suite, seed))
    return sensors.measure(truth, wind, sensors.scaled(described, noise), LOG_RATE, seed)


def blowing(truth: FlightRecord, wind: np.ndarray) -> np.ndarray:
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

"""Flights of several aircraft as their sensors log them, seeded, for benchmarks of what reads logs."""

from __future__ import annotations

import os
import sys
from functools import lru_cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import msgspec

import freqid as fq
from freqid.core.results.design import MultisineDesign
from freqid.core.scenario import Scenario

HERE = Path(__file__).resolve().parent
SCENARIOS = HERE.parent / "scenarios"
# Linear aircraft; propellers in front of a wing; tilt-wing with 20 effectors: hover-like to wing-borne.
AIRCRAFT = (
    ("linear", "u20"),
    ("dep6", "u15"),
    ("la8", "u45"),
    ("linear", "u20"),
    ("dep6", "u21"),
    ("la8", "u20"),
    ("dep6", "u18"),
    ("la8", "u70"),
)
# Flown for judging alone: nothing was written or tuned with it.
UNSEEN = (("transport", "u50"),)


def asked(first_seed: int) -> tuple[int, tuple[tuple[str, str], ...], str]:
    """Return first seed, aircraft and the end of the table's name; the latter is empty for no table."""
    if "--seed" in sys.argv:
        return int(sys.argv[sys.argv.index("--seed") + 1]), AIRCRAFT, ""
    return (first_seed, UNSEEN, "_unseen.csv") if "--unseen" in sys.argv else (first_seed, AIRCRAFT, ".csv")


@lru_cache
def scenario(name: str) -> Scenario:
    """Return one aircraft's scenario."""
    folder = HERE if name == "transport" else SCENARIOS
    return fq.read_scenario(folder / f"{name}.toml")


@lru_cache
def design(name: str, seed: int) -> MultisineDesign:
    """Return the inputs that an aircraft is flown with; the seed is that of their phases."""
    excitation = scenario(name).excitation
    assert excitation is not None
    # a minute at least, as logs of one condition last
    periods = max(excitation.periods, round(60.0 / excitation.period_s))
    excitation = msgspec.structs.replace(excitation, periods=periods)
    described = msgspec.structs.replace(scenario(name), excitation=excitation)
    found = fq.design_inputs(described, seed=seed).design
    assert isinstance(found, MultisineDesign)
    return found


LEVEL = 0.5  # m/s, to whose multiples gusts are rounded: each has a compiled simulation of its own


@lru_cache
def _loop(name: str, rho: float, turbulence: float):
    described = scenario(name)
    at = next(r.id for r in described.reference if r.rho == rho and r.u > 5.0)
    return fq.simulate(described, at=at, duration=0.5, turbulence=turbulence).loop


def logged(
    name: str, at: str, seed: int, *, turbulence: float = 0.5, flown: MultisineDesign | None = None
) -> fq.FlightRecord:
    """Return what an aircraft logs of one manoeuvre, with all its noise, in gusts (wind at 20 ft, m/s)."""
    described = scenario(name)
    level = LEVEL * round(turbulence / LEVEL)
    return fq.simulate(
        described,
        design(name, seed % 3) if flown is None else flown,
        at=at,
        noise=1.0,
        turbulence=level,
        seed=seed,
        loop=_loop(name, described.reference_of(at).rho, level),
    ).record

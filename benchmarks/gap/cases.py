"""Cases: which truth at which detectability, flown on an aircraft that is a little off everywhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from _la8 import SCENARIO, inputs
from truths import OTHER, OUTSIDE, OWN, Truth, _section, _times, find

from freqid.core.errors import FreqidError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.scenario import Scenario
from freqid.core.store import replacing
from freqid.gap.compare import Compared, compare, evidence_of
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.residual import residual
from freqid.gap.tolerance import stated
from freqid.simulate.effects import shipped
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

AT = ("u20", "u45")
DURATION = 60.0  # s
BAND_HZ = (0.05, 1.9)
STRATA = (15, 50, 200)
GUSTS = 1.5  # m/s at 20 ft, in every fifth case
DRAWS = 40
CLOSE = 1.6  # times a stratum's detectability, or so much less, that a size may miss it by

Complex = np.ndarray


@dataclass(frozen=True)
class Part:
    """A truth of a case at a size."""

    truth: Truth
    place: str
    size: float


REFERENCE = {r.id: r for r in SCENARIO.reference}
SIMULATION = ScenarioSimulation(SCENARIO)
LIBRARY = shipped()
TOLERANCES = stated(dict(SCENARIO.tolerance), LIBRARY)


def scattered(seed: int) -> tuple[Scenario, dict[str, dict[str, float]]]:
    """Return the aircraft a little off everywhere, within what the tool allows for, and its mass effects."""
    rng = np.random.default_rng([seed, 11])

    def off(sigma: float) -> float:
        return float(sigma * np.clip(rng.standard_normal(), -2, 2))

    def airframe(table: dict[str, Any]) -> dict[str, Any]:
        for path, sigma in (
            ("aerofoil.lift_slope", 0.04),
            ("aerofoil.drag", 0.05),
            ("aerofoil.lift_drag", 0.05),
            ("tail.aerofoil.lift_slope", 0.05),
            ("propeller.thrust", 0.03),
            ("propeller.torque", 0.05),
            ("propeller.inplane_force", 0.05),
            ("propeller.hub_moment", 0.05),
            ("fuselage.drag_area_m2", 0.05),
            ("wake.downwash", 0.05),
            ("wake.blowing", 0.05),
            ("mixing_m", 0.05),
            ("surface_efficiency", 0.05),
        ):
            _times(table, path, 1 + off(sigma))
        return table

    def actuators(table: dict[str, Any]) -> dict[str, Any]:
        for path in ("surface.frequency_hz", "surface.damping", "tilt.frequency_hz"):
            _times(table, path, 1 + off(0.05))
        speed = 1 + off(0.05)
        _times(table, "motor.rise_s", speed)
        _times(table, "motor.fall_s", speed)
        return table

    def inertia() -> dict[str, float]:
        """Return fractions that a body can have: no moment exceeds the sum of the other two."""
        stated = SCENARIO.aircraft().mass_properties.inertia
        while True:
            each = {axis: off(0.03) for axis in ("xx", "yy", "zz")}
            xx, yy, zz = (getattr(stated, axis) * (1 + x) for axis, x in each.items())
            if zz < xx + yy:
                return each

    found = _section(_section(SCENARIO, "airframe", airframe), "actuators", actuators)
    mass = {
        "mass": {"fraction": off(0.01)},
        "cg_offset": {axis: off(0.005) for axis in "xyz"},
        "inertia": inertia(),
    }
    return found, mass


def in_force(identifier: str) -> dict[str, float]:
    """Return an effect's parameters in the simulation."""
    return SIMULATION.effects[identifier]


def flown(
    at: str,
    parts: Sequence[Part],
    *,
    noise: float = 0.0,
    gusts: float = 0.0,
    seed: int = 0,
    scatter: int | None = None,
    signals: int = 0,
) -> FlightRecord:
    """Fly one manoeuvre of a case and return its log, which describes the nominal vehicle."""
    scenario, added = scattered(scatter) if scatter is not None else (SCENARIO, {})
    for part in parts:
        scenario = part.truth.scenario(scenario, part.size, part.place)
        for identifier, values in part.truth.settings(part.size, part.place).items():
            here = added.setdefault(identifier, {})
            for name, value in values.items():
                here[name] = here.get(name, 0.0) + value
    every = SIMULATION.effects
    table = {i: {n: every[i].get(n, 0.0) + x for n, x in of.items()} for i, of in added.items()}
    conditions = Conditions(noise=noise, turbulence=gusts, seed=seed)
    flight = fly_maneuver(
        with_effects(scenario, table), REFERENCE[at], inputs(signals), conditions, duration=DURATION
    )
    if flight.divergence:
        raise ArithmeticError(f"{at}: {flight.divergence}")
    record = replace(flight.record, vehicle=SCENARIO.aircraft())
    for part in parts:
        record = part.truth.record(record, part.size, part.place)
    return record


ALLOWED = {i: e for i, e in LIBRARY.items() if any(name.partition(".")[0] == i for name in TOLERANCES)}


def measured(record: FlightRecord, seed: int) -> Compared:
    """Return a manoeuvre with its noise and tolerances, for the metric that they make."""
    return compare(SIMULATION, Maneuver.of(record), ALLOWED, TOLERANCES, BAND_HZ, count=DRAWS, seed=seed)


@lru_cache(maxsize=16)
def _without(at: str, signals: int, gusts: float, seed: int, scatter: int | None) -> Any:
    record = flown(at, (), gusts=gusts, seed=seed, scatter=scatter, signals=signals)
    return residual(SIMULATION, Maneuver.of(record))


def change(
    at: str,
    parts: Sequence[Part],
    compared: Compared,
    *,
    signals: int = 0,
    gusts: float = 0.0,
    seed: int = 0,
    scatter: int | None = None,
) -> Complex:
    """Return what truths make of one manoeuvre's stack without noise, on the lines of what is compared.

    Both flights have the same scatter and gusts. The metric has to be of a flight with the truths: what
    tolerances may do goes with the motion, which the truths change.
    """
    record = flown(at, parts, gusts=gusts, seed=seed, scatter=scatter, signals=signals)
    without = _without(at, signals, gusts, seed, scatter)
    return compared.lines.transform(residual(SIMULATION, Maneuver.of(record)) - without)


def detectability(compared: Sequence[Compared], s: Sequence[Complex]) -> float:
    """Return lambda of a change, tolerances integrated over."""
    evidence = evidence_of(compared, changes=[(0 * z, {"truth": z}) for z in s])
    return float(evidence.metric[1, 1])


def sized(truth: Truth, place: str, target: float, noise: float, folder: Path) -> float:
    """Return the size at which a truth has a detectability on the nominal aircraft, kept in a folder.

    Raises
    ------
    ArithmeticError
        Where no size does.
    """
    name = f"{truth.id}-{truth.form}-{place or 'all'}-{target:g}-{noise:g}".replace(" ", "_")
    path = folder / f"{name}.txt"
    if path.is_file():
        return float(path.read_text())
    known = _scaled(truth, place, target, folder)
    if known:
        return min(known, truth.most)
    tried: dict[float, float] = {}
    size = truth.one
    for _ in range(7):
        size = min(size, truth.most)
        try:
            parts = [Part(truth, place, size)]
            with_it = [measured(flown(at, parts, noise=noise, seed=900), 5) for at in AT]
            s = [change(at, parts, c) for at, c in zip(AT, with_it, strict=True)]
        except (FreqidError, ArithmeticError, ValueError) as error:
            smaller = [x for x in tried if x < size]
            if not smaller and size < 1e-3 * truth.one:
                raise ArithmeticError(f"{name}: {error}") from None
            size = 0.5 * (size + max(smaller)) if smaller else 0.3 * size
            continue
        got = tried[size] = detectability(with_it, s)
        if 1 / CLOSE < got / target < CLOSE or (got < target and size >= truth.most):
            break
        # in logarithms: where two are known, through both, else as the square of the size
        known = sorted(tried, key=lambda x: abs(np.log(max(tried[x], 1e-9) / target)))[:2]
        power = 2.0
        if len(known) == 2 and tried[known[0]] > 0 and tried[known[1]] > 0:
            rise = np.log(tried[known[0]] / tried[known[1]]) / np.log(known[0] / known[1])
            power = float(np.clip(rise, 0.7, 8.0)) if np.isfinite(rise) else 2.0
        size = known[0] * (target / max(tried[known[0]], 1e-9)) ** (1 / power)
    if not tried:
        raise ArithmeticError(f"{name}: no size flies")
    size = min(tried, key=lambda x: abs(np.log(max(tried[x], 1e-9) / target)))
    got = tried[size]
    if not 0.5 < got / target < 2:
        raise ArithmeticError(f"{name}: detectability {got:.3g} at most or at least, size {size:.4g}")
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(path) as partial:
        partial.write_text(f"{size!r}\n")
    return size


def _scaled(truth: Truth, place: str, target: float, folder: Path) -> float | None:
    """Return the size that goes with one found at another detectability; each case measures its own."""
    for path in sorted(folder.glob(f"{truth.id}-{truth.form}-{place or 'all'}-*.txt".replace(" ", "_"))):
        at = float(path.stem.rsplit("-", 2)[1])
        return float(path.read_text()) * float(np.sqrt(target / at))
    return None


def nuisance(number: int) -> dict[str, float]:
    """Return noise and gusts of a case by its number."""
    return {
        "noise": 2.0 if number % 4 == 3 else 1.0,
        "gusts": GUSTS if number % 5 == 4 else 0.0,
    }


def _place(truth: Truth, number: int) -> str:
    return truth.places[number % len(truth.places)]


def nulls(count: int) -> list[dict[str, Any]]:
    """Return cases without an effect."""
    return [{"kind": "null", "parts": [], "lam": 0, "seed": k, **nuisance(k)} for k in range(count)]


def singles(truths: Sequence[Truth], seeds: Sequence[int], strata: Sequence[int] = STRATA) -> list[dict]:
    """Return cases of one effect each: every truth, stratum and seed."""
    found = []
    for seed in seeds:
        for i, truth in enumerate(truths):
            for j, lam in enumerate(strata):
                number = 7 * i + 3 * j + 5 * seed
                part = [truth.id, truth.form, _place(truth, i + j + seed)]
                kind = "outside" if truth.id.startswith("outside") else "single"
                found.append(
                    {
                        "kind": kind,
                        "parts": [part],
                        "lam": lam,
                        "seed": 1000 + 100 * i + 10 * j + seed,
                        "turn": seed,
                        **nuisance(number),
                    }
                )
    return found


def doubles(count: int) -> list[dict[str, Any]]:
    """Return cases of two effects, each at 50 or 200."""
    rng = np.random.default_rng(3)
    found = []
    while len(found) < count:
        a, b = (PRIMARY[i] for i in rng.choice(len(PRIMARY), 2, replace=False))
        number = len(found)
        parts = [[t.id, t.form, _place(t, int(rng.integers(10)))] for t in (a, b)]
        found.append(
            {
                "kind": "double",
                "parts": parts,
                "lam": (50, 200)[number % 2],
                "seed": 9000 + number,
                **nuisance(number),
            }
        )
    return found


_OTHERWISE = {t.id: t for t in OTHER}
PRIMARY = tuple(_OTHERWISE.get(t.id, t) for t in OWN)
"""One truth an effect: in another form than the candidate's where there is one."""

SECOND = tuple(t for t in OWN if t.id in _OTHERWISE)
"""The library's own formulas of the others."""


def planned(nulls_: int = 60, seeds: int = 3, outside: int = 30, pairs: int = 30) -> list[dict[str, Any]]:
    """Return all cases, the most wanted first."""
    rest = singles(OUTSIDE, range(5), (50, 200))
    return [
        *nulls(nulls_)[:8],
        *(case for lam in (50, 200) for case in singles(PRIMARY, [0]) if case["lam"] == lam),
        *rest[:12],
        *doubles(pairs)[:6],
        *nulls(nulls_)[8:],
        *(case for case in singles(PRIMARY, [0]) if case["lam"] == 15),
        *rest[12:outside],
        *doubles(pairs)[6:],
        *(case for seed in range(1, seeds) for case in singles(PRIMARY, [seed])),
        *singles(SECOND, [3]),
    ]


def parts_of(case: Mapping[str, Any], folder: Path) -> list[Part]:
    """Return a case's truths at their sizes."""
    found = []
    for identifier, form, place in case["parts"]:
        truth = find(identifier, form)
        size = sized(truth, place, float(case["lam"]), float(case["noise"]), folder)
        found.append(Part(truth, place, size))
    return found


def described(case: Mapping[str, Any]) -> str:
    """Return a case in a few words."""
    names = "+".join(f"{i}/{form}{'/' + place if place else ''}" for i, form, place in case["parts"])
    return f"{case['kind']} {names} lambda {case['lam']} seed {case['seed']}"

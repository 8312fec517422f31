"""Cases of a second vehicle: JSBSim's c172p beside edited copies of itself, a little off everywhere.

What `cases` holds for the LA-8, by the same names: `run` and `table` take either. A case is flown by JSBSim
at 200 Hz and compared by replay through the adapter; nothing that the flights are made of is seen by it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cases
import numpy as np
from c172p_craft import RATE_HZ, Craft, excitation, fly
from c172p_truths import INSIDE, OUTSIDE, SECOND, Edited, find
from cases import CLOSE, Complex, Part, described, detectability
from gap_c172p import KINDS, NOISE

from freqid.core.channels import si_unit
from freqid.core.errors import FreqidError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.store import replacing
from freqid.gap.compare import Compared, compare
from freqid.gap.connect.jsbsim import load
from freqid.gap.residual import residual
from freqid.gap.tolerance import stated
from freqid.simulate.effects import shipped

__all__ = ["described"]

SPEEDS = {"v29": 29.0, "v48": 48.0}  # m/s
AT = tuple(SPEEDS)
DURATION, BAND_HZ, DRAWS = cases.DURATION, cases.BAND_HZ, cases.DRAWS
STEPS_OF = {  # of sensors in coarse cases
    **dict.fromkeys(("state/u", "state/v", "state/w"), 0.1),
    **dict.fromkeys(("state/phi", "state/theta", "state/psi"), np.radians(0.1)),
    **dict.fromkeys(("state/ax", "state/ay", "state/az"), 0.02),
    **dict.fromkeys(("effector/elevator", "effector/aileron", "effector/rudder"), np.radians(0.1)),
}
JITTER = 0.002  # s, of the moments at which they are read in coarse cases
LIBRARY = shipped()
TOLERANCES = stated({}, LIBRARY)
ALLOWED = {i: e for i, e in LIBRARY.items() if any(name.partition(".")[0] == i for name in TOLERANCES)}
SIMULATION = load("c172p")


def in_force(identifier: str) -> dict[str, float]:
    """Return an effect's parameters in the simulation, which has none."""
    return dict.fromkeys(LIBRARY[identifier].parameters, 0.0)


def scattered(seed: int) -> Craft:
    """Return the aircraft with every coefficient, its propeller and its masses a little off."""
    rng = np.random.default_rng([seed, 11])

    def off(sigma: float) -> float:
        return float(sigma * np.clip(rng.standard_normal(), -2, 2))

    craft = Craft.nominal()
    for name in craft.coefficients:
        craft.times(name, 1 + off(0.05))
    for table in craft.propeller.findall("table"):
        factor, data = 1 + off(0.03), table.find("tableData")
        assert data is not None
        pairs = (line.split() for line in (data.text or "").strip().splitlines())
        data.text = "\n".join(f"{a} {factor * float(c)}" for a, c in pairs)
    craft.ballast(off(0.01) * craft.weighed().weight)
    craft.shift([off(0.005) for _ in range(3)])
    craft.turn_harder({axis: off(0.03) for axis in ("xx", "yy", "zz")})
    return craft


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
    """Fly one manoeuvre of a case and return its log, which describes the nominal vehicle.

    Sensors of every third case have coarse digits and are read at jittering moments.
    """
    craft = scattered(scatter) if scatter is not None else Craft.nominal()
    for part in parts:
        if isinstance(part.truth, Edited):
            craft = part.truth.craft(craft, part.size, part.place)
    time = np.arange(round(RATE_HZ * DURATION)) / RATE_HZ
    injected = excitation(time, 20 + 10 * signals + AT.index(at))
    values = fly(craft, SPEEDS[at], injected, gusts=gusts, seed=seed)
    units = {n: "1" if n.startswith(("command", "excitation")) else si_unit(n, KINDS) or "1" for n in values}
    channels = {n: Channel(n, units[n], x, RATE_HZ, "JSBSim") for n, x in values.items()}
    record = FlightRecord(time, channels, vehicle=SIMULATION.vehicle)
    for part in parts:
        record = part.truth.record(record, part.size, part.place)
    return _read(record, noise, seed, scatter is not None and scatter % 3 == 1) if noise else record


def _read(record: FlightRecord, noise: float, seed: int, coarse: bool) -> FlightRecord:
    rng = np.random.default_rng([seed, 1])
    found = []
    for name, sigma in NOISE.items():
        values = record[name]
        if coarse and name.startswith("state/"):
            values = values + JITTER * rng.standard_normal(values.size) * np.gradient(values, record.dt)
        values = values + noise * sigma * rng.standard_normal(values.size)
        if coarse and name in STEPS_OF:
            values = STEPS_OF[name] * np.round(values / STEPS_OF[name])
        found.append(replace(record.channel(name), values=values))
    return record.with_channels(*found)


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
    """Return what truths make of one manoeuvre's stack without noise, as `cases.change`."""
    record = flown(at, parts, gusts=gusts, seed=seed, scatter=scatter, signals=signals)
    without = _without(at, signals, gusts, seed, scatter)
    return compared.lines.transform(residual(SIMULATION, Maneuver.of(record)) - without)


def sized(truth: Edited, place: str, target: float, noise: float, folder: Path) -> float:
    """Return the size at which a truth has a detectability on the nominal aircraft.

    What is found of a truth on the way is kept in the folder, so that other strata begin from it.

    Raises
    ------
    ArithmeticError
        Where no size does.
    """
    name = f"c172p-{truth.id}-{truth.form}-{place or 'all'}-{noise:g}".replace(" ", "_")
    path = folder / f"{name}.json"
    known = dict(json.loads(path.read_text())) if path.is_file() else {}
    tried = {float(size): float(found) for size, found in known.items()}
    too_much = truth.most * 1.0001
    for _ in range(0 if tried else 3):  # a known curve is scaled: what a case has is measured in it
        size = _next(tried, truth.one, target, truth.most, too_much)
        if size in tried:
            break
        try:
            parts = [Part(truth, place, size)]
            with_it = [measured(flown(at, parts, noise=noise, seed=900), 5) for at in AT]
            s = [change(at, parts, c) for at, c in zip(AT, with_it, strict=True)]
        except (FreqidError, ArithmeticError, ValueError):
            too_much = size
            continue
        tried[size] = detectability(with_it, s)
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial:
            partial.write_text(json.dumps({repr(k): v for k, v in tried.items()}) + "\n")
    if not tried:
        raise ArithmeticError(f"{name}: no size flies")
    size = min(tried, key=lambda x: abs(np.log(max(tried[x], 1e-9) / target)))
    return min(size * float(np.sqrt(target / max(tried[size], 1e-9))), truth.most)


def _next(tried: Mapping[float, float], one: float, target: float, most: float, too_much: float) -> float:
    """Return what size to try next: one that was tried where it is good enough or nothing is beyond."""
    if not tried:
        return one if one < too_much else 0.4 * too_much
    near = sorted(tried, key=lambda x: abs(np.log(max(tried[x], 1e-9) / target)))[:2]
    if 1 / CLOSE < tried[near[0]] / target < CLOSE:
        return near[0]
    power = 2.0
    if len(near) == 2 and min(tried[n] for n in near) > 0:
        rise = np.log(tried[near[0]] / tried[near[1]]) / np.log(near[0] / near[1])
        power = float(np.clip(rise, 0.7, 8.0)) if np.isfinite(rise) else 2.0
    size = near[0] * float(np.clip((target / max(tried[near[0]], 1e-9)) ** (1 / power), 0.05, 8.0))
    size = min(size, most)
    return size if size < too_much else 0.5 * (near[0] + too_much)


def _of(listed: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{"vehicle": "c172p", **case} for case in listed]


def doubles(count: int) -> list[dict[str, Any]]:
    """Return cases of two effects, each at 50 or 200."""
    rng = np.random.default_rng(3)
    found = []
    while len(found) < count:
        a, b = (INSIDE[i] for i in rng.choice(len(INSIDE), 2, replace=False))
        number = len(found)
        parts = [[t.id, t.form, t.places[int(rng.integers(10)) % len(t.places)]] for t in (a, b)]
        found.append(
            {
                "kind": "double",
                "parts": parts,
                "lam": (50, 200)[number % 2],
                "seed": 9000 + number,
                **cases.nuisance(number),
            }
        )
    return found


def planned(nulls_: int = 40, seeds: int = 2, outside: int = 24, pairs: int = 12) -> list[dict[str, Any]]:
    """Return all cases, the most wanted first."""
    first = cases.singles(INSIDE, [0])
    rest = cases.singles(OUTSIDE, range(2), (50, 200))
    return _of(
        [
            *cases.nulls(nulls_)[:20],
            *(case for lam in (200, 50) for case in first if case["lam"] == lam),
            *rest[:16],
            *cases.singles(SECOND, [3]),
            *(case for case in first if case["lam"] == 15),
            *doubles(pairs),
            *cases.nulls(nulls_)[20:],
            *rest[16:outside],
            *(case for seed in range(1, seeds) for case in cases.singles(INSIDE, [seed])),
        ]
    )


def parts_of(case: Mapping[str, Any], folder: Path) -> list[Part]:
    """Return a case's truths at their sizes."""
    found = []
    for identifier, form, place in case["parts"]:
        truth = find(identifier, form)
        found.append(
            Part(truth, place, sized(truth, place, float(case["lam"]), float(case["noise"]), folder))
        )
    return found

"""How often 90 % intervals of a refit hold the truth, where truth and candidate have the same formula.

    python benchmarks/gap/intervals.py FOLDER [--seeds 4] [--jobs 2]

The LA-8 with each effect by the library's own formula, at each of its places and a size about a plausible
one, flown in two manoeuvres of 60 s with scatter everywhere; the effect is refitted as a closure refits it. A
refit takes what the effect itself may be off by for the effect: scatter of mass counts as truth, and what a
parameter scales is not scattered besides. A battery's unit in the scenario is not the candidate's. What was
found is kept in the folder, so that a run resumes; ``intervals.csv`` beside this script gets one row a refit.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench import Circumstances  # first: it finds what lies beside it
from la8_bench import LA8, flown, scattered
from la8_own import OWN
from provenance import code
from table import rate
from truth import Part, Truth

from freqid.core.errors import FreqidError
from freqid.gap import attribute
from freqid.gap.closures import start_of
from freqid.gap.gather import evidence_of
from freqid.gap.refit import refit
from freqid.gap.testable import in_force_of
from freqid.simulate import runner

CSV = Path(__file__).resolve().with_name("intervals.csv")
STILL = {
    "surface_effectiveness": ("surface_efficiency",),
    "weak_rotor": ("propeller.thrust", "propeller.torque"),
    "slipstream": ("propeller.thrust",),
    "rotor_inplane_force": ("propeller.inplane_force", "propeller.hub_moment"),
    "wing_wake": ("wake.downwash", "wake.blowing"),
    "extra_drag": ("fuselage.drag_area_m2",),
}
"""Parts of the airframe's table that are as described where an effect that scales them is fitted."""

OF_ONE_FORM = tuple(t for t in OWN if t.id != "battery_sag")
BENCH = replace(LA8, draws=20)  # no null is asked about: draws are for the noise's covariance alone
REACH = 1.6449  # standard errors of 90 %
SPREAD = 0.5  # of the logarithm of the size, either way


def work(path: Path, identifier: str, place: str, seed: int) -> None:
    """Fly one effect, refit it, and write how far the estimate is from what flew."""
    began = time.perf_counter()
    truth = next(t for t in OWN if t.id == identifier)
    rng = np.random.default_rng([seed, OWN.index(truth), truth.places.index(place)])
    part = Part(truth, place, truth.one * float(np.exp(rng.uniform(-SPREAD, SPREAD))))
    row = {"effect": identifier, "place": place, "seed": seed, "size": part.size}
    try:
        row |= _refitted(part, seed)
    except (FreqidError, ArithmeticError) as error:
        row |= {"note": str(error)}
    row |= {"seconds": round(time.perf_counter() - began, 1), "code": code()}
    path.write_text(json.dumps(row) + "\n")


def _refitted(part: Part, seed: int) -> dict[str, Any]:
    identifier = part.truth.id
    how = [
        Circumstances(noise=1.0, seed=7000 + 10 * seed + i, scatter=500 + seed) for i in range(len(LA8.at))
    ]
    still = STILL.get(identifier, ())
    flights = [flown(at, [part], h, still) for at, h in zip(LA8.at, how, strict=True)]
    candidate = {identifier: LA8.candidates[identifier]}
    used = [BENCH.measured(f, seed + i, **candidate) for i, f in enumerate(flights)]
    library = {identifier: candidate[identifier].of(flights[0].vehicle)}
    evidence = evidence_of(used, seed=seed)
    name = next(iter(part.truth.settings(part.size, part.place)[identifier]))
    start = {identifier: {name: in_force_of(library[identifier], LA8.simulation)[name]}}
    if not library[identifier].alternatives:
        judged = [j for j in attribute.judge(evidence, library) if j.name == identifier]
        if not judged:
            return {"note": "it changes nothing in these manoeuvres"}
        start = start_of((identifier,), evidence, judged, library, used)
    fitted = refit(used, list(library.values()), start)
    at = fitted.names.index((identifier, name))
    value, sigma = float(fitted.value[at]), float(np.sqrt(fitted.covariance[at, at]))
    true = _true(part, in_force_of(library[identifier], LA8.simulation), name, 500 + seed)
    return {
        "parameter": name,
        "true": true,
        "estimate": value,
        "error_in_sigma": (value - true) / sigma,
        "held": int(abs(value - true) <= REACH * sigma),
        "at_bound": int(fitted.names[at] in fitted.at_bound),
        "undetermined": int(fitted.names[at] in fitted.undetermined),
    }


def _true(part: Part, force: Mapping[str, float], name: str, scatter: int) -> float:
    """Return what flew: in force in the simulation, scatter, and the effect on top."""
    identifier = part.truth.id
    aside = scattered(scatter)[1].get(identifier, {}).get(name, 0.0)
    return force[name] + aside + part.truth.settings(part.size, part.place)[identifier][name]


def cases(seeds: int) -> list[dict[str, Any]]:
    """Return all refits, every effect at one of its places before any at the next."""
    every: list[tuple[int, Truth, int, str]] = [
        (i, truth, seed, place)
        for truth in OF_ONE_FORM
        for i, place in enumerate(truth.places)
        for seed in range(seeds)
    ]
    every.sort(key=lambda one: (one[2], one[0]))
    return [{"identifier": t.id, "place": place, "seed": seed} for _, t, seed, place in every]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    folder = given.folder.resolve()
    runner.run(work, cases(given.seeds), folder, jobs=given.jobs)
    told(folder)


def told(folder: Path) -> None:
    """Write the table of all refits in a folder, and say how many intervals held the truth."""
    rows = sorted(
        (json.loads(p.read_text()) for p in folder.glob("*.json") if p.name != "units.json"),
        key=lambda r: (r["effect"], r["place"], r["seed"]),
    )
    names = list(dict.fromkeys(n for r in rows for n in r))
    with CSV.open("w", newline="") as file:
        table = csv.DictWriter(file, names, lineterminator="\n")
        table.writeheader()
        table.writerows({n: f"{x:.5g}" if isinstance(x, float) else x for n, x in r.items()} for r in rows)
    known = [r for r in rows if "held" in r]
    print(f"90 % intervals hold the truth    {rate(r['held'] for r in known)}")
    for effect in dict.fromkeys(r["effect"] for r in known):
        print(f"  {effect:<30} {rate(r['held'] for r in known if r['effect'] == effect)}")


if __name__ == "__main__":
    main()

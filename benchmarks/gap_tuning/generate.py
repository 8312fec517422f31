"""Make tuning cases: `python benchmarks/gap_tuning/generate.py OUT --vehicle c172p --nulls 8`."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from types import ModuleType

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import c172p
import la8
import numpy as np
from scatter import Settings

from freqid.core.record import Maneuver, write_record
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.infer.where import gap_map
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import library

VEHICLES = {"la8": la8, "c172p": c172p}
STRATA = (50.0, 200.0, 1000.0)


def of_a_null(vehicle: ModuleType, seed: int) -> Findings:
    """Return the diagnosis of flights without an effect, for the sizes of effects."""
    simulation, effects = vehicle.simulation(), library()
    flights = [Maneuver.of(r, simulation.vehicle) for r in vehicle.flown({}, seed)[:-1]]
    names = [f"flight {k}" for k in range(len(flights))]
    tolerances = stated({}, effects, simulation, flights[0].vehicle)
    question = Question(effects, tolerances, vehicle.BAND_HZ, draws=100, close=False)
    return diagnose(simulation, flights, question, names=names)


def size_of(found: Findings, effect: str, parameter: str, sign: int, wanted: float) -> float | None:
    """Return the size of an effect at which its detectability in a diagnosis's own stack is as wanted.

    Noise, offsets and tolerances are allowed for, errors of form are not. None where no size that the
    diagnosis looks for reaches it.
    """
    system = found.evidence.system
    for i, c in enumerate(system.candidates):
        if (
            c.effect == effect
            and c.kind == "scalar"
            and parameter in c.place.parameters
            and not c.place.fixed
        ):
            at = system.columns_of(i)
            G = system.reduced(system.form_errors[0]).G[at, at]
            sizes = np.linspace(0, max(np.abs(c.prior)), 2001)
            weights = np.array([c.weights(sign * s) for s in sizes])
            power = np.einsum("si,ij,sj->s", weights, G, weights)
            enough = np.flatnonzero(power >= wanted)
            return float(sign * sizes[enough[0]]) if enough.size else None
    return None


def where(found: Findings, effect: str, parameter: str, size: float) -> dict[str, dict[str, float]]:
    """Return where an effect is detectable beyond noise and tolerances, by row and by injected input."""
    for c in found.evidence.system.candidates:
        if (
            c.effect == effect
            and c.kind == "scalar"
            and parameter in c.place.parameters
            and not c.place.fixed
        ):
            made = [np.tensordot(c.weights(size), z, 1) for z in c.columns]
            cells = gap_map(found.blocks, found.columns, [made])
            return {
                "rows": {n: round(x, 4) for n, x in cells.share("row").items() if x > 1e-3},
                "inputs": {n or "none": round(x, 4) for n, x in cells.share("input").items() if x > 1e-3},
            }
    return {}


def write(out: Path, name: str, case: dict, effect: Settings) -> None:
    """Fly a case and write its records and what it is."""
    vehicle = VEHICLES[name]
    folder = out / name / case["case"]
    folder.mkdir(parents=True, exist_ok=True)
    records = vehicle.flown(effect, case["seed"])
    files = [f"{k}.h5" for k in range(len(records))]
    for file, record in zip(files, records, strict=True):
        write_record(folder / file, record)
    case |= {"vehicle": name, "set": f"tuning-{name}", "effects": effect, "band_hz": list(vehicle.BAND_HZ)}
    case |= {"use": files[:-1], "holdout": files[-1:], "simulation": vehicle.SIMULATION}
    case |= {"scenario": vehicle.SCENARIO_FILE}
    (folder / "case.json").write_text(json.dumps(case, indent=1) + "\n", encoding="utf-8")
    print(name, case["case"], flush=True)


def main() -> None:
    """Write the cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--vehicle", choices=VEHICLES, required=True)
    parser.add_argument("--nulls", type=int, default=8)
    parser.add_argument("--singles", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    first = 1000 * args.seed
    for k in range(args.nulls):
        write(args.out, args.vehicle, {"case": f"null_{first + k}", "kind": "null", "seed": first + k}, {})
    if not args.singles:
        return
    vehicle = VEHICLES[args.vehicle]
    found = of_a_null(vehicle, first + 999)
    for k in range(args.singles):
        effect, parameter, sign = vehicle.PLACES[k % len(vehicle.PLACES)]
        stratum = STRATA[(k + k // len(vehicle.PLACES)) % len(STRATA)]
        size = size_of(found, effect, parameter, sign, stratum)
        if size is None:
            print(f"{effect} {parameter} does not reach {stratum:g}")
            continue
        seed = first + 500 + k
        case = {"case": f"single_{effect}-{parameter}_{stratum:g}_{seed}", "kind": "single", "seed": seed}
        case |= {"stratum": stratum, "lambda": {effect: stratum}, "place": {effect: None}}
        case |= {"where": where(found, effect, parameter, size)}
        write(args.out, args.vehicle, case, {effect: {parameter: size}})


if __name__ == "__main__":
    main()

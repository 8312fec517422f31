"""Make judging cases: `python benchmarks/gap_judging/generate.py OUT --vehicle quadplane --kind null`."""

from __future__ import annotations

import argparse
import json
import os
import pickle
import sys
import time
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
import sensing
from candidates import Candidate, candidates, outsiders
from detectability import STRATA, IdealScan, metric, signatures
from motion import fly
from multisine import load_module
from pilot import pilot_inputs
from scatter import KINDS, added, draw, kind_of, per_case, per_flight
from settings import Settings
from stack import stack

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord, write_record
from freqid.core.scenario import read_scenario

HERE = Path(__file__).resolve().parent
FILES = ("1", "2", "h")  # repeats, and another that is held out; a pilot's inputs are all different
VEHICLES = (
    "quadplane",
    "vtail",
    "tiltrotor",
    "canard",
    "blownwing",
    "tiltwing",
    "winghex",
    "ttail",
    "airtaxi",
)
CASES = 50  # flown together


def matrices(out: Path, vehicle: str, scanned: bool = True):
    """Return truth, simulation, metric, signatures of effects and of outsiders, ideal scan; kept in `out`.

    Unless `scanned`, only truth and simulation.
    """
    truth = load_module(HERE / vehicle / "truth.py")
    simulation = load_module(truth.SIMULATION)
    if not scanned:
        return truth, simulation, None, None, None, None
    kept = out / f"{vehicle}.pickle"
    if kept.exists():
        m, known, others = pickle.loads(kept.read_bytes())
    else:
        m = metric(truth, simulation)
        print("metric is made", flush=True)
        known = signatures(truth, simulation, m, candidates(truth))
        print("signatures of effects are made", flush=True)
        others = signatures(truth, simulation, m, outsiders(truth))
        out.mkdir(parents=True, exist_ok=True)
        kept.write_bytes(pickle.dumps((m, known, others)))
        for found in (known, others):
            for c, sizes in zip(found.candidates, found.size, strict=True):
                missed = [f"{s:g}" for s, size in zip(STRATA, sizes, strict=True) if np.isnan(size)]
                if missed:
                    print(f"{c.label} does not reach {', '.join(missed)}")
    return truth, simulation, m, known, others, IdealScan(m, known)


def plans(args, truth, known, others) -> list[dict]:
    """Return what acts in each case, without scatter."""
    if args.effect:
        key, _, size = args.effect.partition("=")
        by_key = {c.key: c for c in candidates(truth)}
        if key not in by_key:
            sys.exit(f"{args.vehicle} has no effect '{key}', expected one of: {', '.join(by_key)}")
        name = f"single_{key.replace('.', '-').replace('@', '-')}={size}_{args.seed}"
        return [{"id": name, "stratum": None, "acts": [], "asked": [(by_key[key], float(size))]}]
    rng = np.random.default_rng([args.seed, 7])
    count = 10 if args.count is None else args.count
    if args.kind == "null":
        return [{"id": f"null_{args.seed}_{i:03d}", "stratum": None, "acts": []} for i in range(count)]
    if args.kind == "outsider":
        wanted = [float(x) for x in (args.strata or "200").split(",")]
        out = [
            {"id": f"outsider_{c.parameter}_{s:g}", "stratum": s, "acts": [(others, i, STRATA.index(s))]}
            for i, c in enumerate(others.candidates)
            for s in wanted
            if not np.isnan(others.size[i, STRATA.index(s)])
        ]
        return out if args.count is None else [out[i] for i in rng.permutation(len(out))[:count]]
    by_id: dict[str, list[int]] = {}
    for i, c in enumerate(known.candidates):
        by_id.setdefault(c.id, []).append(i)
    out = []
    if args.kind == "single":
        deck: list[
            str
        ] = []  # of effects; a stratum goes on where the last one stopped, so that all take turns
        for s in (float(x) for x in (args.strata or "15,50,200,1000").split(",")):
            j = STRATA.index(s)
            able = {n: [i for i in members if not np.isnan(known.size[i, j])] for n, members in by_id.items()}
            names = [n for n, members in able.items() if members]
            if args.count is not None:
                names, deck = dealt(deck, by_id, names, count, rng)
            for name in names:
                chosen = rng.permutation(able[name])[: args.places]
                for i in chosen:
                    c = known.candidates[i]
                    label = f"{c.id}-{c.parameter}" + (f"-{c.place}" if c.place else "")
                    out.append(
                        {
                            "id": f"single_{label}_{s:g}_{args.seed}",
                            "stratum": s,
                            "acts": [(known, int(i), j)],
                        }
                    )
        return out
    j = STRATA.index(200.0)
    able = {n: [i for i in members if not np.isnan(known.size[i, j])] for n, members in by_id.items()}
    names = [n for n, members in able.items() if members]
    for k in range(count):
        a, b = rng.choice(names, 2, replace=False)
        acts = [(known, int(rng.choice(able[n])), j) for n in (a, b)]
        out.append({"id": f"pair_{args.seed}_{k:02d}_{a}+{b}", "stratum": 200.0, "acts": acts})
    return out


def dealt(deck, every, able, count, rng):
    """Return names of effects that are next on the deck and able, and the deck without them."""
    taken: list[str] = []
    while len(taken) < min(count, len(able)):
        fitting = [n for n in deck if n in able and n not in taken]
        if not fitting:
            deck = deck + rng.permutation(list(every)).tolist()
            continue
        taken.append(fitting[0])
        deck = [n for k, n in enumerate(deck) if k != deck.index(fitting[0])]
    return taken, deck


def record_of(truth, scenario, channels, condition, name) -> FlightRecord:
    """Return a record as a logger would have written it; it says nothing of the truth."""
    vehicle = scenario.aircraft()
    kinds = vehicle.effector_kinds
    place = tuple(float(x) for x in truth.SENSOR)
    made = {
        key: Channel(
            key,
            si_unit(key, kinds),
            values,
            50.0,
            "judging set",
            place if key[6:] in ("ax", "ay", "az") else None,
        )
        for key, values in channels.items()
    }
    return FlightRecord(sensing.TIME, made, vehicle, None, condition, provenance={"file": name})


def make(args, plan, setup) -> None:
    """Fly, measure, judge and write a batch of cases."""
    truth, simulation, m, known, others, scan = setup
    scenario, sha = read_scenario(HERE / args.vehicle / "scenario.toml")
    conditions = list(truth.TRIM)
    sigmas, biases = per_case(truth), per_flight(truth)
    flights, departures = [], []
    for case in plan:
        case["seed"] = int(
            np.random.SeedSequence([args.seed, *args.vehicle.encode(), *case["id"].encode()]).generate_state(
                1
            )[0]
        )
        rng = np.random.default_rng(case["seed"])
        case["common"], case["own"] = only(args.scatter, draw(sigmas, rng)), []
        effect = {c.key: size for c, size in case.get("asked", ())}
        for source, i, j in case["acts"]:
            c: Candidate = source.candidates[i]
            effect[c.key] = c.sign * float(source.size[i, j])
        for condition in conditions:
            for name in FILES:
                design = FILES.index(name) if args.inputs == "pilot" else int(name == "h")
                flights.append({"condition": condition, "design": design})
                case["own"].append(only(args.scatter, draw(biases, rng)))
                departures.append(added(case["common"], case["own"][-1], effect))
    excitation = partial(pilot_inputs, truth.SCENARIO) if args.inputs == "pilot" else truth.excitation
    log = fly(truth, flights, Settings(departures), excitation=excitation, gust=args.gusts, seed=args.seed)
    seen = {id(source): source.beyond(m) for source in (known, others)} if scan else {}
    signals = excitation(sensing.TIME)
    at = 0
    for case in plan:
        rng = np.random.default_rng([case["seed"], 1])
        folder = args.out / args.vehicle / case["id"]
        mean = -m.bias if scan else 0.0
        for c, condition in enumerate(conditions):
            rho = truth.TRIM[condition]["rho"]
            if not np.abs(log.state[:, 6:8, at]).max() < 1.0:
                print(f"{case['id']} lost control in {condition}")
            for name in FILES:
                channels = sensing.measure(truth, log, at, departures[at], rng)
                if scan and name != "h":
                    mean[c] += 0.5 * stack(truth, simulation, channels, rho)
                for i, e in enumerate(truth.EFFECTORS):
                    channels[f"excitation/{e}"] = signals[flights[at]["design"], i]
                file = f"{condition}_{name}.h5"
                record = record_of(truth, scenario, sensing.with_air(channels, rho), condition, file)
                write_record(folder / file, record, sha)
                at += 1
        case["ideal"] = None
        if scan:  # it is ideal in this too: it knows the owner's error of form and the mean of the scatter
            white = m.whiten(mean) - m.beyond_first
            white = white - sum(source.column[i, j] - seen[id(source)][i, j] for source, i, j in case["acts"])
            case["ideal"] = scan.judge(white, [s.candidates[i].id for s, i, _ in case["acts"]])
        text = json.dumps(described(args, case, truth, m, conditions), indent=1)
        (folder / "case.json").write_text(text + "\n")


def only(kinds: list[str], drawn: dict[str, float]) -> dict[str, float]:
    """Return draws of some kinds of scatter, the others at zero."""
    return {name: value if kind_of(name) in kinds else 0.0 for name, value in drawn.items()}


def described(args, case, truth, m, conditions) -> dict:
    """Return the content of ``case.json``."""
    effects: dict[str, dict[str, float]] = {}
    places, power, where = {}, {}, {"rows": {}, "inputs": {}}
    total = 0.0
    for c, size in case.get("asked", ()):
        effects[c.id], places[c.id] = c.described(size), c.place
    for source, i, j in case["acts"]:
        c = source.candidates[i]
        name = f"outsider:{c.parameter}" if c.id == "outsider" else c.id
        effects.setdefault(name, {}).update(c.described(c.sign * float(source.size[i, j])))
        places[name] = c.place
        if args.inputs == "pilot" or args.gusts:
            continue  # detectability and where it lies are known for the multisine in still air
        power[name] = round(float(source.detectability[i, j]), 2)
        for kind, parts in source.shares[i][j].items():
            for key, value in parts.items():
                where[kind][key] = where[kind].get(key, 0.0) + value * power[name]
        total += power[name]
    where = {kind: {k: round(v / total, 4) for k, v in parts.items()} for kind, parts in where.items()}
    return {
        "case": case["id"],
        "vehicle": args.vehicle,
        "set": args.vehicle
        + ("-loads" if args.no_flight else "")
        + ("-pilot" if args.inputs == "pilot" else "")
        + ("-gusts" if args.gusts else ""),
        "kind": args.kind,
        "effects": effects,
        "place": places,
        "stratum": case["stratum"],
        "lambda": power,
        "where": where,
        "ideal": case["ideal"],
        "use": [f"{c}_{n}.h5" for c in conditions for n in ("1", "2")],
        "holdout": [f"{c}_h.h5" for c in conditions],
        "simulation": f"benchmarks/gap_judging/{args.vehicle}/simulation.py:"
        + ("loads_alone" if args.no_flight else "wrench"),
        "scenario": f"benchmarks/gap_judging/{args.vehicle}/scenario.toml",
        "seed": case["seed"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--vehicle", choices=VEHICLES, required=True)
    parser.add_argument("--kind", choices=("null", "single", "pair", "outsider"), required=True)
    parser.add_argument(
        "--count",
        type=int,
        help="of nulls or pairs (10), of singles in each stratum or of outsiders (all)",
    )
    parser.add_argument("--strata", help="of singles and outsiders, such as 15,50,200,1000")
    parser.add_argument(
        "--places", type=int, default=1, help="parameters or places of one effect in a stratum"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--scatter", nargs="*", choices=KINDS, default=list(KINDS), help="what is drawn, to tell causes"
    )
    parser.add_argument(
        "--no-scan", action="store_true", help="nulls only: without the ideal scan, which takes minutes"
    )
    parser.add_argument(
        "--effect", metavar="KEY=SIZE", help="one single at a size, without scan: weak_rotor.loss@ro_fl=0.25"
    )
    parser.add_argument("--no-flight", action="store_true", help="the owner's simulation cannot fly")
    parser.add_argument(
        "--inputs",
        choices=("multisine", "pilot"),
        default="multisine",
        help="a pilot's are steps and sweeps, no two records alike; sizes are those of the multisine",
    )
    parser.add_argument(
        "--gusts",
        type=float,
        default=0.0,
        metavar="SIGMA",
        help="of vertical gusts, m/s; sizes are those in still air",
    )
    args = parser.parse_args()
    if args.no_scan and args.kind != "null":
        parser.error("--no-scan is for --kind null: sizes of effects are made from its matrices")
    if args.effect and args.kind != "single":
        parser.error("--effect is for --kind single")
    start = time.time()
    setup = matrices(args.out, args.vehicle, not (args.no_scan or args.effect))
    if args.inputs == "pilot" or args.gusts:
        setup = (*setup[:5], None)  # the ideal scan knows the multisine in still air alone
    print(f"matrices after {time.time() - start:.0f} s")
    plan = plans(args, setup[0], setup[3], setup[4])
    for first in range(0, len(plan), CASES):
        make(args, plan[first : first + CASES], setup)
        print(
            f"{min(first + CASES, len(plan))} of {len(plan)} cases after {time.time() - start:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()

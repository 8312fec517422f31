"""Open cases of gap diagnosis, each flown and diagnosed: one JSON a case, resumable.

python benchmarks/gap/run.py FOLDER [--vehicle la8|c172p] [--jobs 2] [--only null|single|outside|double]
    [--first N]

A run goes on from the cases in its folder; ``tar xf benchmarks/gap/cases.tar.xz -C PARENT`` puts those that
are kept into PARENT/la8 and PARENT/c172p.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import plans
from against_truth import around, closed, of_truth
from bench import Bench, Case
from provenance import code
from sizes import parts_of
from told import plain, told
from truth import Part

from freqid import __version__
from freqid.core.record import Maneuver
from freqid.core.store import replacing
from freqid.gap import diagnose
from freqid.gap.diagnose import Question
from freqid.gap.evidence import Evidence
from freqid.simulate import runner

PLANS = {"la8": plans.la8, "c172p": plans.c172p}
CLOSED, EACH = 50, 6  # detectability from which every sixth case is closed
_CODE = "BENCH_CODE"  # tells workers what is run, which is no input that a case is resumed by


def vehicle(name: str) -> Bench:
    """Return a vehicle; only its own simulation is loaded."""
    if name == "c172p":
        from c172p_bench import C172P

        return C172P
    from la8_bench import LA8

    return LA8


def work(path: Path, **case: Any) -> None:
    """Fly and diagnose one case; write what was found."""
    by = vehicle(case.get("vehicle", "la8"))
    began = time.perf_counter()
    home = path.parent.parent
    parts = parts_of(by, case, home / "sizes")
    seed = int(case["seed"])
    flights = [by.fly(at, parts, around(case, i)) for i, at in enumerate(by.at)]
    question = Question(by.candidates, by.tolerances, by.band_hz, draws=by.draws, seed=seed, close=False)
    found = diagnose.diagnose(by.simulation, [Maneuver.of(f) for f in flights], question, names=by.at)
    table: dict[str, Any] = {
        "case": case,
        "version": __version__,
        "code": os.environ.get(_CODE) or code(),
        "truth": [_truth(by, part) for part in parts],
        **told(found),
    }
    if parts:
        table |= of_truth(by, found, parts, case)
        if case["kind"] == "single" and case["lam"] >= CLOSED and seed % EACH == 0:
            table["closure"] = closed(by, found, parts, case)
    table["seconds"] = round(time.perf_counter() - began, 1)
    _keep(home / "evidence" / f"{path.name.strip('.').split('.')[0]}.npz", found.evidence, case)
    path.write_text(json.dumps(plain(table), allow_nan=False) + "\n")
    with (home / "bench.log").open("a") as log:
        top = next(iter(found.diagnosis.which.probabilities.items()))
        log.write(
            f"{time.strftime('%H:%M:%S')} {plans.described(case)} lambda {table.get('lambda')}: "
            f"p {found.diagnosis.gap.p:.2g}, {top[0]} {top[1]:.2f} ({table['seconds']} s)\n"
        )


def _truth(by: Bench, part: Part) -> dict[str, Any]:
    truth = part.truth
    return {
        "id": truth.id,
        "form": truth.form,
        "place": part.place,
        "size": part.size,
        "settings": truth.settings(part.size, part.place) if truth.form == "own" else {},
        "in_force": by.in_force(truth.id) if truth.id in by.candidates else {},
    }


def _keep(path: Path, evidence: Evidence, case: Case) -> None:
    """Keep the metric, from which every judgement can be made again."""
    with replacing(path) as partial, partial.open("wb") as file:
        np.savez_compressed(
            file,
            metric=evidence.metric.astype(np.float32),
            data=evidence.metric[:, 0],
            signatures=np.array(evidence.signatures),
            tolerances=np.array(evidence.tolerances),
            null=evidence.null,
            rows=evidence.rows,
            case=json.dumps(case),
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vehicle", choices=tuple(PLANS), default="la8")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="")
    parser.add_argument("--first", type=int, default=None)
    given = parser.parse_args()
    folder = given.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [c for c in PLANS[given.vehicle]() if given.only in ("", c["kind"])][: given.first]
    os.environ[_CODE] = code()
    runner.run(work, wanted, folder / "cases", jobs=given.jobs)


if __name__ == "__main__":
    main()

"""Do the intervals of models of an aircraft of one's own hold? `python benchmarks/own_tiltrotor.py`.

`examples/own_tiltrotor.py` flies six conditions by formulas of its own. Each is designed for, flown once and
logged with the noise of twenty seeds; every log is imported and identified with the settings that
`scenarios/tiltrotor.toml` states. Writes benchmarks/own_tiltrotor.csv: by condition and response, the share
of 95 % intervals that hold the true derivative, and the spread of errors in standard errors.

`python benchmarks/own_tiltrotor.py chain` types the commands from scenario to global model, counts them and
writes benchmarks/own_tiltrotor_chain.csv.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

import freqid as fq

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "examples"))
import own_tiltrotor as own  # noqa: E402

SEEDS = range(20)
SCENARIO, COLUMNS = ROOT / "scenarios" / "tiltrotor.toml", ROOT / "scenarios" / "maps" / "tiltrotor.toml"


def identified(condition: str, folder: Path, seeds=SEEDS) -> list[fq.PointModel]:
    """Return the point models of one condition, flown once and logged with the noise of each seed."""
    scenario = fq.read_scenario(SCENARIO)
    design = fq.design_inputs(scenario, at=condition, seed=0).write_csv(folder / f"{condition}.csv")
    time, excitation = own.design_of(design)
    clean = own.fly(condition, time, excitation)
    models = []
    for seed in seeds:
        path = folder / f"{condition}-{seed}.csv"
        own.log(condition, time, excitation, clean, seed).to_csv(path, index=False, float_format="%.9g")
        record = fq.read_log(path, COLUMNS, scenario=scenario)
        models.append(fq.identify_point(record, scenario, at=condition))
    return models


def judge(condition: str, models: list[fq.PointModel]) -> list[dict]:
    """Return one row for each response: coverage, and errors over standard errors."""
    names = (*own.STATES, *own.FREE)
    rows = []
    for i, response in enumerate("XYZLMN"):
        truth = dict(zip(names, own.true_derivatives(condition)[i], strict=True))
        inside, errors = [], []
        for model in models:
            one = model[response]
            true = np.array([truth[n] for n in one.regressors])
            inside.append((one.lower <= true) & (true <= one.upper))
            errors.append((one.estimate - true) / one.std_error)
        rows.append(
            {
                "condition": condition,
                "response": response,
                "seeds": len(models),
                "parameters": len(one.regressors),
                "covered_percent": round(100 * float(np.mean(inside)), 2),
                "error_rms_in_std_errors": round(float(np.sqrt(np.mean(np.square(errors)))), 3),
                "worst_mean_error_in_std_errors": round(float(np.abs(np.mean(errors, axis=0)).max()), 3),
            }
        )
    return rows


def chain(folder: Path) -> list[dict]:
    """Return how often each command was typed from scenario to global model, and the seconds it took."""
    program, took = Path(sys.executable).with_name("freqid"), {}

    def run(*words: object) -> str:
        started = perf_counter()
        result = subprocess.run(list(map(str, words)), cwd=folder, capture_output=True, text=True, check=True)
        name = f"freqid {words[1]}" if words[0] == program else Path(str(words[1])).name
        took.setdefault(name, []).append(perf_counter() - started)
        return result.stdout

    fly, log = ROOT / "examples" / "own_tiltrotor.py", ("--map", COLUMNS, "--scenario", SCENARIO)
    run(program, "check", SCENARIO)
    for at in own.CONDITIONS:
        run(program, "design-inputs", SCENARIO, "--at", at, "--csv", "--no-study", "-o", f"design-{at}.h5")
        run(sys.executable, fly, f"design-{at}.csv", at, f"{at}.csv", "--seed", 1)
        run(program, "import-log", f"{at}.csv", *log, "--at", at, "-o", f"{at}.h5")
        run(program, "identify-point", f"{at}.h5", "--scenario", SCENARIO, "-o", f"point-{at}.h5")
    for at in own.HELD_OUT:
        run(sys.executable, fly, "design-u16.csv", at, f"{at}.csv", "--seed", 2)
        run(program, "import-log", f"{at}.csv", *log, "-o", f"{at}.h5")
    points = [f"point-{at}.h5" for at in own.CONDITIONS]
    print(run(program, "global-blend", *points, "--predict", "u19.h5", "-o", "global.h5"))
    run(program, "report", "point-u16.h5", "-o", "point-u16.html")
    rows = [{"command": n, "runs": len(s), "seconds": round(sum(s), 1)} for n, s in took.items()]
    return [*rows, {k: sum(r[k] for r in rows) for k in ("runs", "seconds")} | {"command": "all"}]


def write(path: Path, rows: list[dict]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    if sys.argv[1:] == ["chain"]:
        with tempfile.TemporaryDirectory() as name:
            rows = chain(Path(name))
        write(Path(__file__).with_name("own_tiltrotor_chain.csv"), rows)
        print(*rows, sep="\n")
        return
    started, rows = perf_counter(), []
    with tempfile.TemporaryDirectory() as name:
        for condition in own.CONDITIONS:
            rows += judge(condition, identified(condition, Path(name)))
            print(*rows[-6:], sep="\n", flush=True)
    total = {
        "condition": "all",
        "response": "all",
        "seeds": len(SEEDS),
        "parameters": sum(r["parameters"] for r in rows),
        "covered_percent": round(float(np.mean([r["covered_percent"] for r in rows])), 2),
        "error_rms_in_std_errors": round(
            float(np.sqrt(np.mean([r["error_rms_in_std_errors"] ** 2 for r in rows]))), 3
        ),
        "worst_mean_error_in_std_errors": max(r["worst_mean_error_in_std_errors"] for r in rows),
    }
    write(Path(__file__).with_suffix(".csv"), [*rows, total])
    print(total, f"{perf_counter() - started:.0f} s", sep="\n")


if __name__ == "__main__":
    main()

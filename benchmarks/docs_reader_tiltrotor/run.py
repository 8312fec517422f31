"""Judge the intervals of an aircraft that someone described from the documentation alone.

`python benchmarks/docs_reader_tiltrotor/run.py [v07 v15 ...]` flies six conditions with twenty seeds of noise
and gusts (`simulation.py`), writes each flight's log, imports it with jitter and mixed units, identifies it
as `scenario.toml` says, and writes `coverage.csv`: by condition and response the share of 95 % intervals that
hold each of two truths.

- *noise-free*: the estimate, by the same settings, from the same flight with sensors that have no noise.
- *derivative*: central differences of the simulation's wrench at the flight's own mean. It differs from the
  noise-free estimate by curvature over the excitation and the gusts, which a linear model's interval ignores.

`... run.py chain` types the commands from scenario to page, counts them, and writes `chain.csv`, and
`chain_coverage.csv`: the two flights of each condition, of a design each, against derivatives, what is left
on the harmonics over the noise there, and the same less what the nacelles' rates, and then curvature too,
make of the estimates of a linear model.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

import freqid as fq

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
import simulation as own  # noqa: E402

SEEDS = range(100, 120)  # not those that the scenario's amplitudes were chosen with
SCENARIO, COLUMNS = HERE / "scenario.toml", HERE / "map.toml"
NAMES = ["u", "v", "w", "p", "q", "r", *own.EFFECTORS]
CHANNELS = [f"state/{n}" for n in ("p", "q", "r", "ax", "ay", "az", "phi", "theta", "psi")]
CHANNELS += ["air/V", "air/alpha", "air/beta", "state/alt", *(f"effector/{n}" for n in own.EFFECTORS)]


def derivatives_flown(mean: np.ndarray) -> np.ndarray:
    """Return central differences of the wrench at a flight's mean, as its sensors have it, (6, 20)."""
    tilt = mean[17:21]
    v = own.feedback(mean[None], np.zeros(10))[0, :3] + np.cross(mean[:3], own.centre(tilt[None])[0])
    return own.derivatives(mean[13:], v, mean[:3])


def judged(condition: str, folder: Path, seeds: Sequence[int]) -> Iterator[list[dict]]:
    """Fly one condition; after each log that is imported and identified, yield a row for each response."""
    scenario = fq.read_scenario(SCENARIO)
    path = fq.design_inputs(scenario, at=condition, seed=0).write_csv(folder / f"{condition}.csv")
    signals, dt = own.read_design(path)
    flight = own.fly(condition, signals[None], dt, seeds=list(seeds))
    models, clean, truth = [], [], []
    for i, seed in enumerate(seeds):
        path = folder / f"{condition}-{seed}.csv"
        own.write_log(path, flight, i)
        record = fq.read_log(path, COLUMNS, scenario=scenario, at=condition, resample_hz=50.0)
        path.unlink()
        models.append(fq.identify_point(record, scenario))
        clean.append(fq.identify_point(without_noise(record, flight, i), scenario))
        truth.append(derivatives_flown(flight["truth"][:, i].mean(0)))
        yield [row_of(condition, k, models, clean, truth) for k in range(6)]


def row_of(
    condition: str,
    k: int,
    models: Sequence[fq.PointModel],
    clean: Sequence[fq.PointModel],
    truth: Sequence[np.ndarray],
) -> dict:
    """Return coverage and errors in standard errors of one response over the flights so far."""
    response = "XYZLMN"[k]
    order = [models[0][response].regressors.index(n) for n in NAMES]
    estimate, error, lower, upper = (
        np.array([getattr(m[response], a)[order] for m in models])
        for a in ("estimate", "std_error", "lower", "upper")
    )
    row = {"condition": condition, "response": response, "seeds": len(models), "parameters": len(NAMES)}
    truths = {"noise_free": np.array([m[response].estimate[order] for m in clean])} if clean else {}
    truths["derivative"] = np.array([t[k] for t in truth])
    for name, true in truths.items():
        off = (estimate - true) / error
        row |= {
            f"{name}_covered_percent": round(100 * float(np.mean((lower <= true) & (true <= upper))), 2),
            f"{name}_error_rms": round(float(np.sqrt(np.mean(off**2))), 3),
            f"{name}_worst_mean_error": round(float(np.abs(off.mean(0)).max()), 3),
        }
    return row


def judged_chain(folder: Path) -> list[dict]:
    """Judge both flights of each condition that `chain` left in a folder, against derivatives alone."""
    scenario, rows = fq.read_scenario(SCENARIO), []
    for condition in own.CORRIDOR:
        records = [fq.read(folder / f"{condition}{kind}.h5") for kind in ("", "-check")]
        models = [fq.identify_point(r, scenario) for r in records]
        means = [np.array([r[name].mean() for name in CHANNELS]) for r in records]
        truth = [derivatives_flown(mean) for mean in means]
        form = [errors_of_form(*of) for of in zip(records, models, means, strict=True)]
        for k, response in enumerate("XYZLMN"):
            row = row_of(condition, k, models, [], truth)
            left = np.mean([m[response].distortion for m in models])
            row["left_over_noise"] = round(float(left), 2)
            for what, parts in (("tilt_rates", 1), ("form", 2)):
                off, inside = [], []
                for model, true, wrong in zip(models, truth, form, strict=True):
                    one = model[response]
                    order = [one.regressors.index(n) for n in NAMES]
                    about = true[k] + wrong[:parts, k].sum(0)
                    off.append((one.estimate[order] - about) / one.std_error[order])
                    inside.append((one.lower[order] <= about) & (about <= one.upper[order]))
                row[f"less_{what}_covered_percent"] = round(100 * float(np.mean(inside)), 2)
                row[f"less_{what}_error_rms"] = round(float(np.sqrt(np.mean(np.square(off)))), 3)
            rows.append(row)
    return rows


def errors_of_form(record: fq.FlightRecord, model: fq.PointModel, mean: np.ndarray) -> np.ndarray:
    """Return errors of each derivative, (2, 6, 20), from loads that no linear model in the regressors holds.

    First, those that go with the nacelles' rates, which move the hubs through the air; second, the rest of
    the simulation's wrench along the measured motion, less its derivatives times the regressors. Each is
    regressed on the regressors, on the lines of the model.
    """
    read = np.stack([record[name] for name in CHANNELS], -1)
    centre = own.centre(read[:, 17:21])
    flow = own.feedback(read, np.zeros(10))[:, :3]
    regressors = np.concatenate([flow + np.cross(read[:, :3], centre), read[:, :3], read[:, 13:]], 1)
    regressors -= regressors.mean(0)
    wrench = own.loads(flow, read[:, :3], read[:, 13:])
    wrench[:, 3:] -= np.cross(centre, wrench[:, :3])
    curved = wrench - wrench.mean(0) - regressors @ derivatives_flown(mean).T
    step = 1e-3 * np.concatenate([np.eye(4), -np.eye(4)])
    at = own.feedback(mean[None], np.zeros(10))[0, :3]
    moved = own.loads(*(np.tile(a, (8, 1)) for a in (at, mean[:3], mean[13:])), step)
    moved[:, 3:] -= np.cross(own.centre(mean[None, 17:21])[0], moved[:, :3])
    lines = model["X"].fit["frequency"].axis
    turn = np.exp(-2j * np.pi * lines[:, None] * (record.time - record.time[0]))
    x = turn @ regressors
    by_rate = (2j * np.pi * lines[:, None] * x[:, 10:14]) @ ((moved[:4] - moved[4:]) / 2e-3)
    stacked = [np.concatenate([part.real, part.imag]) for part in (x, by_rate, turn @ curved)]
    return np.stack([np.linalg.lstsq(stacked[0], y, rcond=None)[0].T for y in stacked[1:]])


def without_noise(record: fq.FlightRecord, flight: dict[str, np.ndarray], which: int) -> fq.FlightRecord:
    """Return the record as sensors without noise would have it: cubic between the samples."""
    stamp = flight["time"] + 312.4
    at = np.clip(np.searchsorted(stamp, record.time) - 2, 0, len(stamp) - 4)
    points = stamp[at[:, None] + np.arange(4)]
    values = flight["truth"][at[:, None] + np.arange(4), which]
    weight = np.ones((len(at), 4))
    for i in range(4):
        for j in set(range(4)) - {i}:
            weight[:, i] *= (record.time - points[:, j]) / (points[:, i] - points[:, j])
    smooth = (weight[..., None] * values).sum(1)
    return record.with_channels(
        *(replace(record.channel(name), values=smooth[:, i]) for i, name in enumerate(CHANNELS))
    )


def chain(folder: Path) -> list[dict]:
    """Return how often each command was typed from scenario to page, and the seconds it took."""
    program, took = Path(sys.executable).with_name("freqid"), {}

    def run(*words: object, good: tuple[int, ...] = (0,)) -> str:
        started = perf_counter()
        done = subprocess.run(list(map(str, words)), cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode not in good:
            raise SystemExit(f"{' '.join(map(str, words))}: {done.returncode}\n{done.stderr}")
        name = f"freqid {words[1]}" if words[0] == program else Path(str(words[1])).name
        took.setdefault(name, []).append(perf_counter() - started)
        return done.stdout

    log = ("--map", COLUMNS, "--scenario", SCENARIO, "--resample", 50)
    simulation = HERE / "simulation.py"
    effectors = [
        f"{n}:{k}" for n, k in zip(own.EFFECTORS, ["surface"] * 4 + ["tilt"] * 4 + ["rotor"] * 6, strict=True)
    ]
    run(program, "new-scenario", "--effectors", ",".join(effectors), "-o", "skeleton.toml")
    run(program, "check", SCENARIO)
    (folder / "flights").mkdir()
    for at in own.CORRIDOR:
        run(program, "design-inputs", SCENARIO, "--at", at, "--csv", "--no-study", "-o", f"design-{at}.h5")
        check = ("design-inputs", SCENARIO, "--at", at, "--csv", "--no-study", "--no-page", "--seed", 5)
        run(program, *check, "-o", f"check-{at}.h5")
        logs = ("--log", f"{at}.csv", "--log", f"{at}-check.csv")
        run(sys.executable, simulation, at, f"design-{at}.csv", f"check-{at}.csv", *logs)
        for name in (at, f"{at}-check"):
            run(program, "import-log", f"{name}.csv", *log, "--at", at, "-o", f"flights/{name}.h5")
        run(program, "quicklook", f"flights/{at}.h5", f"design-{at}.h5", "--scenario", SCENARIO)
        held_out = ("--predict", f"flights/{at}-check.h5")
        run(
            program,
            "identify-point",
            f"flights/{at}.h5",
            "--scenario",
            SCENARIO,
            *held_out,
            "-o",
            f"point-{at}.h5",
        )
    run(sys.executable, simulation, 21, "check-v19.csv", "--log", "v21.csv", "--seed", 7)
    run(program, "import-log", "v21.csv", *log, "-o", "v21.h5")
    points = [f"point-{at}.h5" for at in own.CORRIDOR]
    print(run(program, "global-blend", *points, "--predict", "v21.h5", "-o", "global.h5"))
    run(program, "report", "point-v19.h5", "--scenario", SCENARIO, "-o", "point-v19.html")
    print(run(program, "study", SCENARIO, "--flights", "flights", "-o", "study", good=(0, 4)))
    rows = [{"command": n, "runs": len(s), "seconds": round(sum(s), 1)} for n, s in took.items()]
    return [
        *rows,
        {"command": "all", "runs": sum(r["runs"] for r in rows), "seconds": sum(r["seconds"] for r in rows)},
    ]


def write(path: Path, rows: list[dict]) -> None:
    """Write rows as CSV."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    """Run what was asked for."""
    asked = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        if asked == ["chain"]:
            rows = chain(Path(name))
            write(HERE / "chain.csv", rows)
            write(HERE / "chain_coverage.csv", judged_chain(Path(name) / "flights"))
            print(*rows, sep="\n")
            return
        table = HERE / "coverage.csv"
        order = list(own.CORRIDOR)
        for condition in asked or own.CORRIDOR:
            started = perf_counter()
            old = list(csv.DictReader(table.open())) if table.exists() else []
            kept = [r for r in old if r["condition"] != condition]
            for found in judged(condition, Path(name), SEEDS):
                rows = [*kept, *found]
                rows.sort(key=lambda r: (order.index(r["condition"]), "XYZLMN".index(r["response"])))
                write(table, rows)  # a run that is broken off leaves the seeds so far
            print(*found, f"{perf_counter() - started:.0f} s", sep="\n", flush=True)
    for kind in ("noise_free", "derivative"):  # of all conditions in the table
        covered = [float(r[f"{kind}_covered_percent"]) for r in rows]
        rms = np.sqrt(np.mean([float(r[f"{kind}_error_rms"]) ** 2 for r in rows]))
        print(
            f"{kind}: {np.mean(covered):.1f} % covered, rms error {rms:.2f} standard errors, {len(rows)} rows"
        )


if __name__ == "__main__":
    main()

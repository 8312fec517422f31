"""How processor time grows with the work: `python benchmarks/growth.py`.

Each task is done at several sizes. The exponent is the slope of a straight line through the logarithms of
time over its upper half, where what every call costs anyway weighs least; the steepest slope stands beside
it. Times are processor times, the least of several, in turns over the sizes, so that other work on the
machine disturbs little. Flights in a batch are in simulation_speed.py. Writes benchmarks/growth.csv and
docs/images/growth.png; ``growth.py gap study`` replaces the rows of these two and leaves the figure.
"""

from __future__ import annotations

import csv
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from matplotlib.figure import Figure

import freqid as fq
from freqid.core.record import Channel
from freqid.core.scenario import Reference
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Inertia, MassProperties
from freqid.identify.point import identify_point
from freqid.identify.spectra.fourier import FourierPlan

HERE = Path(__file__).resolve()
LINEAR = HERE.parents[1] / "scenarios" / "linear.toml"
REPEATS = 9
Task = Callable[[int], Callable[[], object]]


def manoeuvre(samples: int, regressors: int, responses: str = "XYZLMN") -> fq.Maneuver:
    """Return a manoeuvre whose responses depend on all regressors, 100 Hz, every regressor on all lines."""
    rng = np.random.default_rng(0)
    time_s = np.arange(samples) * 0.01
    x = rng.standard_normal((regressors, samples))
    z = rng.standard_normal((len(responses), regressors)) @ x + rng.standard_normal((len(responses), samples))
    rows = {f"effector/e{i}": (v, "rad") for i, v in enumerate(x)}
    rows |= {f"response/{r}": (v, "N") for r, v in zip(responses, z, strict=True)}
    channels = {n: Channel(n, unit, v, 100.0, "benchmark") for n, (v, unit) in rows.items()}
    body = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1, yy=1, zz=1))
    return fq.Maneuver(fq.FlightRecord(time_s, channels), fq.Vehicle(name="bench", mass_properties=body))


def settings(regressors: int, lines: int) -> Identification:
    return Identification(
        regressors=tuple(f"e{i}" for i in range(regressors)),
        frequencies_hz=tuple(np.arange(3, 3 + lines) / 60.0),
        response_source="record",
    )


def point(samples: int = 6001, regressors: int = 21, lines: int = 106) -> Callable[[], object]:
    flown, asked = manoeuvre(samples, regressors), settings(regressors, lines)
    return lambda: identify_point(flown, asked)


def transform(samples: int = 6001, channels: int = 27) -> Callable[[], object]:
    signals = np.random.default_rng(0).standard_normal((channels, samples))
    plan = FourierPlan(samples, 0.01, np.arange(3, 109) / 60.0)
    return lambda: plan(signals)


def blended(conditions: int) -> Callable[[], object]:
    """Return what blends so many conditions: one point model, stated again at each speed."""
    from dataclasses import replace

    flown = manoeuvre(3001, 21)
    model = identify_point(flown, settings(21, 106))
    points = [
        replace(model, reference=Reference.of(id=f"u{k}", u=10.0 + k, rho=1.225)) for k in range(conditions)
    ]
    return lambda: fq.blend(points)


def campaign(cases: int) -> Callable[[], object]:
    """Return what does so many cheap cases, fifty a unit, from nothing."""
    (folder := Path(tempfile.mkdtemp())).joinpath("work.py").write_text(
        "import numpy as np\n"
        "def trial(seed):\n"
        "    return {'value': float(np.random.default_rng(seed).standard_normal())}\n"
    )
    (folder / "c.toml").write_text(f'stage = "work.py:trial"\nseeds = {cases}\nbatch = 50\n')
    count = iter(range(1000))
    return lambda: fq.monte_carlo(
        folder / "c.toml", folder / f"{next(count)}", jobs=1, progress=lambda *_: None
    )


def output_error(samples: int) -> Callable[[], object]:
    """Return what estimates the 18 parameters of the lateral model of output_error.py."""
    import output_error as bench

    from freqid.identify.output_error.estimate import estimate

    bench.DURATION = samples * bench.DT
    signals = bench.flight(0, coloured=False)
    return lambda: estimate(bench.MODEL, [signals], bench.CHOICES)


def studied(conditions: int) -> Callable[[], object]:
    """Return what studies the linear aircraft of the examples at so many conditions, from nothing."""
    folder = Path(tempfile.mkdtemp())
    text = LINEAR.read_text().replace("period_s = 60.0\nperiods = 2", "period_s = 24.0\nperiods = 1")
    start, end = text.index("[[reference]]"), text.index("[excitation]")
    speeds = np.linspace(17.0, 23.0, conditions)
    every = "".join(f'[[reference]]\nid = "c{i}"\nu = {u}\nrho = 1.225\n' for i, u in enumerate(speeds))
    text = text[:start] + every + text[end:].replace("[0.05, 1.8]", "[0.1, 1.8]")
    (folder / "s.toml").write_text(text)
    count = iter(range(1000))
    return lambda: fq.study(folder / "s.toml", folder / f"{next(count)}", jobs=1)


def gap(flights: int) -> Callable[[], object]:
    """Return what diagnoses so many flights of 30 s with three effects as candidates."""
    sys.path.insert(0, str(HERE.parents[1] / "examples"))
    import gap_flights

    from freqid.gap import flights as flown
    from freqid.gap.connect import connect
    from freqid.gap.diagnose import Question, diagnose
    from freqid.gap.model.tolerance import stated
    from freqid.simulate.effects import library

    scenario, records = fq.read_scenario(LINEAR), []
    log = Path(tempfile.mkdtemp()) / "flight.csv"
    for seed in range(flights):
        table = gap_flights.fly(seed=seed, period=30.0, periods=1, derivatives=gap_flights.derivatives())
        table.to_csv(log, index=False)
        records.append(fq.read_log(log, columns=LINEAR.parent / "maps" / LINEAR.name, scenario=scenario))
    function = f"{HERE.parents[1] / 'examples' / 'linear_simulation.py'}:wrench"
    simulation = connect(function, scenario=LINEAR, record=records[0])
    names = [f"flight {i}" for i in range(flights)]
    vehicle = flown.vehicle_of(records, simulation, scenario.aircraft())
    maneuvers = flown.maneuvers(records, names, simulation, vehicle)
    effects = {n: library()[n] for n in ("surface_effectiveness", "sensor_bias", "time_skew")}
    question = Question(effects, stated(scenario.tolerance, effects), (0.05, 1.8), draws=200, close=False)
    return lambda: diagnose(simulation, maneuvers, question, names=names)


SLOW = {"campaign", "study", "gap"}
TASKS: dict[tuple[str, str], tuple[Task, Sequence[int]]] = {
    ("point identification", "samples"): (
        lambda n: point(samples=n),
        (3001, 6001, 12001, 24001, 48001, 96001),
    ),
    ("point identification", "regressors"): (lambda n: point(regressors=n), (6, 12, 24, 48, 96)),
    ("point identification", "lines"): (lambda n: point(lines=n, samples=12001), (50, 100, 200, 400, 800)),
    ("transform", "samples"): (lambda n: transform(samples=n), (6001, 12001, 24001, 48001, 96001)),
    ("transform", "channels"): (lambda n: transform(channels=n), (8, 16, 32, 64, 128)),
    ("blend", "conditions"): (blended, (8, 16, 32, 64, 128)),
    ("output error", "samples"): (output_error, (1000, 2000, 4000, 8000, 16000)),
    ("campaign", "cases"): (campaign, (500, 1000, 2000, 4000)),
    ("study", "conditions"): (studied, (2, 4, 8, 16)),
    ("gap", "flights"): (gap, (1, 2, 4, 8)),
}


def timed(task: Task, sizes: Sequence[int], repeats: int) -> np.ndarray:
    """Return the least processor time of each size, s."""
    calls = [task(n) for n in sizes]
    for call in calls:
        call()  # plans, caches and compiled code are there
    least = np.full(len(sizes), np.inf)
    for _ in range(repeats):
        for i, call in enumerate(calls):
            began = time.process_time()
            call()
            least[i] = min(least[i], time.process_time() - began)
    return least


def main() -> None:
    """Print and write exponents, and draw time against size."""
    asked, rows, curves, table = sys.argv[1:], [], {}, HERE.with_suffix(".csv")
    for (what, size), (task, sizes) in TASKS.items():
        if asked and what not in asked:
            continue
        least = timed(task, sizes, 1 if what in SLOW else REPEATS)
        x, y = np.log(np.array(sizes, dtype=float)), np.log(least)
        upper = slice(len(sizes) // 2 - (len(sizes) < 5), None)
        exponent = float(np.polyfit(x[upper], y[upper], 1)[0])
        steepest = float((np.diff(y) / np.diff(x)).max())
        rows.append(
            {
                "task": what,
                "with": size,
                "from": sizes[0],
                "to": sizes[-1],
                "exponent": f"{exponent:.2f}",
                "steepest": f"{steepest:.2f}",
                "ms_at_from": f"{1e3 * least[0]:.3g}",
                "ms_at_to": f"{1e3 * least[-1]:.3g}",
            }
        )
        curves[f"{what}, {size} ({exponent:.2f})"] = (np.array(sizes) / sizes[0], least / least[0])
        print("  ".join(f"{v!s:<22}" for v in rows[-1].values()), flush=True)
    if asked:
        with table.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["task"] not in asked] + rows
    else:
        draw(curves)
    with table.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def draw(curves: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """Draw time against size, each over its smallest."""
    figure = Figure(figsize=(6.0, 4.2), layout="constrained")
    axes = figure.subplots()
    for name, (x, y) in curves.items():
        axes.loglog(x, y, marker="o", markersize=3, linewidth=1, label=name)
    axes.set_xlabel("Size over the smallest")
    axes.set_ylabel("Processor time over that of the smallest")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False, fontsize="small")
    figure.savefig(HERE.parents[1] / "docs" / "images" / "growth.png", dpi=110)


if __name__ == "__main__":
    main()

"""Margins of the global model of the LA-8 class aircraft: `python benchmarks/margins.py [SEEDS] [DRAWS]`.

One flight at each of the 32 conditions of scenarios/la8.toml, measured SEEDS times with other sensor noise;
every time all points are identified and blended, and the margins of that global model are taken under the law
and actuators that the simulation flies (`freqid margins MODEL la8`), with 95 % intervals from DRAWS models of
its covariance. By condition and axis of the law, gain margin upwards, phase margin and disk margin:

linear       the simulation, linearised exactly at its trim, wakes in their steady state
noise-free   the global model of the same flights without any sensor error: what more data would lead to
error        rms over seeds of the global model's margin less either, and its mean
cover        how often the interval holds either, of all seeds
late         noise-free less linear, where that is more than the interval's half width: wakes that arrive
             late, and finite amplitudes, which a model without memory counts as damping

Writes benchmarks/margins.csv. Flights are kept in the system's folder for temporary files.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from _la8 import EXCITATION, SCENARIO, SETTINGS, write
from _la8_flights import flights, measured
from joblib import Parallel, delayed
from tqdm import tqdm

import freqid as fq
from freqid.blend.line_up import line_up
from freqid.blend.state_space import StateSpace
from freqid.compare.loop_margins import Place, loop_margins, places_of
from freqid.compare.scenario_law import scenario_law, simulated_motion
from freqid.core.results.corridor import Corridor
from freqid.core.results.loop_margins import LoopMargins
from freqid.dynamics.control_law import ControlLaw
from freqid.identify.point import identify_point

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 30
DRAWS = int(sys.argv[2]) if len(sys.argv) > 2 else 200
JOBS = int(sys.argv[3]) if len(sys.argv) > 3 else 2
FIRST = 5001  # seed; those up to 5000 were for trials
IDS = tuple(at.id for at in SCENARIO.reference)
FIGURES = ("gain_up_db", "phase_deg", "disk")
BARS = {"gain_up_db": 1.0, "phase_deg": 3.0}


def corridor(truths: dict[str, fq.FlightRecord], seed: int, noise: float = 1.0) -> Corridor:
    """Return the points of a global model with noise of their own."""
    points = []
    for place, at in enumerate(SCENARIO.reference):
        record = measured(truths[at.id], 1000 * seed + place, noise)
        maneuver = fq.Maneuver.of(record)
        points.append(identify_point(maneuver, SETTINGS, excitation=EXCITATION, reference=at))
    return line_up(points, list(IDS))


@dataclass(frozen=True)
class Known:
    """What is the same for all seeds: laws and linearised motions by condition, and the flights."""

    laws: dict[str, ControlLaw]
    linear: dict[str, StateSpace]
    truths: dict[str, fq.FlightRecord]

    def margins(self, of: Corridor, draws: int) -> LoopMargins:
        """Return margins of a global model under the simulation's law, beside the linearised simulation."""
        model = fq.GlobalModel(of)
        by_place = {(at.u, at.rho): self.laws[at.id] for at in SCENARIO.reference}
        return loop_margins(
            model,
            lambda u, rho, scheduled: by_place[u, rho],
            places_of(model),
            draws=draws,
            level=0.95,
            beside={"linear": lambda place: self.linear[place.id]},
        )


def known() -> Known:
    """Fly, trim, design and linearise, once."""
    law, motion = scenario_law(SCENARIO), simulated_motion(SCENARIO)
    truths = flights(IDS, jobs=JOBS)
    places = [Place(at.id, at.u, at.rho, dict(at.scheduled)) for at in SCENARIO.reference]
    return Known(
        {p.id: law(p.u, p.rho, p.scheduled) for p in places}, {p.id: motion(p) for p in places}, truths
    )


def one_seed(of: Known, seed: int) -> LoopMargins:
    """Return the margins of one set of measurements."""
    return of.margins(corridor(of.truths, seed), DRAWS)


def main() -> None:
    """Print and write the table."""
    shared = known()
    quiet = shared.margins(corridor(shared.truths, 0, 0.0), 0)
    seeds = range(FIRST, FIRST + SEEDS)
    found = list(
        tqdm(Parallel(n_jobs=JOBS, return_as="generator")(delayed(one_seed)(shared, s) for s in seeds))
    )
    rows, pooled = [], {}
    for k, name in enumerate(quiet.ids):
        for axis in quiet.axes:
            for figure in FIGURES:
                path = f"margins/{axis}/{figure}"
                at = [one.ids.index(name) for one in found]
                estimate, low, high = np.array(
                    [one.row(path)[:, i] for one, i in zip(found, at, strict=True)]
                ).T
                exact = float(quiet.row(path)[0, k])
                linear = float(quiet.beside["linear"].estimate[quiet.figures.index(path), k])
                if not np.isfinite([exact, linear, *estimate]).all():
                    continue
                half = float(np.median(high - low)) / 2
                row = {
                    "condition": name,
                    "axis": axis,
                    "margin": figure,
                    "linear": linear,
                    "noise_free": exact,
                    "mean": estimate.mean(),
                    "rms_to_linear": np.sqrt(np.mean((estimate - linear) ** 2)),
                    "rms_to_noise_free": np.sqrt(np.mean((estimate - exact) ** 2)),
                    "half_width": half,
                    "cover_linear": np.mean((low <= linear) & (linear <= high)),
                    "cover_noise_free": np.mean((low <= exact) & (exact <= high)),
                    "late": abs(exact - linear) > half,
                }
                pooled.setdefault(figure, []).append(row)
                rows.append(row)
    for figure, each in pooled.items():
        told(figure, each)
    written = [{k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows]
    write(Path(__file__), [{**row, "seeds": SEEDS, "draws": DRAWS} for row in written])


def told(figure: str, rows: list[dict]) -> None:
    """Print what holds for one kind of margin."""
    bar = BARS.get(figure, np.inf)

    def column(name: str) -> np.ndarray:
        return np.array([row[name] for row in rows], dtype=float)

    for what in ("linear", "noise_free"):
        error, cover = column(f"rms_to_{what}"), column(f"cover_{what}")
        print(
            f"{figure}, to {what}: rms error {np.sqrt(np.mean(error**2)):.3g}, worst {error.max():.3g}, "
            f"{np.mean(error <= bar):.1%} of {len(rows)} within the bar; intervals cover {cover.mean():.1%}"
        )
    print(
        f"{figure}: linear and noise-free differ by more than the half width at {int(column('late').sum())}"
    )


if __name__ == "__main__":
    main()

"""Two simulations compared on the same flights: equal ones called equal, a nearer one found.

Run: python benchmarks/gap_two_simulations.py [linear | LA-8]
Prints and writes benchmarks/gap_two_simulations.csv, both parts unless one is named. Equal pairs are off from
the truth by errors of the tolerances' own size, drawn independently: linear simulations on two linear flights
of 60 s each, also with five times the noise in the flown states, with a vane three times as noisy as w in one
of them, and with a loss of the elevator that both lack; the LA-8 class scenario with every number of its own
off by one sigma. In the other pairs one has the loss, or the whole wake, that was flown; the other has not.
"""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "unit" / "compare"))

import numpy as np
from linear_pair import ELEVATOR, SLOPES, fly, simulation

from freqid.compare.two_simulations import compare_two
from freqid.core.results.rivals import Rivals
from freqid.gap.settings import LEVEL
from freqid.simulate.effects import library

SIGMA = 0.05  # of each derivative, as is allowed for where nothing is stated
DURATION = 60.0  # s
EQUAL = ("same", "equal", "strong noise", "noisier vane", "both lack a loss")


def linear(kind: str, seed: int) -> Rivals:
    """Return one pair of linear simulations compared on two flights."""
    rng = np.random.default_rng([seed, 5])
    off, other = 1 + SIGMA * rng.standard_normal((2, *SLOPES.shape))
    lost = float(kind.split()[2]) / 100 if kind.startswith("loss of") else 0.3 * (kind == "both lack a loss")
    noise = 5.0 if kind == "strong noise" else 1.0
    phases = (2 * seed + 1, 2 * seed + 2)
    flights = [
        fly(lost, noise=noise, seed=1000 + k, duration=DURATION, phases=k, reference=f"u{k}") for k in phases
    ]
    if kind.startswith("loss of"):  # a simulation and its next version share what else is wrong with them
        knows = off.copy()
        knows[:, ELEVATOR] *= 1 - lost
        other = knows
    pair = simulation("A", factors=off), simulation("B", factors=other, vane=kind == "noisier vane")
    if kind == "same":
        pair = (pair[0], pair[0])
    elif seed % 2:
        pair = pair[::-1]
    return compare_two(pair, flights, [f"flight {k}" for k in phases], library(), {}, (0.1, 2.0), seed=seed)


def la8(kind: str, seed: int) -> Rivals:
    """Return one pair of LA-8 class simulations compared on two flights of the nominal aircraft."""
    import msgspec
    from _la8 import SCENARIO, inputs

    from freqid.core.record import Maneuver
    from freqid.gap.connect.scenario import ScenarioSimulation
    from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

    at = [r for r in SCENARIO.reference if r.id in ("u20", "u45")]
    scenario = msgspec.structs.replace(SCENARIO, reference=tuple(at))
    flights = []
    for i, reference in enumerate(at):
        how = Conditions(noise=1.0, turbulence=0.0, seed=8000 + 2 * seed + i)
        flight = fly_maneuver(scenario, reference, inputs(seed % 3), how, duration=DURATION)
        flights.append(Maneuver.of(flight.record))
    nominal = ScenarioSimulation(scenario)
    rng = np.random.default_rng([seed, 11])
    one, two = ({n: t.sigma * rng.standard_normal() for n, t in nominal.tolerances.items()} for _ in range(2))
    if kind == "equal":
        pair = Off(nominal, one, "A"), Off(nominal, two, "B")
    else:
        half = ScenarioSimulation(with_effects(scenario, {"wing_wake": {"strength": 0.5}}))
        pair = Off(half, one, "A"), Off(nominal, one, "B")
        pair = pair[::-1] if seed % 2 else pair
    band = (0.05, 1.9)
    return compare_two(
        pair, flights, [r.id for r in at], library(), dict(SCENARIO.tolerance), band, seed=seed
    )


@dataclass(frozen=True, eq=False)
class Off:
    """A simulation whose own parameters depart from those of another."""

    of: object
    by: dict
    name: str

    def __getattr__(self, attribute: str):
        return getattr(object.__getattribute__(self, "of"), attribute)

    def _departures(self, more):
        return {n: x + (more or {}).get(n, 0.0) for n, x in self.by.items()}

    def predict(self, record, effects=None, departures=None):
        """Return the responses, shape (response, sample)."""
        return self.of.predict(record, effects, self._departures(departures))

    def positions(self, record, effects=None, departures=None):
        """Return positions by effector."""
        return self.of.positions(record, effects, self._departures(departures))

    def fly(self, record, effects=None, departures=None):
        """Return its own flight."""
        return self.of.fly(record, effects, self._departures(departures))


PLAN = [
    ("linear", "same", 3, linear),
    ("linear", "equal", 30, linear),
    ("linear", "strong noise", 10, linear),
    ("linear", "noisier vane", 10, linear),
    ("linear", "both lack a loss", 10, linear),
    ("linear", "loss of 10 %", 8, linear),
    ("linear", "loss of 20 %", 8, linear),
    ("linear", "loss of 40 %", 8, linear),
    ("LA-8", "equal", 1, la8),
    ("LA-8", "half the wake", 2, la8),
]
HEAD = [
    "simulation",
    "pair",
    "pairs",
    "called equal",
    "nearer one found",
    "wrong",
    "low",
    "high",
    "p < 0.05",
    "s",
]


def wilson(k: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    z, rate = 1.96, k / n
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(centre - half, 0.0), min(centre + half, 1.0)


def row(name: str, kind: str, count: int, judged: Callable[[str, int], Rivals]) -> list[str]:
    """Return a row of the table: how often each verdict was given, and p over all was below 0.05."""
    found, start = [], process_time()
    for seed in range(count):
        one = judged(kind, seed)
        found.append((one.nearer, "A" if seed % 2 else "B", one.overall.p))
        print(f"{name} {kind} {seed}: {one.nearer or '='} p {one.overall.p:.2g}", file=sys.stderr)
    took = (process_time() - start) / count
    equal = sum(not n for n, _, _ in found)
    right = sum(n == r for n, r, _ in found)
    low, high = wilson(equal if kind in EQUAL else right, count)
    made = [name, kind, str(count), str(equal)]
    made += ["", str(count - equal)] if kind in EQUAL else [str(right), str(count - equal - right)]
    return [
        *made,
        f"{low:.3f}",
        f"{high:.3f}",
        f"{np.mean([p < 0.05 for *_, p in found]):.3f}",
        f"{took:.1f}",
    ]


def main() -> None:
    """Print and write the table; `s` is seconds of one core a pair, flights included."""
    path = Path(__file__).with_suffix(".csv")
    rows: dict[tuple[str, ...], list[str]] = {}
    if path.is_file() and len(sys.argv) > 1:
        with path.open(encoding="utf-8") as file:
            rows = {(r[0], r[1]): r for r in list(csv.reader(file))[1:]}
    print(f"level {LEVEL}", *HEAD, sep="  ")
    for name, kind, count, judged in PLAN:
        if name not in (sys.argv[1:] or [name]):
            continue
        made = row(name, kind, count, judged)
        print(*made, sep="  ", flush=True)
        if path.is_file() and len(sys.argv) > 1:  # the other part may be running
            with path.open(encoding="utf-8") as file:
                rows |= {(r[0], r[1]): r for r in list(csv.reader(file))[1:]}
        rows[name, kind] = made
        kept = [rows[s, k] for s, k, _, _ in PLAN if (s, k) in rows]
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([HEAD, *kept])


if __name__ == "__main__":
    main()

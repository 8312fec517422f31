"""Two simulations compared on the same flights: equal ones called equal, a nearer one found.

Run: python benchmarks/gap_two_simulations.py [linear | LA-8]
Prints and writes benchmarks/gap_two_simulations.csv, both parts unless one is named. Equal pairs are off from
the truth by errors of the tolerances' own size, drawn independently: linear simulations on two linear flights
of their own each, also with five times the noise in the flown states, and with a loss of the elevator that
both lack; the LA-8 class scenario with airframes scattered as in the open cases. In the other pairs one has
the loss, or the wake, that was flown, and the other does not.
"""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent / "gap"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "unit" / "gap"))

import numpy as np
from linear_flight import INPUTS, LIBRARY, RESPONSES, SLOPES, TRIM, U0, W0, Linear, Truth, fly

from freqid.core.record import Maneuver
from freqid.core.rivals import Rivals
from freqid.gap.rivals import LEVEL, compare_two

SIGMA = 0.05  # of each derivative
TOLERANCES = {"derivatives": SIGMA, "responses": 0.02, "dynamics": 0.05, "form": 0.0}
BAND_HZ = (0.1, 2.0)
DRAWS = 25
DURATION = 14.0  # s, of linear flights
_ELEVATOR = INPUTS.index("effector/d1")


@dataclass(frozen=True, eq=False)
class Off(Linear):
    """A simulation with derivatives that are each off by a factor."""

    factors: tuple = ()

    def slopes(self, effects=None):
        """Return the derivatives, shape (response, input)."""
        return SLOPES * np.array(self.factors)

    def predict(self, record, effects=None):
        """Return the responses, shape (response, sample)."""
        moved = record.matrix(INPUTS) - np.array([U0, W0, 0.0, 0.0, 0.0])[:, None]
        return TRIM[:, None] + self.slopes() @ moved

    def gradient(self, record, inputs):
        """Return derivatives by inputs along the record."""
        found = np.zeros((len(RESPONSES), len(inputs), record.time.size))
        for j, name in enumerate(inputs):
            if name in INPUTS:
                found[:, j] = self.slopes()[:, INPUTS.index(name), None]
        return found


def off(rng: np.random.Generator, loss: float = 0.0, scatter: float = SIGMA) -> Off:
    """Return a simulation that is off within the tolerances and knows of a loss of the elevator."""
    factors = 1 + scatter * rng.standard_normal(SLOPES.shape)
    factors[:, _ELEVATOR] *= 1 - loss
    return Off(factors=tuple(map(tuple, factors)), name=f"loss {loss:g}")


def linear(kind: str, seed: int) -> Rivals:
    """Return one pair of linear simulations compared on two flights."""
    rng = np.random.default_rng([seed, 5])
    lost, noise, knows = 0.0, 1.0, 0.0
    if kind == "both lack a loss":
        lost = 0.3
    elif kind == "strong noise":
        noise = 5.0
    elif kind.startswith("loss of"):
        lost = knows = float(kind.split()[2]) / 100
    flights = [
        fly(
            Truth(loss=lost),
            noise=noise,
            seed=1000 + 2 * seed + k,
            duration=DURATION,
            phases=k,
            reference=f"u{k}",
        )
        for k in (1, 2)
    ]
    pair = (off(rng), off(rng, knows))
    if kind == "same":
        pair = (pair[0], pair[0])
    elif knows:  # a simulation and its next version share what else is wrong with them
        factors = np.array(pair[0].factors)
        factors[:, _ELEVATOR] *= 1 - knows
        pair = (pair[0], replace(pair[0], factors=tuple(map(tuple, factors))))
    if seed % 2 and knows:
        pair = pair[::-1]
    return compare_two(pair, flights, LIBRARY, TOLERANCES, BAND_HZ, count=DRAWS, seed=seed)


def la8(kind: str, seed: int) -> Rivals:
    """Return one pair of LA-8 class simulations compared on two flights of the nominal aircraft."""
    from bench import Circumstances
    from la8_bench import LA8, scattered

    from freqid.gap.connect.scenario import ScenarioSimulation
    from freqid.simulate.maneuver import with_effects

    how = Circumstances(noise=1.0, seed=8000 + seed, signals=seed % 3)
    flights = [Maneuver.of(LA8.fly(at, (), how)) for at in LA8.at]
    if kind == "equal":
        a, b = (scattered(6000 + 2 * seed + k)[0] for k in (0, 1))
    else:  # the same airframe, with the wake that was flown and with half of it
        b = scattered(6000 + seed)[0]
        a = with_effects(b, {"wing_wake": {"strength": 0.5}})
    pair = (ScenarioSimulation(a, name="A"), ScenarioSimulation(b, name="B"))
    return compare_two(pair, flights, LA8.allowed, LA8.tolerances, LA8.band_hz, count=DRAWS, seed=seed)


EQUAL = ("same", "equal", "strong noise", "both lack a loss")
PLAN = [
    ("linear", "same", 25, linear),
    ("linear", "equal", 100, linear),
    ("linear", "strong noise", 60, linear),
    ("linear", "both lack a loss", 60, linear),
    ("linear", "loss of 10 %", 20, linear),
    ("linear", "loss of 20 %", 20, linear),
    ("linear", "loss of 40 %", 20, linear),
    ("LA-8", "equal", 20, la8),
    ("LA-8", "half the wake", 6, la8),
]
HEAD = ["simulation", "pair", "pairs", "called equal", "nearer one found", "wrong", "low", "high", "p < 0.05"]


def wilson(k: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (E. B. Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    z, rate = 1.96, k / n
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(centre - half, 0.0), min(centre + half, 1.0)


def row(simulation: str, kind: str, count: int, judged: Callable[[str, int], Rivals]) -> list[str]:
    """Return a row of the table: how often each verdict was given, and p over all was below 0.05."""
    found = []
    for seed in range(count):
        one = judged(kind, seed)
        right = "A" if simulation == "linear" and seed % 2 else "B"
        found.append((one.nearer, right, one.overall.p))
        print(f"{simulation} {kind} {seed}: {one.nearer or '='} p {one.overall.p:.2g}", file=sys.stderr)
    equal = sum(not n for n, _, _ in found)
    right = sum(n == r for n, r, _ in found)
    low, high = wilson(equal if kind in EQUAL else right, count)
    p = np.array([x for _, _, x in found])
    made = [simulation, kind, str(count), str(equal)]
    made += ["", str(count - equal)] if kind in EQUAL else [str(right), str(count - equal - right)]
    return [*made, f"{low:.3f}", f"{high:.3f}", f"{np.mean(p < 0.05):.3f}"]


def main() -> None:
    """Print and write the table."""
    path = Path(__file__).with_suffix(".csv")
    rows: dict[tuple[str, ...], list[str]] = {}
    if path.is_file() and len(sys.argv) > 1:
        with path.open(encoding="utf-8") as file:
            rows = {(r[0], r[1]): r for r in list(csv.reader(file))[1:]}
    print(f"level {LEVEL}", *HEAD, sep="  ")
    for simulation, kind, count, judged in PLAN:
        if simulation not in (sys.argv[1:] or [simulation]):
            continue
        made = row(simulation, kind, count, judged)
        print(*made, sep="  ", flush=True)
        if path.is_file() and len(sys.argv) > 1:  # the other part may be running
            with path.open(encoding="utf-8") as file:
                rows |= {(r[0], r[1]): r for r in list(csv.reader(file))[1:]}
        rows[simulation, kind] = made
        kept = [rows[s, k] for s, k, _, _ in PLAN if (s, k) in rows]
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([HEAD, *kept])


if __name__ == "__main__":
    main()

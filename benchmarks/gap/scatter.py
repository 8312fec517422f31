"""What each number of the aircraft, one sigma off, looks like: what no tolerance holds passes for an effect.

python benchmarks/gap/scatter.py -> benchmarks/gap/scatter.csv

The LA-8 class vehicle is flown without noise with one number off, to either side, and as it is described.
What the first makes of the residual more than the second is weighed by the metric of a flight with noise.
`lambda` is what noise and tolerances leave of it, `z` the size in standard deviations of the effect that it
passes for most, with the sign of the side that shows more. Of an effect, `all` is the root of the squares of
all numbers' z: from one on, scatter that is allowed for moves it as far as noise and tolerances together.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from bench import Circumstances  # first: it finds what lies beside it
from la8_bench import LA8, SCATTER, SCENARIO, flown_by, off_by

from freqid.core.record import FlightRecord, Maneuver
from freqid.core.store import replacing
from freqid.gap.gather import evidence_of
from freqid.gap.histories import Histories
from freqid.gap.residual import residual

SEED = 100  # of the noise in the metric
CSV = Path(__file__).with_name("scatter.csv")


def main() -> None:
    how = [Circumstances(noise=1.0, seed=SEED + i, signals=i) for i in range(len(LA8.at))]

    def flight(values: dict[str, float], i: int, noise: float) -> FlightRecord:
        still = replace(how[i], noise=noise)
        return flown_by(off_by(values) if values else (SCENARIO, {}), LA8.at[i], [], still)

    def made(values: dict[str, float], i: int) -> Histories:
        return residual(LA8.simulation, Maneuver.of(flight(values, i, 0.0)))

    used = [LA8.measured(flight({}, i, 1.0), SEED, **LA8.candidates) for i in range(len(how))]
    described = [made({}, i) for i in range(len(how))]
    sides = {(name, side): side * sigma for name, sigma in SCATTER.items() for side in (1, -1)}
    columns = [
        {
            f"{name}{side:+d}": c.lines.transform(made({name: value}, i) - described[i])
            for (name, side), value in sides.items()
        }
        for i, c in enumerate(used)
    ]
    taken = [(0 * c.residual, {**c.signatures, **of}) for c, of in zip(used, columns, strict=True)]
    evidence = evidence_of(used, changes=taken, null=False)
    metric = evidence.metric
    candidates = [n for n in evidence.signatures if n not in columns[0]]
    places = [evidence.column(n) for n in candidates]
    length = np.sqrt(np.maximum(metric[places, places], 1e-300))
    rows, every = [], []
    for name in SCATTER:
        both = [evidence.column(f"{name}{side:+d}") for side in (1, -1)]
        z = metric[np.ix_(places, both)] / length[:, None]
        more = np.take_along_axis(z, np.abs(z).argmax(axis=1)[:, None], axis=1)[:, 0]
        most = int(np.abs(more).argmax())
        every.append(more)
        rows.append((name, SCATTER[name], metric[both, both].max(), candidates[most], more[most]))
    whole = np.sqrt(np.square(every).sum(axis=0))
    rows += [("all", np.nan, np.nan, candidates[k], whole[k]) for k in np.argsort(-whole)[:10]]
    table = pd.DataFrame(rows, columns=["off", "sigma", "lambda", "passes for", "z"]).round(
        {"lambda": 2, "z": 2}
    )
    with replacing(CSV) as partial:
        table.to_csv(partial, index=False, lineterminator="\n")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()

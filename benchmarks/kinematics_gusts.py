"""What ``--kinematics correct`` does to derivatives in gusts: their bias without and with it.

Three linear aircraft (`_gusty_flights`) in gusts of 0, 0.1, 0.5 and 1 m/s, their air data on time and 0.14 s
late, logged as u v w and as V alpha beta. Each flight is one minute of multisines; its model by least squares
as logged, and after the compatibility check has been told to correct the sensors, which have no other error.
The model's intervals hold what is uncertain in the correction. Nothing was tuned on these seeds, 300 onward;
what was tuned was tuned on 100 to 103. A correction is *harmful* where its mean error is larger than that of
no correction by more than the half width of its own mean interval. Run as ``python
benchmarks/kinematics_gusts.py 2`` for two flights of each condition, as the table that is kept (eight where
no number is given).
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from _gusty_flights import AIRCRAFT, LATE, SETTINGS, fly, logged
from joblib import Parallel, delayed

from freqid.core.errors import DataError
from freqid.identify.point import identify_point
from freqid.workflows.inputs import silent
from freqid.workflows.models.sensors import checked, with_correction_doubt

SIZES = (0.0, 0.1, 0.5, 1.0)
SUITES = ("vanes", "velocity")
SEEDS = range(300, 300 + (int(sys.argv[1]) if len(sys.argv) > 1 else 8))
WATCHED = (("M", "w"), ("M", "q"), ("M", "de"), ("Z", "w"), ("N", "v"), ("N", "r"))


def rows_of(index: int, size: float, late: float, suite: str) -> list[dict[str, object]]:
    """Fly one condition once for each seed and return a row for each derivative."""
    craft = AIRCRAFT[index]
    found = {key: [] for key in WATCHED}
    gusts, refused, by_loads, failed = [], 0, 0, 0
    for seed, flown in zip(SEEDS, fly(craft, size, SEEDS), strict=True):
        maneuver = logged(craft, flown, seed, late, suite)
        plain = identify_point(maneuver, SETTINGS)
        try:
            check = checked(
                [maneuver], ["flight"], settings=SETTINGS, excitation=None, correct=True, tell=silent
            )
        except DataError:
            failed += 1
            continue
        model = with_correction_doubt(
            identify_point(check.used, SETTINGS), check, identify_point, SETTINGS, aligned=False
        )
        gusts.append(check.checks[0].gusts.std)
        main = "w delay" if suite == "velocity" else "alpha delay"
        refused += main not in check.checks[0].names
        by_loads += main in check.checks[0].by_loads
        for response, name in WATCHED:
            true = craft.derivatives[response][name]
            i = model[response].regressors.index(name)
            found[response, name].append(
                [
                    row
                    for one in (plain[response], model[response])
                    for row in (
                        one.estimate[i] / true - 1,
                        one.std_error[i] / abs(true),
                        float(one.lower[i] < true < one.upper[i]),
                        (one.upper[i] - one.lower[i]) / 2 / abs(true),
                    )
                ]
            )
    rows = []
    for (response, name), values in found.items():
        off, _, held, _, off_by, error_by, held_by, half = np.array(values).mean(axis=0)
        rows.append(
            {
                "aircraft": craft.name,
                "air data": suite,
                "gusts": size,
                "late": late,
                "derivative": f"{response}_{name}",
                "flights": len(values),
                "failed": failed,
                "gusts found": f"{np.mean(gusts):.2f}",
                "delay by loads": by_loads,
                "delay not told": refused,
                "bias": f"{off:+.4f}",
                "covered": f"{held:.2f}",
                "bias corrected": f"{off_by:+.4f}",
                "std_error corrected": f"{error_by:.4f}",
                "covered corrected": f"{held_by:.2f}",
                "harmful": int(abs(off_by) > abs(off) + half),
            }
        )
    print("  ".join(str(v) for v in rows[0].values()), flush=True)
    return rows


def main() -> None:
    """Print and write the table."""
    jobs = [
        (index, size, late, suite)
        for suite in SUITES
        for index in range(len(AIRCRAFT))
        for size in SIZES
        for late in (0.0, LATE)
    ]
    rows = []
    for part in Parallel(n_jobs=2, return_as="generator")(delayed(rows_of)(*job) for job in jobs):
        rows += part
        _write(rows)
    for late in (0.0, LATE):
        part = [row for row in rows if row["late"] == late]
        off, by = (np.abs([float(row[k]) for row in part]) for k in ("bias", "bias corrected"))
        print(
            f"late {late:g} s: mean error {off.mean():.4f} as logged, {by.mean():.4f} corrected; largest "
            f"{off.max():.3f}, {by.max():.3f}; "
            f"harmful {sum(row['harmful'] for row in part)} of {len(part)}; intervals hold "
            f"{np.mean([float(row['covered corrected']) for row in part]):.3f} "
            f"(as logged {np.mean([float(row['covered']) for row in part]):.3f})"
        )


def _write(rows: list[dict[str, object]]) -> None:
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()

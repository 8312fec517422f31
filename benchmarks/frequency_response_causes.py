"""Why circles of frequency responses are too small at two conditions: bias, or noise that is stated too low.

Of the flights of frequency_response_aircraft.py, how often 95 % circles hold the truth; the mean of all
measurements, which bias does not move away from; and the estimate of the same flight without noise, which
holds all that smoothing and nonlinearity do. Beside these the share that holds the truth by frequency and by
first-stage F of the input; and the mean error of each output over that of the inputs as their own
instruments, S_uy / S_uu, by frequency: 1 where the injected signals tell nothing.

    python benchmarks/frequency_response_causes.py [FIRST_SEED]

writes frequency_response_causes.csv. Flights are kept in the folder for temporary files.
"""

from __future__ import annotations

import csv
import sys
from itertools import pairwise
from pathlib import Path

import frequency_response_aircraft as aircraft
import numpy as np

from freqid.identify.response.local_response import local_response

# measurements, every so many lines, measurements that are flown again without noise
CASES = {"u20": (5, 6, 0), "u45": (5, 6, 0), "u70": (5, 6, 0), "dep6 u18": (30, 3, 10)}
LOWEST = 0.25  # Hz
STEPS = (0.0, 10.0, 100.0, np.inf)  # of F
LEANING = np.array([0.08, 0.13, 0.18, 0.23, 0.28])  # Hz


def rows_of(name: str, first: int) -> list[dict]:
    """Return what is said of one condition."""
    sets, step, again = CASES[name]
    case = aircraft.Case(name)
    at = np.arange(2, case.harmonics.size - 2, step)
    hz, truth = case.harmonics[at] / case.period, aircraft.truth(case)[..., at]
    value, radius, strength = [], [], []
    for s in range(sets):
        lines = aircraft.measurement(case, 1.0, 1.0, first + 100 * s)
        found = [local_response(lines, f, aircraft.ORDER, aircraft.LINES) for f in hz]
        freedom = np.array([one.degrees_of_freedom for one in found])
        value.append(np.stack([one.value for one in found], axis=-1))
        variance = np.stack([one.variance for one in found], axis=-1)
        radius.append(np.sqrt(variance * freedom * (0.05 ** (-1 / freedom) - 1)))
        strength.append(np.stack([one.strength for one in found], axis=-1))
        print(name, s, flush=True)
    value, radius = np.array(value), np.array(radius)
    strength = np.broadcast_to(np.array(strength)[:, None], value.shape)
    mean, held = value.mean(axis=0), np.abs(value - truth) < radius
    rows = [row(name, "truth", "all", held)]
    own = np.abs(value - mean) / np.sqrt(1 - 1 / sets) < radius  # a mean follows each of its parts
    rows.append(row(name, "mean", "all", own))
    if again:
        clean = np.array(
            [
                aircraft.estimated(case, aircraft.measurement(case, 1.0, 0.0, first + 100 * s), at)[0]
                for s in range(again)
            ]
        )
        rows.append(row(name, "truth", f"first {again}", held[:again]))
        same = np.abs(value[:again] - clean) < radius[:again]
        rows.append(row(name, "same flight without noise", f"first {again}", same))
        size = [
            np.sum(np.abs(x / radius[:again]) ** 2, axis=(0, 2, 3))
            for x in (clean - truth, value[:again] - truth)
        ]
        for output, share in zip(aircraft.OUTPUTS, size[0] / size[1], strict=True):
            rows.append(
                {
                    "case": name,
                    "about": "squared error without noise",
                    "where": output,
                    "share": round(share, 3),
                }
            )
    low = hz < LOWEST
    rows.append(row(name, "truth", f"from {LOWEST} Hz on", held[..., ~low]))
    for i, output in enumerate(aircraft.OUTPUTS):
        rows.append(row(name, "truth", f"{output} below {LOWEST} Hz", held[:, i][..., low]))
    for below, above in pairwise(STEPS):
        inside = (strength >= below) & (strength < above)
        if inside.any():
            rows.append(row(name, "truth", f"F {below:g} to {above:g}", held[inside], inside.mean()))
    return rows


def row(case: str, about: str, where: str, held: np.ndarray, share: float = 1.0) -> dict:
    """Return one line of the table."""
    return {
        "case": case,
        "about": about,
        "where": where,
        "share": round(float(share), 3),
        "coverage_95": round(float(np.mean(held)), 3),
    }


def leaning(first: int) -> list[dict]:
    """Return how much of the error of S_uy / S_uu the mean of the measurements at u20 has, by output."""
    case = aircraft.Case("u20")
    at = np.array([int(np.argmin(np.abs(case.harmonics / case.period - f))) for f in LEANING])
    truth, both = aircraft.truth(case)[..., at], []
    for s in range(CASES["u20"][0]):
        lines = aircraft.measurement(case, 1.0, 1.0, first + 100 * s)
        both.append([aircraft.estimated(case, lines, at, plain=plain) for plain in (False, True)])
    radius = np.sqrt(np.mean([one[0][1] ** 2 for one in both], axis=0))
    off, plain = ((np.mean([one[k][0] for one in both], axis=0) - truth) / radius for k in (0, 1))
    slope = np.real((plain.conj() * off).sum(axis=1)) / (np.abs(plain) ** 2).sum(axis=1)
    return [
        {
            "case": "u20",
            "about": "error of S_uy / S_uu",
            "where": f"{o} at {f} Hz",
            "share": round(float(x), 2),
        }
        for o, of in zip(aircraft.OUTPUTS, slope, strict=True)
        for f, x in zip(LEANING, of, strict=True)
    ]


def main(first: int) -> None:
    rows = [one for name in CASES for one in rows_of(name, first)] + leaning(first)
    with Path(__file__).with_suffix(".csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, ["case", "about", "where", "share", "coverage_95"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 5000)

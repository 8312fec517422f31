"""What real records say of their own sensors, without any simulation.

Run: python benchmarks/gap_judging/real/sensors_alone.py CASES... [-o sensors_alone.csv]
Each attitude angle is compared with the integral of the gyros, each velocity with the integral of the
accelerometers: ``a(t) = c + b t + s I(t) - tau x(t)``, I the integral of the rate x. Where s is not 1 or tau
not 0, the two sensors contradict each other, and a flight without a spliced change is a flight with one all
the same. Least squares in the time domain; the residual is an autoregression of first order, which is
whitened (Cochrane & Orcutt, J. American Statistical Association 44, 1949). Nothing of `freqid.gap` is used.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from freqid.core.record import FlightRecord, read_record
from freqid.dynamics.frames import body_velocity

Array = NDArray[np.float64]

GRAVITY = 9.80665
_ROUNDS = 10  # of whitening


@dataclass(frozen=True)
class Relation:
    """One sensor against the integral of others; standard deviations beside the estimates.

    Attributes
    ----------
    case, record, relation : str
    scale, scale_sd : float
        Of what is integrated, as the other sensor has it.
    late_ms, late_ms_sd : float
        By which what is integrated is behind the other sensor.
    offset, offset_sd : float
        Of what is integrated, rad/s or m/s2.
    """

    case: str
    record: str
    relation: str
    scale: float
    scale_sd: float
    late_ms: float
    late_ms_sd: float
    offset: float
    offset_sd: float


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("cases", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    with asked.output.open("w", newline="") if asked.output else sys.stdout as out:
        table = csv.writer(out, lineterminator="\n")
        table.writerow([f.name for f in fields(Relation)])
        for case in asked.cases:
            for name in json.loads((case / "case.json").read_text())["use"]:
                for one in relations(case.name, name, read_record(case / name)):
                    table.writerow([f"{x:.4g}" if isinstance(x, float) else x for x in astuple(one)])


def relations(case: str, name: str, record: FlightRecord) -> Iterator[Relation]:
    """Yield what a record's angles and velocities say of its gyros and accelerometers."""
    needed = [f"state/{n}" for n in ("p", "q", "r", "phi", "theta")]
    if not all(n in record for n in needed):
        return
    p, q, r, phi, theta = (record[n] for n in needed)
    turning = q * np.sin(phi) + r * np.cos(phi)
    rates = {
        "phi": p + np.tan(theta) * turning,
        "theta": q * np.cos(phi) - r * np.sin(phi),
        "psi": turning / np.cos(theta),
    }
    for angle, rate in rates.items():
        if f"state/{angle}" in record:
            yield Relation(case, name, angle, *_fitted(record, np.unwrap(record[f"state/{angle}"]), rate))
    forces = [f"state/{n}" for n in ("ax", "ay", "az")]
    moved = _velocity(record)
    if moved is None or not all(n in record for n in forces):
        return
    u, v, w = moved
    weight = GRAVITY * np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
    turned = weight - np.array([q * w - r * v, r * u - p * w, p * v - q * u])
    for axis, speed, felt, known in zip("uvw", moved, forces, turned, strict=True):
        yield Relation(case, name, axis, *_fitted(record, speed - _integral(known, record), record[felt]))


def _velocity(record: FlightRecord) -> Array | None:
    """Return u v w, measured or of the air data."""
    if all(f"state/{n}" in record for n in "uvw"):
        return record.matrix(f"state/{n}" for n in "uvw")
    air = [f"air/{n}" for n in ("V", "alpha", "beta")]
    if not all(n in record for n in air):
        return None
    return np.array(body_velocity(*(record[n] for n in air)))


def _integral(values: Array, record: FlightRecord) -> Array:
    steps = np.diff(record.time) * (values[1:] + values[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum(steps)])


def _fitted(record: FlightRecord, position: Array, rate: Array) -> tuple[float, ...]:
    """Return scale, lateness in ms and offset of a rate, each with its standard deviation."""
    time = record.time - record.time[0]
    columns = np.stack([np.ones_like(time), time, _integral(rate, record), rate], axis=1)
    memory = 0.0
    for _ in range(_ROUNDS):
        x, y = columns[1:] - memory * columns[:-1], position[1:] - memory * position[:-1]
        weights = np.linalg.lstsq(x, y, rcond=None)[0]
        left = position - columns @ weights
        memory = float(left[1:] @ left[:-1] / (left[:-1] @ left[:-1]))
    noise = y - x @ weights
    covariance = np.linalg.inv(x.T @ x) * (noise @ noise) / (len(y) - x.shape[1] - 1)
    sd = np.sqrt(np.diag(covariance))
    _, drift, scale, ahead = weights.tolist()
    return scale, float(sd[2]), 1e3 * ahead, float(1e3 * sd[3]), -drift, float(sd[1])


if __name__ == "__main__":
    main()

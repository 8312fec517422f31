"""Whether a log with a seeded mistake is refused with the right setting, and a good one is not.

Flights of three aircraft (linear, propellers in front of a wing, tilt-wing) in gusts, logged with all noise
of their sensors; one mistake of the map or the instruments is put into each of 40, none into 40 others. A
mistake counts as found where a finding names its kind and its channels, and no error blames another channel.
Run as ``python benchmarks/plausibility.py``; ``--unseen`` flies an aircraft that the checks were not written
with, ``--seed 1000`` and ``--seed 2000`` the logs that they were.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from _logged_flights import asked, logged, scenario

import freqid as fq
from freqid.core.arrays import Array
from freqid.flightlog.plausibility.check import check_plausibility

FAULTS, GOOD, FIRST_SEED = 40, 40, 40
DEG, G = np.degrees(1.0), 9.80665
Faulty = tuple[fq.FlightRecord, str, tuple[str, ...]]


def changed(record: fq.FlightRecord, values: Mapping[str, Array]) -> fq.FlightRecord:
    """Return a record with other values of some channels."""
    return record.with_channels(*(replace(record.channel(n), values=x) for n, x in values.items()))


def scaled(kind: str, factor: float, *sets: tuple[str, ...]) -> Callable[..., Faulty | None]:
    """Return a mistake that multiplies one of these sets of channels."""

    def mistake(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
        known = [s for s in (tuple(n for n in s if n in record) for s in sets) if s]
        if not known:
            return None
        names = known[rng.integers(len(known))]
        return changed(record, {n: factor * record[n] for n in names}), kind, names

    return mistake


def effector_scaled(kind: str, factor: float, unit: str) -> Callable[..., Faulty | None]:
    """Return a mistake of one excited effector's position."""

    def mistake(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
        names = [
            f"effector/{n}"
            for n in record.group("effector")
            if record.channel(f"effector/{n}").unit == unit and f"excitation/{n}" in record
        ]
        if not names:
            return None
        name = names[rng.integers(len(names))]
        return changed(record, {name: factor * record[name]}), kind, (name,)

    return mistake


def swapped(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Interchange two positions, left and right where there are such."""
    names = [
        n
        for n in record.group("effector")
        if f"excitation/{n}" in record and record.channel(f"effector/{n}").unit == "rad"
    ]
    a, b = (f"effector/{n}" for n in rng.choice(names, 2, replace=False))
    return changed(record, {a: record[b], b: record[a]}), "swap", (a, b)


def interchanged(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Interchange roll and yaw rate, or roll and pitch angle."""
    a, b = (("state/p", "state/r"), ("state/phi", "state/theta"))[rng.integers(2)]
    return changed(record, {a: record[b], b: record[a]}), "swap", (a, b)


def axes(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Log inertial sensors in axes that point left and up."""
    names = ("state/q", "state/r", "state/ay", "state/az")
    return changed(record, {n: -record[n] for n in names}), "axes", names


def stuck(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Freeze one sensor for 1 to 3 s."""
    names = [
        n for n in ("state/p", "state/q", "state/az", "state/theta", "state/w", "air/alpha") if n in record
    ]
    name, count = names[rng.integers(len(names))], round(rng.uniform(1.0, 3.0) / record.dt)
    at = int(rng.integers(10, record.time.size - count - 10))
    x = record[name].copy()
    x[at : at + count] = x[at]
    return changed(record, {name: x}), "stuck", (name,)


def still(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Map a column that nobody filled."""
    name = ("state/r", "state/phi", "state/ax")[rng.integers(3)]
    return changed(record, {name: np.zeros(record.time.size)}), "stuck", (name,)


def latched(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Repeat each sample of one channel three to eight times."""
    names = [n for n in ("state/q", "state/phi", "state/v", "air/beta", "effector/de") if n in record]
    name, k = names[rng.integers(len(names))], int(rng.integers(3, 9))
    return changed(record, {name: np.repeat(record[name][::k], k)[: record.time.size]}), "latched", (name,)


def beyond(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Log a surface with a scale that takes it past its stops."""
    vehicle = record.vehicle
    assert vehicle is not None
    names = [e for e in vehicle.effectors if e.kind == "surface" and f"effector/{e.name}" in record]
    effector = names[rng.integers(len(names))]
    name = f"effector/{effector.name}"
    x = record[name]
    reach = 1.3 * max(map(abs, effector.limits)) / np.abs(x).max()
    return changed(record, {name: reach * x}), "limit", (name,)


def spoilt(record: fq.FlightRecord, rng: np.random.Generator) -> Faulty | None:
    """Put the largest number of a 16-bit word into one sample."""
    names = [n for n in ("state/p", "state/az", "state/u", "air/V") if n in record]
    name = names[rng.integers(len(names))]
    x = record[name].copy()
    x[rng.integers(x.size)] = 65535.0
    return changed(record, {name: x}), "range", (name,)


RATES, ANGLES = ("state/p", "state/q", "state/r"), ("state/phi", "state/theta", "state/psi")
FORCES, SPEEDS = ("state/ax", "state/ay", "state/az"), ("state/u", "state/v", "state/w")
MISTAKES: dict[str, Callable[..., Faulty | None]] = {
    "a rate's sign": scaled("sign", -1.0, *((n,) for n in RATES)),
    "rates in deg/s": scaled("unit", DEG, RATES),
    "one rate in deg/s": scaled("unit", DEG, *((n,) for n in RATES)),
    "an angle in deg": scaled("unit", DEG, *((n,) for n in ANGLES)),
    "attitude in deg": scaled("unit", DEG, ANGLES),
    "an angle's sign": scaled("sign", -1.0, ("state/phi",), ("state/theta",)),
    "accelerometers in g": scaled("unit", 1 / G, FORCES),
    "accelerometers' sign": scaled("sign", -1.0, FORCES),
    "az's sign": scaled("sign", -1.0, ("state/az",)),
    "ay's sign": scaled("sign", -1.0, ("state/ay",)),
    "velocities in ft/s": scaled("unit", 1 / 0.3048, SPEEDS, ("air/V",)),
    "velocities in kt": scaled("unit", 1 / 0.514444, SPEEDS, ("air/V",)),
    "altitude in ft": scaled("unit", 1 / 0.3048, ("state/alt",)),
    "a flow angle in deg": scaled("unit", DEG, ("air/alpha",), ("air/beta",)),
    "sideslip's sign": scaled("sign", -1.0, ("air/beta",), ("state/v",)),
    "density in slug/ft3": lambda record, rng: (
        changed(record, {"air/rho": record["air/rho"] / 515.378818}),
        "range",
        ("air/rho",),
    ),
    "a surface's sign": effector_scaled("sign", -1.0, "rad"),
    "a surface in deg": effector_scaled("unit", DEG, "rad"),
    "a rotor in rpm": effector_scaled("unit", 60 / (2 * np.pi), "rad/s"),
    "two surfaces swapped": swapped,
    "columns interchanged": interchanged,
    "axes left and up": axes,
    "stuck": stuck,
    "still": still,
    "latched": latched,
    "beyond limits": beyond,
    "a value of 65535": spoilt,
}


def main() -> None:
    """Judge and write the tables."""
    first, aircraft, table = asked(FIRST_SEED)
    rows, kinds = [], list(MISTAKES)
    for i in range(FAULTS):
        kind, (name, at) = kinds[i % len(kinds)], aircraft[(i + i // len(kinds)) % len(aircraft)]
        rng = np.random.default_rng([first, i])
        flight = logged(name, at, first + i, turbulence=rng.uniform(0.0, 1.5))
        made = MISTAKES[kind](flight, rng)
        if made is None:  # this aircraft logs no such channel
            name, at = ("dep6", "u18") if kind != "a rotor in rpm" else ("la8", "u45")
            made = MISTAKES[kind](logged(name, at, first + i, turbulence=rng.uniform(0.0, 1.5)), rng)
        assert made is not None
        rows.append(judged(kind, name, at, first + i, *made))
    for i in range(GOOD):
        name, at = aircraft[i % len(aircraft)]
        seed = first + FAULTS + i
        turbulence = np.random.default_rng([first, FAULTS + i]).uniform(0.0, 1.5)
        rows.append(judged("none", name, at, seed, logged(name, at, seed, turbulence=turbulence), "", ()))
    faulty, good = rows[:FAULTS], rows[FAULTS:]
    print(f"{sum(r['right'] for r in faulty)} of {FAULTS} mistakes found, ", end="")
    print(f"{GOOD - sum(r['right'] for r in good)} of {GOOD} good logs with a warning or an error")
    if table:
        path = Path(__file__)
        with path.with_name(path.stem + table).open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


def judged(
    mistake: str,
    name: str,
    at: str,
    seed: int,
    record: fq.FlightRecord,
    check: str,
    channels: tuple[str, ...],
) -> dict[str, object]:
    """Check one log and tell whether what is said of it is right."""
    start = time.perf_counter()
    report = check_plausibility(record, scenario(name).reference_of(at))
    took = time.perf_counter() - start
    named = any(f.check == check and set(f.channels) == set(channels) for f in report.findings)
    astray = [f for f in report.errors if not set(f.channels) <= set(channels)]
    right = named and not astray if check else not report.findings
    row = {
        "mistake": mistake,
        "aircraft": name,
        "at": at,
        "seed": seed,
        "channels": " ".join(channels),
        "found": " | ".join(f"{f.severity} {f.check} {' '.join(f.channels)}" for f in report.findings),
        "seconds": f"{took:.2f}",
        "right": right,
    }
    print("  ".join(f"{value!s:<12}" for value in row.values()), flush=True)
    return row


if __name__ == "__main__":
    main()

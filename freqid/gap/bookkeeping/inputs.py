"""Mistakes in what goes into a simulation: signs, names, units and axes of what it is given."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from freqid.core.record import FlightRecord
from freqid.gap.bookkeeping.fault import FOOT, RADIAN, Bench, Fault

_SLUG_FT3 = 515.378818  # kg/m3
_INPUTS = {  # groups of a record's channels, and what a simulation may expect them in
    "p q r": (("state/p", "state/q", "state/r"), {"degrees per second": RADIAN}),
    "alpha beta": (("air/alpha", "air/beta"), {"degrees": RADIAN}),
    "u v w": (
        ("state/u", "state/v", "state/w", "air/V"),
        {"feet per second": 1 / FOOT, "knots": 3600 / 1852, "km/h": 3.6},
    ),
    "rho": (("air/rho",), {"slug/ft3": 1 / _SLUG_FT3, "g/m3": 1e3}),
}
_TURNED = {"y left and z up": ("v", "w", "q", "r"), "x aft and z up": ("u", "w", "p", "r"), "z up": ("w",)}


def inputs(bench: Bench) -> Iterator[Fault]:
    """Yield the mistakes in what goes into a simulation."""
    record, kinds = bench.record, bench.maneuver.vehicle.effector_kinds
    effectors = [n for n in record.group("effector") if np.ptp(record[f"effector/{n}"]) > 0]
    for name in effectors:
        yield _scaled(
            "effector_sign", name, (f"effector/{name}",), -1.0, f"{name} is taken with the opposite sign"
        )
    for a, b in combinations(effectors, 2):
        if kinds.get(a) == kinds.get(b):
            yield Fault(
                "swapped_effectors",
                f"{a} {b}",
                f"{a} and {b} are exchanged",
                "check the order of effectors",
                mend=lambda r, a=f"effector/{a}", b=f"effector/{b}": _exchanged(r, a, b),
            )
    by_kind = {k: [n for n in effectors if kinds.get(n) == k] for k in ("surface", "tilt", "rotor")}
    angles, speeds = by_kind["surface"] + by_kind["tilt"], by_kind["rotor"]
    sets = dict.fromkeys(
        tuple(s) for s in ([[n] for n in angles] + [by_kind["surface"], by_kind["tilt"], angles])
    )
    groups = [(s, "degrees", RADIAN) for s in sets if s]
    groups += [(tuple(speeds), "rpm", 30 / np.pi), (tuple(speeds), "1/s", 0.5 / np.pi)] if speeds else []
    for which, unit, factor in groups:
        subject = " ".join(which)
        for value, how in ((factor, f"expected in {unit}"), (1 / factor, f"converted as if from {unit}")):
            label = "degrees" if unit == "degrees" else "units"
            yield _scaled(label, subject, [f"effector/{n}" for n in which], value, f"{subject} is {how}")
    for subject, (channels, units) in _INPUTS.items():
        there = [c for c in channels if c in record]
        for unit, factor in units.items() if there else ():
            for value, how in ((factor, f"expected in {unit}"), (1 / factor, f"converted as if from {unit}")):
                label = "degrees" if unit.startswith("degrees") else "units"
                yield _scaled(label, subject, there, value, f"{subject} is {how}")
    for how, turned in _TURNED.items():
        there = [f"state/{n}" for n in turned if f"state/{n}" in record]
        if there:
            yield _scaled("axes", " ".join(turned), there, -1.0, f"the motion is read in axes with {how}")
    yield from (
        _scaled("axes", n, (f"state/{n}",), -1.0, f"{n} is taken with the opposite sign")
        for n in "vpqr"
        if f"state/{n}" in record
    )


def _scaled(fault: str, subject: str, channels: Sequence[str], factor: float, sentence: str) -> Fault:
    def mend(record: FlightRecord) -> FlightRecord:
        return record.with_channels(
            *(replace(record.channel(c), values=factor * record[c]) for c in channels if c in record)
        )

    remedy = "check how the simulation reads its inputs: SI and radians, x forward, y right, z down"
    return Fault(fault, subject, sentence, remedy, mend=mend)


def _exchanged(record: FlightRecord, a: str, b: str) -> FlightRecord:
    one, other = record.channel(a), record.channel(b)
    return record.with_channels(replace(one, values=other.values), replace(other, values=one.values))

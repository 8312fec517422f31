"""Which mistakes are tried on the records at hand: in what a simulation is given, and in what it returns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT, WRENCH
from freqid.core.errors import DataError
from freqid.core.record import FlightRecord
from freqid.core.units import FOOT, POUND_FORCE, STANDARD_GRAVITY
from freqid.dynamics.frames import cross
from freqid.dynamics.moment_reference_point import moment_about
from freqid.gap.bookkeeping.comparison import Comparison
from freqid.gap.bookkeeping.correction import gain_of
from freqid.gap.bookkeeping.fault import RADIAN, Bench, Fault
from freqid.gap.connect.differences import moved
from freqid.identify.loads.momentum import rotor_momentum
from freqid.identify.spectra.smoothing import local_derivative

SEA_LEVEL = 1.225  # kg/m3
_CONFIRMED = 10  # candidates by derivatives that are tried on the simulation itself
_DELAYS = np.concatenate([-np.arange(0.1, 1.01, 0.02), np.arange(0.1, 1.01, 0.02)])  # s
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
_SCALES = {  # what a prediction in other units has to be multiplied by
    "X Y Z": {
        "in pounds": POUND_FORCE,
        "in newtons taken for pounds": 1 / POUND_FORCE,
        "in kilograms of force": STANDARD_GRAVITY,
        "in kilonewtons": 1e3,
    },
    "L M N": {
        "in pound-feet": POUND_FORCE * FOOT,
        "in newton metres taken for pound-feet": 1 / (POUND_FORCE * FOOT),
        "in kilogram-force metres": STANDARD_GRAVITY,
    },
}
_STATE_SCALES = {"in degrees": 1 / RADIAN, "in radians twice converted": RADIAN}


def possible_faults(comparisons: Sequence[Comparison]) -> Iterator[Fault]:
    """Yield the mistakes that are tried; those in what goes in are ranked by derivatives along a record."""
    first = comparisons[0]
    # the same mistake is made of every record by its own closure where it uses the record's signals
    yield from _of_every(comparisons, [list(_outputs(t.bench)) for t in comparisons])
    yield from _shifts(comparisons)
    yield from _ignored_density(first)
    ranked = [(gain_of([first], [first.linear(fault)]), fault) for fault in _inputs(first.bench)]
    large = [f for _, f in ranked if f.id in ("degrees", "units", "axes") and " " in f.subject]  # not linear
    small = sorted((r for r in ranked if r[1] not in large), key=lambda r: -r[0])
    yield from (f for gain, f in small[:_CONFIRMED] if gain > 0)
    if first.simulation.kind != "predictions":
        yield from large


def _of_every(comparisons: Sequence[Comparison], lists: Sequence[Sequence[Fault]]) -> Iterator[Fault]:
    """Join the same mistake of several records into one that knows which record it is asked about."""
    by_key = [{(f.id, f.subject, f.sentence): f for f in faults} for faults in lists]
    for key, fault in by_key[0].items():
        if all(key in found for found in by_key):
            mine = {id(t.bench): found[key] for t, found in zip(comparisons, by_key, strict=True)}

            def undo(predicted: Array, bench: Bench, mine: dict = mine) -> Array:
                return mine[id(bench)].undo(predicted, bench)

            yield Fault(fault.id, fault.subject, fault.sentence, fault.remedy, fault.rows, undo=undo)


def _ignored_density(comparison: Comparison) -> Iterator[Fault]:
    """Yield a density that stays that of sea level, where the prediction does not change with it."""
    record = comparison.bench.record
    if "air/rho" not in record or comparison.simulation.kind == "predictions":
        return
    try:
        there, denser = (
            comparison.simulation.predict(r)
            for r in (record, moved(record, "air/rho", 0.1 * record["air/rho"].mean()))
        )
    except DataError:  # it may be made for the densities that were flown alone
        return
    if np.abs(denser - there).max() < 1e-3 * np.abs(there).max():
        yield Fault(
            "density",
            "rho",
            "the density of the record is not used: loads are those of sea level",
            "use air['rho'], or qbar",
            tuple(range(len(comparison.bench.names))),
            undo=lambda p, bench: p * bench.record["air/rho"] / SEA_LEVEL,
        )


def _shifts(comparisons: Sequence[Comparison]) -> Iterator[Fault]:
    """Yield the one shift of all responses together that leaves least."""
    names = comparisons[0].bench.names
    least = 0.1 if sum(n in WRENCH or n in COEFFICIENT for n in names) >= 3 else 0.25

    def left(delay: float) -> float:
        return sum(
            float((t.residual(_shifted(t.predicted, t.bench.record.dt, delay))[0] ** 2).sum())
            for t in comparisons
        )

    best = min((float(d) for d in _DELAYS if abs(d) >= least), key=left)
    how = "early" if best > 0 else "late"
    yield Fault(
        "time_shift",
        " ".join(names),
        f"all responses come {abs(best):.2f} s too {how}",
        "bring the simulation and the record to one clock",
        tuple(range(len(names))),
        undo=lambda p, bench: _shifted(p, bench.record.dt, best),
    )


def _shifted(values: Array, dt: float, delay: float) -> Array:
    """Return rows a time later, s; the ends are held."""
    at = np.arange(values.shape[1], dtype=float)
    return np.array([np.interp(at - delay / dt, at, row) for row in values])


def _inputs(bench: Bench) -> Iterator[Fault]:
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


def _outputs(bench: Bench) -> Iterator[Fault]:
    """Yield the mistakes in what comes out of a simulation."""
    names, vehicle = bench.names, bench.maneuver.vehicle
    for i, name in enumerate(names):
        yield _factor("response_sign", name, -1.0, (i,), f"{name} has the opposite sign", f"negate {name}")
        if name not in WRENCH and name[0] != "C":
            for how, factor in _STATE_SCALES.items():
                sentence = f"{name} comes {how}"
                yield _factor("degrees", name, factor, (i,), sentence, "give angles in radians")
    for group, scales in _SCALES.items():
        if rows := bench.rows(group):
            for how, factor in scales.items():
                subject = " ".join(names[i] for i in rows)
                yield _factor("units", subject, factor, rows, f"{subject} come {how}", "give N and N m")
    yield from _per_mass(bench)
    yield from _coefficients(bench)
    for a, b in combinations(range(len(names)), 2):
        if all(n in WRENCH[:3] for n in (names[a], names[b])) or all(
            n in WRENCH[3:] for n in (names[a], names[b])
        ):
            yield _exchange(bench, a, b)
    for how, turned in {"y left and z up": "Y Z M N", "x aft and z up": "X Z L N"}.items():
        if len(rows := bench.rows(turned)) > 1:
            sentence = f"the loads are in axes with {how}"
            yield _factor("axes", turned, -1.0, rows, sentence, "give x forward, y right, z down")
    if bench.rows("X Y Z") and all(f"state/{n}" in bench.record for n in ("phi", "theta", "psi")):
        yield from _gravity(bench)
    if len(bench.rows("X Y Z L M N")) == 6:
        yield from _reference_points(bench)
    if vehicle.rotors and len(rows := bench.rows("L M N")) == 3:
        yield from _gyroscopic(bench, rows)


def _factor(
    fault: str, subject: str, factor: float, rows: Sequence[int], sentence: str, remedy: str
) -> Fault:
    return Fault(fault, subject, sentence, remedy, tuple(rows), undo=lambda p, _: _times(p, rows, factor))


def _times(predicted: Array, rows: Sequence[int], factor: float | Array) -> Array:
    out = predicted.copy()
    out[list(rows)] *= factor
    return out


def _exchange(bench: Bench, a: int, b: int) -> Fault:
    def undo(predicted: Array, _: Bench) -> Array:
        order = np.arange(len(predicted))
        order[[a, b]] = b, a
        return predicted[order]

    subject = f"{bench.names[a]} {bench.names[b]}"
    sentence = f"{bench.names[a]} and {bench.names[b]} are exchanged"
    return Fault("swapped_responses", subject, sentence, "check the order of responses", (a, b), undo=undo)


def _per_mass(bench: Bench) -> Iterator[Fault]:
    """Yield loads that come over mass or inertia."""
    stated = bench.maneuver.vehicle.mass_properties
    if rows := bench.rows("X Y Z"):
        for how, factor in {"m/s2": stated.mass_kg, "g": stated.mass_kg * STANDARD_GRAVITY}.items():
            sentence = f"the forces come per mass, in {how}"
            yield _factor("units", "X Y Z", factor, rows, sentence, "multiply them by the mass")
    if rows := bench.rows("L M N"):
        inertia = np.diag(stated.inertia.matrix)[["LMN".index(bench.names[i]) for i in rows]][:, None]
        yield Fault(
            "units",
            "L M N",
            "the moments come per moment of inertia, in rad/s2",
            "multiply them by the inertia",
            rows,
            undo=lambda p, _: _times(p, rows, inertia),
        )


def _coefficients(bench: Bench) -> Iterator[Fault]:
    """Yield coefficients in place of loads, and the reverse."""
    vehicle, record = bench.maneuver.vehicle, bench.record
    if vehicle.area_m2 is None or "air/rho" not in record or not all(f"state/{n}" in record for n in "uvw"):
        return
    area = 0.5 * record["air/rho"] * (record.matrix(("state/u", "state/v", "state/w")) ** 2).sum(0)
    area = np.maximum(area, 1.0) * vehicle.area_m2
    lengths = {"L": vehicle.span_m, "M": vehicle.chord_m, "N": vehicle.span_m}
    for prefix, names in (("", WRENCH), ("C", ("CX", "CY", "CZ", "Cl", "Cm", "Cn"))):
        rows = [i for i, n in enumerate(bench.names) if n in names]
        arms = [lengths.get(WRENCH[names.index(bench.names[i])], 1.0) for i in rows]
        if rows and all(arms):
            size = np.array(arms, dtype=float)[:, None] * area
            subject = " ".join(bench.names[i] for i in rows)
            found, wanted = ("loads", "coefficients") if prefix else ("coefficients", "loads")
            factor = 1 / size if prefix else size
            yield Fault(
                "coefficient",
                subject,
                f"{subject} come as {found}, not as {wanted}",
                "multiply by qbar S (and b or cbar), or name them CX ... Cn",
                tuple(rows),
                undo=lambda p, _, rows=rows, factor=factor: _times(p, rows, factor),
            )


def _gravity(bench: Bench) -> Iterator[Fault]:
    weight = bench.weight()
    rows = bench.rows("X Y Z")
    part = np.array(["XYZ".index(bench.names[i]) for i in rows])
    for sign, sentence, remedy in (
        (-1.0, "the forces include the weight", "leave gravity out of X Y Z"),
        (
            1.0,
            "the weight is missing from the measured force: gravity is taken out of the record's ax ay az, "
            "or out of the simulation twice",
            "log specific force, what an accelerometer feels",
        ),
    ):
        yield Fault("gravity", "X Y Z", sentence, remedy, rows, undo=_adding(rows, sign * weight[part]))


def _adding(rows: Sequence[int], what: Array) -> Callable[[Array, Bench], Array]:
    """Return a correction that adds loads, shape (row, sample), to some rows of a prediction."""

    def undo(predicted: Array, _: Bench) -> Array:
        out = predicted.copy()
        out[list(rows)] += what
        return out

    return undo


def _reference_points(bench: Bench) -> Iterator[Fault]:
    """Yield moments about another point that is known by name, not about the centre of gravity."""
    vehicle = bench.maneuver.vehicle
    centre = np.array(vehicle.mass_properties.cg_m)
    points: dict[str, Array] = {"the vehicle's origin": np.zeros(3)}
    points |= {f"the tilt axis of wing '{w.name}'": np.array(w.pivot_m) for w in vehicle.wings}
    places = {c.position_m: c.name for c in bench.record.channels.values() if c.position_m is not None}
    points |= {f"the place of sensor '{n}'": np.array(place) for place, n in places.items()}
    forces, moments = bench.rows("X Y Z"), bench.rows("L M N")
    for label, point in points.items():
        arm = point - centre
        if np.linalg.norm(arm) > 0.02:
            # about the centre of gravity: M + (point - centre) x F
            def undo(predicted: Array, _: Bench, arm: Array = arm) -> Array:
                more = moment_about(arm[:, None], predicted[list(forces)])
                return _adding(moments, more)(predicted, _)

            yield Fault(
                "moment_reference",
                "L M N",
                f"the moments are about {label}, not about the centre of gravity",
                "move them to the instantaneous centre of gravity: M + r x F",
                moments,
                undo=undo,
            )


def _gyroscopic(bench: Bench, rows: tuple[int, ...]) -> Iterator[Fault]:
    record = bench.record
    if not all(f"effector/{r.name}" in record for r in bench.maneuver.vehicle.rotors):
        return
    momentum = rotor_momentum(bench.maneuver)
    rates = record.matrix(("state/p", "state/q", "state/r"))
    term = cross(rates, momentum) + local_derivative(momentum, record.dt, window=9, degree=4)
    for sign, sentence in (
        (1.0, "the rotors' gyroscopic moments are in the predicted moments, and in the reconstructed ones"),
        (-1.0, "the rotors' gyroscopic moments are taken out of the predicted moments with the wrong sign"),
    ):
        remedy = (
            "count them once: leave them out of the simulation's moments, or the rotors out of the vehicle"
        )
        yield Fault("gyroscopic", "L M N", sentence, remedy, rows, undo=_adding(rows, sign * term))

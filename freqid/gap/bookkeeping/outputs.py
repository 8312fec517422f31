"""Mistakes in what comes out of a simulation: signs, names, units, axes, points and what loads contain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.frames import cross
from freqid.core.units import STANDARD_GRAVITY
from freqid.gap.bookkeeping.fault import FOOT, POUND, RADIAN, Bench, Fault
from freqid.identify.momentum import rotor_momentum
from freqid.identify.smoothing import local_derivative

Array = NDArray[np.float64]

_SCALES = {  # what a prediction in other units has to be multiplied by
    "X Y Z": {
        "in pounds": POUND,
        "in newtons taken for pounds": 1 / POUND,
        "in kilograms of force": STANDARD_GRAVITY,
        "in kilonewtons": 1e3,
    },
    "L M N": {
        "in pound-feet": POUND * FOOT,
        "in newton metres taken for pound-feet": 1 / (POUND * FOOT),
        "in kilogram-force metres": STANDARD_GRAVITY,
    },
}
_STATE_SCALES = {"in degrees": 1 / RADIAN, "in radians twice converted": RADIAN}


def outputs(bench: Bench) -> Iterator[Fault]:
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

        def undo(predicted: Array, _: Bench, sign: float = sign) -> Array:
            out = predicted.copy()
            out[list(rows)] += sign * weight[part]
            return out

        yield Fault("gravity", "X Y Z", sentence, remedy, rows, undo=undo)


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
                out = predicted.copy()
                force = predicted[list(forces)]
                out[list(moments)] += cross(np.broadcast_to(arm[:, None], force.shape), force)
                return out

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

        def undo(predicted: Array, _: Bench, sign: float = sign) -> Array:
            out = predicted.copy()
            out[list(rows)] += sign * term
            return out

        remedy = (
            "count them once: leave them out of the simulation's moments, or the rotors out of the vehicle"
        )
        yield Fault("gyroscopic", "L M N", sentence, remedy, rows, undo=undo)

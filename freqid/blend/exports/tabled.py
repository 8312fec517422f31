"""A global model as a calculation with tables, and how far the tables are from the model."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from freqid.blend.exports.calculation import (
    Apply,
    Axis,
    Calculation,
    CheckCase,
    Expression,
    Steps,
    beyond,
    less,
    product,
    quotient,
    total,
)
from freqid.blend.exports.place import EFFORTS, add_place
from freqid.blend.exports.usable_range import DEPARTURE, meaning_of, range_notes, states, units_of
from freqid.blend.global_model import GlobalModel
from freqid.blend.line import Line
from freqid.blend.locate import Located, locate
from freqid.blend.pchip import Pchip
from freqid.blend.similarity import ALIKE, equivalent, goes_with_velocity, not_similar
from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.point import per
from freqid.core.units import RHO0

TABLE_ERROR = 1e-3
"""Of tables, relative to a response's size along the corridor; identification knows it to 1 % at best."""
MOST_NODES = 512  # by interval between knots
PLACE_ERROR = 1e-9  # of the length of a line
FAR_STRAYS = 0.01  # share of states, all far off the corridor, whose nearest place may be another one
SAMPLES = 2000  # states that an export is tried at
CHECKS = 24  # of them that go into the file


def tabled(model: GlobalModel, table_error: float = TABLE_ERROR) -> Calculation:
    """Return a global model as a calculation whose parameters are linear tables of the place on a line.

    Parameters
    ----------
    model : GlobalModel
    table_error : float
        Largest error that tables may make, relative to the size of each response along the corridor.

    Raises
    ------
    UsageError
        Where the error asked for is not between 1e-7 and 0.1 or needs too many nodes, or the corridor bends
        so sharply that no fixed number of steps finds the place on it.
    """
    if not 1e-7 <= table_error <= 0.1:
        raise UsageError(
            f"a table error of {table_error:g} is asked for", remedy="ask for something between 1e-7 and 0.1"
        )
    for effort in EFFORTS:
        found = _calculation(model, table_error, effort)
        if found is not None:
            return found
    raise UsageError(
        "the place on the corridor is found by no fixed number of steps, because the corridor bends sharply",
        remedy="export to python, csv, json or mat, which hold the model itself",
    )


def _calculation(model: GlobalModel, table_error: float, effort: tuple[int, int]) -> Calculation | None:
    """Return the calculation, or None where its places are not those of the model."""
    steps, c = Steps(), model.corridor
    named = {
        name: steps.add(name, unit, meaning_of(model, name), None, label=name)
        for name, unit in units_of(model).items()
    }
    k = steps.add("k", "1", "equivalent over true velocity", Apply("sqrt", (quotient(named["rho"], RHO0),)))
    velocity = dict(zip(c.units, goes_with_velocity(c.units), strict=True))
    x = {
        name: steps.add(f"{name}_eq", unit, f"equivalent {name}", product(named[name], k))
        if velocity[name]
        else named[name]
        for name, unit in c.units.items()
    }
    speed = x["u"] if "u" in x else steps.add("u_eq", "m/s", "equivalent u", product(named["u"], k))
    moving = {n: i for i, n in enumerate(c.scheduled) if n in named}
    flown = {**{n: named[n] for n in moving}, "u": speed}
    several = len(model.lines) > 1
    weights: list[Expression] = [1.0]
    if several:
        steps.axes["rho"] = Axis(np.array([line.rho for line in model.lines]), "kg/m3")
        weights = [
            steps.table(f"weight_{i + 1}", "1", f"how much line {i + 1} counts", "rho", named["rho"], row)
            for i, row in enumerate(np.eye(len(model.lines)))
        ]
    places, far, local, tables, own_values = [], [], [], [], []
    for i, line in enumerate(model.lines):
        number = f"_{i + 1}" if several else ""
        place, off = add_place(steps, line, number, flown, moving, effort)
        places.append(place)
        off_line = total(
            [*(beyond(off[n], model.tolerance.tilt) for n in moving), beyond(off["u"], model.tolerance.speed)]
        )
        counts = Apply("if<", (0.0, weights[i], off_line, 0.0)) if several else off_line
        far.append(steps.add(f"far{number}", "1", f"how many variables are too far off line {i + 1}", counts))
        tables.append(_Tables(model, line, i, table_error))
        local.append(tables[-1].add(steps, number, place))
    if not_similar(c.units):
        away = beyond(less(quotient(named["rho"], model.lines[0].rho), 1.0), ALIKE)
        far.append(steps.add("far_density", "1", "1 where no law carries the model to the density", away))
    outside = steps.add(
        "outside", "1", "1 where the corridor is too far away, else 0", Apply("min", (total(far), 1.0))
    )
    outputs = {}
    for r, (name, response) in enumerate(c.responses.items()):
        terms = []
        for i, one in enumerate(local):
            number = f"_{i + 1}" if several else ""
            bias, slopes, trims = one[r]
            moved = [
                product(t, less(x[n], x0))
                for t, n, x0 in zip(slopes, response.regressors, trims, strict=True)
            ]
            own = steps.add(
                f"{name}_line{number}",
                response.unit,
                f"{name} of line {i + 1}",
                total([bias, *moved]),
            )
            own_values.append(own)
            terms.append(product(weights[i], own))
        for i, (one, two) in enumerate(pairwise(local)):
            bend = total(
                [
                    product(less(b, a), less(b0, a0))
                    for a, b, a0, b0 in zip(one[r][1], two[r][1], one[r][2], two[r][2], strict=True)
                ]
            )
            terms.append(product(0.5, weights[i], weights[i + 1], bend))
        outputs[name] = steps.add(name, response.unit, f"applied {name}, whole", total(terms), label=name)
    calculation = Calculation(
        title=f"{c.vehicle or 'aircraft'}: global model of {len(c.ids)} conditions",
        notes=(),
        axes=steps.axes,
        quantities=tuple(steps.quantities),
        outputs=outputs,
        outside=outside,
        inner=(*places, *far, *own_values),
        bounds={},
        checks=(),
        form=c.form,
    )
    return _tried(model, calculation, places, tables)


class _Tables:
    """Tables of one line's parameters, dense enough, and their errors.

    The chord of a cubic over a step h is off by at most ``h^2 / 8`` of the larger second derivative at its
    ends, because a cubic's second derivative is linear and nodes include all knots.
    """

    def __init__(self, model: GlobalModel, line: Line, index: int, table_error: float):
        self.model, self.line = model, line
        c = model.corridor
        members = np.flatnonzero(c.line == index)
        k = equivalent(c.rho[members])
        knots = line.knots
        per_response = []
        self.chord, self.scale = [], []  # errors of one step from knot to knot
        for response, local in zip(c.responses.values(), line.local, strict=True):
            units = dict(zip(response.regressors, response.regressor_units, strict=True))
            rms = response.regressor_rms[:, members] * k ** goes_with_velocity(units)[:, None]
            away = DEPARTURE * np.maximum(rms[:, 1:], rms[:, :-1])
            away = np.array(
                [
                    np.maximum(a, model.tolerance.speed) if n == "u" else a
                    for n, a in zip(units, away, strict=True)
                ]
            )
            e = _chord_error(knots, local.parameters)
            e0 = _chord_error(knots, local.trim)
            self.chord.append((e, e0))
            at = local.parameters(knots)
            slope = np.maximum(np.abs(at[1:, 1:]), np.abs(at[1:, :-1]))  # pchip stays between its knots
            linear = e[0] + (e[1:] * away).sum(axis=0) + (slope * e0).sum(axis=0)
            per_response.append((linear, (e[1:] * e0).sum(axis=0)))
            size = float(np.abs(at[0]).max() + np.sqrt(((at[1:] * rms) ** 2).sum(axis=0)).max())
            self.scale.append(size or 1.0)
        parts = np.ones(knots.size - 1, dtype=int)
        for (linear, square), scale in zip(per_response, self.scale, strict=True):
            need = np.sqrt(linear / (table_error * scale))
            parts = np.maximum(
                parts,
                np.ceil(np.maximum(need, (square / (table_error * scale)) ** 0.25) * 1.0001).astype(int),
            )
        if parts.max() > MOST_NODES:
            least = 1.05 * table_error * (parts.max() / MOST_NODES) ** 2
            raise UsageError(
                f"a table error of {table_error:g} needs {parts.max()} nodes between two points",
                remedy=f"ask for {least:.2g} or more (--table-error)",
            )
        self.parts = parts
        self.nodes = np.append(
            np.concatenate(
                [
                    np.linspace(a, b, n, endpoint=False)
                    for a, b, n in zip(knots, knots[1:], parts, strict=False)
                ]
            ),
            knots[-1],
        )
        self.bounds = [linear / parts**2 + square / parts**4 for linear, square in per_response]

    def add(self, steps: Steps, number: str, place: str) -> list[tuple[str, list[str], list[str]]]:
        """Add the tables; return by response the names of bias, derivatives and trims."""
        model, line = self.model, self.line
        axis, coarse = f"nodes{number}", f"errors{number}"
        along = (
            "m/s"
            if model.corridor.along == "u"
            else model.corridor.scheduled_units[model.corridor.scheduled.index(model.corridor.along)]
        )
        steps.axes[axis] = Axis(self.nodes, along)
        knots = line.knots
        few = np.unique(np.concatenate([np.linspace(a, b, 5) for a, b in pairwise(knots)]))
        steps.axes[coarse] = Axis(few, along)
        at, found = number.replace("_", " on line "), []
        known: dict[str, list[tuple[Array, str]]] = {}

        def called(name: str, unit: str) -> str:
            return f"equivalent {name}" if goes_with_velocity({name: unit})[0] else name

        for response, local in zip(model.corridor.responses.values(), line.local, strict=True):
            values, trims = local.parameters(self.nodes), local.trim(self.nodes)
            errors = np.sqrt(local.own_variance(few))
            names, r = [], response.response
            units = zip(("", *response.regressors), ("1", *response.regressor_units), strict=True)
            for j, (name, unit) in enumerate(units):
                meaning = f"derivative of {r} by {called(name, unit)}{at}" if name else f"{r} at the trim{at}"
                own = f"{r}_{name or 'trim'}{number}"
                unit = per(response.unit, unit)
                error = steps.table(f"{own}_se", unit, f"standard error of {own}", coarse, place, errors[j])
                names.append(steps.table(own, unit, meaning, axis, place, values[j], std_error=error))
            x0 = []
            for name, unit, row in zip(response.regressors, response.regressor_units, trims, strict=True):
                same = next((n for v, n in known.get(name, []) if np.array_equal(v, row)), None)
                if same is None:
                    meaning = f"{called(name, unit)} at the trim{at}"
                    same = steps.table(f"trim_{name}{number}", unit, meaning, axis, place, row)
                    known.setdefault(name, []).append((row, same))
                x0.append(same)
            found.append((names[0], names[1:], x0))
        return found


def _chord_error(knots: Array, cubic: Pchip) -> Array:
    """Return how far cubics are from their chords at most, shape (channel, interval)."""
    left = cubic(knots[:-1], 2)
    right = 2 * cubic(0.5 * (knots[1:] + knots[:-1]), 2) - left
    return np.diff(knots) ** 2 / 8 * np.maximum(np.abs(left), np.abs(right))


def _tried(
    model: GlobalModel, calculation: Calculation, places: list[str], tables: list[_Tables]
) -> Calculation | None:
    """Return the calculation with its errors and check cases; None where a place is not the model's."""
    inputs = states(model, SAMPLES)
    truth = model.wrench(inputs, outside="hold")
    at = locate(model.corridor, model.lines, inputs, model.inputs, model.tolerance, "hold")
    found = calculation.evaluate(inputs)
    strays = np.zeros(SAMPLES, dtype=bool)
    for name, line, position in zip(places, model.lines, at.positions, strict=True):
        wrong = np.abs(found[name] - position.s) > PLACE_ERROR * np.ptp(line.knots)
        if (wrong & ~at.outside).any() or wrong.mean() > FAR_STRAYS:
            return None
        strays |= wrong
    bounds, bend = _sample_bounds(at, tables)
    scale = np.max([t.scale for t in tables], axis=0)
    bounds += 1e-9 * scale[:, None]  # the place is as near as that
    inside = [max(float(t.bounds[r].max()) for t in tables) for r in range(len(scale))]
    stated = np.array(inside) + bend.max(axis=1)
    errors = np.array([found[calculation.outputs[r]] for r in model.names]) - truth.values
    same = ~at.outside
    order = np.concatenate([np.flatnonzero(same)[: CHECKS - 4], np.flatnonzero(~same & ~strays)[:4]])
    checks = tuple(
        CheckCase(
            name=f"{'outside' if at.outside[i] else 'inside'} {number + 1}",
            inputs={n: float(v[i]) for n, v in inputs.items()},
            outputs={n: float(v[i]) for n, v in zip(model.names, truth.values, strict=True)},
            bounds={n: float(v[i]) for n, v in zip(model.names, bounds, strict=True)},
            outside=bool(at.outside[i]),
        )
        for number, i in enumerate(order)
    )
    units = truth.units
    most = np.abs(errors[:, same]).max(axis=1)
    said = ", ".join(
        f"{n} {b:.3g} {u} (largest found {e:.2g})"
        for n, b, e, u in zip(model.names, stated, most, units, strict=True)
    )
    return replace(
        calculation,
        notes=(
            *range_notes(model),
            f"Parameters and trims are linear tables; they make errors, in that range, of at most {said}.",
            "Standard errors are one sigma of each parameter by itself; correlations are not in this file.",
        ),
        bounds=dict(zip(model.names, stated.tolist(), strict=True)),
        checks=checks,
    )


def _sample_bounds(at: Located, tables: list[_Tables]) -> tuple[Array, Array]:
    """Return how far tables can make responses be from the model at states, shape (response, n) each.

    The whole, and of that what the term of curvature between two lines makes.
    """
    count = len(tables[0].scale)
    whole, bend = np.zeros((2, count, at.rho.size))
    for r in range(count):
        rows = []
        for t, p in zip(tables, at.positions, strict=True):
            local = t.line.local[r]
            i = np.clip(np.searchsorted(t.line.knots, p.s, side="right") - 1, 0, t.parts.size - 1)
            e, e0 = t.chord[r][0][:, i] / t.parts[i] ** 2, t.chord[r][1][:, i] / t.parts[i] ** 2
            rows.append((local.parameters(p.s), local.trim(p.s), e, e0, at.x[local.columns]))
        for (value, trim, e, e0, x), w in zip(rows, at.weights, strict=True):
            off = np.abs(x - trim)
            whole[r] += w * (e[0] + (e[1:] * (off + e0)).sum(axis=0) + (np.abs(value[1:]) * e0).sum(axis=0))
        for (one, two), w in zip(pairwise(rows), at.weights[:-1] * at.weights[1:], strict=True):
            gap, rise = np.abs(two[1] - one[1]), np.abs(two[0][1:] - one[0][1:])
            e, e0 = one[2][1:] + two[2][1:], one[3] + two[3]
            bend[r] += 0.5 * w * (e * (gap + e0) + rise * e0).sum(axis=0)
    return whole + bend, bend

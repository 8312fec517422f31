"""Point and global models as calculations with tables, and how far tables are from the model."""

from __future__ import annotations

from collections.abc import Mapping
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
from freqid.blend.global_model import GlobalModel
from freqid.blend.line import Line
from freqid.blend.locate import Located, locate
from freqid.blend.pchip import Pchip
from freqid.blend.similarity import ALIKE, equivalent, goes_with_velocity, not_similar
from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.point import PointModel, per
from freqid.core.sections.identification import factors_of
from freqid.core.units import RHO0

TABLE_ERROR = 1e-3
"""Of tables, relative to a response's size along the corridor; identification knows it to 1 % at best."""
DEPARTURE = 3.0
"""How far regressors go from their trim in the stated range, in rms of the manoeuvres of identification."""
MOST_NODES = 512  # by interval between knots
PLACE_ERROR = 1e-9  # of the length of a line
FAR_STRAYS = 0.01  # share of states, all far off the corridor, whose nearest place may be another one
SAMPLES = 2000  # states that an export is tried at
CHECKS = 24  # of them that go into the file


def calculation_of(model: PointModel | GlobalModel, table_error: float = TABLE_ERROR) -> Calculation:
    """Return a model as a calculation.

    Parameters
    ----------
    model : PointModel or GlobalModel
        A point model is exact; a global model's parameters are linear tables of the place on a line.
    table_error : float
        Largest error that tables may make, relative to the size of each response along the corridor.

    Raises
    ------
    UsageError
        Where the error asked for is not between 1e-7 and 0.1, or needs too many nodes.
    """
    if not 1e-7 <= table_error <= 0.1:
        raise UsageError(
            f"a table error of {table_error:g} is asked for", remedy="ask for something between 1e-7 and 0.1"
        )
    if isinstance(model, PointModel):
        return _point(model)
    for effort in EFFORTS:
        found = _global(model, table_error, effort)
        if found is not None:
            return found
    raise UsageError(
        "the place on the corridor is found by no fixed number of steps, because the corridor bends sharply",
        remedy="export to python, csv, json or mat, which hold the model itself",
    )


# Of a point model -----------------------------------------------------------------------------------------


def _point(model: PointModel) -> Calculation:
    steps, outputs, limits = Steps(), {}, {}
    named: dict[str, str] = {}
    factors = _factor_trims(model)
    for name, (unit, trim, rms) in factors.items():
        span = f"{name}, trim {trim:.6g}, moved by {rms:.3g} rms when the model was identified"
        named[name] = steps.add(name, unit, span, None, label=name)
    for response in model.responses.values():
        r = response.response
        terms: list[Expression] = [
            steps.add(f"{r}_trim", response.unit, f"{r} at the trim", response.bias, response.bias_std_error)
        ]
        before: list[str] = []
        for j, (name, unit) in enumerate(zip(response.regressors, response.parameter_units, strict=True)):
            correlation = {
                other: float(response.correlation[j, i])
                for i, other in enumerate(before)
                if np.isfinite(response.correlation[j, i])
            }
            estimate, error = float(response.estimate[j]), float(response.std_error[j])
            parameter = steps.add(
                f"{r}_{name}", unit, f"derivative of {r} by {name}", estimate, error, correlation
            )
            before.append(parameter)
            parts = factors_of(name)
            moved = [less(named[part], factors[part][1]) for part in parts]
            value = moved[0] if len(parts) == 1 else less(product(*moved), float(response.trim[j]))
            terms.append(product(parameter, value))
        outputs[r] = steps.add(r, response.unit, f"applied {r}, whole", total(terms), label=r)
        limits[r] = 0.0
    far = total(
        [beyond(less(named[n], trim), DEPARTURE * rms) for n, (_, trim, rms) in factors.items() if rms > 0]
    )
    outside = steps.add(
        "outside",
        "1",
        f"1 where an input is more than {DEPARTURE:g} rms from its trim",
        Apply("min", (far, 1.0)),
    )
    at = model.reference
    notes = (
        f"Model of {model.vehicle} at the condition '{at.id}': u = {at.u:.6g} m/s, rho = {at.rho:.6g} kg/m3"
        + "".join(f", {n} = {v:.6g}" for n, v in at.scheduled.items())
        + f"; form '{model.form}', {model.axes} axes, moments about the centre of gravity.",
        "Inputs are absolute values in SI units and radians, not deviations from the trim.",
        f"The model is linear and is meant for inputs within {DEPARTURE:g} rms of its trim; beyond, it goes "
        "on linearly and the quantity 'outside' is 1.",
        "Parameters are exact; standard errors are one sigma.",
    )
    calculation = Calculation(
        title=f"{model.vehicle or 'aircraft'} at {at.id or 'one condition'}",
        notes=notes,
        axes={},
        quantities=tuple(steps.quantities),
        outputs=outputs,
        outside=outside,
        bounds=limits,
        checks=(),
        form=model.form,
    )
    return replace(calculation, checks=_point_checks(model, factors))


def _factor_trims(model: PointModel) -> dict[str, tuple[str, float, float]]:
    """Return unit, trim and rms of all inputs of a point model, by name."""
    found: dict[str, tuple[str, float, float]] = {}
    for response in model.responses.values():
        rows = zip(
            response.regressors,
            response.regressor_units,
            response.trim.tolist(),
            response.regressor_rms.tolist(),
            strict=True,
        )
        for name, unit, trim, rms in rows:
            if len(factors_of(name)) == 1:
                found.setdefault(name, (unit, trim, rms))
    lacking = [
        f for r in model.responses.values() for n in r.regressors for f in factors_of(n) if f not in found
    ]
    if lacking:
        raise UsageError(
            f"a product has the factor '{lacking[0]}', which is no regressor, so its trim is not known",
            remedy="identify the point with the factor among its regressors",
        )
    return found


def point_values(model: PointModel, inputs: Mapping[str, Array]) -> dict[str, Array]:
    """Return the responses of a point model for absolute inputs, by response, shape (n,) each."""
    factors = _factor_trims(model)
    values = {}
    for name, response in model.responses.items():
        x = [
            np.asarray(inputs[n])
            if len(factors_of(n)) == 1
            else np.prod([np.asarray(inputs[f]) - factors[f][1] for f in factors_of(n)], axis=0)
            for n in response.regressors
        ]
        values[name] = response.bias + response.estimate @ (np.array(x) - response.trim[:, None])
    return values


def _point_checks(
    model: PointModel, factors: Mapping[str, tuple[str, float, float]]
) -> tuple[CheckCase, ...]:
    rng = np.random.default_rng(0)
    size = rng.uniform(-1, 1, (len(factors), CHECKS)) * np.append(0.0, np.linspace(0.5, 2.9, CHECKS - 1))
    size[:, -1] = 4.0
    inputs = {n: trim + rms * row for (n, (_, trim, rms)), row in zip(factors.items(), size, strict=True)}
    values = point_values(model, inputs)
    scale = {n: float(np.abs(v).max()) for n, v in values.items()}
    return tuple(
        CheckCase(
            name="at the trim" if i == 0 else "outside" if i == CHECKS - 1 else f"about the trim {i}",
            inputs={n: float(v[i]) for n, v in inputs.items()},
            outputs={n: float(v[i]) for n, v in values.items()},
            bounds={n: 1e-12 * max(scale[n], 1e-6) for n in values},
            outside=bool(i == CHECKS - 1),
        )
        for i in range(CHECKS)
    )


# Of a global model ----------------------------------------------------------------------------------------


def _global(model: GlobalModel, table_error: float, effort: tuple[int, int]) -> Calculation | None:
    """Return the calculation, or None where its places are not those of the model."""
    steps, c = Steps(), model.corridor
    named = {
        name: steps.add(name, unit, _input_words(model, name), None, label=name)
        for name, unit in _units(model).items()
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
    places, far, local, error = [], [], [], []
    for i, line in enumerate(model.lines):
        number = f"_{i + 1}" if several else ""
        place, off = add_place(steps, line, number, flown, moving, effort)
        places.append(place)
        off_line = total(
            [*(beyond(off[n], model.tolerance.tilt) for n in moving), beyond(off["u"], model.tolerance.speed)]
        )
        counts = Apply("if<", (0.0, weights[i], off_line, 0.0)) if several else off_line
        far.append(steps.add(f"far{number}", "1", f"how many variables are off line {number or '1'}", counts))
        tables = _Tables(model, line, i, table_error)
        error.append(tables)
        local.append(tables.add(steps, number, place))
    if not_similar(c.units):
        far.append(beyond(less(quotient(named["rho"], model.lines[0].rho), 1.0), ALIKE))
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
                f"{name} of line {number or '1'}",
                total([bias, *moved]),
            )
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
        title=f"{c.vehicle or 'aircraft'} over {len(c.ids)} conditions",
        notes=(),
        axes=steps.axes,
        quantities=tuple(steps.quantities),
        outputs=outputs,
        outside=outside,
        bounds={},
        checks=(),
        form=c.form,
    )
    return _tried(model, calculation, places, error, table_error)


def _units(model: GlobalModel) -> dict[str, str]:
    c = model.corridor
    scheduled = dict(zip(c.scheduled, c.scheduled_units, strict=True))
    own = {"u": "m/s", "rho": "kg/m3"}
    return {name: c.units.get(name) or own.get(name) or scheduled[name] for name in model.inputs}


def _input_words(model: GlobalModel, name: str) -> str:
    c = model.corridor
    if name == "u":
        return f"velocity along x body through the air, points from {c.u.min():.6g} to {c.u.max():.6g} m/s"
    if name == "rho":
        return f"air density, points from {c.rho.min():.6g} to {c.rho.max():.6g} kg/m3"
    if name in c.scheduled:
        row = c.schedule[c.scheduled.index(name)]
        return f"{name}, set along the corridor from {row.min():.6g} to {row.max():.6g}"
    trims = [r.trim[r.regressors.index(name)] for r in c.responses.values() if name in r.regressors]
    rms = max(
        r.regressor_rms[r.regressors.index(name)].max() for r in c.responses.values() if name in r.regressors
    )
    return f"{name}, trims from {np.min(trims):.6g} to {np.max(trims):.6g}, moved by up to {rms:.3g} rms"


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
            self.scale.append(np.abs(at[0]).max() + np.sqrt(((at[1:] * rms) ** 2).sum(axis=0)).max())
        parts = np.ones(knots.size - 1, dtype=int)
        for (linear, square), scale in zip(per_response, self.scale, strict=True):
            need = np.sqrt(linear / (table_error * scale))
            parts = np.maximum(
                parts,
                np.ceil(np.maximum(need, (square / (table_error * scale)) ** 0.25) * 1.0001).astype(int),
            )
        if parts.max() > MOST_NODES:
            raise UsageError(
                f"a table error of {table_error:g} needs {parts.max()} nodes between two points",
                remedy=f"ask for {table_error * (parts.max() / MOST_NODES) ** 2:.1g} or more (--table-error)",
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
        at, found = f"on line{number.replace('_', ' ')}", []
        known: dict[str, list[tuple[Array, str]]] = {}
        for response, local in zip(model.corridor.responses.values(), line.local, strict=True):
            values, trims = local.parameters(self.nodes), local.trim(self.nodes)
            errors = np.sqrt(local.own_variance(few))
            names, r = [], response.response
            units = zip(("", *response.regressors), ("1", *response.regressor_units), strict=True)
            for j, (name, unit) in enumerate(units):
                meaning = f"derivative of {r} by equivalent {name} {at}" if name else f"{r} at the trim {at}"
                own = f"{r}_{name or 'trim'}{number}"
                unit = per(response.unit, unit)
                error = steps.table(f"{own}_se", unit, f"standard error of {own}", coarse, place, errors[j])
                names.append(steps.table(own, unit, meaning, axis, place, values[j], std_error=error))
            x0 = []
            for name, unit, row in zip(response.regressors, response.regressor_units, trims, strict=True):
                same = next((n for v, n in known.get(name, []) if np.array_equal(v, row)), None)
                if same is None:
                    same = steps.table(
                        f"trim_{name}{number}", unit, f"equivalent {name} at the trim {at}", axis, place, row
                    )
                    known.setdefault(name, []).append((row, same))
                x0.append(same)
            found.append((names[0], names[1:], x0))
        return found


def _chord_error(knots: Array, cubic: Pchip) -> Array:
    """Return how far cubics are from their chords at most, shape (channel, interval)."""
    left = cubic(knots[:-1], 2)
    right = 2 * cubic(0.5 * (knots[1:] + knots[:-1]), 2) - left
    return np.diff(knots) ** 2 / 8 * np.maximum(np.abs(left), np.abs(right))


def states(model: GlobalModel, count: int, seed: int = 0) -> dict[str, Array]:
    """Return states all over the stated range, shape (count,) each: on the corridor, off it, beyond its ends.

    All inputs of the model, SI: at every density of its lines and between, up to twice the tolerance from the
    corridor, regressors up to `DEPARTURE` rms from their trims.
    """
    rng, c = np.random.default_rng(seed), model.corridor
    which = rng.integers(len(model.lines), size=count)
    rho = np.array([line.rho for line in model.lines])[which]
    if len(model.lines) > 1:
        rho = rng.uniform(0.98 * rho.min(), 1.02 * rho.max(), count)
    k = equivalent(rho)
    x, schedule, speed = np.zeros((len(c.units), count)), np.zeros((len(c.scheduled), count)), np.zeros(count)
    for i, line in enumerate(model.lines):
        on = which == i
        s = rng.uniform(line.knots[0], line.knots[-1], on.sum())
        s[::7] = rng.choice(line.knots, s[::7].size)
        x[:, on], schedule[:, on], speed[on] = line.trim(s, len(c.units)), line.schedule(s), line.speed(s)
    reach = rng.choice([0.0, 0.5, 1.0, 2.0], count, p=[0.2, 0.3, 0.4, 0.1])
    turn = model.lines[0].turn[:, None]
    schedule = schedule + reach * model.tolerance.tilt * rng.uniform(-1, 1, schedule.shape) / turn
    speed = speed + reach * model.tolerance.speed * rng.uniform(-1, 1, count)
    units = c.units
    rms = {
        n: min(
            r.regressor_rms[r.regressors.index(n)].min() for r in c.responses.values() if n in r.regressors
        )
        for n in units
    }
    moved = (
        np.array([rms[n] for n in units])[:, None]
        * DEPARTURE
        * rng.uniform(-1, 1, x.shape)
        * np.minimum(reach, 1)
    )
    values = dict(zip(units, (x + moved) / k ** goes_with_velocity(units)[:, None], strict=True))
    values |= dict(zip(c.scheduled, schedule, strict=True)) | {"u": speed / k, "rho": rho}
    return {name: values[name] for name in model.inputs}


def _tried(
    model: GlobalModel, calculation: Calculation, places: list[str], tables: list[_Tables], table_error: float
) -> Calculation | None:
    """Return the calculation with its errors and check cases; None where a place is not the model's."""
    inputs = states(model, SAMPLES)
    truth = model.wrench(inputs, outside="hold")
    at = locate(model.corridor, model.lines, inputs, model.inputs, model.tolerance, "hold")
    found = calculation.evaluate(inputs)
    for name, line, position in zip(places, model.lines, at.positions, strict=True):
        wrong = np.abs(found[name] - position.s) > PLACE_ERROR * np.ptp(line.knots)
        if (wrong & ~at.outside).any() or wrong.mean() > FAR_STRAYS:
            return None
    bounds, bend = _sample_bounds(at, tables)
    scale = np.max([t.scale for t in tables], axis=0)
    bounds += 1e-9 * scale[:, None]  # the place is as near as that
    stated = np.array([max(float(t.bounds[r].max()) for t in tables) for r in range(len(scale))]) + bend.max(
        axis=1
    )
    errors = np.array([found[calculation.outputs[r]] for r in model.names]) - truth.values
    same = ~at.outside
    order = np.concatenate([np.flatnonzero(same)[: CHECKS - 4], np.flatnonzero(~same)[:4]])
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
        notes=_notes(model, said),
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


def _notes(model: GlobalModel, said: str) -> tuple[str, ...]:
    c, t = model.corridor, model.tolerance
    moving = [n for n in c.scheduled if n in model.inputs]
    span = f"u from {c.u.min():.6g} to {c.u.max():.6g} m/s, "
    span += f"rho from {c.rho.min():.6g} to {c.rho.max():.6g} kg/m3"
    near = f"{t.speed:g} m/s of equivalent speed"
    if moving:
        near += f" and {np.rad2deg(t.tilt):.3g} deg of {', '.join(moving)}"
    return (
        f"Model of {c.vehicle} over the conditions {' '.join(c.ids)}: {span}; form '{c.form}', body axes, "
        "moments about the centre of gravity.",
        "Inputs are absolute values in SI units and radians, not deviations from the trim. Equivalent "
        f"velocities, rates and rotor speeds are the true ones times sqrt(rho / {RHO0:g}).",
        f"The model is meant for states within {near} of the corridor. Beyond, parameters are held at the "
        "nearest place of the corridor and the quantity 'outside' is 1.",
        f"Regressors are meant to be within {DEPARTURE:g} rms of the manoeuvres of identification from their "
        "trims; beyond, the model goes on linearly.",
        "Parameters and trims are linear tables of shape-preserving cubics; they make errors, in that range, "
        f"of at most {said}.",
        "Standard errors are one sigma of each parameter by itself; their correlation is not in this file.",
    )


def start_of(model: PointModel | GlobalModel) -> dict[str, float]:
    """Return inputs at a trim and ``theta``, SI: a point model's own, or that half way along a corridor."""
    if isinstance(model, PointModel):
        at = {name: trim for name, (_, trim, _) in _factor_trims(model).items()}
        at = {**model.reference.scheduled, "u": model.reference.u, "rho": model.reference.rho} | at
        bias = {name: r.bias for name, r in model.responses.items()}
    else:
        c, line = model.corridor, model.lines[0]
        s = line.knots[line.knots.size // 2]
        along = s / equivalent(line.rho) if c.along == "u" else s
        inputs = model.reference(along, line.rho)
        at = {name: float(value[0]) for name, value in inputs.items()}
        bias = dict(zip(model.names, model.wrench(inputs, outside="hold").values[:, 0].tolist(), strict=True))
    theta = float(np.arctan2(bias.get("X", 0.0), -bias.get("Z", -1.0)))
    return {"w": at["u"] * np.tan(theta)} | at | {"theta": theta}

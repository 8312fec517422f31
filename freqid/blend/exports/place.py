"""Where on a line of the corridor an aircraft is, as scalar calculations.

`freqid.blend.line` searches a fine grid and then takes Newton's steps until they no longer move. Here the
search is over the chords between a few places, and the number of steps is fixed. `tabled`
takes as many of both as it needs for the place to come out the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from freqid.blend.exports.calculation import (
    Apply,
    Axis,
    Expression,
    Steps,
    clipped,
    less,
    product,
    quotient,
    total,
)
from freqid.blend.line import STILL_TILT, Line
from freqid.core.arrays import Array

EFFORTS = ((1, 4), (2, 5), (4, 6), (8, 7), (16, 8))
"""Chords by interval between knots, and steps of Newton's method, the least first."""


def add_place(
    steps: Steps,
    line: Line,
    number: str,
    flown: Mapping[str, str],
    moving: Mapping[str, int],
    effort: tuple[int, int],
) -> tuple[str, dict[str, Expression]]:
    """Add the place on a line.

    Parameters
    ----------
    steps : Steps
    line : Line
    number : str
        Of the line, for names.
    flown : mapping of str to str
        Names of the quantities of the scheduled variables and of ``u``, the equivalent speed.
    moving : mapping of str to int
        Scheduled variables that differ along the corridor, and their rows in the line's path.
    effort : tuple of 2 int
        One of `EFFORTS`.

    Returns
    -------
    str
        Name of the quantity that is the place.
    dict of str to Expression
        By variable, what is flown less what the line has there: tilts rad, others as `Line.turn` makes them,
        speed m/s.
    """
    if not moving:  # then the line runs along equivalent speed, and the place is the speed
        value = clipped(flown["u"], float(line.knots[0]), float(line.knots[-1]))
        place = steps.add(f"place{number}", "m/s", "place on the line: equivalent speed", value)
        return place, {"u": less(flown["u"], place)}
    way = _Way(steps, line, number, flown, moving)
    place, lowest, highest = way.add_nearest_chord(effort[0])
    for count in range(effort[1]):
        place = way.add_newton(f"{number}_{count + 1}", place, lowest, highest)
    here = way.add_path(f"{number}_end", place)
    off: dict[str, Expression] = {n: less(way.scaled[n], here[n][0]) for n in moving}
    off["u"] = quotient(less(way.scaled["u"], here["u"][0]), STILL_TILT)
    return place, off


class _Way:
    """A line's way through scheduled variables and speed, all scaled to angles that count alike."""

    def __init__(
        self,
        steps: Steps,
        line: Line,
        number: str,
        flown: Mapping[str, str],
        moving: Mapping[str, int],
    ):
        self.steps, self.line, self.number = steps, line, number
        self.rows = {**moving, "u": len(line.turn)}
        self.scale = {n: float(line.turn[row]) for n, row in moving.items()} | {"u": STILL_TILT}
        self.scaled: dict[str, Expression] = {
            n: flown[n]
            if scale == 1.0
            else steps.add(f"scaled_{n}{number}", "rad", f"{n} flown, as an angle", product(scale, flown[n]))
            for n, scale in self.scale.items()
        }
        knots = line.knots
        self.counts = np.arange(knots.size, dtype=float)
        steps.axes[f"knots{number}"] = Axis(knots, "1")
        steps.axes[f"intervals{number}"] = Axis(self.counts, "1")
        at, middle = knots[:-1], 0.5 * (knots[1:] + knots[:-1])
        second = self._values(at, 2) / 2
        third = (self._values(middle, 2) / 2 - second) / (1.5 * np.diff(knots))
        self.coefficients = (self._values(at), self._values(at, 1), second, third)

    def _values(self, s: Array, order: int = 0) -> Array:
        """Return the scaled path or a derivative of it, shape (variable, n)."""
        path = self.line.path(s, order)
        return np.array([self.scale[n] * path[row] for n, row in self.rows.items()])

    def add_nearest_chord(self, parts: int) -> tuple[str, str, str]:
        """Add the nearest point of the chords; return it, and the ends that Newton's steps may not pass."""
        add, number = self.steps.add, self.number
        pieces = [np.linspace(a, b, parts + 1) for a, b in pairwise(self.line.knots)]
        ends = np.unique(np.concatenate(pieces))
        at = self._values(ends)
        nearest = least = ""
        for i, start in enumerate(at.T[:-1]):
            along = at[:, i + 1] - start
            square = float(along @ along)
            ahead = [
                product(float(a) / square, self.scaled[n]) for a, n in zip(along, self.rows, strict=True)
            ]
            share = clipped(total([*ahead, -float(along @ start) / square]), 0.0, 1.0)
            t = add(f"chord{number}_{i + 1}", "1", f"nearest point of chord {i + 1}, 0 to 1", share)
            apart = [
                less(self.scaled[n], total([float(start[j]), product(float(along[j]), t)]))
                for j, n in enumerate(self.rows)
            ]
            meaning = f"squared distance from chord {i + 1}"
            distance = add(f"distance{number}_{i + 1}", "1", meaning, total([product(a, a) for a in apart]))
            here = total([float(i), t])
            here = Apply("if<", (distance, least, here, nearest)) if nearest else here
            closer = Apply("min", (distance, least)) if least else distance
            meaning = f"nearest of the first {i + 1} chords: whole chords before it, and part of it"
            nearest = add(f"nearest{number}_{i + 1}", "1", meaning, here)
            least = add(f"least{number}_{i + 1}", "1", "its squared distance", closer)
        self.steps.axes[f"chords{number}"] = Axis(np.arange(ends.size, dtype=float), "1")

        def place(name: str, meaning: str, count: str) -> str:
            return self.steps.table(f"{name}{number}", "1", meaning, f"chords{number}", count, ends)

        before = add(f"before{number}", "1", "one chord before", less(nearest, 1.0))
        after = add(f"after{number}", "1", "one chord after", total([nearest, 1.0]))
        return (
            place("guess", "first guess of the place", nearest),
            place("lowest", "lowest place that is tried", before),
            place("highest", "highest place that is tried", after),
        )

    def add_path(self, tag: str, place: str) -> dict[str, tuple[str, Expression, Expression]]:
        """Add the scaled path at a place; return it with its first and second derivative, exactly."""
        table, add, number = self.steps.table, self.steps.add, self.number
        meaning = "place, counted in intervals between knots"
        count = table(f"count{tag}", "1", meaning, f"knots{number}", place, self.counts)
        whole = Apply("min", (Apply("floor", (count,)), float(self.counts.size - 2)))
        interval = add(f"interval{tag}", "1", "interval, from 0", whole)
        axis = f"intervals{number}"
        start = table(f"start{tag}", "1", "place where the interval starts", axis, interval, self.line.knots)
        x = add(f"into{tag}", "1", "place in the interval", less(place, start))
        found = {}
        for j, n in enumerate(self.rows):
            c = []
            for order, values in enumerate(self.coefficients):
                meaning = f"coefficient of power {order} of {n} on the line"
                row = np.append(values[j], values[j, -1])
                c.append(table(f"c{order}_{n}{tag}", "1", meaning, axis, interval, row))
            value = total([c[0], product(x, total([c[1], product(x, total([c[2], product(x, c[3])]))]))])
            slope = total([c[1], product(x, total([product(2.0, c[2]), product(3.0, c[3], x)]))])
            curve = total([product(2.0, c[2]), product(6.0, c[3], x)])
            found[n] = (add(f"line_{n}{tag}", "rad", f"{n} of the line, as an angle", value), slope, curve)
        return found

    def add_newton(self, tag: str, place: str, lowest: str, highest: str) -> str:
        """Add one step towards the nearest point and return the place after it."""
        add, path = self.steps.add, self.add_path(tag, place)
        slope = {n: add(f"slope_{n}{tag}", "1", f"slope of {n}", path[n][1]) for n in self.rows}
        off = {
            n: add(f"off_{n}{tag}", "rad", f"{n} flown less the line's", less(self.scaled[n], path[n][0]))
            for n in self.rows
        }
        fall = total([product(off[n], slope[n]) for n in self.rows])
        base = add(f"base{tag}", "1", "squared slope", total([product(s, s) for s in slope.values()]))
        bend = total([product(off[n], path[n][2]) for n in self.rows])
        curve = add(f"curve{tag}", "1", "curvature of half the squared distance", less(base, bend))
        used = Apply("if<", (product(0.1, base), curve, curve, base))
        moved = total([place, quotient(fall, used)])
        return add(f"place{tag}", "1", "place after a step", clipped(moved, lowest, highest))

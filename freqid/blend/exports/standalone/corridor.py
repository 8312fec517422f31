"""The evaluator of a global model's Python file; a transcript of `freqid.blend`, which a test holds it to."""

from __future__ import annotations

import sys
from itertools import pairwise
from typing import Any

import numpy as np

DATA: dict[str, Any] = {}
# What follows goes into the exported file as it stands.

INPUTS = dict(zip(DATA.get("inputs", ()), DATA.get("input_units", ()), strict=True))
RESPONSES = dict(zip(DATA.get("responses", ()), DATA.get("units", ()), strict=True))


def wrench(inputs=None, **values):
    """Return the responses, shape (response, n), and whether each state is outside, shape (n,).

    Inputs are those of INPUTS by name, arrays of shape (n,) or numbers, SI and radians, absolute. Outside,
    the parameters are those of the nearest place of the corridor.
    """
    at = _located({**(inputs or {}), **values})
    return np.array([_mixed(at, r)[0] for r in range(len(RESPONSES))]), at["outside"]


def standard_error(inputs=None, **values):
    """Return one standard error of the responses, shape (response, n), from those of the points."""
    at = _located({**(inputs or {}), **values})
    return np.sqrt([_variance(at, r) for r in range(len(RESPONSES))])


# Where on the corridor ------------------------------------------------------------------------------------


def _located(given):
    unknown, missing = set(given) - set(INPUTS), set(INPUTS) - set(given)
    if unknown or missing:
        raise ValueError(
            f"inputs are {' '.join(INPUTS)}; unknown {sorted(unknown)}, missing {sorted(missing)}"
        )
    size = np.broadcast_shapes((1,), *(np.shape(v) for v in given.values()))
    given = {name: np.broadcast_to(np.asarray(v, float), size) for name, v in given.items()}
    rho = given["rho"]
    if not all(np.isfinite(v).all() for v in given.values()) or not (rho > 0).all():
        raise ValueError("inputs are finite numbers, and rho is positive")
    k = np.sqrt(rho / DATA["rho0"])
    velocity = np.array(DATA["velocity"])
    still = dict(zip(DATA["scheduled"], DATA["still"], strict=True))
    schedule = np.array([np.broadcast_to(given[n] if n in given else still[n], size) for n in still])
    schedule = schedule.reshape(len(still), rho.size)
    x = np.array([given[n] for n in DATA["regressors"]]) * k ** velocity[:, None]
    lines = [_Line(line) for line in DATA["lines"]]
    places, outside = [], np.zeros(rho.size, bool)
    weights = _weights(np.array([line["rho"] for line in DATA["lines"]]), rho)
    for line, w in zip(lines, weights, strict=True):
        s, speed_off, schedule_off = line.nearest(given["u"] * k, schedule)
        places.append(s)
        far = (np.abs(schedule_off) > DATA["tolerance"]["tilt"]).any(axis=0)
        outside |= (w > 0) & (far | (np.abs(speed_off) > DATA["tolerance"]["speed"]))
    if DATA["density_alike"] is not None:  # no law carries the model to another density
        outside |= np.abs(rho / DATA["lines"][0]["rho"] - 1) > DATA["density_alike"]
    return {"x": x, "places": places, "weights": weights, "outside": outside, "lines": lines}


def _weights(at, rho):
    """Return how much each line counts, shape (line, n): linear in density between lines, held beyond."""
    if at.size == 1:
        return np.ones((1, rho.size))
    i = np.clip(np.searchsorted(at, rho) - 1, 0, at.size - 2)
    share = np.clip((rho - at[i]) / (at[i + 1] - at[i]), 0.0, 1.0)
    weights, n = np.zeros((at.size, rho.size)), np.arange(rho.size)
    weights[i, n], weights[i + 1, n] = 1 - share, share
    return weights


class _Line:
    """One line of the corridor: its cubics, and its nearest place to a state."""

    def __init__(self, data):
        self.data = data
        self.knots = np.array(data["knots"])
        self.path = _Pchip(self.knots, data["path"])
        self.scale = np.append(data["turn"], DATA["still_tilt"])[:, None]

    def nearest(self, speed, schedule):
        """Return the place, shape (n,), and how far speed and scheduled variables are from it."""
        knots = self.knots
        grid = np.concatenate([np.linspace(a, b, 32, endpoint=False) for a, b in pairwise(knots)])
        grid = np.append(grid, knots[-1])
        on_grid = self.scale * self.path(grid)
        flown = self.scale * np.vstack([schedule, speed])
        nearest = ((on_grid**2).sum(axis=0)[:, None] - 2 * on_grid.T @ flown).argmin(axis=0)
        low, high = grid[np.maximum(nearest - 1, 0)], grid[np.minimum(nearest + 1, grid.size - 1)]
        s = grid[nearest]
        for _ in range(12):
            fall, curve = self._pull(s, flown)
            s, before = np.clip(s + fall / curve, low, high), s
            if np.abs(s - before).max() <= 1e-12:
                break
        off = flown - self.scale * self.path(s)
        return s, off[-1] / DATA["still_tilt"], off[:-1]

    def _pull(self, s, flown):
        """Return how half the squared distance falls with the place, and how that curves."""
        slope, off = self.scale * self.path(s, 1), flown - self.scale * self.path(s)
        base = (slope**2).sum(axis=0)
        curve = base - (off * self.scale * self.path(s, 2)).sum(axis=0)
        return (off * slope).sum(axis=0), np.where(curve > 0.1 * base, curve, base)


# The responses there --------------------------------------------------------------------------------------


def _mixed(at, r):
    """Return one response, shape (n,), and by line the factors of its bias and derivatives, (1 + p, n)."""
    local = [line.data["responses"][r] for line in at["lines"]]
    x = at["x"][local[0]["columns"]]
    where = list(zip(at["lines"], local, at["places"], strict=True))
    trim = np.array([_Pchip(line.knots, one["trims"])(s) for line, one, s in where])
    parameters = np.array([_Pchip(line.knots, one["values"])(s) for line, one, s in where])
    w = at["weights"][:, None]
    factors = w * (x - trim)
    bend = -0.5 * w[:-1] * w[1:] * np.diff(trim, axis=0)
    factors[:-1] += bend
    factors[1:] -= bend
    factors = np.concatenate([w, factors], axis=1)
    return (parameters * factors).sum(axis=(0, 1)), factors


def _variance(at, r):
    """Return the variance of one response, shape (n,)."""
    total = 0.0
    for line, s, factors in zip(at["lines"], at["places"], _mixed(at, r)[1], strict=True):
        one = line.data["responses"][r]
        n, p = line.knots.size, len(one["columns"])
        band = np.array(one["slope_weights"])  # (1 + p, knot, 3 at most)
        width = band.shape[2]
        slopes = np.zeros((1 + p, n, n))
        for i in range(n):
            first = min(max(i - 1, 0), n - width)
            slopes[:, i, first : first + width] = band[:, i]
        level, tilt = _hermite(line.knots, s)
        weights = level + np.swapaxes(slopes, 1, 2) @ tilt  # (1 + p, knot, n)
        for k in range(n):
            covariance = np.zeros((1 + p, 1 + p))
            covariance[0, 0] = one["bias_variance"][k]
            rows, columns = np.tril_indices(p)
            covariance[1 + rows, 1 + columns] = covariance[1 + columns, 1 + rows] = one["covariance"][k]
            g = weights[:, k] * factors
            total = total + ((covariance @ g) * g).sum(axis=0)
    return total


class _Pchip:
    """Shape-preserving cubics through values, shape (channel, knot) (Fritsch and Butland, 1984)."""

    def __init__(self, knots, values):
        self.knots, self.values = knots, np.array(values, float).reshape(-1, knots.size)
        self.slopes = _slopes(knots, self.values)

    def __call__(self, s, order=0):
        """Return values or derivatives, shape (channel, n)."""
        i = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, self.knots.size - 2)
        h, t = self.knots[i + 1] - self.knots[i], s - self.knots[i]
        y, d = self.values[:, i], self.slopes[:, i]
        chord = (self.values[:, i + 1] - y) / h
        c = (3 * chord - 2 * d - self.slopes[:, i + 1]) / h
        b = (d - 2 * chord + self.slopes[:, i + 1]) / h**2
        if order == 0:
            return y + t * (d + t * (c + t * b))
        return d + t * (2 * c + t * 3 * b) if order == 1 else 2 * c + 6 * t * b


def _slopes(knots, values):
    """Return the slopes at the knots, shape (channel, knot)."""
    h = np.diff(knots)
    chord = np.diff(values, axis=1) / h
    slopes = np.zeros(values.shape)
    if knots.size == 2:
        return slopes + chord
    left, right = chord[:, :-1], chord[:, 1:]
    w_left, w_right = h[:-1] + 2 * h[1:], 2 * h[:-1] + h[1:]
    alike = left * right > 0
    left, right = np.where(alike, left, 1.0), np.where(alike, right, 1.0)
    slopes[:, 1:-1] = np.where(alike, (w_left + w_right) / (w_left / left + w_right / right), 0.0)
    for at, near, far in ((0, 0, 1), (-1, -1, -2)):
        end = ((2 * h[near] + h[far]) * chord[:, near] - h[near] * chord[:, far]) / (h[near] + h[far])
        steep = (np.sign(chord[:, near]) != np.sign(chord[:, far])) & (
            np.abs(end) > 3 * np.abs(chord[:, near])
        )
        end = np.where(steep, 3 * chord[:, near], end)
        slopes[:, at] = np.where(np.sign(end) != np.sign(chord[:, near]), 0.0, end)
    return slopes


def _hermite(knots, s):
    """Return what values and slopes at the knots count at s, shape (knot, n) each."""
    i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, knots.size - 2)
    h, n = knots[i + 1] - knots[i], np.arange(s.size)
    t = (s - knots[i]) / h
    level, tilt = np.zeros((2, knots.size, s.size))
    level[i, n], level[i + 1, n] = (1 + 2 * t) * (1 - t) ** 2, t**2 * (3 - 2 * t)
    tilt[i, n], tilt[i + 1, n] = h * t * (1 - t) ** 2, h * t**2 * (t - 1)
    return level, tilt


# The check ------------------------------------------------------------------------------------------------


def self_check(tolerance=1e-12):
    """Compare with the cases that freqid computed, and say how they compare."""
    checks = DATA["checks"]
    found, outside = wrench(checks["inputs"])
    expected = np.array(checks["values"])
    size = np.abs(expected).max(axis=1, keepdims=True) + np.array(DATA["sizes"])[:, None]
    worst = float((np.abs(found - expected) / size).max())
    error = np.array(checks["std_error"])
    worst_error = float((np.abs(standard_error(checks["inputs"]) / error - 1)).max())
    same = bool((outside == np.array(checks["outside"])).all())
    good = worst <= tolerance and worst_error <= 1e-9 and same
    verdict = "good" if good else "NOT AS EXPECTED"
    text = f"{expected.shape[1]} check cases: responses within {worst:.1e} of their size"
    print(f"{text}, standard errors within {worst_error:.1e}; {verdict}")
    return good


if __name__ == "__main__":
    sys.exit(0 if self_check() else 1)

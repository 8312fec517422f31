"""The global model against a slow one of scalar loops, textbook slopes and a search by thirds."""

import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up

SPEEDS = (0.0, 3.0, 7.0, 12.0, 18.0, 25.0)


def slope_inside(h0, h1, d0, d1):
    """Weighted harmonic mean of two chords (Fritsch & Butland 1984)."""
    if d0 * d1 <= 0:
        return 0.0
    a = (h0 + 2 * h1) / (3 * (h0 + h1))
    return d0 * d1 / (a * d1 + (1 - a) * d0)


def slope_at_end(h0, h1, d0, d1):
    """Derivative at the first point of the parabola through three, kept from overshooting."""
    m = d0 + (d0 - d1) * h0 / (h0 + h1)
    if m * d0 <= 0:
        return 0.0
    return 3 * d0 if d0 * d1 <= 0 and abs(m) > abs(3 * d0) else m


def cubic(x, y, at):
    """Evaluate the shape-preserving cubic through (x, y)."""
    n = len(x)
    h = [x[i + 1] - x[i] for i in range(n - 1)]
    d = [(y[i + 1] - y[i]) / h[i] for i in range(n - 1)]
    m = [slope_at_end(h[0], h[1], d[0], d[1])]
    m += [slope_inside(h[i - 1], h[i], d[i - 1], d[i]) for i in range(1, n - 1)]
    m += [slope_at_end(h[-1], h[-2], d[-1], d[-2])]
    i = max(k for k in range(n - 1) if x[k] <= at or k == 0)
    t = (at - x[i]) / h[i]
    # Bernstein form.
    control = [y[i], y[i] + m[i] * h[i] / 3, y[i + 1] - m[i + 1] * h[i] / 3, y[i + 1]]
    weights = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
    return sum(w * c for w, c in zip(weights, control, strict=True))


def slow(points, state, response):
    """One response of one state from the points of one density whose wings tilt alike.

    Works at the density of the points: velocities flown at another are turned into those that give the
    same loads there.
    """
    points = sorted(points, key=lambda p: p.reference.u)
    k = np.sqrt(state["rho"] / points[0].reference.rho)
    u = [p.reference.u for p in points]
    tilt = [p.reference["dw1"] for p in points]

    def distance(s):  # both wings, and 0.05 deg for every m/s: docs/theory/global-model.md
        return 2 * (state["dw1"] - cubic(u, tilt, s)) ** 2 + (np.deg2rad(0.05) * (state["u"] * k - s)) ** 2

    low, high = u[0], u[-1]
    for _ in range(120):  # tilt falls with speed, so there is one minimum
        third = (high - low) / 3
        closer = distance(low + third) < distance(high - third)
        low, high = (low, high - third) if closer else (low + third, high)
    model = points[0][response]
    total = cubic(u, [p[response].bias for p in points], low)
    for j, name in enumerate(model.regressors):
        x = state[name] * (k if name in "uvwpqr" or name in ("n1", "n2") else 1.0)
        away = x - cubic(u, [p[response].trim[j] for p in points], low)
        total += cubic(u, [p[response].estimate[j] for p in points], low) * away
    return total


@pytest.mark.parametrize("rho", [1.225, 1.0])
def test_it_equals_the_slow_model(rho):
    points = [tilt_wing.exact_point(tilt_wing.trim(u, 1.225), f"u{u:g}") for u in SPEEDS]
    model = GlobalModel(line_up(points, [p.reference.id for p in points]))
    rng = np.random.default_rng(0)
    for u in (1.0, 5.5, 10.0, 21.0):
        at = tilt_wing.trim(u * np.sqrt(1.225 / rho), rho, tilt_wing.trim(u, 1.225)["dw1"])
        state = {
            n: v + (0.1 * rng.uniform(-1, 1) if n in tilt_wing.INPUTS and n != "u" else 0)
            for n, v in at.items()
        }
        found = model.wrench(state)
        for name, value in zip(found.names, found.values[:, 0], strict=True):
            assert value == pytest.approx(slow(points, state, name), abs=1e-5)  # what the search leaves

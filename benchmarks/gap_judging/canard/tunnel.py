"""What a tunnel and a test stand would tell the owner: `python benchmarks/gap_judging/canard/tunnel.py`.

Samples the truth's lattice, fans and pusher at random points of the flights' range, each part also scaled,
and fits polynomials with few terms by forward selection. Writes `tunnel.csv`: response, term, coefficient.
The owner's simulation reads nothing else of the truth.
"""

from __future__ import annotations

import csv
import sys
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import air  # noqa: E402
import canard_numbers as g  # noqa: E402
from fans import fan, pusher  # noqa: E402
from settings import Settings  # noqa: E402

COUNT, RHO = 3000, 1.18
EVEN = ("camber", "tilt", "alpha", "alpha_c", "q", "q_c", "canard", "flap", "toe", "polar")
ODD = ("slip", "beta", "beta_f", "p", "p_w", "r", "r_f", "ail", "rud")
ENOUGH, MOST = 0.004, 26  # share of the variation that may be left, and number of terms
SCALED = {
    "camber": "wing.lift_zero",
    "alpha": "wing.lift_slope",
    "alpha_c": "canard.lift_slope",
    "q": "wing.pitch_damping",
    "q_c": "canard.pitch_damping",
    "canard": "canard.effectiveness",
    "polar": "wing.drag_zero",
    "beta": "wing.sideslip",
    "beta_f": "winglets.side_force",
    "p_w": "wing.roll_damping",
    "r_f": "winglets.yaw_damping",
}


def campaign(rng):
    """Return inputs by name and coefficients of the lattice, by response."""
    around = lambda middle, wide: middle + wide * rng.uniform(-1, 1, COUNT)  # noqa: E731
    slow = rng.random(COUNT) < 0.5
    speed = np.where(slow, 19.0, 24.0) + around(0.0, 1.5)
    alpha, beta = np.where(slow, 0.080, 0.043) + around(0.0, 0.04), around(0.0, 0.06)
    p, q, r = around(0.0, 0.4), around(0.0, 0.4), around(0.0, 0.25)
    canard, left, right, rud_l, rud_r = (
        around(0.052, 0.06),
        *(around(0.0, wide) for wide in (0.08, 0.08, 0.17, 0.17)),
    )
    scale = {name: around(0.0, 0.15) for name in SCALED.values()}
    s = Settings([dict(zip(scale, row, strict=True)) for row in np.array(list(scale.values())).T.tolist()])
    x = np.zeros((10, COUNT))
    x[0], x[1], x[2] = (
        speed * np.cos(alpha) * np.cos(beta),
        speed * np.sin(beta),
        speed * np.sin(alpha) * np.cos(beta),
    )
    x[3:6] = p, q, r
    felt = np.vstack([canard, left, right, rud_l, rud_r, np.full((3, COUNT), 700.0)])
    made = air.lattice_loads(x, felt, RHO, s, air.Memory(x, felt, s), None)
    inputs = {
        "camber": 1.0,
        "tilt": alpha,
        "alpha": alpha,
        "alpha_c": alpha,
        "q": q / speed,
        "q_c": q / speed,
        "canard": canard,
        "flap": 0.5 * (left + right),
        "toe": 0.5 * (rud_l - rud_r),
        "polar": 1.0,
        "slip": beta,
        "beta": beta,
        "beta_f": beta,
        "p": p / speed,
        "p_w": p / speed,
        "r": r / speed,
        "r_f": r / speed,
        "ail": 0.5 * (left - right),
        "rud": 0.5 * (rud_l + rud_r),
    }
    inputs = {n: v * (1 + scale[SCALED[n]]) if n in SCALED else v for n, v in inputs.items()}
    return inputs, dict(zip("XYZLMN", made / (0.5 * RHO * speed**2 * g.AREA), strict=True))


def selected(terms, y, enough, most):
    """Return the coefficients of the terms that explain `y` best, one added after the other."""
    names = list(terms)
    columns = np.array([terms[n] for n in names]).T
    size = np.linalg.norm(columns, axis=0)
    left, taken = y.copy(), []
    whole = np.std(y)
    while np.sqrt(np.mean(left**2)) > enough * whole and len(taken) < most:
        basis = np.linalg.qr(columns[:, taken])[0] if taken else np.zeros((len(y), 0))
        free = columns - basis @ (basis.T @ columns)
        norm = np.linalg.norm(free, axis=0)
        gain = np.where(norm > 1e-6 * size, np.abs(free.T @ left) / np.maximum(norm, 1e-12), 0)
        taken.append(int(np.argmax(gain)))
        fit = np.linalg.lstsq(columns[:, taken], y, rcond=None)[0]
        left = y - columns[:, taken] @ fit
    share = np.sqrt(np.mean(left**2)) / whole
    return {names[i]: float(c) for i, c in zip(taken, fit, strict=True)}, share


def lattice_terms(inputs, odd):
    """Return products of two inputs and single inputs that are odd or even in what changes with the side."""
    out = {n: inputs[n] * np.ones(COUNT) for n in (ODD if odd else EVEN)}
    even = [n for n in EVEN if n != "polar"]
    if odd:
        pairs = [(a, b) for a in even for b in ODD]
    else:
        pairs = [*combinations_with_replacement(even, 2), *combinations_with_replacement(ODD, 2)]
    if not odd:
        out["1"] = np.ones(COUNT)
    return out | {f"{a} {b}": inputs[a] * inputs[b] * np.ones(COUNT) for a, b in pairs}


def stand(rng):
    """Return terms and coefficients of fans and pusher, by response, as a test stand shows them."""
    slow = rng.random(COUNT) < 0.5
    tip = np.where(slow, 90.0, 65.0) + rng.uniform(-15, 15, COUNT)
    edge = np.where(slow, 19.0, 24.0) + rng.uniform(-1.5, 1.5, COUNT)
    climb = rng.uniform(-3.5, 0.5, COUNT)
    thrust, flow, torque = fan(RHO, air.FAN_R, tip, climb, edge**2)
    disc = RHO * np.pi * air.FAN_R**2 * tip
    mu, lam = edge / tip, climb / tip
    terms = {"1": np.ones(COUNT), "mu": mu, "mu2": mu**2, "lam": lam, "lam2": lam**2, "mu lam": mu * lam}
    yield "fan thrust", terms, thrust / (disc * tip), 1e-4
    yield "fan flow", terms, flow / disc, 1e-4
    yield "fan torque", terms, torque / (disc * tip * air.FAN_R), 1e-4
    speed, along = rng.uniform(560, 900, COUNT), air.WAKE * rng.uniform(16.5, 27, COUNT)
    thrust, torque = pusher(RHO, air.PUSH_R, air.PUSH_CHORD, speed, along)
    advance = along / air.WAKE / (air.PUSH_R * speed)
    terms = {"1": np.ones(COUNT), "J": advance, "J2": advance**2}
    yield "push thrust", terms, thrust / speed**2, 1e-9
    yield "push torque", terms, torque / speed**2, 1e-9


def main() -> None:
    rng = np.random.default_rng(6)
    inputs, loads = campaign(rng)
    rows = []
    for name, y in loads.items():
        found, share = selected(lattice_terms(inputs, name in "YLN"), y, ENOUGH, MOST)
        print(f"{name}: {len(found)} terms leave {100 * share:.2f} %")
        rows += [(name, term, f"{value:.5g}") for term, value in found.items()]
    for name, terms, y, enough in stand(rng):
        found, share = selected(terms, y, enough, len(terms))
        print(f"{name}: {len(found)} terms leave {100 * share:.2f} %")
        rows += [(name, term, f"{value:.5g}") for term, value in found.items()]
    with (HERE / "tunnel.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("response", "term", "coefficient"), *rows])


if __name__ == "__main__":
    main()

"""What a tunnel and a test stand would tell the owner: `python benchmarks/gap_judging/blownwing/tunnel.py`.

Samples the truth's wing in its jets at random points of the flights' range, each part also scaled. Loads are
fitted as the sum of two halves, each a mirror image of the other: polynomials of a half's own inputs, and for
each of its propellers a polynomial times that propeller's thrust. Products of a left and a right input are
left out. Writes `tunnel.csv`: response, station, term, coefficient; then thrust and torque of a propeller
over its advance as a table. The owner's simulation reads nothing else of the truth.
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

import blown_air  # noqa: E402
import blownwing_numbers as g  # noqa: E402
from polynomials import reduced  # noqa: E402
from propellers import propeller  # noqa: E402
from settings import Settings  # noqa: E402

COUNT, RHO = 4000, 1.17
SCALED = (
    "wing.lift_zero",
    "wing.lift_slope",
    "wing.roll_damping",
    "wing.pitch_damping",
    "wing.sideslip",
    "wing.drag_zero",
    "wing.moment",
    "jets.strength",
    "jets.swirl",
)
ODD = ("p", "roll", "slip", "beta", "r")  # change sign on the other half
TRIMMED = {"alpha": (0.09, 0.04), "speed": (710.0, 910.0)}  # slow and fast, rad and rad/s
ADVANCES = np.linspace(0.10, 0.42, 9)  # of the table: speed over tip speed


def campaign(rng):
    """Return inputs of both halves by name, shape (half, point), thrusts, and coefficients of the wing."""
    around = lambda middle, wide: middle + wide * rng.uniform(-1, 1, COUNT)  # noqa: E731
    slow = rng.random(COUNT) < 0.5
    speed = np.where(slow, 18.0, 24.0) + around(0.0, 1.5)
    alpha, beta = np.where(slow, *TRIMMED["alpha"]) + around(0.0, 0.035), around(0.0, 0.09)
    p, q, r = around(0.0, 0.5), around(0.0, 0.4), around(0.0, 0.25)
    flaps = [around(0.0, wide) for wide in (0.13, 0.13, 0.10, 0.10)]
    rudders = [around(0.35, 0.22) for _ in range(2)]
    speeds = np.where(slow, *TRIMMED["speed"]) + rng.uniform(-90, 90, (8, COUNT))
    scale = {name: around(0.0, 0.10) for name in SCALED}
    s = Settings([dict(zip(scale, row, strict=True)) for row in np.array(list(scale.values())).T.tolist()])
    x = np.zeros((10, COUNT))
    x[0] = speed * np.cos(alpha) * np.cos(beta)
    x[1], x[2] = speed * np.sin(beta), speed * np.sin(alpha) * np.cos(beta)
    x[3:6] = p, q, r
    felt = np.vstack([*flaps, *rudders, speeds])
    thrust, _, ahead, around_axis = blown_air.propulsion(x, speeds, RHO, s)
    memory = blown_air.Memory(x, felt, s)
    made = blown_air.wing_loads(x, felt, RHO, s, memory, ahead, around_axis)
    k = {name: 1 + value for name, value in scale.items()}
    sign = np.array([[-1.0], [1.0]])
    same = lambda values: np.array([values, values])  # noqa: E731
    inputs = {
        "camber": same(k["wing.lift_zero"]),
        "tilt": same(alpha),
        "alpha": same(alpha * k["wing.lift_slope"]),
        "q": same(q / speed * k["wing.pitch_damping"]),
        "polar": same(k["wing.drag_zero"]),
        "section": same(k["wing.moment"]),
        "inner": np.array(flaps[:2]),
        "outer": np.array(flaps[2:]),
        "open": np.array(rudders),
        "swirl": same(k["jets.swirl"]),
        "roll": sign * p / speed,
        "p": sign * p / speed * k["wing.roll_damping"],
        "beta": sign * beta,
        "slip": sign * beta * k["wing.sideslip"],
        "r": sign * r / speed,
    }
    disc = RHO * speed**2 * np.pi * g.PROP_R**2
    jets = thrust / disc * k["jets.strength"]
    stations = {str(i + 1): np.array([jets[3 - i], jets[4 + i]]) for i in range(4)}
    return inputs, stations, dict(zip("XYZLMN", made / (0.5 * RHO * speed**2 * g.AREA), strict=True))


def columns(inputs, stations, odd):
    """Return what every term of every station adds, by (station, term).

    Parameters
    ----------
    inputs, stations : dict
        Of `campaign`.
    odd : bool
        Whether the load changes its sign from one half to the other, as Y, L and N do.
    """
    sign = np.array([[-1.0], [1.0]]) if odd else np.ones((2, 1))
    plain = [n for n in inputs if n != "swirl"]
    pairs = [n for n in plain if n not in ("polar", "section")]
    out = {} if odd else {("half", "1"): np.full(COUNT, 2.0)}
    singles = [*((n,) for n in plain), ("polar", "beta")]
    for term in [*singles, *combinations_with_replacement(pairs, 2)]:
        out["half", " ".join(term)] = (sign * np.prod([inputs[n] for n in term], axis=0)).sum(axis=0)
    for name, jet in stations.items():
        flap = "inner" if name in "12" else "outer"
        single = ["camber", "alpha", flap, "q", "p", "slip", "swirl", "polar", "section"]
        tilted = [("tilt", n) for n in ("camber", "alpha", flap)] + [("roll", n) for n in ("camber", "alpha")]
        squared = [("alpha", flap), ("camber", "alpha"), (flap, flap)]
        squared += [("swirl", n) for n in ("alpha", "camber")]
        for term in [(n,) for n in single] + tilted + squared:
            made = sign * jet * np.prod([inputs[n] for n in term], axis=0)
            out[name, " ".join(term)] = made.sum(axis=0)
        out[name, "jet"] = (sign * jet * jet).sum(axis=0)
    return {n: values for n, values in out.items() if np.abs(values).max() > 1e-9}


def stand():
    """Yield advance, thrust and torque coefficients of one propeller, as a test stand shows them."""
    speed = np.full(ADVANCES.size, 900.0)
    tip = g.PROP_R * speed
    thrust, torque, *_ = propeller(np.full(ADVANCES.size, RHO), speed, ADVANCES * tip)
    disc = RHO * np.pi * g.PROP_R**2 * tip**2
    yield from zip(ADVANCES, thrust / disc, torque / disc / g.PROP_R, strict=True)


def main() -> None:
    inputs, stations, loads = campaign(np.random.default_rng(8))
    rows = []
    for name, y in loads.items():
        found, left = reduced(columns(inputs, stations, name in "YLN"), y)
        print(f"{name}: {len(found)} terms leave {100 * left:.2f} %")
        rows += [(name, *key, f"{value:.5g}") for key, value in found.items()]
    for advance, thrust, torque in stand():
        rows.append(("thrust", "stand", f"{advance:.2f}", f"{thrust:.5g}"))
        rows.append(("torque", "stand", f"{advance:.2f}", f"{torque:.5g}"))
    with (HERE / "tunnel.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("response", "station", "term", "coefficient"), *rows])


if __name__ == "__main__":
    main()

"""What a tunnel and a test stand would tell the owner: `python benchmarks/gap_judging/ttail/tunnel.py`.

Samples the truth's wing with its jets, tail, fin and body, and each kind of propeller by itself, at random
points about each flight condition. Loads of a half wing are fitted by polynomials of its own angle, flap,
aileron and propellers, the wing's turning and the other half's inputs; a propeller over both advances; what
is at the tail by the wing's loads. Writes `tunnel.csv`: campaign, response, term, coefficient. The owner's
simulation reads nothing else of the truth.
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

import ttail_air as air  # noqa: E402
import ttail_numbers as g  # noqa: E402
from polynomials import reduced  # noqa: E402
from settings import Settings  # noqa: E402
from tip_loss_propellers import propellers  # noqa: E402

COUNT = 4000
LEAST = 0.004  # share of a load's variation; terms that matter less are left out
ABOUT = {
    "slow": ((24.5, 27.5), (-0.04, 0.05), (0.02, 0.26), (470.0, 600.0)),
    "fast": ((31.0, 35.0), (-0.04, 0.04), (-0.08, 0.16), (580.0, 730.0)),
}
"""Ranges that are flown: m/s; vertical velocity over the forward one; flaps, rad; propellers, rad/s."""
SLIP, TURN, MOVED = 0.07, 0.3, 0.13  # sideways velocity over the forward one, rad/s, rad
SIDE = np.array([[-1.0], [1.0]])
MAIN = ("angle", "flap", "aileron", "inner", "tip")
REST = ("slip", "roll", "yaw", "pitch", "angle2", "flap2", "aileron2", "inner2")


def campaign(rng, speed, climbing, flaps, turning):
    """Return inputs and loads of half wings, shape (half, point), and what they make at the tail.

    Returns
    -------
    inputs, loads : dict
        By name, as of right halves.
    behind : dict
        By response, terms by name and values.
    """
    within = lambda low, high, *n: rng.uniform(low, high, (*n, COUNT))  # noqa: E731
    u, climb, slip = within(*speed), within(*climbing), within(-SLIP, SLIP)
    p, q, r = (within(-TURN, TURN) for _ in range(3))
    moved = np.vstack([within(-MOVED, MOVED, 2), within(*flaps, 2), within(-MOVED, MOVED, 2)])
    felt = np.vstack([moved, within(*turning, 4)])
    x = np.vstack([u, slip * u, climb * u, p, q, r, np.zeros((4, COUNT))])
    rho, one = np.full(COUNT, 1.17), Settings([{}] * COUNT)
    seen = {}
    memory = air.Memory(x, felt, one)
    whole_wing = air.wing
    try:  # the balance of the wing alone
        air.wing = lambda *a: seen.setdefault("wing", whole_wing(*a))
        air.loads(x, felt, rho, one, memory)
    finally:
        air.wing = whole_wing
    chordwise, normal, moment, _ = seen["wing"]
    px, py, pz = air.PLACE
    v, w = x[1], x[2]
    hubs = np.array([u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px])
    thrust = air.AXIS @ air.rotors(hubs, felt[6:], rho, one)[0].transpose(1, 0, 2)
    y = g.HALF_Y * SIDE
    ahead, below = u + q * g.WING_Z - r * y, w + p * y - q * g.WING_X
    c, d = np.cos(g.INCIDENCE), np.sin(g.INCIDENCE)
    own, own_through = ahead * c - below * d, ahead * d + below * c
    whole = np.sqrt(own**2 + own_through**2)
    power = thrust / (rho * air.DISC * u * u)
    inputs = {
        "1": np.ones((2, COUNT)),
        "angle": own_through / own - g.MIDDLE["angle"],
        "flap": moved[2:4],
        "aileron": moved[:2],
        "inner": power[2:] - g.MIDDLE["inner"],
        "tip": power[:2] - g.MIDDLE["tip"],
        "slip": SIDE * slip,
        "roll": SIDE * p / u,
        "yaw": SIDE * r / u,
        "pitch": np.tile(q / u, (2, 1)),
    }
    inputs |= {f"{n}2": inputs[n][::-1] for n in ("angle", "flap", "aileron", "inner")}
    half = lambda values: values.reshape(2, -1, COUNT).sum(axis=1)  # noqa: E731
    area = 0.25 * whole**2 * g.AREA
    loads = {
        "chordwise": half(chordwise) / area,
        "normal": half(normal) / area,
        "bending": half(air.OUT * normal) / area / g.SPAN,
        "turning": half(moment) / area / g.CHORD,
        "swinging": half(-air.OUT * chordwise) / area / g.SPAN,
    }
    said = {n: (whole * loads[n]).sum(axis=0) for n in ("normal", "bending")} | {"still": u}
    said |= {n: u * inputs[n].sum(axis=0) for n in ("flap", "aileron", "inner")}
    behind = {"wash": (said, memory.shed)}
    wash = memory.shed / u
    high = (air.ABOVE - air.BACK * (climb - 0.7 * wash)) / air.WIDE
    powers = {f"{i}{j}": climb**i * wash**j for i in range(3) for j in range(3 - i)}
    behind["pressure"] = (powers, air.PRESSURE - air.DIP * np.exp(-high * high))
    return inputs, loads, behind


def columns(inputs):
    """Return what every term adds, by name."""
    terms = [("1",)]
    for degree in (1, 2):
        terms += combinations_with_replacement(MAIN, degree)
    terms += [(n,) * 3 for n in MAIN[:3]] + [(n,) for n in REST]
    terms += [(n, m) for n in MAIN[:3] for m in REST]
    return {" ".join(t): np.prod([inputs[n] for n in t], axis=0).ravel() for t in terms}


def stand(rng, kind):
    """Return coefficients of a kind of propeller by response, over both advances, and what they leave."""
    radius, pitch = g.RADIUS[kind], float(air.PITCH[2 * kind, 0])
    tip = radius * rng.uniform(470.0, 730.0, COUNT)
    along = rng.uniform(*((0.255, 0.36) if kind == 0 else (0.20, 0.29)), COUNT)
    across = rng.uniform(0.0, 0.035, COUNT)
    rho = np.full(COUNT, 1.17)
    made = propellers(rho, tip / radius, along * tip, across * tip, radius, pitch)
    power = rho * np.pi * radius**2 * tip**2
    scales = (power, power * radius, power * across, power * radius * across)
    for name, values, scale in zip(("thrust", "torque", "dragged", "leaning"), made, scales, strict=True):
        terms = {f"{i}0": along**i for i in range(4)} | {"02": across**2}
        yield name, *reduced(terms, values / scale, LEAST)


def main() -> None:
    rows = []
    for number, (about, ranges) in enumerate(ABOUT.items()):
        inputs, loads, behind = campaign(np.random.default_rng(number), *ranges)
        for load, y in loads.items():
            found, left = reduced(columns(inputs), y.ravel(), LEAST)
            print(f"{about} wing {load}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(f"{about} wing", load, term, f"{value:.6g}") for term, value in found.items()]
        for name, (terms, y) in behind.items():
            found, left = reduced(terms, y, LEAST)
            print(f"{about} {name}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(f"{about} tail", name, term, f"{value:.6g}") for term, value in found.items()]
    for kind, label in enumerate(("tip", "inner")):
        for load, found, left in stand(np.random.default_rng(5 + kind), kind):
            print(f"{label} {load}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(label, load, term, f"{value:.6g}") for term, value in found.items()]
    with (HERE / "tunnel.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("campaign", "response", "term", "coefficient"), *rows])


if __name__ == "__main__":
    main()

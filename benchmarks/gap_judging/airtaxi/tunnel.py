"""What a tunnel and a test stand would tell the owner: `python benchmarks/gap_judging/airtaxi/tunnel.py`.

Samples the truth's wing with its jets, its wash at the lifting rotors and the stabilator, and each kind of
rotor by itself in steady flow, at random points about each flight condition. Loads of a half wing are fitted
by polynomials of its own angle, flaperon and propellers, the wing's turning and the other half's inputs; wash
by the wing's loads; a rotor over both advances and the speed of its tips. Writes `tunnel.csv`: campaign,
response, term, coefficient. The owner's simulation reads nothing else of the truth.
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

import airtaxi_numbers as g  # noqa: E402
import blade_rings  # noqa: E402
import taxi_air as air  # noqa: E402
from polynomials import reduced  # noqa: E402
from settings import Settings  # noqa: E402

COUNT = 4000
LEAST = 0.004  # share of a load's variation; terms that matter less are left out
FAST = 200.0  # m/s: scale of the speed of tips
ABOUT = {
    "slow": ((40.0, 44.0), (0.0, 0.11), (134.0, 165.0), (128.0, 152.0)),
    "fast": ((55.5, 60.5), (-0.07, 0.03), (182.0, 212.0), (118.0, 142.0)),
}
"""Ranges that are flown: m/s; vertical velocity over the forward one; propellers, lifting rotors, rad/s."""
SLIP, TURN, MOVED = 0.06, 0.17, 0.12  # sideways velocity over the forward one, rad/s, rad
SIDE = np.array([[-1.0], [1.0]])
MAIN = ("angle", "aileron", "inner", "outer")
REST = ("slip", "roll", "yaw", "pitch", "angle2", "aileron2", "inner2", "outer2")


def campaign(rng, speed, climbing, turning, lifting):
    """Return inputs and loads of half wings, shape (half, point), and wash behind by its terms.

    Returns
    -------
    inputs, loads : dict
        By name, as of right halves.
    behind : dict
        By response, terms by name and wash at the right, m/s.
    """
    within = lambda low, high, *n: rng.uniform(low, high, (*n, COUNT))  # noqa: E731
    u, climb, slip = within(*speed), within(*climbing), within(-SLIP, SLIP)
    p, q, r = (within(-TURN, TURN) for _ in range(3))
    moved = within(-MOVED, MOVED, 2)
    felt = np.vstack([moved, np.zeros((3, COUNT)), within(*turning, 4), within(*lifting, 2)])
    v, w = slip * u, climb * u
    x = np.vstack([u, v, w, p, q, r, np.zeros((4, COUNT))])
    rho, one = np.full(COUNT, 1.15), Settings([{}] * COUNT)
    px, py, pz = air.PLACE
    hubs = np.array([u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px])
    memory = air.Memory(x, felt, one)
    for _ in range(40):  # until the inflow is steady
        *_, balance, _ = air.rotors(hubs, felt[5:], memory.induced, rho, one)
        memory.induced += 0.6 * (balance - memory.induced)
    seen = {}
    whole_wing = air.wing
    try:  # the wing alone
        air.wing = lambda *a: seen.setdefault("wing", whole_wing(*a))
        air.loads(x, felt, rho, one, memory)
    finally:
        air.wing = whole_wing
    chordwise, normal, moment, _ = seen["wing"]
    thrust = blade_thrust(hubs, felt[5:], memory.induced, rho)
    y = g.HALF_Y * SIDE
    ahead, below = u + q * g.WING_Z - r * y, w + p * y - q * g.WING_X
    c, d = np.cos(g.INCIDENCE), np.sin(g.INCIDENCE)
    own, own_through = ahead * c - below * d, ahead * d + below * c
    whole = np.sqrt(own**2 + own_through**2)
    power = thrust[:4] / (rho * air.DISCS.area[:4] * u * u)
    inputs = {
        "1": np.ones((2, COUNT)),
        "angle": own_through / own - g.MIDDLE["angle"],
        "aileron": moved,
        "inner": power[1:3] - g.MIDDLE["inner"],
        "outer": power[[0, 3]] - g.MIDDLE["outer"],
        "slip": SIDE * slip,
        "roll": SIDE * p / u,
        "yaw": SIDE * r / u,
        "pitch": np.tile(q / u, (2, 1)),
    }
    inputs |= {f"{n}2": inputs[n][::-1] for n in MAIN}
    half = lambda values: values.reshape(2, -1, COUNT).sum(axis=1)  # noqa: E731
    area = 0.25 * whole**2 * g.AREA
    loads = {
        "chordwise": half(chordwise) / area,
        "normal": half(normal) / area,
        "bending": half(air.OUT * normal) / area / g.SPAN,
        "turning": half(moment) / area / g.CHORD,
        "swinging": half(-air.OUT * chordwise) / area / g.SPAN,
    }
    said = {"still": u, "slipping": v, "rolling": p, "yawing": r}
    for i, k in ((1, "own"), (0, "other")):
        said |= {f"{n}_{k}": whole[i] * loads[n][i] for n in ("normal", "bending")}
        said |= {f"{n}_{k}": u * inputs[n][i] for n in MAIN[1:]}
    behind = {"rotor": (said, memory.shed[1]), "stab": (said, memory.shed[3])}
    return inputs, loads, behind


def blade_thrust(hubs, speeds, induced, rho):
    """Return thrusts of all rotors, N."""
    along = (air.AXIS * hubs).sum(axis=0)
    across = np.sqrt(((hubs - air.AXIS * along) ** 2).sum(axis=0))
    return blade_rings.blades(air.DISCS, rho, speeds, along, across, induced).thrust


def columns(inputs):
    """Return what every term adds, by name."""
    terms = [("1",)]
    for degree in (1, 2):
        terms += combinations_with_replacement(MAIN, degree)
    terms += [(n,) * 3 for n in MAIN[:2]] + [(n,) for n in REST]
    terms += [(n, m) for n in MAIN for m in REST]
    return {" ".join(t): np.prod([inputs[n] for n in t], axis=0).ravel() for t in terms}


def stand(rng, kind, speed, climbing, turning, lifting):
    """Return coefficients of a kind of rotor by response, and what they leave."""
    k = 0 if kind == "prop" else 4
    u, turn = rng.uniform(*speed, COUNT), rng.uniform(*(turning if k == 0 else lifting), COUNT)
    climb = rng.uniform(*climbing, COUNT) - (0 if k == 0 else 0.055)  # in the wing's wash
    w = u * climb + rng.uniform(-1.0, 1.0, COUNT)
    ax, az = air.AXIS[0, k, 0], air.AXIS[2, k, 0]
    along, across = ax * u + az * w, np.abs(ax * w - az * u)
    radius = float(air.DISCS.radius[k, 0])
    one = blade_rings.Discs([radius], air.DISCS.blades[k], air.PITCH[:, k : k + 1])
    rho = np.full(COUNT, 1.15)
    made, _ = blade_rings.settled(one, rho, turn[None], along[None], across[None])
    tip = radius * turn
    a, b, t = along / tip, across / tip, tip / FAST - 0.9
    power = rho * np.pi * radius**2 * tip**2
    terms = {f"{i}{j}0": a**i * b**j for i in range(4) for j in range(4 - i)}
    terms |= {"001": t, "101": a * t, "011": b * t}
    for name in ("thrust", "torque", "dragged", "sideways", "advancing", "forward"):
        scale = power * (1.0 if name in ("thrust", "dragged", "sideways") else radius)
        scale = scale * (1.0 if name in ("thrust", "torque") else b)
        yield name, *reduced(terms, getattr(made, name)[0] / scale, LEAST)


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
            print(f"{about} wash {name}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(f"{about} wash", name, term, f"{value:.6g}") for term, value in found.items()]
        for kind in ("prop", "lift"):
            for load, found, left in stand(np.random.default_rng(5 + number), kind, *ranges):
                print(f"{about} {kind} {load}: {len(found)} terms leave {100 * left:.2f} %")
                rows += [(f"{about} {kind}", load, term, f"{value:.6g}") for term, value in found.items()]
    with (HERE / "tunnel.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("campaign", "response", "term", "coefficient"), *rows])


if __name__ == "__main__":
    main()

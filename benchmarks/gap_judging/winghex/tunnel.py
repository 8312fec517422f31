"""What a tunnel and a test stand would tell the owner: `python benchmarks/gap_judging/winghex/tunnel.py`.

Samples the truth's wing in the wakes of the front rotors, the wakes at the rear rotors and at the tail, and
one rotor by itself, at random points about each flight condition. Loads of a half wing are fitted by
polynomials of its own angle, wake, aileron and slip to third degree, with the wing's turning and the other
half's inputs to second; wakes by the loads of the rotors that make them, climb and slip; a rotor by both
advances. Writes `tunnel.csv`: campaign, response, term, coefficient. The owner's simulation reads nothing
else of the truth.
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

import hex_air  # noqa: E402
import winghex_numbers as g  # noqa: E402
from edgewise_rotors import blades  # noqa: E402
from polynomials import reduced  # noqa: E402
from settings import Settings  # noqa: E402

COUNT = 4000
ABOUT = {
    "slow": ((11.7, 14.4), (-0.06, 0.08), (0.24, 0.40)),
    "fast": ((14.6, 17.2), (-0.11, 0.03), (0.15, 0.27)),
}
"""Ranges that are flown: m/s; vertical velocity over the forward one; a rotor's load, thrust over density,
area and the forward velocity's square."""
SLIP, TURN, MOVED = 0.07, 0.3, 0.18  # sideways velocity over the forward one, rad/s, rad
SIDE = np.array([[-1.0], [1.0]])
MAIN, REST = ("angle", "wake", "aileron", "slip"), ("roll", "yaw", "pitch", "angle2", "wake2", "aileron2")
DISC = np.pi * g.ROTOR_R**2


def campaign(rng, speed, climbing, loaded):
    """Return inputs and loads of half wings, shape (half, point), and downwash behind by its terms.

    Returns
    -------
    inputs, loads : dict
        By name, as of right halves.
    behind : dict
        By response, terms by name and the downwash, m/s.
    """
    within = lambda low, high: rng.uniform(low, high, COUNT)  # noqa: E731
    u, climb, slip = within(*speed), within(*climbing), within(-SLIP, SLIP)
    p, q, r = (within(-TURN, TURN) for _ in range(3))
    w = climb * u
    moved = rng.uniform(-MOVED, MOVED, (2, COUNT))
    induced = u * rng.uniform(*loaded, (6, COUNT))
    made = induced * DISC / (2 * hex_air.HALF_PAIR)
    each = hex_air.wakes(made[hex_air.FROM], slip, climb, u)
    met = hex_air.SUM @ each
    c, d = np.cos(g.INCIDENCE), np.sin(g.INCIDENCE)
    place = hex_air.WING.place
    ahead, below = u + q * g.WING_Z - r * place, w + p * place
    along = ahead * c - below * d
    through = [ahead * d + (below - q * (g.WING_X - back)) * c for back in (0.0, 0.5 * g.CHORD)]
    one = Settings([{}] * COUNT)
    chordwise, normal, moment, bound = hex_air.wing(along, through, 0.0, met[: hex_air.PANELS], moved, one)
    y = g.HALF_Y * SIDE
    ahead, below = u + q * g.WING_Z - r * y, w + p * y - q * g.WING_X
    own, own_through = ahead * c - below * d, ahead * d + below * c
    whole = np.sqrt(own**2 + own_through**2)
    inputs = {
        "1": np.ones((2, COUNT)),
        "angle": own_through / own - g.MIDDLE["angle"],
        "wake": induced[:2] / whole - g.MIDDLE["wake"],
        "aileron": moved,
        "slip": SIDE * slip,
        "roll": SIDE * p / whole,
        "yaw": SIDE * r / whole,
        "pitch": q / whole,
    }
    inputs |= {f"{n}2": inputs[n][::-1] for n in ("angle", "wake", "aileron")}
    half = lambda values: values.reshape(2, -1, COUNT).sum(axis=1)  # noqa: E731
    area = 0.25 * whole**2 * g.AREA
    out = np.abs(place)
    loads = {
        "chordwise": half(chordwise) / area,
        "normal": half(normal) / area,
        "bending": half(out * normal) / area / g.SPAN,
        "turning": half(moment) / area / g.CHORD,
        "swinging": half(-out * chordwise) / area / g.SPAN,
    }
    # Behind the wing: by loads of both halves, and by the loads of rotors, their wakes' height and place
    said = {
        f"{n}_{k}": whole[i] * loads[n][i]
        for n in ("normal", "bending")
        for i, k in ((1, "own"), (0, "other"))
    }
    said["slow"] = u * climb
    said["still"] = u
    said |= {"slipping": u * slip, "rolling": p, "yawing": r}
    said |= {f"{n}_{k}": u * inputs[n][i] for n in ("wake", "aileron") for i, k in ((1, "own"), (0, "other"))}
    behind = {"wing rear": (said, (hex_air.AT_REAR @ bound)[1])}
    said = {n: whole.mean(axis=0) * loads[n].sum(axis=0) for n in ("normal", "bending")}
    said |= {"slow": u * climb, "still": u}
    said |= {n: u * inputs[n].sum(axis=0) for n in ("wake", "aileron")}
    behind["wing tail"] = (said, (hex_air.AT_TAIL @ bound).mean(axis=0))
    for name, source, target in pairs_of_wakes():
        part = each[target].sum(axis=0) / (2 if "tail" in name else 1)
        load = induced[source].sum(axis=0)
        terms = wake_terms(load, {"climb": climb, "slip": slip, "load": load / u})
        if len(source) > 1:
            terms |= {"sides": (induced[source[1]] - induced[source[0]]) * slip}
        behind[name] = (terms, part)
    return inputs, loads, behind


def pairs_of_wakes():
    """Return name, rotors and pairs of each wake, at the right rear rotor or at both halves of the tail."""
    pairs = list(zip(hex_air.FROM.tolist(), hex_air.TO.tolist(), strict=True))
    right = hex_air.PANELS + 1
    for name, source in {"front rear": 1, "across rear": 0, "mid rear": 3, "beyond rear": 2}.items():
        yield name, [source], [pairs.index((source, right))]
    for name, source in {"front tail": (0, 1), "mid tail": (2, 3), "rear tail": (4, 5)}.items():
        yield name, list(source), [i for i, (k, j) in enumerate(pairs) if k in source and j > right]


def wake_terms(load, inputs):
    """Return what every term of a wake adds: its rotors' load by products of climb, slip and load."""
    names = [t for n in range(5) for t in combinations_with_replacement(inputs, n)]
    return {" ".join(t) or "1": load * np.prod([inputs[n] for n in t], axis=0) for t in names}


def columns(inputs):
    """Return what every term adds, by name."""
    terms = [("1",)]
    for degree in (1, 2, 3):
        terms += combinations_with_replacement(MAIN, degree)
    terms += [(n,) for n in REST]
    terms += [(n, m) for n in MAIN for m in REST]
    return {" ".join(t): np.prod([inputs[n] for n in t], axis=0).ravel() for t in terms}


def stand(rng):
    """Return coefficients of a rotor by response, over both advances, and what they leave."""
    tip = g.ROTOR_R * rng.uniform(310.0, 390.0, COUNT)
    along, across = rng.uniform(-0.01, 0.06, COUNT), rng.uniform(0.12, 0.25, COUNT)
    rho = np.full(COUNT, 1.17)
    made = blades(rho, tip / g.ROTOR_R, along * tip, across * tip, g.ROTOR_R)
    disc = rho * DISC * tip**2
    terms = [along**i * across**j for i in range(4) for j in range(4 - i)]
    for name in ("thrust", "torque", "dragged", "sideways", "advancing", "forward"):
        y = getattr(made, name) / disc / (1.0 if name in ("thrust", "dragged", "sideways") else g.ROTOR_R)
        names = [f"{i}{j}" for i in range(4) for j in range(4 - i)]
        fit, left = reduced(dict(zip(names, terms, strict=True)), y)
        yield name, fit, left


def main() -> None:
    rows = []
    for number, (about, ranges) in enumerate(ABOUT.items()):
        inputs, loads, behind = campaign(np.random.default_rng(number), *ranges)
        for load, y in loads.items():
            found, left = reduced(columns(inputs), y.ravel())
            print(f"{about} wing {load}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(f"{about} wing", load, term, f"{value:.6g}") for term, value in found.items()]
        for name, (terms, y) in behind.items():
            found, left = reduced(terms, y)
            print(f"{about} {name}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(f"{about} wake", name, term, f"{value:.6g}") for term, value in found.items()]
    for load, fit, left in stand(np.random.default_rng(2)):
        print(f"stand {load}: {len(fit)} terms leave {100 * left:.2f} %")
        rows += [("stand", load, term, f"{value:.6g}") for term, value in fit.items()]
    with (HERE / "tunnel.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("campaign", "response", "term", "coefficient"), *rows])


if __name__ == "__main__":
    main()

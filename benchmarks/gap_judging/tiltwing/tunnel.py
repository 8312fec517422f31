"""What a tunnel and a test stand would tell the owner: `python benchmarks/gap_judging/tiltwing/tunnel.py`.

Samples one of the truth's wings with its propellers at random points about each flight condition, and a
propeller about both. Loads of a half wing are fitted by polynomials of its own angle, jet and elevon to third
degree, with the wing's turning and the other half's inputs to second; the wake by the wing's normal force,
jets, elevons and angle. Writes `tunnel.csv`: campaign, response, term, coefficient. The owner's simulation
reads nothing else of the truth.
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

import tilt_air  # noqa: E402
import tiltwing_numbers as g  # noqa: E402
from oblique_propellers import propellers  # noqa: E402
from polynomials import reduced  # noqa: E402
from settings import Settings  # noqa: E402

COUNT = 3000
# Speed, density, angle of the wing to its flow, tangent of the vehicle's angle, propellers' speed
ABOUT = {
    "slow front": (19.0, 1.17, 0.315, 0.0, 507.0),
    "slow rear": (19.0, 1.17, 0.291, 0.0, 507.0),
    "fast front": (22.0, 1.15, 0.212, 0.0, 529.0),
    "fast rear": (22.0, 1.15, 0.204, 0.0, 529.0),
}
SIDE = np.array([[-1.0], [1.0]])


def campaign(rng, speed, rho, angle, alpha, turns):
    """Return inputs by name and loads by name, shape (half, point), as of right halves, and the wake.

    Returns
    -------
    inputs, loads : dict
    middles : dict
        Means that the owner takes off angle and jet.
    wake : dict
        What the wing's downwash behind it is fitted by, shape (point,) each.
    down : ndarray, shape (point,)
        That downwash, m/s.
    """
    around = lambda middle, wide: middle + wide * rng.uniform(-1, 1, COUNT)  # noqa: E731
    speeds = around(speed, 1.5)
    bent = around(angle, 0.09)
    along, through = speeds * np.cos(bent), speeds * np.sin(bent)
    p, r = around(0.0, 0.5), around(0.0, 0.5)
    across = around(0.0, 1.2)
    elevons = rng.uniform(-0.20, 0.20, (1, 2, COUNT))
    turn = turns + rng.uniform(-60, 60, (1, 2, COUNT))
    s = Settings([{}] * COUNT)
    at = np.zeros((1, 2, COUNT))
    hub = np.array([at + along - r * g.PROP_Y * SIDE, at + across, at + through + p * g.PROP_Y * SIDE])
    force, _, ahead, twisted = tilt_air.propulsion(hub, turn, rho, s, g.ROTORS[:2])
    flow = (along - r * tilt_air.PLACE)[None], (through + p * tilt_air.PLACE)[None]
    made = np.zeros((1, tilt_air.PLACE.size, COUNT))
    (chordwise, normal, moment), made = tilt_air.wing_loads(flow, ahead, twisted, elevons, made, rho, s, 40)
    half = lambda values: values[0].reshape(2, 4, COUNT).sum(axis=1)  # noqa: E731
    own, own_through = along - r * g.PROP_Y * SIDE, through + p * g.PROP_Y * SIDE
    whole = np.sqrt(own**2 + own_through**2)
    disc = rho * np.pi * g.PROP_R**2
    jet = (np.sqrt(hub[0, 0] ** 2 + 2 * force[0, 0] / disc) - hub[0, 0]) / whole
    tangent = own_through / own
    middles = {"angle_middle": float(tangent.mean()), "jet_middle": float(jet.mean())}
    inputs = {
        "1": np.ones((2, COUNT)),
        "angle": tangent - middles["angle_middle"],
        "jet": jet - middles["jet_middle"],
        "elevon": elevons[0],
        "roll": SIDE * p / whole,
        "yaw": SIDE * r / whole,
    }
    inputs |= {f"{n}2": inputs[n][::-1] for n in ("angle", "jet", "elevon")}
    pressure = 0.5 * rho * whole**2 * g.HALF
    out = np.abs(tilt_air.PLACE)
    loads = {
        "chordwise": half(chordwise) / pressure,
        "normal": half(normal) / pressure,
        "bending": half(out * normal) / pressure / g.SPAN,
        "turning": half(moment) / pressure / g.CHORD,
        "swinging": half(-out * chordwise) / pressure / g.SPAN,
    }
    width = tilt_air.WING.width
    front = (width * made[0]).sum(axis=0) / width.sum()
    flown = around(alpha, 0.09)
    down = tilt_air.WAKE / g.SPAN * front * (1 - 0.5 * flown)
    wake = {
        "wake_constant": speeds,
        "wake_jet": speeds * inputs["jet"].sum(axis=0),
        "wake_elevon": speeds * inputs["elevon"].sum(axis=0),
        "wake_lift": normal[0].sum(axis=0) / (rho * speeds),
        "wake_angle": speeds * flown,
    }
    return inputs, loads, middles, wake, down


def columns(inputs):
    """Return what every term adds, by name."""
    main, rest = ("angle", "jet", "elevon"), ("roll", "yaw", "angle2", "jet2", "elevon2")
    terms = [("1",)]
    for degree in (1, 2, 3):
        terms += combinations_with_replacement(main, degree)
    terms += [(n,) for n in rest]
    terms += [(n, m) for n in main for m in rest]
    return {" ".join(t): np.prod([inputs[n] for n in t], axis=0).ravel() for t in terms}


def stand(rng):
    """Return coefficients of a propeller by response, over both advances, and what they leave."""
    speed = rng.uniform(440.0, 600.0, COUNT)
    tip = g.PROP_R * speed
    along, across = rng.uniform(0.12, 0.22, COUNT), rng.uniform(0.0, 0.10, COUNT)
    rho = np.full(COUNT, 1.17)
    made = propellers(rho, speed, along * tip, across * tip, g.PROP_R)
    disc = rho * np.pi * g.PROP_R**2 * tip**2
    even = np.array([np.ones(COUNT), along, along**2, along**3, across**2, along * across**2]).T
    odd = np.array([across, across * along, across * along**2]).T
    for name, values in zip(("thrust", "torque", "dragged", "leaning"), made, strict=False):
        y = values / disc if name in ("thrust", "dragged") else values / disc / g.PROP_R
        matrix = even if name in ("thrust", "torque") else odd
        fit = np.linalg.lstsq(matrix, y, rcond=None)[0]
        yield name, fit, np.std(y - matrix @ fit) / np.std(y)


def main() -> None:
    rows = []
    for number, (name, about) in enumerate(ABOUT.items()):
        inputs, loads, middles, wake, down = campaign(np.random.default_rng(number), *about)
        terms = columns(inputs)
        for load, y in loads.items():
            found, left = reduced(terms, y.ravel())
            print(f"{name} {load}: {len(found)} terms leave {100 * left:.2f} %")
            rows += [(name, load, term, f"{value:.6g}") for term, value in found.items()]
        way = tilt_air.WAKE_WAY / (tilt_air.WAKE_SPEED * about[0])
        fit = np.linalg.lstsq(np.array(list(wake.values())).T, down, rcond=None)[0]
        found = middles | dict(zip(wake, fit, strict=True))
        found["wake_lag"] = way
        rows += [(name, key, "", f"{value:.6g}") for key, value in found.items()]
    for load, fit, left in stand(np.random.default_rng(2)):
        print(f"stand {load}: leaves {100 * left:.2f} %")
        rows += [("stand", load, str(i), f"{value:.6g}") for i, value in enumerate(fit)]
    with (HERE / "tunnel.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("campaign", "response", "term", "coefficient"), *rows])


if __name__ == "__main__":
    main()

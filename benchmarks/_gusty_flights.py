"""Flights of three linear aircraft in gusts, logged as air data that may come late: for kinematics_gusts.py.

Rigid bodies whose applied wrench is exactly linear in the motion through the air and four effectors, so the
derivatives are known. A gust moves the aircraft as it moves the vanes: the wrench is that of the body's
velocity less the air's. The gusts have the spectra of Dryden (MIL-F-8785C), which are not those that the
compatibility check assumes: of second order across the flight path, and of three lengths.
"""

from __future__ import annotations

import os
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.signal import bilinear, lfilter

import freqid as fq
from freqid.core.record import Channel
from freqid.core.sections.identification import Identification
from freqid.core.vehicle import Effector, Inertia, MassProperties

G = 9.80665
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi")
NOISE = {"velocity": 0.05, "rate": np.deg2rad(0.1), "angle": np.deg2rad(0.1), "force": 0.01 * G}
LATE = 0.14  # s, of air data that lag
PERIOD, DT, INNER = 60.0, 0.02, 2
EFFECTORS = ("de", "da", "dr", "n1")
LONGITUDINAL, LATERAL = ("u", "w", "q", "de", "n1"), ("v", "p", "r", "da", "dr")
SETTINGS = Identification(
    responses=("X", "Y", "Z", "L", "M", "N"),
    regressors={**dict.fromkeys("XZM", LONGITUDINAL), **dict.fromkeys("YLN", LATERAL)},
    frequencies_hz=tuple(np.arange(3, 109) / 60.0),
)


class Aircraft(NamedTuple):
    """A linear aircraft.

    Attributes
    ----------
    name : str
    mass : float
        kg.
    inertia : tuple of 4 floats
        Ix Iy Iz Ixz, kg m2.
    speed : float
        m/s.
    derivatives : dict of dict of float
        N and N m per SI unit of motion through the air and effectors.
    amplitude : dict of float
        Of the excitation, rad or rad/s.
    gains : dict of dict of float
        Effector per rad or rad/s.
    lengths : tuple of 3 floats
        Scales of the gusts, m.
    """

    name: str
    mass: float
    inertia: tuple[float, float, float, float]
    speed: float
    derivatives: dict[str, dict[str, float]]
    amplitude: dict[str, float]
    gains: dict[str, dict[str, float]]
    lengths: tuple[float, float, float] = (180.0, 90.0, 60.0)

    def vehicle(self) -> fq.Vehicle:
        """Return it as identification knows it."""
        xx, yy, zz, xz = self.inertia
        kinds = {"n1": "rotor"}
        return fq.Vehicle(
            name=self.name,
            mass_properties=MassProperties(self.mass, Inertia(xx, yy, zz, xz=xz)),
            effectors=tuple(
                Effector(n, kinds.get(n, "surface"), (-1.0, 1.0) if n != "n1" else (0.0, 900.0))
                for n in EFFECTORS
            ),
        )


DRONE = Aircraft(
    "drone",  # examples/linear_record.py
    28.6,
    (2.4, 3.1, 4.9, 0.15),
    20.0,
    {
        "X": {"u": -6.0, "w": 4.0, "q": 0.5, "de": -5.0, "n1": 0.9},
        "Y": {"v": -14.0, "p": 0.6, "r": 2.5, "da": 2.0, "dr": 30.0},
        "Z": {"u": -28.0, "w": -95.0, "q": -12.0, "de": -60.0, "n1": -0.3},
        "L": {"v": -5.0, "p": -16.0, "r": 3.0, "da": 45.0, "dr": 2.5},
        "M": {"u": 0.4, "w": -9.0, "q": -18.0, "de": -42.0, "n1": 0.05},
        "N": {"v": 8.0, "p": -0.8, "r": -9.0, "da": -1.5, "dr": -22.0},
    },
    {"de": 0.06, "da": 0.05, "dr": 0.06, "n1": 25.0},
    {"de": {"theta": 0.35, "q": 0.05}, "da": {"phi": -0.3, "p": -0.05}},
)
# A twin-engined transport of 5 t: mass, inertia and size of scenarios/twin_otter.toml at 65 m/s, with
# coefficients of its class (CLalpha 5.5, Cmalpha -1.6, Cmq -35, Cmde -1.8, Cnbeta 0.1, Clp -0.5): assumed.
TRANSPORT = Aircraft(
    "transport",
    4952.0,
    (28339.0, 32888.0, 52149.0, 1528.0),
    65.0,
    {
        "X": {"u": -180.0, "w": 500.0, "de": -2000.0, "n1": 60.0},
        "Y": {"v": -1250.0, "p": 400.0, "r": 3000.0, "dr": 18000.0},
        "Z": {"u": -1450.0, "w": -8600.0, "q": -12000.0, "de": -42000.0, "n1": -5.0},
        "L": {"v": -2100.0, "p": -122000.0, "r": 28000.0, "da": 270000.0, "dr": 9000.0},
        "M": {"u": 30.0, "w": -4900.0, "q": -107000.0, "de": -320000.0, "n1": 40.0},
        "N": {"v": 3100.0, "p": -12000.0, "r": -41000.0, "da": -8000.0, "dr": -150000.0},
    },
    {"de": 0.03, "da": 0.03, "dr": 0.03, "n1": 12.0},
    {"de": {"theta": 0.5, "q": 0.2}, "da": {"phi": -0.4, "p": -0.1}},
    (250.0, 140.0, 80.0),
)
# Body and motion of benchmarks/_unstable_aircraft.py, unstable in pitch, with a weak M_w; flown by its loop.
TILTWING = Aircraft(
    "tilt-wing",
    28.6,
    (3.2, 2.9, 5.6, 0.1),
    13.7,
    {
        "X": {"u": -4.0, "w": 6.0, "q": 1.0, "de": -3.0, "n1": 0.8},
        "Y": {"v": -14.0, "p": 0.5, "r": 2.0, "da": 1.0, "dr": 20.0},
        "Z": {"u": -25.0, "w": -85.0, "q": -15.0, "de": -35.0, "n1": -0.4},
        "L": {"v": -6.0, "p": -22.0, "r": 5.0, "da": 35.0, "dr": 2.0},
        "M": {"u": 1.0, "w": 6.0, "q": -12.0, "de": -30.0, "n1": 0.08},
        "N": {"v": 6.0, "p": -1.0, "r": -7.0, "da": -1.0, "dr": -16.0},
    },
    {"de": 0.05, "da": 0.05, "dr": 0.06, "n1": 20.0},
    {"de": {"theta": 1.2, "q": 0.6}, "da": {"phi": -0.4, "p": -0.05}, "dr": {"r": 0.1}},
    (90.0, 60.0, 40.0),
)
AIRCRAFT = (DRONE, TRANSPORT, TILTWING)


def gusts(craft: Aircraft, size: float, samples: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Return u v w of the air, shape (3, sample), m/s, with the spectra of Dryden."""
    rows = []
    for axis, length in enumerate(craft.lengths):
        time = length / craft.speed
        above, below = (
            ([1.0], [time, 1.0]) if axis == 0 else ([np.sqrt(3) * time, 1.0], [time**2, 2 * time, 1.0])
        )
        b, a = bilinear(above, below, 1 / dt)
        run_in = round(10 * time / dt)
        x = lfilter(b, a, rng.standard_normal(samples + run_in))[run_in:]
        # the filter's variance, from its own answer to one kick
        rows.append(size * x / np.sqrt((lfilter(b, a, np.eye(1, run_in)[0]) ** 2).sum()))
    return np.array(rows)


def multisines(craft: Aircraft, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return multisines of random phase on harmonics of their own, shape (effector, sample)."""
    lines = np.arange(3, 109)
    rows = []
    for i, name in enumerate(EFFECTORS):
        own = lines[i :: len(EFFECTORS)]
        turns = 2 * np.pi * np.outer(own, time) / PERIOD + rng.uniform(0, 2 * np.pi, (own.size, 1))
        rows.append(craft.amplitude[name] * np.sqrt(2 / own.size) * np.sin(turns).sum(axis=0))
    return np.array(rows)


def fly(craft: Aircraft, size: float, seeds: range) -> list[dict[str, np.ndarray]]:
    """Fly one period of multisines once for each seed, side by side, in gusts of so many m/s.

    Returns
    -------
    list of dict of ndarray
        By seed, without noise: states, specific forces, effectors, injected signals, motion through the air.
    """
    h = DT / INNER
    steps = round(PERIOD / h)
    fine = np.arange(2 * steps + 1) * h / 2  # half steps for RK4
    rngs = [np.random.default_rng([s, 7]) for s in seeds]
    signal = np.stack([multisines(craft, fine, r) for r in rngs], axis=-1)
    air = np.stack([gusts(craft, size, fine.size, h / 2, r) for r in rngs], axis=-1)
    trim = {"n1": 420.0}
    matrix = np.array(
        [[row.get(n, 0.0) for n in (*STATES[:6], *EFFECTORS)] for row in craft.derivatives.values()]
    )
    gain = np.array([[craft.gains.get(e, {}).get(n, 0.0) for n in STATES] for e in EFFECTORS])
    ix, iy, iz, ixz = craft.inertia
    inertia = np.array([[ix, 0, -ixz], [0, iy, 0], [-ixz, 0, iz]])
    inverse = np.linalg.inv(inertia)

    def loads(x: np.ndarray, at: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        moved = signal[:, at] + gain @ x
        through = x[:6].copy()
        through[:3] -= air[:, at]
        about = through.copy()
        about[0] -= craft.speed
        applied = matrix @ np.concatenate([about, moved])
        applied[2] -= craft.mass * G
        return applied, moved, through

    def slope(x: np.ndarray, at: int) -> np.ndarray:
        applied = loads(x, at)[0]
        p, q, r, phi, theta = x[3:8]
        gravity = G * np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
        moved = applied[:3] / craft.mass + gravity - np.cross(x[3:6], x[:3], axis=0)
        turned = inverse @ (applied[3:] - np.cross(x[3:6], inertia @ x[3:6], axis=0))
        across = q * np.sin(phi) + r * np.cos(phi)
        return np.concatenate(
            [
                moved,
                turned,
                [p + across * np.tan(theta), q * np.cos(phi) - r * np.sin(phi), across / np.cos(theta)],
            ]
        )

    x = np.zeros((9, len(seeds)))
    x[0] = craft.speed
    log = []
    for i in range(steps + 1):
        if i % INNER == 0:
            applied, moved, through = loads(x, 2 * i)
            log.append(np.concatenate([x, applied[:3] / craft.mass, moved, through[:3]]))
        if i < steps:
            k1 = slope(x, 2 * i)
            k2 = slope(x + h / 2 * k1, 2 * i + 1)
            k3 = slope(x + h / 2 * k2, 2 * i + 1)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3, 2 * i + 2))
    log = np.array(log)
    names = (*STATES, "ax", "ay", "az", *EFFECTORS, "ua", "va", "wa")
    flights = []
    for j in range(len(seeds)):
        flown = {n: log[:, k, j].copy() for k, n in enumerate(names)}
        flown["n1"] += trim["n1"]
        flown |= {f"e_{n}": signal[k, :: 2 * INNER, j] for k, n in enumerate(EFFECTORS)}
        flights.append(flown)
    return flights


def logged(
    craft: Aircraft, flown: dict[str, np.ndarray], seed: int, late: float, suite: str = "velocity"
) -> fq.Maneuver:
    """Return a flight as sensors log it: noisy, its air data so many seconds late.

    `suite` is ``"velocity"`` (u v w), ``"vanes"`` (V alpha beta), or ``"both"``, of which only u v w is late.
    """
    rng = np.random.default_rng([seed, 11])
    t = DT * np.arange(flown["u"].size)

    def noisy(values: np.ndarray, kind: str) -> np.ndarray:
        return values + NOISE[kind] * rng.standard_normal(t.size)

    def delayed(values: np.ndarray, by: float) -> np.ndarray:
        return np.interp(t - by, t, values)

    rows: dict[str, np.ndarray] = {}
    for names, kind in ((("p", "q", "r"), "rate"), (("ax", "ay", "az"), "force"), (STATES[6:], "angle")):
        rows |= {f"state/{n}": noisy(flown[n], kind) for n in names}
    u, v, w = flown["ua"], flown["va"], flown["wa"]
    if suite in ("velocity", "both"):
        rows |= {
            f"state/{n}": noisy(delayed(x, late), "velocity") for n, x in zip("uvw", (u, v, w), strict=True)
        }
    if suite in ("vanes", "both"):
        speed = np.sqrt(u**2 + v**2 + w**2)
        by = late if suite == "vanes" else 0.0
        rows["air/V"] = noisy(delayed(speed, by), "velocity")
        rows["air/alpha"] = noisy(delayed(np.arctan2(w, u), by), "angle")
        rows["air/beta"] = noisy(delayed(np.arcsin(v / speed), by), "angle")
    rows["air/rho"] = np.full(t.size, 1.225)
    for n in EFFECTORS:
        rows[f"effector/{n}"] = flown[n]
        rows[f"excitation/{n}"] = flown[f"e_{n}"]
    units = {"n1": "rad/s"}
    channels = {
        n: Channel(n, units.get(n.partition("/")[2], "rad") if n[0] == "e" else "", x, 1 / DT, "made")
        for n, x in rows.items()
    }
    return fq.Maneuver(fq.FlightRecord(t, channels), craft.vehicle())

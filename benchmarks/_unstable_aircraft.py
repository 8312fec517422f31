"""An unstable aircraft under feedback, excited by multisines: what benchmarks/instruments.py identifies.

A rigid body of the mass of scenarios/la8.toml, its wrench exactly linear in u v w p q r and 18 effectors,
flies the scenario's multisines for two periods, 120 s at 50 Hz, in one of two loops:

static    effectors follow ``e - K x`` at once, x the true state;
lagged    commands ``e - K [y, integral of y]`` of noisy measurements y, held over a sample and 20 ms late, go
          through first-order servos and motors.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_continuous_are

import freqid as fq
from freqid.core.channels import WRENCH
from freqid.core.record import Channel
from freqid.core.units import STANDARD_GRAVITY
from freqid.dynamics.small_motion import equations_of_motion

Flights = dict[str, np.ndarray]

DT, DURATION, SPEED = 0.02, 120.0, 13.72
SCENARIO = fq.read_scenario("la8")
LA8 = SCENARIO.aircraft()
# The linear wrench holds no spinning rotors and no tilting wings.
VEHICLE = fq.Vehicle(name="Unstable, linear", mass_properties=LA8.mass_properties, effectors=LA8.effectors)
EXCITED = [e for e in VEHICLE.effectors if e.kind != "tilt"]
EFFECTORS = [e.name for e in EXCITED]
STATES = ["u", "v", "w", "p", "q", "r"]
MOTION = {  # N and N m per m/s and rad/s; the pitching moment of w makes it unstable: assumed
    "X": {"u": -4.0, "w": 6.0, "q": 1.0},
    "Y": {"v": -14.0, "p": 0.5, "r": 2.0},
    "Z": {"u": -25.0, "w": -85.0, "q": -15.0},
    "L": {"v": -6.0, "p": -22.0, "r": 5.0},
    "M": {"u": 1.0, "w": 6.0, "q": -12.0},
    "N": {"v": 6.0, "p": -1.0, "r": -7.0},
}
TRUTH = np.array(
    [[MOTION[a].get(s, 0.0) for s in STATES] + [e.effectiveness.get(a, 0.0) for e in EXCITED] for a in WRENCH]
)
ROTOR_SPEED = 550.0
DEGREE = np.radians(1.0)
# One sigma of a sample, three times research quality.
STATE_NOISE = 3 * np.array([0.15] * 3 + [0.1 * DEGREE] * 3)
EFFECTOR_NOISE = 3 * np.array([0.002 * ROTOR_SPEED if e.kind == "rotor" else 0.05 * DEGREE for e in EXCITED])
FORCE_NOISE = 3 * 0.01 * STANDARD_GRAVITY
ATTITUDE_NOISE = 3 * 0.1 * DEGREE  # of what the lagged loop feeds back
LAG = np.array([0.06 if e.kind == "rotor" else 0.03 for e in EXCITED])
MASS, INERTIA = VEHICLE.mass_properties.mass_kg, VEHICLE.mass_properties.inertia.matrix
TRIM = np.array([SPEED, 0, 0, 0, 0, 0, 0, 0.0])[:, None]
INTEGRATED = [0, 2, 6]  # u, w and phi


def wrench(x: np.ndarray, d: np.ndarray) -> np.ndarray:
    level = np.array([0, 0, -MASS * STANDARD_GRAVITY, 0, 0, 0])[:, None]
    return level + TRUTH[:, :6] @ (x - TRIM)[:6] + TRUTH[:, 6:] @ d


def motion(x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the derivative of the states, shape (8, flight): Klein & Morelli, 2nd ed., ch. 3."""
    applied, rates = wrench(x, d), x[3:6]
    p, q, r, phi, theta = x[3:]
    gravity = STANDARD_GRAVITY * np.array(
        [-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)]
    )
    moved = applied[:3] / MASS - np.cross(rates, x[:3], axis=0) + gravity
    turned = np.linalg.solve(INERTIA, applied[3:] - np.cross(rates, INERTIA @ rates, axis=0))
    steady = q * np.sin(phi) + r * np.cos(phi)
    return np.concatenate([moved, turned, [p + np.tan(theta) * steady, q * np.cos(phi) - r * np.sin(phi)]])


def regulator(integrated: list[int], effort: float) -> np.ndarray:
    """Return LQ gains on states and integrals, shape (18, 8 + integrals), by Bryson's rule."""
    E, A = equations_of_motion(
        np.concatenate([TRUTH[:, :6], np.zeros((6, 2)), TRUTH[:, 6:]], axis=1),
        VEHICLE,
        TRIM[:3, 0],
        0.0,
        np.zeros((3, 18)),
        np.zeros(3),
    )
    both = np.linalg.solve(E[:, :8], A)
    A, B = np.zeros((8 + len(integrated),) * 2), np.zeros((8 + len(integrated), 18))
    A[:8, :8], B[:8] = both[:, :8], both[:, 8:]
    A[8 + np.arange(len(integrated)), integrated] = 1.0
    allowed = np.array([1, 1, 1, 0.3, 0.3, 0.3, 0.2, 0.15] + [2.0 if i < 3 else 0.6 for i in integrated])
    usual = np.array([SCENARIO.excitation.amplitude[e] for e in EFFECTORS]) / effort
    Q, R = np.diag(allowed**-2.0), np.diag(usual**-2.0)
    return np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))


def step(slope: Callable[[np.ndarray, int], np.ndarray], y: np.ndarray, h: float) -> np.ndarray:
    """Return y after h, by Runge and Kutta; the slope is told how many half steps have passed."""
    k1 = slope(y, 0)
    k2 = slope(y + h / 2 * k1, 1)
    k3 = slope(y + h / 2 * k2, 1)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(y + h * k3, 2))


def injected(design: fq.MultisineDesign, times: np.ndarray) -> np.ndarray:
    angle = 2 * np.pi * times / design.period_s
    rows = [s.amplitude @ np.sin(np.outer(s.index, angle) + s.phase[:, None]) for s in design.signals]
    return np.array(rows)


def fly_static(design: fq.MultisineDesign, gains: np.ndarray) -> Flights:
    """Return one flight without noise; arrays of shape (channel, sample, 1)."""
    count, substeps = round(DURATION / DT) + 1, 2
    h = DT / substeps
    e = injected(design, np.arange(2 * substeps * (count - 1) + 1) * h / 2)
    x, log = TRIM.copy(), []
    for i in range(count):
        at = 2 * substeps * i
        log.append((x, e[:, at : at + 1] - gains @ (x - TRIM)))
        for j in range(substeps if i + 1 < count else 0):
            start = at + 2 * j

            def slope(y: np.ndarray, halves: int, start: int = start) -> np.ndarray:
                return motion(y, e[:, start + halves, None] - gains @ (y - TRIM))

            x = step(slope, x, h)
    states, positions = (np.array(rows).transpose(1, 0, 2) for rows in zip(*log, strict=True))
    return collected(states, positions, states)


def fly_lagged(design: fq.MultisineDesign, gains: np.ndarray, flights: int, noise: float) -> Flights:
    """Return flights with noise fed back; arrays of shape (channel, sample, flight)."""
    rng = np.random.default_rng(1)
    count, substeps = round(DURATION / DT) + 1, 2
    e = injected(design, DT * np.arange(count))
    sigma = noise * np.append(STATE_NOISE, [ATTITUDE_NOISE] * 2)[:, None]
    y = np.concatenate([np.repeat(TRIM, flights, axis=1), np.zeros((18, flights))])
    total, late, log = np.zeros((len(INTEGRATED), flights)), np.zeros((18, flights)), []
    for i in range(count):
        seen = y[:8] + sigma * rng.standard_normal((8, flights))
        log.append((y[:8], y[8:], seen))
        total += DT * (seen - TRIM)[INTEGRATED]
        command, late = late, e[:, i : i + 1] - gains @ np.concatenate([seen - TRIM, total])

        def slope(y: np.ndarray, halves: int, command: np.ndarray = command) -> np.ndarray:
            return np.concatenate([motion(y[:8], y[8:]), (command - y[8:]) / LAG[:, None]])

        for _ in range(substeps if i + 1 < count else 0):
            y = step(slope, y, DT / substeps)
    return collected(*(np.array(rows).transpose(1, 0, 2) for rows in zip(*log, strict=True)))


def collected(states: np.ndarray, positions: np.ndarray, seen: np.ndarray) -> Flights:
    applied = np.array([wrench(states[:, i], positions[:, i])[:3] for i in range(states.shape[1])])
    return {"x": states, "d": positions, "force": applied.transpose(1, 0, 2) / MASS, "seen": seen}


def logged(flown: Flights, e: np.ndarray, flight: int, seed: int, *, fed_back: bool) -> fq.Maneuver:
    """Return one flight as it was logged; a loop that feeds noise back logs the very samples that it used."""
    rng = np.random.default_rng(10_000 + seed)
    x, d, force = (flown[k][:, :, flight] for k in ("x", "d", "force"))
    fresh = x[:6] + STATE_NOISE[:, None] * rng.standard_normal((6, x.shape[1]))
    states = flown["seen"][:6, :, flight] if fed_back else fresh
    d = d + EFFECTOR_NOISE[:, None] * rng.standard_normal(d.shape)
    force = force + FORCE_NOISE * rng.standard_normal(force.shape)
    rows = {f"state/{n}": ("m/s" if n in "uvw" else "rad/s", v) for n, v in zip(STATES, states, strict=True)}
    rows |= {f"state/{n}": ("m/s2", v) for n, v in zip(("ax", "ay", "az"), force, strict=True)}
    for effector, values, signal in zip(EXCITED, d, e, strict=True):
        level = ROTOR_SPEED if effector.kind == "rotor" else 0.0
        rows[f"effector/{effector.name}"] = (effector.unit, level + values)
        rows[f"excitation/{effector.name}"] = (effector.unit, signal)
    channels = {n: Channel(n, unit, values, 1 / DT, "benchmark") for n, (unit, values) in rows.items()}
    return fq.Maneuver(fq.FlightRecord(DT * np.arange(x.shape[1]), channels), VEHICLE)

"""An aircraft of one's own: a tilt-rotor with six rotors on four nacelles and a V-tail, and its flights.

It shares no formula with freqid. Masses are particles and rigid bodies whose accelerations are added up;
loads are flown as tangents to the formulas in `loads`, so that the true derivatives are known
(`true_derivatives`). A linear-quadratic regulator holds the trim, sensors are noisy, and the accelerometers
are away from the centre of gravity. Write a log of a design of ``freqid design-inputs --csv`` with

    python examples/own_tiltrotor.py DESIGN.csv u16 LOG.csv --seed 1

and list the trims that a scenario needs with ``python examples/own_tiltrotor.py``.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_continuous_are
from scipy.optimize import fsolve

G, RHO = 9.80665, 1.2
SURFACES = ("ail_l", "ail_r", "rv_l", "rv_r")
NACELLES = ("nac_fl", "nac_fr", "nac_rl", "nac_rr")
ROTORS = ("n1", "n2", "n3", "n4", "n5", "n6")
FREE = (*SURFACES, *NACELLES, *ROTORS)  # what can be excited
STATES = ("u", "v", "w", "p", "q", "r")
CONDITIONS = {"u04": 4.0, "u10": 10.0, "u16": 16.0, "u22": 22.0, "u28": 28.0, "u34": 34.0}  # m/s
HELD_OUT = {"u19": 19.0}  # between two conditions: to judge a global model by
FLAP = {"u04": 0.50, "u10": 0.50, "u16": 0.35, "u19": 0.275, "u22": 0.20, "u28": 0.10, "u34": 0.0}  # rad

# Masses, kg and m, body axes from the origin at the wing's quarter chord. The body without nacelles:
BODY_MASS, BODY_PLACE = 24.0, np.array([-0.05, 0.0, 0.04])
BODY_INERTIA = np.array([[1.9, 0.0, -0.12], [0.0, 3.2, 0.0], [-0.12, 0.0, 4.6]])  # about its own centre
NACELLE_MASS, NACELLE_ARM = 2.0, np.array([0.11, 0.0, 0.0])  # from its pivot, at zero tilt; a particle
PIVOT = np.array([[0.40, -0.95, -0.05], [0.40, 0.95, -0.05], [-0.85, -0.60, -0.02], [-0.85, 0.60, -0.02]])
# Rotors: nacelle, side offset from its pivot, sense of rotation. The front nacelles carry two each.
ON = np.array([0, 0, 1, 1, 2, 3])
HUB = np.array([[0.20, y, 0.0] for y in (-0.22, 0.22, -0.22, 0.22, 0.0, 0.0)])
SPIN = np.array([1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
ROTOR_INERTIA = 6e-4  # kg m2
MASS = BODY_MASS + 4 * NACELLE_MASS
THRUST, INFLOW, TORQUE, INPLANE = 2.4e-4, 3.2e-3, 4.0e-6, 4.0e-4  # N/(rad/s)2, N/(rad/s m/s), N m/(rad/s)2
LAG = 0.08  # s, of the motors
AREA, SPAN = 0.9, 2.4  # of the wing, m2 and m
SENSOR = np.array([0.10, 0.02, -0.06])  # accelerometers, m
NOISE = {"uvw": 0.08, "pqr": 0.0015, "attitude": 0.001, "force": 0.06, "angle": 0.0006, "rotor": 0.6}


def turned(vector, tilt):
    """Return vectors after a rotation about +y, nose up: x goes towards -z."""
    c, s = np.cos(tilt), np.sin(tilt)
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    return np.stack([c * x + s * z, y + 0 * c, -s * x + c * z], axis=-1)


def centre_of_gravity(nacelles):
    """Return where the whole balances, m."""
    places = PIVOT + turned(NACELLE_ARM * np.ones((4, 1)), nacelles)
    return (BODY_MASS * BODY_PLACE + NACELLE_MASS * places.sum(axis=0)) / MASS


def loads(x, flap):
    """Return X Y Z L M N about the centre of gravity, of u v w p q r there and the `FREE` effectors."""
    velocity, rates = x[:3], x[3:6]
    ail, rv, nac, n = x[6:8], x[8:10], x[10:14], x[14:20]
    cg, u = centre_of_gravity(nac), x[0]
    force, moment = np.zeros(3), np.zeros(3)

    def add(f, place):
        nonlocal force, moment
        force, moment = force + f, moment + np.cross(place - cg, f)

    for i in range(6):
        tilt = nac[ON[i]]
        axis, hub = turned([1.0, 0.0, 0.0], tilt), PIVOT[ON[i]] + turned(HUB[i], tilt)
        air = velocity + np.cross(rates, hub - cg)
        along = air @ axis
        add((THRUST * n[i] ** 2 - INFLOW * n[i] * along) * axis - INPLANE * n[i] * (air - along * axis), hub)
        moment -= SPIN[i] * TORQUE * n[i] ** 2 * axis
    for side, a in ((-1, ail[0]), (1, ail[1])):  # half wings, each where its lift acts
        place = np.array([-0.02, side * SPAN / 4, -0.05])
        ua, _, wa = velocity + np.cross(rates, place - cg)
        q = 0.5 * RHO * AREA / 2
        lift = q * (ua**2 * (0.25 + 1.1 * flap + 0.5 * a) + 5.0 * ua * wa)
        drag = q * (ua**2 * (0.045 + 0.10 * flap) + 0.8 * wa**2)
        add(np.array([-drag + 0.6 * q * wa**2, 0.0, -lift]), place)
        moment[1] -= q * 0.25 * ua**2 * (0.02 + 0.25 * flap)
    for side, d in ((-1, rv[0]), (1, rv[1])):  # panels of the V, leaning outwards by 40 degrees
        place = np.array([-1.45, side * 0.18, -0.20])
        normal = np.array([0.0, side * np.sin(0.70), -np.cos(0.70)])  # out of the upper side
        air = velocity + np.cross(rates, place - cg)
        push = 0.5 * RHO * 0.13 * air[0] * (-3.6 * (air @ normal) + 2.2 * air[0] * d)
        add(push * normal + np.array([-0.5 * RHO * 0.13 * 0.02 * air[0] ** 2, 0.0, 0.0]), place)
    side_area = 0.5 * RHO * 0.25 * (u + 3.0)
    add(
        np.array([0.0, -0.9 * side_area * velocity[1], -0.4 * side_area * velocity[2]]),
        np.array([0.05, 0, 0]),
    )
    add(-0.5 * RHO * 0.06 * u * np.array([u, 0.0, 0.0]), np.array([0.0, 0.0, 0.0]))
    return np.concatenate([force, moment])


@cache
def trim(condition):
    """Return u v w p q r and `FREE` positions of level flight with a level body, and what is unbalanced."""
    u, flap = (CONDITIONS | HELD_OUT)[condition], FLAP[condition]

    def whole(unknown):
        nac, front, rear = unknown
        return np.array([u, 0, 0, 0, 0, 0, 0, 0, 0, 0, *[nac] * 4, *[100 * front] * 4, *[100 * rear] * 2])

    def off(unknown):
        got = loads(whole(unknown), flap)
        return got[[0, 2, 4]] + [0.0, MASS * G, 0.0]

    best = min(
        (fsolve(off, start, full_output=True)[0] for start in ([1.4, 5, 5], [0.9, 5, 4], [0.3, 3, 3])),
        key=lambda z: np.abs(off(z)).max() + 1e3 * max(0.0, -z[0]),
    )
    return whole(best), np.abs(off(best)).max()


@cache
def true_derivatives(condition):
    """Return the derivatives of the loads at a trim, shape (6, 20): N and N m per SI unit."""
    at, flap = trim(condition)[0], FLAP[condition]
    step = np.where(np.arange(20) >= 14, 1.0, 1e-3)
    columns = [
        (loads(at + h * e, flap) - loads(at - h * e, flap)) / (2 * h)
        for h, e in zip(step, np.eye(20), strict=True)
    ]
    return np.array(columns).T


class Aircraft:
    """Particles, a rigid body and spinning rotors: what the loads make of them."""

    def __init__(self, condition):
        self.trim = trim(condition)[0]
        self.tangent, self.balance = true_derivatives(condition), loads(self.trim, FLAP[condition])

    def rate(self, state, surfaces, nacelles, commands):
        """Return the rate of change of v w angles n, and the acceleration felt by the sensor.

        `nacelles` has their angles, rates and accelerations; the state's velocity is that of the origin.
        """
        velocity, rates, (phi, theta, _), n = state[:3], state[3:6], state[6:9], state[9:15]
        angle, angle_rate, angle_acceleration = nacelles
        cg = centre_of_gravity(angle)
        spin_up = (commands - n) / LAG
        motion = np.concatenate([velocity + _cross(rates, cg), rates, surfaces, angle, n])
        wrench = self.balance + self.tangent @ (motion - self.trim)
        down = np.array([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)])
        force = wrench[:3] + MASS * G * down
        moment = wrench[3:] + _cross(cg, force)
        # What is there without acceleration of the origin: m (w x v + centripetal, Coriolis, own motion).
        turn, mass, first = _cross(rates, velocity), 0.0, np.zeros(3)
        inertia = BODY_INERTIA.copy()
        still_force, still_moment = np.zeros(3), _cross(rates, BODY_INERTIA @ rates)
        arm = turned(NACELLE_ARM * np.ones((4, 1)), angle)
        across = np.stack([arm[:, 2], 0 * angle, -arm[:, 0]], axis=1)  # y x arm
        places = [(BODY_MASS, BODY_PLACE, np.zeros(3), np.zeros(3))]
        places += [
            (NACELLE_MASS, PIVOT[k] + arm[k], angle_rate[k] * across[k],
             angle_acceleration[k] * across[k] - angle_rate[k] ** 2 * arm[k] * [1, 0, 1])
            for k in range(4)
        ]  # fmt: skip
        for m, r, moving, own in places:
            at_rest = turn + _cross(rates, _cross(rates, r) + 2 * moving) + own
            mass, first = mass + m, first + m * r
            inertia += m * (r @ r * np.eye(3) - np.outer(r, r))
            still_force += m * at_rest
            still_moment += _cross(r, m * at_rest)
        axes = turned(np.array([1.0, 0.0, 0.0]) * np.ones((6, 1)), angle[ON])
        turning = np.stack([axes[:, 2], 0 * n, -axes[:, 0]], axis=1) * angle_rate[ON][:, None]
        spin = ROTOR_INERTIA * SPIN
        held = (spin * n) @ axes
        still_moment += (spin * spin_up) @ axes + (spin * n) @ turning + _cross(rates, held)
        cross = np.array([[0, -first[2], first[1]], [first[2], 0, -first[0]], [-first[1], first[0], 0]])
        both = np.block([[mass * np.eye(3), -cross], [cross, inertia]])
        accelerated = np.linalg.solve(both, np.concatenate([force - still_force, moment - still_moment]))
        felt = accelerated[:3] + turn + _cross(accelerated[3:], SENSOR) + _cross(rates, _cross(rates, SENSOR))
        p, q, r = rates
        attitude = [
            p + (q * np.sin(phi) + r * np.cos(phi)) * np.tan(theta),
            q * np.cos(phi) - r * np.sin(phi),
            (q * np.sin(phi) + r * np.cos(phi)) / np.cos(theta),
        ]
        return np.concatenate([accelerated, attitude, spin_up]), felt - G * down


def _cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@cache
def regulator(condition):
    """Return the gains of a linear-quadratic regulator, from u v w p q r phi theta to surfaces and rotors."""
    aircraft, at = Aircraft(condition), trim(condition)[0]
    start = np.concatenate([at[:3], np.zeros(6), at[14:]])
    still = np.zeros((2, 4))

    def slope(z, command):
        state = start.copy()
        state[:8] += z
        # the motors follow at once here: their lag is short beside the motion
        state[9:] = at[14:] + command[4:]
        return aircraft.rate(state, command[:4], (at[10:14], *still), state[9:])[0][:8]

    h = 1e-4
    a = np.array([(slope(h * e, np.zeros(10)) - slope(-h * e, np.zeros(10))) / (2 * h) for e in np.eye(8)]).T
    size = np.array([*[0.2] * 4, *[30.0] * 6])
    b = np.array(
        [(slope(np.zeros(8), h * e) - slope(np.zeros(8), -h * e)) / (2 * h) for e in np.diag(size)]
    ).T
    weight = np.diag(1 / np.array([2.0, 2.0, 2.0, 0.5, 0.5, 0.5, 0.15, 0.15]) ** 2)
    ricatti = solve_continuous_are(a, b, weight, 2.0 * np.eye(10))
    return size[:, None] * (b.T @ ricatti) / 2.0


def fly(condition, time, excitation):
    """Return channels of a flight without noise, by name, SI, shape (sample,) each.

    Parameters
    ----------
    condition : str
    time : ndarray, shape (sample,)
        Uniform, s.
    excitation : dict of str to ndarray
        By effector of `FREE`; zero where absent.
    """
    aircraft, at, gains = Aircraft(condition), trim(condition)[0], regulator(condition)
    h = time[1] - time[0]
    added = np.array([excitation.get(name, np.zeros(time.size)) for name in FREE])
    # Signals, and rates and accelerations of the nacelles, at every half step.
    smooth = CubicSpline(time, added, axis=1)
    halves = np.linspace(time[0], time[-1], 2 * time.size - 1)
    signal = smooth(halves)
    held = np.stack([smooth(halves, order)[4:8] for order in range(3)])

    def inputs(state, signals, nacelles):
        z = state[:8] - np.concatenate([at[:3], np.zeros(5)])
        asked = -gains @ z
        tilts = (at[10:14] + nacelles[0], nacelles[1], nacelles[2])
        return asked[:4] + signals[:4], tilts, at[14:] + asked[4:] + signals[8:]

    state = np.concatenate([at[:3], np.zeros(6), at[14:]])
    rows = []
    for i in range(time.size):
        here, half, after = (
            (signal[:, 2 * i + k], held[:, :, 2 * i + k])
            if i + 1 < time.size
            else (signal[:, -1], held[:, :, -1])
            for k in range(3)
        )
        now = inputs(state, *here)
        slope, felt = aircraft.rate(state, *now)
        rows.append(np.concatenate([state[:9], felt, now[0], now[1][0], state[9:]]))
        if i + 1 == time.size:
            break
        k2 = aircraft.rate(s := state + h / 2 * slope, *inputs(s, *half))[0]
        k3 = aircraft.rate(s := state + h / 2 * k2, *inputs(s, *half))[0]
        k4 = aircraft.rate(s := state + h * k3, *inputs(s, *after))[0]
        state = state + h / 6 * (slope + 2 * k2 + 2 * k3 + k4)
    names = (*STATES, "phi", "theta", "psi", "ax", "ay", "az", *FREE)
    return dict(zip(names, np.array(rows).T, strict=True))


def log(condition, time, excitation, clean, seed, noise=1.0):
    """Return the table of a log with `noise` times the noise, in the units of the columns' names."""
    rng, degree, rpm = np.random.default_rng(seed), np.degrees(1.0), 30 / np.pi
    kinds = [
        (("u", "v", "w"), "m/s", 1.0, NOISE["uvw"]),
        (("p", "q", "r"), "deg/s", degree, NOISE["pqr"]),
        (("phi", "theta", "psi"), "deg", degree, NOISE["attitude"]),
        (("ax", "ay", "az"), "m/s2", 1.0, NOISE["force"]),
        ((*SURFACES, *NACELLES), "deg", degree, NOISE["angle"]),
        (ROTORS, "rpm", rpm, NOISE["rotor"]),
    ]
    table = {"t [s]": time}
    for names, unit, factor, sigma in kinds:
        for name in names:
            table[f"{name} [{unit}]"] = factor * (
                clean[name] + noise * sigma * rng.standard_normal(time.size)
            )
    table["flap [deg]"] = np.full(time.size, degree * FLAP[condition])
    table["rho [kg/m3]"] = np.full(time.size, RHO)
    for name, signal in excitation.items():
        unit, factor = ("rpm", rpm) if name in ROTORS else ("deg", degree)
        table[f"{name} injected [{unit}]"] = factor * signal
    return pd.DataFrame(table)


def design_of(path):
    """Return time and signals of a design written as CSV by ``freqid design-inputs --csv``."""
    table = pd.read_csv(path, comment="#")
    time = table.iloc[:, 0].to_numpy()
    signals = {c.split()[0].split("_rad")[0]: table[c].to_numpy() for c in table.columns[1:]}
    return time, {name: signals[name] for name in FREE if name in signals}


def main(arguments):
    """Write a log, or list the trims."""
    if not arguments:
        for name, u in CONDITIONS.items():
            x, off = trim(name)
            place = np.round(centre_of_gravity(x[10:14]), 4)
            sys.stdout.write(
                f"{name}: u = {u:g} m/s, nacelles {x[10]:.4f} rad, flap {FLAP[name]:g} rad, rotors "
                f"{x[14]:.0f} and {x[18]:.0f} rad/s, unbalanced {off:.1e} N, centre of gravity {place} m\n"
            )
        return
    design, condition, target, *rest = arguments
    seed = int(rest[rest.index("--seed") + 1]) if "--seed" in rest else 0
    time, excitation = design_of(design)
    table = log(condition, time, excitation, fly(condition, time, excitation), seed)
    Path(target).parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(target, index=False, float_format="%.9g")


if __name__ == "__main__":
    main(sys.argv[1:])

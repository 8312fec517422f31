"""The owner's simulation of the judging air taxi: few-term polynomials of half wings, rotors and wash."""

from __future__ import annotations

import csv
import math
import sys
import tomllib
from operator import mul
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import airtaxi_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402

# Of a half wing in its own flow, about the middle of the campaign, then turning, and the other half's.
INPUTS = ("1", "angle", "aileron", "inner", "outer", "slip", "roll", "yaw", "pitch")
INPUTS += ("angle2", "aileron2", "inner2", "outer2")
LOADS = ("chordwise", "normal", "bending", "turning", "swinging")
MADE = ("thrust", "torque", "dragged", "sideways", "advancing", "forward")
BETWEEN = 50.0  # m/s, of both campaigns
FAST = 200.0  # m/s: scale of the speed of tips
ROTORS = tomllib.loads((HERE / "scenario.toml").read_text())["rotor"]
HUBS = [(r["name"], r["axis"][0], r["axis"][2], *r["position_m"], float(r["spin"])) for r in ROTORS]
DISC = math.pi * g.RADIUS[0] ** 2
# Of the wash, m
WAYS = np.array([g.WING_X - HUBS[4][3]] * 2 + [g.WING_X - g.STAB["x"]] * 2)


def _read():
    """Return products of inputs, or powers, with rows of coefficients, and terms of the wash."""
    read = {}
    for row in csv.DictReader((HERE / "tunnel.csv").read_text().splitlines()):
        made = read.setdefault(row["campaign"], {}).setdefault(row["response"], {})
        made[row["term"]] = float(row["coefficient"])
    out = {}
    for about in ("slow", "fast"):
        for kind, names in (("wing", LOADS), ("prop", MADE), ("lift", MADE)):
            found = read[f"{about} {kind}"]
            terms = sorted({t for load in found.values() for t in load}, key=lambda t: (len(t.split()), t))
            if kind == "wing":
                said = [tuple(INPUTS.index(n) for n in (*t.split(), "1", "1")[:3]) for t in terms]
            else:
                said = [tuple(map(int, t)) for t in terms]
            out[about, kind] = said, [[found[n].get(t, 0.0) for t in terms] for n in names]
        out[about, "wash"] = [list(read[f"{about} wash"][n].items()) for n in ("rotor", "stab")]
    return out


TABLE = _read()


def half_wing(inputs, about):
    """Return the coefficients of all loads of a half wing."""
    products, rows = TABLE[about, "wing"]
    made = [
        inputs[i] * inputs[j] * inputs[k] if k else inputs[i] * inputs[j] if j else inputs[i]
        for i, j, k in products
    ]
    return [sum(map(mul, row, made)) for row in rows]


def rotor(k, at, speed, rho, get, about):
    """Return three forces, three moments about the centre of gravity and thrust of a rotor."""
    name, ax, az, x, y, z, spin = HUBS[k]
    front = k < 4
    radius = g.RADIUS[0 if front else 1]
    powers, rows = TABLE[about, "prop" if front else "lift"]
    u, v, w = at
    tip = radius * speed
    along = u * ax + w * az
    ux, wz = u - ax * along, w - az * along
    across = (ux * ux + v * v + wz * wz) ** 0.5
    a, b, t = along / tip, across / tip, tip / FAST - 0.9
    if front:
        a = a * (1 + get("props.inflow", 0.0))
    of_a, of_b, of_t = (1.0, a, a * a, a * a * a), (1.0, b, b * b, b * b * b), (1.0, t)
    made = [of_a[i] * of_b[j] * of_t[n] for i, j, n in powers]
    thrust, torque, dragged, sideways, advancing, forward = (sum(map(mul, row, made)) for row in rows)
    power = rho * (math.pi * radius * radius) * tip * tip
    if not front:
        thrust = thrust - get("lifts.inflow", 0.0) * lost_by_inflow(thrust, b)
    thrust = power * thrust * (1 + get(name + ".thrust", 0.0))
    torque = power * radius * torque * (1 + get(name + ".torque", 0.0)) * spin
    inplane = power * (1 + get("props.inplane", 0.0)) / tip  # by the velocity across
    dragged, sideways = dragged * inplane, sideways * inplane * spin
    advancing, forward = advancing * inplane * radius * spin, forward * inplane * radius
    sx, sy, sz = v * az, wz * ax - ux * az, -v * ax  # across way and axis
    fx = ax * thrust - ux * dragged - sx * sideways
    fy = -v * dragged - sy * sideways
    fz = az * thrust - wz * dragged - sz * sideways
    mx = sx * forward - ux * advancing - ax * torque + y * fz - z * fy
    my = sy * forward - v * advancing + z * fx - x * fz
    mz = sz * forward - wz * advancing - az * torque + x * fy - y * fx
    return (fx, fy, fz, mx, my, mz), thrust


def lost_by_inflow(thrust, across):
    """Return what a lifting rotor's thrust loses by its inflow's relative change, both as coefficients.

    Blades lose 0.15 by inflow; momentum gives back a part, for less thrust induces less.
    """
    return 0.15 * thrust / (2 * across + 0.15)


def _steady(value, slow):
    return value


def loads(m, state, effector, rho, par, late=_steady):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy).

    `late` puts the wing's wash at lifting rotors and stabilator behind lags: ``late(values, seconds)``.
    """
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed = m.sqrt(u * u + v * v + w * w)
    slip = v / u
    mean = u if m is math else float(u.mean())
    about = "slow" if mean < BETWEEN else "fast"
    sums = [0.0] * 6

    def spun(k, down=0.0):
        _, _, _, x, y, z, _ = HUBS[k]
        at = (u + q * z - r * y, v + r * x - p * z, w + p * y - q * x - down)
        made, thrust = rotor(k, at, effector[5 + k], rho, get, about)
        for i, part in enumerate(made):
            sums[i] = sums[i] + part
        return thrust

    blowing = 1 + get("jets.strength", 0.0)
    power = [spun(k) / (rho * DISC * u * u) * blowing for k in range(4)]
    # wing
    c, s = math.cos(g.INCIDENCE), math.sin(g.INCIDENCE)
    roll = p * (1 + get("wing.roll_damping", 0.0))
    bent = get("wing.dihedral", 0.0) * g.DIHEDRAL
    halves = []
    for k, side in ((0, -1.0), (1, 1.0)):
        y = side * g.HALF_Y
        ahead = u + q * g.WING_Z - r * y
        below = w + roll * y - q * g.WING_X + side * bent * v
        along, through = ahead * c - below * s, ahead * s + below * c
        aileron = effector[k] * (1 + get(g.SURFACES[k] + ".effectiveness", 0.0))
        inner, outer = (power[1], power[0]) if k == 0 else (power[2], power[3])
        own = (1.0, through / along - g.MIDDLE["angle"], aileron)
        own += (inner - g.MIDDLE["inner"], outer - g.MIDDLE["outer"])
        turning = (side * slip, side * roll / u, side * r / u, q / u)
        halves.append((own, turning, along * along + through * through))
    lift, pull = 1 + get("wing.lift", 0.0), 1 + get("wing.chord_force", 0.0)
    fx = fz = fy = mx = my = mz = 0.0
    said = []
    for k, side in ((0, -1.0), (1, 1.0)):
        (own, turning, square), other = halves[k], halves[1 - k][0]
        chordwise, normal, bending, pitching, swinging = half_wing((*own, *turning, *other[1:5]), about)
        pressure = 0.25 * rho * g.AREA * square
        whole = m.sqrt(square)
        said.append((whole * normal, whole * bending, u * own[2], u * own[3], u * own[4]))
        fx, fz = fx + pressure * chordwise * pull, fz + pressure * normal * lift
        fy = fy + side * pressure * normal * lift
        mx = mx + side * pressure * bending
        mz = mz + side * pressure * swinging
        my = my + pressure * pitching
    mx, mz = mx * (g.SPAN * lift), mz * (g.SPAN * pull)
    bx, bz = fx * c + fz * s, fz * c - fx * s
    X, Y, Z = bx, g.DIHEDRAL * (1 + get("wing.dihedral", 0.0)) * fy, bz
    L, N = mx * c + mz * s, mz * c - mx * s
    M = my * (g.CHORD * (1 + get("wing.moment", 0.0))) + g.WING_Z * bx - g.WING_X * bz
    # lifting rotors and stabilator, in the wing's late wash
    wash = []
    for terms in TABLE[about, "wash"]:
        for k, side in ((0, -1.0), (1, 1.0)):
            seen = {"still": u, "slipping": side * v, "rolling": side * p, "yawing": side * r}
            for i, n in enumerate(("normal", "bending", "aileron", "inner", "outer")):
                seen[n + "_own"], seen[n + "_other"] = said[k][i], said[1 - k][i]
            wash.append(sum(value * seen[n] for n, value in terms))
    wash = late(np.array(wash), WAYS / mean)
    for k in (4, 5):
        spun(k, wash[k - 4] * (1 + get("rear.downwash", 0.0)))
    for k, side in ((0, -1.0), (1, 1.0)):
        down = wash[2 + k] * (1 + get("tail.downwash", 0.0))
        met = w - down - q * g.STAB["x"] * (1 + get("tail.pitch_damping", 0.0)) + side * p * g.STAB["y"]
        angle = met / u + effector[2 + k] * (1 + get(g.SURFACES[2 + k] + ".effectiveness", 0.0))
        pressure = 0.25 * rho * u * u * g.STAB["area"]
        lift = 3.7 * angle + 1.4 * angle * abs(angle)
        lift = pressure * (1 + get("tail.lift_slope", 0.0)) * lift
        drag = 0.009 * pressure + 0.09 / pressure * lift * lift
        fx, fz = lift * met / u - drag, -lift
        X, Z, L, N = X + fx, Z + fz, L + side * g.STAB["y"] * fz, N - side * g.STAB["y"] * fx
        M = M + g.STAB["z"] * fx - g.STAB["x"] * fz
    # fin
    met = 0.88 * v + r * g.FIN["x"] * (1 + get("fin.yaw_damping", 0.0)) - p * g.FIN["z"]
    rud = effector[4]
    moved = 1.5 * (1 + get("rud.effectiveness", 0.0)) * rud * (1 - 1.2 * rud * rud) * u
    side = 0.5 * rho * u * g.FIN["area"] * (moved - 2.65 * (1 + get("fin.side_force", 0.0)) * met)
    L, N = L - g.FIN["z"] * side, N + g.FIN["x"] * side
    # body
    drag = 0.25 * rho * speed * (1 + get("body.drag", 0.0))
    X, Y, Z = X - drag * u, Y + side - drag * v, Z - drag * w - 0.42 * rho * u * w
    M = M + 3.6 * rho * (1 + get("body.pitch_moment", 0.0)) * u * w
    Y = Y - 0.44 * rho * (1 + get("body.side_force", 0.0)) * u * v
    N = N - 3.6 * rho * (1 + get("body.yaw_moment", 0.0)) * u * v
    return X + sums[0], Y + sums[1], Z + sums[2], L + sums[3], M + sums[4], N + sums[5]


def schedule(u):
    """Return commands, of which the trim replaces stabilator and propellers."""
    slow = u < BETWEEN
    return (0.0,) * 5 + (150.0 if slow else 197.0,) * 4 + (140.0 if slow else 130.0,) * 2


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("stab_l", "stab_r"), g.PROPELLERS),
    wake=True,
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

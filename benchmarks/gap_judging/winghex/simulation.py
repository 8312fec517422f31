"""The owner's simulation of the judging winged hexacopter: polynomials of half wings, rotors and wakes."""

from __future__ import annotations

import csv
import math
import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import winghex_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402

# Of a half wing in its own flow, about the middle of the campaign, then turning, and the other half's.
INPUTS = ("1", "angle", "wake", "aileron", "slip", "roll", "yaw", "pitch", "angle2", "wake2", "aileron2")
LOADS = ("chordwise", "normal", "bending", "turning", "swinging")
WAKE_INPUTS = ("climb", "slip", "load")
BETWEEN = 14.5  # m/s, of both campaigns
DISC = math.pi * g.ROTOR_R**2
HUBS = [
    (r["name"], r["axis"][0], r["axis"][2], *r["position_m"], r["spin"])
    for r in tomllib.loads((HERE / "scenario.toml").read_text())["rotor"]
]
# Ways of wakes, m: front to wing, to rear and to tail; middle to rear and to tail
FORE, REAR, TAIL = HUBS[0][3], HUBS[4][3], g.TAIL["x"]
WAYS = (*[FORE - g.WING_X] * 2, *[FORE - REAR] * 2, *[-REAR] * 2, *[FORE - TAIL] * 2, *[-TAIL] * 2)


def _read():
    """Return coefficients: of half wings by indices of inputs, of rotors by powers, of wakes by powers."""
    out = {}
    for row in csv.DictReader((HERE / "tunnel.csv").read_text().splitlines()):
        term, value = row["term"], float(row["coefficient"])
        if row["campaign"].endswith("wing"):
            said = tuple(INPUTS.index(n) for n in (*term.split(), "1", "1")[:3])
        elif row["campaign"] == "stand":
            said = tuple(int(n) for n in term)
        elif row["response"].startswith("wing ") or term == "sides":
            said = (term,)
        else:
            said = tuple(term.split().count(n) for n in WAKE_INPUTS)
        out.setdefault(row["campaign"], {}).setdefault(row["response"], []).append((*said, value))
    return out


TABLE = _read()


def half_wing(inputs, terms):
    """Return the coefficient of one load of a half wing."""
    total = 0.0
    for i, j, k, c in terms:
        total = total + c * inputs[i] * inputs[j] * inputs[k]
    return total


def stand(along, across, terms):
    """Return one coefficient of a rotor by both advances."""
    total = 0.0
    for i, j, c in terms:
        total = total + c * along**i * across**j
    return total


def wake(responses, load, climb, slip, u, other=0.0):
    """Return downwash of rotors' wakes, m/s, by the velocity that they induce."""
    relative, total = load / u, 0.0
    for *powers, c in responses:
        if powers == ["sides"]:
            total = total + c * other * slip
        else:
            i, j, k = powers
            total = total + c * load * climb**i * slip**j * relative**k
    return total


def behind_wing(responses, said):
    """Return downwash behind the wing, m/s."""
    return sum(c * said[n] for n, c in responses)


def rotor(hub, at, speed, rho, get):
    """Return three forces, three moments about the centre of gravity and thrust of a rotor."""
    name, ax, az, x, y, z, spin = hub
    u, v, w = at
    tip = g.ROTOR_R * speed
    along = u * ax + w * az
    ux, wz = u - ax * along, w - az * along
    across = (ux * ux + v * v + wz * wz) ** 0.5
    a, b = along / tip * (1 + get("props.inflow", 0.0)), across / tip * (1 + get("props.edgewise", 0.0))
    power = DISC * rho * tip * tip
    thrust, torque, dragged, sideways, advancing, forward = (
        power * stand(a, b, TABLE["stand"][n])
        for n in ("thrust", "torque", "dragged", "sideways", "advancing", "forward")
    )
    thrust = thrust * (1 + get(name + ".thrust", 0.0))
    torque = torque * g.ROTOR_R * (1 + get(name + ".torque", 0.0)) * spin
    inplane = (1 + get("props.inplane", 0.0)) / across
    dragged, sideways = dragged * inplane, sideways * inplane * spin
    advancing, forward = advancing * inplane * g.ROTOR_R * spin, forward * inplane * g.ROTOR_R
    sx, sy, sz = v * az, wz * ax - ux * az, -v * ax  # across way and axis
    fx = ax * thrust - ux * dragged - sx * sideways
    fy = -v * dragged - sy * sideways
    fz = az * thrust - wz * dragged - sz * sideways
    mx = sx * forward - ux * advancing - ax * torque + y * fz - z * fy
    my = sy * forward - v * advancing + z * fx - x * fz
    mz = sz * forward - wz * advancing - az * torque + x * fy - y * fx
    return (fx, fy, fz, mx, my, mz), thrust


def _steady(value, slow):
    return value


def loads(m, state, effector, rho, par, late=_steady):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy).

    `late` puts the wakes of the front and middle rotors behind lags: ``late(values, seconds)``.
    """
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed = m.sqrt(u * u + v * v + w * w)
    climb, slip = w / u, v / u
    jets = 1 + get("jets.strength", 0.0)
    sums = [0.0] * 6
    induced = []

    def spun(k, down=0.0):
        _, _, _, x, y, z, _ = HUBS[k]
        at = (u + q * z - r * y, v + r * x - p * z, w + p * y - q * x - down)
        made, thrust = rotor(HUBS[k], at, effector[4 + k], rho, get)
        for i, part in enumerate(made):
            sums[i] = sums[i] + part
        induced.append(thrust / (rho * DISC * u))

    for k in range(4):
        spun(k)
    fl, fr, ml, mr = induced
    mean = u if m is math else float(u.mean())
    about = "slow" if mean < BETWEEN else "fast"
    table, behind = TABLE[f"{about} wing"], TABLE[f"{about} wake"]
    values = np.array([fl, fr, fl, fr, ml, mr, fl, fr, ml, mr])
    at_wing_l, at_wing_r, *far = late(values, np.array(WAYS) / mean)
    # wing
    c, s = m.cos(g.INCIDENCE), m.sin(g.INCIDENCE)
    roll = 1 + get("wing.roll_damping", 0.0)
    halves = []
    for side, load, moved in ((-1.0, at_wing_l, 0), (1.0, at_wing_r, 1)):
        y = side * g.HALF_Y
        ahead, below = u + q * g.WING_Z - r * y, w + p * roll * y - q * g.WING_X
        along, through = ahead * c - below * s, ahead * s + below * c
        whole = m.sqrt(along * along + through * through)
        halves.append(
            (
                through / along - g.MIDDLE["angle"],
                load * jets / whole - g.MIDDLE["wake"],
                effector[moved] * (1 + get(g.SURFACES[moved] + ".effectiveness", 0.0)),
                side * slip,
                side * p * roll / whole,
                side * r / whole,
                q / whole,
                whole,
            )
        )
    lift, pull = 1 + get("wing.lift", 0.0), 1 + get("wing.chord_force", 0.0)
    fx = fz = mx = my = mz = 0.0
    said = []
    for k, side in enumerate((-1.0, 1.0)):
        own, other = halves[k], halves[1 - k]
        inputs = (1.0, *own[:7], *other[:3])
        pressure = 0.25 * rho * own[7] * own[7] * g.AREA
        chordwise, normal, bending, turning, swinging = (half_wing(inputs, table[n]) for n in LOADS)
        said.append((own[7] * normal, own[7] * bending, own[1], own[2]))
        fx, fz = fx + pressure * chordwise * pull, fz + pressure * normal * lift
        mx = mx + side * pressure * g.SPAN * bending * lift
        mz = mz + side * pressure * g.SPAN * swinging * pull
        my = my + pressure * g.CHORD * turning * (1 + get("wing.moment", 0.0))
    bx, bz = fx * c + fz * s, fz * c - fx * s
    X, Z = bx, bz
    L, N = mx * c + mz * s, mz * c - mx * s
    M = my + g.WING_Z * bx - g.WING_X * bz
    # rear rotors, in the wing's downwash and in wakes
    fl, fr, ml, mr, *further = far
    for k, own, other, near, cross, side in ((4, 0, 1, fl, fr, -1.0), (5, 1, 0, fr, fl, 1.0)):
        mid, beyond = (ml, mr) if k == 4 else (mr, ml)
        terms = {"slow": w, "still": u, "slipping": side * v, "rolling": side * p, "yawing": side * r}
        for i, n in enumerate(("normal", "bending", "wake", "aileron")):
            scale = u if i > 1 else 1.0
            terms |= {f"{n}_own": scale * said[own][i], f"{n}_other": scale * said[other][i]}
        down = jets * (
            wake(behind["front rear"], near, climb, side * slip, u)
            + wake(behind["across rear"], cross, climb, side * slip, u)
            + wake(behind["mid rear"], mid, climb, side * slip, u)
            + wake(behind["beyond rear"], beyond, climb, side * slip, u)
        )
        spun(k, (down + behind_wing(behind["wing rear"], terms)) * (1 + get("rear.downwash", 0.0)))
    # tail
    terms = {"slow": w, "still": u}
    for i, n in enumerate(("normal", "bending", "wake", "aileron")):
        scale = u if i > 1 else 1.0
        terms[n] = scale * (said[0][i] + said[1][i])
    fl, fr, ml, mr = further
    rl, rr = induced[4:]
    down = behind_wing(behind["wing tail"], terms) + jets * (
        wake(behind["front tail"], fl + fr, climb, slip, u, fr - fl)
        + wake(behind["mid tail"], ml + mr, climb, slip, u, mr - ml)
        + wake(behind["rear tail"], rl + rr, climb, slip, u, rr - rl)
    )
    down = down * (1 + get("tail.downwash", 0.0))
    angle = (w - down - q * g.TAIL["x"] * (1 + get("tail.pitch_damping", 0.0))) / u + 0.075
    slope = 3.70 * (1 + get("tail.lift_slope", 0.0))
    de = effector[2]
    moved = 2.1 * (1 + get("elev.effectiveness", 0.0)) * de * (1 - 0.16 * de * de)
    lift = slope * (angle - angle * angle * angle) + moved
    pressure = 0.5 * rho * u * u * g.TAIL["area"]
    lift = pressure * lift
    X, Z = X + lift * (w - down) / u - 0.06 * pressure * de * de, Z - lift
    M = M + g.TAIL["x"] * lift
    # fin
    met = v + r * g.FIN["x"] * (1 + get("fin.yaw_damping", 0.0)) - p * g.FIN["z"]
    dr = effector[3]
    moved = 1.7 * (1 + get("rud.effectiveness", 0.0)) * dr * (1 - 0.16 * dr * dr) * u
    side = 0.5 * rho * u * g.FIN["area"] * (moved - 2.91 * (1 + get("fin.side_force", 0.0)) * met)
    L, N = L - g.FIN["z"] * side, N + g.FIN["x"] * side
    # body
    pressure = 0.5 * rho * speed * speed * g.AREA
    alpha, beta = m.atan2(w, u), v / speed
    drag = 0.0402 * (1 + get("body.drag", 0.0)) * 0.5 * rho * speed
    X, Y, Z = X - drag * u, side - drag * v, Z - 2.45 * drag * w
    turned = alpha - 0.65 * alpha * alpha * alpha
    M = M + pressure * g.CHORD * 0.09 * (1 + get("body.pitch_moment", 0.0)) * turned
    Y = Y - pressure * 0.307 * (1 + get("body.side_force", 0.0)) * beta
    N = N - pressure * g.SPAN * 0.014 * (1 + get("body.yaw_moment", 0.0)) * beta
    return X + sums[0], Y + sums[1], Z + sums[2], L + sums[3], M + sums[4], N + sums[5]


def schedule(u):
    """Return commands that the trim replaces: no more than a guess."""
    return (0.0, 0.0, 0.0, 0.0, *((350.0,) * 6))


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("elev",), g.ROTORS),
    wake=True,
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

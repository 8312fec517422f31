"""The owner's simulation of the judging T-tail: few-term polynomials of half wings, propellers and tail."""

from __future__ import annotations

import csv
import math
import sys
import tomllib
from operator import mul
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import ttail_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402

# Of a half wing in its own flow, about the middle of the campaign, then turning, and the other half's.
INPUTS = ("1", "angle", "flap", "aileron", "inner", "tip", "slip", "roll", "yaw", "pitch")
INPUTS += ("angle2", "flap2", "aileron2", "inner2")
LOADS = ("chordwise", "normal", "bending", "turning", "swinging")
BETWEEN = 29.5  # m/s, of both campaigns
ROTORS = tomllib.loads((HERE / "scenario.toml").read_text())["rotor"]
HUBS = [(r["name"], *r["position_m"], float(r["spin"])) for r in ROTORS]
AX, _, AZ = ROTORS[0]["axis"]
DISCS = [math.pi * (r["diameter_m"] / 2) ** 2 for r in ROTORS]
BACK = g.WING_X - g.TAIL["x"]  # m, from the wing to the tail


def _read():
    """Return coefficients by campaign, response and term; of wings, products of inputs and rows of loads."""
    out = {}
    for row in csv.DictReader((HERE / "tunnel.csv").read_text().splitlines()):
        made = out.setdefault(row["campaign"], {}).setdefault(row["response"], {})
        made[row["term"]] = float(row["coefficient"])
    for about in ("slow", "fast"):
        wing = out[f"{about} wing"]
        terms = sorted({t for load in wing.values() for t in load}, key=lambda t: (len(t.split()), t))
        products = [tuple(INPUTS.index(n) for n in (*t.split(), "1", "1")[:3]) for t in terms]
        rows = [[wing[n].get(t, 0.0) for t in terms] for n in LOADS]
        out[about] = (products, rows)
    for kind in ("tip", "inner"):
        for terms in out[kind].values():
            terms["cubic"] = tuple(terms.get(f"{i}0", 0.0) for i in range(4))
    return out


TABLE = _read()


def half_wing(inputs, about):
    """Return the coefficients of all loads of a half wing."""
    products, rows = TABLE[about]
    made = [
        inputs[i] * inputs[j] * inputs[k] if k else inputs[i] * inputs[j] if j else inputs[i]
        for i, j, k in products
    ]
    return [sum(map(mul, row, made)) for row in rows]


def power_of(terms, a, b=0.0):
    """Return a polynomial of two inputs, by the powers of both."""
    total = 0.0
    for powers, c in terms.items():
        total = total + c * a ** int(powers[0]) * b ** int(powers[1])
    return total


def rotor(k, at, speed, rho, get):
    """Return three forces, three moments about the centre of gravity and thrust of a propeller."""
    name, x, y, z, spin = HUBS[k]
    table = TABLE["tip" if k < 2 else "inner"]
    u, v, w = at
    radius = g.RADIUS[k // 2]
    tip = radius * speed
    along = u * AX + w * AZ
    ux, wz = u - AX * along, w - AZ * along
    a = along / tip * (1 + get("props.inflow", 0.0))
    b2 = (ux * ux + v * v + wz * wz) / (tip * tip)
    t, n, d = table["thrust"], table["torque"], table["dragged"]
    mean = rho * DISCS[k] * tip
    power = mean * tip
    thrust = power * (cubic(t, a) + t.get("02", 0.0) * b2) * (1 + get(name + ".thrust", 0.0))
    torque = power * radius * spin * cubic(n, a) * (1 + get(name + ".torque", 0.0))
    inplane = mean * (1 + get("props.inplane", 0.0))
    drag, lean = inplane * cubic(d, a), inplane * radius * spin * cubic(table["leaning"], a)
    fx, fy, fz = AX * thrust - ux * drag, -v * drag, AZ * thrust - wz * drag
    mx = y * fz - z * fy - AX * torque - ux * lean
    my = z * fx - x * fz - v * lean
    mz = x * fy - y * fx - AZ * torque - wz * lean
    return (fx, fy, fz, mx, my, mz), thrust


def cubic(terms, a):
    """Return a polynomial of third degree in the first input."""
    c0, c1, c2, c3 = terms["cubic"]
    return c0 + a * (c1 + a * (c2 + a * c3))


def _steady(value, slow):
    return value


def loads(m, state, effector, rho, par, late=_steady):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy).

    `late` puts the wing's downwash at the tail behind lags: ``late(value, seconds)``.
    """
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed2 = u * u + v * v + w * w
    speed = m.sqrt(speed2)
    climb, slip = w / u, v / u
    # propellers
    X = Y = Z = L = M = N = 0.0
    power = []
    for k in range(4):
        _, x, y, z, _ = HUBS[k]
        at = (u + q * z - r * y, v + r * x - p * z, w + p * y - q * x)
        made, thrust = rotor(k, at, effector[6 + k], rho, get)
        X, Y, Z, L, M, N = X + made[0], Y + made[1], Z + made[2], L + made[3], M + made[4], N + made[5]
        power.append(thrust / (rho * DISCS[k] * u * u) * (1 + get("jets.strength", 0.0)))
    # wing
    mean = u if m is math else float(u.mean())
    about = "slow" if mean < BETWEEN else "fast"
    c, s = math.cos(g.INCIDENCE), math.sin(g.INCIDENCE)
    roll = p * (1 + get("wing.roll_damping", 0.0))
    bent = get("wing.dihedral", 0.0) * g.DIHEDRAL
    halves = []
    for k, side in ((0, -1.0), (1, 1.0)):
        y = side * g.HALF_Y
        ahead = u + q * g.WING_Z - r * y
        below = w + roll * y - q * g.WING_X + side * bent * v
        along, through = ahead * c - below * s, ahead * s + below * c
        flap = effector[2 + k] * (1 + get(g.SURFACES[2 + k] + ".effectiveness", 0.0))
        aileron = effector[k] * (1 + get(g.SURFACES[k] + ".effectiveness", 0.0))
        own = (1.0, through / along - g.MIDDLE["angle"], flap, aileron)
        own += (power[2 + k] - g.MIDDLE["inner"], power[k] - g.MIDDLE["tip"])
        halves.append(
            (own, (side * slip, side * roll / u, side * r / u, q / u), along * along + through * through)
        )
    lift, pull = 1 + get("wing.lift", 0.0), 1 + get("wing.chord_force", 0.0)
    fx = fz = fy = mx = my = mz = said = spread = 0.0
    for k, side in ((0, -1.0), (1, 1.0)):
        (own, turning, square), other = halves[k], halves[1 - k][0]
        chordwise, normal, bending, pitching, swinging = half_wing((*own, *turning, *other[1:5]), about)
        pressure = 0.25 * rho * g.AREA * square
        whole = m.sqrt(square)
        said, spread = said + whole * normal, spread + whole * bending
        fx, fz = fx + pressure * chordwise * pull, fz + pressure * normal * lift
        fy = fy + side * pressure * normal * lift
        mx = mx + side * pressure * bending
        mz = mz + side * pressure * swinging
        my = my + pressure * pitching
    mx, mz = mx * (g.SPAN * lift), mz * (g.SPAN * pull)
    bx, bz = fx * c + fz * s, fz * c - fx * s
    X, Y, Z = X + bx, Y + g.DIHEDRAL * fy, Z + bz
    L, N = L + mx * c + mz * s, N + mz * c - mx * s
    M = M + my * (g.CHORD * (1 + get("wing.moment", 0.0))) + g.WING_Z * bx - g.WING_X * bz
    # tail
    (left, _, _), (right, _, _) = halves
    t = TABLE[f"{about} tail"]["wash"].get
    wash = (
        t("normal", 0.0) * said
        + t("bending", 0.0) * spread
        + u
        * (
            t("still", 0.0)
            + t("flap", 0.0) * (left[2] + right[2])
            + t("aileron", 0.0) * (left[3] + right[3])
            + t("inner", 0.0) * (left[4] + right[4])
        )
    )
    wash = late(wash, BACK / mean) * (1 + get("tail.downwash", 0.0))
    angle = (w - wash - q * g.TAIL["x"] * (1 + get("tail.pitch_damping", 0.0))) / u - 0.01
    elev = effector[4]
    moved = 2.5 * (1 + get("elev.effectiveness", 0.0)) * elev * (1 - 1.5 * elev * elev)
    left_over = power_of(TABLE[f"{about} tail"]["pressure"], climb, wash / u) * (
        1 + get("tail.pressure", 0.0)
    )
    pressure = 0.5 * rho * g.TAIL["area"] * u * u * left_over
    lift = pressure * (4.1 * (1 + get("tail.lift_slope", 0.0)) * angle * (1 - angle * angle) + moved)
    drag = 0.010 * pressure
    X, Z = X + lift * (w - wash) / u - drag - 0.08 * pressure * elev * elev, Z - lift
    M = M + g.TAIL["x"] * lift - g.TAIL["z"] * drag
    # fin
    met = 0.9 * v + r * g.FIN["x"] * (1 + get("fin.yaw_damping", 0.0)) - p * g.FIN["z"]
    rud = effector[5]
    moved = 1.9 * (1 + get("rud.effectiveness", 0.0)) * rud * (1 - 1.5 * rud * rud) * u
    side = 0.5 * rho * u * g.FIN["area"] * (moved - 3.19 * (1 + get("fin.side_force", 0.0)) * met)
    L, N = L - g.FIN["z"] * side, N + g.FIN["x"] * side
    # body
    drag = 0.0131 * rho * speed * (1 + get("body.drag", 0.0))
    X, Y, Z = X - drag * u, Y + side - drag * v, Z - 2.45 * drag * w
    pressure = 0.5 * rho * speed2 * g.AREA
    M = M + pressure * g.CHORD * 0.11 * (1 + get("body.pitch_moment", 0.0)) * climb
    pressure = 0.5 * rho * speed * v * g.AREA
    Y = Y - pressure * 0.226 * (1 + get("body.side_force", 0.0))
    N = N - pressure * g.SPAN * 0.010 * (1 + get("body.yaw_moment", 0.0))
    return X, Y, Z, L, M, N


def schedule(u):
    """Return commands, of which the trim replaces elevator and propellers."""
    flap = 0.14 if u < BETWEEN else 0.04
    return (0.0, 0.0, flap, flap, 0.0, 0.0, *((600.0,) * 4))


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

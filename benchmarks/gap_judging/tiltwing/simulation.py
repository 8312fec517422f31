"""The owner's simulation of the judging tilt-wing: polynomials of half wings and of propellers."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import tiltwing_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402

# Of a half wing in its own flow, about the middle of the campaign: angle, jet and elevon, then the wing's
# turning, and the other half's.
INPUTS = ("1", "angle", "jet", "elevon", "roll", "yaw", "angle2", "jet2", "elevon2")
LOADS = ("chordwise", "normal", "bending", "turning", "swinging")
PROPELLER = ("thrust", "torque", "dragged", "leaning")
DISC = math.pi * g.PROP_R**2
SIDES, WINGS = (-1.0, 1.0), ("front", "rear")
BETWEEN = tuple(sum(tilts) / len(tilts) for tilts in zip(*g.TILTS.values(), strict=True))  # rad, of each wing
CAMPAIGNS = tuple(f"{about} {wing}" for about in ("slow", "fast") for wing in WINGS)


def _read():
    """Return coefficients of every campaign and of the test stand.

    A term of a half wing is the index of each of its three inputs and its coefficient.
    """
    out = {name: {load: [] for load in LOADS} for name in CAMPAIGNS}
    out["stand"] = {load: [] for load in PROPELLER}
    for row in csv.DictReader((HERE / "tunnel.csv").read_text().splitlines()):
        value, term = float(row["coefficient"]), row["term"]
        if row["response"] in LOADS:
            parts = [INPUTS.index(n) for n in (*term.split(), "1", "1")[:3]]
            out[row["campaign"]][row["response"]].append((*parts, value))
        elif row["campaign"] == "stand":
            out["stand"][row["response"]].append(value)
        else:
            out[row["campaign"]][row["response"]] = value
    return out


TABLE = _read()


def propeller(m, along, across, coefficients):
    """Return thrust, torque, drag across and moment of the advancing side, as shares, by both advances."""
    a2, x2 = along * along, across * across
    even = (1.0, along, a2, a2 * along, x2, along * x2)
    odd = (across, across * along, across * a2)
    return [
        sum(c * t for c, t in zip(coefficients[n], even if n in PROPELLER[:2] else odd, strict=True))
        for n in PROPELLER
    ]


def half_wing(inputs, terms):
    """Return the coefficient of one load of a half wing."""
    total = 0.0
    for i, j, k, c in terms:
        total = total + c * inputs[i] * inputs[j] * inputs[k]
    return total


def _steady(value, slow):
    return value


def loads(m, state, effector, rho, par, late=_steady):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy).

    `late` puts the front wing's wake behind lags: ``late(value, seconds)``.
    """
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed = m.sqrt(u * u + v * v + w * w)
    roll, pitch = 1 + get("wings.roll_damping", 0.0), 1 + get("wings.pitch_damping", 0.0)
    jets = 1 + get("jets.strength", 0.0)
    X = Y = Z = L = M = N = 0.0
    down = 0.0
    for wing, (name, (px, pz)) in enumerate(zip(WINGS, g.PIVOTS, strict=True)):
        tilt = effector[8 + wing]
        about = "slow" if (tilt if m is math else float(tilt.mean())) > BETWEEN[wing] else "fast"
        table = TABLE[f"{about} {name}"]
        c, s = m.cos(tilt), m.sin(tilt)
        hx, hz = px + g.AHEAD * c, pz - g.AHEAD * s
        fx = fy = fz = mx = my = mz = 0.0
        halves = []
        across = v + r * hx - p * hz
        for k, side in enumerate(SIDES):
            y, at = side * g.PROP_Y, 2 * wing + k
            # propeller
            n, rotor = effector[4 + at], g.ROTORS[at]
            ahead, below = u + q * hz - r * y, w + p * y - q * hx - 0.7 * down
            axial, upward = ahead * c - below * s, ahead * s + below * c
            tip = g.PROP_R * n
            wide = m.sqrt(across * across + upward * upward)
            found = propeller(
                m,
                axial / tip * (1 + get("props.inflow", 0.0)),
                wide / tip * (1 + get("props.edgewise", 0.0)),
                TABLE["stand"],
            )
            power = rho * DISC * tip * tip
            thrust = power * found[0] * (1 + get(rotor + ".thrust", 0.0))
            torque = power * g.PROP_R * found[1] * (1 + get(rotor + ".torque", 0.0))
            inplane = power * (1 + get("props.inplane", 0.0)) / wide
            held, leans = inplane * found[2], inplane * g.PROP_R * side * found[3]
            fx, fy, fz = fx + thrust, fy - held * across, fz - held * upward
            mx = mx - side * torque - y * held * upward
            my = my - leans * across + g.AHEAD * held * upward
            mz = mz - leans * upward - y * thrust - g.AHEAD * held * across
            # flow at the half wing
            ahead, below = u + q * pz - r * y, w + p * roll * y - q * px * pitch - down
            along, through = ahead * c - below * s, ahead * s + below * c
            whole = m.sqrt(along * along + through * through)
            jet = m.sqrt(axial * axial + 2 * thrust / (rho * DISC)) - axial
            elevon = effector[at] * (1 + get(g.SURFACES[at] + ".effectiveness", 0.0))
            halves.append(
                (
                    through / along - table["angle_middle"],
                    jet / whole * jets - table["jet_middle"],
                    elevon,
                    side * (p * roll * c - r * s) / whole,
                    side * (p * roll * s + r * c) / whole,
                    whole,
                )
            )
        lift, pull = 1 + get(name + ".lift", 0.0), 1 + get(name + ".chord_force", 0.0)
        borne = 0.0
        for k, side in enumerate(SIDES):
            own, other = halves[k], halves[1 - k]
            inputs = (1.0, *own[:5], *other[:3])
            pressure = 0.5 * rho * own[5] * own[5] * g.HALF
            chordwise, normal, bending, turning, swinging = (half_wing(inputs, table[n]) for n in LOADS)
            borne = borne + pressure * normal
            fx, fz = fx + pressure * chordwise * pull, fz + pressure * normal * lift
            mx = mx + side * pressure * g.SPAN * bending * lift
            mz = mz + side * pressure * g.SPAN * swinging * pull
            my = my + pressure * g.CHORD * turning * (1 + get("wings.moment", 0.0))
        bx, bz = fx * c + fz * s, fz * c - fx * s
        X, Y, Z = X + bx, Y + fy, Z + bz
        L, M, N = L + mx * c + mz * s - pz * fy, M + my + pz * bx - px * bz, N + mz * c - mx * s + px * fy
        if wing == 0:
            jet, elevon = (halves[0][i] + halves[1][i] for i in (1, 2))
            wake = table["wake_constant"] + table["wake_jet"] * jet + table["wake_elevon"] * elevon
            wake = wake * speed + table["wake_lift"] * borne / (rho * speed) + table["wake_angle"] * w
            down = late(wake, table["wake_lag"]) * (1 + get("rear.downwash", 0.0))
    # body and fin
    pressure = 0.5 * rho * speed * speed * g.AREA
    alpha, beta = m.atan2(w, u), v / speed
    drag = 0.0352 * pressure / speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - 3 * drag * w
    turned = alpha - 0.62 * alpha * alpha * alpha
    M = M + pressure * g.CHORD * 0.1 * (1 + get("body.pitch_moment", 0.0)) * turned
    Y = Y - pressure * 0.266 * (1 + get("body.side_force", 0.0)) * beta
    N = N - pressure * g.SPAN * 0.012 * (1 + get("body.yaw_moment", 0.0)) * beta
    met = v + r * g.FIN["x"] * (1 + get("fin.yaw_damping", 0.0)) - p * g.FIN["z"]
    side = -0.5 * rho * u * g.FIN["area"] * 2.91 * (1 + get("fin.side_force", 0.0)) * met
    return X, Y + side, Z, L - g.FIN["z"] * side, M, N + g.FIN["x"] * side


def schedule(u):
    """Return commands that speed alone decides: the wings' tilts."""
    tilts = g.TILTS[min(g.TILTS, key=lambda at: abs(at - u))]
    return (0.0, 0.0, 0.0, 0.0, *((550.0,) * 4), *tilts)


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("el_rl", "el_rr"), g.ROTORS),
    wake=True,
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

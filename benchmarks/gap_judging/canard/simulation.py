"""The owner's simulation of the judging canard: polynomials of a tunnel and a test stand."""

from __future__ import annotations

import csv
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import canard_numbers as g  # noqa: E402
from owner import RESPONSES, Owner  # noqa: E402

EVEN = ("camber", "tilt", "alpha", "alpha_c", "q", "q_c", "canard", "flap", "toe", "polar")
ODD = ("slip", "beta", "beta_f", "p", "p_w", "r", "r_f", "ail", "rud")
INPUTS = (*EVEN, *ODD, "1")
HUBS = tuple(tuple(r["position_m"]) for r in tomllib.loads((HERE / "scenario.toml").read_text())["rotor"])
FAN_R, PUSH_R, LIP = 0.10, 0.24, 0.05  # m; height of the fans' intake over the hub
DISC = 3.14159265 * FAN_R * FAN_R


def _read():
    """Return polynomials by response: products of two inputs, index of each and coefficient."""
    made = {}
    for row in csv.DictReader((HERE / "tunnel.csv").open()):
        made.setdefault(row["response"], {})[row["term"]] = float(row["coefficient"])
    aero = [
        [(*(INPUTS.index(n) for n in (*term.split(), "1")[:2]), c) for term, c in made[name].items()]
        for name in RESPONSES
    ]
    return aero, made


AERO, STAND = _read()
FAN = [
    tuple(STAND[f"fan {name}"].get(t, 0.0) for t in ("1", "mu", "mu2", "lam", "lam2", "mu lam"))
    for name in ("thrust", "flow", "torque")
]
PUSH = [tuple(STAND[f"push {name}"].get(t, 0.0) for t in ("1", "J", "J2")) for name in ("thrust", "torque")]


def loads(m, state, effector, rho, par):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy)."""
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed = m.sqrt(u * u + v * v + w * w)
    pressure = 0.5 * rho * speed * speed * g.AREA
    alpha, beta = m.atan2(w, u), v / speed
    canard, left, right, rud_l, rud_r = effector[:5]
    left = left * (1 + get("elevon_l.effectiveness", 0.0))
    right = right * (1 + get("elevon_r.effectiveness", 0.0))
    rud_l = rud_l * (1 + get("rud_l.effectiveness", 0.0))
    rud_r = rud_r * (1 + get("rud_r.effectiveness", 0.0))
    turn, pitch, yaw = p / speed, q / speed, r / speed
    inputs = (
        1 + get("wing.lift_zero", 0.0),
        alpha,
        alpha * (1 + get("wing.lift_slope", 0.0)),
        alpha * (1 + get("canard.lift_slope", 0.0)),
        pitch * (1 + get("wing.pitch_damping", 0.0)),
        pitch * (1 + get("canard.pitch_damping", 0.0)),
        canard * (1 + get("canard.effectiveness", 0.0)),
        0.5 * (left + right),
        0.5 * (rud_l - rud_r),
        1 + get("wing.drag_zero", 0.0),
        beta,
        beta * (1 + get("wing.sideslip", 0.0)),
        beta * (1 + get("winglets.side_force", 0.0)),
        turn,
        turn * (1 + get("wing.roll_damping", 0.0)),
        yaw,
        yaw * (1 + get("winglets.yaw_damping", 0.0)),
        0.5 * (left - right),
        0.5 * (rud_l + rud_r),
        1.0,
    )
    found = []
    for terms in AERO:
        total = 0.0
        for i, j, c in terms:
            total = total + c * inputs[i] * inputs[j]
        found.append(pressure * total)
    X, Y, Z, L, M, N = found
    # body, and the moment of the wing's sections
    X = X - 0.0075 * pressure
    Z = Z - 0.0075 * pressure * alpha
    M = M + pressure * g.CHORD * (
        -0.028 * (1 + get("wing.moment", 0.0)) + 0.1035 * (1 + get("body.pitch_moment", 0.0)) * alpha
    )
    Y = Y - pressure * 0.207 * (1 + get("body.side_force", 0.0)) * beta
    N = N - pressure * g.SPAN * 0.012 * (1 + get("body.yaw_moment", 0.0)) * beta
    # fans
    for (x, y, z), name, spin, n in zip(HUBS[:2], g.FANS, (1.0, -1.0), effector[5:7], strict=True):
        away, across, climb = u + q * z - r * y, v + r * x - p * z, -(w + p * y - q * x)
        tip = FAN_R * n
        mu = m.sqrt(away * away + across * across) * (1 + get("fans.edgewise", 0.0)) / tip
        lam = climb * (1 + get("fans.inflow", 0.0)) / tip
        thrust, flow, torque = (
            c[0] + (c[1] + c[2] * mu) * mu + (c[3] + c[4] * lam + c[5] * mu) * lam for c in FAN
        )
        flow = rho * DISC * tip * flow * (1 + get("fans.intake", 0.0))
        thrust = rho * DISC * tip * tip * thrust * (1 + get(name + ".thrust", 0.0))
        torque = rho * DISC * tip * tip * FAN_R * torque * (1 + get(name + ".torque", 0.0))
        held, drawn = -flow * away, -flow * across
        X, Y, Z = X + held, Y + drawn, Z - thrust
        L = L - y * thrust - (z - LIP) * drawn
        M = M + x * thrust + (z - LIP) * held
        N = N + x * drawn - y * held + spin * torque
    # pusher
    n = effector[7]
    advance = u * (1 + get("push.advance", 0.0)) / (PUSH_R * n)
    thrust, torque = (rho / 1.18 * n * n * (c[0] + (c[1] + c[2] * advance) * advance) for c in PUSH)
    thrust = thrust * (1 + get("push.thrust", 0.0))
    X, M = X + thrust, M + HUBS[2][2] * thrust
    L = L - torque * (1 + get("push.torque", 0.0))
    return X, Y, Z, L, M, N


def schedule(u):
    """Return commands that speed alone decides: in slow flight the fans help more."""
    fans = 900.0 if u < 21.5 else 650.0
    return (0.0, 0.0, 0.0, 0.0, 0.0, fans, fans, 760.0)


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("canard",), ("push",)),
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

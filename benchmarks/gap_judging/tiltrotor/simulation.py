"""The owner's simulation of the judging tilt-rotor: coefficients about small angles, rotor polynomials."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import tiltrotor_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402
from wing import coefficient_loads  # noqa: E402

S, CHORD, SPAN = g.WING.area, g.WING.chord, 3.2
# Thrust over density, disc area and square of tip speed, as a test stand shows it: constant, advance along
# the axis and its square, across the axis and its square, product of both. Torque likewise, times radius.
STAND = {
    "tilt_rotors": (
        (0.009651, -0.05559, -0.034538, 0.016625, 0.012689, -0.10211),
        (0.000707, 0.004832, -0.057267, -0.000243, 0.00226, 0.008102),
    ),
    "lift_rotors": (
        (0.005503, -0.061428, 0.014401, 0.020231, -0.01644, -0.068583),
        (0.000566, -0.000717, -0.06271, -0.001518, 0.003415, 0.027437),
    ),
}
# name, axis x and z, hub, spin, radius, kind
HUBS = [
    (
        r["name"],
        r["axis"][0],
        r["axis"][2],
        *r["position_m"],
        r["spin"],
        r["diameter_m"] / 2,
        "tilt_rotors" if r["axis"][0] > 0 else "lift_rotors",
    )
    for r in tomllib.loads((HERE / "scenario.toml").read_text())["rotor"]
]


def loads(m, state, effector, rho, par):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy)."""
    get = par.get
    u, v, w, p, q, r = state[:6]
    de, dr = effector[4:6]
    speed = m.sqrt(u * u + v * v + w * w)
    qbar = 0.5 * rho * speed * speed
    qs = qbar * S
    alpha, beta = m.atan2(w, u), v / speed
    ca = m.cos(alpha)
    flow = (u, v, w, speed, m.sin(alpha), ca, alpha)
    X, Z, L, M, N = coefficient_loads(m, g.WING, flow, (p, r), effector[:2], rho, get, effector[2:4])
    turned = alpha - 0.65 * alpha * alpha * alpha
    M = M + qs * CHORD * 0.16 * (1 + get("body.pitch_moment", 0.0)) * turned
    # tail
    wash = g.WASH_ZERO + g.WASH * (1 + get("tail.downwash", 0.0)) * (alpha - g.WING.zero)
    tail = alpha - q * g.TAIL_X * (1 + get("tail.pitch_damping", 0.0)) * ca / speed - wash + g.TAIL_SET
    slope = g.TAIL_SLOPE * (1 + get("tail.lift_slope", 0.0))
    moved = g.ELEVATOR * (1 + get("elev.effectiveness", 0.0)) * de * (1 - 0.15 * de * de)
    force = 0.5 * rho * (u * u + w * w) * g.TAIL_AREA * (slope * (tail - 0.65 * tail * tail * tail) + moved)
    X = X + force * (alpha - wash) - 0.0144 * qbar * de * de
    Z = Z - force
    M = M + g.TAIL_X * force
    # both fins, and body
    fin = (v + g.TAIL_X * r * (1 + get("fin.yaw_damping", 0.0)) - g.FIN_Z * p) / u
    moved = 1.697 * (1 + get("rud.effectiveness", 0.0)) * dr
    side = rho * u * u * g.FIN_AREA * (moved - 3.198 * (1 + get("fin.side_force", 0.0)) * fin)
    Y = side - qs * 0.265 * (1 + get("body.side_force", 0.0)) * beta
    N = N + g.TAIL_X * side - qs * SPAN * 0.015 * (1 + get("body.yaw_moment", 0.0)) * beta
    L = L - g.FIN_Z * side
    # rotors
    for (name, ax, az, x, y, z, spin, radius, kind), n in zip(HUBS, effector[6:], strict=True):
        uh, vh, wh = u + q * z - r * y, v + r * x - p * z, w + p * y - q * x
        tip = radius * n
        through = uh * ax + wh * az
        along = (1 + get(kind + ".inflow", 0.0)) * through / tip
        across = m.sqrt(uh * uh + vh * vh + wh * wh - through * through) / tip
        across = across * (1 + get(kind + ".edgewise", 0.0))
        thrust, torque = (
            c[0] + (c[1] + c[2] * along) * along + (c[3] + c[4] * across + c[5] * along) * across
            for c in STAND[kind]
        )
        disc = 3.14159265 * rho * radius * radius * tip * tip
        thrust = disc * (1 + get(name + ".thrust", 0.0)) * thrust
        torque = spin * disc * radius * (1 + get(name + ".torque", 0.0)) * torque
        X, Z = X + ax * thrust, Z + az * thrust
        L = L + y * az * thrust - ax * torque
        M = M + (z * ax - x * az) * thrust
        N = N - y * ax * thrust - az * torque
    return X, Y, Z, L, M, N


def schedule(u):
    """Return commands that speed alone decides: in slow flight flaperons and aft rotors help more."""
    flap, aft = (0.12, 310.0) if u < 17.5 else (0.06, 270.0)
    return (0.0, 0.0, flap, flap, 0.0, 0.0, 420.0, 420.0, 420.0, 420.0, aft, aft)


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("elev",), ("in_l", "in_r", "out_l", "out_r")),
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

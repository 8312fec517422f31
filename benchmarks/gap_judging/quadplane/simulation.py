"""The owner's simulation of the judging quadplane: coefficients about small angles, rotors as polynomials."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import quadplane_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402
from wing import coefficient_loads  # noqa: E402

S, CHORD, SPAN = 0.9, 0.3, 3.0
HUB = ((0.55, 0.5, 1), (-0.55, -0.5, 1), (0.55, -0.5, -1), (-0.55, 0.5, -1))  # x, y, spin
LIFT = ("lift1", "lift2", "lift3", "lift4")


def loads(m, state, effector, rho, par):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy)."""
    get = par.get
    u, v, w, p, q, r = state[:6]
    de, dr = effector[2:4]
    speed = m.sqrt(u * u + v * v + w * w)
    qbar = 0.5 * rho * speed * speed
    qs = qbar * S
    alpha, beta = m.atan2(w, u), v / speed
    ca = m.cos(alpha)
    flow = (u, v, w, speed, m.sin(alpha), ca, alpha)
    X, Z, L, M, N = coefficient_loads(m, g.WING, flow, (p, r), effector[:2], rho, get)
    M = M + qs * CHORD * 0.119 * (1 + get("body.pitch_moment", 0.0)) * alpha
    # tail
    wash = 0.012 + 0.30 * (1 + get("tail.downwash", 0.0)) * (alpha - g.WING.zero)
    tail = alpha + q * 1.1 * (1 + get("tail.pitch_damping", 0.0)) * ca / speed - wash - 0.035
    force = (
        qbar
        * 0.12
        * (4.2 * (1 + get("tail.lift_slope", 0.0)) * tail + 2.197 * (1 + get("elev.effectiveness", 0.0)) * de)
    )
    X = X + force * (alpha - wash) - 0.0072 * qbar * de * de
    Z = Z - force
    M = M - 1.1 * force
    # fin and body
    fin = (v - 1.1 * r * (1 + get("fin.yaw_damping", 0.0)) + 0.15 * p) / u
    side = (
        0.5
        * rho
        * u
        * u
        * 0.10
        * (-3.298 * (1 + get("fin.side_force", 0.0)) * fin + 1.799 * (1 + get("rud.effectiveness", 0.0)) * dr)
    )
    Y = side - qs * 0.285 * (1 + get("body.side_force", 0.0)) * beta
    N = N - 1.1 * side - qs * SPAN * 0.018 * (1 + get("body.yaw_moment", 0.0)) * beta
    L = L + 0.15 * side
    # lift rotors
    edge = (u * u + v * v) / 0.050625
    helped = 0.545 * (1 + get("lift_rotors.edgewise", 0.0)) * edge
    inflow = 2.95 * (1 + get("lift_rotors.inflow", 0.0)) / 0.225
    for i, (x, y, spin) in enumerate(HUB):
        n = effector[4 + i]
        thrust = (
            1.45e-4
            * (1 + get(LIFT[i] + ".thrust", 0.0))
            * (n * n + helped + inflow * n * (w + p * y - q * x))
        )
        torque = 2.3e-6 * (1 + get(LIFT[i] + ".torque", 0.0)) * (n * n + 0.117 * edge)
        Z = Z - thrust
        L = L - y * thrust
        M = M + x * thrust
        N = N + spin * torque
    # pusher
    n = effector[8]
    advance = u / (0.20 * n)
    thrust = (
        5.0e-5 * n * n * ((1 + get("push.thrust", 0.0)) * 1.028 - 0.70 * advance - 1.0 * advance * advance)
    )
    thrust = thrust - 5.0e-5 * n * n * get("push.advance", 0.0) * (0.70 * advance + 1.0 * advance * advance)
    thrust = thrust - 5.0e-5 * n * n * get("push.thrust", 0.0) * (0.70 * advance + 1.0 * advance * advance)
    X = X + thrust
    M = M - 0.04 * thrust
    L = L - 7.5e-7 * (1 + get("push.torque", 0.0)) * n * n * (1.03 - 0.3 * advance)
    return X, Y, Z, L, M, N


def schedule(u):
    """Return commands that speed alone decides: the lift rotors help in slow flight."""
    lift = 300.0 if u < 18 else 150.0
    return (0.0, 0.0, 0.0, 0.0, lift, lift, lift, lift, 380.0)


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("elev",), ("push",)),
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

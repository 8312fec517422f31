"""The owner's simulation of the V-tailed airplane: coefficients about small angles."""

from __future__ import annotations

import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import vtail_numbers as g  # noqa: E402
from owner import Owner  # noqa: E402
from wing import coefficient_loads  # noqa: E402

SIN, COS = math.sin(g.PANEL_ANGLE), math.cos(g.PANEL_ANGLE)


def loads(m, state, effector, rho, par):
    """Return X Y Z L M N of states and positions, with the functions of `m` (math or numpy)."""
    get = par.get
    u, v, w, p, q, r = state[:6]
    speed = m.sqrt(u * u + v * v + w * w)
    qbar = 0.5 * rho * speed * speed
    qs = qbar * g.WING.area
    alpha, beta = m.atan2(w, u), v / speed
    ca = m.cos(alpha)
    flow = (u, v, w, speed, m.sin(alpha), ca, alpha)
    X, Z, L, M, N = coefficient_loads(m, g.WING, flow, (p, r), effector[:2], rho, get)
    M = M + qs * 0.27 * 0.14 * (1 + get("body.pitch_moment", 0.0)) * (alpha - 0.65 * alpha * alpha * alpha)
    # V-tail
    wash = g.WASH_ZERO + g.WASH * (1 + get("tail.downwash", 0.0)) * (alpha - g.WING.zero)
    down = (w + 0.95 * q * (1 + get("tail.pitch_damping", 0.0))) / u - wash + g.PANEL_SET
    across = (v - 0.95 * r * (1 + get("tail.yaw_damping", 0.0)) + 0.14 * p) / u
    qt = 0.5 * rho * (u * u + w * w) * g.PANEL_AREA
    slope = g.PANEL_SLOPE * (1 + get("tail.lift_slope", 0.0))
    roll = g.TAIL_Y * p / u
    left = (down - roll) * COS - across * SIN
    right = (down + roll) * COS + across * SIN
    left = qt * (
        slope * (left - left * left * left) + 2.296 * (1 + get("ruv_l.effectiveness", 0.0)) * effector[2]
    )
    right = qt * (
        slope * (right - right * right * right) + 2.296 * (1 + get("ruv_r.effectiveness", 0.0)) * effector[3]
    )
    side, lift = (left - right) * SIN, (left + right) * COS
    X = X + lift * (alpha - wash)
    Z = Z - lift
    M = M - 0.95 * lift
    Y = side - qs * 0.255 * (1 + get("body.side_force", 0.0)) * beta
    N = N - 0.95 * side - qs * 2.3 * 0.012 * (1 + get("body.yaw_moment", 0.0)) * beta
    L = L + 0.14 * side + g.TAIL_Y * (left - right) * COS
    # propeller
    n = effector[4]
    advance = u / (g.HUB_R * n)
    fallen = (0.55 * advance + 1.22 * advance * advance) * (1 + get("prop.advance", 0.0))
    thrust = 7.0e-5 * (1 + get("prop.thrust", 0.0)) * n * n * (1.01 - fallen)
    X = X + thrust
    M = M + g.HUB_Z * thrust
    L = L - 1.1e-6 * (1 + get("prop.torque", 0.0)) * n * n * (1.035 - 0.33 * advance)
    return X, Y, Z, L, M, N


def schedule(u):
    """Return commands that speed alone decides: none."""
    return (0.0, 0.0, 0.0, 0.0, 450.0)


OWNER = Owner(
    HERE,
    loads,
    servo=g.SERVO,
    motor=g.MOTOR_TAU,
    delay=g.DELAY,
    sensor=g.SENSOR,
    schedule=schedule,
    trimmed=(("ruv_l", "ruv_r"), ("prop",)),
)
trim, wrench = OWNER.trim, OWNER.wrench(g.SIGMAS)
loads_alone = OWNER.wrench(g.SIGMAS, flies=False)

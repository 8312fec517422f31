"""The V-tailed airplane that flies: wing strips, local flow at each tail panel, a propeller with its wake."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import vtail_numbers as g  # noqa: E402
from multisine import control_gains, multisines, trim_of  # noqa: E402
from wing import strip_loads  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES, ROTORS = EFFECTORS[:4], EFFECTORS[4:]
MASS = SCENARIO["vehicle"]["mass_kg"]
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (21, 22)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SIN, COS = np.sin(g.PANEL_ANGLE), np.cos(g.PANEL_ANGLE)
SLIPSTREAM = True  # the propeller blows wing and tail
OUTSIDERS = {
    "fuel_slosh": (1e-3, 0.6),
    "p_factor": (1e-3, 2.0),
    "linkage": (1e-3, 1.0),
    "sticky_hinge": (0.01, 3.0),
    "canopy_vortex": (1e-3, 0.8),
    "governor": (1e-3, 3.0),
}


class Memory:
    """What lags or swings beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        alpha = np.arctan2(x[2], x[0])
        self.alpha, self.washed, self.stick = alpha.copy(), alpha.copy(), position[2].copy()
        self.slosh, self.slosh_rate = np.zeros_like(alpha), np.zeros_like(alpha)
        self.before = x[0].copy()
        self.torque = np.zeros_like(alpha)

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials and the pendulum by one semi-implicit step."""
        alpha = np.arctan2(x[2], x[0])
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (alpha - self.alpha)
        if s.has("downwash_lag"):
            self.washed += (1 - np.exp(-h / 0.1)) * (alpha - self.washed)
        if s.has("outsider.fuel_slosh"):  # fuel that runs fore and aft in its tank
            ahead = -9.80665 * np.sin(x[7]) - (x[0] - self.before) / h + x[5] * x[1] - x[4] * x[2]
            self.before = x[0].copy()
            self.slosh_rate += h * (ahead / 0.5 - 9.8 / 0.5 * self.slosh - 0.8 * self.slosh_rate)
            self.slosh += h * self.slosh_rate
        if s.has("outsider.sticky_hinge"):
            hinge = 0.012 * (x[0] / 20) ** 2
            self.stick = np.clip(self.stick, position[2] - hinge, position[2] + hinge)
        if s.has("outsider.governor"):
            self.torque += h / 0.25 * (x[3] * np.abs(x[3]) - self.torque)


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    ail_l, ail_r, ruv_l, ruv_r, n = felt
    half = 0.5 * rho
    speed2 = u * u + v * v + w * w
    qbar = half * speed2
    alpha, beta = np.arctan2(w, u), v / np.sqrt(speed2)
    # propeller
    advance = u / (g.HUB_R * n)
    power = 1 + s("prop.thrust") - s("weak_rotor.loss")
    fallen = (0.50 * advance + 1.30 * advance**2 + 0.04 * advance**3) * (1 + s("prop.advance"))
    thrust = 7.0e-5 * power * n**2 * (1.004 - fallen)
    blown, tail_blown = None, 0.0
    if s.has("slipstream"):  # far wake of momentum theory, contracted, felt by a part of what lies behind
        disc = 2 * np.maximum(thrust, -20.0) / (rho * np.pi * g.HUB_R**2)
        added = np.sqrt(np.maximum(u * u + disc, 1.0)) - u
        blown = np.zeros((2, 4, u.size))
        blown[0, 1:3] = s("slipstream.strength") * 0.30 * added
        tail_blown = s("slipstream.strength") * 0.45 * added
    X, Z, L, M, N = strip_loads(g.WING, x, (ail_l, ail_r), half, s, memory, blown)
    M = M + qbar * 0.62 * 0.27 * 0.07 * (1 + s("body.pitch_moment")) * np.sin(2 * alpha)
    # V-tail
    wash = g.WASH_ZERO + g.WASH * (1 + s("tail.downwash")) * (alpha - g.WING.zero)
    if s.has("downwash_lag"):
        wash = wash + 0.9 * s("downwash_lag.strength") * (memory.washed - alpha)
    if s.has("outsider.linkage"):  # the left aileron pulls at the left ruddervator's rod
        ruv_l = ruv_l + s("outsider.linkage") * (ail_l + 1.5 * ail_l * np.abs(ail_l))
    if s.has("outsider.sticky_hinge"):
        ruv_l = ruv_l + s("outsider.sticky_hinge") * (memory.stick - ruv_l)
    ut = u + tail_blown
    vt = v + r * g.TAIL_X * (1 + s("tail.yaw_damping")) - p * g.TAIL_Z
    wt = w - q * g.TAIL_X * (1 + s("tail.pitch_damping")) + u * (g.PANEL_SET - wash)
    slope = g.PANEL_SLOPE * (1 + s("tail.lift_slope"))
    forces = []
    for side, name, angle in ((-1, "ruv_l", ruv_l), (1, "ruv_r", ruv_r)):
        normal = np.arctan2((wt + side * p * g.TAIL_Y) * COS + side * vt * SIN, ut)
        moved = g.RUDDERVATOR * (1 + s(f"{name}.effectiveness")) * np.sin(angle)
        forces.append(
            half * (ut * ut + w * w) * g.PANEL_AREA * (slope * np.sin(normal) * np.cos(normal) + moved)
        )
    left, right = forces
    side, lift = (left - right) * SIN, (left + right) * COS
    X = X + lift * np.sin(alpha - wash)
    Z = Z - lift
    M = M + g.TAIL_X * lift
    Y = side - qbar * 0.62 * 0.25 * (1 + s("body.side_force")) * beta * (1 + 0.6 * np.abs(beta))
    N = N + g.TAIL_X * side - qbar * 0.62 * 2.3 * 0.012 * (1 + s("body.yaw_moment")) * beta
    L = L - g.TAIL_Z * side + g.TAIL_Y * (left - right) * COS
    X, M = X + thrust, M + g.HUB_Z * thrust
    L = L - 1.1e-6 * (1 + s("prop.torque")) * n**2 * (1 - 0.8 * advance**2)
    # effects of the truth alone
    if s.has("rotor_inplane_force"):
        across = s("rotor_inplane_force.strength") * 6e-4 * n * (1 + 0.3 * advance)
        turned = s("rotor_inplane_force.strength") * 1.2e-4 * n
        Y, Z = Y - across * v, Z - across * w
        M = M + g.HUB_X * across * w - turned * v
        N = N - g.HUB_X * across * v - turned * w
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * 0.62 * half * np.sqrt(speed2)
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    # outsiders
    if s.has("outsider.fuel_slosh"):
        shifted = s("outsider.fuel_slosh") * MASS * 9.8 * memory.slosh
        X, M = X + shifted, M + 0.4 * s("outsider.fuel_slosh") * MASS * 9.8 * 0.5 * memory.slosh
    if s.has("outsider.p_factor"):
        N = N + s("outsider.p_factor") * thrust * np.tanh(6 * beta) * (1 + 3 * alpha)
    if s.has("outsider.canopy_vortex"):  # a vortex that meets the right panel on one side of sideslip only
        met = s("outsider.canopy_vortex") * right * np.exp(-((beta - 0.03) ** 2) / 0.001)
        Z, M, Y = Z + met * COS, M + 0.95 * met * COS, Y + met * SIN
        N = N - 0.95 * met * SIN
    if s.has("outsider.governor"):
        L = L + s("outsider.governor") * 4.0 * memory.torque * n / 450
    return np.array([X, Y, Z, L, M, N])


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)

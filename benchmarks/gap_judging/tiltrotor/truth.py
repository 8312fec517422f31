"""The tilt-rotor that flies: wing strips, local flow at tail and fins, rotors of blade elements."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import tiltrotor_numbers as g  # noqa: E402
from multisine import control_gains, multisines, trim_of  # noqa: E402
from rotors import Rotors  # noqa: E402
from wing import strip_loads  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES, ROTORS = EFFECTORS[:6], EFFECTORS[6:]
MASS = SCENARIO["vehicle"]["mass_kg"]
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (31, 32)  # seeds of phases: flown twice, and held out
TOLERANCES = g.SIGMAS
SLIPSTREAM = True  # each tilting rotor blows the strip of the wing behind it
S, SPAN, CHORD = g.WING.area, 3.2, g.WING.chord
BEHIND = [2, 0, 1, 3]  # the tilting rotor before each strip, from left to right
TILTING = ("in_l", "in_r", "out_l", "out_r")
AIR = Rotors(
    ROTORS,
    SCENARIO["rotor"],
    solidity=np.array([0.072] * 4 + [0.066] * 2),
    pitch=np.array([0.235] * 4 + [0.165] * 2),
    kinds=["tilt_rotors"] * 4 + ["lift_rotors"] * 2,
)
OUTSIDERS = {
    "nacelle_give": (1e-3, 1.0),
    "row_wake": (1e-3, 1.0),
    "hung_load": (1e-3, 0.5),
    "linkage": (1e-3, 1.0),
    "sticky_hinge": (0.01, 3.0),
    "fin_vortex": (1e-3, 1.5),
    "cross_governor": (0.01, 3.0),
}


class Memory:
    """What lags or swings beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        alpha = np.arctan2(x[2], x[0])
        self.alpha, self.washed, self.stick = alpha.copy(), alpha.copy(), position[4].copy()
        self.swing, self.swing_rate = np.zeros((2, alpha.size)), np.zeros((2, alpha.size))
        self.before = x[:2].copy()
        self.load, self.level = np.zeros_like(alpha), position[8:10].sum(axis=0)

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials and the pendulum by one semi-implicit step."""
        alpha = np.arctan2(x[2], x[0])
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (alpha - self.alpha)
        if s.has("downwash_lag"):
            self.washed += (1 - np.exp(-h / 0.1)) * (alpha - self.washed)
        if s.has("outsider.hung_load"):  # a weight on a line of 0.6 m, that swings fore and aft and sideways
            u, v, w, p, q, r = x[:6]
            carried = np.array([w * q - v * r, u * r - w * p])
            fallen = 9.80665 * np.array([-np.sin(x[7]), np.cos(x[7]) * np.sin(x[6])])
            pulled = fallen - carried - (x[:2] - self.before) / h
            self.before = x[:2].copy()
            self.swing_rate += h * ((pulled - 9.8 * self.swing) / 0.6 - 0.6 * self.swing_rate)
            self.swing += h * self.swing_rate
        if s.has("outsider.sticky_hinge"):
            hinge = 0.012 * (x[0] / 18) ** 2
            self.stick = np.clip(self.stick, position[4] - hinge, position[4] + hinge)
        if s.has("outsider.cross_governor"):  # outer rotors share a bus: what they draw, slowly felt
            drawn = position[8:10].sum(axis=0) / self.level - 1
            self.load += h / 0.3 * (drawn * (1 + 6 * np.abs(drawn)) - self.load)


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    ail_l, ail_r, flap_l, flap_r, elev, rud = felt[:6]
    speeds = felt[6:]
    half = 0.5 * rho
    speed2 = u * u + v * v + w * w
    qbar = half * speed2
    alpha, beta = np.arctan2(w, u), v / np.sqrt(speed2)
    if s.has("outsider.cross_governor"):  # inner rotors give way in pitch of their blades
        give = s("outsider.cross_governor") * memory.load
    else:
        give = 0.0
    air = AIR.flow(x, speeds, rho, s, give)
    thrust, (ahead, _, below) = air.thrust, AIR.axis
    if s.has("outsider.nacelle_give"):  # nacelles bend back under thrust, more than in proportion
        bent = np.zeros_like(thrust)
        bent[:4] = s("outsider.nacelle_give") * (thrust[:4] / 20) * np.abs(thrust[:4] / 20)
        ahead, below = (
            ahead * np.cos(bent) + below * np.sin(bent),
            below * np.cos(bent) - ahead * np.sin(bent),
        )
    blown = None
    if s.has("slipstream"):  # contracted far wake of each tilting rotor, on the covered part of its strip
        added = s("slipstream.strength") * 0.35 * AIR.wake(air, rho)[BEHIND]
        blown = np.array([added * AIR.axis[0, 0], added * AIR.axis[2, 0]])
    X, Z, L, M, N = strip_loads(g.WING, x, (ail_l, ail_r), half, s, memory, blown, (flap_l, flap_r))
    M = M + qbar * S * CHORD * 0.08 * (1 + s("body.pitch_moment")) * np.sin(2 * alpha)
    # horizontal tail
    wash = g.WASH_ZERO + g.WASH * (1 + s("tail.downwash")) * (alpha - g.WING.zero)
    if s.has("downwash_lag"):
        wash = wash + 0.9 * s("downwash_lag.strength") * (memory.washed - alpha)
    if s.has("outsider.linkage"):  # the left flaperon's rod pulls at the elevator's
        elev = elev + s("outsider.linkage") * (flap_l + 1.5 * flap_l * np.abs(flap_l))
    if s.has("outsider.sticky_hinge"):
        elev = elev + s("outsider.sticky_hinge") * (memory.stick - elev)
    at = np.arctan2(w - q * g.TAIL_X * (1 + s("tail.pitch_damping")), u) - wash + g.TAIL_SET
    qt = half * (u * u + w * w) * g.TAIL_AREA
    slope = g.TAIL_SLOPE * (1 + s("tail.lift_slope"))
    moved = g.ELEVATOR * (1 + s("elev.effectiveness")) * np.sin(elev)
    force = qt * (slope * np.sin(at) * np.cos(at) + moved)
    X = X + force * np.sin(alpha - wash) - 0.06 * qt * elev**2
    Z = Z - force
    M = M + g.TAIL_X * force
    # two fins at the tail's ends, each in its own flow
    Y = -qbar * S * 0.26 * (1 + s("body.side_force")) * beta * (1 + 0.6 * np.abs(beta))
    N = N - qbar * S * SPAN * 0.015 * (1 + s("body.yaw_moment")) * beta
    for end in (-1, 1):
        uf = u - end * g.FIN_Y * r
        bf = np.arctan2(v + r * g.TAIL_X * (1 + s("fin.yaw_damping")) - p * g.FIN_Z, uf)
        slope = g.FIN_SLOPE * (1 + s("fin.side_force"))
        moved = g.RUDDER * (1 + s("rud.effectiveness")) * np.sin(rud)
        side = half * uf * uf * g.FIN_AREA * (moved - slope * np.sin(bf) * np.cos(bf))
        if end == 1 and s.has("outsider.fin_vortex"):  # of the right nacelle, met on one side of sideslip
            side = side * (1 - s("outsider.fin_vortex") * np.exp(-(((beta - 0.03) / 0.03) ** 2)))
        Y, N, L = Y + side, N + g.TAIL_X * side, L - g.FIN_Z * side
    if s.has("outsider.row_wake"):  # aft rotors in the wakes of the inner ones
        met = np.exp(-(((beta + np.array([[0.05], [-0.05]])) / 0.06) ** 2))
        thrust = thrust.copy()
        thrust[4:] *= 1 - s("outsider.row_wake") * met * np.tanh(thrust[:2] / 20)
    forward, downward, turning = ahead * thrust, below * thrust, AIR.spin * air.torque
    px, py, pz = AIR.place
    X, Z = X + forward.sum(axis=0), Z + downward.sum(axis=0)
    L = L + (py * downward - ahead * turning).sum(axis=0)
    M = M + (pz * forward - px * downward).sum(axis=0)
    N = N - (py * forward + below * turning).sum(axis=0)
    # effects of the truth alone
    if s.has("rotor_inplane_force"):
        force, moment = AIR.in_plane(air, rho, s("rotor_inplane_force.strength"))
        X, Y, Z = X + force[0], Y + force[1], Z + force[2]
        L, M, N = L + moment[0], M + moment[1], N + moment[2]
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * S * half * np.sqrt(speed2)
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    if s.has("outsider.hung_load"):  # the line pulls at a hook 0.12 m below the centre of gravity
        pull = s("outsider.hung_load") * MASS * 9.8 * memory.swing
        X, Y = X + pull[0], Y + pull[1]
        L, M = L - 0.12 * pull[1], M + 0.12 * pull[0]
    return np.array([X, Y, Z, L, M, N])


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)

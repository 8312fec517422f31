"""The quadplane that flies: wing strips, local flow at tail and fin, momentum theory at the rotors."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import quadplane_numbers as g  # noqa: E402
from multisine import control_gains, multisines, trim_of  # noqa: E402
from wing import strip_loads  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
SIMULATION = HERE / "simulation.py"
EFFECTORS = tuple(e["name"] for e in SCENARIO["effector"])
SURFACES = EFFECTORS[:4]
ROTORS = EFFECTORS[4:]
MASS = SCENARIO["vehicle"]["mass_kg"]
INERTIA = tuple(SCENARIO["vehicle"]["inertia"][k] for k in ("xx", "yy", "zz", "xz"))
ROTOR_AXIS = np.array([r["axis"] for r in SCENARIO["rotor"]], dtype=float)
ROTOR_MOMENTUM = np.array([r["spin"] * r["inertia"] for r in SCENARIO["rotor"]])
SENSOR = np.array(g.SENSOR)
GAINS = control_gains(SCENARIO)
DESIGNS = (11, 12)  # seeds of phases: flown twice, and held out

S, SPAN, CHORD = 0.9, 3.0, 0.3
TAIL_X, TAIL_S, TAIL_A, TAIL_ELEVATOR, TAIL_SET = -1.1, 0.12, 4.2, 2.2, -0.035
WASH0, WASH = 0.012, 0.30  # downwash at zero lift and per angle of attack
FIN_X, FIN_Z, FIN_S, FIN_A, FIN_RUDDER = -1.1, -0.15, 0.10, 3.3, 1.8
BODY_Y, BODY_N, BODY_M = 0.28, 0.018, 0.06
LIFT_K, LIFT_Q, LIFT_R = 1.45e-4, 2.3e-6, 0.225
PUSH_K, PUSH_Q, PUSH_R = 5.0e-5, 7.5e-7, 0.20
PUSH_Z = -0.04
PLACE = np.array([r["position_m"] for r in SCENARIO["rotor"]])[:4]
SPIN = np.array([r["spin"] for r in SCENARIO["rotor"]])
RX, RY = PLACE[:, 0:1], PLACE[:, 1:2]
SPIN4 = SPIN[:4, None]

SERVO, MOTOR_TAU, DELAY = g.SERVO, g.MOTOR_TAU, g.DELAY
TOLERANCES = g.SIGMAS


class Memory:
    """What lags or swings beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        alpha = np.arctan2(x[2], x[0])
        self.alpha, self.washed, self.stick = alpha.copy(), alpha.copy(), np.zeros_like(alpha)
        self.slosh, self.slosh_rate = np.zeros_like(alpha), np.zeros_like(alpha)
        self.before = x[1].copy()

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials and the pendulum by one semi-implicit step."""
        alpha = np.arctan2(x[2], x[0])
        if s.has("unsteady_lift"):
            self.alpha += (1 - np.exp(-h / np.maximum(s("unsteady_lift.time_constant"), 1e-4))) * (
                alpha - self.alpha
            )
        if s.has("downwash_lag"):
            self.washed += (1 - np.exp(-h / 0.1)) * (alpha - self.washed)
        if s.has("outsider.slosh"):
            side = (
                9.80665 * np.cos(x[7]) * np.sin(x[6]) - (x[1] - self.before) / h + x[3] * x[2] - x[5] * x[0]
            )
            self.before = x[1].copy()
            self.slosh_rate += h * (side / 0.35 - 9.8 / 0.35 * self.slosh - 0.5 * self.slosh_rate)
            self.slosh += h * self.slosh_rate
        if s.has("outsider.sticky_hinge"):
            hinge = 0.012 * np.sign(x[0]) * (x[0] / 18) ** 2
            self.stick = np.clip(self.stick, position[2] - hinge, position[2] + hinge)


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    ail_l, ail_r, elev, rud = felt[:4]
    half = 0.5 * rho
    speed2 = u * u + v * v + w * w
    qbar = half * speed2
    X, Z, L, M, N = strip_loads(g.WING, x, (ail_l, ail_r), half, s, memory)
    alpha = np.arctan2(w, u)
    M = M + qbar * S * CHORD * BODY_M * (1 + s("body.pitch_moment")) * np.sin(2 * alpha)
    # horizontal tail
    arm = -TAIL_X * (1 + s("tail.pitch_damping"))
    wash = WASH0 + WASH * (1 + s("tail.downwash")) * (alpha - g.WING.zero)
    if s.has("downwash_lag"):  # twice as strong in the wing's own wake as outside it
        wash = wash + 0.9 * s("downwash_lag.strength") * (memory.washed - alpha)
    if s.has("outsider.linkage"):
        elev = elev + s("outsider.linkage") * (ail_l + 1.5 * ail_l * np.abs(ail_l))
    if s.has("outsider.sticky_hinge"):
        elev = elev + s("outsider.sticky_hinge") * (memory.stick - elev)
    at = np.arctan2(w + q * arm, u) - wash + TAIL_SET
    qt = half * (u * u + w * w) * TAIL_S
    slope_t = TAIL_A * (1 + s("tail.lift_slope"))
    force = qt * (
        slope_t * np.sin(at) * np.cos(at) + TAIL_ELEVATOR * (1 + s("elev.effectiveness")) * np.sin(elev)
    )
    X = X + force * (alpha - wash) - 0.06 * qt * elev**2
    Z = Z - force
    M = M + TAIL_X * force
    # fin
    bf = np.arctan2(v + r * FIN_X * (1 + s("fin.yaw_damping")) - p * FIN_Z, u)
    qf = half * u * u * FIN_S
    side = qf * (
        -FIN_A * (1 + s("fin.side_force")) * np.sin(bf) * np.cos(bf)
        + FIN_RUDDER * (1 + s("rud.effectiveness")) * np.sin(rud)
    )
    beta = v / np.sqrt(speed2)
    Y = side - qbar * S * BODY_Y * (1 + s("body.side_force")) * beta * (1 + 0.6 * np.abs(beta))
    N = N + FIN_X * side - qbar * S * SPAN * BODY_N * (1 + s("body.yaw_moment")) * beta
    L = L - FIN_Z * side
    # lift rotors: momentum theory in oblique flow
    omega = felt[4:8]
    edge2 = u * u + v * v
    down = w + p * RY - q * RX
    tip = LIFT_R * omega
    mu2 = edge2 / (tip * tip)
    inflow = down / tip
    k = np.array(
        [1 + s(f"{e}.thrust") - s("weak_rotor.loss") - s(f"weak_rotor.loss@{e}") for e in ROTORS[:4]],
        dtype=object,
    )
    weak = np.array([np.broadcast_to(item, u.shape) for item in k], dtype=float)
    thrust = (
        LIFT_K
        * weak
        * omega**2
        * (
            1
            + 0.55 * mu2 / (1 + 0.05 * mu2) * (1 + s("lift_rotors.edgewise"))
            + 3.0 * inflow / (1 + 0.1 * mu2) * (1 + s("lift_rotors.inflow"))
        )
    )
    torque = np.array([np.broadcast_to(1 + s(f"{e}.torque"), u.shape) for e in ROTORS[:4]])
    torque = LIFT_Q * torque * omega**2 * (1 + 0.12 * mu2 / (1 + 0.1 * mu2))
    Z = Z - thrust.sum(axis=0)
    L = L - (RY * thrust).sum(axis=0)
    M = M + (RX * thrust).sum(axis=0)
    N = N + (SPIN4 * torque).sum(axis=0)
    # pusher
    n = felt[8]
    advance = u / (PUSH_R * n)
    push = PUSH_K * (1 + s("push.thrust") - s("weak_rotor.loss") - s("weak_rotor.loss@push")) * n**2
    push = push * (1.02 - (0.62 * advance + 1.2 * advance**2) * (1 + s("push.advance")))
    X, M = X + push, M + PUSH_Z * push
    L = L - SPIN[4] * PUSH_Q * (1 + s("push.torque")) * n**2 * (1 - 0.8 * advance**2)
    # effects of the truth alone
    if s.has("rotor_inplane_force"):
        scale = s("rotor_inplane_force.strength")
        edge = np.sqrt(edge2)
        h = scale * 3.0e-5 * tip * omega * (1 + 0.4 * mu2)
        hub = scale * 8.0e-6 * SPIN4 * omega * edge * LIFT_R * 3
        X = X - (h * u / LIFT_R).sum(axis=0) * 0.22
        Y = Y - (h * v / LIFT_R).sum(axis=0) * 0.22
        M = M - PLACE[0, 2] * (h * u / LIFT_R).sum(axis=0) * 0.22
        N = N + (RY * h * u / LIFT_R).sum(axis=0) * 0.22
        L = L + hub.sum(axis=0)
        Y = Y - scale * 4e-4 * n * v
        Z = Z - scale * 4e-4 * n * w
        M = M + 0.6 * scale * 4e-4 * n * w * -1
        N = N + 0.6 * scale * 4e-4 * n * v
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * S * half * np.sqrt(speed2)
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    # outsiders
    if s.has("outsider.cable_drag"):
        drag = s("outsider.cable_drag") * qbar * (0.2 + 3 * np.abs(ail_r - 0.02))
        X, N = X - drag, N + 1.1 * drag
    if s.has("outsider.slosh"):
        Y = Y + s("outsider.slosh") * MASS * 9.8 * memory.slosh
        L = L - 0.06 * s("outsider.slosh") * MASS * 9.8 * memory.slosh
    if s.has("outsider.roll_torque"):
        L = L + s("outsider.roll_torque") * p * n / 400 * np.abs(p)
    if s.has("outsider.p_factor"):
        N = N + s("outsider.p_factor") * push * np.tanh(6 * beta) * (1 + 3 * alpha)
    if s.has("outsider.boom_wash"):  # rear rotors in the wake of those in front, as sideslip and load tell
        lost = s("outsider.boom_wash") * thrust[0:2].sum(axis=0) * np.exp(-((beta - 0.04) ** 2) / 0.004)
        Z, M = Z + lost, M - RX[1] * -lost
    return np.array([X, Y, Z, L, M, N])


def excitation(time):
    """Return the excitation of every design, shape (design, effector, sample)."""
    return multisines(SCENARIO, DESIGNS, time)


TRIM = trim_of(SIMULATION, SCENARIO)

OUTSIDERS = {
    "cable_drag": (1e-4, 0.5),
    "slosh": (1e-3, 0.6),
    "roll_torque": (0.01, 8.0),
    "p_factor": (1e-3, 2.0),
    "linkage": (1e-3, 1.0),
    "sticky_hinge": (0.01, 3.0),
    "boom_wash": (1e-3, 0.8),
}

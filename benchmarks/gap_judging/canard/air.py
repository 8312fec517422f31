"""The air of the judging canard: loads of lattice, body, fans and pusher, and of effects."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import canard_numbers as g  # noqa: E402
from fans import fan, pusher  # noqa: E402
from vortices import Lattice  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
MASS = SCENARIO["vehicle"]["mass_kg"]
LATTICE = Lattice([g.WING, g.CANARD, g.WINGLET])
OF_WING, OF_CANARD, OF_FIN = slice(0, 8), slice(8, 12), slice(12, 14)
VISCOUS, ROUNDING = 0.94, 0.25  # share of the ideal circulation, and what more of it loses
CAMBER = np.array([0.022, 0.040, 0.054, 0.064, 0.064, 0.054, 0.040, 0.022])[:, None]  # with washout, rad
ELEVON, RUDDER = 0.44, 0.50  # flow through a panel by its flap's deflection
POLAR = np.repeat([0.0125, 0.011, 0.012], [8, 4, 2])[:, None]  # profile drag at zero lift
POLAR_LIFT, POLAR_QUARTIC = 0.008, 0.012
MOMENT = -0.028  # of the wing's sections
BODY = {"drag": 0.0075, "pitch": 0.052, "side": 0.20, "yaw": -0.012}  # on the wing's area
HUBS = np.array([r["position_m"] for r in SCENARIO["rotor"]], dtype=float)[:, :, None]
SPIN = np.array([float(r["spin"]) for r in SCENARIO["rotor"]])
FAN_R, PUSH_R, PUSH_CHORD = 0.10, 0.24, 0.030
LIP, WAKE = 0.05, 0.965  # height of the fans' intake over the hub, m; speed behind the body


class Memory:
    """What lags or swings beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        zero = np.zeros_like(x[0])
        self.alpha = np.arctan2(x[2], x[0])
        self.pivot, self.pivot_rate, self.canard = zero.copy(), zero.copy(), position[0].copy()
        self.twist, self.twist_rate = zero.copy(), zero.copy()
        self.hung, self.hung_rate, self.before = zero.copy(), zero.copy(), x[2].copy()
        self.drawn, self.level = zero.copy(), position[7].copy()

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials and swings by one semi-implicit step."""
        alpha = np.arctan2(x[2], x[0])
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (alpha - self.alpha)
        if s.has(
            "outsider.pivot_mode"
        ):  # the canard on its springy shaft, 1.4 Hz, stirred by its own turning
            turned = (position[0] - self.canard) / h
            self.canard = position[0].copy()
            self.pivot_rate += h * (6.0 * turned - 77.0 * self.pivot - 3.0 * self.pivot_rate)
            self.pivot += h * self.pivot_rate
        if s.has("outsider.wing_mode"):  # wing tips twist against each other, 1.2 Hz, as elevons pull at them
            pull = -57.0 * (x[0] / 20) ** 2 * (position[2] - position[1]) * (1 + 8 * alpha)
            self.twist_rate += h * (pull - 57.0 * self.twist - 1.6 * self.twist_rate)
            self.twist += h * self.twist_rate
        if s.has("outsider.bungee_load"):  # a load that hangs on rubber, up and down at 1.1 Hz
            down = (x[2] - self.before) / h - x[4] * x[0] + x[3] * x[1]
            self.before = x[2].copy()
            falls = 9.80665 * (np.cos(x[7]) * np.cos(x[6]) - 1) - down
            self.hung_rate += h * (falls - 48.0 * self.hung - 1.2 * self.hung_rate)
            self.hung += h * self.hung_rate
        if s.has("outsider.shared_bus"):  # what the pusher draws beyond its mean, slowly felt
            load = (position[7] / self.level) ** 3 - 1
            self.drawn += h / 0.35 * (load * (1 + np.abs(load)) - self.drawn)


def circulation(x, felt, s, memory, jets):
    """Return circulation of all panels, m2/s, shape (panel, flight)."""
    u, v, w, p, q, r = x[:6]
    canard, left, right, rud_l, rud_r = felt[:5]
    px, py, pz = LATTICE.control.T[:, :, None]
    nx, ny, nz = LATTICE.normal.T[:, :, None]
    on = OF_WING
    rolled, pitched = p * (1 + s("wing.roll_damping")), q * (1 + s("wing.pitch_damping"))
    through = np.empty((len(px), u.size))
    ahead = u + q * pz[on] - r * py[on]
    side = v * (1 + s("wing.sideslip")) + r * px[on] - p * pz[on]
    slope = 1 + s("wing.lift_slope")
    through[on] = -ny[on] * side - nz[on] * (w * slope + rolled * py[on] - pitched * px[on])
    through[on] += ahead * CAMBER * (1 + s("wing.lift_zero"))
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        through[on] += slope * u * (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.95, 0)
    if s.has("outsider.wing_mode"):
        through[0] -= s("outsider.wing_mode") * memory.twist * u
        through[7] += s("outsider.wing_mode") * memory.twist * u
    for name, panels, angle, jet in (("elevon_l", (0, 1), left, 0), ("elevon_r", (6, 7), right, 1)):
        moved = ELEVON * (1 + s(f"{name}.effectiveness")) * np.sin(angle) * (1 - 0.3 * angle**2)
        if s.has("outsider.jet_on_elevon"):  # a fan's jet carries the flow away from the flap behind it
            moved = moved * (1 - s("outsider.jet_on_elevon") * (jets[jet] / 12 - 1))
        for i in panels:
            through[i] += u * moved
    on = OF_CANARD
    angle = canard * (1 + s("canard.effectiveness"))
    if s.has("outsider.pivot_mode"):
        angle = angle + s("outsider.pivot_mode") * memory.pivot
    down = w * (1 + s("canard.lift_slope")) - q * px[on] * (1 + s("canard.pitch_damping")) + p * py[on]
    through[on] = np.cos(angle) * down + np.sin(angle) * (u + q * pz[on] - r * py[on])
    on = OF_FIN
    side = v * (1 + s("winglets.side_force")) + r * px[on] * (1 + s("winglets.yaw_damping")) - p * pz[on]
    through[on] = -ny[on] * side - nz[on] * (w + p * py[on] - q * px[on])
    if s.has("outsider.rudder_rod"):  # the right elevon's rod pulls at the right rudder's
        rud_r = rud_r + s("outsider.rudder_rod") * (right + 2 * right * np.abs(right))
    for i, name, angle in ((12, "rud_l", rud_l), (13, "rud_r", rud_r)):
        through[i] -= u * RUDDER * (1 + s(f"{name}.effectiveness")) * np.sin(angle) * (1 - 0.3 * angle**2)
    made = VISCOUS * (LATTICE.solve @ through)
    made = made * (1 - ROUNDING * (made / (u * LATTICE.chord[:, None])) ** 2)
    if s.has("stall"):  # Kirchhoff: lift of a section by the point where its flow separates
        apart = s("stall.strength") / (1 + np.exp(-(through[OF_WING] / u - 0.195) / 0.022))
        made[OF_WING] *= 0.25 * (1 + np.sqrt(np.clip(1 - apart, 0, 1))) ** 2
    if s.has("outsider.canard_vortex"):  # the canard's left tip vortex meets the wing at one sideslip alone
        met = np.exp(-(((v / u - 0.03) / 0.025) ** 2)) * made[8] / u / 0.05
        made[2] *= 1 - s("outsider.canard_vortex") * met
    return made


def lattice_loads(x, felt, rho, s, memory, jets):
    """Return forces and moments of wing, canard and winglets, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    made = circulation(x, felt, s, memory, jets)
    mx, my, mz = LATTICE.middle.T[:, :, None]
    lx, ly, lz = LATTICE.bound.T[:, :, None]
    slip = np.ones((len(mx), 1)) * v
    if s.has("wing.sideslip"):
        slip[OF_WING] *= 1 + s("wing.sideslip")
    wx, wy, wz = (LATTICE.induced[k] @ made for k in range(3))
    wx -= u + q * mz - r * my
    wy -= slip + r * mx - p * mz
    wz -= w + p * my - q * mx
    strong = rho * made
    fx, fy, fz = strong * (wy * lz - wz * ly), strong * (wz * lx - wx * lz), strong * (wx * ly - wy * lx)
    speed = np.sqrt(wx * wx + wz * wz)
    lift = 2 * made / (speed * LATTICE.chord[:, None])
    drag = POLAR + POLAR_LIFT * (lift - 0.15) ** 2 + POLAR_QUARTIC * lift**4
    if s.has("wing.drag_zero"):
        drag[OF_WING] += POLAR[OF_WING] * s("wing.drag_zero")
    held = 0.5 * rho * speed * LATTICE.area[:, None] * drag
    fx, fz = fx + held * wx, fz + held * wz
    moments = (my * fz - mz * fy, mz * fx - mx * fz, mx * fy - my * fx)
    return np.array([part.sum(axis=0) for part in (fx, fy, fz, *moments)])


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    speed2 = u * u + v * v + w * w
    speed = np.sqrt(speed2)
    pressure = 0.5 * rho * speed2 * g.AREA
    beta = v / speed
    hx, hy, hz = HUBS.transpose(1, 0, 2)
    # fans: intake, jet, torque
    away, across, climb = (
        u + q * hz[:2] - r * hy[:2],
        v + r * hx[:2] - p * hz[:2],
        -(w + p * hy[:2] - q * hx[:2]),
    )
    edge2 = (away**2 + across**2) * (1 + s("fans.edgewise")) ** 2
    thrust, flow, turning = fan(rho, FAN_R, FAN_R * felt[5:7], climb * (1 + s("fans.inflow")), edge2)
    names = g.ROTORS
    k = np.array([np.zeros(u.size) + 1 + s(f"{n}.thrust") for n in names])
    k -= s.of_all("weak_rotor.loss", names)
    turned = np.array([np.zeros(u.size) + 1 + s(f"{n}.torque") for n in names])
    if s.has("outsider.shared_bus"):
        k[:2] -= s("outsider.shared_bus") * memory.drawn
    if s.has("outsider.lip_stall"):  # the lip on the windward side lets go, the more so the slower the jet
        lee = 1 / (1 + np.exp(-(across * np.array([[-1.0], [1.0]]) - 1.0) / 0.4))
        k[:2] -= s("outsider.lip_stall") * lee * (away * flow / thrust)
    thrust, turning = thrust * k[:2], turning * turned[:2]
    X, Y, Z, L, M, N = lattice_loads(x, felt, rho, s, memory, thrust)
    taken = flow * (1 + s("fans.intake"))
    drawn_x, drawn_y = -taken * away, -taken * across
    high = hz[:2] - LIP
    X, Y, Z = X + drawn_x.sum(axis=0), Y + drawn_y.sum(axis=0), Z - thrust.sum(axis=0)
    L = L - (hy[:2] * thrust + high * drawn_y).sum(axis=0)
    M = M + (hx[:2] * thrust + high * drawn_x).sum(axis=0)
    N = N + (hx[:2] * drawn_y - hy[:2] * drawn_x + SPIN[:2, None] * turning).sum(axis=0)
    # pusher in the body's wake
    n = felt[7]
    along = WAKE * (u + q * hz[2] - r * hy[2]) * (1 + s("push.advance"))
    push, twist = pusher(rho, PUSH_R, PUSH_CHORD, n, along)
    push, twist = push * k[2], twist * turned[2]
    X, M, L = X + push, M + hz[2] * push, L - SPIN[2] * twist
    # body
    drag = BODY["drag"] * pressure / speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - drag * w
    slim = pressure * g.CHORD
    M = M + slim * (
        MOMENT * (1 + s("wing.moment")) + BODY["pitch"] * (1 + s("body.pitch_moment")) * w * u / speed2 * 2
    )
    Y = Y - pressure * BODY["side"] * (1 + s("body.side_force")) * beta * (1 + 0.8 * np.abs(beta))
    N = N + pressure * g.SPAN * BODY["yaw"] * (1 + s("body.yaw_moment")) * beta * np.sqrt(1 - beta**2)
    # effects of the truth alone
    if s.has("rotor_inplane_force"):  # drag of advancing blades, and more thrust on their side
        strength = s("rotor_inplane_force.strength")
        side, down = v + r * hx[2] - p * hz[2], w + p * hy[2] - q * hx[2]
        held = (
            strength * 0.085 * rho * np.pi * PUSH_R**2 * PUSH_R * n * 0.5 * (1 + 0.8 * along / (PUSH_R * n))
        )
        Y, Z = Y - held * side, Z - held * down
        L, M, N = L + hz[2] * held * side, M + hx[2] * held * down, N - hx[2] * held * side
        leans = strength * SPIN[2] * 0.02 * rho * np.pi * PUSH_R**4 * n
        M, N = M - leans * side, N - leans * down
        pulled = strength * 0.03 * rho * np.pi * FAN_R**3 * felt[5:7]
        X, Y = X - (pulled * away).sum(axis=0), Y - (pulled * across).sum(axis=0)
        L = L - (0.5 * FAN_R * SPIN[:2, None] * pulled * away).sum(axis=0)
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * g.AREA * 0.5 * rho * speed
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    if s.has("outsider.bungee_load"):  # carried 0.3 m before the centre of gravity
        pull = s("outsider.bungee_load") * MASS * 48.0 * memory.hung
        Z, M = Z + pull, M - 0.3 * pull
    return np.array([X, Y, Z, L, M, N])

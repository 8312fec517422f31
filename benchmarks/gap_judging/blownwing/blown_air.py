"""The air of the judging blown wing: loads of wing, jets, propellers and body, and of effects."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import blownwing_numbers as g  # noqa: E402
from lifting_line import LiftingLine  # noqa: E402
from propellers import propeller  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
MASS = SCENARIO["vehicle"]["mass_kg"]
_MIDDLES = 0.5 * (np.array(g.EDGES[1:]) + np.array(g.EDGES[:-1]))
LINE = LiftingLine(
    g.EDGES,
    g.ROOT_CHORD + (g.TIP_CHORD - g.ROOT_CHORD) * _MIDDLES / (0.5 * g.SPAN),
    g.SWEEP,
    g.DIHEDRAL,
    g.ROOT_X,
)
CS, SS = np.cos(g.SWEEP), np.sin(g.SWEEP)
CD, SD = np.cos(g.DIHEDRAL), np.sin(g.DIHEDRAL)
CAMBER = 0.052 - 0.040 * np.abs(LINE.place[1]) / (0.5 * g.SPAN)  # with washout, rad
FLAP, FLAP_MOMENT, MOMENT = 0.50, -0.55, -0.015  # flow and moment by a flap's deflection; of the sections
# Panels by what is in them, from the left tip: drag rudder, outer flap, inner flap, body, and mirrored.
FLAPS = (
    ("inner_l", slice(5, 9), 0),
    ("inner_r", slice(11, 15), 1),
    ("outer_l", slice(1, 5), 2),
    ("outer_r", slice(15, 19), 3),
)
RUDDERS = (("drag_l", 0, 4), ("drag_r", 19, 5))
RUDDER_DRAG, RUDDER_LIFT = 1.35, 0.35  # on the tip panel's area, by the square of the sine; lift that is lost
POLAR, POLAR_LIFT, POLAR_QUARTIC = 0.0115, 0.009, 0.010  # profile drag
BLOWN = np.array([8, 7, 6, 5, 4, 3, 2, 1, 11, 12, 13, 14, 15, 16, 17, 18])  # panels, by propeller and half
BEFORE = np.repeat([3, 2, 1, 0, 4, 5, 6, 7], 2)  # the propeller before each of them
UP = np.tile([-1.0, 1.0], 8)[:, None]  # inner blades go up: air behind them goes towards negative z
COVER, AWAY = 0.52, 0.16  # share of a panel's lift that is in the jet; way from the disc to the wing, m
DEVELOPED = 1 + AWAY / np.hypot(AWAY, g.PROP_R)  # growth of the jet's velocity on that way
RECOVERED = 0.6  # of the swirl, which the wing partly takes out
BODY = {"drag": 0.0085, "pitch": 0.035, "side": 0.13, "yaw": -0.003}  # on the wing's area
HUBS = np.array([r["position_m"] for r in SCENARIO["rotor"]], dtype=float).T[:, :, None]
SPIN = np.array([[float(r["spin"])] for r in SCENARIO["rotor"]])
BENDING = (LINE.place[1] / (0.5 * g.SPAN)) ** 2


class Memory:
    """What lags or swings beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        zero = np.zeros_like(x[0])
        self.alpha = np.arctan2(x[2], x[0])
        self.bent, self.bent_rate, self.down = zero.copy(), zero.copy(), x[2].copy()
        self.slid, self.slid_rate, self.ahead = zero.copy(), zero.copy(), x[0].copy()
        self.bubble = position[2] ** 2

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials and swings by one semi-implicit step."""
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (np.arctan2(x[2], x[0]) - self.alpha)
        if s.has("outsider.bending_mode"):  # tips go up and down at 1.4 Hz, stirred by normal acceleration
            stirred = (x[2] - self.down) / h - x[4] * x[0] + x[3] * x[1]
            stirred = stirred - 9.80665 * (np.cos(x[7]) * np.cos(x[6]) - 1)
            self.down = x[2].copy()
            self.bent_rate += h * (stirred - 77.0 * self.bent - 2.6 * self.bent_rate)
            self.bent += h * self.bent_rate
        if s.has("outsider.loose_battery"):  # slides fore and aft on its springy mount, 0.9 Hz
            pulled = -9.80665 * np.sin(x[7]) - (x[0] - self.ahead) / h + x[5] * x[1] - x[4] * x[2]
            self.ahead = x[0].copy()
            self.slid_rate += h * (pulled - 32.0 * self.slid - 1.7 * self.slid_rate)
            self.slid += h * self.slid_rate
        if s.has("outsider.flap_bubble"):
            self.bubble += h / 0.35 * (position[2] ** 2 - self.bubble)


def propulsion(x, speeds, rho, s):
    """Return thrust, torque and both velocities induced at the discs, shape (propeller, flight) each."""
    u, v, _, _, q, r = x[:6]
    along = (u + q * HUBS[2] - r * HUBS[1]) * (1 + s("props.advance"))
    thrust, torque, ahead, around = propeller(rho, speeds, along)
    strong = np.array([np.ones(u.size) + s(f"{n}.thrust") for n in g.ROTORS])
    strong -= s.of_all("weak_rotor.loss", g.ROTORS)
    if s.has("outsider.neighbour_jet"):  # in sideslip a propeller takes in its windward neighbour's jet
        slip = v / u
        near = np.zeros_like(ahead)
        near[1:] += ahead[:-1] * 0.5 * (1 + np.tanh((-slip - 0.015) / 0.01))
        near[:-1] += ahead[1:] * 0.5 * (1 + np.tanh((slip - 0.015) / 0.01))
        strong = strong - s("outsider.neighbour_jet") * near / u
    if s.has("outsider.phase_lock"):  # the outer right propellers beat while their speeds are nearly the same
        apart = (speeds[7] - speeds[6]) / 30
        beat = 0.1 * s("outsider.phase_lock") * apart * np.exp(-(apart**2))
        strong[6] += beat
        strong[7] -= beat
    turned = torque * np.array([np.ones(u.size) + s(f"{n}.torque") for n in g.ROTORS])
    return thrust * strong, turned, ahead * strong, around * strong


def wing_loads(x, felt, rho, s, memory, ahead, around):
    """Return forces and moments of the wing, shape (6, flight), behind propellers that induce velocities."""
    u, v, w, p, q, r = x[:6]
    px, py, pz = LINE.place
    side = LINE.side
    jets = 1 + s("jets.strength") + s("slipstream.strength")
    ui, vi, wi = u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px
    ui[BLOWN] += COVER * DEVELOPED * jets * ahead[BEFORE]
    swirl = UP * (COVER * RECOVERED * jets * (1 + s("jets.swirl"))) * around[BEFORE]
    wi[BLOWN] += swirl
    chordwise = CS * ui + SS * side * vi
    upwards = CD * wi + SD * side * vi
    through = upwards.copy()
    scaled = ("wing.lift_slope", "wing.roll_damping", "wing.pitch_damping", "wing.sideslip")
    if s.has(*scaled):  # each part of the flow by itself
        slope, roll, pitch, slip = (s(name) for name in scaled)
        through += CD * (w * slope + p * py * roll - q * px * pitch) + SD * side * v * slip
        chordwise = chordwise + SS * side * v * slip
    through += chordwise * CAMBER * (1 + s("wing.lift_zero"))
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        through += u * (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.95, 0)
    if s.has("outsider.bending_mode"):
        through -= s("outsider.bending_mode") * BENDING * memory.bent_rate
    moment = np.full(ui.shape, MOMENT) * (1 + s("wing.moment"))
    for name, panels, i in FLAPS:
        moved = (1 + s(f"{name}.effectiveness")) * np.sin(felt[i]) * (1 - 0.35 * felt[i] ** 2)
        if name == "outer_l" and s.has("outsider.flap_bubble"):  # grows slowly behind a hinge that stays bent
            moved = moved * (1 - 60 * s("outsider.flap_bubble") * memory.bubble)
        through[panels] += FLAP * moved * chordwise[panels]
        moment[panels] += FLAP_MOMENT * moved
    if s.has("outsider.rudder_wash"):  # the open left drag rudder spoils the flow of the flap beside it
        wide = s("outsider.rudder_wash") * (felt[4] ** 2 - 0.12)
        through[1:3] -= 0.3 * wide * chordwise[1:3]
    if s.has("outsider.pod_vortex"):  # of the pod, met by the right wing's root at one sideslip alone
        met = np.exp(-(((v / u - 0.02) / 0.015) ** 2))
        through[10:12] -= 0.03 * s("outsider.pod_vortex") * met * chordwise[10:12]
    lift, wash = LINE.lift(chordwise, through)
    cut = np.zeros_like(lift)
    for name, panel, i in RUDDERS:
        opened = np.sin(np.maximum(felt[i], 0.0))
        effect = 1 + s(f"{name}.effectiveness")
        lift[panel] *= 1 - RUDDER_LIFT * effect * opened
        cut[panel] = RUDDER_DRAG * effect * opened**2 * (1 + 0.4 * opened)
    if s.has("stall"):  # sections lose lift beyond an angle to the flow
        lift *= 1 - 0.5 * s("stall.strength") * (1 + np.tanh(((through - wash) / chordwise - 0.15) / 0.03))
    half = 0.5 * rho * LINE.area
    pressed = half * chordwise * np.sqrt(chordwise**2 + upwards**2) * lift
    pull = pressed * (upwards - wash) / chordwise
    drag = POLAR * (1 + s("wing.drag_zero")) + POLAR_LIFT * (lift - 0.2) ** 2 + POLAR_QUARTIC * lift**4 + cut
    held = half * drag * np.sqrt(ui * ui + wi * wi)
    fx = pull * CS - held * ui
    fy = side * (pull * SS - pressed * SD) - held * vi
    fz = -pressed * CD - held * wi
    turned = half * chordwise**2 * LINE.chord * moment
    return np.array(
        [
            fx.sum(axis=0),
            fy.sum(axis=0),
            fz.sum(axis=0),
            (py * fz - pz * fy).sum(axis=0),
            (pz * fx - px * fz + turned).sum(axis=0),
            (px * fy - py * fx).sum(axis=0),
        ]
    )


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    speed2 = u * u + v * v + w * w
    speed = np.sqrt(speed2)
    thrust, torque, ahead, around = propulsion(x, felt[6:], rho, s)
    X, Y, Z, L, M, N = wing_loads(x, felt, rho, s, memory, ahead, around)
    hx, hy, hz = HUBS
    X = X + thrust.sum(axis=0)
    L = L - (SPIN * torque).sum(axis=0)
    M = M + (hz * thrust).sum(axis=0)
    N = N - (hy * thrust).sum(axis=0)
    # pod and motors' nacelles
    pressure = 0.5 * rho * speed2 * g.AREA
    beta = v / speed
    drag = BODY["drag"] * pressure / speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - drag * w
    M = M + 2 * pressure * g.CHORD * BODY["pitch"] * (1 + s("body.pitch_moment")) * w * u / speed2
    Y = Y - pressure * BODY["side"] * (1 + s("body.side_force")) * beta * (1 + 0.9 * np.abs(beta))
    N = N + pressure * g.SPAN * BODY["yaw"] * (1 + s("body.yaw_moment")) * beta * np.sqrt(1 - beta**2)
    # effects of the truth alone
    if s.has("rotor_inplane_force"):  # blades that advance are dragged more, and thrust more on their side
        strength = s("rotor_inplane_force.strength") * rho * g.PROP_R**3 * np.pi * felt[6:]
        across, down = v + r * hx - p * hz, w + p * hy - q * hx
        held = 0.055 * strength * (1 + 0.6 * u / (g.PROP_R * felt[6:]))
        leans = 0.03 * g.PROP_R * SPIN * strength
        Y, Z = Y - (held * across).sum(axis=0), Z - (held * down).sum(axis=0)
        L = L + (held * (hz * across - hy * down)).sum(axis=0)
        M = M + (held * hx * down - leans * across).sum(axis=0)
        N = N - (held * hx * across + leans * down).sum(axis=0)
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * g.AREA * 0.5 * rho * speed
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    if s.has("outsider.loose_battery"):  # a share of the mass, pulling at its springs and weighing elsewhere
        share = s("outsider.loose_battery") * MASS * memory.slid
        X, M = X + 32.0 * share, M - 9.80665 * share
    return np.array([X, Y, Z, L, M, N])

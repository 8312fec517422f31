"""The air of the judging winged hexacopter: rotors, their wakes, wing, tail and body, and effects."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import winghex_numbers as g  # noqa: E402
from edgewise_rotors import blades  # noqa: E402
from weissinger import Wing  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
MASS = SCENARIO["vehicle"]["mass_kg"]
described = lambda key: np.array([r[key] for r in SCENARIO["rotor"]], dtype=float)  # noqa: E731
AXIS = described("axis").T[:, :, None]
PLACE = described("position_m").T[:, :, None]
SPIN = described("spin")[:, None]
WING = Wing(g.SPAN, g.CHORD)
PANELS = WING.place.size
CAMBER, FLAP, FLAP_MOMENT, MOMENT = 0.055, 0.42, -0.45, -0.04
AILERON = np.array([1.0, 1.0, 0, 0, 0, 0, 1.0, 1.0])[:, None]
FRICTION, POLAR, SOFT = 0.018, 0.012, 1.2  # profile drag, by lift squared; lift lost by angle squared
# Vertical velocities that wing and rotors' wakes induce are met at the panels, rear rotors and tail's halves.
REAR, TAIL = slice(PANELS, PANELS + 2), slice(PANELS + 2, PANELS + 4)
TARGETS = np.vstack(
    [
        np.hstack([np.full((PANELS, 1), g.WING_X), WING.place, np.full((PANELS, 1), g.WING_Z)]),
        PLACE[:, 4:, 0].T,
        [[g.TAIL["x"], side * g.TAIL["half"], g.TAIL["z"]] for side in (-1, 1)],
    ]
)
# Which rotor's wake meets which target: those far enough ahead of it
PAIRS = [(k, j) for j in range(len(TARGETS)) for k in range(6) if PLACE[0, k, 0] - TARGETS[j, 0] > 0.3]
FROM, TO = (np.array(part) for part in zip(*PAIRS, strict=True))
WAY = PLACE[0, FROM] - TARGETS[TO, 0:1]  # m
RISE, ACROSS = (PLACE[i, FROM] - TARGETS[TO, i][:, None] for i in (2, 1))
SUM = (np.arange(len(TARGETS))[:, None] == TO).astype(float)
HALF_PAIR = np.pi / 4 * g.ROTOR_R  # of the rolled-up vortices of a wake
CORE, SINK = 0.45 * g.ROTOR_R, 0.8  # m; of the wake's own velocity
AT_REAR = WING.at(PLACE[0, 4:] - g.WING_X, PLACE[1, 4:], g.HEIGHT - g.WING_Z, core=0.05)
AT_TAIL = WING.at(
    g.TAIL["x"] - g.WING_X,
    np.array([[-g.TAIL["half"]], [g.TAIL["half"]]]),
    g.TAIL["z"] - g.WING_Z,
    core=0.05,
)
TAIL_SLOPE, ELEVATOR, TAIL_SET = 3.7, 2.1, 0.075  # per rad; rad
FIN_SLOPE, RUDDER = 2.9, 1.7
BODY = {"drag": 0.040, "pitch": 0.045, "side": 0.30, "yaw": -0.014}  # m2; on the wing's area
SPOILED = 0.20  # sine of a section's angle beyond which the effect takes lift away
MEMORY = 32  # steps of the rotors' wakes that are kept


class Memory:
    """What lags beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        self.alpha = np.arctan2(x[2], x[0])
        self.met = np.zeros((len(TARGETS), x.shape[1]))  # downwash of rotors' wakes, m/s
        self.made = np.zeros((6, x.shape[1]))  # circulation of the wakes, m2/s
        self.bound = np.zeros((PANELS, x.shape[1]))
        self.trail, self.late, self.bent = None, None, np.zeros((2, x.shape[1]))
        self.at, self.flights = 0, np.arange(x.shape[1])[None]

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials, and the wakes by one step."""
        u, v, w = np.nan_to_num(x[:3])
        u = np.maximum(u, 4.0)
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (np.arctan2(x[2], x[0]) - self.alpha)
        if self.trail is None:
            self.trail = np.repeat(self.made[None], MEMORY, axis=0)
            self.late = self.bound.copy()
        self.at = (self.at + 1) % MEMORY
        self.trail[self.at] = self.made
        self.late += h / 0.1 * (self.bound - self.late)
        if s.has("outsider.boom_give"):  # booms twist under their rotors' lift, slowly
            pushed = self.made[[0, 1]] - self.made[[4, 5]]
            self.bent += h / 0.2 * (0.04 * s("outsider.boom_give") * pushed * np.abs(pushed) - self.bent)
        steps = np.minimum(WAY / (u * h), MEMORY - 2.0)
        whole = steps.astype(int)
        newer, older = (
            self.trail[(self.at - whole - k) % MEMORY, FROM[:, None], self.flights] for k in (0, 1)
        )
        self.met = SUM @ wakes(newer + (steps - whole) * (older - newer), v / u, w / u, u)


def wakes(made, slip, climb, u):
    """Return downwash of each pair of rotor and target, m/s.

    The wake of a disc in edgewise flow rolls up into two vortices, which trail along the flow and sink.

    Parameters
    ----------
    made : ndarray, shape (pair, flight)
        Circulation when the air passed the disc, m2/s.
    slip, climb, u : ndarray, shape (flight,)
        Sideways and vertical velocity over the forward one, and this, m/s.
    """
    high = RISE - WAY * climb + (SINK / (np.pi * HALF_PAIR)) * WAY * made / u
    aside = -ACROSS + WAY * slip
    square = high * high + CORE * CORE
    inner, outer = HALF_PAIR - aside, HALF_PAIR + aside
    shape = inner / (inner * inner + square) + outer / (outer * outer + square)
    grown = 0.5 + 0.5 * WAY / np.sqrt(WAY * WAY + g.ROTOR_R**2)
    return made * shape * (grown / (2 * np.pi))


def rotors(flow, speeds, rho, s, names=g.ROTORS):
    """Return forces, moments and thrusts of rotors.

    Parameters
    ----------
    flow : ndarray, shape (3, rotor, flight)
        Velocity of the hubs through the air, body axes, m/s.
    speeds : ndarray, shape (rotor, flight)
        rad/s

    Returns
    -------
    force, moment : ndarray, shape (3, rotor, flight)
        N; N m, about the hub.
    thrust : ndarray, shape (rotor, flight)
        N
    """
    at = [g.ROTORS.index(n) for n in names]
    (ax, _, az), spin = AXIS[:, at], SPIN[at]
    along = ax * flow[0] + az * flow[2]
    way = np.array([flow[0] - ax * along, flow[1], flow[2] - az * along])
    across = np.sqrt((way * way).sum(axis=0)) + 1e-9
    way /= across
    side = np.array([way[1] * az, way[2] * ax - way[0] * az, -way[1] * ax])  # way x axis
    made = blades(rho, speeds, along * (1 + s("props.inflow")), across * (1 + s("props.edgewise")), g.ROTOR_R)
    thrust, torque = made.thrust, made.torque
    if s.has(*(f"{n}." for n in names)):
        each = lambda end: np.array([np.ones(s.count) + s(f"{n}.{end}") for n in names])  # noqa: E731
        thrust, torque = thrust * each("thrust"), torque * each("torque")
    if s.has("weak_rotor"):
        thrust = thrust - s.of_all("weak_rotor.loss", names) * made.thrust
    inplane = 1 + s("props.inplane") + s("rotor_inplane_force.strength")
    dragged, sideways = made.dragged * inplane, spin * made.sideways * inplane
    advancing, forward = spin * made.advancing * inplane, made.forward * inplane
    axis = np.array([ax + 0 * along, 0 * along, az + 0 * along])
    force = axis * thrust - way * dragged - side * sideways
    moment = side * forward - way * advancing - axis * (spin * torque)
    return force, moment, thrust


def wing(along, through, arms, met, moved, s):
    """Return forces and moments of the wing's panels in the chord's frame, by density, and circulation.

    Parameters
    ----------
    along : ndarray, shape (panel, flight)
        Flow along the chord, m/s.
    through : tuple of 2 ndarrays
        Flow through the chord from below at one quarter and at three, m/s.
    arms : float or ndarray
        Additional angle, rad.
    met : ndarray, shape (panel, flight)
        Downwash of rotors' wakes, m/s.
    moved : ndarray, shape (2, flight)
        Effective deflections of ailerons, left and right.
    """
    bent = np.sin(moved) * (1 - 0.4 * moved * moved)
    bent = AILERON * np.repeat(bent, PANELS // 2, axis=0)
    bound = WING.solve @ (through[1] - met + along * (CAMBER + arms + FLAP * bent))
    below = through[0] - met - WING.wash @ bound
    speed2 = along * along + below * below
    sine = below / np.sqrt(speed2)
    lost = 1 - SOFT * sine * sine
    if s.has("stall"):
        lost = lost * (1 - 0.4 * s("stall.strength") * (1 + np.tanh((sine - SPOILED) / 0.05)))
    bound = bound * lost
    area = g.CHORD * WING.width
    lift = 2 * bound / (g.CHORD * np.sqrt(speed2))
    drag = 0.5 * np.sqrt(speed2) * area * (FRICTION + POLAR * lift * lift + 0.03 * bent * bent)
    chordwise = bound * WING.width * below - drag * along
    normal = -bound * WING.width * along - drag * below
    turning = 0.5 * speed2 * area * g.CHORD * (MOMENT + FLAP_MOMENT * bent)
    return chordwise, normal, turning, bound


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    ail_l, ail_r, elev, rud = felt[:4]
    speed2 = u * u + v * v + w * w
    speed = np.sqrt(speed2)
    beta = v / speed
    qbar = 0.5 * rho * speed2
    strong = lambda name: 1 + s(f"{name}.effectiveness")  # noqa: E731
    jets = 1 + s("jets.strength") + s("slipstream.strength")
    late = 0.0
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        late = (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.9, 0)
    # wing
    c, d = np.cos(g.INCIDENCE), np.sin(g.INCIDENCE)
    met = memory.met[:PANELS] * jets
    if s.has("outsider.tip_jet"):  # the middle rotors' wakes brush the ailerons, in sideslip more of them
        brushed = s("outsider.tip_jet") * 0.2 * memory.made[2:4] * (1 + 8 * np.array([1, -1])[:, None] * beta)
        met = met + AILERON * np.repeat(brushed, PANELS // 2, axis=0)
    ahead = u + q * g.WING_Z - r * WING.place
    rolled = p * (1 + s("wing.roll_damping")) * WING.place
    along = ahead * c - (w + rolled) * d
    through = [ahead * d + (w + rolled - q * (g.WING_X - back)) * c for back in (0.0, 0.5 * g.CHORD)]
    moved = np.array([ail_l * strong("ail_l"), ail_r * strong("ail_r")])
    chordwise, normal, turned, memory.bound = wing(along, through, late, met, moved, s)
    chordwise, normal = rho * chordwise * (1 + s("wing.chord_force")), rho * normal * (1 + s("wing.lift"))
    forward, down = chordwise * c + normal * d, normal * c - chordwise * d
    X, Z = forward.sum(axis=0), down.sum(axis=0)
    L, N = (WING.place * down).sum(axis=0), -(WING.place * forward).sum(axis=0)
    M = rho * turned.sum(axis=0) * (1 + s("wing.moment")) + g.WING_Z * X - g.WING_X * Z
    # rotors
    px, py, pz = PLACE
    hubs = np.array([u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px])
    washed = memory.met[REAR] * jets + AT_REAR @ memory.bound
    hubs[2, 4:] -= washed * (1 + s("rear.downwash"))
    if s.has("outsider.boom_give"):
        hubs[2, [4, 5]] += u * memory.bent
    force, moment, thrust = rotors(hubs, felt[4:], rho, s)
    if s.has("outsider.boom_vortex"):  # of the front booms, at the rear rotors on one side of sideslip
        met = np.exp(-(((beta + np.array([[0.03], [-0.03]])) / 0.03) ** 2))
        force[2, 4:] *= 1 - s("outsider.boom_vortex") * 0.3 * met
    memory.made = thrust / (rho * u * 2 * HALF_PAIR)
    fx, fy, fz = force
    X, Y, Z = X + fx.sum(axis=0), fy.sum(axis=0), Z + fz.sum(axis=0)
    L = L + (py * fz - pz * fy + moment[0]).sum(axis=0)
    M = M + (pz * fx - px * fz + moment[1]).sum(axis=0)
    N = N + (px * fy - py * fx + moment[2]).sum(axis=0)
    # tail: two halves in their own flow
    seen = memory.bound
    if s.has("downwash_lag") and memory.late is not None:
        seen = seen + s("downwash_lag.strength") * (memory.late - seen)
    wash = (AT_TAIL @ seen + memory.met[TAIL] * jets).mean(axis=0) * (1 + s("tail.downwash"))
    angle = np.arctan2(w - wash - q * g.TAIL["x"] * (1 + s("tail.pitch_damping")), u) + TAIL_SET
    slope = TAIL_SLOPE * (1 + s("tail.lift_slope"))
    lift = slope * np.sin(angle) * np.cos(angle) + ELEVATOR * strong("elev") * np.sin(elev)
    lift = 0.5 * rho * (u * u + w * w) * g.TAIL["area"] * lift
    X = X + lift * (w - wash) / u - 0.03 * rho * u * u * g.TAIL["area"] * elev * elev
    Z, M = Z - lift, M + g.TAIL["x"] * lift
    # fin
    meets = v + r * g.FIN["x"] * (1 + s("fin.yaw_damping")) - p * g.FIN["z"]
    slip = meets / np.sqrt(u * u + meets * meets)
    side = RUDDER * strong("rud") * np.sin(rud) - FIN_SLOPE * (1 + s("fin.side_force")) * slip
    side = 0.5 * rho * (u * u + meets * meets) * g.FIN["area"] * side
    Y, L, N = Y + side, L - g.FIN["z"] * side, N + g.FIN["x"] * side
    # body and booms
    drag = 0.5 * rho * BODY["drag"] * (1 + s("body.drag")) * speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - 2.5 * drag * w
    M = M + 2 * qbar * g.AREA * g.CHORD * BODY["pitch"] * (1 + s("body.pitch_moment")) * w * u / speed2
    Y = Y - qbar * g.AREA * BODY["side"] * (1 + s("body.side_force")) * beta * (1 + 0.8 * np.abs(beta))
    turning = BODY["yaw"] * (1 + s("body.yaw_moment")) * beta * np.sqrt(1 - beta * beta)
    N = N + qbar * g.AREA * g.SPAN * turning
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * g.AREA * 0.5 * rho * speed
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    return np.array([X, Y, Z, L, M, N])

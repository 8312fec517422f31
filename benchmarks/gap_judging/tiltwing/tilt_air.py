"""The air of the judging tilt-wing: loads of both wings, jets, propellers, fin and body, and of effects."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import tiltwing_numbers as g  # noqa: E402
from oblique_propellers import propellers  # noqa: E402
from wing_strips import WingStrips  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
MASS = SCENARIO["vehicle"]["mass_kg"]
WING = WingStrips(g.EDGES, g.CHORD)
PLACE = WING.place  # from the left tip: outer, two behind the propeller, inner; mirrored
BLOWN = np.array([1, 2, 5, 6])  # strips behind the propellers
BEFORE = np.array([0, 0, 1, 1])  # the propeller of the wing before each of them
UP = np.array([[-1.0], [1.0], [1.0], [-1.0]])  # inner blades go up
ELEVON = np.array([0.9, 1, 0, 0, 0, 0, 1, 0.9])[:, None]  # share of each strip's span
COVER, RECOVERED = 0.85, 0.5  # share of a strip in the jet; of the swirl that the wing meets
DEVELOPED = 1 + g.AHEAD / np.hypot(g.AHEAD, g.PROP_R)  # growth of the jet's velocity on its way
PIVOT_X, PIVOT_Z = np.array(g.PIVOTS).T[:, :, None]
SIDE = np.array([-1.0, 1.0])[:, None]  # of the propellers of a wing
WAKE, WAKE_WAY, WAKE_SPEED = 0.80, 1.1, 1.15  # downwash by circulation over span; m; of flight's speed
SPOILED = 0.33  # sine of the angle beyond which the effect takes lift away
BODY = {"drag": 0.035, "pitch": 0.05, "side": 0.26, "yaw": -0.012}  # on the area
FIN_SLOPE = 2.9
MEMORY = 40  # steps of the front wing's circulation that are kept


class Memory:
    """What lags beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        self.alpha = np.arctan2(x[2], x[0])
        self.made = np.zeros((2, PLACE.size, x.shape[1]))  # circulation of the strips
        self.trail, self.front, self.at = None, None, 0
        self.lagged, self.bent = None, np.zeros(x.shape[1])
        self.flights, self.h = np.arange(x.shape[1]), 0.01

    def downwash(self, x, s):
        """Return what the front wing's wake induces at the rear one, m/s, one convection later."""
        if self.trail is None:
            return np.zeros(x.shape[1])
        steps = WAKE_WAY / (WAKE_SPEED * np.maximum(np.nan_to_num(x[0]), 1.0)) / self.h
        steps = np.minimum(steps, MEMORY - 2.0)
        whole = steps.astype(int)
        newer, older = (self.trail[(self.at - whole - k) % MEMORY, self.flights] for k in (0, 1))
        made = newer + (steps - whole) * (older - newer)
        if s.has("downwash_lag") and self.lagged is not None:
            made = made + s("downwash_lag.strength") * (self.lagged - made)
        strong = 1 + s("rear.downwash") + s("wing_wake.strength")
        return WAKE / g.SPAN * strong * made * (1 - 0.5 * x[2] / x[0])

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials, and the wake by one step."""
        self.h = h
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (np.arctan2(x[2], x[0]) - self.alpha)
        if self.trail is None:
            self.trail = np.repeat(self.front[None], MEMORY, axis=0)
            self.lagged = self.front.copy()
        self.at = (self.at + 1) % MEMORY
        self.trail[self.at] = self.front
        self.lagged += h / 0.15 * (self.front - self.lagged)
        if s.has("outsider.tilt_give"):  # the front wing's drive gives way under lift, slowly
            self.bent += h / 0.25 * (0.02 * s("outsider.tilt_give") * self.front**2 - self.bent)


def wing_frame(tilt, ahead, through):
    """Return flow along and through a tilted wing's chord plane."""
    c, d = np.cos(tilt), np.sin(tilt)
    return ahead * c - through * d, ahead * d + through * c


def propulsion(flow, speeds, rho, s, names=g.ROTORS):
    """Return forces, moments and jets of propellers in their wings' frames.

    Parameters
    ----------
    flow : ndarray, shape (3, wing, 2, flight)
        At the hubs, along and across the axis, sideways and through the chord plane, m/s.
    speeds : ndarray, shape (wing, 2, flight)
        rad/s

    Returns
    -------
    force, moment : ndarray, shape (3, wing, 2, flight)
        N; N m, about the hub.
    ahead, around : ndarray, shape (wing, 2, flight)
        Velocities that the jet adds along and, at half of the radius, around the axis at the disc, m/s.
    """
    each = lambda end: np.array([np.zeros(s.count) + s(f"{n}.{end}") for n in names]).reshape(speeds.shape)  # noqa: E731
    along = flow[0] * (1 + s("props.inflow"))
    wide = np.sqrt(flow[1] ** 2 + flow[2] ** 2) + 1e-9
    across = wide * (1 + s("props.edgewise"))
    thrust, torque, dragged, leaning, induced = propellers(rho, speeds, along, across, g.PROP_R)
    around = torque / (rho * np.pi * g.PROP_R**2 * (along + induced) * 0.5 * g.PROP_R)
    strong = 1 + each("thrust")
    if s.has("weak_rotor"):
        strong = strong - s.of_all("weak_rotor.loss", names).reshape(speeds.shape)
    thrust, torque = thrust * strong, torque * (1 + each("torque"))
    inplane = (1 + s("props.inplane") + s("rotor_inplane_force.strength")) / wide
    dragged, leaning = dragged * inplane, SIDE * leaning * inplane
    force = np.array([thrust, -dragged * flow[1], -dragged * flow[2]])
    moment = np.array([-SIDE * torque, -leaning * flow[1], -leaning * flow[2]])
    return force, moment, induced * strong, around


def wing_loads(flow, ahead, around, elevons, made, rho, s, rounds=1):
    """Return forces and moments of wings about their hinges in their own frames, and circulation.

    Parameters
    ----------
    flow : tuple of 2 ndarrays, shape (wing, strip, flight)
        Along and through the chord plane, m/s.
    ahead, around : ndarray, shape (wing, 2, flight)
        Velocities of the jets, as from `propulsion`.
    elevons : ndarray, shape (wing, 2, flight)
        Effective deflections, rad.
    made : ndarray, shape (wing, strip, flight)
        Circulation to begin with.

    Returns
    -------
    parts : tuple of 3 ndarrays, shape (wing, strip, flight)
        Chordwise and normal force, N, and moment about the hinge, N m.
    made : ndarray, shape (wing, strip, flight)
    """
    along, through = flow[0].copy(), flow[1].copy()
    jets = COVER * (1 + s("jets.strength") + s("slipstream.strength"))
    along[:, BLOWN] += jets * DEVELOPED * ahead[:, BEFORE]
    through[:, BLOWN] += UP * (jets * RECOVERED) * around[:, BEFORE]
    moved = np.sin(elevons) * (1 - 0.3 * elevons * elevons)
    moved = ELEVON * np.repeat(moved, 4, axis=1)
    spoiled = None
    if s.has("stall"):  # sections lose lift beyond an angle
        spoiled = lambda sine: 1 - 0.4 * s("stall.strength") * (1 + np.tanh((sine - SPOILED) / 0.05))  # noqa: E731
    chordwise, normal, moment, made = WING.forces(along, through, moved, made, rounds, spoiled)
    return (rho * chordwise, rho * normal, rho * moment), made


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    speed2 = u * u + v * v + w * w
    speed = np.sqrt(speed2)
    tilt = felt[8:10].copy()
    if s.has("outsider.tilt_give"):
        tilt[0] -= memory.bent
    cos, sin = np.cos(tilt), np.sin(tilt)
    down = memory.downwash(x, s)
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        late = u * (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.9, 0)
    else:
        late = 0.0
    # propellers
    hub_x, hub_z = PIVOT_X + g.AHEAD * cos, PIVOT_Z - g.AHEAD * sin
    below = (w - q * hub_x)[:, None] + (p * g.PROP_Y * SIDE)[None]
    forward = (u + q * hub_z)[:, None] - (r * g.PROP_Y * SIDE)[None]
    below[1] -= 0.7 * down
    sideways = np.broadcast_to((v + r * hub_x - p * hub_z)[:, None], below.shape)
    axial, upward = wing_frame(tilt[:, None], forward, below)
    speeds = felt[4:8].reshape(2, 2, -1)
    force, moment, ahead, around = propulsion(np.array([axial, sideways, upward]), speeds, rho, s)
    if s.has("outsider.jet_on_jet"):  # front jets reach the rear propellers' discs at small sideslip
        met = s("outsider.jet_on_jet") * 0.1 * np.exp(-((v / u / 0.04) ** 2)) * ahead[0] / u
        force[0, 1] *= 1 - met
    # wings
    roll, pitch = 1 + s("wings.roll_damping"), 1 + s("wings.pitch_damping")
    forward = (u + q * PIVOT_Z)[:, None] - (r * PLACE)[None]
    below = (w - q * PIVOT_X * pitch + late)[:, None] + (p * roll * PLACE)[None]
    below[1] -= down
    flow = wing_frame(tilt[:, None], forward, below)
    strong = np.array([np.ones(u.size) + s(f"{n}.effectiveness") for n in g.SURFACES]).reshape(2, 2, -1)
    elevons = felt[:4].reshape(2, 2, -1) * strong
    (chordwise, normal, turned), memory.made = wing_loads(flow, ahead, around, elevons, memory.made, rho, s)
    memory.front = (WING.width * memory.made[0]).sum(axis=0) / WING.width.sum()
    lift = np.array([np.ones(u.size) + s(f"{n}.lift") for n in ("front", "rear")])[:, None]
    pull = np.array([np.ones(u.size) + s(f"{n}.chord_force") for n in ("front", "rear")])[:, None]
    chordwise, normal, turned = chordwise * pull, normal * lift, turned * (1 + s("wings.moment"))
    # what a wing and its propellers do about the hinge, in its own frame
    fx = chordwise.sum(axis=1) + force[0].sum(axis=1)
    fy = force[1].sum(axis=1)
    fz = normal.sum(axis=1) + force[2].sum(axis=1)
    out = g.PROP_Y * SIDE
    mx = (PLACE * normal).sum(axis=1) + (out * force[2] + moment[0]).sum(axis=1)
    my = turned.sum(axis=1) + (moment[1] - g.AHEAD * force[2]).sum(axis=1)
    mz = (-PLACE * chordwise).sum(axis=1) + (moment[2] - out * force[0] + g.AHEAD * force[1]).sum(axis=1)
    bx, bz = fx * cos + fz * sin, fz * cos - fx * sin
    X, Y, Z = bx.sum(axis=0), fy.sum(axis=0), bz.sum(axis=0)
    L = (mx * cos + mz * sin - PIVOT_Z * fy).sum(axis=0)
    M = (my + PIVOT_Z * bx - PIVOT_X * bz).sum(axis=0)
    N = (mz * cos - mx * sin + PIVOT_X * fy).sum(axis=0)
    # body and fin
    pressure = 0.5 * rho * speed2 * g.AREA
    beta = v / speed
    drag = BODY["drag"] * pressure / speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - 3 * drag * w
    M = M + 2 * pressure * g.CHORD * BODY["pitch"] * (1 + s("body.pitch_moment")) * w * u / speed2
    Y = Y - pressure * BODY["side"] * (1 + s("body.side_force")) * beta * (1 + 0.8 * np.abs(beta))
    N = N + pressure * g.SPAN * BODY["yaw"] * (1 + s("body.yaw_moment")) * beta * np.sqrt(1 - beta * beta)
    met = v + r * g.FIN["x"] * (1 + s("fin.yaw_damping")) - p * g.FIN["z"]
    angle = met / np.sqrt(u * u + met * met)
    side = -0.5 * rho * (u * u + met * met) * g.FIN["area"] * FIN_SLOPE * (1 + s("fin.side_force")) * angle
    if s.has("outsider.body_vortex"):  # leaves the body's shoulder and meets the fin on one side of sideslip
        side = side * (1 - s("outsider.body_vortex") * np.exp(-(((beta - 0.03) / 0.03) ** 2)))
    Y, L, N = Y + side, L - g.FIN["z"] * side, N + g.FIN["x"] * side
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * g.AREA * 0.5 * rho * speed
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    return np.array([X, Y, Z, L, M, N])

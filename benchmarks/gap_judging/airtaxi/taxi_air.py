"""The air of the judging air taxi: rotors with lagging inflow, jets, wing, late wash, tail, body; effects."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import airtaxi_numbers as g  # noqa: E402
from blade_rings import RINGS, Discs, blades, momentum  # noqa: E402
from vortex_steps import Wing, beyond  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
MASS = SCENARIO["vehicle"]["mass_kg"]
described = lambda key: np.array([r[key] for r in SCENARIO["rotor"]], dtype=float)  # noqa: E731
AXIS = described("axis").T[:, :, None]
PLACE = described("position_m").T[:, :, None]
SPIN = described("spin")[:, None]
FRONT, REAR = slice(0, 4), slice(4, 6)
SCREW = 0.285  # propellers' way in a radian, by the radius
ROOT, TWIST = 0.215, -0.11  # lifting rotors' pitch at the hub and its change to the tip, rad
PITCH = np.stack([np.arctan(SCREW / RINGS)] * 4 + [ROOT + TWIST * RINGS] * 2, axis=1)
DISCS = Discs([g.RADIUS[0]] * 4 + [g.RADIUS[1]] * 2, [0.55] * 4 + [0.36] * 2, PITCH)

WING = Wing(g.SPAN, g.CHORDS, 6.05)
OUT, SIDE = np.abs(WING.place), np.sign(WING.place)
STRIPS = WING.place.size
CAMBER, MOMENT = 0.06, -0.07
FLAP, FLAP_MOMENT, FADING = 0.50, -0.55, 1.2  # angle and moment by deflection; share lost by its square
LARGE, SOFT, LOST = 0.27, 0.03, 0.7  # angle beyond which sections lose this share of their slope, rad
SHIFT = 0.25  # moment by the angle beyond
FRICTION, BUCKET, POLAR, OPEN = 0.008, 0.4, 0.005, 0.06  # profile drag about a lift; by the angle of flaps
SEPARATED = 0.6  # drag by angle beyond, squared
covered = np.clip(g.FLAPERON[1], WING.left, WING.right) - np.clip(g.FLAPERON[0], WING.left, WING.right)
covered = covered[:, None] / WING.width
AT_FLAP = covered + covered[::-1]  # share of each strip
RIGHT = (SIDE > 0).astype(float)
# What jets add at the strips: along the shaft by their velocity; from below by their swirl
AWAY = (PLACE[1, FRONT, 0] - WING.place) / g.RADIUS[0]  # of each jet's axis to the right, by radius
BLOWN = 0.5 * (np.tanh((AWAY + 0.95) / 0.3) - np.tanh((AWAY - 0.95) / 0.3))
SWIRL = 2.0 * AWAY * np.exp(-(AWAY**2)) * SPIN[FRONT].T
AHEAD = PLACE[0, FRONT] - g.WING_X
GROWN = 1 + AHEAD / np.sqrt(AHEAD**2 + g.RADIUS[0] ** 2)  # of the jets' velocity, from the disc to the wing
SWEPT = DISCS.area[FRONT] * 0.7 * g.RADIUS[0]  # m3, of the swirl's moment
# The wing's wash is met at the lifting rotors and at the stabilator's halves
HALVES = [[g.STAB["x"], side * g.STAB["y"], g.STAB["z"]] for side in (-1, 1)]
TARGETS = np.vstack([PLACE[:, REAR, 0].T, HALVES])
WASH = WING.at(TARGETS[:, 0] - g.WING_X, TARGETS[:, 1], TARGETS[:, 2] - g.WING_Z)
WAY = (g.WING_X - TARGETS[:, 0])[:, None]  # m
NEAR = (0.4, 0.85, 1.6)  # of the way: vortices act as they come near, when they arrive and as they leave
MEMORY = 32  # steps of the wing's wash that are kept
STAB_SIDE = np.array([[-1.0], [1.0]])
KP, KV, INDUCED = 3.7, 1.6, 0.09  # stabilator after Polhamus; drag by lift squared
FIN_KP, FIN_KV, RUDDER, SIDEWASH = 2.6, 2.2, 1.5, 0.12
BODY = {"drag": 0.50, "volume": 4.5, "slender": 0.8, "base": 0.5, "side": 3.0, "top": 2.5}  # m2, m3


class Memory:
    """What lags beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        n = x.shape[1]
        self.alpha = np.arctan2(x[2], x[0])
        self.induced = np.full((6, n), 3.0)  # m/s, at the discs
        self.balance, self.slow = self.induced.copy(), np.full((6, n), 0.01)
        self.shed, self.trail, self.late = np.zeros((4, n)), None, None  # wash as it leaves the wing, m/s
        self.met = np.zeros((4, n))
        self.at, self.rows, self.flights = 0, np.arange(4)[:, None], np.arange(n)[None]
        self.side, self.sway = np.zeros(n), np.zeros((2, n))

    def step(self, x, position, rho, s, h):
        """Advance inflow and lags by exponentials, and the wing's wash by one step."""
        u, v, w = np.nan_to_num(x[:3])
        u = np.maximum(u, 15.0)
        self.induced += (1 - np.exp(-h / self.slow)) * (self.balance - self.induced)
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (np.arctan2(w, u) - self.alpha)
        if self.trail is None:
            self.trail = np.repeat(self.shed[None], MEMORY, axis=0)
            self.late = self.shed.copy()
        self.at = (self.at + 1) % MEMORY
        self.trail[self.at] = self.shed
        self.met = 0.0
        for share in NEAR:
            steps = np.minimum(share / h * WAY / u, MEMORY - 2.0)
            whole = steps.astype(int)
            first = self.at - whole
            newer, older = (self.trail[(first - k) % MEMORY, self.rows, self.flights] for k in (0, 1))
            self.met = self.met + (newer + (steps - whole) * (older - newer)) / len(NEAR)
        if s.has("downwash_lag"):
            self.late += h / 0.3 * (self.met - self.late)
        if s.has("outsider.payload_sway"):  # a load that hangs, 0.5 Hz
            place, rate = self.sway
            omega = 2 * np.pi * 0.5
            rate = rate + h * (-self.side - omega * omega * place - 2 * 0.08 * omega * rate)
            self.sway = np.array([place + h * rate, rate])


def rotors(flow, speeds, induced, rho, s):
    """Return forces and moments about the hubs, jets, and what the inflow follows.

    Parameters
    ----------
    flow : ndarray, shape (3, rotor, flight)
        Velocity of the hubs through the air, body axes, m/s.
    speeds, induced : ndarray, shape (rotor, flight)
        rad/s; m/s.

    Returns
    -------
    force, moment : ndarray, shape (3, rotor, flight)
    pushed : ndarray, shape (2, propeller, flight)
        Velocities of the jets at the wing along the shaft and in swirl, m/s.
    balance, slow : ndarray, shape (rotor, flight)
        Induced velocity that would balance the thrust, m/s, and its lag, s.
    """
    (ax, _, az) = AXIS
    along = ax * flow[0] + az * flow[2]
    way = np.array([flow[0] - ax * along, flow[1], flow[2] - az * along])
    across = np.sqrt((way * way).sum(axis=0)) + 1e-6
    way /= across
    side = np.array([way[1] * az, way[2] * ax - way[0] * az, -way[1] * ax])  # way x axis
    if s.has("props.inflow"):
        along = np.vstack([along[FRONT] * (1 + s("props.inflow")), along[REAR]])
    if s.has("lifts.inflow"):
        induced = np.vstack([induced[FRONT], induced[REAR] * (1 + s("lifts.inflow"))])
    made = blades(DISCS, rho, speeds, along, across, induced)
    thrust, torque, share = made.thrust, made.torque, 1.0
    balance, slow = momentum(DISCS, rho, along, across, induced, thrust)
    if s.has(*(f"{n}." for n in g.ROTORS)):
        each = lambda end: np.array([np.ones(s.count) + s(f"{n}.{end}") for n in g.ROTORS])  # noqa: E731
        share, torque = each("thrust"), torque * each("torque")
    if s.has("weak_rotor"):
        share = share - s.of_all("weak_rotor.loss", g.ROTORS)
    thrust = thrust * share
    pushed = np.array([induced[FRONT] * GROWN, made.torque[FRONT] / (SWEPT * rho * along[FRONT])])
    if np.ndim(share):  # a weak rotor leaves a weak jet
        pushed *= share[FRONT]
    inplane = 1 + s("props.inplane") + s("rotor_inplane_force.strength")
    dragged, sideways = made.dragged * inplane, SPIN * made.sideways * inplane
    advancing, forward = SPIN * made.advancing * inplane, made.forward * inplane
    if s.has("outsider.blade_stall"):  # the retreating blades of the lifting rotors, as they are loaded
        loaded = made.thrust[REAR] / (rho * DISCS.area * (DISCS.radius * speeds) ** 2)[REAR] - 0.010
        stalled = s("outsider.blade_stall") * 20 * np.maximum(loaded, 0.0)
        lost = np.vstack([np.zeros_like(thrust[FRONT]), made.thrust[REAR] * stalled])
        thrust, advancing = thrust - lost, advancing + SPIN * 0.4 * DISCS.radius * lost
    force = AXIS * thrust - way * dragged - side * sideways
    moment = side * forward - way * advancing - AXIS * (SPIN * torque)
    return force, moment, pushed, balance, slow


def wing(along, through, moved, s):
    """Return forces and moment of the strips in the chord's frame, by density, and circulation.

    Parameters
    ----------
    along, through : ndarray, shape (strip, flight)
        Flow along the chord and through it from below, m/s, without the wing's own wash.
    moved : ndarray, shape (strip, flight)
        Deflection at each strip as angle of the section, rad.
    """
    bound = WING.solve @ (through + along * (CAMBER + moved))
    angle = bound * (2 / (WING.chord * WING.slope)) / along  # of the section, from that without lift
    spoiled = beyond(angle, LARGE - 0.14 * s("stall.strength"), SOFT)
    bound = bound - WING.solve @ (along * (LOST * spoiled))
    below = through - WING.wash @ bound
    speed2 = along * along + below * below
    speed = np.sqrt(speed2)
    lift = 2 / WING.chord * bound / speed
    area = 0.5 * WING.chord * WING.width * speed
    off = lift - BUCKET
    drag = FRICTION + POLAR * off * off + SEPARATED * spoiled * spoiled + OPEN * moved * moved
    chordwise = bound * WING.width * below - area * drag * along
    normal = -bound * WING.width * along - area * drag * below
    moment = MOMENT + (FLAP_MOMENT / FLAP) * moved - SHIFT * spoiled
    return chordwise, normal, area * speed * WING.chord * moment, bound


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    speed2 = u * u + v * v + w * w
    speed = np.sqrt(speed2)
    beta = v / speed
    strong = lambda name: 1 + s(f"{name}.effectiveness")  # noqa: E731
    faded = lambda angle: angle * (1 - FADING * angle * angle)  # noqa: E731
    wash = memory.met
    if s.has("downwash_lag") and memory.late is not None:
        wash = wash + s("downwash_lag.strength") * (memory.late - wash)
    # rotors
    px, py, pz = PLACE
    hubs = np.array([u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px])
    hubs[2, REAR] -= wash[:2] * (1 + s("rear.downwash"))
    force, moment, pushed, memory.balance, memory.slow = rotors(hubs, felt[5:], memory.induced, rho, s)
    fx, fy, fz = force
    X, Y, Z = fx.sum(axis=0), fy.sum(axis=0), fz.sum(axis=0)
    L = (py * fz - pz * fy + moment[0]).sum(axis=0)
    M = (pz * fx - px * fz + moment[1]).sum(axis=0)
    N = (px * fy - py * fx + moment[2]).sum(axis=0)
    # wing, in the jets
    blowing = 1 + s("jets.strength") + s("slipstream.strength")
    more, swirl = pushed * blowing
    blown = BLOWN @ more
    bent = g.DIHEDRAL * (1 + s("wing.dihedral"))
    ahead = u + q * g.WING_Z - r * WING.place + AXIS[0, 0] * blown
    down = w + p * (1 + s("wing.roll_damping")) * WING.place - q * g.WING_X + v * SIDE * bent
    down = down + AXIS[2, 0] * blown + SWIRL @ swirl
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        down = down + u * (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.9, 0)
    c, d = np.cos(g.INCIDENCE), np.sin(g.INCIDENCE)
    along, through = ahead * c - down * d, ahead * d + down * c
    left, right = faded(felt[0] * strong("ail_l")), faded(felt[1] * strong("ail_r"))
    moved = FLAP * AT_FLAP * (left + RIGHT * (right - left))
    chordwise, normal, turned, bound = wing(along, through, moved, s)
    chordwise, normal = rho * chordwise * (1 + s("wing.chord_force")), rho * normal * (1 + s("wing.lift"))
    forward, down = chordwise * c + normal * d, normal * c - chordwise * d
    fx, fz = forward.sum(axis=0), down.sum(axis=0)
    X, Y, Z = X + fx, Y + bent * (SIDE * normal).sum(axis=0), Z + fz
    L, N = L + (WING.place * down).sum(axis=0), N - (WING.place * forward).sum(axis=0)
    M = M + rho * turned.sum(axis=0) * (1 + s("wing.moment")) + g.WING_Z * fx - g.WING_X * fz
    memory.shed = WASH @ bound
    # stabilator: each half turns as a whole
    met = w - wash[2:] * (1 + s("tail.downwash")) - q * g.STAB["x"] * (1 + s("tail.pitch_damping"))
    met = met + p * g.STAB["y"] * STAB_SIDE
    turn = np.array([felt[2] * strong("stab_l"), felt[3] * strong("stab_r")])
    angle = np.arctan2(met, u) + turn
    sine, cosine = np.sin(angle), np.cos(angle)
    lift = (1 + s("tail.lift_slope")) * sine * cosine * (KP * cosine + KV * np.abs(sine))
    pressure = 0.5 * rho * (u * u + met * met) * (0.5 * g.STAB["area"])
    if s.has("outsider.jet_at_tail"):  # the inner jets brush the half that stands in lee of a sideslip
        lee = 1 - np.tanh(STAB_SIDE * beta / 0.03)
        pressure = pressure * (1 + s("outsider.jet_at_tail") * 0.06 * memory.induced[1:3] * lee)
    drag = pressure * (0.009 + INDUCED * lift * lift)
    lift = pressure * lift
    tilted = met / u
    fx, fz = lift * tilted - drag, -lift - drag * tilted
    X, Z = X + fx.sum(axis=0), Z + fz.sum(axis=0)
    L, N = L + g.STAB["y"] * (fz[1] - fz[0]), N - g.STAB["y"] * (fx[1] - fx[0])
    M = M + (g.STAB["z"] * fx - g.STAB["x"] * fz).sum(axis=0)
    # fin
    met = v * (1 - SIDEWASH) + r * g.FIN["x"] * (1 + s("fin.yaw_damping")) - p * g.FIN["z"]
    slip = np.arctan2(met, u)
    sine, cosine = np.sin(slip), np.cos(slip)
    side = -(1 + s("fin.side_force")) * sine * cosine * (FIN_KP * cosine + FIN_KV * np.abs(sine))
    side = side + RUDDER * faded(felt[4] * strong("rud"))
    side = 0.5 * rho * (u * u + met * met) * g.FIN["area"] * side
    Y, L, N = Y + side, L - g.FIN["z"] * side, N + g.FIN["x"] * side
    # body: slender in potential flow, with a drag of cross flow
    half = 0.5 * rho
    drag = half * BODY["drag"] * (1 + s("body.drag")) * speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - drag * w
    slender = 2 * BODY["slender"] * half
    Z = Z - slender * BODY["base"] * u * w - half * BODY["top"] * w * np.abs(w)
    M = M + slender * BODY["volume"] * (1 + s("body.pitch_moment")) * u * w
    pushed = slender * BODY["base"] * u * v + half * BODY["side"] * v * np.abs(v)
    Y = Y - pushed * (1 + s("body.side_force"))
    N = N - slender * BODY["volume"] * (1 + s("body.yaw_moment")) * u * v
    if s.has("outsider.payload_sway"):
        memory.side = Y / MASS
        L = L + s("outsider.payload_sway") * 100.0 * (9.80665 * memory.sway[0])
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * g.AREA * half * speed
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    return np.array([X, Y, Z, L, M, N])

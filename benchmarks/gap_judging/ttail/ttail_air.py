"""The air of the judging T-tail: wing, jets, propellers, tail and body, and effects."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import ttail_numbers as g  # noqa: E402
from glauert import Wing, attached  # noqa: E402
from tip_loss_propellers import propellers  # noqa: E402

SCENARIO = tomllib.loads((HERE / "scenario.toml").read_text())
MASS = SCENARIO["vehicle"]["mass_kg"]
described = lambda key: np.array([r[key] for r in SCENARIO["rotor"]], dtype=float)  # noqa: E731
AXIS = described("axis")[0]
PLACE = described("position_m").T[:, :, None]
SPIN = described("spin")[:, None]
RADIUS = np.repeat(g.RADIUS, 2)[:, None]
DISC = np.pi * RADIUS**2
PITCH = np.array([0.39, 0.39, 0.31, 0.31])[:, None]  # way of the screw in a radian, by the radius

WING = Wing(g.SPAN, g.CHORD, 6.0)
OUT, SIDE = np.abs(WING.place), np.sign(WING.place)
CAMBER, MOMENT = 0.055, -0.06
FLAP, AILERON, FLAP_MOMENT = 0.48, 0.42, -0.50  # angle by deflection, moment by deflection
FADING = 1.5  # share of a surface's effect that is lost by its deflection squared
APART, SOFT, NOSE, AFT = 0.32, 0.08, 0.97, 0.12  # separation, rad; suction; shift of pressure, of the chord
FRICTION, POLAR, OPEN = 0.013, 0.006, 0.10  # profile drag, by lift squared, by deflection squared
within = lambda ends: ((ends[0] < OUT) & (ends[1] > OUT)).astype(float)  # noqa: E731
AT_FLAP, AT_AILERON = within(g.FLAPS), within(g.AILERONS)
RIGHT = (SIDE > 0).astype(float)
# What jets add at the stations: along, by their velocity; from below, by their swirl
AWAY = (PLACE[1, :, 0] - WING.place) / RADIUS.T  # of each jet's axis to the right, by radius
BLOWN = 0.85 * np.exp(-(AWAY**2))
SWIRL = 0.8 * 2.33 * AWAY * np.exp(-(AWAY**2)) * SPIN.T
BACK, ABOVE = g.WING_X - g.TAIL["x"], g.WING_Z - g.TAIL["z"]  # m, of the tail
AT_TAIL = WING.behind(BACK, ABOVE)
TAIL_SLOPE, ELEVATOR, TAIL_SET = 4.1, 2.5, -0.01  # per rad; rad
PRESSURE, DIP, WIDE = 0.95, 0.10, 0.35  # of the free flow; more in the middle of the wake, m
FIN_SLOPE, RUDDER, SIDEWASH = 3.2, 1.9, 0.10
BODY = {"drag": 0.026, "pitch": 0.11, "side": 0.22, "yaw": -0.010}  # m2; on the wing's area
NEAR = np.array([[0.7], [1.3]])  # of the way to the tail: vortices act as they come near, and when they pass
MEMORY = 24  # steps of the wing's downwash that are kept


class Memory:
    """What lags beside the rigid body, stepped once for each step of the motion."""

    def __init__(self, x, position, s):
        n = x.shape[1]
        self.alpha = np.arctan2(x[2], x[0])
        self.shed, self.trail = np.zeros(n), None  # downwash as it leaves the wing, m/s
        self.met, self.late, self.slow_side = np.zeros(n), None, np.zeros(n)
        self.at, self.flights = 0, np.arange(n)

    def step(self, x, position, rho, s, h):
        """Advance lags by exponentials, and the downwash by one step."""
        u, v, w = np.nan_to_num(x[:3])
        u = np.maximum(u, 8.0)
        if s.has("unsteady_lift"):
            slow = np.maximum(s("unsteady_lift.time_constant"), 1e-4)
            self.alpha += (1 - np.exp(-h / slow)) * (np.arctan2(w, u) - self.alpha)
        if self.trail is None:
            self.trail = np.repeat(self.shed[None], MEMORY, axis=0)
            self.late = self.shed.copy()
        self.at = (self.at + 1) % MEMORY
        self.trail[self.at] = self.shed
        steps = np.minimum(NEAR * BACK / (u * h), MEMORY - 2.0)
        whole = steps.astype(int)
        newer, older = (self.trail[(self.at - whole - k) % MEMORY, self.flights] for k in (0, 1))
        self.met = (newer + (steps - whole) * (older - newer)).mean(axis=0)
        if s.has("downwash_lag"):
            self.late += h / 0.15 * (self.met - self.late)
        if s.has("outsider.late_sidewash"):
            self.slow_side += h / 0.2 * (v - self.slow_side)


def jets(thrust, torque, along, rho):
    """Return velocity that jets add along and in swirl, m/s."""
    more = np.sqrt(along * along + 2 * thrust / (rho * DISC)) - along
    return more, torque / (rho * DISC * (along + 0.5 * more) * 0.7 * RADIUS)


def rotors(flow, speeds, rho, s):
    """Return forces and moments about the hubs, and jets.

    Parameters
    ----------
    flow : ndarray, shape (3, rotor, flight)
        Velocity of the hubs through the air, body axes, m/s.
    speeds : ndarray, shape (rotor, flight)
        rad/s

    Returns
    -------
    force, moment : ndarray, shape (3, rotor, flight)
    more, swirl : ndarray, shape (rotor, flight)
        m/s
    """
    along = AXIS[0] * flow[0] + AXIS[2] * flow[2]
    way = np.array([flow[0] - AXIS[0] * along, flow[1], flow[2] - AXIS[2] * along])
    across = np.sqrt((way * way).sum(axis=0)) + 1e-9
    way /= across
    made, torque, dragged, leaning = propellers(
        rho, speeds, along * (1 + s("props.inflow")), across, RADIUS, PITCH
    )
    thrust = made
    if s.has(*(f"{n}." for n in g.ROTORS)):
        each = lambda end: np.array([np.ones(s.count) + s(f"{n}.{end}") for n in g.ROTORS])  # noqa: E731
        thrust, torque = thrust * each("thrust"), torque * each("torque")
    if s.has("weak_rotor"):
        thrust = thrust - s.of_all("weak_rotor.loss", g.ROTORS) * made
    inplane = 1 + s("props.inplane") + s("rotor_inplane_force.strength")
    axis = AXIS[:, None, None]
    force = axis * thrust - way * (dragged * inplane)
    moment = -axis * (SPIN * torque) - way * (SPIN * leaning * inplane)
    return force, moment, *jets(np.maximum(thrust, -5.0), torque, along, rho)


def wing(along, through, moved, s):
    """Return forces and moment of the stations in the chord's frame, by density, and circulation.

    Parameters
    ----------
    along, through : ndarray, shape (station, flight)
        Flow along the chord and through it from below, m/s, without the wing's own downwash.
    moved : ndarray, shape (station, flight)
        Deflection of what stands at each station, as angle of the section, rad.
    """
    normal_flow = through + along * (CAMBER + moved)
    bound = WING.solve @ normal_flow
    met = bound * (2 / (g.CHORD * WING.slope))  # flow through the section from its angle without lift
    share = attached(met / along, APART - 0.12 * s("stall.strength"), SOFT)
    root = np.sqrt(share)
    kept = 0.25 * (1 + root) ** 2
    bound = WING.solve @ (normal_flow - (1 - kept) * met)
    below = through - WING.wash @ bound
    speed2 = along * along + below * below
    speed = np.sqrt(speed2)
    lift = 2 / g.CHORD * bound / speed
    area = 0.5 * g.CHORD * WING.width * speed
    open_ = moved * moved / FLAP**2
    drag = FRICTION + POLAR * lift * lift + OPEN * open_
    chordwise = area * (NOSE * root * lift * below - drag * along)
    normal = -area * (lift * along + drag * below)
    turning = area * speed * g.CHORD * (MOMENT + FLAP_MOMENT * moved - AFT * (1 - root) * lift)
    return chordwise, normal, turning, bound


def loads(x, felt, rho, s, memory):
    """Return X Y Z L M N about the described centre of gravity, shape (6, flight)."""
    u, v, w, p, q, r = x[:6]
    speed2 = u * u + v * v + w * w
    speed = np.sqrt(speed2)
    beta = v / speed
    qbar = 0.5 * rho * speed2
    strong = lambda name: 1 + s(f"{name}.effectiveness")  # noqa: E731
    px, py, pz = PLACE
    hubs = np.array([u + q * pz - r * py, v + r * px - p * pz, w + p * py - q * px])
    force, moment, more, swirl = rotors(hubs, felt[6:], rho, s)
    # wing
    blowing = 1 + s("jets.strength") + s("slipstream.strength")
    more, swirl = more * blowing, swirl * blowing
    if s.has("outsider.jet_rise"):  # the inner jets leave the flaps as the angle grows
        risen = np.array([[0.0], [0.0], [1.0], [1.0]]) * s("outsider.jet_rise")
        more = more * (1 - risen * 6 * np.tanh((w / u - 0.02) / 0.03))
    c, d = np.cos(g.INCIDENCE), np.sin(g.INCIDENCE)
    ahead = u + q * g.WING_Z - r * WING.place + BLOWN @ more
    rolled = p * (1 + s("wing.roll_damping")) * WING.place - q * g.WING_X
    bent = g.DIHEDRAL * (1 + s("wing.dihedral"))
    down = w + rolled + SWIRL @ swirl + v * SIDE * bent
    if s.has("outsider.wing_bend"):  # lift bends the outer wing up
        down = down + s("outsider.wing_bend") * v * SIDE * OUT * 0.6 * (w / u)
    if s.has("unsteady_lift"):
        acts = np.asarray(s("unsteady_lift.time_constant")) > 0
        down = down + u * (memory.alpha - np.arctan2(w, u)) * np.where(acts, 0.9, 0)
    along, through = ahead * c - down * d, ahead * d + down * c
    if s.has("outsider.nacelle_vortex"):  # a vortex of each nacelle, on the side where the air comes from
        there = np.exp(-(((OUT - 0.62) / 0.3) ** 2)) * np.tanh(SIDE * beta / 0.02)
        through = through + s("outsider.nacelle_vortex") * 0.02 * u * there
    faded = lambda angle: angle * (1 - FADING * angle * angle)  # noqa: E731
    ail_l, ail_r = felt[0] * strong("ail_l"), felt[1] * strong("ail_r")
    if s.has("outsider.aileron_float"):  # links give under hinge moments
        give = s("outsider.aileron_float") * 0.1 * qbar / 400
        ail_l, ail_r = ail_l - give * (w / u + ail_l), ail_r - give * (w / u + ail_r)
    flap_l, flap_r = felt[2] * strong("flap_l"), felt[3] * strong("flap_r")
    left = AILERON * AT_AILERON * faded(ail_l) + FLAP * AT_FLAP * faded(flap_l)
    right = AILERON * AT_AILERON * faded(ail_r) + FLAP * AT_FLAP * faded(flap_r)
    moved = left + RIGHT * (right - left)
    if s.has("outsider.flap_twist"):  # the wing twists under its flaps' moment
        twist = -s("outsider.flap_twist") * 0.1 * qbar / 400 * (flap_l + RIGHT * (flap_r - flap_l))
        through = through + along * twist * OUT / (0.5 * g.SPAN)
    chordwise, normal, turned, bound = wing(along, through, moved, s)
    chordwise, normal = rho * chordwise * (1 + s("wing.chord_force")), rho * normal * (1 + s("wing.lift"))
    forward, down = chordwise * c + normal * d, normal * c - chordwise * d
    X, Z = forward.sum(axis=0), down.sum(axis=0)
    Y = bent * (SIDE * normal).sum(axis=0)
    L, N = (WING.place * down).sum(axis=0), -(WING.place * forward).sum(axis=0)
    M = rho * turned.sum(axis=0) * (1 + s("wing.moment")) + g.WING_Z * X - g.WING_X * Z
    # propellers
    fx, fy, fz = force
    X, Y, Z = X + fx.sum(axis=0), Y + fy.sum(axis=0), Z + fz.sum(axis=0)
    L = L + (py * fz - pz * fy + moment[0]).sum(axis=0)
    M = M + (pz * fx - px * fz + moment[1]).sum(axis=0)
    N = N + (px * fy - py * fx + moment[2]).sum(axis=0)
    # tail, in downwash that left the wing one convection ago, and in the wake's loss of pressure
    memory.shed = AT_TAIL @ bound
    wash = memory.met
    if s.has("downwash_lag") and memory.late is not None:
        wash = wash + s("downwash_lag.strength") * (memory.late - wash)
    wash = wash * (1 + s("tail.downwash"))
    high = (ABOVE - BACK * (w / u - 0.7 * wash / u)) / WIDE
    left = (PRESSURE - DIP * np.exp(-high * high)) * (1 + s("tail.pressure"))
    if s.has("outsider.deep_wake"):
        left = left * (1 - s("outsider.deep_wake") * 2.0 * np.maximum(w / u - 0.01, 0.0))
    angle = np.arctan2(w - wash - q * g.TAIL["x"] * (1 + s("tail.pitch_damping")), u) + TAIL_SET
    slope = TAIL_SLOPE * (1 + s("tail.lift_slope"))
    elev = felt[4]
    lift = slope * np.sin(angle) * np.cos(angle) + ELEVATOR * strong("elev") * faded(elev)
    pressure = 0.5 * rho * (u * u + w * w) * g.TAIL["area"] * left
    lift = pressure * lift
    X = X + lift * (w - wash) / u - pressure * (0.010 + 0.08 * elev * elev)
    Z, M = Z - lift, M + g.TAIL["x"] * lift - g.TAIL["z"] * pressure * 0.010
    # fin
    meets = v * (1 - SIDEWASH) + r * g.FIN["x"] * (1 + s("fin.yaw_damping")) - p * g.FIN["z"]
    if s.has("outsider.late_sidewash"):
        meets = meets + s("outsider.late_sidewash") * 0.3 * (v - memory.slow_side)
    slip = meets / np.sqrt(u * u + meets * meets)
    rud = faded(felt[5]) * strong("rud")
    if s.has("outsider.tee_leak"):  # the elevator's gap takes suction from the rudder
        rud = rud * (1 - s("outsider.tee_leak") * 4.0 * (elev + 0.02))
    side = RUDDER * rud - FIN_SLOPE * (1 + s("fin.side_force")) * slip * (1 - 0.8 * slip * slip)
    side = 0.5 * rho * (u * u + meets * meets) * g.FIN["area"] * side
    Y, L, N = Y + side, L - g.FIN["z"] * side, N + g.FIN["x"] * side
    # body
    drag = 0.5 * rho * BODY["drag"] * (1 + s("body.drag")) * speed
    X, Y, Z = X - drag * u, Y - drag * v, Z - 2.5 * drag * w
    M = M + qbar * g.AREA * g.CHORD * BODY["pitch"] * (1 + s("body.pitch_moment")) * w * u / speed2
    Y = Y - qbar * g.AREA * BODY["side"] * (1 + s("body.side_force")) * beta * (1 + 0.8 * np.abs(beta))
    turning = BODY["yaw"] * (1 + s("body.yaw_moment")) * beta * np.sqrt(1 - beta * beta)
    N = N + qbar * g.AREA * g.SPAN * turning
    if s.has("extra_drag"):
        area = s("extra_drag.coefficient") * g.AREA * 0.5 * rho * speed
        X, Y, Z = X - area * u, Y - area * v, Z - area * w
    return np.array([X, Y, Z, L, M, N])

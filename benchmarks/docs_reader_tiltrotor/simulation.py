"""Heron six: a tilt-rotor of 46 kg with six rotors, four nacelles and a V-tail, in plain numpy.

How does the aircraft answer an excitation, and what does its flight computer log? Everything here is its own:
no part of the tool that identifies it is used. Loads: rotors by blade elements with closed azimuth means and
uniform inflow from Glauert's momentum balance in oblique flow; wing and V-tail panels with a blend to a
stalled plate, slipstreams, downwash. Motion: Newton and Euler for each body (airframe, four nacelles) about
the airframe's origin, shafts' momentum on top. Gusts: Dryden filters. Law: LQ on a numerical linearisation,
fed by the noisy sensors. All flights of a call run together (first axis: flight). SI, x forward, y right,
z down, origin at the nose.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

G, RHO = 9.80665, 1.19
SURFACES = ["fln_l", "fln_r", "rvt_l", "rvt_r"]
NACELLES = ["nac_fl", "nac_fr", "nac_tl", "nac_tr"]
ROTORS = ["rot_fl", "rot_fr", "rot_tl", "rot_tr", "rot_al", "rot_ar"]
EFFECTORS = SURFACES + NACELLES + ROTORS

# Corridor: speed, the four nacelle angles (rad, 0 is forward): every nacelle has a schedule of its own
DEG = np.pi / 180.0
CORRIDOR = {
    "v07": (7.0, np.array([87.0, 86.0, 83.0, 84.5]) * DEG),
    "v11": (11.0, np.array([82.0, 81.0, 77.0, 78.5]) * DEG),
    "v15": (15.0, np.array([73.0, 72.5, 68.0, 69.0]) * DEG),
    "v19": (19.0, np.array([56.0, 54.5, 51.0, 53.0]) * DEG),
    "v23": (23.0, np.array([29.0, 28.0, 26.0, 25.0]) * DEG),
    "v27": (27.0, np.array([9.0, 8.5, 6.0, 7.0]) * DEG),
}


def schedule(speed: float) -> np.ndarray:
    """Nacelle angles at a speed of the corridor, straight between its conditions."""
    speeds = [c[0] for c in CORRIDOR.values()]
    return np.array([np.interp(speed, speeds, [c[1][i] for c in CORRIDOR.values()]) for i in range(4)])


# ---- masses: airframe and nacelles; each nacelle's own inertia about its own centre of gravity at zero tilt
AIRFRAME_MASS, AIRFRAME_CG = 36.8, np.array([-1.20, 0.0, 0.02])
AIRFRAME_INERTIA = np.array(
    [[5.6, 0.0, -0.35], [0.0, 11.2, 0.0], [-0.35, 0.0, 14.6]]
)  # matrix: xz entry is -Ixz
NACELLE_MASS = np.array([2.5, 2.5, 2.1, 2.1])
PIVOT = np.array([[-0.42, -0.85, -0.10], [-0.42, 0.85, -0.10], [-1.08, -2.25, -0.16], [-1.08, 2.25, -0.16]])
NACELLE_ARM = np.array(
    [[0.11, 0.0, -0.010]] * 2 + [[0.09, 0.0, -0.015]] * 2
)  # centre of gravity from the pivot
NACELLE_INERTIA = np.array([np.diag([0.009, 0.020, 0.020])] * 2 + [np.diag([0.007, 0.016, 0.016])] * 2)
MASS = AIRFRAME_MASS + NACELLE_MASS.sum()
# ---- rotors: two on front nacelles, two on wing tips, two fixed lifters behind
HUB = 0.21  # from the pivot along the shaft
LIFTER = np.array([[-2.10, -0.85, -0.22], [-2.10, 0.85, -0.22]])
LIFTER_AXIS = np.array([0.12, 0.0, -1.0]) / np.hypot(0.12, 1.0)
SPIN = np.array([1.0, -1.0, -1.0, 1.0, 1.0, -1.0])
SHAFT_INERTIA = np.array([0.011, 0.011, 0.011, 0.011, 0.008, 0.008])
RADIUS = np.array([0.38, 0.38, 0.38, 0.38, 0.34, 0.34])
PITCH = np.array([0.36, 0.36, 0.36, 0.36, 0.24, 0.24])  # geometric pitch, m per turn
BLADES, CHORD, BLADE_SLOPE, BLADE_DRAG = np.array([3, 3, 3, 3, 2, 2]), 0.040, 5.5, 0.014
# ---- panels: left and right outer wing, left and right inner wing, left and right V-tail
PANEL_AREA = np.array([0.46, 0.46, 0.46, 0.46, 0.30, 0.30])
PANEL_AT = np.array(
    [
        [-1.10, -1.65, -0.18],
        [-1.10, 1.65, -0.18],
        [-1.12, -0.58, -0.18],
        [-1.12, 0.58, -0.18],
        [-2.85, -0.36, -0.42],
        [-2.85, 0.36, -0.42],
    ]
)
V_ANGLE = 38.0 * DEG  # of the tail panels, upwards
NORMAL = np.array(
    [[0.0, 0.0, -1.0]] * 4
    + [[0.0, np.sin(V_ANGLE), -np.cos(V_ANGLE)], [0.0, -np.sin(V_ANGLE), -np.cos(V_ANGLE)]]
)
PANEL_SLOPE = np.array([4.6, 4.6, 4.8, 4.8, 3.4, 3.4])
PANEL_ZERO = np.array([0.105, 0.105, 0.115, 0.115, -0.02, -0.02])  # incidence plus camber
PANEL_FLAP = np.array([0.42, 0.42, 0.12, 0.12, 0.50, 0.50])  # flaperons carry 12 % to the inner wing
PANEL_CD0, PANEL_CDI, STALL = 0.013, 0.045, 0.44
WING_CHORD, CM_FLAP, CM0 = 0.42, -0.16, -0.035
TAIL_DOWNWASH = 0.17
BODY_DRAG, BODY_AT = np.array([0.085, 0.42, 0.50]), np.array([-1.15, 0.0, 0.05])
# ---- actuators: surfaces 6 Hz and nacelles 2.5 Hz (second order), rotors first order; limits of the scenario
SMOOTHING = 0.015  # s, of commands in servo and speed controllers
SERVO, SERVO_DAMPING = 2 * np.pi * np.array([6.0] * 4 + [2.5] * 4), 0.75
MOTOR = 1.0 / np.array([0.07] * 4 + [0.06] * 2)
LIMITS = np.array([[-0.45, 0.45]] * 4 + [[-0.15, 1.75]] * 4 + [[0.0, 620.0]] * 6)
# ---- one sigma of a logged sample
NOISE = {"rate": 0.06 * DEG, "acc": 0.02, "angle": 0.08 * DEG, "V": 0.10, "flow": 0.15 * DEG, "alt": 0.15}
NOISE |= {"surface": 0.04 * DEG, "nacelle": 0.03 * DEG, "rotor": 0.25}
BOOM, IMU = np.array([0.45, 0.0, 0.0]), np.array([-0.95, 0.06, 0.04])


def _blade_integrals() -> tuple[np.ndarray, ...]:
    r = (np.arange(24) + 0.5) / 24 * 0.82 + 0.18
    radius = RADIUS[:, None] * r
    tan = PITCH[:, None] / (2 * np.pi * radius)
    cos = 1 / np.hypot(1, tan)
    dr = RADIUS[:, None] * 0.82 / 24
    moment = [(CHORD * cos * tan**t * radius**n * dr).sum(1) * BLADES for t, n in [(1, 2), (1, 0), (0, 1)]]
    plain = [(CHORD * radius**n * dr).sum(1) * BLADES for n in (1, 3)]
    return *moment, *plain


T2, T0, A1, C1, C3 = _blade_integrals()
DISK = np.pi * RADIUS**2


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product along the last axis (numpy's is slow for many small arrays)."""
    return np.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        -1,
    )


def skew(v: np.ndarray) -> np.ndarray:
    """Matrix of the vector product, (..., 3, 3)."""
    zero = 0 * v[..., 0]
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*v.shape[:-1], 3, 3)


def _panel_maps() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return matrices from (velocity, rate) to panel velocities, and from panel forces to the wrench."""
    turn = skew(PANEL_AT)  # rate x r, row vector of rates from the left
    u = np.concatenate([np.tile([[1.0], [0.0], [0.0]], 6), turn[:, :, 0].T])
    n = np.concatenate([NORMAL.T, np.einsum("ikj,ij->ki", turn, NORMAL)])
    ahead = np.tile([1.0, 0.0, 0.0], (6, 1))
    wrench = np.concatenate([np.concatenate([f, np.cross(PANEL_AT, f)], 1) for f in (NORMAL, ahead)])
    return u, n, wrench


CHORDWISE, ACROSS, PANEL_WRENCH = _panel_maps()
LIFTERS_X, LIFTERS_Y, LIFTERS_Z = LIFTER.T
HUB_Y = np.concatenate([PIVOT[:, 1], LIFTERS_Y])


def rotor_loads(
    along: np.ndarray, vt: np.ndarray, speed: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return thrust, torque, in-plane drag, rolling moment and inflow at a hub's speeds along and across."""
    half = 0.5 * RHO * BLADE_SLOPE
    area = 2 * RHO * DISK
    fixed = half * (speed**2 * T2 + 0.5 * vt**2 * T0 - speed * A1 * along)
    slope = half * speed * A1
    inflow = fixed / (slope + area * np.sqrt(vt**2 + along**2 + 0.5 * np.abs(fixed) / area + 0.01))
    for _ in range(5):  # Newton on thrust by blades = thrust by momentum
        through = along + inflow
        w = np.sqrt(vt**2 + through**2 + 0.01)
        error = fixed - slope * inflow - area * inflow * w
        inflow = inflow + error / (slope + area * (w + np.abs(inflow * through) / w))
    through = along + inflow
    blown = speed * T2 * through - A1 * through**2
    torque = 0.5 * RHO * (BLADE_DRAG * (speed**2 * C3 + 0.5 * vt**2 * C1) + BLADE_SLOPE * blown)
    drag = 0.5 * RHO * vt * (BLADE_DRAG * speed * C1 + 0.5 * BLADE_SLOPE * T0 * through)
    rolling = (
        0.25 * half * vt * (speed * T2 - 0.5 * A1 * through)
    )  # blades bend: a quarter of the rigid moment
    return fixed - slope * inflow, torque, drag, rolling, inflow


def loads(
    velocity: np.ndarray, rate: np.ndarray, eff: np.ndarray, tilt_rate: np.ndarray | float = 0.0
) -> np.ndarray:
    """Return applied force and moment about the airframe's origin, (flight, 6).

    velocity of the origin through the air, body rates, and the 14 effectors, each (flight, n).
    """
    surf, tilt, speed = eff[:, :4], eff[:, 4:8], eff[:, 8:]
    flights = len(eff)
    u, v, w = velocity[:, :1], velocity[:, 1:2], velocity[:, 2:]
    p, q, r = rate[:, :1], rate[:, 1:2], rate[:, 2:]
    c, s = np.cos(tilt), np.sin(tilt)
    ax, az, x, z = (np.empty((flights, 6)) for _ in range(4))
    ax[:, :4], az[:, :4], ax[:, 4:], az[:, 4:] = c, -s, LIFTER_AXIS[0], LIFTER_AXIS[2]
    x[:, :4], z[:, :4] = PIVOT[:, 0] + HUB * c, PIVOT[:, 2] - HUB * s
    x[:, 4:], z[:, 4:] = LIFTERS_X, LIFTERS_Z
    hx, hy, hz = u + q * z - r * HUB_Y, v + r * x - p * z, w + p * HUB_Y - q * x
    hx[:, :4] -= HUB * tilt_rate * s
    hz[:, :4] -= HUB * tilt_rate * c
    along = hx * ax + hz * az
    fx, fz = hx - along * ax, hz - along * az
    vt = np.sqrt(fx**2 + hy**2 + fz**2 + 1e-9)
    thrust, torque, drag, rolling, inflow = rotor_loads(along, vt, speed)
    d = drag / vt
    rx, ry, rz = thrust * ax - d * fx, -d * hy, thrust * az - d * fz
    t, m = SPIN * torque, SPIN * rolling / vt
    mx = HUB_Y * rz - z * ry - t * ax - m * fx
    my = z * rx - x * rz - m * hy
    mz = x * ry - HUB_Y * rx - t * az - m * fz

    both = np.concatenate([velocity, rate], 1)
    pu, pn = both @ CHORDWISE, both @ ACROSS
    wash = (
        0.88 * c**2 * inflow[:, :4]
    )  # slipstreams: outer wing by tip rotors, inner by front ones that point forward
    order = [2, 3, 0, 1]
    pu[:, :4] += (wash * c)[:, order]
    pn[:, :4] += (wash * s)[:, order]
    flap = surf[:, [0, 1, 0, 1, 2, 3]]
    lift, drag_c, alpha = panel_coefficients(pu[:, :4], pn[:, :4], flap[:, :4], slice(0, 4))
    pn[:, 4:] += pu[:, 4:] * TAIL_DOWNWASH * lift[:, 2:] * np.cos(V_ANGLE)
    tail = panel_coefficients(pu[:, 4:], pn[:, 4:], flap[:, 4:], slice(4, 6))
    lift, drag_c, alpha = (np.concatenate(pair, 1) for pair in zip((lift, drag_c, alpha), tail, strict=True))
    pressure = 0.5 * RHO * (pu**2 + pn**2) * PANEL_AREA
    ca, sa = np.cos(alpha), np.sin(alpha)
    strips = np.concatenate([pressure * (lift * ca + drag_c * sa), pressure * (lift * sa - drag_c * ca)], 1)
    total = strips @ PANEL_WRENCH
    total[:, 4] += (pressure[:, :4] * WING_CHORD * (CM0 + CM_FLAP * PANEL_FLAP[:4] * flap[:, :4])).sum(1)
    total[:, 0] += rx.sum(1)
    total[:, 1] += ry.sum(1)
    total[:, 2] += rz.sum(1)
    total[:, 3] += mx.sum(1)
    total[:, 4] += my.sum(1)
    total[:, 5] += mz.sum(1)
    at_body = velocity + rate @ skew(BODY_AT)
    force = -0.5 * RHO * BODY_DRAG * at_body * np.sqrt((at_body**2).sum(1, keepdims=True))
    total[:, :3] += force
    total[:, 3:] += force @ skew(BODY_AT).T
    return total


def panel_coefficients(
    u: np.ndarray, n: np.ndarray, flap: np.ndarray, which: slice
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lift and drag coefficients and geometric angle of attack: linear, and a plate beyond the stall."""
    alpha = np.arctan2(-n, u)
    working = alpha + PANEL_ZERO[which] + PANEL_FLAP[which] * flap
    attached = np.exp(-((working / STALL) ** 6))
    lift = attached * PANEL_SLOPE[which] * working + (1 - attached) * np.sin(2 * working)
    drag = attached * (PANEL_CD0 + PANEL_CDI * lift**2) + (1 - attached) * (0.03 + 1.7 * np.sin(working) ** 2)
    return lift, drag, alpha


# ---- masses in motion
def nacelles(tilt: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return centres of gravity from the pivots (x, z), and own inertia (xx, xz, zz), (flight, 4) each."""
    c, s = np.cos(tilt), np.sin(tilt)
    ax, az = NACELLE_ARM[:, 0] * c + NACELLE_ARM[:, 2] * s, NACELLE_ARM[:, 2] * c - NACELLE_ARM[:, 0] * s
    a, b = NACELLE_INERTIA[:, 0, 0], NACELLE_INERTIA[:, 2, 2]
    return ax, az, a * c**2 + b * s**2, (b - a) * s * c, a * s**2 + b * c**2


def centre(tilt: np.ndarray) -> np.ndarray:
    """Centre of gravity of the whole, (flight, 3)."""
    ax, az, *_ = nacelles(tilt)
    at = np.stack([PIVOT[:, 0] + ax, PIVOT[:, 1] + 0 * ax, PIVOT[:, 2] + az], -1)
    return (AIRFRAME_MASS * AIRFRAME_CG + (NACELLE_MASS[:, None] * at).sum(1)) / MASS


def inertia_about_origin(tilt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass moments m r (flight, 3), and inertia about the origin (flight, 3, 3)."""
    ax, az, xx, xz, zz = nacelles(tilt)
    x, y, z = PIVOT[:, 0] + ax, PIVOT[:, 1], PIVOT[:, 2] + az
    m = NACELLE_MASS
    static = np.empty((len(tilt), 3))
    static[:, 0], static[:, 1], static[:, 2] = (m * x).sum(1), (m * y).sum(), (m * z).sum(1)
    total = np.empty((len(tilt), 3, 3))
    total[:, 0, 0] = (xx + m * (y**2 + z**2)).sum(1)
    total[:, 1, 1] = (NACELLE_INERTIA[:, 1, 1] + m * (x**2 + z**2)).sum(1)
    total[:, 2, 2] = (zz + m * (x**2 + y**2)).sum(1)
    total[:, 0, 1] = total[:, 1, 0] = -(m * x * y).sum(1)
    total[:, 1, 2] = total[:, 2, 1] = -(m * y * z).sum(1)
    total[:, 0, 2] = total[:, 2, 0] = (xz - m * x * z).sum(1)
    c = AIRFRAME_CG
    own = AIRFRAME_INERTIA + AIRFRAME_MASS * (c @ c * np.eye(3) - np.outer(c, c))
    return static + AIRFRAME_MASS * c, total + own


def whole_inertia(tilt: np.ndarray) -> np.ndarray:
    """Inertia matrix of the whole about its centre of gravity at these tilts (4)."""
    c = centre(tilt[None])[0]
    return inertia_about_origin(tilt[None])[1][0] - MASS * (c @ c * np.eye(3) - np.outer(c, c))


def acceleration(
    wrench: np.ndarray, rate: np.ndarray, eff: np.ndarray, d1: np.ndarray, d2: np.ndarray, spin_up: np.ndarray
) -> np.ndarray:
    """Inertial acceleration of the origin less gravity, and angular acceleration, (flight, 6).

    For each body m (a_O + w' x r + w x (w x r) + 2 w x r' + r''), and r x that + I w_b' + w_b x I w_b: summed
    over airframe and nacelles; d1 and d2 are the nacelles' rates and accelerations; shafts' momentum on top.
    """
    tilt = eff[:, 4:8]
    p, q, r = rate[:, :1], rate[:, 1:2], rate[:, 2:]
    ax, az, xx, xz, zz = nacelles(tilt)
    x, y, z = PIVOT[:, 0] + ax, PIVOT[:, 1], PIVOT[:, 2] + az
    m = NACELLE_MASS
    vx, vz = d1 * az, -d1 * ax  # of the nacelles' centres of gravity in the body
    bx, bz = d2 * az - d1**2 * ax, -d2 * ax - d1**2 * az
    static, inertia = inertia_about_origin(tilt)
    known = np.zeros_like(wrench)
    spun = cross(rate, static)
    move = np.zeros_like(rate)
    move[:, 0], move[:, 2] = (m * vx).sum(1), (m * vz).sum(1)
    known[:, :3] = cross(rate, spun + 2 * move)
    known[:, 0] += (m * bx).sum(1)
    known[:, 2] += (m * bz).sum(1)
    # moments: w x J w of all bodies; then what the turning nacelles add
    known[:, 3:] = cross(rate, (inertia @ rate[..., None])[..., 0])
    rv, rw = x * vx + z * vz, p * x + q * y + r * z  # r x (w x r') = w (r.r') - r' (r.w)
    known[:, 3] += (2 * m * (p * rv - vx * rw) + m * y * bz).sum(1)
    known[:, 4] += (2 * m * q * rv + m * (z * bx - x * bz)).sum(1)
    known[:, 5] += (2 * m * (r * rv - vz * rw) - m * y * bx).sum(1)
    b = NACELLE_INERTIA[:, 1, 1]
    gx, gz = -r * d1, p * d1  # w x turn
    ix, iz = xx * p + xz * r, xz * p + zz * r  # I w, x and z
    known[:, 3] += (xx * gx + xz * gz + d1 * iz - r * b * d1).sum(1)
    known[:, 4] += (b * d2).sum(1)
    known[:, 5] += (xz * gx + zz * gz - d1 * ix + p * b * d1).sum(1)
    # shafts
    h = SPIN * SHAFT_INERTIA * eff[:, 8:]
    up = SPIN * SHAFT_INERTIA * spin_up
    c, s = np.cos(tilt), np.sin(tilt)
    shaft = np.zeros_like(rate)
    shaft[:, 0] = (h[:, :4] * c).sum(1) + LIFTER_AXIS[0] * h[:, 4:].sum(1)
    shaft[:, 2] = -(h[:, :4] * s).sum(1) + LIFTER_AXIS[2] * h[:, 4:].sum(1)
    known[:, 3:] += cross(rate, shaft)
    known[:, 3] += (up[:, :4] * c - h[:, :4] * d1 * s).sum(1) + LIFTER_AXIS[0] * up[:, 4:].sum(1)
    known[:, 5] += -(up[:, :4] * s + h[:, :4] * d1 * c).sum(1) + LIFTER_AXIS[2] * up[:, 4:].sum(1)
    left = np.empty((len(rate), 6, 6))
    k = skew(static)
    left[:, :3, :3] = MASS * np.eye(3)
    left[:, :3, 3:] = -k
    left[:, 3:, :3] = k
    left[:, 3:, 3:] = inertia
    return np.linalg.solve(left, (wrench - known)[..., None])[..., 0]


def down(phi: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Direction of gravity in body axes."""
    return np.stack([-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)], -1)


# ---- trim and law
def trim(speed: float, tilt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return attitude (phi, theta) and effectors (14) of level flight, nearest to a preferred setting."""
    fast = np.clip((speed - 7.0) / 20.0, 0, 1)
    prefer = np.r_[0.0, 0.035, 0.03, 0.03, 0, 0, [265 + 25 * fast] * 4, [270 - 140 * fast] * 2]
    unit = np.r_[0.03, 0.012, [0.05] * 2, [0.10] * 2, [60.0] * 4, [40.0] * 2]
    x = prefer.copy()

    def rest(x: np.ndarray) -> np.ndarray:
        n = len(x)
        eff = np.concatenate([x[:, 2:6], np.broadcast_to(tilt, (n, 4)), x[:, 6:]], 1)
        phi, theta = x[:, 0], x[:, 1]
        velocity = np.stack([speed * np.cos(theta), 0 * phi, speed * np.sin(theta)], -1)
        wrench = loads(velocity, np.zeros((n, 3)), eff)
        weight = MASS * G * down(phi, theta)
        return wrench + np.concatenate([weight, cross(centre(eff[:, 4:8]), weight)], 1)

    for _ in range(200):
        step = 1e-4 * unit
        base = rest(x[None])[0]
        slope = ((rest(x + np.diag(step)) - rest(x - np.diag(step))) / (2 * step)[:, None]).T * unit
        a = (prefer - x) / unit
        move = a + np.linalg.pinv(slope) @ (-base - slope @ a)
        x = x + unit * np.clip(0.7 * move, -0.5, 0.5)
        if np.abs(base).max() < 1e-7 and np.abs(move).max() < 1e-4:
            break
    else:
        raise RuntimeError(f"no trim at {speed} m/s: {base}")
    return x[:2], np.concatenate([x[2:6], tilt, x[6:]])


def rates_of_change(
    state: np.ndarray, eff: np.ndarray, gust: np.ndarray, d1: np.ndarray, d2: np.ndarray, up: np.ndarray
):
    """Return the derivative of u v w p q r phi theta psi z, of the origin over ground, and `acceleration`."""
    v, w, phi, theta = state[:, :3], state[:, 3:6], state[:, 6], state[:, 7]
    acc = acceleration(loads(v - gust, w, eff, d1), w, eff, d1, d2, up)
    vdot = acc[:, :3] + G * down(phi, theta) - cross(w, v)
    p, q, r = w.T
    turn = q * np.sin(phi) + r * np.cos(phi)
    sink = (down(phi, theta) * v).sum(-1)
    angles = np.stack(
        [p + np.tan(theta) * turn, q * np.cos(phi) - r * np.sin(phi), turn / np.cos(theta), sink], -1
    )
    return np.concatenate([vdot, acc[:, 3:], angles], 1), acc


def gains(speed: float, tilt: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Trim state (10), trim effectors (14) and LQ gains (14, 10); the nacelles stay on their schedule."""
    (phi, theta), eff = trim(speed, tilt)
    x0 = np.r_[speed * np.cos(theta), 0, speed * np.sin(theta), 0, 0, 0, phi, theta, 0, 0]
    zero = np.zeros

    def f(x: np.ndarray, e: np.ndarray) -> np.ndarray:
        n = max(len(x), len(e))
        x, e = np.broadcast_to(x, (n, 10)), np.broadcast_to(e, (n, 14))
        return rates_of_change(x, e, zero((n, 3)), zero((n, 4)), zero((n, 4)), zero((n, 6)))[0]

    h = 1e-4
    a = ((f(x0 + h * np.eye(10), eff[None]) - f(x0 - h * np.eye(10), eff[None])) / (2 * h)).T
    scale = np.r_[[0.1] * 4, [0.1] * 4, [25.0] * 6]
    b = ((f(x0[None], eff + h * np.diag(scale)) - f(x0[None], eff - h * np.diag(scale))) / (2 * h)).T
    b[:, 4:8] = 0.0
    weight = 1 / np.r_[1.2, 1.2, 0.9, 0.35, 0.3, 0.3, 0.12, 0.1, 0.15, 2.5] ** 2
    ham = np.block([[a, -b @ b.T], [-np.diag(weight), -a.T]])
    value, vector = np.linalg.eig(ham)
    stable = vector[:, value.real < 0]
    riccati = np.real(stable[10:] @ np.linalg.inv(stable[:10]))
    return x0, eff, -scale[:, None] * (b.T @ riccati)


# ---- flight
def dryden(speed: float, sigma: float, dt: np.ndarray, rng: np.random.Generator, flights: int) -> np.ndarray:
    """Return gusts (sample, flight, 3): 1/(1+Ts) along, (1+sqrt3 Ts)/(1+Ts)^2 across the flight path."""
    time = np.array([150.0, 150.0, 75.0]) / speed
    steps = np.concatenate([np.full(600, 0.1), dt])
    out = np.zeros((len(steps), flights, 3))
    lag, lag2 = np.zeros((flights, 3)), np.zeros((flights, 3))
    for i, step in enumerate(steps):
        keep = np.exp(-step / time)
        new = keep * lag + np.sqrt(1 - keep**2) * rng.standard_normal(lag.shape)
        lag2 = keep * lag2 + (1 - keep) * (lag + new) / 2
        lag = new
        out[i] = lag
        out[i, :, 1:] = ((np.sqrt(3) * lag + (1 - np.sqrt(3)) * lag2) / np.sqrt(2))[:, 1:]
    return sigma * out[600:]


def _actuators() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Modes of (smoothed command, position, rate) of each effector under a held command."""
    a = np.zeros((14, 3, 3))
    a[:, 0, 0] = -1 / SMOOTHING
    a[:8, 1, 2] = 1.0
    a[:8, 2, 0], a[:8, 2, 1], a[:8, 2, 2] = SERVO**2, -(SERVO**2), -2 * SERVO_DAMPING * SERVO
    a[8:, 1, 0], a[8:, 1, 1], a[8:, 2, 2] = MOTOR, -MOTOR, -1.0
    value, vector = np.linalg.eig(a)
    return value, vector, np.linalg.inv(vector)


MODE, SHAPE, UNSHAPE = _actuators()


def actuator_step(dt: float) -> np.ndarray:
    """How a departure of the actuators from their rest decays over dt, (14, 3, 3)."""
    return np.real((SHAPE * np.exp(MODE * dt)[:, None, :]) @ UNSHAPE)


def adams(times: np.ndarray, step: float) -> np.ndarray:
    """Return weights of derivatives at these times (from now) in the integral over the next step."""
    n = np.arange(len(times))
    return np.linalg.solve((times / step) ** n[:, None], step / (n + 1.0))


def fly(
    condition: str | float,
    inject: np.ndarray,
    inject_dt: float,
    *,
    seeds: list[int],
    gust: float = 0.25,
    noise: float = 1.0,
    rate_hz: float = 50.0,
    lead_s: float = 4.0,
    tail_s: float = 2.0,
) -> dict[str, np.ndarray]:
    """Fly excitations, (flight, 14, samples) in rad and rad/s, each with its seed.

    Returns the stamps ("time") and, each (sample, flight, n), what sensors read and would read without noise
    ("read", "truth"), commands and injected signals. Stamps jitter; samples are of the stamped times.
    """
    speed, tilt = CORRIDOR[condition] if isinstance(condition, str) else (condition, schedule(condition))
    x0, eff0, gain = gains(speed, tilt)
    flights = len(seeds)
    inject = np.broadcast_to(inject, (flights, *inject.shape[-2:]))
    rngs = [np.random.default_rng([s, 77]) for s in seeds]
    clock = np.random.default_rng(seeds[0])
    count = int((lead_s + inject.shape[2] * inject_dt + tail_s) * rate_hz)
    stamp = (np.arange(count) + clock.uniform(-0.06, 0.06, count)) / rate_hz
    dt = np.diff(stamp, append=stamp[-1] + 1 / rate_hz)
    gusts = np.concatenate([dryden(speed, gust, dt, r, 1) for r in rngs], 1)
    white = [{k: r.standard_normal((count, n)) for k, n in READINGS.items()} for r in rngs]
    sigma = noise * SIGMA
    sigma = noise * SIGMA
    signal_time = np.arange(inject.shape[2]) * inject_dt + lead_s
    signals = np.stack(
        [[np.interp(stamp, signal_time, row, left=0.0, right=0.0) for row in one] for one in inject]
    ).transpose(2, 0, 1)
    log: dict[str, list[np.ndarray]] = {"read": [], "truth": [], "command": []}
    command = np.tile(eff0, (flights, 1))
    moved = np.zeros((flights, 14, 3))  # of each effector: smoothed command, position, its rate
    moved[..., 0] = moved[..., 1] = command
    state = np.tile(x0, (flights, 1))
    past: list[np.ndarray] = []  # derivatives of the state, newest first

    def change(state: np.ndarray, moved: np.ndarray, air: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        faster = SERVO**2 * (moved[:, :8, 0] - moved[:, :8, 1]) - 2 * SERVO_DAMPING * SERVO * moved[:, :8, 2]
        up = MOTOR * (moved[:, 8:, 0] - moved[:, 8:, 1])
        return rates_of_change(state, moved[..., 1], air, moved[:, 4:8, 2], faster[:, 4:], up)

    for i in range(count):
        step = dt[i]
        gone, total = change(state, moved, gusts[i])
        truth = sense(state, moved[..., 1], total, gusts[i])
        read = truth + sigma * np.stack([np.concatenate([w[k][i] for k in READINGS]) for w in white])
        for key, value in (("read", read), ("truth", truth), ("command", command)):
            log[key].append(value)
        # actuators exactly, for a command held over the step; then the motion: Adams-Bashforth, Adams-Moulton
        rest = np.stack([command, command, 0 * command], -1)
        moved = rest + (actuator_step(step) @ (moved - rest)[..., None])[..., 0]
        past = [gone, *past[:3]]
        times = np.cumsum(np.r_[0.0, -dt[i - len(past) + 1 : i][::-1]]) if len(past) > 1 else np.zeros(1)
        guess = state + np.tensordot(adams(times, step), past, 1)
        ahead, _ = change(guess, moved, gusts[min(i + 1, count - 1)])
        newest = [ahead, *past[:3]]
        state = state + np.tensordot(adams(np.r_[step, times[:3]], step), newest, 1)
        # the flight computer: one sample late, on what it has read
        command = np.clip(eff0 + signals[i] + feedback(read, x0) @ gain.T, LIMITS[:, 0], LIMITS[:, 1])
        if not np.isfinite(state).all() or np.abs(state[:, 6:8]).max() > 1.2:
            raise RuntimeError(f"{condition}: lost at {stamp[i]:.1f} s")
    out = {k: np.array(v) for k, v in log.items()}
    out["time"], out["inject"], out["gust"] = stamp, signals, gusts
    out["trim"] = eff0
    return out


# what is read, in this order: p q r, fx fy fz, phi theta psi, V alpha beta, altitude, 14 effectors
READINGS = {"rate": 3, "acc": 3, "angle": 3, "air": 3, "alt": 1, "surface": 4, "nacelle": 4, "rotor": 6}
SIGMA = np.r_[
    [NOISE["rate"]] * 3, [NOISE["acc"]] * 3, [NOISE["angle"]] * 3, NOISE["V"], [NOISE["flow"]] * 2,
    NOISE["alt"],
    [NOISE["surface"]] * 4, [NOISE["nacelle"]] * 4, [NOISE["rotor"]] * 6,
]  # fmt: skip


def sense(state: np.ndarray, position: np.ndarray, total: np.ndarray, air: np.ndarray) -> np.ndarray:
    """Return what sensors without noise read, as READINGS has it: accelerometers at IMU, probe on BOOM."""
    v, w = state[:, :3], state[:, 3:6]
    acc = total[:, :3] + cross(total[:, 3:], IMU) + cross(w, cross(w, IMU))
    probe = v - air + cross(w, BOOM)
    size = np.sqrt((probe**2).sum(1))
    flow = np.stack([size, np.arctan2(probe[:, 2], probe[:, 0]), np.arcsin(probe[:, 1] / size)], -1)
    return np.concatenate([w, acc, state[:, 6:9], flow, -state[:, 9:10], position], 1)


def feedback(read: np.ndarray, x0: np.ndarray) -> np.ndarray:
    """Departure of the ten states as the flight computer takes them from its sensors."""
    rate, angle, (size, alpha, beta) = read[:, :3], read[:, 6:9], read[:, 9:12].T
    probe = size[:, None] * np.stack(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)], -1
    )
    v = probe - cross(rate, BOOM)
    return np.concatenate([v, rate, angle, -read[:, 12:13]], 1) - x0


# ---- the log: the project's own names and units
COLUMNS = (
    [
        "GyroX_dps",
        "GyroY_dps",
        "GyroZ_dps",
        "AccFwd_g",
        "AccRight_g",
        "LoadFactor_g",
        "Bank_deg",
        "Pitch_deg",
        "Hdg_deg",
    ]
    + ["TAS_kt", "AOA_deg", "AOS_deg", "Alt_ft"]
    + [f"{n}_deg" for n in ("FLN_L", "FLN_R", "RVT_L", "RVT_R")]
    + [f"CONV_{n}_deg" for n in ("FL", "FR", "TL", "TR")]
    + [f"RPM{n}" for n in range(1, 7)]
)
FT, KT, RPM = 0.3048, 1852 / 3600, 2 * np.pi / 60
LOGGED = np.r_[
    [1 / DEG] * 3, 1 / G, 1 / G, -1 / G, [1 / DEG] * 3, 1 / KT, [1 / DEG] * 2, 1 / FT,
    [1 / DEG] * 4, [-1 / DEG] * 4, [1 / RPM] * 6,
]  # fmt: skip
# The conversion angle is 0 in helicopter mode and 90 in aeroplane mode: 90 deg less the tilt
SHIFT = np.where(np.char.startswith(COLUMNS, "CONV"), 90.0, 0.0)


def write_log(path: Path, flight: dict[str, np.ndarray], which: int = 0) -> None:
    """Write the flight's CSV: stamps in ms since power-up, names and units of its own."""
    stamp = (flight["time"] + 312.4) * 1e3
    scale, shift, names = LOGGED[13:], SHIFT[13:], COLUMNS[13:]
    header = ["Stamp_ms", *COLUMNS, "RHO_kgm3", *[f"CMD_{n}" for n in names], *[f"INJ_{n}" for n in names]]
    read = flight["read"][:, which] * LOGGED + SHIFT
    command = flight["command"][:, which] * scale + shift
    density = np.full(len(stamp), RHO)
    table = np.column_stack([stamp, read, density, command, flight["inject"][:, which] * scale])
    np.savetxt(
        path,
        table,
        fmt=["%.3f"] + ["%.7g"] * (table.shape[1] - 1),
        delimiter=",",
        header=",".join(header),
        comments="",
    )


def read_design(path: Path) -> tuple[np.ndarray, float]:
    """Return injected signals (14, samples) and their interval from a design's CSV; zero where absent."""
    with path.open(newline="") as stream:
        rows = [r for r in csv.reader(stream) if r and not r[0].startswith("#")]
    names, values = rows[0], np.array(rows[1:], dtype=float)
    signals = np.zeros((14, len(values)))
    for i, name in enumerate(EFFECTORS):
        match = [j for j, n in enumerate(names) if n in (name + "_rad", name + "_rad/s")]
        if match:
            signals[i] = values[:, match[0]]
    return signals, values[1, 0] - values[0, 0]


def derivatives(eff: np.ndarray, velocity: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Central differences of the wrench about the centre of gravity, (6, 20): u v w p q r and the effectors.

    velocity is that of the centre of gravity through the air.
    """
    step = np.r_[[0.02] * 3, [0.005] * 3, [0.002] * 8, [0.5] * 6]
    point = np.r_[velocity, rate, eff]
    both = point + np.concatenate([np.diag(step), -np.diag(step)])
    c = centre(both[:, 10:14])
    wrench = loads(both[:, :3] - cross(both[:, 3:6], c), both[:, 3:6], both[:, 6:])
    wrench[:, 3:] -= cross(c, wrench[:, :3])
    return ((wrench[:20] - wrench[20:]) / (2 * step)[:, None]).T


def main() -> None:
    """Fly a design and write the log."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("condition", help="v07 ... v27, or a speed in m/s")
    parser.add_argument("design", type=Path, nargs="+", help="CSV of a design; each is a flight")
    parser.add_argument("--log", type=Path, action="append", required=True, help="one for each design")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--gust", type=float, default=0.25, help="one sigma, m/s")
    asked = parser.parse_args()
    condition = asked.condition if asked.condition in CORRIDOR else float(asked.condition)
    designs = [read_design(path) for path in asked.design]
    seeds = [asked.seed + i for i in range(len(designs))]
    flight = fly(condition, np.stack([d[0] for d in designs]), designs[0][1], seeds=seeds, gust=asked.gust)
    for i, path in enumerate(asked.log):
        write_log(path, flight, i)


if __name__ == "__main__":
    main()

"""Rotors of the truth: rings of blades in compressible, oblique flow, with a given induced velocity.

The induced velocity grows towards the rear of the disc as Drees has it (Journal of the Helicopter
Association of Great Britain 3(2), 1949) and is normal to the flow that the blades meet, so that the air
swirls. Lift goes with the sine of an angle and with Prandtl and Glauert's factor, drag of a section has a
polar; means over a turn are closed. Momentum theory says what induced velocity belongs to a thrust, and how
much air has to be moved before it is there (Pitt and Peters, Vertica 5(1), 1981).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SLOPE, PROFILE, POLAR = 5.8, 0.011, 0.012  # lift per rad, drag of a section and by its lift squared
SOUND = 338.0  # m/s
POINTS, SHARES = np.polynomial.legendre.leggauss(2)
RINGS, SHARES = 0.575 + 0.395 * POINTS, 0.395 * SHARES  # of the radius, from 0.18 to 0.97


class Discs:
    """Rotors of given radius, chords of all blades together by the radius, and pitch.

    Parameters
    ----------
    radius, blades : ndarray, shape (rotor,)
        m; of the radius.
    pitch : ndarray, shape (ring, rotor)
        rad
    """

    def __init__(self, radius, blades, pitch):
        self.radius = np.asarray(radius, dtype=float)[:, None]
        self.blades = np.asarray(blades, dtype=float)[:, None]
        self.area = np.pi * self.radius**2
        self.sine, self.cosine = np.sin(pitch)[:, :, None], np.cos(pitch)[:, :, None]
        self.place, share = RINGS[:, None, None], SHARES[:, None, None]
        self.element = 0.5 * self.blades * self.radius**2 * share
        self.arm = self.place * self.radius


@dataclass(frozen=True)
class Made:
    """What rotors do, each of the shape of the flow.

    Attributes
    ----------
    thrust, torque : ndarray
        N; N m, against the spin.
    dragged, sideways : ndarray
        N: against the way of the hub across the axis; against the motion of the blade that points aft.
    advancing, forward : ndarray
        N m: of more thrust on the advancing side, and before the hub.
    """

    thrust: np.ndarray
    torque: np.ndarray
    dragged: np.ndarray
    sideways: np.ndarray
    advancing: np.ndarray
    forward: np.ndarray


def blades(d, rho, speed, along, across, induced):
    """Return `Made` by density, kg/m3, speed, rad/s, flow along the axis and across it and induced, m/s."""
    tip = d.radius * speed
    through = along + induced
    total2 = across * across + through * through
    total = np.sqrt(total2)
    gradient = 4 / 3 * induced * (across / (total + through) - 1.8 * across * total / (tip * tip))
    turn = d.place * tip
    met2 = turn * turn + (total2 - 0.5 * across * across)  # mean over a turn
    met = np.sqrt(met2)
    along_blade = turn - induced * through / turn
    raised = gradient * d.place
    sine, cosine = d.sine, d.cosine
    normal = along_blade * sine - through * cosine
    slope = SLOPE / np.sqrt(1 - met2 / SOUND**2)
    lift = slope * normal / met
    drag = met * (PROFILE + POLAR * lift * lift)
    e = rho * d.element
    pushed = e * d.arm
    ea, pa = e * slope, pushed * slope
    swept = across * sine
    raised_c = raised * cosine
    return Made(
        (ea * (normal * along_blade + 0.5 * across * swept) - e * drag * through).sum(axis=0),
        (pa * (normal * through - 0.5 * raised * raised_c) + pushed * drag * along_blade).sum(axis=0),
        0.5 * (ea * swept * through + e * drag * across).sum(axis=0),
        0.5 * (ea * raised * (normal - cosine * through)).sum(axis=0),
        0.5 * (pa * (normal * across + swept * along_blade)).sum(axis=0),
        0.5 * (pa * raised_c * along_blade + pushed * drag * raised).sum(axis=0),
    )


def momentum(d, rho, along, across, induced, thrust):
    """Return the induced velocity that balances a thrust, m/s, and the time that it takes, s."""
    through = along + induced
    total = np.sqrt(across * across + through * through)
    return thrust / (2 * rho * d.area * total), 4 / (3 * np.pi) * d.radius / total


def settled(d, rho, speed, along, across, steps=60):
    """Return `Made` and induced velocity in steady flow."""
    induced = np.zeros(np.broadcast_shapes(np.shape(speed), np.shape(along), np.shape(across)))
    for _ in range(steps):
        made = blades(d, rho, speed, along, across, induced)
        induced = induced + 0.6 * (momentum(d, rho, along, across, induced, made.thrust)[0] - induced)
    return blades(d, rho, speed, along, across, induced), induced

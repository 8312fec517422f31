"""Rotors of the truth in edgewise flow: twisted rigid blades, integrated along the blade and round the turn.

The induced velocity is Glauert's mean with the fore-and-aft gradient that Pitt and Peters give in steady flow
(Leishman, Principles of Helicopter Aerodynamics, section 3.5). Blades do not flap: what they lift more on one
side of the disc turns the hub.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SLOPE, PROFILE, SOLIDITY = 5.6, 0.016, 0.080  # lift per rad, drag of a section, blade area over disc
ROOT, TWIST = 0.270, -0.130  # pitch at the hub and its change to the tip, rad
GRADIENT = 15 * np.pi / 32  # of Pitt and Peters, times the tangent of half the wake's skew
NEWTON = 3  # steps from a guess; a fourth changes thrust by less than 1e-5 of it


@dataclass(frozen=True)
class Blades:
    """What rotors do, each of the shape of the flow.

    Attributes
    ----------
    thrust, torque : ndarray
        N; N m, against the spin.
    dragged, sideways : ndarray
        N: against the way of the hub across the axis; against the motion of the blade that points aft.
    advancing, forward : ndarray
        N m: of more thrust on the advancing side, and before the hub.
    induced : ndarray
        Mean, m/s.
    """

    thrust: np.ndarray
    torque: np.ndarray
    dragged: np.ndarray
    sideways: np.ndarray
    advancing: np.ndarray
    forward: np.ndarray
    induced: np.ndarray


def blades(rho, speed, along, across, radius):
    """Return `Blades` of density, kg/m3, speed, rad/s, and flow along the axis and across it, m/s."""
    tip = radius * speed
    inverse = 1 / tip
    edge, climb = across * inverse, along * inverse
    edge2 = edge * edge
    k = 0.5 * SOLIDITY * SLOPE
    lifted = ROOT / 3 + TWIST / 4 + (0.5 * ROOT + 0.25 * TWIST) * edge2
    induced = k * (lifted - 0.5 * climb) / (2 * edge + 0.1)
    for _ in range(NEWTON):
        inflow = climb + induced
        total = np.sqrt(edge2 + inflow * inflow)
        miss = 2 * induced * total - k * (lifted - 0.5 * inflow)
        induced = induced - miss / (2 * total + 2 * induced * inflow / total + 0.5 * k)
    inflow = climb + induced
    total = np.sqrt(edge2 + inflow * inflow)
    slope = GRADIENT * edge / (inflow + total) * induced  # more aft, in proportion to the radius
    disc = rho * (np.pi * radius * radius) * tip * tip
    lifting = disc * k
    turning = lifting * radius
    third, half = ROOT / 3 + TWIST / 4, 0.5 * ROOT + 0.25 * TWIST
    profile = SOLIDITY * PROFILE
    pulled = third * inflow - 0.5 * inflow * inflow - 0.125 * slope * slope
    return Blades(
        lifting * (lifted - 0.5 * inflow),
        turning * pulled + disc * radius * (0.125 * profile) * (1 + edge2),
        lifting * (half * inflow * edge) + disc * (0.25 * profile) * edge,
        lifting * slope * (0.5 * third - 0.5 * inflow),
        turning * edge * (third - 0.25 * inflow),
        turning * (0.125 * slope),
        induced * tip,
    )

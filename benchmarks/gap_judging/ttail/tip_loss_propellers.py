"""Propellers of the truth: blade elements in rings, with Prandtl's tip loss, in slightly oblique flow.

In each ring the momentum of its own air equals the thrust of the elements, whose lift goes with the sine of
their angle; with a tip loss from a first guess of the inflow that is a quadratic equation. Means over a turn
are closed (Leishman, Principles of Helicopter Aerodynamics, section 3.3).
"""

from __future__ import annotations

import numpy as np

BLADES, CHORD, SLOPE, PROFILE = 3, 0.13, 5.7, 0.018  # number, share of the radius, per rad, drag of a section
RINGS, SHARES = np.polynomial.legendre.leggauss(3)
RINGS, SHARES = 0.6 + 0.4 * RINGS, 0.4 * SHARES  # of the radius, from a fifth to the tip


def propellers(rho, speed, along, across, radius, pitch):
    """Return what propellers do.

    Parameters
    ----------
    rho, speed, along, across : ndarray, shape (..., flight)
        Density, kg/m3; rad/s; flow along the axis and across it, m/s.
    radius, pitch : ndarray, shape (..., 1)
        m; way that a screw goes in a radian, by the radius.

    Returns
    -------
    thrust, torque, dragged, leaning : ndarray
        N; N m; N, against the way across; N m, of more thrust on the advancing side.
    """
    x, share = (part.reshape(-1, *[1] * np.ndim(speed)) for part in (RINGS, SHARES))  # rings first
    tangent = pitch / x
    cosine = 1 / np.sqrt(1 + tangent * tangent)
    sine = tangent * cosine
    element = 0.5 * BLADES * CHORD * SLOPE * radius
    ring = 4 * np.pi * x * radius / element
    turn = x * (radius * speed)
    straight, risen = turn * cosine, turn * turn * sine

    def through_at(loss):
        k = ring * loss
        half = 0.5 * (straight - k * along)
        return (np.sqrt(half * half + k * risen) - half) / k

    flow = (0.5 * BLADES * (1 - x) / x) * turn / through_at(0.9)
    through = through_at(2 / np.pi * np.arccos(np.exp(-np.clip(flow, 0.02, 20.0))))
    element = element * radius * share
    met = turn * sine - through * cosine
    drag = PROFILE / SLOPE * np.sqrt(turn * turn + through * through)
    pushed = element * x * radius
    thrust = rho * (element * (turn * met + 0.5 * across * across * sine - drag * through)).sum(axis=0)
    torque = rho * (pushed * (through * met + drag * turn)).sum(axis=0)
    dragged = rho * 0.5 * across * (element * (through * sine + drag)).sum(axis=0)
    leaning = rho * 0.5 * across * (pushed * (2 * turn * sine - through * cosine)).sum(axis=0)
    return thrust, torque, dragged, leaning

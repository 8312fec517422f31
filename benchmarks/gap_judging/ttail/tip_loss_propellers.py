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
    thrust = torque = dragged = leaning = 0.0
    for x, share in zip(RINGS, SHARES, strict=True):
        turn = x * radius * speed
        tangent = pitch / x
        cosine = 1 / np.sqrt(1 + tangent * tangent)
        sine = tangent * cosine
        element = 0.5 * BLADES * CHORD * radius * SLOPE
        ring = 4 * np.pi * x * radius / element
        through, loss = along, 0.9
        for guess in (True, False):
            k = ring * loss
            half = 0.5 * (turn * cosine - k * along)
            through = (np.sqrt(half * half + k * turn * turn * sine) - half) / k
            if guess:
                flow = 0.5 * BLADES * (1 - x) * turn / (x * through)
                loss = 2 / np.pi * np.arccos(np.exp(-np.clip(flow, 0.02, 20.0)))
        element = rho * element * share * radius
        met = turn * sine - through * cosine
        whole = np.sqrt(turn * turn + through * through)
        drag = PROFILE / SLOPE * whole
        thrust = thrust + element * (turn * met + 0.5 * across * across * sine - drag * through)
        torque = torque + x * radius * element * (through * met + drag * turn)
        dragged = dragged + 0.5 * element * across * (through * sine + drag)
        leaning = leaning + 0.5 * x * radius * element * across * (2 * turn * sine - through * cosine)
    return thrust, torque, dragged, leaning

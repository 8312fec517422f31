"""Propellers of the truth in oblique flow: a blade station goes round, momentum theory gives the inflow.

A blade is one section at three quarters of the radius. Its forces at small inflow angles are averaged over
the turn in closed form; Glauert's momentum equation for oblique flow gives the induced velocity (Leishman,
Principles of Helicopter Aerodynamics, chapters 2 and 3).
"""

from __future__ import annotations

import numpy as np

BLADES, CHORD, PITCH, SLOPE, PROFILE = 2, 0.028, 0.31, 5.7, 0.016  # number, m, rad, per rad, drag
STATION, LENGTH = 0.75, 0.85  # of the radius: the section, and how much of the blade lifts
NEWTON = 4  # steps from a guess; a fifth changes thrust by less than 1e-5 of it


def propellers(rho, speed, along, across, radius):
    """Return thrust, torque, drag across the axis, moment of the advancing side, induced velocity.

    Parameters
    ----------
    rho, speed, along, across : ndarray
        Density, kg/m3; rad/s; flow along the axis and across it, m/s.
    radius : float
        m

    Returns
    -------
    thrust, torque, dragged, leaning, induced : ndarray
        N; N m; N, against the way across; N m, of more thrust on the advancing side; m/s at the disc.
    """
    turn = STATION * radius * speed
    blades = 0.5 * rho * BLADES * CHORD * LENGTH * radius
    disc = 2 * rho * np.pi * radius**2
    lifted = SLOPE * PITCH * (turn * turn + 0.5 * across * across)
    fall = (SLOPE + PROFILE) * turn
    induced = 0.25 * np.maximum(along, 3.0)
    for _ in range(NEWTON):
        through = along + induced
        total = np.sqrt(through * through + across * across)
        miss = disc * induced * total - blades * (lifted - fall * through)
        induced = induced - miss / (disc * (total + induced * through / total) + blades * fall)
    through = along + induced
    thrust = blades * (lifted - fall * through)
    pull = SLOPE * (PITCH * turn - through) * through
    torque = STATION * radius * blades * (pull + PROFILE * (turn * turn + 0.5 * across * across))
    dragged = blades * across * (0.5 * SLOPE * PITCH * through + PROFILE * turn)
    leaning = STATION * radius * blades * across * SLOPE * (PITCH * turn - 0.5 * through)
    return thrust, torque, dragged, leaning, induced

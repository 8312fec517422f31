"""Propellers of the truth: one section stands for a blade; its vortex wake induces flow along and around."""

from __future__ import annotations

import numpy as np

BLADES, CHORD, SLOPE, PROFILE, PROFILE_LIFT = 2, 0.021, 5.8, 0.017, 0.014
STATION, LENGTH, LOSS = 0.075, 0.078, 0.80  # m: of the section, of blade that lifts; Prandtl's factor there
PITCH = 0.20  # of the helix, m
NEWTON = 3  # steps from a guess; a fourth changes thrust by less than 1e-6 N in these flights


def propeller(rho, speed, along):
    """Return thrust, N, torque, N m, and velocities induced at the disc along and around the axis, m/s.

    The induced velocity ``e`` stands across the flow that the section meets (Betz). This flow has the speed
    ``W = sqrt(U^2 - e^2)``, where ``U`` comes from flight and rotation alone. ``e`` follows from the
    circulation: ``8 pi r F sin(phi) e = B c W cl(phi)``, ``phi`` the angle of ``W`` to the disc.

    Parameters
    ----------
    rho, speed, along : ndarray
        Density, kg/m3; rad/s; flow along the axis, m/s.
    """
    turn = speed * STATION
    whole2 = along * along + turn * turn
    inverse = 1 / np.sqrt(whole2)
    pitch = np.arctan(PITCH / (2 * np.pi * STATION))
    sp, cp = np.sin(pitch), np.cos(pitch)
    solid = BLADES * CHORD / (8 * np.pi * STATION * LOSS)
    e = 0.03 * turn
    for step in range(NEWTON + 1):
        met = np.sqrt(whole2 - e * e)
        sin, cos = (along * met + turn * e) * inverse**2, (turn * met - along * e) * inverse**2
        lift = SLOPE * (sp * cos - cp * sin)
        if step == NEWTON:
            break
        miss = sin * e - solid * met * lift
        e = e - miss / (sin + cos * e / met + solid * (SLOPE * (cp * cos + sp * sin) + lift * e / met))
    pressed = 0.5 * rho * met * met * (BLADES * CHORD * LENGTH)
    drag = PROFILE + PROFILE_LIFT * lift * lift
    thrust = pressed * (lift * cos - drag * sin)
    torque = STATION * pressed * (lift * sin + drag * cos)
    return thrust, torque, e * cos, e * sin

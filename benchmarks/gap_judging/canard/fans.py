"""Ducted lift fans and pusher of the truth: a pressure balance through each duct, momentum ring by ring."""

from __future__ import annotations

import numpy as np

HEAD, FALL, LOSS, RECOVERED = 0.052, 0.105, 0.22, 0.45  # of a fan: see `duct`
FAN_DRAG = 0.0042  # torque that the fan's blades and stator take at any flow
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
BLADES, SLOPE, PROFILE = 2, 5.6, 0.016  # of the pusher: number, lift slope and profile drag
PITCH, TIP_LOSS, HUB = 0.31, 0.97, 0.18  # pitch of the helix, m; where lift ends and begins, over the radius


def duct(tip, climb, edge2):
    """Return velocity at the duct's exit, and rise of pressure over density by the fan.

    The rise is ``HEAD tip^2 - FALL tip exit``. It accelerates the air from the total pressure before the
    intake, where a share of the edgewise flow's is recovered, and overcomes losses:
    ``(1 + LOSS) exit^2 / 2 = rise + (RECOVERED edge^2 + climb |climb|) / 2``.

    Parameters
    ----------
    tip, climb : ndarray
        Tip speed; velocity along the duct's axis, upwards, m/s.
    edge2 : ndarray
        Square of the velocity across the axis, m2/s2.
    """
    given = HEAD * tip**2 + 0.5 * (RECOVERED * edge2 + climb * np.abs(climb))
    slope = FALL * tip
    wide = 1 + LOSS
    leaves = (np.sqrt(slope**2 + 2 * wide * given) - slope) / wide
    return leaves, HEAD * tip**2 - slope * leaves


def fan(rho, radius, tip, climb, edge2):
    """Return thrust along the axis, N, mass flow, kg/s, and torque, N m, of ducted fans."""
    disc = np.pi * radius**2
    leaves, rise = duct(tip, climb, edge2)
    flow = rho * disc * leaves
    torque = radius * (flow * rise / (0.78 * tip) + FAN_DRAG * rho * disc * tip**2)
    return flow * (leaves - climb), flow, torque


def pusher(rho, radius, chord, speed, along):
    """Return thrust and torque of a propeller whose rings each obey momentum and blade theory.

    In a ring, ``4 pi r (V + v) v = B c a omega r (pitch omega r - V - v) / 2``, a quadratic for `v`.
    Four Gauss points carry the span.

    Parameters
    ----------
    rho : ndarray
    radius, chord : float
        m.
    speed, along : ndarray
        rad/s; flow along the axis, m/s.
    """
    thrust, torque = 0.0, 0.0
    half = 0.5 * (TIP_LOSS - HUB) * radius
    for point, weight in zip(POINTS, WEIGHTS, strict=True):
        r = (0.5 * (TIP_LOSS + HUB) + 0.5 * (TIP_LOSS - HUB) * point) * radius
        angle = np.arctan(PITCH / (2 * np.pi * r))
        turn = speed * r
        k = BLADES * chord * SLOPE / (8 * np.pi * r) * turn
        b = along + k
        v = 0.5 * (np.sqrt(np.maximum(b**2 + 4 * k * (angle * turn - along), 0.0)) - b)
        through = along + v
        lift = 4 * np.pi * r * rho * through * v * (half * weight)
        drag = 0.5 * rho * BLADES * chord * PROFILE * (turn**2 + through**2) * (half * weight)
        thrust = thrust + lift - drag * through / turn
        torque = torque + r * (lift * through / turn + drag)
    return thrust, torque

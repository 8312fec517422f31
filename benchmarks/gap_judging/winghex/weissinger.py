"""The wing of the truth after Weissinger: horseshoe vortices, no flow through the chord at three quarters.

J. Weissinger, The Lift Distribution of Swept-Back Wings, NACA TM 1120 (1947); velocities of straight vortices
after Katz and Plotkin, Low-Speed Aerodynamics, section 2.11. Legs trail along the chord.
"""

from __future__ import annotations

import numpy as np


def downwash(at, left, right, x):
    """Return what a horseshoe of unit circulation induces downwards, 1/m.

    Parameters
    ----------
    at : tuple of 3 floats or ndarrays
        Where, m, x forward, y right, z down, from the bound vortex's line.
    left, right : float or ndarray
        Ends of the bound vortex along the span, m.
    x : float
        Core of the legs, m, so that a point on one of them stays finite.
    """
    ahead, side, below = at
    out = 0.0
    for end, sign in ((left, 1.0), (right, -1.0)):
        away = side - end
        square = away * away + below * below + x * x
        out = out + sign * away / square * (1 - ahead / np.sqrt(ahead * ahead + square))
    # The bound vortex washes down behind it
    square = ahead * ahead + below * below + x * x
    ends = [(side - e) / np.sqrt(square + (side - e) ** 2) for e in (left, right)]
    return (out - ahead / square * (ends[0] - ends[1])) / (4 * np.pi)


class Wing:
    """A straight wing of equal chord.

    Parameters
    ----------
    span, chord : float
        m
    panels : int
        Of each half.

    Attributes
    ----------
    place, width : ndarray, shape (panel, 1)
        Middles from the left tip, and widths, m.
    wash : ndarray, shape (panel, panel)
        Downwash of the legs at the bound vortices by circulation, 1/m.
    solve : ndarray, shape (panel, panel)
        Circulation by the flow through the chord at its three quarters, m.
    """

    def __init__(self, span, chord, panels=4):
        edges = 0.5 * span * np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * panels + 1) * 0.92)
        edges *= 0.5 * span / edges[-1]
        self.left, self.right = edges[:-1], edges[1:]
        self.place, self.width = 0.5 * (self.left + self.right)[:, None], (self.right - self.left)[:, None]
        self.chord = chord
        self.wash = 0.5 * self.at(0.0, self.place, 0.0, far=True)
        self.solve = np.linalg.inv(self.at(-0.5 * chord, self.place, 0.0))

    def at(self, ahead, side, below, core=1e-4, far=False):
        """Return downwash at places by circulation of the panels, 1/m, shape (place, panel).

        `far` behind the wing there is no bound vortex, and the legs are endless both ways.
        """
        where = (-1e4 if far else ahead, np.atleast_2d(side).reshape(-1, 1), below)
        return downwash(where, self.left, self.right, core)

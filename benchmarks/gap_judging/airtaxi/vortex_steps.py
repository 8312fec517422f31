"""A tapered wing as a lifting line of horseshoe vortices, with sections that lose lift at large angles.

Circulation is constant on every strip of the span. Where a section's angle is large, its camber is lessened
(after Mukherjee and Gopalarathnam, Journal of Aircraft 43(3), 2006): one correction of the linear solution.
"""

from __future__ import annotations

import numpy as np


def induced(at, left, right):
    """Return what horseshoes of unit circulation induce downwards, 1/m, shape (place, strip).

    Parameters
    ----------
    at : tuple of 3 ndarrays, shape (place, 1)
        Where, m: before the bound vortex, to the right, and below; legs run aft from it.
    left, right : ndarray, shape (strip,)
        Ends of the bound vortices, m.
    """
    ahead, side, below = at
    flat = ahead * ahead + below * below
    out = 0.0
    for end, sign in ((left, 1.0), (right, -1.0)):
        away = side - end
        leg = away * away + below * below
        whole = np.sqrt(flat + away * away)
        with np.errstate(divide="ignore", invalid="ignore"):
            bound = np.where(flat > 0, ahead / flat * (away / whole), 0.0)
        out = out + sign * (away / leg * (1 - ahead / whole) - bound)
    return out / (4 * np.pi)


class Wing:
    """Strips of a wing that tapers in a straight line.

    Parameters
    ----------
    span : float
        m
    chords : tuple of 2 floats
        In the middle and at the tips, m.
    slope : float
        Lift of a section per rad.
    strips : int
        Of each half.

    Attributes
    ----------
    place, width, chord : ndarray, shape (strip, 1)
        m, from the left tip.
    wash : ndarray, shape (strip, strip)
        Downwash at the strips by circulation, 1/m.
    solve : ndarray, shape (strip, strip)
        Circulation by the flow through the sections, m.
    """

    def __init__(self, span, chords, slope, strips=6):
        turn = np.linspace(0, np.pi, 2 * strips + 1)
        edges = -0.5 * span * np.cos(turn)
        self.left, self.right = edges[:-1], edges[1:]
        self.place = (-0.5 * span * np.cos(0.5 * (turn[1:] + turn[:-1])))[:, None]
        self.width = (self.right - self.left)[:, None]
        out = np.abs(self.place) / (0.5 * span)
        self.chord = chords[0] + (chords[1] - chords[0]) * out
        self.slope, self.span = slope, span
        still = np.zeros_like(self.place)
        self.wash = induced((still, self.place, still), self.left, self.right)
        self.solve = np.linalg.inv(np.diag(2 / (self.chord[:, 0] * slope)) + self.wash)

    def at(self, ahead, side, below):
        """Return downwash at places by circulation, 1/m, shape (place, strip)."""
        column = lambda x: np.reshape(x, (-1, 1))  # noqa: E731
        return induced((column(ahead), column(side), column(below)), self.left, self.right)


def beyond(angle, where, soft):
    """Return how far angles are beyond one, with a soft bend, rad."""
    return soft * np.log1p(np.exp((angle - where) / soft))

"""A straight wing whose circulation is a Fourier series along the span, with separated sections.

Glauert's series is solved at as many stations as it has terms (Glauert, The Elements of Aerofoil and
Airscrew Theory, chapter 11). Sections separate from the trailing edge: lift falls with Kirchhoff's square of
the mean of one and the root of the attached share of the chord, suction at the nose with that root (Leishman
and Beddoes, Journal of the American Helicopter Society 34(3), 1989).
"""

from __future__ import annotations

import numpy as np

TERMS = 12


class Wing:
    """Stations and matrices of a wing of equal chord.

    Parameters
    ----------
    span, chord, slope : float
        m, m, and lift of a section per rad.

    Attributes
    ----------
    place, width : ndarray, shape (station, 1)
        From the left tip, and how much of the span each stands for, m.
    wash : ndarray, shape (station, station)
        Downwash by circulation, 1/m.
    solve : ndarray, shape (station, station)
        Circulation of attached sections by the flow through them, m.
    """

    def __init__(self, span, chord, slope):
        n = np.arange(1, TERMS + 1)
        angle = (n - 0.5) * np.pi / TERMS
        self.sines = np.sin(np.outer(angle, n))
        self.series = np.linalg.inv(self.sines)  # coefficients by circulation
        self.span, self.chord, self.slope = span, chord, slope
        self.place = -0.5 * span * np.cos(angle)[:, None]
        self.width = (0.5 * span * np.sin(angle) * np.pi / TERMS)[:, None]
        self.wash = (self.sines * n / (2 * span * np.sin(angle)[:, None])) @ self.series
        self.solve = np.linalg.inv(np.eye(TERMS) * 2 / (chord * slope) + self.wash)

    def behind(self, back, above, points=400):
        """Return downwash in the middle by circulation, 1/m, of the vortices that trail to far behind."""
        angle = (np.arange(points) + 0.5) * np.pi / points
        y = -0.5 * self.span * np.cos(angle)
        n = np.arange(1, TERMS + 1)
        shed = n * np.cos(np.outer(angle, n)) * np.pi / points  # of each term, towards the right
        square = y * y + above * above
        drawn = y / square * (1 + back / np.sqrt(back * back + square)) / (4 * np.pi)
        return -(drawn @ shed) @ self.series


def attached(angle, where, soft):
    """Return how much of the chord is attached, of a section's angle from that without lift, rad."""
    return 0.5 * (1 - np.tanh((angle - where) / soft))

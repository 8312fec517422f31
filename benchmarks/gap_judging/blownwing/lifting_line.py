"""Swept wing of the truth as a lifting line whose sections lift less than in proportion.

Prandtl's line with piecewise constant circulation: vortices trail from the edges of the panels and wash the
panels' middles (Katz and Plotkin, Low-Speed Aerodynamics, section 8.1). Sections act in the flow across the
swept quarter-chord line (simple sweep theory).
"""

from __future__ import annotations

import numpy as np

SLOPE, ROUNDING = 6.0, 1.6  # lift of a section per rad, and what the square of its angle takes away


class LiftingLine:
    """Panels of a wing, from the left tip to the right one.

    Parameters
    ----------
    edges : sequence of float
        Of the right half's panels, from the middle to the tip, m.
    chords : sequence of float
        Of the right half's panels, m.
    sweep, dihedral : float
        Of the quarter-chord line, rad.
    root : float
        x of that line in the middle, m.

    Attributes
    ----------
    place : ndarray, shape (3, panel, 1)
        Middles of the panels, m.
    side, chord, area : ndarray, shape (panel, 1)
        -1 left, 1 right; m; m2.
    wash : ndarray, shape (panel, panel)
        Downwash by circulation, 1/m.
    """

    def __init__(self, edges, chords, sweep=0.0, dihedral=0.0, root=0.0):
        edges, chords = np.array(edges), np.array(chords)
        right = 0.5 * (edges[1:] + edges[:-1])
        y = np.concatenate([-right[::-1], right])
        every = np.concatenate([-edges[:0:-1], edges])
        self.side = np.sign(y)[:, None]
        self.chord = np.concatenate([chords[::-1], chords])[:, None]
        self.area = self.chord * np.diff(every)[:, None]
        out = np.abs(y)
        self.place = np.array([root - np.tan(sweep) * out, y, -np.tan(dihedral) * out])[:, :, None]
        self.wash = (1 / (y[:, None] - every[:-1]) - 1 / (y[:, None] - every[1:])) / (4 * np.pi)
        self._half = 0.5 * self.chord * np.cos(sweep)
        self._solve = np.linalg.inv(np.eye(y.size) + SLOPE * self._half * self.wash)

    def lift(self, ahead, through):
        """Return lift coefficients of the sections and the wing's own downwash, m/s.

        Parameters
        ----------
        ahead : ndarray, shape (panel, flight)
            Flow across the quarter-chord line, m/s.
        through : ndarray, shape (panel, flight)
            Flow through the chord plane, upwards, with what camber and flaps make of it, m/s.
        """
        made = self._solve @ (SLOPE * self._half * through)
        straight = (through - self.wash @ made) / ahead
        made = made - self._solve @ (self._half * ahead * SLOPE * ROUNDING * straight**3)
        wash = self.wash @ made
        angle = (through - wash) / ahead
        return SLOPE * angle * (1 - ROUNDING * angle * angle), wash

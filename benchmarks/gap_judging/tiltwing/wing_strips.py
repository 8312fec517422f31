"""A wing of the truth in strips that stall softly, each in the downwash of all.

Vortices trail along the chord from the edges of the strips and induce a velocity at the strips' middles (Katz
and Plotkin, Low-Speed Aerodynamics, section 8.1); across the body the circulation is the mean of its
neighbours'. To the share of it that is attached, a section lifts as attached flow does, and for the rest as a
plate in separated flow (after Leishman and Beddoes, A Semi-Empirical Model for Dynamic Stall, 1989).
"""

from __future__ import annotations

import numpy as np

SLOPE, CAMBER, PLATE = 5.9, 0.035, 2.4  # lift of a section per rad; rad; normal force of a plate
STALLED, SOFT = 0.29, 0.16  # sine of the angle where half of the flow is separated; how gradually
FRICTION, FLAP, FLAP_MOMENT, MOMENT = 0.014, 0.45, -0.50, -0.025
MEAN_SLOPE = 3.0  # per rad, of the correction between two rounds


class WingStrips:
    """Two halves of a wing, from the left tip to the right one.

    Parameters
    ----------
    edges : sequence of float
        Of one half's strips, from the body to the tip, m.
    chord : float
        m

    Attributes
    ----------
    place, area : ndarray, shape (strip, 1)
        Middles along the span, m; m2.
    wash : ndarray, shape (strip, strip)
        Downwash by circulation, 1/m.
    """

    def __init__(self, edges, chord):
        edges = np.array(edges)
        every = np.concatenate([-edges[::-1], edges])
        y = 0.5 * (every[1:] + every[:-1])
        n, middle = y.size // 2, y.size // 2
        wash = (1 / (y[:, None] - every[:-1]) - 1 / (y[:, None] - every[1:])) / (4 * np.pi)
        wash[:, [n - 1, n + 1]] += 0.5 * wash[:, [middle]]
        keep = np.arange(y.size) != middle
        self.chord, self.place = chord, y[keep][:, None]
        self.area = chord * np.diff(every)[keep][:, None]
        self.wash = wash[np.ix_(keep, keep)]
        self.width = self.area / chord
        self._correct = np.linalg.inv(np.eye(2 * n) + 0.5 * chord * MEAN_SLOPE * self.wash)

    def forces(self, ahead, through, moved, made, rounds=1, spoiled=None):
        """Return chordwise and normal forces, N, moments, N m by density, and circulation of the strips.

        Parameters
        ----------
        ahead, through : ndarray, shape (..., strip, flight)
            Flow along the chord, from ahead, and through the chord plane, from below, m/s.
        moved : ndarray, shape (..., strip, flight)
            Effective deflections of elevons.
        made : ndarray, shape (..., strip, flight)
            Circulation to begin with, m2/s: that of a moment ago.
        rounds : int
            Corrections of the circulation; in flight, one leaves 0.06 % of the accelerations.
        spoiled : callable, optional
            Factor of lift by the sine of the section's angle.
        """
        bend = (CAMBER + FLAP * moved) * ahead
        for left in range(rounds, -1, -1):
            below = through - self.wash @ made
            speed = np.sqrt(ahead * ahead + below * below)
            inverse = 1 / speed
            sine, cosine, bent = below * inverse, ahead * inverse, bend * inverse
            acts = sine + bent
            late = (sine + 0.3 * bent - STALLED) * (1 / SOFT)
            torn = 0.5 + 0.5 * late / np.sqrt(1 + late * late)  # separated share
            lift = acts * (SLOPE + torn * (PLATE * cosine - SLOPE))
            if spoiled is not None:
                lift = lift * spoiled(sine)
            if left:
                made = made + self._correct @ ((0.5 * self.chord) * speed * lift - made)
        pressed = 0.5 * speed * speed * self.area
        drag = FRICTION + 0.03 * moved * moved + torn * (PLATE - 0.1) * acts * acts
        chordwise = pressed * (lift * sine - drag * cosine)
        normal = -pressed * (lift * cosine + drag * sine)
        moment = pressed * self.chord * (MOMENT + FLAP_MOMENT * moved - 0.25 * torn * sine)
        return chordwise, normal, moment, made

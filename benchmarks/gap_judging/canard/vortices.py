"""Wing, canard and winglets of the truth as one lattice of horseshoe vortices.

Each panel has a bound vortex on its quarter-chord line, two legs that trail along the vehicle's x axis, and
a control point at three quarters of its chord (Katz and Plotkin, Low-Speed Aerodynamics, section 12.3).
"""

from __future__ import annotations

import numpy as np

FAR = 200.0  # m, length of the trailing legs


class Lattice:
    """Geometry and influence of all panels.

    Parameters
    ----------
    halves : list of tuple
        Right half of each surface: root and tip quarter-chord point, root and tip chord, number of panels.

    Attributes
    ----------
    left, right, middle, control, bound, normal : ndarray, shape (panel, 3)
        Ends and middle of the bound vortex, control point, vortex from end to end, unit normal; m.
    chord, area : ndarray, shape (panel,)
        m, m2.
    part : ndarray, shape (panel,)
        Index of the surface.
    solve : ndarray, shape (panel, panel)
        Circulation, m2/s, from flow through the panels against it, m/s.
    induced : ndarray, shape (3, panel, panel)
        Velocity at the bound vortices' middles by circulation.
    """

    def __init__(self, halves):
        left, right, chord, part = [], [], [], []
        for k, (root, tip, c_root, c_tip, count) in enumerate(halves):
            root, tip = np.array(root), np.array(tip)
            edge = np.linspace(0, 1, count + 1)
            # seen from behind, from the left tip to the right one; winglets from below to above
            upright = abs(tip[2] - root[2]) > abs(tip[1] - root[1])
            for side in (-1, 1):
                mirror = np.array([1.0, side, 1.0])
                order = range(count)[:: -1 if side < 0 and not upright else 1]
                for i in order:
                    a, b = (root + (tip - root) * edge[j] for j in (i, i + 1))
                    a, b = a * mirror, b * mirror
                    if side < 0 and not upright:
                        a, b = b, a
                    left.append(a)
                    right.append(b)
                    chord.append(c_root + (c_tip - c_root) * 0.5 * (edge[i] + edge[i + 1]))
                    part.append(k)
        self.left, self.right = np.array(left), np.array(right)
        self.chord, self.part = np.array(chord), np.array(part)
        self.bound = self.right - self.left
        self.middle = 0.5 * (self.left + self.right)
        self.control = self.middle - np.array([0.5, 0.0, 0.0]) * self.chord[:, None]
        self.normal = np.cross(np.array([-1.0, 0.0, 0.0]), self.bound)
        across = np.linalg.norm(self.normal, axis=1)
        self.normal /= across[:, None]
        self.area = across * self.chord
        through = np.einsum("cpk,ck->cp", self._velocity(self.control), self.normal)
        self.solve = -np.linalg.inv(through)
        self.induced = self._velocity(self.middle, own_bound=False).transpose(2, 0, 1).copy()

    def _velocity(self, points, own_bound=True):
        """Return the velocity of unit horseshoes at points, shape (point, panel, 3)."""
        back = np.array([-FAR, 0.0, 0.0])
        out = np.zeros((len(points), len(self.left), 3))
        for i, point in enumerate(points):
            for j, (a, b) in enumerate(zip(self.left, self.right, strict=True)):
                out[i, j] = segment(point, a + back, a) + segment(point, b, b + back)
                if own_bound or i != j:
                    out[i, j] += segment(point, a, b)
        return out


def segment(point, a, b):
    """Return the velocity of a straight vortex of unit circulation from `a` to `b`, by Biot and Savart."""
    r1, r2 = point - a, point - b
    turned = np.cross(r1, r2)
    n1, n2 = np.linalg.norm(r1), np.linalg.norm(r2)
    near = n1 * n2 * (n1 * n2 + r1 @ r2)
    return turned * (n1 + n2) / (4 * np.pi * max(near, 1e-12))

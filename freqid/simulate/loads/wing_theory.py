"""Classical wing theory, evaluated once for a geometry: the lifting line and the plain flap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def strip_edges(span: float, count: int) -> NDArray[np.float64]:
    """Return strip ends that crowd towards the tips, where the circulation falls steeply.

    Parameters
    ----------
    span : float
        m.
    count : int
        Strips.

    Returns
    -------
    ndarray, shape (count + 1,)
        Spanwise positions from the left tip to the right, m.
    """
    return -0.5 * span * np.cos(np.pi * np.arange(count + 1) / count)


def strip_centres(span: float, count: int) -> NDArray[np.float64]:
    """Return where the flow of each strip of `strip_edges` is evaluated, shape (count,), m."""
    return -0.5 * span * np.cos(np.pi * (np.arange(count) + 0.5) / count)


def induction(span: float, chord: NDArray[np.float64], lift_slope: float) -> NDArray[np.float64]:
    """Return the matrix that gives the induced from the undisturbed normal velocity.

    Parameters
    ----------
    span : float
        m.
    chord : ndarray, shape (strip,)
        m.
    lift_slope : float
        Of the section, per rad.

    Returns
    -------
    ndarray, shape (strip, strip)
        Downwash at each strip over the normal velocity V sin(alpha) at each strip.

    Notes
    -----
    A section's circulation is ``Gamma = c a (w - D Gamma) / 2`` with w the normal velocity and D the
    downwash of the strips' horseshoe vortices; the speed has cancelled, so one constant matrix,
    ``D (I + c a D / 2)^-1 c a / 2``, serves every speed, twist, roll rate and slipstream. Cosine spacing
    gives the elliptic wing's uniform downwash.

    References
    ----------
    Katz, J., and Plotkin, A., *Low-Speed Aerodynamics*, 2nd ed., section 8.1 (lifting line) and 12.1.
    """
    edges, centres = strip_edges(span, len(chord)), strip_centres(span, len(chord))
    trailing = 1 / (centres[:, None] - edges[None, :])
    downwash = (trailing[:, :-1] - trailing[:, 1:]) / (4 * np.pi)
    bound = 0.5 * lift_slope * np.diag(chord)
    return downwash @ np.linalg.solve(np.eye(len(chord)) + bound @ downwash, bound)


def flap_effect(chord_fraction: float) -> tuple[float, float]:
    """Return what a plain flap does by thin-aerofoil theory.

    Parameters
    ----------
    chord_fraction : float
        Flap chord over section chord.

    Returns
    -------
    angle, moment : float
        Change of the zero-lift angle, and of the moment about the quarter chord, per rad of deflection.

    References
    ----------
    Katz, J., and Plotkin, A., *Low-Speed Aerodynamics*, 2nd ed., section 5.4.
    """
    hinge = np.arccos(2 * chord_fraction - 1)
    return 1 - (hinge - np.sin(hinge)) / np.pi, -0.5 * np.sin(hinge) * (1 - np.cos(hinge))

"""Whether points of different densities agree, once similarity has carried one to the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from freqid.blend.global_model import GlobalModel
from freqid.blend.line import BlendedResponse, EquivalentKnots, Line
from freqid.blend.line_up import density_levels
from freqid.blend.similarity import equivalent
from freqid.core.arrays import Array
from freqid.core.results.corridor import Corridor
from freqid.core.results.point import PointModel


@dataclass(frozen=True)
class Agreement:
    """How one response of the points at one density compares with the line at the next lower one.

    Attributes
    ----------
    response : str
    rho : tuple of 2 floats
        Mean densities of the two levels, kg/m3.
    points : int
        How many points of the higher level the lower one's line reaches.
    chi_square : float
        Of the differences of bias and derivatives in units of their joint covariance.
    degrees_of_freedom : int
    p : float
        Probability of a larger value where only the stated errors make the two differ.
    difference : float
        Root mean square of what the derivatives' differences make of the motion that was flown,
        relative to that of the derivatives: a small one may be significant and yet not matter.
    """

    response: str
    rho: tuple[float, float]
    points: int
    chi_square: float
    degrees_of_freedom: int
    p: float
    difference: float


def density_agreement(model: GlobalModel) -> list[Agreement]:
    """Compare each density's points with the line through those of the next lower density.

    Parameters
    ----------
    model : GlobalModel

    Returns
    -------
    list of Agreement
        By pair of densities and response; empty for points of one density, or where no two of a density
        are there to make a line, or none of the other is within the tolerances of it.

    Notes
    -----
    All differences of a response are tested together, with the covariance that they share through the
    line's knots. The line's own error of interpolation is not in it: where the two levels' points lie
    at different places of the corridor, a significant difference may be just that.
    """
    corridor, found = model.corridor, []
    level = density_levels(corridor.rho)
    for low in range(level.max()):
        below, above = np.flatnonzero(level == low), np.flatnonzero(level == low + 1)
        if below.size < 2:
            continue
        line = Line(corridor, below)
        at = line.position(corridor.u[above] * equivalent(corridor.rho[above]), corridor.schedule[:, above])
        near = ~model.tolerance.exceeded(at)
        if not near.any():
            continue
        rho = (line.rho, float(corridor.rho[above].mean()))
        found += [
            _compare(corridor, line.local[i], name, above[near], at.s[near], rho)
            for i, name in enumerate(corridor.responses)
        ]
    return found


def repeat_agreement(one: PointModel, other: PointModel) -> dict[str, float]:
    """Return by response the probability of a larger chi-square between two models, were they alike.

    Parameters
    ----------
    one, other : PointModel
        Of one condition, from different manoeuvres and so with independent errors.

    Returns
    -------
    dict of str to float
        Of the responses that both have, over the derivatives that both have: ``d^T (P1 + P2)^-1 d``.
    """
    found = {}
    for name in one.responses:
        if name not in other.responses:
            continue
        a, b = one[name], other[name]
        shared = [n for n in a.regressors if n in b.regressors]
        i, j = ([r.regressors.index(n) for n in shared] for r in (a, b))
        difference = a.estimate[i] - b.estimate[j]
        covariance = a.covariance[np.ix_(i, i)] + b.covariance[np.ix_(j, j)]
        scale = 1 / np.sqrt(np.diagonal(covariance))
        scaled = difference * scale
        statistic = scaled @ np.linalg.solve(covariance * np.outer(scale, scale), scaled)
        found[name] = float(chi2.sf(float(statistic), len(shared)))
    return found


def _compare(
    corridor: Corridor,
    own: BlendedResponse,
    name: str,
    members: NDArray[np.int64],
    s: Array,
    rho: tuple[float, float],
) -> Agreement:
    """Compare one response of some points with a line, at those points' own trims."""
    other = EquivalentKnots(corridor[name], members, list(corridor.units), equivalent(corridor.rho[members]))
    n, size = s.size, 1 + len(own.columns)
    knots = len(own.covariance)
    # What each point's model is about its own trim, by the line: bias there and derivatives.
    move = np.tile(np.eye(size), (n, 1, 1))
    move[:, 0, 1:] = (other.trims - own.trim(s)).T
    difference = np.einsum("iab,bi->ia", move, own.parameters(s)) - other.values.T
    by_knot = np.einsum("iab,bki->iakb", move, own.parameters.weights(s)).reshape(n * size, knots, size)
    covariance = np.einsum("akb,kbc,dkc->ad", by_knot, own.covariance, by_knot, optimize=True)
    for i, block in enumerate(other.covariance):
        here = slice(i * size, (i + 1) * size)
        covariance[here, here] += block
    flat = difference.ravel()
    scale = 1 / np.sqrt(np.diagonal(covariance))
    statistic = float(flat * scale @ np.linalg.solve(covariance * np.outer(scale, scale), flat * scale))
    moved = other.regressor_rms
    return Agreement(
        response=name,
        rho=rho,
        points=n,
        chi_square=statistic,
        degrees_of_freedom=flat.size,
        p=float(chi2.sf(statistic, flat.size)),
        difference=float(
            np.linalg.norm(difference[:, 1:].T * moved) / np.linalg.norm(other.values[1:] * moved)
        ),
    )

"""One line of the corridor: where on it an aircraft is, and the local model there."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from freqid.blend.pchip import Pchip
from freqid.blend.similarity import equivalent, goes_with_velocity
from freqid.core.arrays import Array
from freqid.core.results.corridor import Corridor, KnotResponse

# Where wings tilt by more than this per unit of speed, their tilt says where along the corridor the
# aircraft is, and speed is a perturbation; where they tilt by less, speed says it. rad per m/s.
STILL_TILT = np.deg2rad(0.05)
_GRID = 32  # starting points per interval between knots, for the search of the nearest point
_STEPS = 12  # of Newton's method, which needs 3 or 4 from there


@dataclass(frozen=True)
class Position:
    """Nearest points of a line.

    Attributes
    ----------
    s : ndarray, shape (n,)
        Equivalent speed there, m/s.
    by_speed : ndarray, shape (n,)
        Its derivative with respect to the equivalent speed flown.
    by_tilt : ndarray, shape (2, n)
        Its derivative with respect to the tilts flown, m/s per rad.
    speed_off : ndarray, shape (n,)
        Equivalent speed flown less s, m/s.
    tilt_off : ndarray, shape (2, n)
        Tilts flown less those of the line, rad.
    """

    s: Array
    by_speed: Array
    by_tilt: Array
    speed_off: Array
    tilt_off: Array


class Line:
    """Point models along one line, in equivalent quantities and so without density.

    Parameters
    ----------
    corridor : Corridor
    members : ndarray of int
        Its knots that belong to the line, ascending in equivalent speed; two or more.

    Attributes
    ----------
    rho : float
        Mean density of the knots, kg/m3.
    tilt : Pchip
        Front and rear wing tilt over equivalent speed.
    """

    def __init__(self, corridor: Corridor, members: NDArray[np.int64]):
        k = equivalent(corridor.rho[members])
        self.rho = float(corridor.rho[members].mean())
        self.speed = corridor.u[members] * k
        self.tilt = Pchip(self.speed, corridor.tilt[:, members])
        names = list(corridor.units)
        knots = [EquivalentKnots(r, members, names, k) for r in corridor.responses.values()]
        self.local = [BlendedResponse(one, self.speed) for one in knots]
        steps = [np.linspace(a, b, _GRID, endpoint=False) for a, b in pairwise(self.speed)]
        self._grid = np.append(np.concatenate(steps), self.speed[-1])

    def position(self, speed: Array, tilt: Array) -> Position:
        """Return the points of the line nearest to what is flown.

        Parameters
        ----------
        speed : ndarray, shape (n,)
            Equivalent speed, m/s.
        tilt : ndarray, shape (2, n)
            rad.

        Notes
        -----
        Nearest in ``sum (tilt - tilt(s))^2 + STILL_TILT^2 (speed - s)^2``. A point model tells what a
        change of speed does at fixed tilt; only the corridor tells what tilting does. So s must follow
        the tilt wherever the tilt tells it.
        """
        on_grid = np.array([*self.tilt(self._grid), STILL_TILT * self._grid])
        flown = np.array([*tilt, STILL_TILT * speed])
        distance = (on_grid**2).sum(axis=0)[:, None] - 2 * on_grid.T @ flown
        nearest = distance.argmin(axis=0)
        low = self._grid[np.maximum(nearest - 1, 0)]
        high = self._grid[np.minimum(nearest + 1, self._grid.size - 1)]
        s = self._grid[nearest]
        for _ in range(_STEPS):
            fall, curve, _ = self._pull(s, speed, tilt)
            s, before = np.clip(s + fall / curve, low, high), s
            if np.allclose(s, before, rtol=0, atol=1e-12):
                break
        fall, curve, slope = self._pull(s, speed, tilt)
        held = np.abs(fall) > 1e-6 * curve  # at an end of the line, beyond which nothing is known
        by_speed = np.where(held, 0.0, STILL_TILT**2 / curve)
        by_tilt = np.where(held, 0.0, slope / curve)
        return Position(s, by_speed, by_tilt, speed - s, tilt - self.tilt(s))

    def _pull(self, s: Array, speed: Array, tilt: Array) -> tuple[Array, Array, Array]:
        """Return how half the squared distance falls with s, how that curves, and the tilts' slope."""
        slope, off = self.tilt(s, 1), tilt - self.tilt(s)
        fall = (off * slope).sum(axis=0) + STILL_TILT**2 * (speed - s)
        base = (slope**2).sum(axis=0) + STILL_TILT**2
        curve = base - (off * self.tilt(s, 2)).sum(axis=0)
        return fall, np.where(curve > 0.1 * base, curve, base), slope

    def trim(self, s: Array, count: int) -> Array:
        """Return the equivalent regressors that the models are expanded about, shape (count, n)."""
        x = np.zeros((count, s.size))
        for local in self.local:
            x[local.columns] = local.trim(s)
        return x


class EquivalentKnots:
    """One response at some knots in equivalent quantities.

    Attributes
    ----------
    columns : list of int
        Rows of the corridor's regressors that the response depends on.
    values : ndarray, shape (1 + p, knot)
        Bias and derivatives.
    covariance : ndarray, shape (knot, 1 + p, 1 + p)
        Of the values.
    trims, regressor_rms : ndarray, shape (p, knot)
    """

    def __init__(self, knots: KnotResponse, members: NDArray[np.int64], names: list[str], k: Array):
        self.columns = [names.index(n) for n in knots.regressors]
        units = dict(zip(knots.regressors, knots.regressor_units, strict=True))
        scale = k ** goes_with_velocity(units)[:, None]  # (p, knot): equivalent over true regressors
        self.values = np.vstack([knots.bias[members], knots.estimate[:, members] / scale])
        self.trims = knots.trim[:, members] * scale
        self.regressor_rms = knots.regressor_rms[:, members] * scale
        p = len(self.columns)
        self.covariance = np.zeros((members.size, 1 + p, 1 + p))
        self.covariance[:, 0, 0] = knots.bias_std_error[members] ** 2
        self.covariance[:, 1:, 1:] = knots.covariance[members] / (scale.T[:, :, None] * scale.T[:, None, :])


class BlendedResponse:
    """Bias and derivatives of one response along a line, and the trim that they hold at.

    Attributes
    ----------
    columns : list of int
        As in `EquivalentKnots`.
    parameters : Pchip
        Bias and derivatives, 1 + p channels.
    trim : Pchip
        p channels.
    covariance : ndarray, shape (knot, 1 + p, 1 + p)
    """

    def __init__(self, knots: EquivalentKnots, speed: Array):
        self.columns, self.covariance = knots.columns, knots.covariance
        spread = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).T
        self.parameters, self.trim = Pchip(speed, knots.values, spread), Pchip(speed, knots.trims)

    def variance(self, s: Array, factors: Array) -> Array:
        """Return the variance of ``sum factors parameters(s)``, shape (n,), factors (1 + p, n)."""
        by_knot = np.swapaxes(self.parameters.weights(s) * factors[:, None, :], 0, 1)
        return np.einsum("kji,kji->i", self.covariance @ by_knot, by_knot)

    def own_variance(self, s: Array) -> Array:
        """Return the variance of each parameter, shape (1 + p, n)."""
        own = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.einsum("jki,kj->ji", self.parameters.weights(s) ** 2, own)

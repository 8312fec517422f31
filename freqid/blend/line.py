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
# What is scheduled in another unit counts by its range over the corridor, as much as a wing's quarter turn.
STILL_TILT = np.deg2rad(0.05)
_GRID = 32  # starting points per interval between knots, for the search of the nearest point
_STEPS = 12  # of Newton's method, which needs 3 or 4 from there


@dataclass(frozen=True)
class Position:
    """Nearest points of a line.

    Attributes
    ----------
    s : ndarray, shape (n,)
        The corridor's coordinate there: equivalent speed, m/s, or the variable that lines run along.
    by_speed : ndarray, shape (n,)
        Its derivative with respect to the equivalent speed flown.
    by_schedule : ndarray, shape (variable, n)
        Its derivative with respect to the scheduled variables flown.
    speed_off : ndarray, shape (n,)
        Equivalent speed flown less that of the line, m/s.
    schedule_off : ndarray, shape (variable, n)
        Scheduled variables flown less those of the line; tilts rad, others as `Line.turn` makes them.
    """

    s: Array
    by_speed: Array
    by_schedule: Array
    speed_off: Array
    schedule_off: Array


class Line:
    """Point models along one line, in equivalent quantities and so without density.

    Parameters
    ----------
    corridor : Corridor
    members : ndarray of int
        Its knots that belong to the line, ascending in the corridor's coordinate; two or more.

    Attributes
    ----------
    rho : float
        Mean density of the knots, kg/m3.
    knots : ndarray, shape (knot,)
        The coordinate of the knots.
    path : Pchip
        Scheduled variables, then equivalent speed, along the line.
    turn : ndarray, shape (variable,)
        Radians that a unit of each scheduled variable counts as.
    """

    def __init__(self, corridor: Corridor, members: NDArray[np.int64]):
        k = equivalent(corridor.rho[members])
        self.rho = float(corridor.rho[members].mean())
        self.knots = corridor.coordinate[members]
        self.turn = turns(corridor)
        # Scheduled variables and equivalent speed, scaled so that they count alike.
        self._scale = np.append(self.turn, STILL_TILT)[:, None]
        path = np.vstack([corridor.schedule[:, members], corridor.u[members] * k])
        self.path = Pchip(self.knots, path)
        names = list(corridor.units)
        knots = [EquivalentKnots(r, members, names, k) for r in corridor.responses.values()]
        self.local = [BlendedResponse(one, self.knots) for one in knots]
        steps = [np.linspace(a, b, _GRID, endpoint=False) for a, b in pairwise(self.knots)]
        self._grid = np.append(np.concatenate(steps), self.knots[-1])

    def schedule(self, s: Array) -> Array:
        """Return the scheduled variables along the line, shape (variable, n)."""
        return self.path(s)[:-1]

    def speed(self, s: Array) -> Array:
        """Return the equivalent speed along the line, m/s, shape (n,)."""
        return self.path(s)[-1]

    def position(self, speed: Array, schedule: Array) -> Position:
        """Return the points of the line nearest to what is flown.

        Parameters
        ----------
        speed : ndarray, shape (n,)
            Equivalent speed, m/s.
        schedule : ndarray, shape (variable, n)
            Scheduled variables, SI.

        Notes
        -----
        Nearest in ``sum (tilt - tilt(s))^2 + STILL_TILT^2 (speed - speed(s))^2``. A point model tells what a
        change of speed does at fixed tilt; only the corridor tells what tilting does. So s must follow
        the tilt wherever the tilt tells it.
        """
        on_grid = self._scale * self.path(self._grid)
        flown = self._scale * np.vstack([schedule, speed])
        distance = (on_grid**2).sum(axis=0)[:, None] - 2 * on_grid.T @ flown
        nearest = distance.argmin(axis=0)
        low = self._grid[np.maximum(nearest - 1, 0)]
        high = self._grid[np.minimum(nearest + 1, self._grid.size - 1)]
        s = self._grid[nearest]
        for _ in range(_STEPS):
            fall, curve, _ = self._pull(s, flown)
            s, before = np.clip(s + fall / curve, low, high), s
            if np.allclose(s, before, rtol=0, atol=1e-12):
                break
        fall, curve, slope = self._pull(s, flown)
        held = np.abs(fall) > 1e-6 * curve  # at an end of the line, beyond which nothing is known
        by_path = np.where(held, 0.0, self._scale * slope / curve)
        off = flown - self._scale * self.path(s)
        return Position(s, by_path[-1], by_path[:-1], off[-1] / STILL_TILT, off[:-1])

    def _pull(self, s: Array, flown: Array) -> tuple[Array, Array, Array]:
        """Return how half the squared distance falls with s, how that curves, and the path's slope."""
        slope, off = self._scale * self.path(s, 1), flown - self._scale * self.path(s)
        fall, base = (off * slope).sum(axis=0), (slope**2).sum(axis=0)
        curve = base - (off * self._scale * self.path(s, 2)).sum(axis=0)
        return fall, np.where(curve > 0.1 * base, curve, base), slope

    def trim(self, s: Array, count: int) -> Array:
        """Return the equivalent regressors that the models are expanded about, shape (count, n)."""
        x = np.zeros((count, s.size))
        for local in self.local:
            x[local.columns] = local.trim(s)
        return x


def turns(corridor: Corridor) -> Array:
    """Return the radians that a unit of each scheduled variable counts as, shape (variable,)."""
    rows = zip(corridor.scheduled_units, corridor.schedule, strict=True)
    return np.array([1.0 if unit == "rad" else np.pi / 2 / (np.ptp(row) or 1.0) for unit, row in rows])


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

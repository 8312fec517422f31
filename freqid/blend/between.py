"""One response between lines of different density: what each line's parameters are multiplied by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.blend.line import BlendedResponse
from freqid.blend.locate import Located
from freqid.core.arrays import Array


class Mixed:
    """A response as a sum over lines of ``[bias, derivatives]`` times factors.

    Parameters
    ----------
    response : sequence of BlendedResponse
        By line.
    at : Located

    Attributes
    ----------
    factors : ndarray, shape (line, 1 + p, n)
    columns : list of int, length p
        Rows of ``Located.x`` that the response depends on.

    Notes
    -----
    With weights 1 - c and c of two lines at trims x0 and x0 + d, the response at regressors x is

    ``z = (1 - c) z_1(x) + c z_2(x) + c (1 - c) / 2 (theta_2 - theta_1) d``

    The two tangents' mean lies off a curved load by ``c (1 - c) / 2 d^T F'' d``, and ``F'' d`` is the
    difference of the derivatives: the last term, with which z is right to the second order in d.
    """

    def __init__(self, response: Sequence[BlendedResponse], at: Located):
        self._response, self._at = response, at
        self.columns = response[0].columns
        x = at.x[self.columns]
        places = list(zip(response, at.positions, strict=True))
        trim = np.array([one.trim(p.s) for one, p in places])
        self._parameters = np.array([one.parameters(p.s) for one, p in places])
        self._off, self._gap = x - trim, np.diff(trim, axis=0)
        self._bend = np.diff(self._parameters[:, 1:], axis=0)
        w = at.weights[:, None]
        self._curving = 0.5 * w[:-1] * w[1:]
        self.factors = np.concatenate([w, _passed_on(w * self._off, -self._curving * self._gap)], axis=1)

    @property
    def value(self) -> Array:
        """The response, shape (n,)."""
        return np.einsum("lji,lji->i", self._parameters, self.factors)

    @property
    def variance(self) -> Array:
        """Its variance from the errors at the knots, shape (n,)."""
        places = zip(self._response, self._at.positions, self.factors, strict=True)
        return np.sum([one.variance(p.s, f) for one, p, f in places], axis=0)

    @property
    def by_regressor(self) -> Array:
        """Derivative with respect to the response's equivalent regressors, shape (p, n)."""
        return np.einsum("li,lji->ji", self._at.weights, self._parameters[:, 1:])

    @property
    def by_place(self) -> Array:
        """Derivative with respect to the place on each line, regressors held, shape (line, n)."""
        places = list(zip(self._response, self._at.positions, strict=True))
        changing = np.array([one.parameters(p.s, 1) for one, p in places]) * self.factors
        moving = np.array([one.trim(p.s, 1) for one, p in places])
        weighted = self._at.weights[:, None] * self._parameters[:, 1:]
        moving *= _passed_on(weighted, self._curving * self._bend)
        return changing.sum(axis=1) - moving.sum(axis=1)

    @property
    def by_weight(self) -> Array:
        """Derivative with respect to density through the lines' weights alone, shape (n,)."""
        w, slope = self._at.weights[:, None], self._at.slopes[:, None]
        tangents = self._parameters[:, :1] + (self._parameters[:, 1:] * self._off).sum(axis=1, keepdims=True)
        curving = 0.5 * (slope[:-1] * w[1:] + w[:-1] * slope[1:])
        return (slope * tangents).sum(axis=(0, 1)) + (curving * self._bend * self._gap).sum(axis=(0, 1))


def _passed_on(by_line: Array, gain: Array) -> Array:
    """Return values by line where each gained something from the next, shape (line, p, n)."""
    by_line = by_line.copy()
    by_line[:-1] += gain
    by_line[1:] -= gain
    return by_line

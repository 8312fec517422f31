"""How far a gap shrinks once named effects are added: refitted on some manoeuvres, scored on others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from freqid.core.diagnosis import Share
from freqid.gap.changes import CHANGE, Values, changes, sources_of_all
from freqid.gap.compare import Compared
from freqid.gap.gather import evidence_of
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_GENEROUS = 3.0  # times what is expected of a parameter


@dataclass(frozen=True, eq=False)
class Misfit:
    """Whitened squared residual of some manoeuvres, tolerances refitted, before and after effects are added.

    Along the directions that any candidate can move, so that a gap is not lost among the thousands of
    lines that hold noise alone: with all of them a gap below some hundreds in ``s^T S^-1 s`` would be
    undefined.

    Attributes
    ----------
    count : int
        Directions.
    before, after : float
        Sums over them.
    null : ndarray, shape (draw,)
        What noise and tolerances alone make.
    across : ndarray, shape (draw,)
        Twice their product with the change that the effects make.
    """

    count: int
    before: float
    after: float
    null: Array
    across: Array

    @classmethod
    def pooled(cls, parts: Sequence[Misfit]) -> Misfit:
        """Return the misfit of several sets of manoeuvres together."""
        return cls(
            sum(p.count for p in parts),
            sum(p.before for p in parts),
            sum(p.after for p in parts),
            np.sum([p.null for p in parts], axis=0),
            np.sum([p.across for p in parts], axis=0),
        )

    def share(self, interval: float) -> Share:
        """Return ``G = 1 - (after - noise) / (before - noise)`` with its interval.

        The interval is that of noise: draws are added to the change that the effects make. Undefined where
        the gap is within two standard deviations of noise.
        """
        noise, scatter = float(self.null.mean()), float(self.null.std())
        gap = self.before - noise
        if gap < 2 * scatter:
            before, level, one = (x / self.count for x in (self.before, noise, scatter))
            why = (
                f"before, {before:.4g}, is within two standard deviations of noise, {level:.4g} +- {one:.2g}"
            )
            return Share(np.nan, np.nan, np.nan, why)
        wander = self.null - noise
        each = 1 - (self.after - noise + wander) / np.maximum(gap + self.across + wander, 0.1 * gap)
        lo, hi = np.quantile(each, [(1 - interval) / 2, (1 + interval) / 2])
        return Share(1 - (self.after - noise) / gap, float(lo), float(hi))


def misfit(compared: Sequence[Compared], effects: Sequence[Effect], settings: Values) -> Misfit:
    """Score effects on manoeuvres that they were not fitted to.

    Parameters
    ----------
    compared : sequence of Compared
    effects : sequence of Effect
    settings : dict of dict of float
        Of a `Refit`.
    """
    made_here = [changes(c, effects, settings) for c in compared]
    return misfit_with(compared, made_here, sources_of_all(effects, compared[0]))


def misfit_with(
    compared: Sequence[Compared], made_here: Sequence[Complex], sources: Sequence[str] = ()
) -> Misfit:
    """Score changes of manoeuvres' residuals.

    Parameters
    ----------
    compared : sequence of Compared
    made_here : sequence of ndarray of complex, shape (row, line)
        The change in each manoeuvre.
    sources : sequence of str
        Channels that the changes are computed from, whose noise may be in them.
    """
    named = [(0 * z, {CHANGE: z, **c.signatures}) for c, z in zip(compared, made_here, strict=True)]
    evidence = evidence_of(compared, changes=named, sources={CHANGE: tuple(sources)})
    last = 1 + len(evidence.signatures)
    gram = evidence.metric[1:last, 1:last]
    expected = np.array([_expected(compared[0], name) for name in evidence.signatures])
    # onto directions in the metric, each as far as it may be expected to be moved
    lengths, directions = np.linalg.eigh(expected[:, None] * gram * expected)
    onto = (directions / np.sqrt(1 + np.maximum(lengths, 0.0))).T * expected
    data = onto @ evidence.metric[1:last, 0]
    change = onto @ gram[:, evidence.signatures.index(CHANGE)]
    null = onto @ np.array([evidence.null_products(k) for k in range(1, last)])
    return Misfit(
        count=int((lengths > 1).sum()),
        before=float(data @ data),
        after=float((data - change) @ (data - change)),
        null=(null**2).sum(axis=0),
        across=2 * change @ null,
    )


def _expected(compared: Compared, name: str) -> float:
    """Return by how much a candidate's parameter may be off, generously; the change itself by its all."""
    if name == CHANGE:
        return 1.0
    return _GENEROUS * compared.scales[name]

"""Local, global, semi-local and one-shot models on manoeuvres that none of them is made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from freqid.blend.semi_local.problem import LocalProblem
from freqid.core.arrays import Array
from freqid.core.results.advance_ratio import AdvanceRatioModel, LocalDerivatives

LOCAL = "local"


@dataclass(frozen=True, eq=False)
class HeldOutScores:
    """How far models are off on held-out manoeuvres.

    Attributes
    ----------
    ids : tuple of str, length m
        Of the manoeuvres.
    models : tuple of str, length k
        ``local`` is the neighbour: the estimates of the nearest manoeuvre of the same cluster.
    misfit : ndarray, shape (k, m)
        Twice the log likelihood lost against the manoeuvre's own fit, over the number of derivatives: one is
        the error of that own fit alone.
    responses : tuple of str, length r
        ``CX`` and so on.
    by_response : ndarray, shape (k, r, m)
        The same by response, from the expansion of the likelihood; nan where a manoeuvre tells none of it.
    """

    ids: tuple[str, ...]
    models: tuple[str, ...]
    misfit: Array
    responses: tuple[str, ...] = ()
    by_response: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))

    @property
    def mean(self) -> dict[str, float]:
        """Mean misfit by model."""
        return dict(zip(self.models, self.misfit.mean(axis=1).tolist(), strict=True))

    def difference(self, model: str, other: str) -> tuple[float, float]:
        """Return the mean of one model's misfit less another's, and its standard error.

        The manoeuvres are paired: what one is harder to predict than another does not count.
        """
        off = self.misfit[self.models.index(model)] - self.misfit[self.models.index(other)]
        error = off.std(ddof=1) / np.sqrt(off.size) if off.size > 1 else np.nan
        return float(off.mean()), float(error)


def score_held_out(
    models: Sequence[AdvanceRatioModel],
    held_out: LocalDerivatives,
    problems: Mapping[str, LocalProblem],
) -> HeldOutScores:
    """Score models, and the neighbouring local estimates, on held-out manoeuvres.

    Parameters
    ----------
    models : sequence of AdvanceRatioModel
        Each of its own kind; the first one's clusters give the neighbours.
    held_out : LocalDerivatives
        Their trims; the estimates are not used.
    problems : mapping of str to LocalProblem
        By the id of the manoeuvre.
    """
    rows = np.empty((1 + len(models), len(held_out.ids)))
    responses = tuple(dict.fromkeys(name.partition(".")[0] for name in held_out.names))
    parts = np.full((1 + len(models), len(responses), len(held_out.ids)), np.nan)
    for i, identifier in enumerate(held_out.ids):
        problem = problems[identifier]
        j, alpha = float(held_out.advance_ratio[i]), float(held_out.alpha[i])
        predicted = [neighbour(models[0], problem.names, j, alpha)]
        for model in models:
            every = model.derivatives(j, alpha, outside="hold")
            predicted.append(np.array([every[name] for name in problem.names]))
        rows[:, i] = [problem.misfit(theta) / theta.size for theta in predicted]
        own = [responses.index(name.partition(".")[0]) for name in problem.names]
        for k, theta in enumerate(predicted):
            minimum, information = problem.expand(theta)
            for r in set(own):
                at = np.flatnonzero(np.array(own) == r)
                off = (theta - minimum)[at]
                parts[k, r, i] = off @ information[np.ix_(at, at)] @ off / at.size
    return HeldOutScores(held_out.ids, (LOCAL, *(m.kind for m in models)), rows, responses, parts)


def neighbour(model: AdvanceRatioModel, names: Sequence[str], j: float, alpha: float) -> Array:
    """Return the local estimates of the nearest manoeuvre that tells all of some derivatives, shape (p,).

    Nearest in the cluster by ``1 / J``, which is zero with stopped propellers.
    """
    local = model.cluster_at(alpha).local
    columns = [local.place(name) for name in names]
    told = np.isfinite(local.estimate[:, columns]).all(axis=1)
    away = np.where(told, np.abs(1 / local.advance_ratio - 1 / j), np.inf)
    return local.estimate[int(away.argmin()), columns]

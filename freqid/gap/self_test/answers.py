"""What the diagnosis answers to draws whose truth is known, by the verdict's own rules.

Noise, tolerances and error of form are drawn once and serve all insertions: what an insertion adds to the
products with all columns is exact, as these are linear in the data, and to the log evidence of no effect,
which is quadratic in them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from freqid.core.arrays import Array
from freqid.core.results.gap_self_test import SEVERAL
from freqid.gap.infer.at_form import Kept, Reduced
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.evidence import NONE, Evidence
from freqid.gap.infer.null_draws import Drawn, drawn_from_posterior
from freqid.gap.infer.system import System
from freqid.gap.infer.weighing import Weighing
from freqid.gap.infer.which import Ranking, probability_of_none, rank
from freqid.gap.model.candidate import OTHER
from freqid.gap.settings import INTERVAL, NAMED, TEMPERATURE

Index = Sequence[int] | NDArray[np.intp]

Data = dict[Form, Drawn]
"""By error of form; products with all columns."""


@dataclass(frozen=True)
class Answer:
    """What one draw is answered; all beyond `called` is of a draw in which a gap is.

    Attributes
    ----------
    truth : str
        Effect id, or `NONE`.
    insertion : int
        Index; -1 where nothing was inserted.
    called : bool
        Whether a gap is.
    named : tuple of str
        The single name with those that it cannot be told from; empty where none is given.
    probability : float
        Given to the likeliest effect and those that it cannot be told from.
    leading : bool
        Whether the truth is the likeliest effect or cannot be told from it.
    truth_probability : float
        Given to the truth.
    covered : bool
        Whether the set holds the truth, or the truth cannot be told from the likeliest effect.
    other : bool
        Whether `OTHER` is likelier than any effect.
    """

    truth: str
    insertion: int
    called: bool = False
    named: tuple[str, ...] = ()
    probability: float = math.nan
    leading: bool = False
    truth_probability: float = math.nan
    covered: bool = False
    other: bool = False

    @property
    def right(self) -> bool:
        """Whether the name that is given holds the truth."""
        return self.truth in self.named

    @property
    def word(self) -> str:
        """Column of the confusion matrix: the name, `OTHER`, `SEVERAL` or `NONE`."""
        if not self.called:
            return NONE
        if self.named:
            return self.truth if self.right else self.named[0]
        return OTHER if self.other else SEVERAL


@dataclass(frozen=True, eq=False)
class DrawnData:
    """Data without an effect, each with an error of form of its posterior.

    Attributes
    ----------
    system : System
        Whose columns the data are multiplied with; those of the candidates come first.
    data : dict
    """

    system: System
    data: Data

    @classmethod
    def of(cls, evidence: Evidence, system: System, count: int, seed: int) -> DrawnData:
        """Draw noise, tolerances and errors of form."""
        rng = np.random.default_rng([seed, 79])
        return cls(system, drawn_from_posterior(evidence, system, count, rng))

    @property
    def count(self) -> int:
        """Number of draws."""
        return next(iter(self.data.values())).none.size

    def with_effect(self, weights: Array, at: Index, rows: Index | None = None) -> Data:
        """Return some draws with columns added to the data, as every error of form sees them.

        Parameters
        ----------
        weights : ndarray, shape (column,)
        at : sequence of int
            Of the draws.
        rows : sequence of int, optional
            Columns whose products with the data are wanted; all where absent.
        """
        added = np.flatnonzero(weights)  # few of the columns: all others would be multiplied by zero
        w, draws = weights[added], np.asarray(at)
        wanted = np.arange(len(weights)) if rows is None else np.asarray(rows)
        found: Data = {}
        for f, (g, log, departures) in self.data.items():
            reduced = self.system.reduced(f)
            G, slopes = reduced.G, reduced.posterior.slopes[:, added]
            more = G[wanted[:, None], added] @ w
            # up to a constant in f, the log evidence is -r' C^-1 r / 2, with r' C^-1 x the products in g
            less = w @ g[added[:, None], draws] + 0.5 * float(w @ G[added[:, None], added] @ w)
            found[f] = Drawn(
                g[wanted[:, None], draws] + more[:, None],
                log[draws] - less,
                departures[:, draws] + (slopes @ w)[:, None],
            )
        return found


@dataclass(frozen=True, eq=False)
class Weighed:
    """Bayes factors of drawn data.

    Attributes
    ----------
    evidence : Evidence
        Of the records: its stack, and where its candidates' columns are.
    data : dict
    places : ndarray, shape (form, candidate, draw)
    none : ndarray, shape (form, draw)
    """

    evidence: Evidence
    data: Data
    places: Array
    none: Array

    @classmethod
    def of(cls, evidence: Evidence, data: Data) -> Weighed:
        """Weigh drawn data by every candidate."""
        system, weighing = evidence.system, evidence.weighing
        n, sizes = system.columns, system.form_errors
        places = np.array(
            [weighing.by_place(system.reduced(f), data[f].g[:n], data[f].departures) for f in sizes]
        )
        return cls(evidence, data, places, np.array([data[f].none for f in sizes]))

    def effects(self) -> Array:
        """Return log Bayes factors of effects, the error of form integrated out, shape (effect, draw)."""
        joint = logsumexp(self.none[:, None] + self.places, axis=0) - logsumexp(self.none, axis=0)
        return self.evidence.weighing.by_effect(joint)

    def statistics(self) -> Array:
        """Return log Bayes factors of a gap, shape (draw,)."""
        effects = self.effects()
        return logsumexp(effects, axis=0) - np.log(len(effects))

    def draw(self, k: int) -> Evidence:
        """Return one draw as if it were the data."""
        system = self.evidence.system
        reduced = {}
        for i, f in enumerate(system.form_errors):
            r = system.reduced(f)
            one = self.data[f]
            known = r.posterior._replace(mean=one.departures[:, k])
            reduced[f] = Reduced(r.G, one.g[: system.columns, k], float(self.none[i, k]), known)
        return Evidence(
            Weighing(replace(system, _kept=Kept(reduced=reduced))), self.none[:, k], self.places[:, :, k]
        )

    def without(self, effect: str) -> Weighed:
        """Return the same data weighed by a library that lacks an effect."""
        system = self.evidence.system
        left = [i for i, c in enumerate(system.candidates) if c.effect != effect]
        at = system.places(left)
        data = {f: one._replace(g=one.g[at]) for f, one in self.data.items()}
        return Weighed(only_candidates(self.evidence, left), data, self.places[:, left], self.none)


def only_candidates(evidence: Evidence, left: Sequence[int]) -> Evidence:
    """Return the evidence of some candidates, as if there were no others."""
    system = evidence.system
    at = system.places(left)
    reduced = {}
    for f in system.form_errors:
        r = system.reduced(f)
        known = r.posterior._replace(slopes=r.posterior.slopes[:, at])
        reduced[f] = Reduced(r.G[np.ix_(at, at)], r.g[at], r.log_evidence, known)
    here = replace(system.of(left), _kept=Kept(reduced=reduced))
    return Evidence(Weighing(here), evidence.none, evidence.places[:, left])


def answers(weighed: Weighed, truth: str, insertion: Sequence[int], threshold: float) -> list[Answer]:
    """Return what is answered to draws.

    Parameters
    ----------
    weighed : Weighed
    truth : str
    insertion : sequence of int
        Of each draw.
    threshold : float
        Of the statistic, from which a gap is called.
    """
    called = weighed.statistics() >= threshold
    found = []
    for k, (exists, which) in enumerate(zip(called.tolist(), insertion, strict=True)):
        if not exists:
            found.append(Answer(truth, which))
            continue
        evidence = weighed.draw(k)
        p_none = probability_of_none(evidence)
        found.append(_answer(rank(evidence, exists, INTERVAL, TEMPERATURE, p_none), truth, which))
    return found


def _answer(ranking: Ranking, truth: str, insertion: int) -> Answer:
    p = ranking.probabilities
    share = sum(p[n] for n in ranking.alike)
    return Answer(
        truth,
        insertion,
        called=True,
        named=ranking.alike if ranking.alike and share >= NAMED else (),
        probability=share,
        leading=truth in ranking.alike,
        truth_probability=p.get(truth, 0.0),
        covered=truth in ranking.credible or truth in ranking.alike,
        other=p.get(OTHER, 0.0) > max((p[n] for n in p if n not in (NONE, OTHER)), default=0.0),
    )

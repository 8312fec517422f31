"""Errors of form of all rows together: which of them the data leave possible.

A simulation may be good in lift and poor in drag, so each row has a size of its own. But a simulation whose
other rows are exact is not likely to be poor in one: the rows' sizes lie about one that they share, which is
unknown too (A. Gelman and others, Bayesian Data Analysis, 3rd ed., chapter 5). Loads share one, actuators
another, and relations between sensors, which need no simulation, a third.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from freqid.core.arrays import Array
from freqid.gap.infer.system import Form, Reduced, System
from freqid.gap.infer.weighing import Weighing
from freqid.gap.settings import ACTUATOR_FORM, FORM_ERRORS, FORM_LIKENESS, SEPARATE

Index = tuple[int, ...]

_KINDS = ("", "actuator/", "kinematic/")
_LEAST = tuple(FORM_ERRORS.index(f) for f in (0.0, ACTUATOR_FORM, 0.0))  # by kind
_UNLIKELY = 0.01  # probability of an error of form, with an effect or without, below which it is left out
_STEPS = (8, 4, 2, 1, -1, -2, -4, -8)  # by which a row is moved: in between the evidence may be lower
_HOPELESS = 30.0  # nats below the best, from which larger ones are no better


def likely_forms(system: System, rows: Sequence[str]) -> tuple[Form, ...]:
    """Return the errors of form that the data leave possible, with an effect or without.

    From one size for all rows, the best one, row after row up and down as long as the evidence rises.

    Parameters
    ----------
    system : System
        Its own errors of form do not matter.
    rows : sequence of str
        That have a form.
    """
    search = _search(system, rows)
    for with_effect in (True, False):
        search.climb(with_effect)
    return tuple(dict.fromkeys([*search.likely(), *search.behind_an_effect()]))


def forms_beside(system: System, rows: Sequence[str], free: Array) -> tuple[Form, ...]:
    """Return the system's errors of form, with those that are possible once effects are allowed for.

    What one effect leaves unexplained looks like an error of form in every row where the second one acts. So
    with any second effect, row after row is made better as long as the evidence rises.

    Parameters
    ----------
    system : System
    rows : sequence of str
        That have a form.
    free : ndarray, shape (freed, column)
        Weights of columns that are there in any case, in unknown sizes: effects that were found already.
    """
    kinds = np.array([_kind(name) for name in rows], dtype=int)
    search = _Search(system, Weighing(system), kinds, free)
    for form in system.form_errors:
        search.ask(tuple(FORM_ERRORS.index(f) for f in np.atleast_1d(form.loads).tolist()))
    search.climb(True, [step for step in _STEPS if step < 0])
    return tuple(dict.fromkeys([*system.form_errors, *search.likely()]))


def common_form(system: System, rows: Sequence[str]) -> Form:
    """Return the likeliest error of form where all rows of a kind have the same size."""
    search = _search(system, rows)
    return search.form(search.best(True))


def _search(system: System, rows: Sequence[str]) -> _Search:
    kinds = np.array([_kind(name) for name in rows], dtype=int)
    search = _Search(system, Weighing(system), kinds)
    for kind in range(len(_KINDS)):
        search.raise_together(kind)
    return search


@dataclass(eq=False)
class _Search:
    """Sizes by row, as places in `FORM_ERRORS`, and what the data say of those that were asked about."""

    system: System
    weighing: Weighing
    kinds: NDArray[np.intp]
    free: Array | None = None
    known: dict[Index, tuple[float, float]] = field(default_factory=dict)

    def best(self, with_effect: bool) -> Index:
        """Return the likeliest sizes so far."""
        return max(self.known, key=lambda index: self.known[index][with_effect])

    def ask(self, index: Index) -> tuple[float, float]:
        """Return the log evidence of sizes without effect, and with none or any."""
        if index not in self.known:
            self.known[index] = self._weighed(self.form(index))
        return self.known[index]

    def form(self, index: Index) -> Form:
        """Return an error of form, with its prior."""
        places = np.array(index, dtype=int)
        prior = sum(_log_prior(places[self.kinds == kind]) for kind in range(len(_KINDS)))
        return Form(tuple(FORM_ERRORS[i] for i in index), 0.0, prior)

    def raise_together(self, kind: int) -> None:
        """Ask about one size for all rows of a kind, larger and larger."""
        start = self.best(True) if self.known else tuple(_LEAST[k] for k in self.kinds)
        top = [-np.inf, -np.inf]
        for size in range(_LEAST[kind], len(FORM_ERRORS)):
            index = tuple(size if k == kind else i for i, k in zip(start, self.kinds.tolist(), strict=True))
            found = self.ask(index)
            top = [max(a, b) for a, b in zip(top, found, strict=True)]
            if all(b < a - _HOPELESS for a, b in zip(top, found, strict=True)):
                break

    def climb(self, with_effect: bool, steps: Sequence[int] = _STEPS) -> None:
        """Move row after row, in longer steps too, as long as the evidence rises."""
        at = self.best(with_effect)
        value, moved = self.ask(at)[with_effect], True
        while moved:
            moved = False
            for row, step in product(range(len(at)), steps):
                if _LEAST[self.kinds[row]] <= at[row] + step < len(FORM_ERRORS):
                    near = (*at[:row], at[row] + step, *at[row + 1 :])
                    found = self.ask(near)[with_effect]
                    if found > value:
                        at, value, moved = near, found, True

    def likely(self) -> tuple[Form, ...]:
        """Return what the data leave possible of all that was asked about."""
        log = np.array(list(self.known.values()))
        keep = np.any(log > logsumexp(log, axis=0) + np.log(_UNLIKELY), axis=1)
        return tuple(self.form(index) for index, k in zip(self.known, keep, strict=True) if k)

    def behind_an_effect(self) -> list[Form]:
        """Return, where an effect is likely, each row in turn as good as the best of its kind.

        A second effect may hide there: alone, either of two leaves the other one to the form.
        """
        at = self.best(True)
        none, every = self.ask(at)
        if every - none < SEPARATE:
            return []
        best = [min(i for i, k in zip(at, self.kinds, strict=True) if k == kind) for kind in self.kinds]
        return [
            self.form((*at[:row], best[row], *at[row + 1 :])) for row in range(len(at)) if at[row] > best[row]
        ]

    def _beside(self, form: Form, free: Array) -> Reduced:
        system = self.system
        known = form in system.form_errors
        return (system.reduced(form) if known else system.reduced_once(form)).freed(free)

    def _weighed(self, form: Form) -> tuple[float, float]:
        weighing = self.weighing
        own = weighing.at(form) if self.free is None else self._beside(form, self.free)
        none = own.log_evidence
        if not self.system.candidates:
            return none, none
        effects = weighing.by_effect(weighing.by_place(own, own.g[:, None])[:, 0])
        return none, none + float(np.logaddexp(0.0, logsumexp(effects) - np.log(len(effects))))


def _kind(row: str) -> int:
    """Return which of `_KINDS` a row is of: loads, an actuator, a relation between sensors."""
    return next((k for k, stem in enumerate(_KINDS) if stem and row.startswith(stem)), 0)


def _log_prior(index: NDArray[np.intp]) -> float:
    """Return how likely sizes of some rows are together before the data."""
    count = len(FORM_ERRORS)
    steps = np.abs(np.arange(count)[:, None] - np.arange(count)) * np.log(FORM_LIKENESS)
    steps = steps - logsumexp(steps, axis=0)  # of a row's size given the shared one, shape (size, shared)
    return float(logsumexp(steps[index].sum(axis=0)) - np.log(count))

"""Errors of form of all rows together: which of them the data leave possible.

A simulation may be good in lift and poor in drag, so each row has a size of its own. But a simulation whose
other rows are exact is not likely to be poor in one: the rows' sizes lie about one that they share, which is
unknown too (A. Gelman and others, Bayesian Data Analysis, 3rd ed., chapter 5). Relations between sensors
share another one: they need no simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from freqid.gap.infer.evidence import Weighing
from freqid.gap.infer.system import Form, System
from freqid.gap.settings import ACTUATOR_FORM_ERRORS, FORM_ERRORS, FORM_LIKENESS

Array = NDArray[np.float64]
Index = tuple[int, ...]

_UNLIKELY = 0.01  # probability of an error of form, with an effect or without, below which it is left out
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
    search = _Search(
        system, Weighing(system), np.array([n.startswith("kinematic/") for n in rows], dtype=bool)
    )
    for sensors in (False, True):
        search.raise_together(sensors)
    search.choose_actuators()
    for with_effect in (True, False):
        search.climb(with_effect)
    return search.likely()


@dataclass(eq=False)
class _Search:
    """Sizes by row, as places in `FORM_ERRORS`, and what the data say of those that were asked about."""

    system: System
    weighing: Weighing
    sensors: NDArray[np.bool_]
    actuators: tuple[float, ...] = (0.0,)
    known: dict[tuple[Index, float], tuple[float, float]] = field(default_factory=dict)

    def best(self, with_effect: bool) -> Index:
        """Return the likeliest sizes so far."""
        return max(self.known, key=lambda one: self.known[one][with_effect])[0]

    def ask(self, index: Index) -> tuple[float, float]:
        """Return the log evidence of sizes without effect, and with none or any, the actuators' summed."""
        for actuators in self.actuators:
            if (index, actuators) not in self.known:
                self.known[index, actuators] = self._weighed(self.form(index, actuators))
        each = np.array([self.known[index, a] for a in self.actuators])
        none, every = logsumexp(each, axis=0)
        return float(none), float(every)

    def form(self, index: Index, actuators: float) -> Form:
        """Return an error of form, with its prior."""
        parts = (_log_prior([i for i, s in zip(index, self.sensors, strict=True) if s == k]) for k in (0, 1))
        return Form(tuple(FORM_ERRORS[i] for i in index), actuators, sum(parts))

    def raise_together(self, sensors: bool) -> None:
        """Ask about one size for all rows of a kind, larger and larger."""
        start = self.best(True) if self.known else (0,) * len(self.sensors)
        top = [-np.inf, -np.inf]
        for size in range(len(FORM_ERRORS)):
            index = tuple(size if s == sensors else i for i, s in zip(start, self.sensors, strict=True))
            found = self.ask(index)
            top = [max(a, b) for a, b in zip(top, found, strict=True)]
            if all(b < a - _HOPELESS for a, b in zip(top, found, strict=True)):
                break

    def choose_actuators(self) -> None:
        """Keep the sizes of the actuators' errors that are not far from the best where all else is best."""
        index, self.actuators = self.best(True), ACTUATOR_FORM_ERRORS
        self.ask(index)
        each = np.array([self.known[index, a] for a in self.actuators])
        near = np.any(each > each.max(axis=0) + np.log(_UNLIKELY), axis=1)
        self.actuators = tuple(a for a, keep in zip(ACTUATOR_FORM_ERRORS, near, strict=True) if keep)

    def climb(self, with_effect: bool) -> None:
        """Move row after row up and down as long as the evidence rises."""
        at = self.best(with_effect)
        value, moved = self.ask(at)[with_effect], True
        while moved:
            moved = False
            for row in range(len(at)):
                for step in (1, -1):
                    while 0 <= at[row] + step < len(FORM_ERRORS):
                        near = (*at[:row], at[row] + step, *at[row + 1 :])
                        found = self.ask(near)[with_effect]
                        if found <= value:
                            break
                        at, value, moved = near, found, True

    def likely(self) -> tuple[Form, ...]:
        """Return what the data leave possible of all that was asked about."""
        log = np.array([v for (_, a), v in self.known.items() if a in self.actuators])
        keep = np.any(log > logsumexp(log, axis=0) + np.log(_UNLIKELY), axis=1)
        asked = [one for one in self.known if one[1] in self.actuators]
        return tuple(self.form(*one) for one, k in zip(asked, keep, strict=True) if k)

    def _weighed(self, form: Form) -> tuple[float, float]:
        reduced, weighing = self.system.reduced(form), self.weighing
        none = reduced.log_evidence
        if not self.system.candidates:
            return none, none
        effects = weighing.by_effect(weighing.by_place(reduced, reduced.g[:, None])[:, 0])
        return none, none + float(np.logaddexp(0.0, logsumexp(effects) - np.log(len(effects))))


def _log_prior(index: Sequence[int]) -> float:
    """Return how likely sizes of some rows are together before the data."""
    count = len(FORM_ERRORS)
    steps = np.abs(np.arange(count)[:, None] - np.arange(count)) * np.log(FORM_LIKENESS)
    steps = steps - logsumexp(steps, axis=0)  # of a row's size given the shared one, shape (size, shared)
    return float(logsumexp(steps[list(index)].sum(axis=0)) - np.log(count))

"""Sizes of the errors of form: which of them the data leave likely.

A simulation may be good in lift and poor in drag, and of one load most derivatives may be right and one be
missing. So every term has a size of its own. It lies about one that its row shares, and this about one of
the row's kind: loads, actuators, or relations between sensors, which need no simulation (A. Gelman and
others, Bayesian Data Analysis, 3rd ed., chapter 5). Were the size of all terms of a row the same, the few
that are wrong would be too large for it, and an effect would be the better explanation of them.

The sizes that are likeliest are taken, once without an effect and once beside each of the likeliest ones
(type-II maximum likelihood: M. E. Tipping, "Sparse Bayesian learning and the relevance vector machine",
Journal of Machine Learning Research 1, 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.gap.infer.at_form import Kept
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.evidence import directions, weigh
from freqid.gap.infer.system import System
from freqid.gap.model.form import row_of
from freqid.gap.settings import (
    ACTUATOR_FORM,
    FORM_ALIKE,
    FORM_ERRORS,
    FORM_KIND_SPREAD,
    FORM_SPREAD,
    FORM_TYPICAL,
    SEPARATE,
)

_KINDS = ("", "actuator/", "kinematic/")
_LEAST = (FORM_TYPICAL, ACTUATOR_FORM, FORM_ERRORS[1])  # from which sizes of a kind are looked for
_SMALLEST = (FORM_TYPICAL, ACTUATOR_FORM, 1e-5)  # of a kind: below a hundred-thousandth is nothing
_REACH = 50.0  # by which a term may be worse than what is common to its kind
_HOPELESS = 30.0  # nats below the best, from which larger ones are no better
_STEPS = 50  # of the search at most
_FARTHEST = 2.0  # e-foldings of a size in one step
_SHORTER = (1.0, 0.5, 0.25, 0.1, 0.03)  # shares of a step that are tried until one leads uphill
_NEAR = 0.1  # nats that a step gains, below which the search ends


def common_form(system: System, terms: Sequence[str]) -> Form:
    """Return the likeliest error of form where all terms of a kind have one size, with an effect or none.

    Parameters
    ----------
    system : System
        Its own errors of form do not matter.
    terms : sequence of str
        That have a form.
    """
    kinds = np.array([_kind(name) for name in terms], dtype=int)
    at = np.array([FORM_TYPICAL, ACTUATOR_FORM, FORM_ERRORS[0]])
    for kind in range(len(_KINDS)):
        found: list[tuple[float, float]] = []
        for size in (f for f in FORM_ERRORS if f >= at[kind]):
            tried = at.copy()
            tried[kind] = size
            loads = tuple(tried[kinds].tolist())
            found.append((_with_any(system, [Form(loads, alike) for alike in _alike(system)]), size))
            if found[-1][0] < max(found)[0] - _HOPELESS:
                break
        at[kind] = max(found)[1]
    return Form(tuple(at[kinds].tolist()), 0.0)


def of_all(terms: Sequence[str], first: Sequence[str], common: Form) -> Array:
    """Return the size of each term's error of form where it is the common one of its kind, shape (term,).

    Parameters
    ----------
    terms : sequence of str
    first : sequence of str
        Terms of first order.
    common : Form
        Of these.
    """
    at = {_kind(n): max(f, _LEAST[_kind(n)]) for n, f in zip(first, np.atleast_1d(common.loads), strict=True)}
    return np.array([at[_kind(name)] for name in terms])


def reach(sizes: Array) -> Array:
    """Return the largest errors of form that terms may have, whose common one is known."""
    return np.minimum(_REACH * sizes, FORM_ERRORS[-1])


def likely_forms(system: System, terms: Sequence[str], start: Array) -> tuple[Form, ...]:
    """Return the likeliest errors of form, without an effect and beside each of the likeliest ones.

    All of these twice: drawn anew in each condition, and with errors that are the same everywhere beside.

    Parameters
    ----------
    system : System
        Its own errors of form do not matter.
    terms : sequence of str
        That have a form.
    start : ndarray, shape (term,)
        Sizes from which the search begins, those that are common to a kind.
    """
    sizes = _Sizes(system, tuple(terms), reach(start))
    none = np.zeros((0, system.columns))
    found = []
    for alike in _alike(system):
        first = sizes.likeliest(start, none, alike)
        # sizes of terms may have taken the place of an effect that is likely where all have one size
        likely = _likely_effects(system, Form(tuple(start.tolist()), alike)) | _likely_effects(system, first)
        beside = [sizes.likeliest(np.array(first.loads), d, alike) for d in likely.values()]
        found += [first, *beside]
    return tuple(dict.fromkeys(found))


def forms_beside(system: System, terms: Sequence[str], explanations: Sequence[Array]) -> tuple[Form, ...]:
    """Return the system's errors of form, with those that are likeliest beside some explanations.

    What one effect leaves unexplained looks like an error of form in every row where the second one acts. So
    no size may be larger than the largest that the system has.

    Parameters
    ----------
    system : System
    terms : sequence of str
        That have a form.
    explanations : sequence of ndarray, shape (direction, column)
        Weights of candidates' columns, one sigma of what is in the data.
    """
    largest = np.max([f.loads for f in system.form_errors], axis=0)
    sizes = _Sizes(system, tuple(terms), largest)
    beside = [sizes.likeliest(largest, one, alike) for alike in _alike(system) for one in explanations]
    return tuple(dict.fromkeys([*system.form_errors, *beside]))


def _alike(system: System) -> tuple[float, ...]:
    """Return the sizes of errors of form that are the same everywhere, at even odds."""
    return (0.0, FORM_ALIKE) if len(system.blocks[0].shared_row) else (0.0,)


def _with_any(system: System, forms: Sequence[Form]) -> float:
    """Return the log evidence of errors of form with no effect or any."""
    evidence = weigh(replace(system, form_errors=tuple(forms), _kept=Kept()), once=True)
    return evidence.log_none + float(np.logaddexp(0.0, evidence.statistic))


def _likely_effects(system: System, form: Form) -> dict[int, Array]:
    """Return directions of the likeliest effects at an error of form, each at its best place, by candidate.

    Of shape (direction, column).
    """
    evidence = weigh(replace(system, form_errors=(form,)))
    least = max(max(evidence.effect.values(), default=0.0) - SEPARATE, 0.0)
    places = [evidence.best_place(effect) for effect, nats in evidence.effect.items() if nats > least]
    return {i: directions(evidence, i) for i in places}


@dataclass(frozen=True, eq=False)
class _Sizes:
    """The search for the likeliest sizes, in their logarithms.

    Attributes
    ----------
    system : System
    terms : tuple of str
    largest : ndarray, shape (term,)
    """

    system: System
    terms: tuple[str, ...]
    largest: Array

    @cached_property
    def kinds(self) -> NDArray[np.intp]:
        """Place of each term's kind."""
        return np.array([_kind(name) for name in self.terms], dtype=int)

    @cached_property
    def smallest(self) -> Array:
        """Sizes that they have at least, shape (term,)."""
        return np.array(_SMALLEST)[self.kinds]

    @cached_property
    def precision(self) -> Array:
        """Inverse of the prior covariance of the logarithms, shape (term, term)."""
        rows = np.array([row_of(name) for name in self.terms])
        same_row, same_kind = rows[:, None] == rows, self.kinds[:, None] == self.kinds
        own = np.eye(len(rows))
        return np.linalg.inv(FORM_SPREAD**2 * (own + same_row) + FORM_KIND_SPREAD**2 * same_kind)

    def likeliest(self, start: Array, beside: Array, alike: float) -> Form:
        """Return the likeliest sizes beside directions of candidates' columns, shape (direction, column).

        And beside errors of a size that are the same everywhere. Its prior is that of all sizes near these,
        by Laplace's method.
        """
        mean, system = np.log(FORM_TYPICAL), self.system.beside(beside)
        low, high = np.log(self.smallest), np.log(self.largest)

        def at(x: Array) -> tuple[float, Array, Array]:
            log, slope, information = system.slope(Form(tuple(np.exp(x).tolist()), alike))
            pull = self.precision @ (x - mean)
            return log - 0.5 * float((x - mean) @ pull), slope - pull, information

        found = np.clip(np.log(start), low, high)
        value, slope, information = at(found)
        for _ in range(_STEPS):
            inside = ~(((found <= low) & (slope < 0)) | ((found >= high) & (slope > 0)))
            curve = self.precision[np.ix_(inside, inside)] + np.diag(information[inside])
            step = np.zeros(len(found))
            step[inside] = np.clip(np.linalg.solve(curve, slope[inside]), -_FARTHEST, _FARTHEST)
            for share in _SHORTER:
                moved = np.clip(found + share * step, low, high)
                there = at(moved)
                if there[0] > value:
                    break
            else:
                break
            gained = there[0] - value
            found, (value, slope, information) = moved, there
            if gained < _NEAR:
                break
        form = Form(tuple(np.exp(found).tolist()), alike)
        prior = -0.5 * float((found - mean) @ self.precision @ (found - mean))
        known = np.linalg.slogdet(self.precision + np.diag(information))[1]
        return form._replace(log_prior=prior + 0.5 * float(np.linalg.slogdet(self.precision)[1] - known))


def _kind(term: str) -> int:
    """Return which of `_KINDS` a term is of: loads, an actuator, a relation between sensors."""
    return next((k for k, stem in enumerate(_KINDS) if stem and term.startswith(stem)), 0)

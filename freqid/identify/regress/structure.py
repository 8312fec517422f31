"""Which terms belong in a model: stepwise regression with partial F and predicted squared error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtrc

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError
from freqid.identify.regress.equations import checked_channels, real_equations, refuse_zero
from freqid.identify.regress.regression import LeastSquares, least_squares

DEPENDENT = 1e-12
"""Share of a candidate's square below which what the model leaves of it is rounding, not information."""


@dataclass(frozen=True)
class Step:
    """One change of a model's structure and the model after it.

    Parameters
    ----------
    action : str
        "add" or "drop".
    name : str
        The term.
    partial_f : float
        What the term explains beyond the others, over the residual variance of the model with it.
    r2, pse, fit_error : float
        Coefficient of determination, predicted squared error and residual standard deviation (unit of
        the response) per real equation, defined as in `LeastSquares`.
    """

    action: str
    name: str
    partial_f: float
    r2: float
    pse: float
    fit_error: float


@dataclass(frozen=True)
class Structure:
    """The terms that stepwise regression chose, how, and the fit on them.

    Parameters
    ----------
    terms : tuple of str
        Chosen candidates, in the order in which they entered.
    steps : tuple of Step
        What was done, in order.
    fit : LeastSquares or None
        The response on the chosen terms; None where no candidate was worth choosing.
    partial_f : mapping of str to float
        F of every candidate in the end: of a chosen term, what the others cannot explain; of another, what
        it would add, zero where the chosen terms already contain it.
    """

    terms: tuple[str, ...]
    steps: tuple[Step, ...]
    fit: LeastSquares | None
    partial_f: Mapping[str, float]


@dataclass(frozen=True)
class Candidates:
    """A response and the candidates for its model, as real equations less the nuisance columns.

    Parameters
    ----------
    names : tuple of str, length p
        The candidates.
    columns : ndarray, shape (p, E)
        What the nuisance columns leave of each candidate.
    length : ndarray, shape (p,)
        Length of each candidate before they were taken out.
    response : ndarray, shape (E,)
        What they leave of the response.
    total_square : float
        Square of it that terms could explain, about the mean where the data are real samples.
    n_nuisance : int
        Unknowns of every model besides its terms.
    independent : float
        Independent equations: E, or fewer where lines are closer than 1/T.
    """

    names: tuple[str, ...]
    columns: Array
    length: Array
    response: Array
    total_square: float
    n_nuisance: int
    independent: float

    def remaining(self, chosen: Sequence[int]) -> tuple[Array, Array, Array]:
        """Return what chosen terms leave: candidates (p, E), response (E,), and each candidate's gain (p,).

        The gain is the square of the response that a candidate would explain next, zero where the
        chosen terms already contain it.
        """
        basis = np.linalg.qr(self.columns[list(chosen)].T)[0]
        columns = self.columns - self.columns @ basis @ basis.T
        columns -= columns @ basis @ basis.T  # twice is enough against rounding
        response = self.response - basis @ (basis.T @ self.response)
        square = np.einsum("pe,pe->p", columns, columns)
        new = square > DEPENDENT * self.length**2
        new[list(chosen)] = False
        gain = np.zeros(len(square))
        gain[new] = (columns[new] @ response) ** 2 / square[new]
        return columns, response, gain

    def residual_square(self, chosen: Sequence[int]) -> float:
        """Square of the response that chosen terms leave."""
        basis = np.linalg.qr(self.columns[list(chosen)].T)[0]
        residual = self.response - basis @ (basis.T @ self.response)
        return float(residual @ residual)

    def freedom(self, n_terms: int) -> float:
        """Degrees of freedom that a model leaves."""
        return self.independent - self.n_nuisance - n_terms

    def partial_f(self, gain: float, residual_square: float, n_terms: int) -> float:
        """F ratio of a term with this gain in a model of `n_terms` terms with this residual."""
        return gain * self.freedom(n_terms) / residual_square if residual_square > 0 else np.inf

    def step(self, action: str, name: str, partial_f: float, residual_square: float, n_terms: int) -> Step:
        """Describe a step by the model after it."""
        equations = len(self.response)
        r2 = 1.0 - residual_square / self.total_square
        pse = self.pse(residual_square, n_terms)
        error = np.sqrt(residual_square / (equations - self.n_nuisance - n_terms))
        return Step(action, name, float(partial_f), float(r2), float(pse), float(error))

    def pse(self, residual_square: float, n_terms: int) -> float:
        """Predicted squared error of one real equation."""
        penalty = self.total_square * (self.n_nuisance + n_terms) / self.independent
        return (residual_square + penalty) / len(self.response)


def prepare_candidates(
    candidates: ArrayLike,
    response: ArrayLike,
    names: Sequence[str] | None,
    nuisance: ArrayLike | None,
    independent_share: float,
) -> Candidates:
    """Check candidates and response, and take the nuisance columns out of both.

    Parameters
    ----------
    candidates, response, names, nuisance, independent_share
        As in `stepwise`.

    Returns
    -------
    Candidates
        The problem that `stepwise` and `orthogonal_functions` solve.

    Raises
    ------
    DataError, UsageError
        As in `stepwise`.
    """
    phi, names = checked_channels(candidates, names, "candidate")
    z, _ = checked_channels(np.atleast_2d(np.asarray(response)), None, "response")
    extra, extra_names = checked_channels(
        np.empty((0, phi.shape[1])) if nuisance is None else nuisance, None, "nuisance column"
    )
    if len(z) != 1:
        raise UsageError(f"a structure is chosen for one response at a time, found {len(z)}")
    columns, target, extra = real_equations(phi, z, extra)
    length = refuse_zero(columns, names)
    refuse_zero(extra, extra_names)
    basis = np.linalg.qr(extra.T)[0]
    columns = columns - columns @ basis @ basis.T
    target = target[0] - basis @ (basis.T @ target[0])
    equations = len(target)
    total_square = target @ target
    if equations == z.shape[1]:
        total_square -= target.sum() ** 2 / equations
    independent = independent_share * equations
    if independent - len(extra) < 2 or total_square <= 0:
        raise DataError(
            f"{independent:.3g} independent equations with {len(extra)} nuisance columns leave nothing to "
            "choose terms by",
            remedy="use more lines, a longer record, or a response that moves",
        )
    return Candidates(names, columns, length, target, float(total_square), len(extra), independent)


def stepwise(
    candidates: ArrayLike,
    response: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    nuisance: ArrayLike | None = None,
    f_enter: float = 20.0,
    f_leave: float | None = None,
    start: Literal["nothing", "everything"] = "nothing",
    independent_share: float = 1.0,
) -> Structure:
    """Choose the terms of one response's model by stepwise regression, forward and backward.

    Parameters
    ----------
    candidates : array_like, shape (p, M), complex or real
        Candidate regressors on M lines or samples.
    response : array_like, shape (M,) or (1, M), complex or real
        The response.
    names : sequence of str, optional
        Names of the candidates.
    nuisance : array_like, shape (q, M), optional
        Columns that every model has: a constant, end terms.
    f_enter, f_leave : float
        A term enters where its partial F is at least `f_enter` and leaves where it falls below
        `f_leave` (default: the same).
    start : {"nothing", "everything"}
        Model to start from. Where each candidate alone explains little, as one of many effectors, all are
        insignificant beside what the others would explain: start from everything.
    independent_share : float
        Independent equations per equation: min(1, T df) for lines df apart.

    Returns
    -------
    Structure
        Chosen terms, history, and the fit.

    Raises
    ------
    DataError
        A channel is not finite, or zero throughout, or too few equations.
    UsageError
        Shapes, names or thresholds do not agree.

    Notes
    -----
    Each turn adds the candidate that explains most of the residual, provided that it also lowers the
    predicted squared error, then drops the terms that the new one made needless. `f_enter` = 4 is the 5 %
    point for one candidate and white residuals; 20 allows for the choice among many, and for coloured
    residuals.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 5 (model structure determination);
    Draper & Smith, *Applied Regression Analysis*, Wiley.
    """
    f_leave = f_enter if f_leave is None else f_leave
    if f_leave > f_enter:
        raise UsageError(f"f_leave {f_leave} above f_enter {f_enter} would add and drop a term for ever")
    problem = prepare_candidates(candidates, response, names, nuisance, independent_share)
    chosen: list[int] = []
    steps: list[Step] = []
    if start == "everything":
        chosen = _independent(problem)
        steps = drop_needless(problem, chosen, f_leave)
    while problem.freedom(len(chosen) + 1) >= 1:
        _, residual, gain = problem.remaining(chosen)
        before = float(residual @ residual)
        best = int(np.argmax(gain))
        after = max(before - gain[best], 0.0)
        f = problem.partial_f(gain[best], after, len(chosen) + 1)
        better = problem.pse(after, len(chosen) + 1) < problem.pse(before, len(chosen))
        if f < f_enter or not better:
            break
        chosen.append(best)
        steps.append(problem.step("add", problem.names[best], f, after, len(chosen)))
        steps += drop_needless(problem, chosen, f_leave)
    final = dict(zip(problem.names, partial_f_of_all(problem, chosen).tolist(), strict=True))
    if not chosen:
        return Structure((), tuple(steps), None, final)
    terms = tuple(problem.names[i] for i in chosen)
    fit = least_squares(
        np.asarray(candidates)[chosen], np.atleast_2d(np.asarray(response)), names=terms, nuisance=nuisance
    )
    return Structure(terms, tuple(steps), fit, final)


def partial_f_of_all(problem: Candidates, chosen: Sequence[int]) -> Array:
    """Return the F of every candidate beside the chosen terms, shape (p,)."""
    _, residual, gain = problem.remaining(chosen)
    square = float(residual @ residual)
    f = np.array([problem.partial_f(g, max(square - g, 0.0), len(chosen) + 1) for g in gain])
    for j in chosen:
        without = problem.residual_square([i for i in chosen if i != j])
        f[j] = problem.partial_f(without - square, square, len(chosen))
    return f


def _independent(problem: Candidates) -> list[int]:
    """Return the candidates that those before them do not contain already."""
    chosen: list[int] = []
    for j, length in enumerate(problem.length):
        left = problem.remaining(chosen)[0][j]
        if left @ left > DEPENDENT * length**2:
            chosen.append(j)
    if problem.freedom(len(chosen)) < 1:
        raise DataError(
            f"{problem.independent:.3g} independent equations are too few to start from {len(chosen)} terms",
            remedy="use more lines, a longer record or fewer candidates",
        )
    return chosen


def drop_needless(problem: Candidates, chosen: list[int], f_leave: float) -> list[Step]:
    """Drop terms one by one from `chosen` until every partial F reaches `f_leave`."""
    steps = []
    while len(chosen) > 1:
        square = problem.residual_square(chosen)
        without = [problem.residual_square([i for i in chosen if i != j]) for j in chosen]
        gains = np.array(without) - square
        weakest = int(np.argmin(gains))
        f = problem.partial_f(gains[weakest], square, len(chosen))
        if f >= f_leave:
            break
        name = problem.names[chosen.pop(weakest)]
        steps.append(problem.step("drop", name, f, square + gains[weakest], len(chosen)))
    return steps


CHANCE = 5e-5
"""Chance by which a group that does nothing may enter; with 230 groups, that one of them does is 1 %."""
LEAST_FREEDOM = 20.0
"""Degrees of freedom that a group must leave, or its F tells nothing."""


def enter_families(
    problem: Candidates, families: Sequence[Sequence[int]], f_leave: float, enough: float = 0.0
) -> list[int]:
    """Choose among candidates that enter one by one or by families.

    Parameters
    ----------
    problem : Candidates
    families : sequence of sequence of int
        Candidates that are tried together, besides each alone; they may overlap.
    f_leave : float
        Partial F that a term must keep to stay.
    enough : float
        Residual square, unit of the response squared, at which nothing more is taken in.

    Returns
    -------
    list of int
        Chosen candidates, in the order in which they entered.

    Notes
    -----
    Each turn orthogonalises every group against the terms so far, and takes in the one whose F has the least
    chance; terms whose partial F falls below `f_leave` are then dropped one by one. A group is taken in once.
    An effect in which n candidates share alike raises the partial F of each by a part only of what the
    residual without it would allow, whereas the F of the group sees all of it.

    References
    ----------
    Draper & Smith, *Applied Regression Analysis*, Wiley (extra sum of squares); Morelli, J. Aircraft 32(2),
    1995 (orthogonal functions).
    """
    waiting = [tuple(family) for family in families if len(family) > 1]
    waiting += [(j,) for j in range(len(problem.names))]
    chosen: list[int] = []
    while problem.residual_square(chosen) > enough:
        chances = [_chance(problem, chosen, group) for group in waiting]
        if not chances or min(chances) > CHANCE:
            break
        entered = waiting.pop(int(np.argmin(chances)))
        chosen += [j for j in entered if j not in chosen]
        drop_needless(problem, chosen, f_leave)
    return chosen


def _chance(problem: Candidates, chosen: Sequence[int], group: Sequence[int]) -> float:
    """Return the chance that a group which does nothing explains as much of what chosen terms leave."""
    together = [*chosen, *(j for j in group if j not in chosen)]
    added, freedom = len(together) - len(chosen), problem.freedom(len(together))
    if added == 0 or freedom < LEAST_FREEDOM:
        return 1.0
    before, after = (problem.residual_square(terms) for terms in (chosen, together))
    f = (before - after) / added / (after / freedom) if after > 0 else np.inf
    return float(fdtrc(added, freedom, max(f, 0.0)))

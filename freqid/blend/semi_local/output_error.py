"""A manoeuvre as output error sees it: the likelihood of its motion as a function of its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from freqid.blend.semi_local.problem import Expansion, LocalProblem
from freqid.core.arrays import Array
from freqid.core.channels import COEFFICIENT
from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.sections.identification import Identification
from freqid.identify.advance_ratio.local import about_zero
from freqid.identify.loads.explanatory import history
from freqid.identify.output_error.estimate import Settings, estimate
from freqid.identify.output_error.minimise import Point
from freqid.identify.output_error.parameters import Choices, choose_parameters
from freqid.identify.output_error.point_model import ready_model
from freqid.identify.output_error.signals import signals_of
from freqid.identify.output_error.time_domain import TimeDomain

_SYMBOLS = {response: symbol for symbol, response in COEFFICIENT.items()}
_STEPS, _HALVINGS, _CLOSE = 8, 12, 1e-3  # of initial conditions and sensor biases at given derivatives


class OutputErrorManeuver:
    """The likelihood of one manoeuvre's motion, with its initial conditions and sensor biases eliminated.

    Parameters
    ----------
    maneuver : Maneuver
    settings : Identification
        In coefficient form and body axes; its responses choose the ready form of the model.

    Raises
    ------
    DataError
        Where output error does not converge, or the manoeuvre does not tell all derivatives.

    Notes
    -----
    The information is divided by how much larger coloured residuals make the variances, in the median over
    the derivatives: likelihoods of manoeuvres are then as sharp as their standard errors say.
    """

    def __init__(self, maneuver: Maneuver, settings: Identification) -> None:
        model = ready_model((maneuver,), settings)
        signals = [signals_of(maneuver, model)]
        found = estimate(model, signals, Choices(), Settings())
        if not found.converged or found.not_excited:
            why = " ".join(found.remarks[:1]) or "output error did not converge"
            raise DataError(f"its motion makes no likelihood of all derivatives: {why}")
        parameters = choose_parameters(model, signals, found.values(), Choices())
        self._likelihood = TimeDomain(model, signals, parameters, "diagonal")
        names, oe, blocks = [], [], []
        for response in settings.responses:
            regressors = settings.regressors_of(response)
            trim = np.array([_trim(maneuver, name) for name in regressors])
            names += [f"{_SYMBOLS[response]}.{x}" for x in ("0", *regressors)]
            oe += [f"{response}_{x}" for x in ("bias", *regressors)]
            blocks.append(np.linalg.inv(about_zero(regressors, trim)))
        self._names = tuple(names)
        free = list(parameters.free_names)
        self._own = np.array([free.index(name) for name in oe])
        self._rest = np.array([k for k in range(len(free)) if k not in set(self._own.tolist())], dtype=int)
        self._turn = np.asarray(_diagonal(blocks) / parameters.scale[self._own, None], dtype=np.float64)
        self._free = np.array(parameters.start)
        place = [found.names.index(name) for name in oe]
        self._wider = float(np.median((found.std_error[place] / found.cramer_rao[place]) ** 2))
        best = np.linalg.solve(self._turn, self._free[self._own])
        self.estimate = np.asarray(best, dtype=np.float64)
        self._least = self._settled(self.estimate)[1].cost

    @property
    def names(self) -> tuple[str, ...]:
        """Derivatives that the manoeuvre tells."""
        return self._names

    def expand(self, theta: Array) -> Expansion:
        """Return the expansion about derivatives `theta`, shape (p,)."""
        _, point = self._settled(theta)
        own, rest = self._own, self._rest
        information, gradient = point.information[np.ix_(own, own)], point.gradient[own]
        if rest.size:
            mixed = point.information[np.ix_(own, rest)]
            solved = np.linalg.solve(
                point.information[np.ix_(rest, rest)],
                np.column_stack([mixed.T, point.gradient[rest]]),
            )
            information = information - mixed @ solved[:, :-1]
            gradient = gradient - mixed @ solved[:, -1]
        information = self._turn.T @ information @ self._turn
        gradient = self._turn.T @ gradient
        minimum = theta - np.linalg.solve(information, gradient)
        return Expansion(np.asarray(minimum, dtype=np.float64), information / self._wider)

    def misfit(self, theta: Array) -> float:
        """Return twice the log likelihood that `theta` loses against the manoeuvre's own best fit."""
        cost = self._settled(theta)[1].cost
        return 2 * (cost - self._least) / self._wider if np.isfinite(cost) else np.inf

    def _settled(self, theta: Array) -> tuple[Array, Point]:
        """Return all free numbers with initial conditions and biases at their best, and the likelihood."""
        free, rest = self._free.copy(), self._rest
        free[self._own] = self._turn @ theta
        point = self._likelihood.linearise(free)
        for _ in range(_STEPS if rest.size else 0):
            if not np.isfinite(point.cost):
                break
            step = -np.linalg.solve(point.information[np.ix_(rest, rest)], point.gradient[rest])
            if abs(float(step @ point.gradient[rest])) < _CLOSE**2:
                break
            trial = free
            for _ in range(_HALVINGS):
                trial = free.copy()
                trial[rest] += step
                if self._likelihood.cost(trial) <= point.cost:
                    break
                step = step / 2
            free = trial
            point = self._likelihood.linearise(free)
        return free, point


class JoinedManeuver:
    """Several likelihoods of one manoeuvre, of its longitudinal and its lateral motion.

    Parameters
    ----------
    parts : sequence of LocalProblem
        With different derivatives.
    """

    def __init__(self, parts: Sequence[LocalProblem]) -> None:
        self._parts = tuple(parts)
        self._names = tuple(name for part in parts for name in part.names)
        bounds = np.cumsum([0, *(len(part.names) for part in parts)])
        self._slices = [slice(a, b) for a, b in pairwise(bounds.tolist())]

    @property
    def names(self) -> tuple[str, ...]:
        """Derivatives of all parts."""
        return self._names

    def expand(self, theta: Array) -> Expansion:
        """Return the expansion about derivatives `theta`, shape (p,)."""
        each = [part.expand(theta[s]) for part, s in zip(self._parts, self._slices, strict=True)]
        return Expansion(np.concatenate([e.minimum for e in each]), _diagonal([e.information for e in each]))

    def misfit(self, theta: Array) -> float:
        """Return twice the log likelihood that `theta` loses, over all parts."""
        return sum(part.misfit(theta[s]) for part, s in zip(self._parts, self._slices, strict=True))


def _diagonal(blocks: Sequence[Array]) -> Array:
    """Return a block-diagonal matrix."""
    size = sum(len(b) for b in blocks)
    out, at = np.zeros((size, size)), 0
    for block in blocks:
        out[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return out


def _trim(maneuver: Maneuver, name: str) -> float:
    """Return what a regressor is expanded about: its mean; products are of their factors' departures."""
    return float(history(maneuver, name).mean()) if "*" not in name else 0.0

"""Which identified parameters cannot be trusted as numbers, and why."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from freqid.core.results.judged.truth import Miss
from freqid.core.results.point import ResponseModel

WIDE = 0.5
"""Half width of the confidence interval over the estimate from which a parameter is called uncertain."""
HIGH_INFLATION = 10.0
"""A variance inflation factor from which regressors are commonly called collinear (Montgomery, Peck and
Vining, Introduction to Linear Regression Analysis, 5th ed., ch. 9)."""
MATTERS = 0.05
"""Share of the rms of a response that a parameter moves it by, from which its error matters."""

DoubtKind = Literal["wide interval", "collinear", "misses the truth"]
DOUBT_KINDS: tuple[DoubtKind, ...] = ("wide interval", "collinear", "misses the truth")


@dataclass(frozen=True)
class Doubt:
    """A parameter that cannot be trusted as a number.

    Attributes
    ----------
    response, parameter, unit : str
    estimate, std_error : float
    half_width : float
        Of the confidence interval, over the size of the estimate.
    inflation : float
        Variance inflation factor.
    companions : tuple of str
        Regressors that it cannot be told from; empty where it is not collinear.
    weight : float
        Root mean square of what the parameter moves its response by in this flight, at the farther end of
        its interval, over that of the response; nan where the flight's response is not known.
    kinds : tuple of DoubtKind
        Reasons, at least one.
    miss : Miss, optional
        What of the simulation's truth it misses, and why.
    """

    response: str
    parameter: str
    unit: str
    estimate: float
    std_error: float
    half_width: float
    inflation: float
    companions: tuple[str, ...]
    weight: float
    kinds: tuple[DoubtKind, ...]
    miss: Miss | None = None

    @property
    def matters(self) -> bool:
        """Whether its error can be seen in the response: `weight` is `MATTERS` or more, or is not known."""
        return not self.weight < MATTERS


def doubts_of(response: ResponseModel, misses: Sequence[Miss] = ()) -> tuple[Doubt, ...]:
    """Return the parameters of a response that cannot be trusted, those that move it most first.

    Parameters
    ----------
    response : ResponseModel
    misses : sequence of Miss
        Of the same response, where the simulation's truth is known.
    """
    found = list(_doubts(response, {m.parameter: m for m in misses}))
    return tuple(sorted(found, key=lambda d: -d.weight if math.isfinite(d.weight) else -math.inf))


def _doubts(response: ResponseModel, misses: dict[str, Miss]) -> Iterator[Doubt]:
    moved = _rms(response)
    for j, name in enumerate(response.regressors):
        estimate, error = float(response.estimate[j]), float(response.std_error[j])
        half = float(response.upper[j] - response.lower[j]) / 2
        width = half / abs(estimate) if estimate else math.inf
        inflation = float(response.variance_inflation[j])
        companions = _companions(response, j)
        kinds: list[DoubtKind] = []
        if not width <= WIDE:
            kinds.append("wide interval")
        if companions:
            kinds.append("collinear")
        if name in misses:
            kinds.append("misses the truth")
        if kinds:
            yield Doubt(
                response.response,
                name,
                response.parameter_units[j],
                estimate,
                error,
                width,
                inflation,
                companions,
                (abs(estimate) + half) * float(response.regressor_rms[j]) / moved,
                tuple(kinds),
                misses.get(name),
            )


def _companions(response: ResponseModel, j: int) -> tuple[str, ...]:
    """Return the regressors that one cannot be told from: its inseparable group, or the nearest one."""
    name = response.regressors[j]
    groups = [g for g in response.inseparable if name in g]
    if groups:
        return tuple(dict.fromkeys(n for g in groups for n in g if n != name))
    if not response.variance_inflation[j] > HIGH_INFLATION or len(response.regressors) < 2:
        return ()
    beside = np.abs(np.nan_to_num(response.correlation[j]))
    beside[j] = -1.0
    return (response.regressors[int(beside.argmax())],)


def _rms(response: ResponseModel) -> float:
    """Return the rms of the response over the manoeuvre about its mean; nan where no history is kept."""
    fit = response.fit.get("time")
    return float(np.std(fit.measured)) or math.nan if fit is not None else math.nan

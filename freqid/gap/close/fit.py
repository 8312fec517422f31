"""Effect and tolerances fitted together to the stack, tolerances penalised by their priors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from freqid.core.arrays import Array
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.evidence import Evidence
from freqid.gap.infer.explain import Explanation
from freqid.gap.infer.system import System
from freqid.gap.settings import FARTHEST


@dataclass(frozen=True, eq=False)
class Fit:
    """What a stack says of an explanation and of the tolerances.

    Attributes
    ----------
    form_error : Form
        At which it was fitted.
    effect : ndarray, shape (column,)
        Weights of the candidates' columns; fitted with tolerances free.
    effect_alone : ndarray, shape (column,)
        The same with nominal tolerances: what is refitted where nothing else may move.
    tolerances : ndarray, shape (tolerance,)
        Departures in sigmas beside the effect.
    tolerances_alone : ndarray, shape (tolerance,)
        Without it.
    """

    form_error: Form
    effect: Array
    effect_alone: Array
    tolerances: Array
    tolerances_alone: Array


def fit(evidence: Evidence, explanation: Explanation, form_error: Form) -> Fit:
    """Return the fit of an explanation to a stack: its sizes as estimated, tolerances given these.

    Parameters
    ----------
    evidence : Evidence
        Of which the explanation is.
    explanation : Explanation
    form_error : Form
        At which it is fitted.
    """
    system = evidence.system
    gram = system.gram(form_error)
    n = system.columns
    weights = explanation.weights(system)
    beside, alone = (system.likeliest_tolerances(form_error, w) for w in (weights, None))
    # with tolerances held at nominal, the size moves along its direction to where the residual is least
    energy = float(weights @ gram[:n, :n] @ weights)
    scale = float(weights @ gram[:n, -1]) / energy if energy > 0 else 1.0
    return Fit(form_error, weights, np.clip(scale, 0.0, 2.0) * weights, beside, alone)


def log_evidence(system: System, evidence: Evidence, explanation: Explanation) -> float:
    """Return the log evidence of an explanation on some blocks, sizes integrated out.

    Each effect in turn, given the estimated sizes of those before it.
    """
    return float(logsumexp(_by_form(system, evidence, explanation)))


def log_evidence_of_tolerances(system: System) -> float:
    """Return the log evidence of tolerances alone on some blocks."""
    return float(logsumexp([system.reduced(f).log_evidence for f in system.form_errors]))


def departures_beyond(system: System) -> dict[int, float]:
    """Return the tolerances that alone would have to depart by more than `FARTHEST` sigmas, held there.

    A centre of gravity that is off by ten sigmas is no tolerance but the effect of that name. The farthest is
    held first, then the others are fitted again.

    Returns
    -------
    dict of float
        Sigmas, plus or minus `FARTHEST`, by the place of the tolerance.
    """
    held: dict[int, float] = {}
    likeliest = max(system.form_errors, key=lambda f: system.reduced(f).log_evidence)
    while len(held) < len(system.tolerances):
        free = [k for k in range(len(system.tolerances)) if k not in held]
        left = system.held(held)
        departure = left.likeliest_tolerances(likeliest)
        farthest = int(np.argmax(np.abs(departure)))
        if abs(departure[farthest]) <= FARTHEST:
            break
        held[free[farthest]] = float(np.sign(departure[farthest])) * FARTHEST
    return held


def likeliest_form_error(evidence: Evidence, explanation: Explanation) -> Form:
    """Return the simulation's error of form with the largest evidence once an explanation is allowed for."""
    system = evidence.system
    return system.form_errors[int(np.argmax(_by_form(system, evidence, explanation)))]


def _by_form(system: System, evidence: Evidence, explanation: Explanation) -> list[float]:
    """Return the log evidence of an explanation at each error of form, less what all have in common.

    The likelihood at the estimated sizes, times what each effect's own prior takes off it given the others.
    """
    weighing = evidence.weighing
    parts = []
    for i, e in zip(explanation.places, explanation.estimates, strict=True):
        parts.append((i, np.zeros(system.columns)))
        parts[-1][1][system.columns_of(i)] = e.weights
    whole = np.sum([w for _, w in parts], axis=0)
    found = []
    for f in system.form_errors:
        reduced = system.reduced(f)
        total = float(whole @ reduced.g - 0.5 * whole @ reduced.G @ whole)
        for i, own in parts:
            left = reduced.given(whole - own)
            total += weighing.of_place(i, left) - float(own @ left.g - 0.5 * own @ left.G @ own)
        found.append(reduced.log_evidence + total)
    return found

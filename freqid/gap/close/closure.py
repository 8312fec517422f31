"""Closures: which explanation holds on data that were left out, and how much of the gap goes with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from freqid.core.results.diagnosis import Closure, Interval, ScoredOn, Share
from freqid.gap.close.closing import Closing
from freqid.gap.close.fit import (
    Fit,
    departures_beyond,
    fit,
    likeliest_form_error,
    log_evidence,
    log_evidence_of_tolerances,
)
from freqid.gap.close.flown import Flown, motions
from freqid.gap.close.score import Responses, Scored, responses, shares
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.evidence import Evidence, estimate, weigh
from freqid.gap.infer.explain import Explanation
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.settings import INTERVAL
from freqid.simulate.effects.effect import Effect


@dataclass(frozen=True, eq=False)
class Closed:
    """One explanation on what was left out of its fit.

    Attributes
    ----------
    explanation : Explanation
    closure : Closure
    fit : Fit
        To all that was used.
    withdrawn : str
        Why its name does not hold; empty where it does.
    """

    explanation: Explanation
    closure: Closure
    fit: Fit
    withdrawn: str


def close(
    closing: Closing,
    explanation: Explanation,
    seed: int,
    library: Mapping[str, Effect],
    tolerances: Mapping[str, float],
    least: int = 1,
    singles: Sequence[Closing] = (),
) -> list[Closed]:
    """Return the closure of an explanation, then of each of its effects alone where it has several.

    A second effect stays only where it raises the score of what was left out.

    Parameters
    ----------
    closing : Closing
    explanation : Explanation
        Whose candidates are those of the closing's system, in that order.
    seed : int
    library : dict of Effect
        Of the vehicle.
    tolerances : dict of float
        One sigma by name.
    least : int
        How many of the effects stay whether they predict better or not.
    singles : sequence of Closing
        Of each effect by itself, where one changes what another does; divided as `closing` is.
    """
    flown = Flown(closing.blocks, library, tolerances)
    whole, fitted = _weighed(closing)
    order = tuple(range(len(explanation.places)))
    every = replace(explanation, places=order)
    best = _prefix(fitted, every, least)
    without = _score_of_tolerances(closing)
    score = _score(closing, whole, best) - without
    for count in range(least + 1, len(order) + 1):
        longer = _prefix(fitted, every, count)
        more = _score(closing, whole, longer) - without
        if more <= score:
            break
        best, score = longer, more
    forms = _forms(closing, fitted, best)
    found = [_closed(closing, fitted, best, forms, score, seed, flown)]
    for i in best.places if len(best.places) > 1 else ():
        own, at = (singles[i], 0) if singles else (closing, i)
        here, used = _weighed(own) if singles else (whole, fitted)
        alone = Explanation((at,), (used.candidate[at],), joint_estimates(used.system, (at,)))
        score = _score(own, here, alone) - without
        found.append(_closed(own, used, alone, forms, score, seed, flown))
    return found


def _forms(closing: Closing, fitted: Evidence, best: Explanation) -> list[Form]:
    """Return the errors of form beside the best explanation: of all that is fitted, then of each fold.

    The simulation has one error of form: a worse explanation with a larger one would seem to close as much.
    """
    whole = likeliest_form_error(fitted, best)
    if len(closing.folds) == 1:
        return [whole, whole]
    each = [weigh(closing.system.only(fold.rest)) for fold in closing.folds]
    return [whole, *(likeliest_form_error(here, _again(here, best)) for here in each)]


def _weighed(closing: Closing) -> tuple[Evidence, Evidence]:
    """Return the evidence of all that is there, and of what is fitted."""
    whole = weigh(closing.system)
    return whole, whole if len(closing.folds) > 1 else weigh(closing.system.only(closing.folds[0].rest))


def _prefix(evidence: Evidence, explanation: Explanation, count: int) -> Explanation:
    if count == len(explanation.places):
        return explanation
    places = explanation.places[:count]
    if count == 1:
        return Explanation(places, explanation.gains[:1], joint_estimates(evidence.system, places))
    return Explanation(places, explanation.gains[:count], explanation.estimates[:count])


def _score(closing: Closing, whole: Evidence, explanation: Explanation) -> float:
    """Return the log predictive density of what was left out, with an explanation.

    That of blocks given all others is the difference of two log evidences.
    """
    every = log_evidence(closing.system, whole, explanation)
    rest = (log_evidence(closing.system.only(fold.rest), whole, explanation) for fold in closing.folds)
    return sum(every - one for one in rest)


def _score_of_tolerances(closing: Closing) -> float:
    """Return the log predictive density of what was left out, with tolerances alone.

    These reach no further than is believed of them: where one is the effect by another name, it would predict
    as well.
    """
    system, total = closing.system, 0.0
    for fold in closing.folds:
        rest = system.only(fold.rest)
        held = departures_beyond(rest)
        total += log_evidence_of_tolerances(system.held(held)) - log_evidence_of_tolerances(rest.held(held))
    return total


def _closed(
    closing: Closing,
    fitted: Evidence,
    explanation: Explanation,
    forms: Sequence[Form],
    score: float,
    seed: int,
    flown: Flown,
) -> Closed:
    """Return the closure of an explanation at the errors of form of `_forms`."""
    scored: list[Scored] = []
    index: list[int] = []
    anew: list[Explanation] = []
    for fold, form in zip(closing.folds, forms[1:], strict=True):
        one = len(closing.folds) == 1
        here = fitted if one else weigh(closing.system.only(fold.rest))
        again = explanation if one else _again(here, explanation)
        fit_ = fit(here, again, form)
        index += [closing.source[i] for i in fold.scored]
        anew += [again for _ in fold.scored]
        scored += [Scored(closing.blocks[closing.source[i]], closing.columns[i], fit_) for i in fold.scored]
    share = shares(scored, seed, INTERVAL)
    if closing.by_lines:
        scored, index, anew = scored[:1], index[:1], anew[:1]  # histories are of the whole block
    moved = motions(flown, scored, index, closing.system, anew, seed, INTERVAL)
    figures = responses(scored, index, closing.system)
    closure = Closure(
        effects=explanation.effects,
        settings=_settings(explanation),
        wrench=share["both"],
        response=moved.share,
        rmse=figures.rmse,
        theil=figures.theil,
        J=moved.cost,
        held_out=closing.held_out,
        note=_note(share, figures, closing.scored),
        effect_only=share["effect"],
        tolerances_only=share["tolerances"],
        response_effect_only=moved.effect_only,
        log_score=score,
        scored=closing.scored,
    )
    whole = fit(fitted, explanation, forms[0])
    return Closed(explanation, closure, whole, _withdrawn(explanation, score, figures, closing.scored))


def _again(evidence: Evidence, explanation: Explanation) -> Explanation:
    """Return an explanation with its sizes estimated anew on other data."""
    if len(explanation.places) == 1:
        found = joint_estimates(evidence.system, explanation.places)
        return Explanation(explanation.places, explanation.gains, found)
    found, given = [], explanation.weights(evidence.system)
    for i in explanation.places:
        others = given.copy()
        others[evidence.system.columns_of(i)] = 0.0
        found.append(estimate(evidence, i, INTERVAL, given=others))
    return Explanation(explanation.places, explanation.gains, tuple(found))


def _settings(explanation: Explanation) -> dict[str, dict[str, Interval]]:
    found: dict[str, dict[str, Interval]] = {}
    for e in explanation.estimates:
        c = e.candidate
        named = c.place.parameters if c.kind == "vector" else c.place.parameters[:1]
        units = c.units or (c.unit,) * len(named)
        values = {
            n: Interval(float(x), float(lo), float(hi), unit)
            for n, x, lo, hi, unit in zip(named, e.size, e.lo, e.hi, units, strict=False)
        }
        if c.kind == "scalar":  # one size for all effectors of a group
            values |= {n: next(iter(values.values())) for n in c.place.parameters[1:]}
        values |= {n: Interval(v, v, v, "") for n, v in c.place.fixed}
        found[c.effect] = values
    return found


_LEFT_OUT: dict[ScoredOn, str] = {
    "held out": "manoeuvres that were held out",
    "turns": "manoeuvres that were left out in turn",
    "lines": "lines that were left out in turn",
}


def _note(share: dict[str, Share], figures: Responses, scored: ScoredOn) -> str:
    both, alone = share["both"].G, share["tolerances"].G
    if np.isfinite(both) and both < 0:
        return "what helps where it was fitted does not transfer"
    if np.isfinite(both) and both < alone:
        return "tolerances alone leave less than the effect with them"
    if not figures.acting:
        return f"the effect changes nothing in {_LEFT_OUT[scored]}"
    return ""


def _withdrawn(explanation: Explanation, score: float, figures: Responses, scored: ScoredOn) -> str:
    """Return why a name does not hold, or nothing."""
    if score < 0:
        return f"it predicts {_LEFT_OUT[scored]} worse than tolerances alone do ({score:.1f} nats)"
    if figures.rises:
        return f"with it the error of {', '.join(figures.acting[:3])} grows on {_LEFT_OUT[scored]}"
    bound = [e.candidate.name for e in explanation.estimates if e.at_bound]
    if bound:
        return f"the size of {bound[0]} is at the end of what is physical"
    return ""

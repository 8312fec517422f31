"""What a reader should know first about a study, in sentences that its numbers make."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from markupsafe import Markup

from freqid.blend.corridor_study import (
    FAILED_VALIDATION,
    GOOD_R2,
    MOST_HELD_OUT,
    MOST_NEW_DENSITY,
    MOST_VALIDATION,
    StudiedPoint,
    StudyResults,
    causes_of,
    most_allowed,
)
from freqid.core.results.judged.truth import BEYOND, PROMISED, as_many_as_by_chance
from freqid.core.results.judged.truth import scatter_of_share as _scatter
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import number, percent, share, short, symbol
from freqid.report.study.results import settled_share

SETTLED = 0.95
"""Share of parameters that makes a manoeuvre long enough."""
SETTLED_BY = 40.0
"""s into the second period: when they should have settled."""


def study_verdict(results: StudyResults, *, truth: bool = True) -> tuple[Finding, ...]:
    """Return the findings, the headline first.

    Parameters
    ----------
    results : StudyResults
    truth : bool
        Whether the simulation's truth is among them; a report says it with its point models.
    """
    findings = [*_held_out(results), *_settled(results), *_separable(results)]
    findings += [*_low(results), *_noise(results), *(truth_findings(results.points) if truth else [])]
    findings.sort(key=lambda f: ("bad", "note", "good").index(f.kind))
    return (_headline(results), *findings)


def settled_by(results: StudyResults) -> float | None:
    """Return when parameters should have settled, s; None where flights are shorter or differ in length."""
    if results.design is None:
        return None
    if any(
        (d.period_s, d.periods) != (results.design.period_s, results.design.periods)
        for d in results.own_designs.values()
    ):
        return None
    by = results.design.period_s + SETTLED_BY
    return by if by < results.design.duration_s else None


def settled_time(time: np.ndarray, settled: np.ndarray) -> float:
    """Return from when on enough parameters have settled, s."""
    return float(time[np.argmax(settled >= SETTLED)])  # at the end all have


def _headline(results: StudyResults) -> Finding:
    scores = {(r, p.id): p.model[r].r2 for p in results.points for r in results.responses}
    lowest = min(scores, key=lambda at: (scores[at] == scores[at], scores[at]))
    good = sum(score >= GOOD_R2 for score in scores.values())
    count = len(results.points)
    text = Markup("{} condition{}: {} of {} responses are modelled with R² of {:g} or more (lowest: {}, {}).")
    sentence = text.format(
        count,
        "s" * (count > 1),
        good,
        len(scores),
        GOOD_R2,
        share(scores[lowest]),
        _at(results, *lowest),
    )
    ratios = {(r, p.id): p.validation_ratio(r) for p in results.points for r in results.responses}
    ratios = {at: ratio for at, ratio in ratios.items() if math.isfinite(ratio)}
    if not ratios:
        return finding("note", "{} No manoeuvre was predicted.", sentence)
    worst = max(ratios, key=lambda at: ratios[at])
    beyond = sum(not ratio <= MOST_VALIDATION for ratio in ratios.values())
    over = f"; {beyond} of {len(ratios)} above {MOST_VALIDATION:g}" if beyond else ""
    fine = not beyond and good == len(scores)
    return finding(
        "bad" if ratios[worst] > FAILED_VALIDATION else "good" if fine else "note",
        "{} Manoeuvres that were not used are predicted with {} to {} times the error of the fit "
        "(largest: {}{}).",
        sentence,
        number(min(ratios.values())),
        number(ratios[worst]),
        _at(results, *worst),
        over,
    )


def _held_out(results: StudyResults) -> list[Finding]:
    ratios = {
        (r, h.reference.id): (h.ratio(r), most_allowed(results, h))
        for h in results.held_out
        for r in results.responses
        if math.isfinite(h.ratio(r))
    }
    if not ratios:
        return []
    worst = max(ratios, key=lambda at: ratios[at][0] / ratios[at][1])
    beyond = sum(ratio > most for ratio, most in ratios.values())
    values = [ratio for ratio, _ in ratios.values()]
    count = len({identifier for _, identifier in ratios})
    one = finding(
        "bad" if beyond else "good",
        "At {} that it was not made from, the global model errs {} to {} times as much as a point model "
        "identified there (farthest from what is asked: {}, {}).",
        "a condition" if count == 1 else f"{count} conditions",
        number(min(values)),
        number(max(values)),
        _at(results, *worst),
        number(ratios[worst][0]),
    )
    if beyond:
        text = Markup("{} {} of {} are beyond {:g}, or {:g} at a density it was not made at.")
        one = Finding(one.kind, text.format(one.text, beyond, len(ratios), MOST_HELD_OUT, MOST_NEW_DENSITY))
    return [one]


def _settled(results: StudyResults) -> list[Finding]:
    times = {p.id: settled_time(*settled_share(p.history)) for p in results.points if p.history}
    if not times:
        return []
    last, by = max(times, key=lambda i: times[i]), settled_by(results)
    text = Markup("{:.0f} % of the parameters stay within 2σ of their final value from {} s on, {}").format(
        100 * SETTLED, short(times[last]), code(last)
    )
    text = Markup("{} being the last.").format(text) if len(times) > 1 else Markup("{}.").format(text)
    if by is not None and times[last] > by:
        return [finding("bad", "{} That is later than {} s, which is asked for.", text, short(by))]
    return [Finding("good", text)]


def _separable(results: StudyResults) -> list[Finding]:
    confused = {
        group: p.id for p in results.points for r in p.model.responses.values() for group in r.inseparable
    }
    if confused:
        listing = listed(
            Markup("{} at {}").format(Markup(", ").join(map(code, group)), code(at))
            for group, at in confused.items()
        )
        return [finding("bad", "The data cannot separate {}.", listing)]
    numbers = {p.id: max(r.condition_number for r in p.model.responses.values()) for p in results.points}
    worst = max(numbers, key=lambda i: numbers[i])
    return [
        finding(
            "good",
            "The data separate every parameter: the condition number is at most {} ({}).",
            number(numbers[worst]),
            code(worst),
        )
    ]


def _low(results: StudyResults) -> list[Finding]:
    low = {
        r: sum(not p.model[r].r2 >= GOOD_R2 for p in results.points)
        for r in results.responses
        if any(not p.model[r].r2 >= GOOD_R2 for p in results.points)
    }
    if not low:
        return []
    listing = listed(Markup("{} ({})").format(symbol(r, results.form), n) for r, n in low.items())
    at = [(p, r) for p in results.points for r in low if not p.model[r].r2 >= GOOD_R2]
    if all(p.model[r].r2_ceiling is not None for p, r in at):
        short = [_at(results, r, p.id) for p, r in at if not p.model[r].reaches_ceiling]
        return [
            finding(
                "note",
                "R² is below {:g} for {}, the number of conditions in brackets: noise sets it a ceiling "
                "there{}.",
                GOOD_R2,
                listing,
                Markup("; also below its ceiling: {}").format(listed(short)) if short else "",
            )
        ]
    return [
        finding(
            "note",
            "R² is below {:g} for {}, the number of conditions in brackets: a response that hardly moves "
            "has little but noise to explain.",
            GOOD_R2,
            listing,
        )
    ]


def _noise(results: StudyResults) -> list[Finding]:
    counts = {
        (r, p.id): len(p.model[r].differing)
        for p in results.points
        for r in results.responses
        if p.model[r].errors_in_variables is not None
    }
    if not counts:
        return [
            finding(
                "note",
                "Estimates are by least squares, which noise in the regressors biases; nothing is beside.",
            )
        ]
    total = sum(len(p.model[r].regressors) for p in results.points for r in results.responses)
    found, most = sum(counts.values()), max(counts, key=lambda at: counts[at])
    if not found:
        return [
            finding("good", "Least squares and instruments agree within noise in all {} parameters.", total)
        ]
    return [
        finding(
            "note",
            "Noise in the regressors biases least squares: {} of {} parameters differ beyond noise from the "
            "estimate by instruments, which is shown (most: {}, {}).",
            found,
            total,
            _at(results, *most),
            counts[most],
        )
    ]


def truth_findings(points: Sequence[StudiedPoint]) -> list[Finding]:
    """Return how many parameters lie within 2σ of the truth: of the linearisation, and of noise-free flights.

    The kind follows from the share beside what 2σ promises: good within the scatter of that many independent
    parameters, bad where more than twice as many are outside as within it, a note between. Off the
    linearisation is a note at most where noise-free flights tell why: it is no fault of the estimate.
    """
    responses = [(p, r) for p in points for r in p.model.responses]
    apart = np.concatenate([np.zeros(0), *(p.from_linear(r) for p, r in responses)])
    apart = apart[np.isfinite(apart)]
    if not apart.size:
        return []
    away = np.concatenate([p.from_noise_free(r) for p, r in responses])
    away = away[np.isfinite(away)]
    kind = _promised(apart)
    linear = finding(
        "note" if kind == "bad" and away.size else kind,
        "{}{} of {} parameters ({}) lie within 2σ of the linearised simulation and {} are off it, where 2σ "
        "promises {} within; the distance is {}σ in root mean square.{}",
        "" if kind == "good" else "Only ",
        *_within(apart),
        _off(apart),
        percent(PROMISED),
        number(float(np.sqrt(np.mean(apart**2))), 2),
        _why_off(points),
    )
    if not away.size:
        return [linear]
    kind = _promised(away)
    words = {"good": "as many as noise alone would leave", "note": "fewer than noise alone would leave"}
    return [
        finding(
            kind,
            "{} of {} parameters ({}) lie within 2σ of the noise-free estimates of the same flights and {} "
            "are off them, {} ({} within, {} to {} by chance); the distance is {}σ in root mean square.",
            *_within(away),
            _off(away),
            words.get(kind, "far fewer than noise alone would leave"),
            percent(PROMISED),
            percent(max(PROMISED - _scatter(away.size), 0.0)),
            percent(min(PROMISED + _scatter(away.size), 1.0)),
            number(float(np.sqrt(np.mean(away**2))), 3),
        ),
        linear,
    ]


def _within(distances: np.ndarray) -> tuple[int, int, str]:
    """Return how many distances, in standard errors, are within 2σ, of how many, and the share."""
    within = int((np.abs(distances) <= BEYOND).sum())
    return within, distances.size, percent(within / distances.size)


def _off(distances: np.ndarray) -> int:
    return int((np.abs(distances) > BEYOND).sum())


def _why_off(points: Sequence[StudiedPoint]) -> Markup:
    """Return the causes of what is off the linearisation, most frequent first."""
    causes = causes_of(points)
    why = listed(Markup("{} for {}").format(cause, n) for cause, n in causes.most_common())
    sentence = Markup(" Of the {} that are off it, the largest part of the difference comes from {}.")
    return sentence.format(causes.total(), why) if causes else Markup()


def _promised(distances: np.ndarray) -> Literal["good", "note", "bad"]:
    """Return how distances, in standard errors, stand beside what 2σ promises."""
    if as_many_as_by_chance(distances):
        return "good"
    outside, expected = float(np.mean(np.abs(distances) > BEYOND)), 1 - PROMISED
    return "note" if outside <= 2 * expected + _scatter(distances.size) else "bad"


def _at(results: StudyResults, response: str, identifier: str) -> Markup:
    return Markup("{} at {}").format(symbol(response, results.form), code(identifier))

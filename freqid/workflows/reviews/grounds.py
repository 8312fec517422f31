"""What each file says for and against the use of a model, of a simulation, and of the next flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from freqid.blend.corridor_study import (
    FAILED_VALIDATION,
    GOOD_R2,
    MOST_HELD_OUT,
    MOST_NEW_DENSITY,
    MOST_VALIDATION,
    StudiedPoint,
    StudyResults,
    most_allowed,
)
from freqid.core.channels import WRENCH_MEANING
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.gates import MissedGate, missed_gates, unjudged_gates
from freqid.core.results.judged.review import Ground, Reversal
from freqid.core.results.judged.sealed_trial import TrialOutcome
from freqid.core.results.loop_margins import LoopMargins, least_of
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import DISTORTED, PointModel, ResponseModel
from freqid.core.results.prediction import Score
from freqid.core.results.quicklook import Quicklook
from freqid.core.results.rivals import Rivals
from freqid.core.scenario import Gates
from freqid.gap.fidelity import ACCEPTABLE
from freqid.workflows.reviews.gap_grounds import MARGINS, WANTED_G, base_name, grounds_of_gap, listed
from freqid.workflows.reviews.read_together import ReviewedFile

_WEIGHTS: dict[str, Literal["good", "risk", "stop"]] = {"right": "good", "wrong": "stop", "undecided": "risk"}


def rules() -> tuple[str, ...]:
    """Return what is an open risk or forbids use: one phrase for each kind of figure."""
    phase, gain = (f"{wanted:g} {unit}" for _, wanted, unit in MARGINS)
    return (
        f"a response of which the model explains less than {100 * GOOD_R2:g} % (R²), whether the model or "
        "noise is why",
        f"a response in which the model leaves more than {DISTORTED:g} times the power of noise",
        f"an error on a new flight above {MOST_VALIDATION:g} times that of the fit; above "
        f"{FAILED_VALIDATION:g} times it forbids use",
        f"an error of the global model at a condition that was held out above {MOST_HELD_OUT:g} times that "
        f"of a model made there, {MOST_NEW_DENSITY:g} at another air density: this forbids use",
        "parameters that the flights cannot separate, and what a model remarks of itself",
        "an output error that did not converge, which forbids use; its residuals that are not white, and a "
        "parameter at its bound",
        f"a margin below {phase} of phase or {gain}, with the identified model or with the effect of the "
        "gap: this forbids use; an interval that reaches below is a risk",
        "margins of another aircraft outside the model's interval, more of them than chance would put there",
        f"a gap: it forbids use unless its effect closes {100 * WANTED_G:g} % of it, with an interval above "
        "zero, and is a risk then",
        "a name of the gap's cause that is withdrawn, effects that cannot be told apart, a fault of a sensor",
        f"a cost J above {ACCEPTABLE:g} of the simulation's own flight with the effect",
        "a gate of the scenario that is missed, a flight to be repeated, a sealed prediction that fails, and "
        "a sealed trial in which the diagnosis was wrong: each forbids use",
        "what was not tried: no new flight, no condition held out, no flight held out from the diagnosis, a "
        "study that is not finished",
    )


def grounds_of(files: Sequence[ReviewedFile], gates: Gates | None) -> Iterator[Ground]:
    """Yield what each file says for and against use.

    Parameters
    ----------
    files : sequence of ReviewedFile
    gates : Gates, optional
        Of a scenario.
    """
    for one in files:
        name, result = one.source.name, one.result
        if one.unfinished:
            yield Ground(
                "model", "risk", f"the study in {name} is not finished: what it lacks is not judged", name
            )
        elif isinstance(result, StudyResults):
            for point in result.points:
                yield from _of_point(point, gates, f"points/{point.id}.h5")
            yield from _of_study(result, name)
        elif isinstance(result, OutputErrorModel):
            yield from _of_output_error(result, name)
        elif isinstance(result, PointModel):
            yield from _of_point(StudiedPoint(result, {}, {}, np.zeros(0), {}), gates, name)
        elif isinstance(result, GapResult):
            yield from grounds_of_gap(result, name)
        elif isinstance(result, LoopMargins):
            yield from _of_margins(result, name)
        elif isinstance(result, Score):
            yield from _of_score(result, name)
        elif isinstance(result, Quicklook):
            yield from _of_quicklook(result, name)
        elif isinstance(result, Rivals):
            yield Ground("simulation", "risk" if result.nearer else "good", result.verdict.rstrip("."), name)
        elif isinstance(result, TrialOutcome):
            yield _of_trial(result, name)


def _of_point(point: StudiedPoint, gates: Gates | None, source: str) -> Iterator[Ground]:
    model, at = point.model, f"at {point.id}" if point.id else f"in {source}"
    for miss in missed_gates(model, gates) if gates is not None else ():
        if not miss.unjudged:
            yield Ground("model", "stop", f"{at} {miss}", source, tuple(_gate(miss, at)))
    if gates is not None and (unjudged := unjudged_gates(model, gates)):
        yield Ground("model", "stop", f"{at} {unjudged}", source)
    for response in model.responses.values():
        for group in response.inseparable:
            text = (
                f"{at} the flights cannot separate what {listed(group)} do to the {said(response.response)}"
            )
            yield Ground("model", "risk", text, source)
    yield from _of_fit(point, at, source)
    bent = [r for r in model.responses.values() if r.distortion is not None and not r.distortion <= DISTORTED]
    if bent:
        worst = max(bent, key=lambda r: r.distortion or 0.0)
        text = (
            f"{at} the model leaves more than sensor noise in {listed([said(r.response) for r in bent])} "
            f"(most in {worst.response}: {worst.distortion:.3g} times the power of noise), so that the true "
            "errors of their parameters are larger than stated"
        )
        figure = Reversal(
            "Power that the model leaves, over that of noise",
            worst.distortion or math.nan,
            DISTORTED,
            f"{worst.response} {at}",
        )
        yield Ground("model", "risk", text, source, (figure,))
    ratios = {r: point.validation_ratio(r) for r in model.responses}
    known = {r: v for r, v in ratios.items() if math.isfinite(v)}
    if not known:
        yield Ground(
            "model", "risk", f"{at} the model was not tried on a flight that it was not made from", source
        )
    else:
        worst = max(known, key=lambda r: known[r])
        failed = known[worst] > FAILED_VALIDATION
        weight = "stop" if failed else "good" if known[worst] <= MOST_VALIDATION else "risk"
        text = (
            f"{at}, on a flight that it was not made from, the model's error is at most {known[worst]:.3g} "
            f"times that on its own flight ({said(worst)})"
        )
        where, what = f"{worst} {at}", "Error on a new flight, over that of the fit"
        bounds: list[tuple[float, Literal["risk", "stop"]]] = [(MOST_VALIDATION, "risk")]
        if weight != "good":
            bounds.append((FAILED_VALIDATION, "stop"))
        figures = tuple(Reversal(what, known[worst], bound, where, weight=w) for bound, w in bounds)
        yield Ground("model", weight, text, source, figures)
    for remark in model.remarks:
        yield Ground("model", "risk", f"{at}: {remark.rstrip('.')}", source)


def _of_fit(point: StudiedPoint, at: str, source: str) -> Iterator[Ground]:
    """Yield the responses of which too little is explained, by whether the model or noise is why."""
    low = [r for r in point.model.responses.values() if not r.r2 >= GOOD_R2]
    hidden = [r for r in low if r.reaches_ceiling]
    poor = [r for r in low if not r.reaches_ceiling]
    for responses, text in (
        (poor, "the model explains too little of {}"),
        (
            hidden,
            "the flight does not show whether the model is good enough in {}: they hardly move beside noise",
        ),
    ):
        if responses:
            each = listed([f"the {said(r.response)} ({100 * r.r2:.1f} %{_allowed(r)})" for r in responses])
            worst = min(responses, key=lambda r: r.r2 if math.isfinite(r.r2) else -math.inf)
            figure = Reversal(
                "Share of a response that the model explains (R²)",
                worst.r2,
                GOOD_R2,
                f"{worst.response} {at}",
                side="at least",
            )
            words = text if len(responses) > 1 else text.replace("they hardly move", "it hardly moves")
            yield Ground("model", "risk", f"{at} {words.format(each)}", source, (figure,))


def _gate(miss: MissedGate, at: str) -> Iterator[Reversal]:
    """Yield the figure of a gate that is missed, where it is a number."""
    if math.isfinite(miss.value):
        side = "at least" if miss.figure in ("R2", "coherence") else "at most"
        text = f"Gate of the scenario: {miss.figure}"
        yield Reversal(text, miss.value, miss.gate, f"{miss.response} {at}", side=side, weight="stop")


def _of_study(results: StudyResults, source: str) -> Iterator[Ground]:
    ratios = {
        (r, h.reference.id): (h.ratio(r), most_allowed(results, h))
        for h in results.held_out
        for r in results.responses
        if math.isfinite(h.ratio(r))
    }
    if not ratios:
        yield Ground(
            "model",
            "risk",
            "between the conditions the global model was not tried, because no condition was held out",
            source,
        )
        return
    worst = max(ratios, key=lambda at: ratios[at][0] / ratios[at][1])
    ratio, allowed = ratios[worst]
    text = (
        f"at conditions that it was not made from, the global model errs at most {ratio:.3g} times as much "
        f"as a model made there ({said(worst[0])} at {worst[1]}; {allowed:g} is allowed)"
    )
    figure = Reversal(
        "Error of the global model between conditions, over a point model's there",
        ratio,
        allowed,
        f"{worst[0]} at {worst[1]}",
        weight="stop",
    )
    yield Ground("model", "good" if ratio <= allowed else "stop", text, source, (figure,))


def _of_output_error(result: OutputErrorModel, source: str) -> Iterator[Ground]:
    if not result.converged:
        yield Ground("model", "stop", f"{result.model}: the iteration did not converge", source)
    if result.coloured:
        text = f"{result.model}: the residuals of {', '.join(result.coloured)} are not white"
        yield Ground("model", "risk", text, source)
    if result.at_bound:
        yield Ground("model", "risk", f"{', '.join(result.at_bound)} ended at a bound", source)
    if result.valid:
        yield Ground("model", "good", f"{result.model}: converged, with white residuals", source)
    for remark in result.remarks:
        yield Ground("model", "risk", remark.rstrip("."), source)


def said(response: str) -> str:
    """Return a response with what it is, as ``yawing moment N``; its name alone where it is no load."""
    meaning = WRENCH_MEANING.get(response, "")
    return f"{meaning} {response}" if meaning else response


def _allowed(response: ResponseModel) -> str:
    """Return what noise allows the model to explain, where that is known."""
    most = response.r2_ceiling
    return "" if most is None else f", where noise allows {100 * most:.1f} %"


def _of_margins(found: LoopMargins, source: str) -> Iterator[Ground]:
    apart = dict(found.differing.values())
    for text in found.warnings:
        weight = "stop" if "is unstable" in text else "risk"
        figures = (
            (Reversal("Share of margins outside the model's interval", apart[text], 1 - found.level, source),)
            if text in apart
            else ()
        )
        yield Ground("next flight", weight, text, source, figures)
    for figure, wanted, unit in MARGINS:
        least = least_margin(found, figure)
        if least is None:
            continue
        value, lower, where = least
        text = f"with the identified model the least {figure.split('_')[0]} margin is {value:.1f} {unit}"
        sure = f"; {100 * found.level:.0f} % sure: {lower:.1f} {unit} or more" if math.isfinite(lower) else ""
        text += f" ({where}{sure}); {wanted:g} {unit} is asked for"
        weight = "stop" if value < wanted else "risk" if lower < wanted else "good"
        name = f"{figure.split('_')[0]} margin of the identified model"
        figures = [Reversal(f"Least {name}", value, wanted, where, unit, "at least", "stop")]
        if math.isfinite(lower):
            figures.append(
                Reversal(
                    f"Lower end of the interval of the least {name}", lower, wanted, where, unit, "at least"
                )
            )
        yield Ground("next flight", weight, text, source, tuple(figures))


def least_margin(found: LoopMargins, figure: str) -> tuple[float, float, str] | None:
    """Return the least of a margin over axes and conditions, the lower end of its interval, and where."""
    rows = []
    for k, at in enumerate(found.ids):
        path = least_of(found, k, figure, found.axes)
        if path:
            value, lower, _ = found.row(path)[:, k].tolist()
            rows.append((value, lower, f"{path.split('/')[1]} at {at}"))
    return min(rows, default=None)


def _of_score(score: Score, source: str) -> Iterator[Ground]:
    shares = ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in score.coverage.items())
    text = (
        f"of what was predicted before the flight, the 95 % bands hold {shares} of the samples; "
        f"{100 * score.gate:.0f} % is asked for"
    )
    figures = tuple(
        Reversal(
            f"Share of the samples that the 95 % bands hold, {kind}",
            share,
            score.gate,
            source,
            "1",
            "at least",
            "stop",
        )
        for kind, share in score.coverage.items()
    )
    yield Ground("model", "good" if score.passed else "stop", text, source, figures)
    for name in score.failed:
        yield Ground("model", "risk", f"the assumption '{name}' of the prediction did not hold", source)


def _of_quicklook(look: Quicklook, source: str) -> Iterator[Ground]:
    name = base_name(look.log)
    if look.usable:
        yield Ground("model", "good", f"{name} is usable", source)
    else:
        yield Ground("model", "stop", f"{name} must be repeated: {'; '.join(look.reasons)}", source)


def _of_trial(outcome: TrialOutcome, source: str) -> Ground:
    return Ground("simulation", _WEIGHTS[outcome.answer], outcome.sentence.rstrip("."), source)

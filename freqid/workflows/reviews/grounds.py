"""What each file says for and against the use of a model, of a simulation, and of the next flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from freqid.blend.campaign import (
    FAILED_VALIDATION,
    GOOD_R2,
    MOST_VALIDATION,
    StudiedPoint,
    StudyResults,
    most_allowed,
)
from freqid.core.channels import WRENCH_MEANING
from freqid.core.results.diagnosis import Closure, Which
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.review import Ground
from freqid.core.results.judged.sealed_trial import TrialOutcome
from freqid.core.results.loop_margins import LoopMargins, least_of
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel, ResponseModel, gate_sentences
from freqid.core.results.prediction import Score
from freqid.core.results.quicklook import Quicklook
from freqid.core.results.rivals import Rivals
from freqid.core.scenario import Gates
from freqid.identify.model.selection import DISTORTED
from freqid.workflows.reviews.read_together import ReviewedFile

_PHASE_DEG, _GAIN_DB = 45.0, 6.0
MARGINS = (("phase_deg", _PHASE_DEG, "deg"), ("gain_up_db", _GAIN_DB, "dB"))
"""Margins asked of a loop before it is flown: MIL-DTL-9490E and SAE AS94900, rigid-body modes."""
WANTED_G = 0.5
"""Share of a gap that must go with its effect, on flights not used, for use of the corrected simulation."""
_WEIGHTS: dict[str, Literal["good", "risk", "stop"]] = {"right": "good", "wrong": "stop", "undecided": "risk"}


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
            yield from _of_gap(result, name)
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
    missed = gate_sentences(model, gates) if gates is not None else []
    for text in missed:
        yield Ground("model", "stop", f"{at} {text}", source)
    for response in model.responses.values():
        for group in response.inseparable:
            text = (
                f"{at} the flights cannot separate what {listed(group)} do to the {said(response.response)}"
            )
            yield Ground("model", "risk", text, source)
    poor = [r for r in model.responses.values() if not (r.r2 >= GOOD_R2 or r.reaches_ceiling)]
    if poor:
        each = listed([f"the {said(r.response)} ({100 * r.r2:.1f} %{_allowed(r)})" for r in poor])
        text = f"{at} the model explains too little of {each}"
        yield Ground("model", "risk", text, source)
    bent = [r for r in model.responses.values() if r.distortion is not None and not r.distortion <= DISTORTED]
    if bent:
        worst = max(bent, key=lambda r: r.distortion or 0.0)
        text = (
            f"{at} the model leaves more than sensor noise in {listed([said(r.response) for r in bent])} "
            f"(most in {worst.response}: {worst.distortion:.3g} times the power of noise), so that the true "
            "errors of their parameters are larger than stated"
        )
        yield Ground("model", "risk", text, source)
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
        yield Ground("model", weight, text, source)
    for remark in model.remarks:
        yield Ground("model", "risk", f"{at}: {remark.rstrip('.')}", source)


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
    yield Ground("model", "good" if ratio <= allowed else "stop", text, source)


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


def _of_gap(result: GapResult, source: str) -> Iterator[Ground]:
    which, closures = result.which, result.how_far
    if not result.gap.exists:
        yield Ground("simulation", "good", result.verdict.rstrip("."), source)
    else:
        named = which.pair or which.named
        closed = closures[0] if closures and named else None
        if closed is not None and closed.wrench.G >= WANTED_G and closed.wrench.lo > 0:
            yield Ground("simulation", "risk", _explained(which, named, closed), source)
        else:
            yield Ground("simulation", "stop", result.verdict.rstrip("."), source)
        if not closures:
            text = "how far the gap closes was not tried on any flight"
            yield Ground("simulation", "risk", text, source)
        if closures and (cost := _cost(closures[0])):
            weight = "stop" if _short_margins(closures[0], "after") else "risk"
            yield Ground("next flight", weight, cost, source)
    for name, why in which.withdrawn.items():
        yield Ground("simulation", "risk", f"{name} fits best and is withdrawn: {why}", source)
    for group in which.aliases:
        text = f"these flights cannot tell {', '.join(group)} apart"
        yield Ground("simulation", "risk", text, source)
    for fault in result.sensors:
        text = f"the sensors show {fault.fault} in {fault.channel}: {fault.estimate:.3g} {fault.unit}"
        yield Ground("model", "risk", text, source)


def _explained(which: Which, named: Sequence[str], closure: Closure) -> str:
    """Return what explains a gap, in words, and how much of the gap goes with it."""
    from freqid.simulate.effects import library  # loads jax

    meant = [library()[n].signed_meaning(which.changes(n)) for n in named if n in library()]
    words = f" ({'; '.join(m[:1].lower() + m[1:] for m in meant)})" if meant else ""
    g = closure.wrench
    return (
        f"flights and simulation differ, and {' and '.join(named)} explains it{words}: with that change "
        f"{100 * g.G:.0f} % of the difference disappears ({100 * g.lo:.0f} to {100 * g.hi:.0f} %) on "
        f"{listed(list(map(base_name, closure.held_out)))}. Use the simulation with this change only"
    )


def _cost(closure: Closure) -> str:
    """Return what the effect of a gap does to the margins, in a sentence; empty where no law is known."""
    sentence = str(closure.consequence.get("sentence", "")).rstrip(".")
    least = least_flown(closure)
    if least is None:
        return f"the gap's effect: {sentence}" if sentence else ""
    at, axis, before, after = least
    asked = next(wanted for figure, wanted, _ in MARGINS if figure == "phase_deg")
    where = f"axis {axis} at {at}" if at else f"axis {axis}"
    text = (
        f"with the effect that was found ({' and '.join(closure.effects)}) the control loop keeps "
        f"{after:.1f} deg of phase margin ({where}), {'at least' if after >= asked else 'less than'} the "
        f"{asked:g} deg asked for; the simulation without it has {before:.1f} deg"
    )
    if before < asked:
        text += ", which is too little as well"
    others = [s for s in _short_margins(closure, "after") if "deg" not in s]
    return text + (f"; {listed(others)} asked for, and missed" if others else "")


def least_flown(closure: Closure) -> tuple[str, str, float, float] | None:
    """Return condition and axis of the least phase margin with an effect; the margin without and with it."""
    found = [
        (float(change["after"]), path.split("/")[1], float(change["before"]))
        for path, change in closure.consequence.get("figures", {}).items()
        if path.startswith("margins/") and path.endswith("/phase_deg") and math.isfinite(change["after"])
    ]
    if not found:
        return None
    after, axis, before = min(found)
    return str(closure.consequence.get("reference", "")), axis, before, after


def _short_margins(closure: Closure, when: str) -> list[str]:
    """Return the bounds that margins are below, ``before`` or ``after`` the effect of a gap is added."""
    figures = closure.consequence.get("figures", {})
    return [
        f"{wanted:g} {unit} is"
        for figure, wanted, unit in MARGINS
        if any(
            path.startswith("margins/") and path.endswith(f"/{figure}") and change.get(when, wanted) < wanted
            for path, change in figures.items()
        )
    ]


def said(response: str) -> str:
    """Return a response with what it is, as ``yawing moment N``; its name alone where it is no load."""
    meaning = WRENCH_MEANING.get(response, "")
    return f"{meaning} {response}" if meaning else response


def listed(names: Sequence[str]) -> str:
    """Join names as a sentence does: a, b and c."""
    return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))


def _allowed(response: ResponseModel) -> str:
    """Return what noise allows the model to explain, where that is known."""
    most = response.r2_ceiling
    return "" if most is None else f", where noise allows {100 * most:.1f} %"


def base_name(record: str) -> str:
    """Return the name of a file without its folder."""
    return record.rpartition("/")[2]


def _of_margins(found: LoopMargins, source: str) -> Iterator[Ground]:
    for text in found.warnings:
        weight = "stop" if "is unstable" in text else "risk"
        yield Ground("next flight", weight, text, source)
    for figure, wanted, unit in MARGINS:
        least = least_margin(found, figure)
        if least is None:
            continue
        value, lower, where = least
        text = f"with the identified model the least {figure.split('_')[0]} margin is {value:.1f} {unit}"
        sure = f"; {100 * found.level:.0f} % sure: {lower:.1f} {unit} or more" if math.isfinite(lower) else ""
        text += f" ({where}{sure}); {wanted:g} {unit} is asked for"
        weight = "stop" if value < wanted else "risk" if lower < wanted else "good"
        yield Ground("next flight", weight, text, source)


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
    yield Ground("model", "good" if score.passed else "stop", text, source)
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

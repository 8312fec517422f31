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
from freqid.core.results.diagnosis import Closure
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.review import Ground
from freqid.core.results.judged.sealed_trial import TrialOutcome
from freqid.core.results.loop_margins import LoopMargins, least_of
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel, gate_sentences
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
    model, at = point.model, point.id or source
    missed = gate_sentences(model, gates) if gates is not None else []
    for text in missed:
        yield Ground("model", "stop", f"{at}: {text}", source)
    for response in model.responses.values():
        for group in response.inseparable:
            text = f"{at}: the data cannot separate {', '.join(group)} in {response.response}"
            yield Ground("model", "risk", text, source)
    poor = [r for r in model.responses.values() if not (r.r2 >= GOOD_R2 or r.reaches_ceiling)]
    if poor:
        each = ", ".join(f"{r.response} (R2 {r.r2:.3f})" for r in poor)
        yield Ground("model", "risk", f"{at}: the model explains less than noise allows of {each}", source)
    bent = [r for r in model.responses.values() if r.distortion is not None and not r.distortion <= DISTORTED]
    if bent:
        worst = max(bent, key=lambda r: r.distortion or 0.0)
        text = (
            f"{at}: what is left on the harmonics is more than noise in "
            f"{', '.join(r.response for r in bent)} (most in {worst.response}, {worst.distortion:.3g} "
            "times): intervals hold noise alone"
        )
        yield Ground("model", "risk", text, source)
    ratios = {r: point.validation_ratio(r) for r in model.responses}
    known = {r: v for r, v in ratios.items() if math.isfinite(v)}
    if not known:
        yield Ground("model", "risk", f"{at}: no flight that was not used was predicted", source)
    else:
        worst = max(known, key=lambda r: known[r])
        failed = known[worst] > FAILED_VALIDATION
        weight = "stop" if failed else "good" if known[worst] <= MOST_VALIDATION else "risk"
        text = (
            f"{at}: a flight that was not used is predicted with at most {known[worst]:.3g} times the error "
            f"of the fit ({worst})"
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
            "no condition was held out: between conditions the global model is not judged",
            source,
        )
        return
    worst = max(ratios, key=lambda at: ratios[at][0] / ratios[at][1])
    ratio, allowed = ratios[worst]
    text = (
        f"at conditions that it was not made from the global model errs at most {ratio:.3g} times as much as "
        f"a point model there ({worst[0]} at {worst[1]}; {allowed:g} is allowed)"
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
            yield Ground(
                "simulation",
                "risk",
                f"the simulation differs by {' and '.join(named)}; with it {100 * closed.wrench.G:.0f} % "
                f"of the gap ({100 * closed.wrench.lo:.0f} to {100 * closed.wrench.hi:.0f} %) is closed on "
                f"{', '.join(map(base_name, closed.held_out))}: use it with this effect only",
                source,
            )
        else:
            yield Ground("simulation", "stop", result.verdict.rstrip("."), source)
        if not closures:
            text = "how far the gap closes was not tried on any flight"
            yield Ground("simulation", "risk", text, source)
        cost = str(closures[0].consequence.get("sentence", "")) if closures else ""
        if cost:
            short = _short_margins(closures[0], "after")
            weight = "stop" if short else "risk"
            asked = f"; {' and '.join(short)} asked for" if short else ""
            asked += "; without the effect it is less too" if _short_margins(closures[0], "before") else ""
            yield Ground("next flight", weight, f"the gap's effect: {cost.rstrip('.')}{asked}", source)
    for name, why in which.withdrawn.items():
        yield Ground("simulation", "risk", f"{name} fits best and is withdrawn: {why}", source)
    for group in which.aliases:
        text = f"these flights cannot tell {', '.join(group)} apart"
        yield Ground("simulation", "risk", text, source)
    for fault in result.sensors:
        text = f"the sensors show {fault.fault} in {fault.channel}: {fault.estimate:.3g} {fault.unit}"
        yield Ground("model", "risk", text, source)


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
        text = f"least {figure.split('_')[0]} margin {value:.3g} {unit}"
        text += f", not below {lower:.3g} {unit} at {100 * found.level:.0f} %" if math.isfinite(lower) else ""
        text += f" ({where}); {wanted:g} {unit} is asked for"
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
        f"of what was predicted before the flight, the 95 % bands hold {shares}; {100 * score.gate:.0f} % is "
        "asked for"
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

"""Page one of a report: use or do not use, for which envelope, open risks, what would overturn it."""

from __future__ import annotations

import math
from typing import Any, Literal

from markupsafe import Markup

from freqid.core.channels import WRENCH_MEANING
from freqid.core.results.judged.review import Answer, Decision, Ground, Review, Trust
from freqid.core.results.judged.truth import BEYOND
from freqid.report.kit.findings import Finding, code, finding
from freqid.report.kit.notation import (
    NONE,
    exact,
    meaning,
    number,
    percent,
    pretty_unit,
    sentence,
    short,
    shown_unit,
    tenths,
)
from freqid.report.review.points import band_text, left_to_noise_text, reasons_text

_SAID = {
    "model": {
        "use": "Use the model",
        "use with limits": "Use the model within the limits below",
        "do not use": "Do not use the model",
        "not decided": "No answer on a model",
    },
    "simulation": {
        "use": "Use the simulation",
        "use with limits": "Use the simulation within the limits below",
        "do not use": "Do not use the simulation as it is",
        "not decided": "No answer on a simulation",
    },
    "next flight": {
        "use": "The next flight is cleared by the margins",
        "use with limits": "The next flight is cleared within the limits below",
        "do not use": "The next flight is not cleared",
        "not decided": "No answer on the next flight",
    },
}
_KINDS: dict[Answer, Literal["good", "note", "bad"]] = {
    "use": "good",
    "use with limits": "note",
    "do not use": "bad",
    "not decided": "note",
}
_LABELS: dict[Answer, str] = {
    "use": "Yes",
    "use with limits": "With limits",
    "do not use": "No",
    "not decided": "Open",
}
_ROLES = ("System identification", "Flight test", "Control laws", "Approval")
_KIND_TEXTS = {
    "freqid-loop-margins": "margins",
    "freqid-trial": "sealed trial",
    "freqid-rivals": "comparison",
}
_BEYOND_BOUND = {"stop": "forbids use", "risk": "a risk", "good": "no gap is called"}
_MOST_RISKS = 12  # listed before the rest is folded


def decision_findings(review: Review) -> list[Finding]:
    """Return the answers as sentences, the ground that decided each behind it; then what fits worst."""
    answers = [
        Finding(
            _KINDS[d.answer],
            Markup("<strong>{}.</strong> {}.").format(_SAID[d.subject][d.answer], _because(d)),
            _LABELS[d.answer],
        )
        for d in review.decisions
    ]
    return [*answers, *_worst_fit(review), *_trust(review)]


def _because(decision: Decision) -> str:
    return sentence(decision.because.rstrip("."))


def _worst_fit(review: Review) -> list[Finding]:
    """Return which response fits worst and where, in words."""
    worst = review.worst_fit
    if worst is None:
        return []
    words = meaning(worst.response, "force")
    allowed = (
        f"; sensor noise would let it explain {percent(worst.r2_ceiling)}"
        if math.isfinite(worst.r2_ceiling)
        else ""
    )
    where = ""
    if math.isfinite(worst.low_hz):
        where = band_text(worst.low_hz, worst.high_hz, worst.over_noise, worst.share)
    return [
        finding(
            "note",
            "Of all responses the model fits {} at {} worst: it explains {} of what was measured{}.{}",
            Markup("the {} <i>{}</i>").format(words, worst.response) if words else code(worst.response),
            code(worst.at),
            percent(max(worst.r2, 0.0)),
            allowed,
            where,
        )
    ]


def _trust(review: Review) -> list[Finding]:
    """Return how many parameters cannot be trusted, and where they are listed."""
    trust = review.trust
    if trust is None:
        return []
    if not trust.doubtful:
        return [finding("good", "All {} parameters can be read as numbers.", trust.parameters)]
    return [
        finding(
            "note",
            "{} of {} parameters cannot be read as numbers: {}.{} {} of the {} matter for their response. "
            '<a href="#points">Point models</a> lists each with its reason.',
            trust.doubtful,
            trust.parameters,
            reasons_text(trust.reasons),
            _off_text(trust),
            trust.matter,
            trust.doubtful,
        )
    ]


def _off_text(trust: Trust) -> str:
    """Return what the parameters that are off the simulation's truth are off, so that the counts add up."""
    if not trust.missing:
        return left_to_noise_text(trust.by_noise)
    return (
        f" Off the simulation's truth by more than {BEYOND:g}σ"
        + (", and without what noise adds too," if trust.by_noise else "")
        + f" are {trust.missing}: {trust.off_linear} off its linearisation, {trust.off_noise_free} "
        f"off the estimate from the same flight without noise, {trust.off_both} off both."
        + left_to_noise_text(trust.by_noise)
    )


def decision_values(review: Review) -> dict[str, Any]:
    """Return what the template shows below the answers."""
    risks = [_row(g) for g in review.risks]
    return {
        "risks": risks[:_MOST_RISKS],
        "more_risks": risks[_MOST_RISKS:],
        "grounds": [_row(g) for g in review.grounds if g.weight == "good"],
        "reversals": [
            {
                "text": r.text,
                "subject": r.subject,
                "now": _with_unit(r.now, r.unit),
                "bound": Markup("{} {}").format(r.side, _with_unit(r.bound, r.unit)),
                "room": Markup("{} {}").format(
                    _with_unit(abs(r.room), r.unit), "to spare" if r.room >= 0 else "beyond"
                ),
                "beyond": r.room < 0,
                "weight": _BEYOND_BOUND[r.weight],
                "where": r.where,
            }
            for r in review.reversals
        ],
        "uses": [{"label": u.label, "text": sentence(u.text)} for u in review.uses],
        "model_use": next((d.answer for d in review.decisions if d.subject == "model"), ""),
        "rules": review.rules,
        "envelope": [_limit(side.name, side.unit, side.low, side.high) for side in review.envelope],
        "conditions": review.conditions,
        "loops": [
            {
                "at": r.at,
                "axis": r.axis,
                "model": exact(r.model, tenths(r.model)),
                "interval": f"{tenths(r.lower)} to {tenths(r.upper)}" if math.isfinite(r.lower) else NONE,
                "interpolated": bool(review.conditions)
                and r.at not in review.conditions
                and math.isfinite(r.model),
                "simulation": exact(r.simulation, tenths(r.simulation)),
                "flown": exact(r.flown, tenths(r.flown)),
            }
            for r in review.loops
        ],
        "flown": any(math.isfinite(r.flown) for r in review.loops),
        "loops_text": review.loops_text,
        "terms": _terms(review),
        "against": review.against,
        "compared": review.compared,
        "changes": [
            {
                "what": c.what,
                "before": c.before,
                "after": c.after,
                "sigmas": number(c.sigmas, 2) if math.isfinite(c.sigmas) else NONE,
            }
            for c in review.changes
        ],
        "roles": _ROLES,
        "sources": [
            {
                "name": s.name,
                "kind": kind_text(s.kind),
                "sha256": s.sha256,
                "version": s.freqid_version or NONE,
                "created": s.created or NONE,
                "scenario": s.scenario_sha256[:12] or NONE,
            }
            for s in review.sources
        ],
    }


_TERMS = (
    ("phase margin", "How much later, as an angle, the control loop may react before it swings by itself."),
    ("gain margin", "How much stronger, in dB, the control loop may react before it swings by itself."),
    (
        "gap",
        "What simulation and flights differ by, beyond noise and the tolerances that the simulation states.",
    ),
    ("interval", "Range that holds the true value in the stated share of cases, as far as noise goes."),
    (
        "cost J",
        "How unlike two frequency responses are, in gain and phase: 0 is alike, below 50 is hard to tell "
        "from flight, up to 100 is acceptable (Tischler & Remple).",
    ),
    ("closed", "What of the gap disappears when the simulation has the effect that was named."),
)


def _terms(review: Review) -> list[tuple[str, str]]:
    """Return the words of page one that a reader from another field may not know, and what they mean."""
    texts = " ".join([*(d.because for d in review.decisions), *(g.text for g in review.grounds)])
    terms = [(word, said) for word, said in _TERMS if word in texts]
    loads = {n: w for n, w in WRENCH_MEANING.items() if f"{w} {n}" in texts or f"axis {n}" in texts}
    if loads:
        listing = "; ".join(f"{n} {w}" for n, w in loads.items())
        terms.insert(
            0, (", ".join(loads), f"Loads on the aircraft along and about its body axes: {listing}.")
        )
    return terms


def kind_text(kind: str) -> str:
    """Return what a file is, in words, from its format: ``freqid-loop-margins``."""
    return _KIND_TEXTS.get(kind, kind.removeprefix("freqid-").replace("-", " "))


def _row(ground: Ground) -> dict[str, Any]:
    return {
        "kind": {"stop": "bad", "risk": "note", "good": "good"}[ground.weight],
        "subject": ground.subject,
        "text": sentence(ground.text),
        "source": ground.source,
    }


def _limit(name: str, unit: str, low: float, high: float) -> dict[str, Any]:
    shown, factor = shown_unit(f"state/{name}", unit)
    ends = [short(float(f"{factor * end:.3g}")) for end in (low, high)]
    return {
        "name": name,
        "text": ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}",
        "unit": pretty_unit(shown),
    }


def _with_unit(value: float, unit: str) -> Markup:
    return Markup("{}{}").format(number(value), "" if unit == "1" else f" {pretty_unit(unit)}")

"""Page one of a report: use or do not use, for which envelope, open risks, what would overturn it."""

from __future__ import annotations

import math
from typing import Any, Literal

from markupsafe import Markup

from freqid.core.results.judged.review import Answer, Decision, Ground, Review
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import NONE, number, pretty_unit, short, shown_unit

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
_ROLES = ("System identification", "Flight test", "Control laws", "Approval")
_MOST_RISKS = 12  # listed before the rest is folded


def decision_findings(review: Review) -> list[Finding]:
    """Return the answers as sentences, the ground that decided each behind it."""
    return [
        finding(_KINDS[d.answer], "{}: {}.", _SAID[d.subject][d.answer], _plain(d)) for d in review.decisions
    ]


def _plain(decision: Decision) -> str:
    return decision.because.rstrip(".")


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
                "now": _with_unit(r.now, r.unit),
                "bound": _with_unit(r.bound, r.unit),
                "where": r.where,
            }
            for r in review.reversals
        ],
        "envelope": [_limit(side.name, side.unit, side.low, side.high) for side in review.envelope],
        "conditions": review.conditions,
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
                "kind": s.kind.removeprefix("freqid-"),
                "sha256": s.sha256,
                "version": s.freqid_version or NONE,
                "created": s.created or NONE,
                "scenario": s.scenario_sha256[:12] or NONE,
            }
            for s in review.sources
        ],
    }


def _row(ground: Ground) -> dict[str, Any]:
    return {
        "kind": {"stop": "bad", "risk": "note", "good": "good"}[ground.weight],
        "subject": ground.subject,
        "text": _sentence(ground.text),
        "source": ground.source,
    }


def _sentence(text: str) -> str:
    """Return a ground as a sentence begins; an id that leads it stays as it is written."""
    return text if text.partition(" ")[0].endswith(":") else text[:1].upper() + text[1:]


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

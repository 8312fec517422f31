"""One self-contained page about several results: page one, then the parts in the order of a campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from freqid import __version__
from freqid.core.results.judged.review import Review
from freqid.report.kit.notation import sentence
from freqid.report.kit.rendering import Part, Sheet, render
from freqid.report.review.decision import decision_findings, decision_values, kind_text

SECTIONS = {
    "vehicle": "Vehicle and envelope",
    "excitation": "Excitation and test card",
    "data": "Data quality",
    "points": "Point models",
    "convergence": "Study and convergence",
    "global": "Global model",
    "responses": "Frequency responses",
    "flights": "Predictions and flights",
    "margins": "Margins",
    "gap": "Gap between simulation and flight",
}
"""Titles of the sections, in their order."""
_LACKS = {
    "excitation": "design of the excitation",
    "data": "quick look at a flight",
    "points": "point model",
    "convergence": "study, which follows the parameters over the length of a flight",
    "global": "global model",
    "responses": "frequency response",
    "flights": "prediction that a flight was held against",
    "margins": "margin of the control law",
    "gap": "diagnosis of a gap",
}


@dataclass(frozen=True, eq=False)
class Piece:
    """What one file adds to a report.

    Attributes
    ----------
    section : str
        Of `SECTIONS`.
    name : str
        Of the file, or what its contents list it as.
    sheet : Sheet
    """

    section: str
    name: str
    sheet: Sheet


def build_review_page(
    review: Review, pieces: Sequence[Piece], vehicle: Mapping[str, Any], notes: Mapping[str, str]
) -> Sheet:
    """Return the page of several results: one HTML text that fetches nothing.

    Parameters
    ----------
    review : Review
    pieces : sequence of Piece
    vehicle : mapping
        Of `freqid.report.review.vehicle.vehicle_values`.
    notes : mapping of str to str
        By section: a sentence about what is not there, such as a study that is half done.
    """
    parts = [
        (piece, piece.sheet.part(f"{piece.section}-{k}"), f"{piece.section}-{k}")
        for k, piece in enumerate(pieces)
    ]
    return render(
        "review.html",
        title=review.vehicle or "Unnamed vehicle",
        what="Decision first, then what it rests on.",
        version=__version__,
        findings=decision_findings(review),
        facts=_facts(review),
        decision=decision_values(review),
        vehicle=vehicle,
        vehicle_text=[sentence(text) for text in review.vehicle_text],
        rules=_rules([part for _, part, _ in parts]),
        sections=[
            {
                "key": key,
                "title": title,
                "parts": [
                    {"anchor": anchor, "name": piece.name, "body": part.body, "contents": part.contents}
                    for piece, part, anchor in parts
                    if piece.section == key
                ],
                "note": notes.get(key, ""),
                "lacks": _LACKS.get(key, "") if key in review.missing else "",
                "command": review.missing.get(key, ""),
            }
            for key, title in SECTIONS.items()
        ],
        provenance={},
    )


def _facts(review: Review) -> list[tuple[str, str]]:
    facts = [("Conditions", ", ".join(review.conditions) or "none")]
    counts: dict[str, int] = {}
    for source in review.sources:
        kind = kind_text(source.kind)
        counts[kind] = counts.get(kind, 0) + 1
    facts.append(("Files", ", ".join(f"{n} {kind}" for kind, n in counts.items())))
    stops = sum(g.weight == "stop" for g in review.grounds)
    facts.append(("Reasons", f"{stops} against use, {len(review.risks) - stops} open risks"))
    trials = {s.name for s in review.sources if s.kind == "freqid-trial"}
    facts += [("Sealed trial", g.text.partition(":")[0]) for g in review.grounds if g.source in trials]
    if review.against:
        facts.append(("Compared with", review.against))
    return facts


def _rules(parts: Sequence[Part]) -> list[Any]:
    return list(dict.fromkeys(part.style for part in parts if part.style))

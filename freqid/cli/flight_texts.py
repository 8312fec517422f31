"""A simulated flight as the terminal shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from freqid.simulate.truth import truth_path
from freqid.workflows.fly import SimulatedManeuver


def files_of(record: Path, *, page: bool) -> list[Path]:
    """Return the files of a flight: record, truth, and the page where it is drawn."""
    return [record, truth_path(record), *([record.with_suffix(".html")] if page else [])]


def flight_result(found: SimulatedManeuver, destination: Path) -> dict[str, Any]:
    """Return what is worth knowing of a flight."""
    return {
        "record": str(destination),
        "truth": str(truth_path(destination)),
        "reference": found.truth.reference,
        "duration_s": found.truth.duration,
        "excursions": found.excursions,
    }


def flight_text(result: dict[str, Any]) -> str:
    """Return a flight and its excursions."""
    lines = [
        f"{result['record']}: {result['duration_s']:g} s from {result['reference']}; "
        f"the truth is in {result['truth']}",
        "largest excursions from the start:",
    ]
    for name, found in result["excursions"].items():
        limit = ""
        if "limit" in found:
            limit = f"  of {found['limit']:g}" + ("" if found["inside"] else "  BEYOND THE ABORT LIMIT")
        lines.append(f"  {name:6s}{found['largest']:9.3g} {found['unit']:6s}{limit}")
    return "\n".join(lines)

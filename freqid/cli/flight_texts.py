"""A simulated flight as the terminal shows it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from freqid.simulate.truth import truth_path
from freqid.workflows.fly import SimulatedManeuver
from freqid.workflows.fly_trim_sequence import trims_flown


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


def campaign_result(found: SimulatedManeuver, destination: Path) -> dict[str, Any]:
    """Return where a campaign went, trim by trim."""
    trims = trims_flown(found)
    alone = (
        "one trim shows nothing of how derivatives depend on the advance ratio: add [[campaign.trim]] entries"
    )
    return {
        "record": str(destination),
        "truth": str(truth_path(destination)),
        "duration_s": found.truth.duration,
        "trims": [
            {
                "span_s": list(at.span_s),
                "V": at.speed,
                "climb": at.climb,
                "alpha": at.alpha,
                "J": at.advance_ratio if np.isfinite(at.advance_ratio) else None,
            }
            for at in trims
        ],
        "remarks": [alone] if len(trims) == 1 else [],
    }


def campaign_text(result: dict[str, Any]) -> str:
    """Return the trims of a campaign as a table."""
    lines = [
        f"{result['record']}: {result['duration_s']:g} s, {len(result['trims'])} trims; "
        f"the truth is in {result['truth']}",
        "means over each manoeuvre:",
        f"{'from s':>9s}{'to s':>9s}{'V m/s':>8s}{'climb deg':>11s}{'alpha deg':>11s}{'J':>9s}",
    ]
    for at in result["trims"]:
        ratio = "stopped" if at["J"] is None else f"{at['J']:.3f}"
        lines.append(
            f"{at['span_s'][0]:9.1f}{at['span_s'][1]:9.1f}{at['V']:8.2f}{np.degrees(at['climb']):11.2f}"
            f"{np.degrees(at['alpha']):11.2f}{ratio:>9s}"
        )
    lines += result["remarks"]
    return "\n".join(lines)

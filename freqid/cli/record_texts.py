"""Imported records as the terminal shows them."""

from __future__ import annotations

import glob
from collections.abc import Collection, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from freqid.core.record import FlightRecord
from freqid.flightlog.listing import Listing

# What reading did to the samples, from the provenance.
_TOLD = ("dropouts", "whole_spans_s", "spikes", "excitation_aligned", "not_logged")


def records_result(records: Mapping[Path, FlightRecord]) -> dict[str, Any]:
    """Return records by file, for machines."""
    return {
        "records": [
            {
                "path": str(path),
                "start_s": float(record.time[0]),
                "duration_s": record.duration,
                "rate_hz": 1 / record.dt,
                "samples": record.time.size,
                "plausibility": record.provenance.get("plausibility"),
                **{name: record.provenance[name] for name in _TOLD if name in record.provenance},
                "channels": {n: {"units": c.unit, "source": c.source} for n, c in record.channels.items()},
            }
            for path, record in records.items()
        ]
    }


def records_text(records: Mapping[Path, FlightRecord]) -> str:
    """Return one line for each record, and what was left out of it or added to it."""
    lines = []
    for path, record in records.items():
        lines.append(
            f"{path}: {len(record.channels)} channels, {record.duration:.6g} s at {1 / record.dt:.6g} Hz"
        )
        jitter = record.provenance.get("resampled", {}).get("jitter_s", {})
        if jitter and max(jitter.values()) > 0:
            worst = max(jitter, key=lambda name: jitter[name])
            lines.append(f"  jitter up to {1e3 * jitter[worst]:.2g} ms ({worst})")
        for name, count in record.provenance.get("spikes", {}).items():
            lines.append(f"  {name}: {count} spike{'s' if count > 1 else ''} left out")
        aligned = record.provenance.get("excitation_aligned")
        if aligned:
            lines.append(
                f"  excitation from {aligned['start_s']:.4f} s +- {2e3 * aligned['start_std_s']:.2g} ms, "
                f"clock {aligned['drift_ppm']:+.3g} ppm +- {2 * aligned['drift_std_ppm']:.2g}, found in "
                + ", ".join(aligned["found_in"].values())
            )
    return "\n".join(lines)


def dropouts_text(record: FlightRecord, *, split: bool) -> str:
    """Return what drops out of a log and which part of it is kept; empty where nothing does."""
    dropouts = record.provenance.get("dropouts", [])
    if not dropouts:
        return ""
    worst = max(dropouts, key=lambda d: d["stop_s"] - d["start_s"])
    length = worst["stop_s"] - worst["start_s"]
    spans = record.provenance["whole_spans_s"]
    times = ", ".join(f"{start:.6g}:{stop:.6g} s" for start, stop in spans[:6])
    more = "" if split or len(spans) < 2 else "; the longest is kept, --split keeps all"
    return (
        f"{len(dropouts)} dropout{'s' if len(dropouts) > 1 else ''}, the longest {length:.4g} s of "
        f"{worst['channel']} after {worst['start_s']:.6g} s: whole are {times}{more}."
    )


def earlier_pieces(destination: Path, written: Collection[Path]) -> list[str]:
    """Return a sentence for each file that is named as a piece of this log and was not written now."""
    others = destination.parent.glob(f"{glob.escape(destination.stem)}-*{destination.suffix}")
    old = (p for p in sorted(others) if p.stem.removeprefix(f"{destination.stem}-").isdigit())
    return [
        f"{p} is older: it is no manoeuvre of this log as it is cut now." for p in old if p not in written
    ]


def plausibility_sentences(record: FlightRecord) -> list[str]:
    """Return what the plausibility checks said of a record, a sentence each."""
    findings = record.provenance.get("plausibility", {}).get("findings", [])
    return [f"{f['severity']}: {f['message']}; {f['setting']}." for f in findings]


def listing_result(listing: Listing) -> dict[str, Any]:
    """Return the channels of a log, for machines; figures that do not exist are null."""
    return {
        "path": str(listing.path),
        "channels": [
            {
                "name": c.name,
                "unit": c.unit,
                "samples": c.samples,
                "rate_hz": c.rate_hz if isfinite(c.rate_hz) else None,
                "jitter_s": c.jitter_s if isfinite(c.jitter_s) else None,
                "gaps_s": [list(gap) for gap in c.gaps],
                "low": c.low if isfinite(c.low) else None,
                "high": c.high if isfinite(c.high) else None,
            }
            for c in listing.channels
        ],
        "map": listing.map,
    }

"""Imported records as the terminal shows them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from freqid.core.record import FlightRecord


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
                "channels": {n: {"units": c.unit, "source": c.source} for n, c in record.channels.items()},
            }
            for path, record in records.items()
        ]
    }


def records_text(records: Mapping[Path, FlightRecord]) -> str:
    """Return one line for each record."""
    return "\n".join(
        f"{path}: {len(record.channels)} channels, {record.duration:.6g} s at {1 / record.dt:.6g} Hz"
        for path, record in records.items()
    )


def plausibility_sentences(record: FlightRecord) -> list[str]:
    """Return what the plausibility checks said of a record, a sentence each."""
    findings = record.provenance.get("plausibility", {}).get("findings", [])
    return [f"{f['severity']}: {f['message']}; {f['setting']}." for f in findings]

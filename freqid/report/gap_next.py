"""What to do next, for a page about a gap."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from freqid.report.notation import number


def next_rows(table: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the proposed tests, the best first; see ``next_flight`` of `GapDiagnosis`."""
    return [
        {
            "kind": test["kind"],
            "name": test["name"],
            "how": test["how"] + _with(test),
            "pairs": [
                {
                    "rivals": " / ".join(p["rivals"]),
                    "now": number(p["now"], 2),
                    "after": number(p["after"], 3),
                }
                for p in test["pairs"]
            ],
        }
        for test in table.get("tests", ())
    ]


def _with(test: Mapping[str, Any]) -> str:
    if test["kind"] == "ground":
        return f" ({test['instrument']})"
    return f" (predicted by {test['predicted_by']})"

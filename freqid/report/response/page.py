"""One self-contained page about frequency responses."""

from __future__ import annotations

from typing import Any

import numpy as np

from freqid import __version__
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import percent, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render
from freqid.report.response.bode import BELIEVED, LEVEL, bode

MOST_PICTURES = 24  # with the highest coherence: more make a page that nobody reads
SMOOTH = 2.0  # misfit from which a response is not linear, or not smooth across its windows


def build_frequency_response_page(response: FrequencyResponse, title: str) -> str:
    """Return the page of frequency responses: one HTML text that fetches nothing."""
    f = response.frequencies_hz
    rows = summary_rows(response)
    return render(
        "frequency_response.html",
        title=title or "Frequency responses",
        what=f"Responses of {', '.join(response.outputs)} to {', '.join(response.inputs)}.",
        version=__version__,
        findings=_findings(response, rows),
        facts=[
            ("Method", response.method),
            ("Frequencies", f"{f.size}, {short(float(f[0]))} to {short(float(f[-1]))} Hz"),
        ],
        rows=[_written(row) for row in rows],
        drawn=_pictures(response, rows),
        provenance=response.provenance,
    )


def summary_rows(response: FrequencyResponse) -> list[dict[str, Any]]:
    """Return coherence, random error and misfit of each pair over the frequencies at which it is known."""
    rows = []
    for o, output in enumerate(response.outputs):
        for i, input_ in enumerate(response.inputs):
            known = np.isfinite(response.value[o, i])
            coherence = response.coherence[o, i][known]
            if not coherence.size:
                continue
            misfit = response.misfit[o][known]
            rows.append(
                {
                    "output": output,
                    "input": input_,
                    "lines": int(known.sum()),
                    "coherence": float(np.median(coherence)),
                    "lowest": float(coherence.min()),
                    "error": float(np.median(response.random_error[o, i][known])),
                    "misfit": None if np.isnan(misfit).all() else float(np.nanmedian(misfit)),
                }
            )
    return rows


def _findings(response: FrequencyResponse, rows: list[dict[str, Any]]) -> list[Finding]:
    doubtful = [r for r in rows if r["coherence"] < BELIEVED]
    text = "{} of {} responses have a median coherence below {}."
    kind = "note" if doubtful else "good"
    said = [finding(kind, text, len(doubtful) or "None", len(rows), BELIEVED)]
    rough = sorted({r["output"] for r in rows if (r["misfit"] or 0.0) > SMOOTH})
    if rough:
        said.append(
            finding(
                "note",
                "More is left on excited lines than noise explains, in {}: not linear, or not smooth across "
                "the windows. Their random errors are too small.",
                ", ".join(rough),
            )
        )
    said += [finding("note", "{}", remark) for remark in response.remarks]
    return said


def _pictures(response: FrequencyResponse, rows: list[dict[str, Any]]) -> list[Picture]:
    shown = sorted(rows, key=lambda r: -r["coherence"])[:MOST_PICTURES]
    drawn = []
    for row in (r for r in rows if r in shown):
        output, input_ = row["output"], row["input"]
        drawn.append(
            picture(
                bode(response, output, input_),
                f"bode{len(drawn)}",
                f"Bode plot with coherence: {output} to {input_}",
                f"{output} to {input_}. Band: {percent(LEVEL)} of the random error, smoothing not counted. "
                f"Grey line: a coherence of {BELIEVED}, below which a response is doubtful.",
            )
        )
    return drawn


def _written(row: dict[str, Any]) -> dict[str, Any]:
    misfit = row["misfit"]
    return row | {
        "doubtful": row["coherence"] < BELIEVED,
        "coherence": f"{row['coherence']:.2f}",
        "lowest": f"{row['lowest']:.2f}",
        "error": percent(row["error"]),
        "misfit": "–" if misfit is None else f"{misfit:.2f}",
    }

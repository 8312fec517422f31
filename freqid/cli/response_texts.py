"""Frequency responses as the terminal shows them."""

from __future__ import annotations

from math import isfinite
from typing import Any

from freqid.core.results.frequency_response import FrequencyResponse
from freqid.report.response.page import summary_rows


def response_result(response: FrequencyResponse) -> dict[str, Any]:
    """Return frequency responses for machines."""

    def plain(values: Any) -> list[float | None]:
        return [float(v) if isfinite(v) else None for v in values]

    pairs = {}
    for o, output in enumerate(response.outputs):
        pairs[output] = {
            input_: {
                "real": plain(response.value[o, i].real),
                "imag": plain(response.value[o, i].imag),
                "std_error": plain(response.std_error[o, i]),
                "random_error": plain(response.random_error[o, i]),
                "coherence": plain(response.coherence[o, i]),
                "partial_coherence": plain(response.partial_coherence[o, i]),
                "units": f"{response.output_units[o]} per {response.input_units[i]}",
            }
            for i, input_ in enumerate(response.inputs)
        } | {"misfit": plain(response.misfit[o])}
    return {
        "method": response.method,
        "frequencies_hz": response.frequencies_hz.tolist(),
        "responses": pairs,
        "remarks": list(response.remarks),
    }


def response_table(response: FrequencyResponse) -> str:
    """Return one line for each pair."""
    lines = ["output    input     lines  coherence (lowest)  random error  misfit"]
    for row in summary_rows(response):
        misfit = "-" if row["misfit"] is None else f"{row['misfit']:.2f}"
        lines.append(
            f"{row['output']:<10}{row['input']:<10}{row['lines']:>5}  {row['coherence']:>9.3f} "
            f"({row['lowest']:.3f}) {100 * row['error']:>13.2f} %  {misfit:>6}"
        )
    return "\n".join(lines)

"""Frequency responses as the terminal shows them."""

from __future__ import annotations

from math import isfinite
from typing import Any

from freqid.core.results.frequency_response import FrequencyResponse
from freqid.report.response.page import SMOOTH, summary_rows


def response_result(response: FrequencyResponse) -> dict[str, Any]:
    """Return frequency responses for machines."""

    def plain(values: Any) -> list[float | None]:
        return [float(v) if isfinite(v) else None for v in values]

    pairs: dict[str, dict[str, Any]] = {}
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
        "compared": {
            c.name: {
                "source": c.source,
                "J": _by_pair(response, c.cost),
                "unnoticed": _by_pair(response, c.unnoticed),
            }
            for c in response.compared
        },
        "fits": [
            {
                "name": x.name,
                "band_hz": list(x.band_hz),
                "J": x.cost if isfinite(x.cost) else None,
                "weighted_error": x.weighted_error,
                "parameters": {
                    name: {
                        "estimate": float(x.estimate[k]),
                        "cramer_rao": float(x.cramer_rao[k]),
                        "insensitivity": float(x.insensitivity[k]),
                        "unit": unit,
                    }
                    for k, (name, unit) in enumerate(zip(x.parameters, x.units, strict=True))
                },
            }
            for x in response.fits
        ],
    }


def _by_pair(response: FrequencyResponse, values: Any) -> dict[str, dict[str, float | None]]:
    return {
        output: {
            input_: float(values[o, i]) if isfinite(values[o, i]) else None
            for i, input_ in enumerate(response.inputs)
        }
        for o, output in enumerate(response.outputs)
    }


def response_table(response: FrequencyResponse) -> str:
    """Return one line for each pair."""
    lines = ["output    input     lines  coherence (lowest)  random error  misfit"]
    rows = summary_rows(response)
    for row in rows:
        misfit = "-" if row["misfit"] is None else f"{row['misfit']:.2f}"
        lines.append(
            f"{row['output']:<10}{row['input']:<10}{row['lines']:>5}  {row['coherence']:>9.3f} "
            f"({row['lowest']:.3f}) {100 * row['error']:>13.2f} %  {misfit:>6}"
        )
    rough = sorted({row["output"] for row in rows if (row["misfit"] or 0.0) > SMOOTH})
    if rough:
        lines.append(
            f"{' '.join(rough)}: more is left on excited lines than noise explains (misfit over {SMOOTH:g}), "
            "so random errors are too small; add --poles 2, or fly fewer inputs at a time or a longer period"
        )
    for c in response.compared:
        lines.append(f"{c.name} ({c.source})    J    inside MUAD bounds")
        for output, row in _by_pair(response, c.cost).items():
            for input_, cost in row.items():
                if cost is not None:
                    share = c.unnoticed[response.outputs.index(output), response.inputs.index(input_)]
                    inside = f"{100 * share:.0f} %" if isfinite(share) else "-"
                    lines.append(f"{output:<10}{input_:<10}{cost:>8.1f}  {inside:>6}")
    for x in response.fits:
        lines.append(f"{x.name}: J {x.cost:.3g}")
        lines.append("parameter     estimate  Cramer-Rao  insensitivity")
        for k, name in enumerate(x.parameters):
            lines.append(
                f"{name:<10}{x.estimate[k]:>12.4g}{x.cramer_rao[k]:>12.2g}{x.insensitivity[k]:>15.2g}"
                f" {x.units[k]}".rstrip()
            )
    return "\n".join(lines)

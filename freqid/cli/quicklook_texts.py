"""A quick look as the terminal shows it."""

from __future__ import annotations

import math
from typing import Any

from freqid.core.results.quicklook import Quicklook

_WORST = 8  # parameters in the text


def quicklook_result(look: Quicklook) -> dict[str, Any]:
    """Return a quick look for machines; what is not known is null."""
    return {
        "verdict": look.verdict,
        "reasons": list(look.reasons),
        "remarks": list(look.remarks),
        "start_s": _known(look.start_s),
        "likeness": look.likeness,
        "inputs": {
            i.name: {
                "present": i.present,
                "source": i.source,
                "coherence": i.coherence,
                "gain": i.gain,
                "found_on": i.found_on,
                "periods": i.periods,
                "achieved_gain": _known(i.achieved_gain),
                "achieved_lag_s": _known(i.achieved_lag_s),
                "achieved_coherence": _known(i.achieved_coherence),
                "at_limit": _known(i.at_limit),
                "at_rate_limit": _known(i.at_rate_limit),
            }
            for i in look.inputs
        },
        "rates_hz": {r.channel: r.rate_hz for r in look.rates},
        "accuracy": look.accuracy,
        "parameters": [
            {
                "response": p.response,
                "parameter": p.name,
                "unit": p.unit,
                "estimate": p.estimate,
                "std_error": p.std_error,
                "contribution_error": _known(p.contribution_error),
                "met": p.met,
            }
            for p in look.parameters
        ],
        "plausibility": dict(look.plausibility),
    }


def quicklook_text(look: Quicklook) -> str:
    """Return a quick look for people."""
    lines = [look.sentence[:1].upper() + look.sentence[1:]]
    if math.isfinite(look.start_s):
        lines.append(f"The design starts at {look.start_s:.3f} s on the log's clock.")
    lines.append("")
    lines.append(
        f"{'input':<12}{'found':>8}{'of design':>11}{'achieved':>10}{'lag ms':>8}{'limit':>8}{'rate':>8}"
    )
    lines += [
        f"{i.name:<12}{i.coherence:>8.3f}{i.gain:>11.3f}{_plain(i.achieved_gain, '.3f'):>10}"
        f"{_plain(1e3 * i.achieved_lag_s, '.0f'):>8}{_plain(100 * i.at_limit, '.1f', ' %'):>8}"
        f"{_plain(100 * i.at_rate_limit, '.1f', ' %'):>8}"
        for i in look.inputs
    ]
    rates = sorted({round(r.rate_hz, 3) for r in look.rates})
    lines += ["", f"Rates of the log: {', '.join(f'{rate:g}' for rate in rates)} Hz."]
    if look.parameters:
        met = sum(p.met for p in look.parameters)
        lines.append(f"Parameters that met {look.accuracy:.0%}: {met} of {len(look.parameters)}.")
        worst = sorted(look.parameters, key=lambda p: (p.met, -p.contribution_error))[:_WORST]
        lines += [
            f"  {p.response} by {p.name:<8}{p.estimate:>12.4g} +- {p.std_error:<10.2g} {p.unit}"
            f"{'' if p.met else '  not met'}"
            for p in worst
            if not p.met
        ]
    lines += [f"note: {remark}." for remark in look.remarks]
    return "\n".join(lines)


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _plain(value: float, form: str, unit: str = "") -> str:
    return f"{value:{form}}{unit}" if math.isfinite(value) else "-"

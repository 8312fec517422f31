"""Margins as the terminal shows them."""

from __future__ import annotations

from math import isfinite, isnan
from typing import Any

from freqid.core.results.loop_margins import LoopMargins, unit_of
from freqid.report.margins.page import conditions_table


def margins_result(found: LoopMargins) -> dict[str, Any]:
    """Return margins for machines; what is infinite is the text ``inf``."""
    return {
        "model": found.model,
        "law": found.law,
        "level": found.level,
        "draws": found.draws,
        "seed": found.seed,
        "axes": list(found.axes),
        "effectors": list(found.effectors),
        "conditions": [
            {
                "id": name,
                "u": float(found.u[k]),
                "rho": float(found.rho[k]),
                "stable": bool(found.stable[k]),
                "unstable_share": float(found.unstable_share[k]),
                "figures": {
                    path: {"estimate": _plain(e), "lo": _plain(lo), "hi": _plain(hi), "unit": unit_of(path)}
                    for path, (e, lo, hi) in found[name].items()
                },
                "beside": {
                    other: {
                        path: _plain(float(value))
                        for path, value in zip(found.figures, one.estimate[:, k], strict=True)
                        if not isnan(value)
                    }
                    for other, one in found.beside.items()
                },
            }
            for k, name in enumerate(found.ids)
        ],
        "remarks": list(found.remarks),
    }


def margins_table(found: LoopMargins) -> str:
    """Return one line for each condition: the least margins over the axes of the law."""
    share = 100 * found.level
    lines = [
        f"{found.model} under {found.law}: least margins over {' '.join(found.axes)}"
        + (f"; {share:g} % intervals from {found.draws} draws" if found.draws else ""),
        f"{'condition':<12}{'u m/s':>7}  {'gain dB':<24}{'phase deg':<26}{'disk':<24}least travel left",
    ]
    lines += [
        f"{row['id']:<12}{row['u']:>7}  {row['gain']:<24}{row['phase']:<26}{row['disk']:<24}" + row["travel"]
        for row in conditions_table(found)
    ]
    lines += [f"warning: {text}" for text in found.warnings]
    return "\n".join(lines)


def _plain(value: float) -> float | str | None:
    if isfinite(value):
        return value
    return None if isnan(value) else ("inf" if value > 0 else "-inf")

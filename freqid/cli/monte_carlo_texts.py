"""A Monte Carlo campaign as the terminal shows it."""

from __future__ import annotations

from freqid.core.results.judged.monte_carlo import SHARES, Measured, MonteCarlo

_WIDTH = 12


def monte_carlo_table(found: MonteCarlo) -> str:
    """Return measures over all quantities, one line for each place on the axis and curve."""
    names = [m for m in found.measures if found.of(m) and (m != "failed" or found.failed)]
    heading = [*([found.by] if found.by else []), found.axis or "all", *names]
    lines = ["".join(_cell(text) for text in heading)]
    for curve in found.curves:
        for at in found.axis_values:
            cells = {m.measure: m for m in found.measured if (m.at, m.curve, m.quantity) == (at, curve, "")}
            if cells:
                place = [*([curve] if found.by else []), f"{at:g}" if isinstance(at, float) else f"{at}"]
                lines.append("".join(map(_cell, [*place, *(_told(cells.get(n)) for n in names)])))
    lines.append(f"{found.cases} cases, {found.failed} without a result, {found.rows} rows")
    return "\n".join(line.rstrip() for line in lines)


def _cell(text: str) -> str:
    return f"{text if len(text) < _WIDTH else text[: _WIDTH - 2] + '…':<{_WIDTH}}"


def _told(m: Measured | None) -> str:
    if m is None:
        return "-"
    return f"{100 * m.mean:.1f} %" if m.measure in SHARES else f"{m.mean:.3g}"

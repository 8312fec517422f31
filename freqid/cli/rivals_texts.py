"""A comparison of two simulations as the terminal shows it."""

from __future__ import annotations

from freqid.cli.columns import text_table
from freqid.core.results.rivals import Contest, Rivals

_LISTED = 12  # contests


def rivals_text(found: Rivals) -> str:
    """Return the comparison: its verdict in one line first, then a table, then remarks."""
    blocks = [found.verdict]
    if not found.identical:
        ranked = sorted(found.contests, key=lambda c: (c.p_adjusted, c.p))
        listed = [c for c in ranked if c.nearer] or ranked
        rows = [_row(c) for c in (found.overall, *listed[:_LISTED])]
        head = ("response", "band", "regime", "misfit A", "misfit B", "nearer", "less", "manoeuvres", "p")
        more = len(listed) - _LISTED
        rest = f"\n  and {more} more in the file" if more > 0 else ""
        blocks.append(
            "Misfit: squared residual over noise and tolerances, less what noise makes; 0 is noise. p is for "
            f"all contests together (level {found.level:g}); a difference of less than "
            f"{100 * found.smallest_difference:g} % is not called.\n" + text_table(head, rows) + rest
        )
    if found.remarks:
        blocks.append("\n".join(f"Note: {remark}." for remark in found.remarks))
    return "\n\n".join(blocks)


def _row(c: Contest) -> tuple[str, ...]:
    return (
        c.response,
        f"{c.band_hz[0]:.2g}-{c.band_hz[1]:.2g} Hz",
        c.regime,
        f"{c.misfit_a.value:.2g} ({c.misfit_a.lo:.2g} to {c.misfit_a.hi:.2g})",
        f"{c.misfit_b.value:.2g} ({c.misfit_b.lo:.2g} to {c.misfit_b.hi:.2g})",
        c.nearer or "-",
        f"{100 * c.less:.0f} %" if c.nearer else "-",
        str(c.maneuvers),
        f"{c.p_adjusted:.2g}",
    )

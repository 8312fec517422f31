"""One self-contained page about two simulations compared on the same flights."""

from __future__ import annotations

from freqid import __version__
from freqid.core.rivals import Contest, Rivals
from freqid.report import rivals_figures
from freqid.report.findings import Finding, finding
from freqid.report.notation import percent, short
from freqid.report.pictures import Picture, picture
from freqid.report.rendering import render

_PANELS = 8  # responses that are drawn
_REGIMES = 5


def build_rivals_page(found: Rivals) -> str:
    """Return the page of a comparison: one HTML text that fetches nothing."""
    a, b = found.simulations
    ranked = sorted(found.contests, key=lambda c: (c.p_adjusted, c.p))
    return render(
        "rivals.html",
        title="Two simulations beside the same flights",
        what=f"A: {a}. B: {b}. Flights: {', '.join(found.records)}.",
        version=__version__,
        findings=_findings(found),
        facts=_facts(found),
        pictures_=_pictures(found),
        rows=[_row(c) for c in (found.overall, *ranked)],
        provenance=found.provenance,
    )


def _findings(found: Rivals) -> list[Finding]:
    said = [finding("good" if found.nearer in ("A", "B") else "note", "{}", found.verdict)]
    return said + [finding("note", "{}.", remark) for remark in found.remarks]


def _facts(found: Rivals) -> list[tuple[str, str]]:
    over = found.overall
    return [
        ("Misfit of A over all", _misfit(over, "misfit_a")),
        ("Misfit of B over all", _misfit(over, "misfit_b")),
        ("p of equal simulations, over all", f"{over.p:.2g}"),
        ("Level, of all contests together", short(found.level)),
        ("Contests: responses, and by band and regime", str(len(found.contests))),
    ]


def _pictures(found: Rivals) -> list[Picture]:
    parted = [c for c in found.contests if c.regime != "all" or c.band_hz != found.overall.band_hz]
    cells = parted or list(found.contests)
    if not cells:
        return []
    weight: dict[str, float] = {}
    for c in cells:
        weight[c.response] = weight.get(c.response, 0.0) + abs(c.difference.value)
    kept = sorted(weight, key=lambda name: -weight[name])[:_PANELS]
    shown = {n: [c for c in cells if c.response == n] for n in weight if n in kept}
    held: dict[str, float] = {}
    for c in cells:
        held[c.regime] = held.get(c.regime, 0.0) + abs(c.difference.value)
    top = sorted(held, key=lambda name: -held[name])[:_REGIMES]
    regimes = [r for r in held if r in top]
    shown = {n: [c for c in each if c.regime in regimes] for n, each in shown.items()}
    shown = {n: each for n, each in shown.items() if each}
    bands = sorted({c.band_hz for c in cells})
    less = len(weight) - len(shown)
    return [
        picture(
            rivals_figures.misfits(shown, regimes, bands),
            "misfit",
            "Misfits of A and B by response, regime and frequency band, with 90 % intervals",
            "Misfit by response and frequency band, in each flight regime: squared residual over noise and "
            "tolerances, less what noise alone makes, with its 90 % interval. 0 is noise alone, 1 as much "
            "again as noise and tolerances together. Coloured bands: the one that is nearer beyond chance, "
            "all contests taken together."
            + (f" {less} more responses, where the two differ less, are in the table." if less else ""),
        )
    ]


def _row(c: Contest) -> dict[str, str]:
    return {
        "response": c.response,
        "band": f"{c.band_hz[0]:.2g}–{c.band_hz[1]:.2g}",
        "regime": c.regime,
        "a": _misfit(c, "misfit_a"),
        "b": _misfit(c, "misfit_b"),
        "nearer": c.nearer or "–",
        "less": percent(c.less) if c.nearer else "–",
        "maneuvers": str(c.maneuvers),
        "p": f"{c.p_adjusted:.2g}",
    }


def _misfit(c: Contest, name: str) -> str:
    span = getattr(c, name)
    return f"{span.value:.2g} ({span.lo:.2g} to {span.hi:.2g})"

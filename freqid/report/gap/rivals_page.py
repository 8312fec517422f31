"""One self-contained page about two simulations compared on the same flights, and its figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from freqid import __version__
from freqid.core.results.rivals import Contest, Rivals, Span
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    draw_legend,
    literal,
    name_panel,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import percent, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

_PANELS = 8  # responses that are drawn
_REGIMES = 5
_WIDE = 5.0  # misfit from which an axis is logarithmic


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
    findings = [finding("good" if found.nearer in ("A", "B") else "note", "{}", found.verdict)]
    return findings + [finding("note", "{}.", remark) for remark in found.remarks]


def _facts(found: Rivals) -> list[tuple[str, str]]:
    over = found.overall
    return [
        ("Misfit of A over all", _misfit(over, "misfit_a")),
        ("Misfit of B over all", _misfit(over, "misfit_b")),
        ("p of equal simulations, over all", f"{over.p:.2g}"),
        ("Level, of all contests together", short(found.level)),
        ("Smallest difference that is called", percent(found.smallest_difference)),
        ("Error of form of A and B", " and ".join(percent(f) for f in found.form_errors)),
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
            draw_misfits(shown, regimes, bands),
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


@styled
def draw_misfits(
    contests: Mapping[str, Sequence[Contest]],
    regimes: Sequence[str],
    bands: Sequence[tuple[float, float]],
) -> Figure:
    """Draw the misfits of two simulations with their intervals: a panel a response, bands within regimes.

    Parameters
    ----------
    contests : dict of sequence of Contest
        By response, from the top down.
    regimes : sequence of str
    bands : sequence of tuple of 2 floats
    """
    steep = len(regimes) * len(bands) > 6
    figure, panels = stacked_panels(
        [0.95] * len(contests), legend=1, bottom=0.95 if steep else 0.5, top=0.42, left=0.55
    )
    for axes, (response, each) in zip(panels, contests.items(), strict=True):
        for c in each:
            x = regimes.index(c.regime) * len(bands) + list(bands).index(c.band_hz)
            if c.nearer:
                axes.axvspan(x - 0.5, x + 0.5, color=ORANGE if c.nearer == "A" else BLUE, alpha=0.16, lw=0)
            _mark_misfit(axes, x - 0.17, c.misfit_a, ORANGE, "o")
            _mark_misfit(axes, x + 0.17, c.misfit_b, BLUE, "s")
        axes.axhline(0, color=INK, linewidth=0.8)
        for k in range(1, len(regimes)):
            axes.axvline(k * len(bands) - 0.5, color=GREY, linewidth=0.6)
        ends = [end for c in each for m in (c.misfit_a, c.misfit_b) for end in (m.lo, m.hi)]
        low, top = min(*ends, -0.5), max(*ends, 0.5)
        if top > _WIDE:
            axes.set_yscale("symlog", linthresh=1.0, linscale=0.7)
            axes.set_yticks([0.0, *10.0 ** np.arange(np.ceil(np.log10(top)))])
            top *= 1.5
        axes.set_ylim(1.15 * low, 1.1 * top)
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(plain)
        axes.grid(axis="x", visible=False)
        name_panel(axes, literal(response, 30), "1")
        axes.tick_params(labelbottom=False)
    last, first = panels[-1], panels[0]
    count = len(regimes) * len(bands)
    names = [f"{low:.2g}–{high:.2g}" for _ in regimes for low, high in bands]
    last.set_xticks(range(count), names, rotation=90 if steep else 0)
    last.set_xlim(-0.5, count - 0.5)
    last.tick_params(labelbottom=True)
    last.set_xlabel("Frequency band (Hz), in " + ", ".join(literal(r, 14) for r in regimes))
    for k, regime in enumerate(regimes):
        middle = (k + 0.5) * len(bands) - 0.5
        first.annotate(
            literal(regime, 14),
            (middle, 1.0),
            (0, 15),
            ("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
            color=GREY,
        )
    draw_legend(
        figure,
        [
            *(
                first.plot([], [], m, color=colour, ms=4, label=label)[0]
                for m, colour, label in (("o", ORANGE, "A"), ("s", BLUE, "B"))
            ),
            Patch(color=ORANGE, alpha=0.16, label="A nearer"),
            Patch(color=BLUE, alpha=0.16, label="B nearer"),
        ],
    )
    return figure


def _mark_misfit(axes: Axes, x: float, misfit: Span, colour: str, marker: str) -> None:
    """Draw a misfit and its interval."""
    half = np.array([[misfit.value - misfit.lo], [misfit.hi - misfit.value]])
    axes.errorbar([x], [misfit.value], half, fmt=marker, color=colour, ms=3.2, elinewidth=0.9, capsize=1.5)

"""One self-contained page about the gap between a simulation and flights, with the part on its self-test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from freqid import __version__
from freqid.core.results.diagnosis import Existence
from freqid.core.results.gap import BeforeAfter, GapResult, ResidualSpectra
from freqid.core.results.gap_self_test import ENDS, Rate, SelfTest, Stratum
from freqid.report.gap import figures as gap_figures
from freqid.report.gap import tables as gap_tables
from freqid.report.gap.tables import with_si
from freqid.report.kit.drawing import WIDTH
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import NONE, number, percent, pretty_unit, sentence, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

_LEAST_SHARE = 0.01  # share of draws that is shown
_WIDE = 9.6  # inches, of a matrix by itself
_BESIDE = 18  # effects whose matrices are legible side by side


def confusions(test: SelfTest | None) -> list[Picture]:
    """Return the confusion matrices, weakest insertions first, where anything is found."""
    if test is None:
        return []
    return [_confusion(test, s, k) for k, s in enumerate(test.strata) if s.detected.share > 0.05]


def gap_summary(test: SelfTest | None) -> dict[str, Any] | None:
    """Return the tables of a self-test."""
    if test is None:
        return None
    return {
        "draws": test.draws,
        "strata": [
            {
                "detectability": f"{s.detectability:g}",
                "rates": [
                    *(_rate(r) for r in (s.detected, s.named, s.right, s.covered)),
                    f"{s.truth_probability:.2f}" if math.isfinite(s.truth_probability) else NONE,
                ],
            }
            for s in test.strata
        ],
        "false_alarm": _rate(test.false_alarm),
        "outside": {n: _rate(r) for n, r in test.outside.items()},
        "form_error": f"{100 * test.form_error:.0f} %",
        "false_name": _rate(test.false_name),
        "reliability": test.reliability.sentence(),
        "bins": [
            {
                "given": f"{b.low:g} to {b.high:g}",
                "probability": f"{b.probability:.2f}",
                "right": _rate(b.right),
            }
            for b in test.reliability.bins
            if b.right.of
        ],
        "smallest": [
            {
                "effect": s.effect,
                "place": s.place,
                "size": with_si(s.size, s.unit) if math.isfinite(s.size) else "none within its range",
                "detectability": f"{s.detectability:.0f}" if math.isfinite(s.detectability) else NONE,
            }
            for s in test.smallest
        ],
        "wide": bool(test.strata) and len(test.strata[-1].answers) > _BESIDE,
        "not_inserted": list(test.not_inserted.items()),
    }


def _confusion(test: SelfTest, stratum: Stratum, k: int) -> Picture:
    rows, columns, shares = stratum.shares()
    names = {"none": "no gap", "other": "other", "several": "several"}
    table = np.array(shares)[None]
    table = np.where(table < _LEAST_SHARE, 0.0, table)
    size = f"{stratum.detectability:g}"
    figure = gap_figures.heat_panels(
        [f"Inserted at a detectability of {size}"],
        rows,
        [names[c] if c in ENDS else c for c in columns],
        table,
        1.0,
        "Answered",
        _WIDE if len(rows) > _BESIDE else WIDTH,
    )
    return picture(
        figure,
        f"confusion{k}",
        f"Confusion matrix at a detectability of {size}",
        f"What is answered, in per cent of {test.draws} draws, where the effect at the left was inserted at "
        f"a detectability of {size}. The diagonal is right; a group of effects that cannot be told apart and "
        "holds the inserted one counts as right. Several: no name is likely enough. No gap: none was called. "
        "Below 1 % is left blank.",
    )


def _rate(rate: Rate) -> str:
    if not rate.of:
        return NONE
    return f"{100 * rate.share:.0f} % ({100 * rate.lo:.0f} to {100 * rate.hi:.0f})"


_ROWS = 12  # of a map
_REGIMES = 4
_PANELS = 4  # of a figure
_BARS = 16
_LEAST = 0.005  # of the gap, from which a row is drawn


def build_gap_page(result: GapResult) -> str:
    """Return the page of a diagnosis: one HTML text that fetches nothing."""
    d = result.diagnosis
    return render(
        "gap.html",
        title="Gap between simulation and flight",
        what=f"{d.simulation} beside {', '.join(d.records)}.",
        version=__version__,
        findings=_findings(result),
        facts=_facts(result),
        maps=_maps(result) if d.gap.exists else [],
        spectra=_spectra(result),
        increments=_increments(result),
        probabilities=_probabilities(result),
        detectable=_detectable(result),
        before_after=_before_after(result),
        tolerances=gap_tables.tolerance_rows(d),
        sensors=gap_tables.sensor_rows(d),
        where=gap_tables.where_rows(d),
        which=gap_tables.which_rows(d),
        pair=d.which.pair,
        aliases=d.which.aliases,
        untested=gap_tables.untested_rows(d),
        self_test=gap_summary(d.self_test),
        confusions=confusions(d.self_test),
        closures=gap_tables.closures(d, result.mean_errors()),
        at_rest=percent(rest) if math.isfinite(rest := result.share_at_rest()) else "",
        top=f"{max(hz):.3g}" if (hz := [float(b.hz[-1]) for b in result.before_after if b.hz.size]) else "",
        next_tests=gap_tables.next_rows(d.next_flight),
        next_groups=[g["sentence"] for g in d.next_flight.get("groups", ())],
        next_design=d.next_flight.get("design") or "",
        provenance=result.provenance,
    )


def _of_verdict(gap: Existence) -> Literal["good", "note", "bad"]:
    if gap.exists:
        return "bad"
    return "note" if gap.unconfirmed else "good"


def _findings(result: GapResult) -> list[Finding]:
    d = result.diagnosis
    findings = [finding(_of_verdict(d.gap), "{}", sentence(d.verdict))]
    findings += [finding("note", "Withdrawn: {}, {}.", name, why) for name, why in d.which.withdrawn.items()]
    findings += [
        finding("note", "These data cannot separate {}.", ", ".join(group)) for group in d.which.aliases
    ]
    findings += [finding("note", "{}.", sentence(remark)) for remark in d.remarks]
    return findings


def _facts(result: GapResult) -> list[tuple[str, str]]:
    d = result.diagnosis
    hz = [s.hz for s in result.spectra]
    held_out = len(result.provenance.get("held out", ()))
    used = len(d.records) - held_out
    facts = [
        ("p if there is no gap", f"{d.gap.p:.2g} (level {short(d.gap.level)})"),
        ("p by chi-square, which knows of no tolerances", f"{d.gap.naive_p:.2g}"),
        ("Records", f"{used} used, in {len(result.spectra)} conditions; {held_out or 'none'} held out"),
        (
            "Error of form of the simulation's terms",
            ", ".join(f"{percent(f)} in {row}" for row, f in d.gap.form_errors.items() if f) or "none",
        ),
    ]
    if hz:
        facts.append(("Lines", f"0 to {max(h[-1] for h in hz):.3g} Hz"))
    return facts


def _order(result: GapResult) -> list[int]:
    """Return the map's rows that hold some of the gap, largest first."""
    each = result.cells.shares(1, 2, 3)
    return [int(i) for i in np.argsort(-each) if each[i] >= _LEAST][:_ROWS]


def _maps(result: GapResult) -> list[Picture]:
    cells, rows = result.cells, _order(result)
    if not rows:
        return []
    names = [cells.rows[i] for i in rows]
    bands = [f"{low:.2g}–{high:.2g}" for low, high in cells.bands_hz]
    by_regime = cells.shares(3)[rows].transpose(2, 0, 1)
    held = cells.shares(3).sum(axis=(0, 1))
    regimes = sorted(np.argsort(-held)[:_REGIMES].tolist())
    left = 1 - float(held[regimes].sum())
    shown = by_regime[regimes]
    titles = [f"{cells.regimes[k]}: {percent(float(held[k]))}" for k in regimes]
    pictures = [
        picture(
            gap_figures.heat_panels(titles, names, bands, shown, float(shown.max()), "Frequency (Hz)"),
            "map-regime",
            f"Gap map: share of what is detectable by response and band, in {', '.join(titles)}",
            "Where the gap is: per cent of what is detectable of it beyond noise, tolerances and error of "
            "form, by response and band in each flight regime. Rows that act on loads "
            "are named by their letter, actuator/ is between command and position, "
            "kinematic/ is what the sensors say of each other."
            + (f" {percent(left)} is in other regimes." if left >= _LEAST else ""),
        )
    ]
    by_input = cells.shares(1, 2)[rows]
    inputs = [n or "none" for n in cells.inputs]
    kept = [k for k in range(len(inputs)) if by_input[:, k].max() >= _LEAST]
    table = by_input[:, kept][None]
    driven = percent(1 - cells.share("input")[""])
    if any(cells.inputs[k] for k in kept):
        pictures.append(
            picture(
                gap_figures.heat_panels(
                    ["All regimes"], names, [inputs[k] for k in kept], table, float(table.max()), "Signal"
                ),
                "map-input",
                "Gap map: share of what is detectable by response and injected signal",
                "The same by injected signal: per cent of what is detectable on the lines that a signal "
                "drives. Under feedback all signals move the vehicle, so a gap in a derivative by motion "
                "shows under every one of them."
                + (" Signals without any are left out." if len(kept) < len(inputs) else ""),
            )
        )
    found = result.coherence
    signals = [n for n in cells.inputs if any(n in row for row in found.values())]
    if signals:
        shown_rows = [n for n in names if n in found]
        table = np.array([[[found[r].get(n, 0.0) for n in signals] for r in shown_rows]])
        pictures.append(
            picture(
                gap_figures.heat_panels(["All regimes"], shown_rows, signals, table, 1.0, "Signal"),
                "coherence",
                "Share of the residual on each signal's lines that noise does not account for",
                "Coherence of the residual with each injected signal: per cent of the residual's power on "
                "the signal's lines that noise does not account for. Near 100: what is left there is no "
                "noise. How much of the gap that is, it does not say: all driven lines together hold "
                f"{driven} of what is detectable.",
            )
        )
    return pictures


def _spectra(result: GapResult) -> list[Picture]:
    names = [result.cells.rows[i] for i in _order(result)]
    each = sorted(result.spectra, key=lambda s: -_explained(s))[:_REGIMES]
    pictures = []
    for k, one in enumerate(s for s in result.spectra if any(s is e for e in each)):
        rows = [one.rows.index(n) for n in names if n in one.rows][:_PANELS] or list(
            range(min(_PANELS, len(one.rows)))
        )
        pictures.append(
            picture(
                gap_figures.residual_spectra(one, rows),
                f"residual{k}",
                f"Residual spectra over the noise floor, {_short(one.maneuver)}",
                f"{_short(one.maneuver)}: measured less simulated on each line. What stands above the "
                "grey floor is no noise; at the left, at 0, stands the mean. Blue dashes are what the "
                "likeliest explanation makes of it: they "
                "should meet the orange dots that stand out.",
            )
        )
    return pictures


def _short(maneuver: str) -> str:
    """Return the name of a condition without its folder and without the suffix of its file."""
    record, _, repeats = maneuver.partition(" and ")
    return Path(record).stem + (f" and {repeats}" if repeats else "")


def _explained(one: ResidualSpectra) -> float:
    return float((np.abs(one.explained) ** 2 / one.noise**2).sum())


def _increments(result: GapResult) -> list[Picture]:
    known = result.increments[:_BARS]
    if not known:
        return []
    clear = sum(i.clear for i in result.increments)
    return [
        picture(
            gap_figures.increment_bars(known),
            "increments",
            "Derivative increments with 95 % intervals",
            f"By how much derivatives in flight differ from the simulation's, with 95 % intervals, all "
            f"fitted together. Blue: the interval excludes zero ({clear} of {len(result.increments)}; one in "
            "twenty would by chance). One input in several responses: an effector; one state: the airframe.",
        )
    ]


def _probabilities(result: GapResult) -> list[Picture]:
    w = result.diagnosis.which
    shown = [n for n, p in w.probabilities.items() if p >= _LEAST or n in w.set][:_BARS]
    if not shown:
        return []
    return [
        picture(
            gap_figures.probability_bars(
                shown, np.array([w.probabilities[n] for n in shown]), [n in w.set for n in shown]
            ),
            "probabilities",
            "Probability of each explanation",
            "How likely each effect is the one, none of the library (other), or nothing at all (none). Blue: "
            "the set that holds the truth in 90 of 100 cases.",
        )
    ]


def _detectable(result: GapResult) -> list[Picture]:
    gap = result.diagnosis.gap
    sizes = gap.smallest_detectable if gap.exists else gap.largest_undetected
    known = [(n, s / result.expected[n]) for n, s in sizes.items() if n in result.expected]
    known = sorted((k for k in known if np.isfinite(k[1]) and k[1] < 1e4), key=lambda k: k[1])
    if not known:
        return []
    names = [n for n, _ in known]
    notes = [gap_tables.with_si(sizes[n], gap.unit.get(n, "1")) for n in names]
    seen = "is found" if gap.exists else "would have been called a gap"
    return [
        picture(
            gap_figures.draw_detectable_sizes(names, np.array([r for _, r in known]), notes),
            "detectable",
            "Smallest size of each effect that would be found",
            f"What these flights can see: the size of each effect that {seen} in 95 of 100 cases, over the "
            "size that is expected of it beforehand. Orange: an effect of the expected size would hide.",
        )
    ]


def _before_after(result: GapResult) -> list[Picture]:
    pictures = []
    if not result.diagnosis.how_far:  # nothing was added, so there is no after
        return []
    for k, one in enumerate(result.before_after):
        rows = _changed(one)
        scored = "held out" if one.held_out else "among those fitted"
        name, added = _short(one.maneuver), " and ".join(result.diagnosis.how_far[0].effects)
        pictures.append(
            picture(
                gap_figures.before_after_time(one, rows),
                f"time{k}",
                f"{name}, {scored}: measured, before and after over time",
                f"{name}, {scored}: as measured, as simulated, and as simulated with {added} and the "
                "tolerances that go with it, where these do most. Blue should lie on grey where orange does "
                f"not. {_means(one, rows)}",
            )
        )
        pictures.append(
            picture(
                gap_figures.before_after_frequency(one, rows),
                f"frequency{k}",
                f"{name}, {scored}: what is left before and after over frequency",
                f"{name}, {scored}: what is left on each line, and at 0 in the mean. Where blue dots stay "
                f"inside the noise, {added} explains all that can be seen; the mean may be off by what "
                "offsets each record has as well.",
            )
        )
    return pictures


def _means(one: BeforeAfter, rows: Sequence[int]) -> str:
    """Return by how much the means of some responses are off, in a sentence."""
    before, after = one.mean_errors()
    each = [
        f"{one.responses[i]} {number(float(before[i]))} before and {number(float(after[i]))} after"
        + (f" ({pretty_unit(one.units[i])})" if one.units[i] not in ("", "1") else "")
        for i in rows
    ]
    return (
        "A steady offset is what is left at zero frequency. Mean of measured less simulated: "
        f"{'; '.join(each)}."
    )


def _changed(one: BeforeAfter) -> list[int]:
    """Return the rows that the effects change most."""
    change = (np.abs(one.after_hz - one.before_hz) ** 2 / np.maximum(one.noise, 1e-300) ** 2).sum(axis=1)
    return [int(i) for i in np.argsort(-change) if change[i] >= 0.02 * change.max()][:_PANELS]

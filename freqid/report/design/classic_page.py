"""One self-contained page about classic inputs, and their test card."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from freqid import __version__
from freqid.core.results.design import ClassicDesign
from freqid.design.classic import Extent
from freqid.report.design import figures, tables
from freqid.report.design.flight_plan import EMPTY, FlightPlan, power_in_band
from freqid.report.design.page import write_cards
from freqid.report.design.signal_pictures import signal_pictures
from freqid.report.design.test_card import build_card
from freqid.report.kit.effectors import effector_groups
from freqid.report.kit.findings import Finding, code, finding
from freqid.report.kit.notation import percent, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render, write_text

PLURAL = {"doublet": "Doublets", "3-2-1-1": "3-2-1-1 inputs", "sweep": "Frequency sweeps"}
_WIDEST = 3  # times the band's end: steps have some power far beyond


def write_classic_documents(
    destination: Path, design: ClassicDesign, judged: Extent, plan: FlightPlan
) -> list[Path]:
    """Write page and test card of classic inputs beside their file.

    Parameters
    ----------
    destination : Path
        Of the design.
    design, judged : ClassicDesign, Extent
    plan : FlightPlan

    Returns
    -------
    list of Path
        Of the files.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    page = destination.with_suffix(".html")
    write_text(page, build_classic_page(design, judged, plan))
    return [page, *write_cards(destination, build_card(design, judged, plan))]


def build_classic_page(design: ClassicDesign, judged: Extent, plan: FlightPlan) -> str:
    """Return the page of classic inputs: one HTML text that fetches nothing."""
    rows = tables.movements(design, judged, plan)
    once = design.inputs.time.size // design.periods
    kind = PLURAL[design.waveform]
    return render(
        "classic.html",
        title=plan.vehicle.name,
        what=f"{kind} for {len(design.names)} effectors, one after the other.",
        version=__version__,
        findings=_findings(design, rows, plan),
        facts=_facts(design, plan),
        effectors=rows,
        spectrum=_spectrum(design, plan),
        signals=signal_pictures(
            design,
            plan.vehicle,
            design.inputs.time[:once],
            design.inputs.values[:, :once],
            f"one sequence of {design.periods}" if design.periods > 1 else "the sequence",
            "Each group has one scale.",
        ),
        with_motion=any(plan.expected(name) for name in design.names),
        motion=tables.motion_rows(plan),
        motion_of="of the linear model",
        varied=len(plan.varied),
        provenance={"design": plan.source, "SHA-256": plan.sha256, **design.provenance},
    )


def _findings(design: ClassicDesign, rows: list[dict], plan: FlightPlan) -> list[Finding]:
    kind, limits = tables.judge_limits(rows)
    findings = [
        finding(kind, "{}, {}: {}.", PLURAL[design.waveform], f"{short(design.duration_s)} s", limits)
    ]
    for band in plan.forbidden_hz:
        share, name = power_in_band(design, band)
        where = f"{short(band[0])} to {short(band[1])} Hz"
        if share > EMPTY:
            text = "The forbidden band {} is not empty: it has {} of the power of {}."
            findings.append(finding("bad", text, where, percent(share), code(name)))
        else:
            findings.append(finding("good", "Nothing to speak of is put into the forbidden band {}.", where))
    if plan.motion is not None and plan.abort:
        findings.append(tables.aborts(plan))
    return findings


def _facts(design: ClassicDesign, plan: FlightPlan) -> list[tuple[str, str]]:
    facts = [
        ("Effectors", ", ".join(effector_groups(design.names, plan.vehicle))),
        ("Condition", plan.condition),
        ("Manoeuvre", f"{design.periods} times all effectors, {short(design.duration_s)} s"),
        ("Band", f"{short(design.band_hz[0])} to {short(design.band_hz[1])} Hz"),
        ("Sampled at", f"{short(1 / design.dt_s)} Hz"),
        ("File", plan.source),
    ]
    return [(label, text) for label, text in facts if text]


def _spectrum(design: ClassicDesign, plan: FlightPlan) -> Picture:
    """Draw the spectrum of one input; all effectors have the same waveform."""
    once = design.inputs.values[0, : design.inputs.time.size // design.periods]
    power = np.abs(np.fft.rfft(once)) ** 2
    f = np.arange(power.size) / (once.size * design.dt_s)
    shown = f <= _WIDEST * design.band_hz[1]
    shaded = " Shaded: forbidden bands." if plan.forbidden_hz else ""
    return picture(
        figures.waveform_spectrum(f[shown], power[shown] / power.max(), design.band_hz, plan.forbidden_hz),
        "spectra",
        "Power of one input over frequency",
        "Where one input has its power. Dashed: the band that is identified. What is far below the highest "
        f"power tells little, and modes there need longer or shorter steps, or a sweep.{shaded}",
    )

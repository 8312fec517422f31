"""Sheets of what has no theme of its own: a record, an output-error model, a sealed trial, a design file."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from freqid import __version__
from freqid.core.channels import GROUPS
from freqid.core.record import FlightRecord
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.results.judged.sealed_trial import TrialOutcome
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Effector, Inertia, MassProperties, Vehicle
from freqid.design.multisine.merit import merit, truncated
from freqid.report.design.flight_plan import FlightPlan
from freqid.report.design.page import build_design_page, flight_plan
from freqid.report.design.test_card import build_card, test_card_text
from freqid.report.kit import figures
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import (
    NONE,
    exact,
    measured_values,
    number,
    percent,
    pretty_unit,
    sentence,
    share,
)
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import Sheet, render
from freqid.report.point.tables import channel_table

_STRIPS = 8  # channels in one figure
_MOST_FITS = 12
_KINDS: dict[str, Literal["good", "note", "bad"]] = {"right": "good", "wrong": "bad", "undecided": "note"}


def build_record_sheet(record: FlightRecord) -> Sheet:
    """Return the page of a flight record: its channels over time, and where each is from."""
    pictures = []
    for group in GROUPS:
        names = [n for n in record.channels if n.startswith(f"{group}/")]
        for first in range(0, len(names), _STRIPS):
            part = names[first : first + _STRIPS]
            pictures.append(
                picture(
                    figures.channel_strips(record, part),
                    f"channels{len(pictures)}",
                    f"{group} over time: {', '.join(part)}",
                    f"{group.capitalize()}: look for drift, dropouts and limits.",
                )
            )
    bad = [c.name for c in record.channels.values() if c.not_finite.size]
    slow = min((c.native_rate_hz for c in record.channels.values()), default=math.nan)
    findings = [
        finding("bad", "Samples are not finite in {}.", ", ".join(bad))
        if bad
        else finding("good", "All samples of all {} channels are finite.", len(record.channels))
    ]
    return render(
        "record.html",
        title=record.vehicle.name if record.vehicle is not None else "Record",
        what=f"Flight record at {record.reference}." if record.reference else "Flight record.",
        version=__version__,
        findings=findings,
        facts=[
            ("Length", f"{number(record.duration, 4)} s"),
            ("Rate", f"{number(1 / record.dt, 4)} Hz; slowest channel {number(slow)} Hz"),
            ("Channels", str(len(record.channels))),
        ],
        drawn=pictures,
        channels=channel_table(record),
        provenance=record.provenance,
    )


def build_output_error_sheet(model: OutputErrorModel) -> Sheet:
    """Return the page of parameters by output error: estimates, whiteness of residuals, fits."""
    rows = []
    for j, name in enumerate(model.names):
        error = float(model.std_error[j])
        values = [float(x[j]) for x in (model.estimate, model.lower, model.upper, model.start)]
        texts = measured_values(error, *values)
        bound = float(model.cramer_rao[j])
        rows.append(
            {
                "name": name,
                "unit": pretty_unit(model.units[j]),
                "error": exact(error, texts[0]),
                "cells": [exact(v, t) for v, t in zip(values, texts[1:], strict=True)],
                "bound": exact(bound, number(bound, 2)),
                "at_bound": name in model.at_bound,
            }
        )
    findings: list[Finding] = []
    findings.append(
        finding("good", "The iteration converged after {} steps.", model.steps)
        if model.converged
        else finding("bad", "The iteration did not converge after {} steps.", model.steps)
    )
    if model.coloured:
        findings.append(
            finding(
                "note",
                "The residuals of {} are not white; the errors allow for it.",
                ", ".join(model.coloured),
            )
        )
    findings += [finding("note", "{}", remark[:1].upper() + remark[1:]) for remark in model.remarks]
    findings += [finding("bad", "These data hardly separate {}.", ", ".join(g)) for g in model.inseparable]
    return render(
        "output_error.html",
        title=model.model,
        what=f"Parameters by {model.method} in the {model.domain} domain.",
        version=__version__,
        findings=findings,
        facts=[("Parameters", str(len(model.names))), ("Cost", number(model.cost, 5))],
        rows=rows,
        level=f"{100 * model.confidence:g}",
        outputs=[
            {"name": name, "r2": share(f.r2), "rms": number(f.rms), "white": _white(model, name)}
            for name, f in model.fit.items()
        ],
        drawn=_output_pictures(model),
        provenance=model.provenance,
    )


def _white(model: OutputErrorModel, name: str) -> str:
    value = model.whiteness.get(name, math.nan)
    return number(value, 2) if math.isfinite(value) else NONE


def _output_pictures(model: OutputErrorModel) -> list[Picture]:
    pictures = []
    for name, fit in list(model.fit.items())[:_MOST_FITS]:
        draw = figures.fit_over_frequency if np.iscomplexobj(fit.measured) else figures.fit_over_time
        pictures.append(
            picture(
                draw(fit, name.replace("$", r"\$"), ""),
                f"output{len(pictures)}",
                f"{name}: measured, model and residual",
                f"{name}: R² {share(fit.r2)}. A residual with a pattern is not explained.",
            )
        )
    return pictures


def build_trial_sheet(outcome: TrialOutcome) -> Sheet:
    """Return the page of a sealed trial: what was sealed, what was found, and whether it was right."""
    unit = pretty_unit(outcome.unit)
    with_unit = "" if outcome.unit == "1" else f" {unit}"
    kind = _KINDS[outcome.answer]
    change = outcome.after - outcome.before
    return render(
        "trial.html",
        title="Sealed trial of the diagnosis",
        what="An effect was drawn by a seed, flown, and named in a sealed file alone; the diagnosis came "
        "before the seal was opened.",
        version=__version__,
        findings=[finding(kind, "{}", sentence(outcome.sentence))],
        facts=[
            ("Sealed", f"{outcome.effect}, {outcome.parameter}"),
            (
                "In the simulation, in the aircraft",
                f"{number(outcome.before)}, {number(outcome.after)}{with_unit}",
            ),
            ("Change", f"{number(change)}{with_unit}"),
            (
                "Found change",
                f"{number(outcome.estimate)} ({number(outcome.lower)} to {number(outcome.upper)}){with_unit}"
                if math.isfinite(outcome.estimate)
                else NONE,
            ),
            ("Named", ", ".join(outcome.named) or "nothing"),
            ("Probability of the sealed effect", percent(outcome.probability)),
            ("Likeliest place", outcome.place or NONE),
            ("Seed", str(outcome.seed)),
        ],
        verdict=sentence(outcome.verdict),
        provenance={"checksum of the seal": outcome.checksum},
    )


def build_design_sheet(
    design: MultisineDesign | ClassicDesign,
    vehicle: Vehicle | None,
    scenario: Scenario | None,
    name: str,
    sha256: str,
) -> Sheet:
    """Return the page of a design that is read from its file.

    Parameters
    ----------
    design : MultisineDesign or ClassicDesign
    vehicle : Vehicle, optional
        Whose limits are shown; without any, effectors have none.
    scenario : Scenario, optional
        Its forbidden bands and abort limits are shown.
    name, sha256 : str
        Of the file.
    """
    if scenario is not None and scenario.excitation is not None:
        plan = flight_plan(None, design, scenario)
    else:
        plan = FlightPlan(vehicle or _bare(design))
    plan = replace(plan, source=name, sha256=sha256)
    if isinstance(design, ClassicDesign):
        from freqid.design.classic import extent
        from freqid.report.design.classic_page import build_classic_page

        return _sheet(build_classic_page(design, extent(design), plan))
    return _sheet(build_design_page(design, merit(design), truncated(design), plan=plan))


def test_card_of(design: MultisineDesign | ClassicDesign, scenario: Scenario) -> str:
    """Return the test card of a design as text; empty for classic inputs."""
    if isinstance(design, ClassicDesign):
        return ""
    return test_card_text(build_card(design, merit(design), flight_plan(None, design, scenario)))


test_card_of.__test__ = False  # type: ignore[attr-defined]


def _sheet(page: str) -> Sheet:
    assert isinstance(page, Sheet)
    return page


def _bare(design: MultisineDesign | ClassicDesign) -> Vehicle:
    """Return a vehicle of which nothing is known but the effectors that a design moves."""
    kinds: dict[str, Literal["surface", "rotor"]] = {"rad": "surface", "rad/s": "rotor"}
    wide = (-1e9, 1e9)
    return Vehicle(
        name="",
        mass_properties=MassProperties(mass_kg=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0)),
        effectors=tuple(
            Effector(name=n, kind=kinds.get(u, "throttle"), limits=wide)
            for n, u in zip(design.names, design.units, strict=True)
        ),
    )

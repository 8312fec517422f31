"""What stands beside a design's file: its page, and its test card as text and HTML."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from freqid.core.channels import WRENCH
from freqid.core.design import ClassicDesign, MultisineDesign
from freqid.core.scenario import Scenario
from freqid.design.closed_loop import STATES
from freqid.design.excursions import excursions
from freqid.design.finish import FinishedSet
from freqid.design.forecast import Forecast
from freqid.design.merit import Merit, merit, truncated
from freqid.design.modelled import ModelledAircraft
from freqid.design.multisine import effectiveness, excited
from freqid.design.net_load import net_loads
from freqid.report.design_page import build_design_page
from freqid.report.flight_plan import FlightPlan
from freqid.report.rendering import write_text
from freqid.report.test_card import Card, build_card, test_card_text, write_test_card


def write_documents(
    destination: Path,
    finished: FinishedSet,
    judged: Merit,
    scenario: Scenario,
    plan: FlightPlan,
    *,
    study: Sequence[MultisineDesign] = (),
    forecast: Forecast | None = None,
) -> list[Path]:
    """Write page and test card of a set of multisines beside its file.

    Parameters
    ----------
    destination : Path
        Of the design.
    finished, judged, scenario, plan, study, forecast
        As for `multisine_page`.

    Returns
    -------
    list of Path
        Of the files.
    """
    page = destination.with_suffix(".html")
    write_text(page, multisine_page(finished, judged, scenario, plan, study=study, forecast=forecast))
    return [page, *write_cards(destination, build_card(finished.design, judged, plan))]


def multisine_page(
    finished: FinishedSet,
    judged: Merit,
    scenario: Scenario,
    plan: FlightPlan,
    *,
    study: Sequence[MultisineDesign] = (),
    forecast: Forecast | None = None,
) -> str:
    """Return the page of a set of multisines.

    Parameters
    ----------
    finished : FinishedSet
    judged : Merit
        Of its design.
    scenario : Scenario
        With the excitation that the design was made from.
    plan : FlightPlan
    study : sequence of MultisineDesign
        Of other periods, for comparison.
    forecast : Forecast, optional
    """
    excitation, design, net = scenario.excitation, finished.design, None
    if finished.before is not None and excitation is not None and excitation.net_load:
        counted = np.array([axis in excitation.net_load for axis in WRENCH])
        axes = [axis for axis, wanted in zip(WRENCH, counted, strict=True) if wanted]
        loads = effectiveness(excited(excitation, scenario.effector))[counted]
        net = (axes, net_loads(design.signals, loads), net_loads(finished.before.signals, loads))
    compared = [(merit(other), truncated(other)) for other in study]
    return build_design_page(
        design, judged, truncated(design), plan=plan, net=net, study=compared, forecast=forecast
    )


def flight_plan(
    destination: Path | None,
    design: MultisineDesign | ClassicDesign,
    scenario: Scenario,
    aircraft: ModelledAircraft | None = None,
) -> FlightPlan:
    """Return how a design is to be flown, and what motion is expected where there is a model.

    `destination` is the design's file; None where it has none yet.
    """
    excitation, vehicle = scenario.excitation, scenario.aircraft()
    assert excitation is not None
    watched = tuple(dict.fromkeys((*STATES, *excitation.excursions, *design.names)))
    return FlightPlan(
        vehicle=vehicle,
        trim=aircraft.trim if aircraft else {},
        source=destination.name if destination else "",
        sha256=hashlib.sha256(destination.read_bytes()).hexdigest() if destination else "",
        forbidden_hz=excitation.forbidden_hz,
        fade_s=excitation.fade_s,
        abort=excitation.abort,
        control="gains of [control]" if scenario.control.get("gains") else "",
        motion=excursions(design, aircraft.loop, watched) if aircraft else None,
        varied=[excursions(design, loop, watched) for loop in aircraft.varied] if aircraft else (),
    )


def write_cards(destination: Path, card: Card) -> list[Path]:
    """Write a test card as text and HTML beside a design; return their paths."""
    text = destination.with_name(f"{destination.stem}-card.txt")
    write_text(text, test_card_text(card))
    write_test_card(text.with_suffix(".html"), card)
    return [text, text.with_suffix(".html")]

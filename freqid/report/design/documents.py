"""What stands beside a design's file: its page, and its test card as text and HTML."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from freqid.core.channels import WRENCH
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.scenario import Scenario
from freqid.design.finish import FinishedSet
from freqid.design.forecast.closed_loop import STATES
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import ModelledAircraft
from freqid.design.forecast.standard_errors import Forecast
from freqid.design.multisine.merit import Merit, merit, truncated
from freqid.design.multisine.net_load import net_loads
from freqid.design.multisine.orthogonal_set import effectiveness, excited
from freqid.report.design.flight_plan import FlightPlan
from freqid.report.design.page import write_design_page
from freqid.report.design.test_card import Card, build_card, test_card_text, write_test_card
from freqid.report.kit.rendering import write_text


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
    finished : FinishedSet
    judged : Merit
        Of its design.
    scenario : Scenario
        With the excitation that the design was made from.
    plan : FlightPlan
    study : sequence of MultisineDesign
        Of other periods, for comparison.
    forecast : Forecast, optional

    Returns
    -------
    list of Path
        Of the files.
    """
    excitation, design, net = scenario.excitation, finished.design, None
    if finished.before is not None and excitation is not None and excitation.net_load:
        counted = np.array([axis in excitation.net_load for axis in WRENCH])
        axes = [axis for axis, wanted in zip(WRENCH, counted, strict=True) if wanted]
        loads = effectiveness(excited(excitation, scenario.effector))[counted]
        net = (axes, net_loads(design.signals, loads), net_loads(finished.before.signals, loads))
    page = destination.with_suffix(".html")
    compared = [(merit(other), truncated(other)) for other in study]
    write_design_page(
        page, design, judged, truncated(design), plan=plan, net=net, study=compared, forecast=forecast
    )
    return [page, *write_cards(destination, build_card(design, judged, plan))]


def flight_plan(
    destination: Path,
    design: MultisineDesign | ClassicDesign,
    scenario: Scenario,
    aircraft: ModelledAircraft | None = None,
) -> FlightPlan:
    """Return how a design is to be flown, and what motion is expected where there is a model."""
    excitation, vehicle = scenario.excitation, scenario.aircraft()
    assert excitation is not None
    watched = tuple(dict.fromkeys((*STATES, *excitation.excursions, *design.names)))
    return FlightPlan(
        vehicle=vehicle,
        trim=aircraft.trim if aircraft else {},
        source=destination.name,
        sha256=hashlib.sha256(destination.read_bytes()).hexdigest(),
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

"""One self-contained page about a set of multisines, and what else stands beside a design's file."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from freqid import __version__
from freqid.core.arrays import Array
from freqid.core.channels import AIR, EFFECTOR_UNITS, STATE, WRENCH
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.scenario import Scenario
from freqid.design.finish import FinishedSet
from freqid.design.forecast.closed_loop import STATES
from freqid.design.forecast.excursions import excursions
from freqid.design.forecast.modelled import ModelledAircraft
from freqid.design.forecast.standard_errors import Forecast
from freqid.design.multisine.merit import Merit, Truncation, merit, truncated
from freqid.design.multisine.net_load import net_loads
from freqid.design.multisine.orthogonal_set import effectiveness, excited
from freqid.design.multisine.signals import sample, samples_per_period
from freqid.report.design import figures, tables
from freqid.report.design.flight_plan import FlightPlan
from freqid.report.design.signal_pictures import signal_pictures
from freqid.report.design.test_card import Card, build_card, test_card_text, write_test_card
from freqid.report.kit.effectors import effector_groups, engineering
from freqid.report.kit.notation import pretty_unit, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render, write_text

NetLoads = tuple[Sequence[str], Array, Array]
Study = Sequence[tuple[Merit, Truncation]]

_POINTS = 16  # samples per shortest period: drawn, not judged


def build_design_page(
    design: MultisineDesign,
    merit: Merit,
    truncation: Truncation,
    *,
    plan: FlightPlan,
    net: NetLoads | None = None,
    study: Study = (),
    forecast: Forecast | None = None,
) -> str:
    """Return the page of a design: one HTML text that fetches nothing, the same for the same arguments.

    Parameters
    ----------
    design : MultisineDesign
    merit : Merit
    truncation : Truncation
        Both of that design.
    plan : FlightPlan
        Vehicle, trim, limits, forbidden bands, expected motion.
    net : tuple of (axes, loads, before), optional
        Names among X Y Z L M N; the sum of all effectors over one period and what it was before starts and
        senses were chosen, both of shape (axis, sample), N and N m.
    study : sequence of (Merit, Truncation)
        Designs with other periods T; that of the page may be among them.
    forecast : Forecast, optional
    """
    period = design.period_s
    others = [pair for pair in study if pair[1].time[-1] != period]
    compared = [*others, (merit, truncation)]
    return render(
        "design.html",
        title=plan.vehicle.name,
        what=f"Orthogonal multisines for {len(design.signals)} effectors.",
        version=__version__,
        findings=tables.design_findings(design, merit, truncation, plan, net),
        facts=tables.design_facts(design, plan),
        effectors=tables.effectors(design, merit, plan),
        spectra=_spectra(design, plan),
        signals=_signals(design, merit, plan),
        net=None if net is None else {"picture": _net(net, period), "rows": tables.net_rows(*net)},
        length=_length(compared, period),
        study=tables.study_rows(compared, period) if others else [],
        low_correlation=tables.LOW_CORRELATION,
        forecast=None if forecast is None else tables.forecast_table(forecast),
        flown=None if forecast is None else short(forecast.design.duration_s),
        with_motion=any(plan.expected(name) for name in design.names),
        motion=tables.motion_rows(plan),
        motion_of="in the steady state of the linear model",
        varied=len(plan.varied),
        provenance={"design": plan.source, "SHA-256": plan.sha256, **design.provenance},
    )


def _spectra(design: MultisineDesign, plan: FlightPlan) -> Picture:
    index = np.concatenate([s.index for s in design.signals])
    shared = index.size - np.unique(index).size
    whose = "Every line belongs to one effector, which makes the signals orthogonal over T."
    if shared:
        whose = f"Lines are shared {shared} times: the effectors that share them are not orthogonal over T."
    low, high = design.band_hz
    inside = any(a < high and b > low for a, b in plan.forbidden_hz)
    shaded = " Shaded: forbidden bands, which have to be empty." if inside else ""
    return picture(
        figures.harmonic_map(design, effector_groups(design.names, plan.vehicle), plan.forbidden_hz),
        "spectra",
        "Spectra of all effectors, and which effector has which harmonic",
        f"{whose} Look for lines that are missing, and for effectors without power where the aircraft has "
        f"its modes.{shaded}",
    )


def _signals(design: MultisineDesign, merit: Merit, plan: FlightPlan) -> list[Picture]:
    """Draw all signals over one period."""
    index = np.concatenate([s.index for s in design.signals])
    samples = samples_per_period(index, _POINTS)
    time = np.linspace(0.0, design.period_s, samples + 1)
    values = np.array([sample(s.index, s.amplitude, s.phase, samples) for s in design.signals])
    values = np.append(values, values[:, :1], axis=1)  # a period ends as it starts
    at_zero = bool(np.all(np.abs(values[:, 0]) < 1e-6 * merit.peak))
    ends = "every signal starts and ends at zero." if at_zero else "not every signal starts at zero."
    when = f"one period of {design.periods}"
    return signal_pictures(design, plan.vehicle, time, values, when, f"Each group has one scale; {ends}")


def _net(net: NetLoads, period: float) -> Picture:
    axes, loads, before = net
    loads, before = (np.append(rows, np.asarray(rows)[:, :1], axis=1) for rows in (loads, before))
    time = np.linspace(0.0, period, loads.shape[1])
    return picture(
        figures.net_load_strips(axes, time, loads, before),
        "net",
        f"Net loads of all effectors over one period: {', '.join(axes)}",
        "What all effectors together do to the aircraft. Starts and senses of the signals are free, so they "
        "are chosen to keep these peaks (dashed) low.",
    )


def _length(compared: Study, period: float) -> list[Picture]:
    curves = {float(t.time[-1]): (t.time, t.max_correlation, t.condition_number) for _, t in compared}
    pictures = [
        picture(
            figures.while_flying(curves, period),
            "flying",
            "Largest correlation and condition number against the length flown",
            Markup(
                "What a manoeuvre is worth when it is broken off: both figures fall while it is flown and "
                "reach 0 and 1 at its end, the dot, unless harmonics are shared. Above {:g}, the condition "
                "number is not drawn."
            ).format(figures.WORST_CONDITION),
        )
    ]
    if len(compared) > 1:
        factors = {float(t.time[-1]): m.rpf for m, t in compared}
        pictures.append(
            picture(
                figures.factors_over_period(factors, period),
                "factors",
                "Relative peak factors over the period",
                "A dot for each signal, a diamond for their median, black for this design. A longer period "
                "has more harmonics for each signal, which tend to add up to lower peaks.",
            )
        )
    return pictures


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
    trim: Mapping[str, float] | None = None,
    condition: str = "",
) -> FlightPlan:
    """Return how a design is to be flown, and what motion is expected where there is a model.

    `destination` is the design's file; None where it has none yet. `trim` has the positions of effectors
    where it is flown, SI; the model's where absent.
    """
    excitation, vehicle = scenario.excitation, scenario.aircraft()
    assert excitation is not None
    watched = tuple(dict.fromkeys((*STATES, *excitation.excursions, *design.names)))
    return FlightPlan(
        vehicle=vehicle,
        condition=_condition(scenario, condition),
        trim=trim if trim is not None else (aircraft.trim if aircraft else {}),
        source=destination.name if destination else "",
        sha256=hashlib.sha256(destination.read_bytes()).hexdigest() if destination else "",
        forbidden_hz=excitation.forbidden_hz,
        fade_s=excitation.fade_s,
        abort=excitation.abort,
        control="gains of [control]" if scenario.control.get("gains") else "",
        motion=excursions(design, aircraft.loop, watched) if aircraft else None,
        varied=[excursions(design, loop, watched) for loop in aircraft.varied] if aircraft else (),
    )


def _condition(scenario: Scenario, at: str) -> str:
    """Return a reference in words, with all that is set there: the card's reader has no scenario at hand."""
    reference = next((r for r in scenario.reference if r.id == at), None)
    if reference is None:
        return at
    kinds = {e.name: EFFECTOR_UNITS[e.kind] for e in scenario.effector}
    words = [f"u {short(reference.u)} m/s"] if math.isfinite(reference.u) else []
    for name, value in reference.scheduled.items():
        unit, factor = engineering(kinds.get(name) or {**STATE, **AIR}.get(name, ("1",))[0])
        words.append(f"{name} {short(factor * value)} {pretty_unit(unit)}".rstrip())
    return f"{at}: {', '.join(words)}" if words else at


def write_cards(destination: Path, card: Card) -> list[Path]:
    """Write a test card as text and HTML beside a design; return their paths."""
    text = destination.with_name(f"{destination.stem}-card.txt")
    write_text(text, test_card_text(card))
    write_test_card(text.with_suffix(".html"), card)
    return [text, text.with_suffix(".html")]

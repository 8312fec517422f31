"""Results as matplotlib figures."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from freqid.blend.corridor_study import StudyResults
from freqid.blend.global_model import GlobalModel
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy
from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.advance_ratio import AdvanceRatioModel
from freqid.core.results.corridor import Corridor
from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs
from freqid.core.results.diagnosis import GapDiagnosis
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.results.judged.monte_carlo import MonteCarlo
from freqid.core.results.loop_margins import LoopMargins
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.results.prediction import Prediction, Score
from freqid.core.results.rivals import Rivals
from freqid.identify.sensors.errors import SensorErrors
from freqid.report.advance_ratio.figures import derivatives_over_advance_ratio
from freqid.report.design.figures import GROUP_COLOURS, signal_rows
from freqid.report.gap.figures import probability_bars
from freqid.report.kit.figures import channel_strips
from freqid.report.margins.page import margins_along
from freqid.report.monte_carlo.page import measures_along
from freqid.report.prediction.page import band_strips, difference_strips
from freqid.report.response.page import bode

from .tables import frame_of, samples_of

_MOST = 12  # explanations or contests that are drawn
_STRIPS = 24  # channels
_BANDS = 12  # channels with bands
_MOST_LAWS = 6  # derivatives


@singledispatch
def figure_of(result: Any) -> Figure:
    """Return a result as a figure.

    Raises
    ------
    UsageError
        For something that has none.
    """
    raise UsageError(f"a {type(result).__name__} has no figure", remedy="look at its attributes")


@figure_of.register
def _of_record(record: FlightRecord) -> Figure:
    """Draw the channels that move, states and then effectors first."""
    moving = [n for n, c in record.channels.items() if np.ptp(c.values) > 0]
    moving.sort(key=lambda n: (not n.startswith("state/"), not n.startswith("effector/")))
    return channel_strips(record, moving[:_STRIPS])


@figure_of.register
def _of_maneuver(maneuver: Maneuver) -> Figure:
    return _of_record(maneuver.record)


@figure_of.register
def _of_samples(inputs: SampledInputs) -> Figure:
    peak = np.abs(inputs.values).max(axis=1)
    notes = [f"{x:.3g} {unit}" for x, unit in zip(peak, inputs.units, strict=True)]
    colours = [GROUP_COLOURS[0]] * len(inputs.names)
    return signal_rows(inputs.names, inputs.time, inputs.values, peak.tolist(), notes, colours)


@figure_of.register
def _of_design(design: MultisineDesign | ClassicDesign) -> Figure:
    return _of_samples(samples_of(design))


@figure_of.register
def _of_point(model: PointModel) -> Figure:
    """Draw each response over frequency, or over time where no lines were regressed."""
    figure, panels = _stacked(len(model.responses), 1.9)
    for axes, (name, r) in zip(panels, model.responses.items(), strict=True):
        on_lines = "frequency" in r.fit
        fit = r.fit["frequency" if on_lines else "time"]
        size = np.abs if on_lines else np.asarray
        axes.plot(fit.axis, size(fit.measured), color="0.6", linewidth=2, label="measured")
        axes.plot(fit.axis, size(fit.modelled), linewidth=1, label="model")
        axes.set_ylabel(f"{name} ({r.unit}{' s' if on_lines else ''})")
        axes.set_title(f"R2 {r.r2:.4f}", loc="right", fontsize="small")
        axes.set_xlabel("Frequency (Hz)" if on_lines else "Time (s)")
    panels[0].legend(frameon=False)
    return figure


@figure_of.register
def _of_output_error(found: OutputErrorModel) -> Figure:
    """Draw each output as measured and as the model gives it."""
    if not found.fit:
        raise UsageError("the model diverged, so there is no fit to draw", remedy="look at its remarks")
    figure, panels = _stacked(len(found.fit), 1.6)
    on_lines = found.domain == "frequency"
    size = np.abs if on_lines else np.asarray
    for axes, (name, fit) in zip(panels, found.fit.items(), strict=True):
        axes.plot(fit.axis, size(fit.measured), color="0.6", linewidth=2, label="measured")
        axes.plot(fit.axis, size(fit.modelled), linewidth=1, label="model")
        axes.set_ylabel(name)
        axes.set_title(f"R2 {fit.r2:.4f}", loc="right", fontsize="small")
    panels[-1].set_xlabel("Frequency (Hz)" if on_lines else "Time (s)")
    panels[0].legend(frameon=False)
    return figure


@figure_of.register
def _of_margins(found: LoopMargins) -> Figure:
    """Draw the phase margin of every axis along the corridor."""
    return margins_along(found, "phase_deg", list(found.axes[:_MOST_LAWS]))


@figure_of.register
def _of_campaign_cases(found: MonteCarlo) -> Figure:
    """Draw every measure over all quantities against the axis."""
    return measures_along(found, [m for m in found.measures if found.of(m)])


@figure_of.register
def _of_advance_ratio(model: AdvanceRatioModel) -> Figure:
    """Draw the derivatives that depend on the advance ratio, those that change most first."""
    changes: dict[str, float] = {}
    for name in model.names:
        laws = [c.laws[name] for c in model.clusters if name in c.laws]
        changes[name] = max(
            (abs(float(law.increment(law.lowest))) / law.std_error for law in laws if law.std_error),
            default=0.0,
        )
    most = sorted(model.names, key=lambda n: -changes[n])[:_MOST_LAWS]
    return derivatives_over_advance_ratio(model, most)


@figure_of.register
def _of_campaign(study: CampaignStudy) -> Figure:
    return _of_advance_ratio(study.models[0])


@figure_of.register
def _of_corridor(corridor: Corridor) -> Figure:
    """Draw every response's parameters along the corridor, each over its largest value."""
    label, place = "Speed u (m/s)", corridor.u
    if corridor.along != "u":
        row = corridor.scheduled.index(corridor.along)
        label, place = f"{corridor.along} ({corridor.scheduled_units[row]})", corridor.schedule[row]
    figure, panels = _stacked(len(corridor.responses), 2.2)
    for axes, (name, k) in zip(panels, corridor.responses.items(), strict=True):
        for parameter, estimate in zip(k.regressors, k.estimate, strict=True):
            share = estimate / (np.abs(estimate).max() or 1.0)
            (drawn,) = axes.plot([], [], "o-", markersize=3, label=parameter)
            for line in range(corridor.line.max() + 1):
                on = corridor.line == line
                axes.plot(place[on], share[on], "o-", color=drawn.get_color(), markersize=3)
        axes.set_ylabel(f"{name}, over the largest")
        axes.set_xlabel(label)
    names = {line.get_label(): line for axes in panels for line in axes.lines if line.get_xdata().size == 0}
    figure.legend(names.values(), names.keys(), loc="outside right upper", frameon=False, fontsize="small")
    return figure


@figure_of.register
def _of_global(model: GlobalModel) -> Figure:
    return _of_corridor(model.corridor)


@figure_of.register
def _of_study(results: StudyResults) -> Figure:
    if results.model is None:
        raise UsageError("the study has no global model to draw", remedy="look at its points")
    return _of_global(results.model)


@figure_of.register
def _of_response(response: FrequencyResponse) -> Figure:
    """Draw the first pair; `FrequencyResponse.of` chooses another."""
    return bode(response, response.outputs[0], response.inputs[0])


@figure_of.register
def _of_diagnosis(d: GapDiagnosis) -> Figure:
    table = frame_of(d).head(_MOST)
    chances = table["probability"].to_numpy()
    return probability_bars(table["effect"].tolist(), chances, table["in the set"].tolist())


@figure_of.register
def _of_rivals(found: Rivals) -> Figure:
    figure, (axes,) = _stacked(1, 3.0)
    table = frame_of(found).head(_MOST)
    at = np.arange(len(table))
    axes.barh(at - 0.2, table["misfit A"], height=0.4, label=f"A: {found.simulations[0]}")
    axes.barh(at + 0.2, table["misfit B"], height=0.4, label=f"B: {found.simulations[1]}")
    axes.set_yticks(at, [f"{r}, {g}" for r, g in zip(table["response"], table["regime"], strict=True)])
    axes.set_xlabel("Misfit beyond noise and tolerances; 0 is noise")
    axes.legend(frameon=False)
    return figure


@figure_of.register
def _of_estimates(found: SensorErrors) -> Figure:
    """Draw sensor errors in their standard errors."""
    figure, (axes,) = _stacked(1, 0.8 + 0.3 * len(found.names))
    axes.errorbar(found.estimate / found.std_error, found.names, xerr=2, fmt="o", markersize=3)
    axes.axvline(0, color="0.6")
    axes.set_xlabel("Sensor error in its standard errors, with 2 sigma")
    return figure


def _stacked(count: int, height: float) -> tuple[Figure, Sequence[Any]]:
    """Return a figure with panels below each other, each so many inches high."""
    figure = Figure(figsize=(7, height * count), layout="constrained")
    return figure, list(np.atleast_1d(np.asarray(figure.subplots(count))))


@figure_of.register
def _of_prediction(prediction: Prediction) -> Figure:
    """Draw the states with their bands."""
    return band_strips(prediction.channels[:_BANDS], prediction.time)


@figure_of.register
def _of_score(score: Score) -> Figure:
    """Draw what was flown less what was predicted, in the bands."""
    return difference_strips(score.channels[:_BANDS])

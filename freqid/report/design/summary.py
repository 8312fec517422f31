"""A design in figures: for machines as plain data, for people as a table on the terminal."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from freqid.core.results.design import ClassicDesign
from freqid.design.classic import Extent
from freqid.design.finish import FinishedSet
from freqid.design.forecast.standard_errors import Forecast
from freqid.design.multisine.merit import Merit
from freqid.report.design.flight_plan import FlightPlan


def multisine_summary(
    finished: FinishedSet, judged: Merit, plan: FlightPlan, forecast: Forecast | None
) -> dict[str, Any]:
    """Return what a set of multisines is, JSON-compatible, SI.

    Parameters
    ----------
    finished : FinishedSet
    judged : Merit
    plan : FlightPlan
        With the expected motion, where there is a model.
    forecast : Forecast, optional
    """
    design = finished.design
    summary: dict[str, Any] = {
        "waveform": "multisine",
        "effectors": {
            signal.name: {
                "rpf": float(judged.rpf[i]),
                **_extent(judged, i),
                "units": signal.unit,
                "harmonics": signal.index.tolist(),
            }
            for i, signal in enumerate(design.signals)
        },
        "max_correlation": judged.max_correlation,
        "condition_number": judged.condition_number,
        "period_s": design.period_s,
        "periods": design.periods,
        "duration_s": design.duration_s,
    }
    if finished.optimum is not None:
        summary["amplitudes"] = {
            "criterion": finished.optimum.criterion,
            "scale": dict(zip(design.names, finished.optimum.scale.tolist(), strict=True)),
            "binding": list(finished.optimum.binding),
        }
    if forecast is not None:
        summary["forecast"] = {
            name: {
                regressor: {"parameter": float(value), "std_error": float(error)}
                for regressor, value, error in zip(r.regressors, r.parameter, r.std_error, strict=True)
            }
            for name, r in forecast.responses.items()
        }
    return summary | _motion(plan)


def classic_summary(design: ClassicDesign, judged: Extent, plan: FlightPlan) -> dict[str, Any]:
    """Return what classic inputs are, JSON-compatible, SI."""
    return {
        "waveform": design.waveform,
        "effectors": {
            name: {"amplitude": amplitude, **_extent(judged, i), "units": design.inputs.units[i]}
            for i, (name, amplitude) in enumerate(design.amplitude.items())
        },
        "periods": design.periods,
        "duration_s": float(design.inputs.time[-1]),
    } | _motion(plan)


def multisine_table(finished: FinishedSet, judged: Merit) -> str:
    """Return a set of multisines as lines for the terminal."""
    design = finished.design
    lines = [f"{'effector':<10} {'RPF':>6} {_HEAD}  unit   harmonics of 1/T"]
    for i, signal in enumerate(design.signals):
        lines.append(
            f"{signal.name:<10} {judged.rpf[i]:>6.3f} {_figures(judged, i)}  {signal.unit:<6} "
            f"{' '.join(map(str, signal.index))}"
        )
    low, middle, high = np.quantile(judged.rpf, [0, 0.5, 1])
    lines.append(
        f"RPF min/median/max {low:.3f}/{middle:.3f}/{high:.3f}, largest correlation "
        f"{judged.max_correlation:.1e}, condition number {judged.condition_number:.6f}"
    )
    if finished.optimum is not None:
        bound = ", ".join(finished.optimum.binding)
        lines.append(f"{finished.optimum.criterion}-optimal amplitudes, held back by {bound}")
    flown = f"{design.periods} period{'s' * (design.periods > 1)} of {design.period_s:g} s"
    return "\n".join([*lines, flown])


def classic_table(design: ClassicDesign, judged: Extent) -> str:
    """Return classic inputs as lines for the terminal."""
    lines = [f"{'effector':<10} {_HEAD}  unit"]
    for i, (name, unit) in enumerate(zip(design.inputs.names, design.inputs.units, strict=True)):
        lines.append(f"{name:<10} {_figures(judged, i)}  {unit}")
    return "\n".join([*lines, f"{design.waveform}, {design.inputs.time[-1]:g} s"])


_HEAD = f"{'rms':>10} {'peak':>10} {'slew /s':>10}"


def _figures(judged: Merit | Extent, i: int) -> str:
    return f"{judged.rms[i]:>10.4g} {judged.peak[i]:>10.4g} {judged.slew[i]:>10.4g}"


def _extent(judged: Merit | Extent, i: int) -> dict[str, float]:
    return {name: float(getattr(judged, name)[i]) for name in ("rms", "peak", "slew")}


def _motion(plan: FlightPlan) -> dict[str, Any]:
    """Return expected excursions by channel; the spread is missing where it is not known."""
    if plan.motion is None:
        return {}
    summary = {}
    for name in plan.motion.names:
        rms, peak, spread = plan.expected(name) or (math.nan,) * 3
        summary[name] = {"rms": rms, "peak": peak} | ({} if math.isnan(spread) else {"spread": spread})
    return {"expected": summary}

"""What a design's page says in words and numbers: the verdict and the rows of its tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from markupsafe import Markup

from freqid.core.arrays import Array
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.design.classic import Extent
from freqid.design.forecast.standard_errors import Forecast
from freqid.design.multisine.merit import Merit, Truncation
from freqid.report.design.flight_plan import FlightPlan, intrusions
from freqid.report.kit.effectors import effector_groups, engineering, reach, runs
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import (
    NONE,
    exact,
    measured_values,
    number,
    percent,
    pretty_unit,
    short,
    shown_unit,
)

ORTHOGONAL = 1e-10
LOW_CORRELATION = 0.3
"""Below this, signals of a manoeuvre that was broken off still tell effectors apart well."""

MOST_NAMED = 8  # effectors in a headline
ROUNDING = 1e-9  # by which an amplitude that is as large as a limit allows may miss it
NO_PARAMETER = 1e-6
"""A parameter smaller than this share of its error is not in the model: what is left is rounding."""


def design_findings(
    design: MultisineDesign, merit: Merit, truncation: Truncation, plan: FlightPlan, net: Any | None
) -> list[Finding]:
    """Return what a reviewer should know first, the headline first."""
    findings = [_orthogonal(design, merit, truncation)]
    findings += [_empty(design, plan)] if plan.forbidden_hz else []
    if net is not None:
        gain = 1 - np.abs(net[1]).max(axis=1) / np.abs(net[2]).max(axis=1)
        text = "With starts and senses chosen, net peaks change by {} ({}) to {} ({})."
        best, worst = int(gain.argmax()), int(gain.argmin())
        parts = (_change(-gain[best]), net[0][best], _change(-gain[worst]), net[0][worst])
        findings.append(finding("good" if gain.mean() > 0 else "note", text, *parts))
    if plan.motion is not None and plan.abort:
        findings.append(aborts(plan))
    findings.sort(key=lambda f: ("bad", "note", "good").index(f.kind))
    return [_headline(merit, effectors(design, merit, plan)), *findings]


def effectors(design: MultisineDesign, merit: Merit, plan: FlightPlan) -> list[dict[str, Any]]:
    """Return the rows of the table of effectors; shares are of what the trim leaves."""
    return [
        row | {"rpf": exact(factor, f"{factor:.3f}"), "harmonics": runs(np.sort(signal.index).tolist())}
        for row, factor, signal in zip(movements(design, merit, plan), merit.rpf, design.signals, strict=True)
    ]


def movements(
    design: MultisineDesign | ClassicDesign, judged: Merit | Extent, plan: FlightPlan
) -> list[dict[str, Any]]:
    """Return how far and how fast each effector is moved, beside its limits."""
    rows, beyond = [], plan.saturated(1.0)
    for i, name in enumerate(design.names):
        unit, factor = engineering(design.units[i])
        room = reach(plan.vehicle, name, plan.trim)
        limit = min(-room[0], room[1]) if room else math.nan
        rate = plan.vehicle.effector(name).rate_limit or math.nan
        moved, lost = plan.expected(name), beyond.get(name, math.nan)
        used, used_rate = judged.peak[i] / limit, judged.slew[i] / rate
        rows.append(
            {
                "name": name,
                "unit": pretty_unit(unit),
                "rms": exact(factor * judged.rms[i], number(factor * judged.rms[i])),
                "peak": exact(factor * judged.peak[i], number(factor * judged.peak[i])),
                "limit": short(factor * limit),
                "used": percent(used),
                "slew": exact(factor * judged.slew[i], number(factor * judged.slew[i])),
                "rate": short(factor * rate),
                "used_rate": percent(used_rate),
                "shares": (used, used_rate),
                "moved": exact(factor * moved[1], number(factor * moved[1])) if moved else NONE,
                "beyond": percent(lost),
                "lost": lost > 0,
            }
        )
    return rows


def design_facts(design: MultisineDesign, plan: FlightPlan) -> list[tuple[str, str]]:
    """Return what the design is, label and text."""
    lines = np.unique(np.concatenate([s.index for s in design.signals]))
    band = " to ".join(short(f) for f in design.band_hz)
    facts = [
        ("Effectors", ", ".join(effector_groups(design.names, plan.vehicle))),
        ("Condition", plan.condition),
        ("Manoeuvre", f"{design.periods} periods of {short(design.period_s)} s"),
        ("Band", f"{band} Hz"),
        ("Harmonics", f"{lines.size}: {runs(lines.tolist())}"),
        ("Amplitudes", str(design.provenance.get("amplitudes", ""))),
        ("Sampled at", f"{short(1 / design.dt_s)} Hz"),
        ("Seed", str(design.seed)),
        ("File", plan.source),
    ]
    return [(label, text) for label, text in facts if text]


def net_rows(axes: Sequence[str], loads: Array, before: Array) -> list[dict[str, Any]]:
    """Return rms and peaks of the net load on each axis."""
    rows = []
    for name, after, old in zip(axes, loads, before, strict=True):
        rms, peak, was = np.sqrt(np.mean(after**2)), np.abs(after).max(), np.abs(old).max()
        rows.append(
            {
                "name": name,
                "unit": "N" if name in "XYZ" else "N m",
                "rms": exact(rms, number(rms)),
                "before": exact(was, number(was)),
                "peak": exact(peak, number(peak)),
                "change": _change(peak / was - 1),
            }
        )
    return rows


def study_rows(study: Sequence[tuple[Merit, Truncation]], chosen: float) -> list[dict[str, Any]]:
    """Return one row for each period T of a study, in order."""
    rows = []
    for merit, truncation in sorted(study, key=lambda pair: pair[1].time[-1]):
        period = float(truncation.time[-1])
        low, middle, high = (f"{x:.3f}" for x in (merit.rpf.min(), np.median(merit.rpf), merit.rpf.max()))
        settled = usable_from(truncation)
        rows.append(
            {
                "period": short(period),
                "chosen": period == chosen,
                "rpf": (low, middle, high),
                "correlation": number(merit.max_correlation, 2),
                "condition": _condition(merit),
                "usable": f"{settled:.0f} s",
                "share": percent(settled / period),
            }
        )
    return rows


def usable_from(truncation: Truncation) -> float:
    """Return the length flown from which on no correlation exceeds `LOW_CORRELATION`, s."""
    above = np.flatnonzero(truncation.max_correlation > LOW_CORRELATION)
    return float(truncation.time[above[-1] + 1]) if above.size else float(truncation.time[0])


def forecast_table(expected: Forecast) -> dict[str, Any]:
    """Return expected standard errors, regressors by responses."""
    responses = list(expected.responses.values())
    names = list(dict.fromkeys(name for response in responses for name in response.regressors))
    rows = []
    for name in names:
        cells = []
        for response in responses:
            if name not in response.regressors:
                cells.append({"share": "", "values": "", "weak": False})
                continue
            j = response.regressors.index(name)
            value, error = float(response.parameter[j]), float(response.std_error[j])
            written, estimate = measured_values(error, value)
            share = error / abs(value) if abs(value) > NO_PARAMETER * error else math.inf
            text = percent(share) if math.isfinite(share) else NONE
            cells.append(
                {
                    "share": exact(error, text),
                    "values": f"{estimate} ± {written}",
                    "weak": 0.5 < share < math.inf,
                }
            )
        rows.append({"name": name, "cells": cells})
    largest = []
    for response in responses:
        apart = np.abs(np.tril(response.correlation, -1))
        i, j = np.unravel_index(int(apart.argmax()), apart.shape)
        pair = f"{response.regressors[j]}, {response.regressors[i]}"
        largest.append((number(float(response.correlation[i, j]), 2), pair) if apart.size > 1 else (NONE, ""))
    return {"responses": [(r.response, r.unit) for r in responses], "rows": rows, "largest": largest}


def motion_rows(plan: FlightPlan) -> list[dict[str, Any]]:
    """Return what states and loads are expected to do at full size."""
    rows = []
    for name in plan.states:
        found = plan.expected(name)
        if plan.motion is None or found is None:
            continue
        unit, factor = shown_unit(f"state/{name}", plan.motion.units[plan.motion.names.index(name)])
        rms, peak, spread = (factor * value for value in found)
        abort = factor * plan.abort[name] if name in plan.abort else math.nan
        rows.append(
            {
                "name": name,
                "unit": pretty_unit(unit),
                "rms": exact(rms, number(rms)),
                "peak": exact(peak, number(peak)),
                "spread": number(spread, 2),
                "abort": short(abort),
                "missed": peak > abort,
            }
        )
    return rows


def judge_limits(rows: Sequence[Mapping[str, Any]]) -> tuple[Literal["good", "note", "bad"], Markup]:
    """Return kind and words of what the rows of `movements` say about limits."""
    over = [code(row["name"]) for row in rows if max(row["shares"]) > 1 + ROUNDING]
    unknown = [code(row["name"]) for row in rows if math.isnan(row["shares"][0])]
    if over:
        return "bad", Markup("{} beyond a limit or a slew rate").format(listed(_first(over)))
    if unknown:
        return "note", Markup(
            "limits of {} are not judged: their trim is not given (a point model has it: --model)"
        ).format(listed(_first(unknown)))
    return "good", Markup("no signal exceeds a limit or a slew rate")


def _first(names: Sequence[Markup]) -> list[Markup]:
    """Return a list that a headline can hold: a few names, and how many more there are."""
    if len(names) <= MOST_NAMED:
        return list(names)
    return [*names[: MOST_NAMED - 1], Markup("{} more").format(len(names) - MOST_NAMED + 1)]


def _headline(merit: Merit, rows: Sequence[Mapping[str, Any]]) -> Finding:
    low, middle, high = merit.rpf.min(), np.median(merit.rpf), merit.rpf.max()
    spread = f"{low:.3f}, {middle:.3f}, {high:.3f}"
    kind, limits = judge_limits(rows)
    text = (
        "Relative peak factor {} (lowest, median, highest); largest correlation {}; condition number {}; {}."
    )
    return finding(kind, text, spread, number(merit.max_correlation, 2), _condition(merit), limits)


def _orthogonal(design: MultisineDesign, merit: Merit, truncation: Truncation) -> Finding:
    if merit.max_correlation > ORTHOGONAL:
        i, j = np.unravel_index(
            int(np.abs(merit.correlation - np.eye(len(merit.names))).argmax()), merit.correlation.shape
        )
        text = "{} and {} share harmonics: their correlation over T is {}."
        return finding(
            "bad", text, code(merit.names[i]), code(merit.names[j]), number(merit.correlation[i, j])
        )
    text = "All signals are orthogonal over T. Cut short after {:.0f} s, no two correlate by more than {:g}."
    return finding("good", text, usable_from(truncation), LOW_CORRELATION)


def _empty(design: MultisineDesign, plan: FlightPlan) -> Finding:
    found = [(name, f) for band in plan.forbidden_hz for name, f in intrusions(design, band)]
    bands = listed(Markup("{} to {} Hz").format(short(a), short(b)) for a, b in plan.forbidden_hz)
    if not found:
        return finding("good", "Nothing is put into the forbidden bands, {}.", bands)
    phrases = [Markup("{} at {} Hz").format(code(name), short(f)) for name, f in found[:4]]
    phrases += [Markup("{} more").format(len(found) - 4)] if len(found) > 4 else []
    return finding("bad", "Forbidden bands, {}, are not empty: {}.", bands, listed(phrases))


def aborts(plan: FlightPlan) -> Finding:
    """Return whether expected peaks stay within the limits at which a run is broken off."""
    over = [row["name"] for row in motion_rows(plan) if row["missed"]]
    if over:
        listing = listed(map(code, over))
        return finding("bad", "Expected peaks of {} are beyond their abort limits.", listing)
    return finding("good", "Expected peaks stay within every abort limit that is predicted.")


def _condition(merit: Merit) -> str:
    """Return the condition number with the digits that show how far from 1 it is."""
    return f"{merit.condition_number:.4f}" if merit.condition_number < 10 else number(merit.condition_number)


def _change(share: float) -> str:
    return f"{'+' if share > 0 else '−'}{abs(100 * share):.0f} %"

"""One self-contained page about a sealed prediction, and one about the flight beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from freqid import __version__
from freqid.core.results.prediction import QUANTILE, ChannelScore, PredictedChannel, Prediction, Score
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    ORANGE,
    draw_history,
    draw_legend,
    few_ticks,
    literal,
    name_panel,
    share_time,
    stacked_panels,
    styled,
)
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import number, percent, shown_unit
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

SHOWN_S = 30.0  # of a history: more hides whether it is inside its band
STRIPS = 6  # channels in one figure
_MOST_EFFECTORS = 6


@styled
def band_strips(channels: Sequence[PredictedChannel], time: np.ndarray, low: float = 0.0) -> Figure:
    """Draw predicted channels with their bands, one strip each.

    Parameters
    ----------
    channels : sequence of PredictedChannel
    time : ndarray, shape (sample,)
    low : float
        First second that is drawn.
    """
    rows = [(c.name, c.unit, time, c.change, c.std, None) for c in channels]
    return _strips(rows, low)


@styled
def flown_strips(channels: Sequence[ChannelScore], low: float = 0.0) -> Figure:
    """Draw channels as flown in their bands, one strip each.

    Parameters
    ----------
    channels : sequence of ChannelScore
    low : float
        First second that is drawn.
    """
    rows = [(c.name, c.unit, c.time, c.predicted, c.std, c.measured) for c in channels]
    return _strips(rows, low)


@styled
def difference_strips(channels: Sequence[ChannelScore]) -> Figure:
    """Draw what was flown less what was predicted, over the whole flight, in the band; one strip each.

    Parameters
    ----------
    channels : sequence of ChannelScore
    """
    figure, panels = stacked_panels([0.62] * len(channels), legend=1)
    marks: list[Artist] = []
    for axes, c in zip(panels, channels, strict=True):
        label, factor = shown_unit(_channel(c.name), c.unit)
        width = factor * QUANTILE * c.std
        band = axes.fill_between(*_ends(c.time, -width, width), color=BLUE, alpha=0.22, linewidth=0)
        off = factor * (c.measured - c.predicted)
        line = draw_history(axes, c.time, off, ORANGE, linewidth=0.5)
        name_panel(axes, literal(c.name, 40), label)
        few_ticks(axes)
        band.set_label("95 % band")
        line.set_label("flown less predicted")
        marks = [band, line]
    draw_legend(figure, marks)
    share_time(panels, channels[0].time)
    return figure


def _ends(time: Any, low: Any, high: Any) -> tuple[Any, Any, Any]:
    """Return a band thinned to what a screen shows."""
    step = max(1, time.size // 400)
    return time[::step], low[::step], high[::step]


def _strips(rows: Sequence[tuple[str, str, Any, Any, Any, Any]], low: float) -> Figure:
    """Draw rows of name, unit, time, prediction, one sigma and, where flown, what was measured."""
    figure, panels = stacked_panels([0.62] * len(rows), legend=1)
    legend: dict[str, Any] = {}
    shown_time = np.array([low, low + SHOWN_S])
    for axes, (name, unit, time, change, std, measured) in zip(panels, rows, strict=True):
        shown = (time >= low) & (time <= low + SHOWN_S)
        label, factor = shown_unit(_channel(name), unit)
        t, y, s = time[shown], factor * change[shown], factor * std[shown]
        shown_time = t
        band = axes.fill_between(t, y - QUANTILE * s, y + QUANTILE * s, color=BLUE, alpha=0.22, linewidth=0)
        band.set_label("95 % band")
        legend["band"] = band
        if measured is not None:
            legend["measured"] = draw_history(axes, t, factor * measured[shown], ORANGE, linewidth=0.7)
            legend["measured"].set_label("flown")
        legend["predicted"] = draw_history(axes, t, y, GREY if measured is not None else BLUE, linewidth=0.9)
        legend["predicted"].set_label("predicted")
        name_panel(axes, literal(name, 40), label)
        few_ticks(axes)
    draw_legend(figure, list(legend.values()))
    share_time(panels, shown_time)
    return figure


def build_prediction_page(prediction: Prediction) -> str:
    """Return the page of a sealed prediction: one HTML text that fetches nothing."""
    at = prediction.reference.id or f"u = {prediction.reference.u:.4g} m/s"
    return render(
        "prediction.html",
        title=f"{prediction.vehicle} at {at}",
        what=f"What {Path(prediction.model).name} says of a flight of {Path(prediction.design_name).name}, "
        f"sealed {prediction.date}.",
        kind="sealed prediction",
        version=__version__,
        findings=_prediction_findings(prediction),
        facts=[
            ("Sealed", prediction.date),
            ("Checksum", prediction.checksum[:16]),
            ("Length", f"{prediction.time[-1]:.4g} s"),
            ("Model", prediction.model_kind),
        ],
        predicted=[_predicted_row(c) for c in prediction.channels],
        scored=[],
        assumed=[
            {"name": a.name, "statement": a.statement, "limit": _limit(a)} for a in prediction.assumptions
        ],
        checked=[],
        drawn=_prediction_pictures(prediction),
        provenance={
            "checksum": prediction.checksum,
            "model": {"file": prediction.model, "sha256": prediction.model_sha256},
            "design": {"file": prediction.design_name, "sha256": prediction.design_sha256},
            "settings": prediction.settings,
        },
    )


def build_score_page(score: Score) -> str:
    """Return the page of a flight beside its prediction, likewise."""
    return render(
        "prediction.html",
        title=Path(score.record).name,
        what=f"Held against {Path(score.prediction).name}, which was sealed {score.date}.",
        kind="scored prediction",
        version=__version__,
        findings=_score_findings(score),
        facts=[
            *((f"In the bands, {kind}", percent(share)) for kind, share in score.coverage.items()),
            ("Gate", percent(score.gate)),
            ("Checksum", score.checksum[:16]),
        ],
        predicted=[],
        scored=[_scored_row(c) for c in score.channels],
        assumed=[],
        checked=[
            {"name": c.name, "statement": c.statement, "held": c.held, "evidence": c.evidence}
            for c in score.checks
        ],
        drawn=_score_pictures(score),
        provenance={
            "prediction": {"file": score.prediction, "checksum": score.checksum, "sealed": score.date},
            "record": {
                "file": score.record,
                "fingerprint": score.fingerprint,
                "flown or written": score.flown,
            },
        },
    )


def _prediction_findings(prediction: Prediction) -> list[Finding]:
    findings = [
        finding(
            "good",
            "{} channels are predicted over {} s, each with a band meant to hold 95 % of its samples.",
            len(prediction.channels),
            f"{prediction.time[-1]:.4g}",
        )
    ]
    return findings + [finding("note", "{}.", _sentence(remark)) for remark in prediction.remarks]


def _score_findings(score: Score) -> list[Finding]:
    kind = "good" if score.passed else "bad"
    shares = ", ".join(f"{k} {percent(share)}" for k, share in score.coverage.items())
    findings = [finding(kind, "In the 95 % bands: {}; the gate is {}.", shares, percent(score.gate))]
    failed = [c for c in score.checks if c.held == "no"]
    findings += [finding("bad", "Failed: {} ({}).", c.statement, c.evidence) for c in failed]
    if not failed:
        findings.append(finding("good", "No assumption that the record tells of failed."))
    return findings


def _limit(assumption: Any) -> str:
    if not math.isfinite(assumption.limit):
        return "a record does not tell"
    return f"{assumption.limit:g} ({assumption.unit})"


def _predicted_row(c: PredictedChannel) -> dict[str, Any]:
    parts = [np.mean(c.parameter_std**2), c.residual_std**2, c.gust_std**2, c.noise_std**2]
    total = sum(parts)
    label, factor = shown_unit(_channel(c.name), c.unit)
    return {
        "name": c.name,
        "unit": label,
        "moved": number(factor * float(c.change.std())),
        "width": number(factor * QUANTILE * float(np.sqrt(np.mean(c.std**2)))),
        "shares": [_whole(float(part / total) if total else math.nan) for part in parts],
    }


def _scored_row(c: ChannelScore) -> dict[str, Any]:
    label, factor = shown_unit(_channel(c.name), c.unit)
    return {
        "kind": c.kind,
        "name": c.name,
        "unit": label,
        "coverage": percent(c.coverage),
        "low": c.coverage < 0.9,
        "rmse": number(factor * c.rmse),
        "expected": number(factor * c.expected_rmse),
        "theil": f"{c.theil:.3f}",
        "shares": [_whole(share) for share in c.shares],
    }


def _prediction_pictures(prediction: Prediction) -> list[Picture]:
    drawn = []
    low = float(min(max(prediction.time[-1] - SHOWN_S, 0.0), 10.0))
    for name, part in _parts([c.kind for c in prediction.channels], prediction.channels):
        drawn.append(
            picture(
                band_strips(part, prediction.time, low),
                f"bands{len(drawn)}",
                f"Predicted {name} with bands: {', '.join(c.name for c in part)}",
                f"Predicted {name}, changes from the trim, {low:g} to {low + SHOWN_S:g} s.",
            )
        )
    return drawn


def _score_pictures(score: Score) -> list[Picture]:
    free = [c for c in score.channels if c.kind == "free-run"]
    one_step = [c for c in score.channels if c.kind == "one-step"]
    kinds = ["wrench" if c.name in "XYZLMN" else "state" if c.name in _STATES else "effector" for c in free]
    groups = [(f"free-running {n}", part) for n, part in _parts(kinds, free)]
    groups += [
        ("wrench from the flown states", part) for _, part in _parts(["wrench"] * len(one_step), one_step)
    ]
    low = 10.0 if free and free[0].time[-1] > 10.0 + SHOWN_S else 0.0
    drawn = [
        picture(
            flown_strips(part, low),
            f"flown{i}",
            f"Flown and predicted {name}: {', '.join(c.name for c in part)}",
            f"{_sentence(name)}, each about its straight line, {low:g} to {low + SHOWN_S:g} s.",
        )
        for i, (name, part) in enumerate(groups[:1])
    ]
    drawn += [
        picture(
            difference_strips(part),
            f"difference{i}",
            f"Flown less predicted {name}: {', '.join(c.name for c in part)}",
            f"{_sentence(name)}: what was flown less what was predicted, each about its straight line.",
        )
        for i, (name, part) in enumerate(groups)
    ]
    return drawn


_STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")


def _channel(name: str) -> str:
    """Return a channel with its group, which decides the unit that it is shown in."""
    return f"{'state' if name in _STATES else 'response' if name in 'XYZLMN' else 'effector'}/{name}"


def _whole(share: float) -> str:
    return f"{100 * share:.0f} %" if math.isfinite(share) else "–"


def _parts(kinds: Sequence[str], channels: Sequence[Any]) -> list[tuple[str, list[Any]]]:
    """Return channels by kind, a few at a time; of effectors the first few."""
    names = {"state": "states", "effector": "effectors", "wrench": "wrench"}
    found = []
    for kind, name in names.items():
        own = [c for k, c in zip(kinds, channels, strict=True) if k == kind]
        if kind == "effector":
            own = own[:_MOST_EFFECTORS]
        found += [(name, own[i : i + STRIPS]) for i in range(0, len(own), STRIPS)]
    return found


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]

"""Tables of a page about a gap."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import islice
from typing import Any

from freqid.core.results.diagnosis import Change, Closure, GapDiagnosis, Interval, Share
from freqid.report.kit.notation import NONE, exact, number, percent, pretty_unit, sentence, short

_SHOWN = 0.005  # probability from which an effect has a row
_ROWS = 3  # of which it is said how much an effect is
_FEW_SETTINGS = 12  # more are free changes of terms, which have no names


def where_rows(d: GapDiagnosis) -> list[dict[str, Any]]:
    """Return the parts of the gap by row and injected signal."""
    return [
        {
            "response": p.response,
            "band": f"{short(p.band_hz[0])} to {short(p.band_hz[1])}",
            "share": exact(p.share, percent(p.share)),
            "regime": p.regime or NONE,
            "input": p.input or "no single signal",
            "phase": p.phase,
        }
        for p in d.where
    ]


def which_rows(d: GapDiagnosis) -> list[dict[str, Any]]:
    """Return explanations with a probability that shows, the likeliest first, and their parameters."""
    rows = []
    for name, chance in d.which.probabilities.items():
        if chance < _SHOWN:
            continue
        least = d.gap.smallest_detectable.get(name)
        rows.append(
            {
                "name": name,
                "place": d.which.places.get(name, ""),
                "chance": exact(chance, percent(chance)),
                "in_set": name in d.which.set,
                "least": NONE if least is None else with_si(least, d.gap.unit.get(name, "1")),
                "parameters": [
                    {"name": n, "text": interval(x)} for n, x in d.which.parameters.get(name, {}).items()
                ],
                "moves": [
                    f"{row} {percent(x)}" for row, x in islice(d.which.moves.get(name, {}).items(), _ROWS)
                ],
            }
        )
    return rows


def untested_rows(d: GapDiagnosis) -> list[tuple[str, str]]:
    """Return reasons why effects were not tested, and their names."""
    by_reason: dict[str, list[str]] = {}
    for name, why in d.which.not_tested.items():
        by_reason.setdefault(why, []).append(name)
    return [(", ".join(names), why) for why, names in by_reason.items()]


def tolerance_rows(d: GapDiagnosis) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the tolerances that were allowed for by where they come from: name and one sigma each."""
    words = {
        "stated": "Stated",
        "simulation": "Of the simulation",
        "default": "By default",
        "each record": "Offsets of each record",
        "clock": "By the log's clock",
    }
    by_source = [
        (heading, [(t.name, with_si(t.sigma, t.unit)) for t in d.tolerances if t.source == source])
        for source, heading in words.items()
    ]
    return [(heading, each) for heading, each in by_source if each]


def sensor_rows(d: GapDiagnosis) -> list[dict[str, str]]:
    """Return the faults that the sensors show."""
    return [
        {"fault": s.fault, "channel": s.channel, "text": interval(Interval(s.estimate, s.lo, s.hi, s.unit))}
        for s in d.sensors
    ]


def closures(d: GapDiagnosis, means: Mapping[str, Change]) -> list[dict[str, Any]]:
    """Return what each closure did.

    Parameters
    ----------
    d : GapDiagnosis
    means : mapping of Change
        By response, what the mean is off by with the first closure; `GapResult.mean_errors`.
    """
    return [
        {
            "title": " and ".join(c.effects),
            "settings": [
                {"effect": effect, "name": n, "text": interval(x)}
                for effect, values in c.settings.items()
                if len(values) <= _FEW_SETTINGS
                for n, x in values.items()
            ],
            "shares": [
                ("The effect alone", closed_share(c.effect_only)),
                ("Tolerances alone", closed_share(c.tolerances_only)),
                ("Both", closed_share(c.wrench)),
            ],
            "strained": ", ".join(f"{n} {x:+.1f}".replace("-", "−") for n, x in c.strained.items()),
            "log_score": f"{c.log_score:+.1f} nats".replace("-", "−") if math.isfinite(c.log_score) else "",
            "response": closed_share(c.response) if math.isfinite(c.response.G) else "",
            "with_cost": bool(c.rmse.keys() & c.J),
            "flown_cost": ", ".join(
                f"{n} {number(x.before, 2)} to {number(x.after, 2)}"
                for n, x in c.J.items()
                if n not in c.rmse
            ),
            "scored": _scored(c),
            "note": c.note,
            "cost": c.consequence.get("sentence", ""),
            "costs": _costs(c),
            "means": bool(shown := means if k == 0 else {}),
            "rows": [_classical(c, name, shown) for name in c.listed],
        }
        for k, c in enumerate(d.how_far)
    ]


_CHOSEN = {
    "held out": "neither which effect it is nor its size was chosen on what is scored",
    "turns": "which effect it is was chosen on all of them",
    "lines": "which effect it is was chosen on all lines",
    "": "",
}


def _scored(c: Closure) -> str:
    """Return what a closure was scored on, and what of it was chosen there."""
    return sentence(f"{c.scored_text}; {_CHOSEN[c.scored]}" if c.scored else c.scored_text)


def interval(x: Interval) -> str:
    """Return an estimate with its interval and unit."""
    unit = "" if x.unit in ("", "1") else f" {pretty_unit(x.unit)}"
    if x.lo == x.hi:
        return f"{number(x.estimate)}{unit} (given)"
    return f"{number(x.estimate)} ({number(x.lo)} to {number(x.hi)}){unit}"


def closed_share(s: Share) -> str:
    """Return a share of the gap with its interval, or why it is undefined."""
    if not math.isfinite(s.G):
        return f"undefined: {s.why_undefined}" if s.why_undefined else "undefined"
    return f"{s.G:.2f} ({s.lo:.2f} to {s.hi:.2f})".replace("-", "−")


def with_si(value: float, unit: str) -> str:
    """Return a number with its unit."""
    return f"{number(value, 2)}" + ("" if unit in ("", "1") else f" {pretty_unit(unit)}")


def _classical(c: Closure, name: str, means: Mapping[str, Change]) -> dict[str, Any]:
    def ends(change: Change | None) -> list[str]:
        if change is None:
            return [NONE] * 3
        return [number(v) for v in (change.before, change.after, change.zero)]

    return {
        "name": name,
        "rmse": ends(c.rmse.get(name)),
        "mean": ends(means.get(name))[:2] if means else [],
        "theil": ends(c.theil.get(name))[:2],
        "J": ends(c.J.get(name))[:2] if c.rmse.keys() & c.J else [],
    }


_MARGIN = {"phase_deg": ("phase margin", "deg"), "gain_up_db": ("gain margin", "dB")}
_MODE = {"frequency": ("natural frequency", "rad/s"), "damping": ("damping ratio", "")}


def _costs(c: Closure) -> list[dict[str, Any]]:
    """Return margins by axis and modes, before and after, where they are known."""
    rows = []
    for path, row in c.consequence.get("figures", {}).items():
        kind, *place, figure = path.split("/")
        labels = (_MARGIN if kind == "margins" else _MODE if kind == "closed_modes" else {}).get(figure)
        if labels is None:
            continue
        what, unit = labels
        ends = [number(row[n]) for n in ("before", "after", "lo", "hi")]
        rows.append(
            {
                "place": "/".join(place),
                "what": f"{what} ({unit})" if unit else what,
                "before": ends[0],
                "after": ends[1],
                "change": f"{ends[2]} to {ends[3]}" if math.isfinite(row["lo"]) else NONE,
            }
        )
    return rows


def next_rows(table: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the proposed tests, the best first; see ``next_flight`` of `GapDiagnosis`."""
    return [
        {
            "kind": test["kind"],
            "name": test["name"],
            "how": test["how"] + _with(test),
            "pairs": [
                {
                    "rivals": " / ".join(p["rivals"]),
                    "now": number(p["now"], 2),
                    "after": number(p["after"], 3),
                }
                for p in test["pairs"]
            ],
        }
        for test in table.get("tests", ())
    ]


def _with(test: Mapping[str, Any]) -> str:
    if test["kind"] == "ground":
        return f" ({test['instrument']})"
    return f" (predicted by {test['predicted_by']})"

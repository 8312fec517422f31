"""The part of a gap's page about its self-test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from freqid.core.results.gap_self_test import ENDS, Rate, SelfTest, Stratum
from freqid.report.gap import figures as gap_figures
from freqid.report.gap.tables import with_si
from freqid.report.kit.drawing import WIDTH
from freqid.report.kit.notation import NONE
from freqid.report.kit.pictures import Picture, picture

_LEAST = 0.01  # share of draws that is shown
_WIDE = 9.6  # inches, of a matrix by itself
_BESIDE = 18  # effects whose matrices are legible side by side


def confusions(test: SelfTest | None) -> list[Picture]:
    """Return the confusion matrices, weakest insertions first, where anything is found."""
    if test is None:
        return []
    return [_confusion(test, s, k) for k, s in enumerate(test.strata) if s.detected.share > 0.05]


def summary(test: SelfTest | None) -> dict[str, Any] | None:
    """Return the tables of a self-test."""
    if test is None:
        return None
    return {
        "draws": test.draws,
        "strata": [
            {
                "detectability": f"{s.detectability:g}",
                "rates": [
                    *(_rate(r) for r in (s.detected, s.named, s.right, s.covered)),
                    f"{s.truth_probability:.2f}" if math.isfinite(s.truth_probability) else NONE,
                ],
            }
            for s in test.strata
        ],
        "false_alarm": _rate(test.false_alarm),
        "outside": {n: _rate(r) for n, r in test.outside.items()},
        "form_error": f"{100 * test.form_error:.0f} %",
        "false_name": _rate(test.false_name),
        "reliability": test.reliability.sentence(),
        "bins": [
            {
                "given": f"{b.low:g} to {b.high:g}",
                "probability": f"{b.probability:.2f}",
                "right": _rate(b.right),
            }
            for b in test.reliability.bins
            if b.right.of
        ],
        "smallest": [
            {
                "effect": s.effect,
                "place": s.place,
                "size": with_si(s.size, s.unit) if math.isfinite(s.size) else "none within its range",
                "detectability": f"{s.detectability:.0f}" if math.isfinite(s.detectability) else NONE,
            }
            for s in test.smallest
        ],
        "wide": bool(test.strata) and len(test.strata[-1].answers) > _BESIDE,
        "not_inserted": list(test.not_inserted.items()),
    }


def _confusion(test: SelfTest, stratum: Stratum, k: int) -> Picture:
    rows, columns, shares = stratum.shares()
    names = {"none": "no gap", "other": "other", "several": "several"}
    table = np.array(shares)[None]
    table = np.where(table < _LEAST, 0.0, table)
    size = f"{stratum.detectability:g}"
    figure = gap_figures.heat_panels(
        [f"Inserted at a detectability of {size}"],
        rows,
        [names[c] if c in ENDS else c for c in columns],
        table,
        1.0,
        "Answered",
        _WIDE if len(rows) > _BESIDE else WIDTH,
    )
    return picture(
        figure,
        f"confusion{k}",
        f"Confusion matrix at a detectability of {size}",
        f"What is answered, in per cent of {test.draws} draws, where the effect at the left was inserted at "
        f"a detectability of {size}. The diagonal is right; a group of effects that cannot be told apart and "
        "holds the inserted one counts as right. Several: no name is likely enough. No gap: none was called. "
        "Below 1 % is left blank.",
    )


def _rate(rate: Rate) -> str:
    if not rate.of:
        return NONE
    return f"{100 * rate.share:.0f} % ({100 * rate.lo:.0f} to {100 * rate.hi:.0f})"

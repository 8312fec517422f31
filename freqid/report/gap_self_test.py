"""The part of a gap's page about its self-test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from freqid.core.gap_self_test import ENDS, Rate, SelfTest, Stratum
from freqid.report import gap_figures
from freqid.report.drawing import WIDTH
from freqid.report.gap_tables import with_si
from freqid.report.notation import NONE
from freqid.report.pictures import Picture, picture

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
                "rates": [_rate(r) for r in (s.detected, s.named, s.right, s.covered)],
            }
            for s in test.strata
        ],
        "false_alarm": _rate(test.false_alarm),
        "outside": {n: _rate(r) for n, r in test.outside.items()},
        "form_error": f"{100 * test.form_error:.0f} %",
        "reach": [
            {
                "effect": r.effect,
                "parameter": r.parameter,
                "size": with_si(r.size, r.unit) if math.isfinite(r.size) else "none within its range",
                "linear": with_si(r.linear, r.unit) if math.isfinite(r.linear) else NONE,
                "detectability": f"{r.detectability:.0f}" if math.isfinite(r.detectability) else NONE,
            }
            for r in test.reach
        ],
        "wide": len(test.strata[-1].answers) > _BESIDE,
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
        f"a detectability of {size}. The diagonal is right; an alias that the insertion cannot be told from "
        "counts as right. Several: the set holds names that are no group. No gap: none was called. Below "
        "1 % is left blank.",
    )


def _rate(rate: Rate) -> str:
    if not rate.of:
        return NONE
    return f"{100 * rate.share:.0f} % ({100 * rate.lo:.0f} to {100 * rate.hi:.0f})"

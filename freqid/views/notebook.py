"""Results as a notebook shows them: their short text, and the table that says most."""

from __future__ import annotations

import html
from functools import singledispatch
from typing import Any

import numpy as np
import pandas as pd

from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.design import ClassicDesign, MultisineDesign

from .tables import frame_of, samples_of

_ROWS = 30  # of a table that a notebook shows


def html_of(result: Any) -> str:
    """Return a result's short text, and below it the table that says most of it."""
    shown = _summary_of(result)
    more = f"<p>and {len(shown) - _ROWS} rows more</p>" if len(shown) > _ROWS else ""
    indexed = shown.index.name is not None
    table = shown.head(_ROWS).to_html(float_format=lambda x: f"{x:.4g}", border=0, index=indexed)
    return f"<div><p><code>{html.escape(repr(result))}</code></p>{table}{more}</div>"


@singledispatch
def _summary_of(result: Any) -> pd.DataFrame:
    return frame_of(result)


@_summary_of.register
def _channels(record: FlightRecord) -> pd.DataFrame:
    rows = [
        (n, c.unit, c.values.min(), c.values.max(), c.native_rate_hz, c.source)
        for n, c in record.channels.items()
    ]
    return pd.DataFrame(rows, columns=["channel", "unit", "lowest", "highest", "rate (Hz)", "source"])


@_summary_of.register
def _signals(design: MultisineDesign | ClassicDesign) -> pd.DataFrame:
    inputs = samples_of(design)
    table = pd.DataFrame({"effector": inputs.names, "unit": inputs.units})
    table["peak"] = np.abs(inputs.values).max(axis=1)
    table["rms"] = np.sqrt((inputs.values**2).mean(axis=1))
    if isinstance(design, MultisineDesign):
        table["harmonics of 1/T"] = [" ".join(map(str, s.index)) for s in design.signals]
    return table


@_summary_of.register
def _of_maneuver(maneuver: Maneuver) -> pd.DataFrame:
    return _channels(maneuver.record)

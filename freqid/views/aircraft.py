"""The aircraft of a scenario as a drawing in a file."""

from __future__ import annotations

from pathlib import Path

from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario
from freqid.core.store import replacing
from freqid.report.flight.aircraft import outline, three_view

FORMATS = ("svg", "png", "pdf")


def draw_aircraft(scenario: Scenario, path: Path, at: str = "") -> bool:
    """Draw an aircraft from above, from behind and from the right.

    Parameters
    ----------
    scenario : Scenario
    path : Path
        ``.svg``, ``.png`` or ``.pdf``.
    at : str
        Reference whose tilts are drawn; the first one where empty.

    Returns
    -------
    bool
        False where the scenario has nothing with a place, and nothing was written.

    Raises
    ------
    UsageError
        Where the suffix is another one, or there is no such reference.
    DataError
        Where the file cannot be written.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise UsageError(
            f"a drawing is no '{path.suffix}' file", where=str(path), remedy=f"use .{', .'.join(FORMATS)}"
        )
    reference = scenario.reference_of(at) if at else next(iter(scenario.reference), None)
    tilts = {w.tilt: reference.scheduled.get(w.tilt, 0.0) for w in scenario.wing} if reference else {}
    if not outline(scenario, tilts):
        return False
    figure = three_view(scenario, tilts)
    with replacing(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=200)
    return True

"""What the pictures of a diagnosis are drawn from, gathered for its file."""

from __future__ import annotations

from typing import Any

import numpy as np

from freqid.core.gap_result import BeforeAfter, GapResult, ResidualSpectra
from freqid.gap.changes import changes
from freqid.gap.compare import Compared
from freqid.gap.diagnose import Findings
from freqid.gap.increments import increments
from freqid.gap.locate import coherence
from freqid.gap.score import followed
from freqid.gap.tolerance import DERIVATIVES

_DRAWN = 2  # manoeuvres whose histories are kept
_COLUMNS = 3000  # samples of a history: more than any page shows


def shown(found: Findings, tolerances: dict[str, float], provenance: dict[str, Any]) -> GapResult:
    """Return a diagnosis with its pictures' numbers.

    Parameters
    ----------
    found : Findings
    tolerances : dict of float
        That the diagnosis was made with.
    provenance : dict
        JSON-compatible.
    """
    names = found.diagnosis.records
    return GapResult(
        diagnosis=found.diagnosis,
        cells=found.map,
        spectra=tuple(
            _spectra(c, name, z) for c, name, z in zip(found.compared, names, found.explained, strict=False)
        ),
        coherence=coherence(found.compared),
        increments=increments(found.evidence, tolerances[DERIVATIVES]),
        before_after=tuple(_before_after(found)),
        expected={j.name: float(j.best.scale[0]) for j in found.judged if j.name in found.diagnosis.gap.unit},
        provenance=provenance,
    )


def _spectra(c: Compared, name: str, explained: np.ndarray) -> ResidualSpectra:
    return ResidualSpectra(
        maneuver=name,
        rows=tuple(row.name for row in c.rows),
        units=tuple(row.unit for row in c.rows),
        hz=c.lines.hz,
        inputs=c.lines.inputs,
        owner=c.lines.owner.astype(float),
        residual=c.residual,
        explained=explained,
        noise=_noise(c),
    )


def _noise(c: Compared) -> np.ndarray:
    """Return one standard deviation of the rows' noise, shape (row, line)."""
    return np.sqrt(np.einsum("lii->il", c.noise.covariance).real)


def _before_after(found: Findings) -> list[BeforeAfter]:
    """Return histories of the manoeuvres where the leading closure changes most, held-out ones if any are."""
    if not found.refits:
        return []
    refit = next(iter(found.refits.values()))
    used, kept = found.compared, found.held_out
    names = found.diagnosis.records[len(used) :] if kept else found.diagnosis.records
    made = []
    for c, name in zip(kept or used, names, strict=False):
        change = changes(c, refit.effects, refit.settings)
        power = np.einsum("lii->il", c.noise.covariance).real
        made.append((float((np.abs(change) ** 2 / power).sum()), c, name, change))
    made.sort(key=lambda one: -one[0])
    return [
        _history(c, name, bool(kept), change, followed(c, refit.effects, refit.settings))
        for _, c, name, change in made[:_DRAWN]
    ]


def _history(
    c: Compared, name: str, held_out: bool, change: np.ndarray, histories: tuple[np.ndarray, ...]
) -> BeforeAfter:
    time = c.maneuver.record.time
    every = max(1, time.size // _COLUMNS)
    measured, before, after = (h[:, ::every] for h in histories)
    simulated = c.lines.transform(c.flown.rows(c.predicted, c.flown.positions))
    return BeforeAfter(
        maneuver=name,
        held_out=held_out,
        responses=tuple(row.name for row in c.rows),
        units=tuple(row.unit for row in c.rows),
        time=time[::every],
        measured=measured,
        before=before,
        after=after,
        hz=c.lines.hz,
        measured_hz=simulated + c.residual,
        before_hz=simulated,
        after_hz=simulated + change,
        noise=_noise(c),
    )

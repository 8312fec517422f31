"""The numbers that the pictures of a diagnosis are drawn from, gathered for its file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from freqid.core.arrays import Array, Complex
from freqid.core.results.gap import BeforeAfter, GapResult, Increment, ResidualSpectra
from freqid.gap.close.score import Scored
from freqid.gap.diagnose import Findings
from freqid.gap.infer.where import coherence
from freqid.gap.model.candidate import OTHER
from freqid.gap.model.tolerance import DERIVATIVES
from freqid.gap.stack.block import Block
from freqid.identify.regress.confidence_interval import half_width
from freqid.simulate.effects import library

INCREMENTS = 0.95
"""Level of the increments' intervals."""

_WIDE = 1.0  # one sigma of an increment before any data, of the derivative itself
_LOOSE = 100.0  # %, of an interval to either side: the records say nothing of such a derivative
_DRAWN = 2  # conditions whose histories are kept
_A_CYCLE = 12  # samples of a history in one period of its highest line
_MOST = 3000  # samples of a history: more than any page shows


def shown(findings: Findings, tolerances: Mapping[str, float], provenance: Mapping[str, Any]) -> GapResult:
    """Return a diagnosis with its pictures' numbers.

    Parameters
    ----------
    findings : Findings
    tolerances : dict of float
        One sigma by name, that the diagnosis was made with; goes into the provenance.
    provenance : dict
        JSON-compatible.
    """
    used = findings.blocks
    return GapResult(
        diagnosis=findings.diagnosis,
        cells=findings.map,
        spectra=tuple(_spectra(b, z) for b, z in zip(used, findings.explained, strict=False)),
        coherence=coherence(used),
        increments=increments(findings),
        before_after=tuple(_before_after(findings)),
        expected=_expected(findings),
        provenance={**provenance, "tolerances": dict(tolerances)},
    )


def named(block: Block) -> str:
    """Return the name of a condition: its first record, and how many repeats were averaged with it."""
    more = len(block.names) - 1
    return block.names[0] + (f" and {more} repeat{'s' if more > 1 else ''}" if more else "")


def _spectra(block: Block, explained: Complex) -> ResidualSpectra:
    return ResidualSpectra(
        maneuver=named(block),
        rows=tuple(row.name for row in block.rows),
        units=tuple(row.unit for row in block.rows),
        hz=block.lines.hz,
        inputs=block.lines.inputs,
        owner=block.lines.owner.astype(float),
        residual=block.residual,
        explained=explained,
        noise=np.sqrt(block.noise_power),
    )


def _before_after(findings: Findings) -> list[BeforeAfter]:
    """Return histories of the conditions where the leading closure changes most, held-out ones if any are."""
    closing = findings.closing
    if closing is None or not findings.closed:
        return []
    fit = findings.closed[0].fit
    used = len(findings.blocks)
    held_out = len(closing.blocks) > used
    at = range(used, len(closing.blocks)) if held_out else range(used)
    made = []
    for i in at:
        block, columns = closing.blocks[i], closing.columns[i]
        effect = Scored(block, columns, fit).spectra(closing.system, i, fit.effect)
        change = effect + np.tensordot(fit.tolerances, columns.sigmas, 1)
        made.append((float((np.abs(effect) ** 2 / block.noise_power).sum()), block, change))
    made.sort(key=lambda one: -one[0])
    return [_histories(block, change, held_out) for _, block, change in made[:_DRAWN]]


def _histories(block: Block, change: Complex, held_out: bool) -> BeforeAfter:
    simulated = block.transform(block.trial.nominal.simulated)
    measured, after = simulated + block.residual, simulated + change
    top = block.lines.hz[-1] * block.lines.duration
    time = np.linspace(0.0, block.lines.duration, int(np.clip(_A_CYCLE * top, 100, _MOST)))
    return BeforeAfter(
        maneuver=named(block),
        held_out=held_out,
        responses=tuple(row.name for row in block.rows),
        units=tuple(row.unit for row in block.rows),
        time=block.maneuvers[0].record.time[block.lines.margin] + time,
        measured=_history(block, measured, time),
        before=_history(block, simulated, time),
        after=_history(block, after, time),
        hz=block.lines.hz,
        measured_hz=measured,
        before_hz=simulated,
        after_hz=after,
        noise=np.sqrt(block.noise_power),
    )


def _history(block: Block, z: Complex, time: Array) -> Array:
    """Return rows over time from their lines, shape (row, sample): nothing above the band is in it."""
    waves = np.exp(2j * np.pi * np.outer(block.lines.hz[1:], time))
    return (z[:, :1].real + 2 * (z[:, 1:] @ waves).real) / np.sqrt(block.lines.duration)


def increments(findings: Findings) -> tuple[Increment, ...]:
    """Return by how much each derivative in flight differs, clear ones first, largest first.

    All derivatives of the loads are free at once with a prior of 100 %, no effect is assumed, and noise, the
    record's own unknowns, errors of form and tolerances other than those of derivatives are integrated out.
    Empty where the simulation has no derivatives, or differs in its inputs between conditions.
    """
    system, blocks = findings.system, findings.blocks
    found = next(
        (i for i, c in enumerate(system.candidates) if c.effect == OTHER and c.kind == "vector"), None
    )
    inputs = {b.trial.inputs for b in blocks}
    if found is None or len(inputs) > 1:
        return ()
    responses = [row.name for row in blocks[0].rows if row.kind == "response"]
    terms = _terms(system.candidates[found].place.parameters, responses, inputs.pop())
    free = [system.columns_of(found).start + k for k, _, _ in terms]
    gram = system.gram(findings.evidence.form_error())
    kept = [system.columns + k for k, n in enumerate(system.tolerances) if not n.startswith(DERIVATIVES)]
    if not free:
        return ()
    G, g = _beside(gram, free, kept)
    covariance = np.linalg.inv(G + np.eye(len(free)) / _WIDE**2)
    value = 100 * covariance @ g
    half = half_width(100 * np.sqrt(np.diag(covariance)), level=INCREMENTS)
    every = [
        Increment(response, moved, float(x), float(x - h), float(x + h))
        for (_, response, moved), x, h in zip(terms, value, half, strict=True)
        if h < _LOOSE
    ]
    return tuple(sorted(every, key=lambda i: (not i.clear, -abs(i.percent))))


def _terms(
    labels: Sequence[str], responses: Sequence[str], inputs: Sequence[str]
) -> list[tuple[int, str, str]]:
    """Return the free terms of loads: index, response, and the input that it is the derivative by."""
    found = []
    for k, label in enumerate(labels):
        response, _, number = label.rpartition(":")
        if response in responses and int(number) < len(inputs):
            found.append((k, response, inputs[int(number)].partition("/")[2]))
    return found


def _beside(gram: Array, free: Sequence[int], tolerances: Sequence[int]) -> tuple[Array, Array]:
    """Return inner products of columns with each other and with the residual, tolerances integrated out."""
    outer = gram[np.ix_(tolerances, [*free, -1])]
    inside = np.eye(len(tolerances)) + gram[np.ix_(tolerances, tolerances)]
    left = gram[np.ix_(free, [*free, -1])]
    if len(tolerances):
        left = left - outer[:, :-1].T @ cho_solve(cho_factor(inside), outer)
    return left[:, :-1], left[:, -1]


def _expected(findings: Findings) -> dict[str, float]:
    """Return by effect the size that is expected before any data, in the unit of the smallest found."""
    unit = findings.diagnosis.gap.unit
    known = library()
    vehicle = findings.blocks[0].trial.maneuver.vehicle
    found: dict[str, float] = {}
    for c in findings.system.candidates:
        new = c.effect in known and c.effect not in found
        if new and c.kind == "scalar" and unit.get(c.effect) == c.unit:
            found[c.effect] = float(known[c.effect].of(vehicle).parameters[c.place.parameters[0]].scale)
    return found

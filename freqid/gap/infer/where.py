"""Where a gap is seen beyond all that is unknown: by response, band, regime, injected signal and time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from freqid.core.arrays import Array, Complex
from freqid.core.results.gap import GapMap
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.columns import Columns
from freqid.gap.stack.block import Block

_BANDS = 4


def gap_map(
    blocks: Sequence[Block],
    columns: Sequence[Columns],
    explained: Sequence[Sequence[Complex]],
    form_error: Form,
) -> GapMap:
    """Return where the detectability of what an explanation makes of the stack lies.

    With s what an effect makes and S the covariance of noise, of the records' own unknowns, of tolerances and
    of errors of form, its detectability is ``s' S^-1 s``; the terms of a cell are that cell's part. A cell in
    which tolerances do the same as the effect counts little, however much of the effect is there. Each of
    several effects counts alike.

    Parameters
    ----------
    blocks : sequence of Block
    columns : sequence of Columns
        By block, with tolerances and own unknowns.
    explained : sequence of sequence of ndarray of complex, shape (row, line)
        By effect and block; the residual itself where nothing explains it.
    form_error : Form
    """
    unknown = [_unknown(c, form_error) for c in columns]
    rows = tuple(dict.fromkeys(r.name for b in blocks for r in b.rows))
    regimes = tuple(dict.fromkeys(b.regime for b in blocks))
    inputs = (*dict.fromkeys(n for b in blocks for n in b.lines.inputs), "")
    bands = bands_of(blocks)
    found = np.zeros((len(rows), len(bands), len(regimes), len(inputs)))
    phase = np.zeros((len(rows), 3))
    for one in explained:
        weighed = _beyond(blocks, unknown, one)
        terms = [_terms(b, z, w) for b, z, w in zip(blocks, one, weighed, strict=True)]
        whole = max(sum(float(t.sum()) for t in terms), 1e-300) * len(explained)
        for block, z, w, parts in zip(blocks, one, weighed, terms, strict=True):
            at = [rows.index(r.name) for r in block.rows]
            owner = [
                inputs.index(block.lines.inputs[o]) if o >= 0 else len(inputs) - 1 for o in block.lines.owner
            ]
            tops = [b for _, b in bands]
            band = np.clip(np.searchsorted(tops, block.lines.hz, side="left"), 0, len(bands) - 1)
            regime = regimes.index(block.regime)
            for k in range(block.lines.hz.size):
                found[at, band[k], regime, owner[k]] += parts[:, k] / whole
            phase[at] += _thirds(block, z, w) / whole
    phase = np.maximum(phase, 0.0)
    total = phase.sum(axis=1, keepdims=True)
    return GapMap(rows, regimes, inputs, bands, found, phase / np.where(total > 0, total, 1.0))


def _terms(block: Block, z: Complex, weighed: Complex) -> Array:
    """Return the terms of ``s' S^-1 s``, shape (row, line)."""
    return np.where(block.lines.hz == 0, 1.0, 2.0) * (z.conj() * weighed).real


def _unknown(c: Columns, form_error: Form) -> tuple[Array, Array]:
    """Return a block's whitened columns of what is unknown in it alone, and of what is in all blocks."""
    form, shared = c.form_at(form_error)
    return np.concatenate([c.own, form]), np.concatenate([c.tolerances, shared])


def _beyond(
    blocks: Sequence[Block], unknown: Sequence[tuple[Array, Array]], change: Sequence[Complex]
) -> list[Complex]:
    """Return ``S^-1 s`` by block, shape (row, line) each."""
    white = [b.white(z) for b, z in zip(blocks, change, strict=True)]
    left = [_beside(own, shared) for own, shared in unknown]
    inside = np.sum([t @ shared.T for t, (_, shared) in zip(left, unknown, strict=True)], axis=0)
    seen = np.sum([t @ y for t, y in zip(left, white, strict=True)], axis=0)
    departures = cho_solve(cho_factor(np.eye(len(seen)) + inside), seen) if len(seen) else seen
    found = []
    for block, (own, _), y, t in zip(blocks, unknown, white, left, strict=True):
        beyond = (_beside(own, y) - departures @ t).reshape(len(block.rows), -1)
        found.append(np.einsum("lji,jl->il", block.whitening.conj(), block.lines.complex(beyond)))
    return found


def _beside(own: Array, y: Array) -> Array:
    """Return numbers, the last axis, times the inverse covariance of noise and own unknowns."""
    if not len(own):
        return y
    return y - cho_solve(cho_factor(np.eye(len(own)) + own @ own.T), own @ y.T).T @ own


def bands_of(blocks: Sequence[Block]) -> tuple[tuple[float, float], ...]:
    """Return bands of equal width in the logarithm; the lowest one begins at zero."""
    top = max(b.lines.hz[-1] for b in blocks)
    driven = [b.lines.hz[b.lines.driven] for b in blocks if b.lines.driven.any()]
    low = min((d[0] for d in driven), default=top / 40)
    edges = np.geomspace(max(low, top / 100), top, _BANDS + 1)
    edges = np.array([float(f"{e:.2g}") for e in edges])
    edges[0], edges[-1] = 0.0, max(edges[-1], top)
    return tuple((float(a), float(b)) for a, b in pairwise(edges))


def _thirds(block: Block, z: Complex, weighed: Complex) -> Array:
    """Return the detectability in each third of the manoeuvre, up to a factor, shape (row, 3)."""
    root = np.sqrt(block.noise_power)
    count = 6 * max(int(np.ceil(block.lines.hz[-1] * block.lines.duration)), 4)
    time = np.arange(count) / count
    angle = 2j * np.pi * np.outer(block.lines.hz * block.lines.duration, time)
    waves = np.where(block.lines.hz == 0, 1.0, 2.0)[:, None] * np.exp(angle)
    product = ((z / root) @ waves).real * ((weighed * root) @ waves).real
    return product.reshape(len(z), 3, -1).mean(axis=2)


def coherence(blocks: Sequence[Block]) -> dict[str, dict[str, float]]:
    """Return the share of the residual that noise does not account for, by row and injected signal."""
    found: dict[str, dict[str, float]] = {}
    names = dict.fromkeys(n for b in blocks for n in b.lines.inputs)
    rows = dict.fromkeys(r.name for b in blocks for r in b.rows)
    for row in rows:
        found[row] = {}
        for name in names:
            power = noise = 0.0
            for b in blocks:
                if row not in [r.name for r in b.rows] or name not in b.lines.inputs:
                    continue
                i = [r.name for r in b.rows].index(row)
                at = b.lines.owner == b.lines.inputs.index(name)
                power += float((np.abs(b.residual[i, at]) ** 2).sum())
                noise += float(b.noise_power[i, at].sum())
            if power > 0:
                found[row][name] = max(0.0, 1 - noise / power)
    return found

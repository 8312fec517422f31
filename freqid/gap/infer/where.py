"""Where a gap is: its energy by response, band, regime, injected signal and time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.results.gap import GapMap
from freqid.gap.stack.block import Block

_BANDS = 4


def gap_map(blocks: Sequence[Block], explained: Sequence[Complex]) -> GapMap:
    """Return the energy of what an explanation makes of the stack, over noise.

    Parameters
    ----------
    blocks : sequence of Block
    explained : sequence of ndarray of complex, shape (row, line)
        By block; the residual itself where nothing explains it.
    """
    rows = tuple(dict.fromkeys(r.name for b in blocks for r in b.rows))
    regimes = tuple(dict.fromkeys(b.regime for b in blocks))
    inputs = (*dict.fromkeys(n for b in blocks for n in b.lines.inputs), "")
    bands = _bands(blocks)
    energy = np.zeros((len(rows), len(bands), len(regimes), len(inputs)))
    phase = np.zeros((len(rows), 3))
    for block, z in zip(blocks, explained, strict=True):
        cells = np.abs(z) ** 2 / block.noise_power
        at = [rows.index(r.name) for r in block.rows]
        owner = [
            inputs.index(block.lines.inputs[o]) if o >= 0 else len(inputs) - 1 for o in block.lines.owner
        ]
        band = np.clip(np.searchsorted([b for _, b in bands], block.lines.hz, side="left"), 0, len(bands) - 1)
        regime = regimes.index(block.regime)
        for k in range(block.lines.hz.size):
            energy[at, band[k], regime, owner[k]] += cells[:, k]
        phase[at] += _thirds(block, z)
    total = phase.sum(axis=1, keepdims=True)
    return GapMap(rows, regimes, inputs, bands, energy, phase / np.where(total > 0, total, 1.0))


def _bands(blocks: Sequence[Block]) -> tuple[tuple[float, float], ...]:
    """Return bands of equal width in the logarithm; the lowest one begins at zero."""
    top = max(b.lines.hz[-1] for b in blocks)
    driven = [b.lines.hz[b.lines.driven] for b in blocks if b.lines.driven.any()]
    low = min((d[0] for d in driven), default=top / 40)
    edges = np.geomspace(max(low, top / 100), top, _BANDS + 1)
    edges = np.array([float(f"{e:.2g}") for e in edges])
    edges[0], edges[-1] = 0.0, max(edges[-1], top)
    return tuple((float(a), float(b)) for a, b in pairwise(edges))


def _thirds(block: Block, z: Complex) -> Array:
    """Return the energy of spectra in each third of the manoeuvre, over noise, shape (row, 3)."""
    white = z / np.sqrt(block.noise_power)
    count = 6 * max(int(np.ceil(block.lines.hz[-1] * block.lines.duration)), 4)
    time = np.arange(count) / count
    angle = 2j * np.pi * np.outer(block.lines.hz * block.lines.duration, time)
    double = np.where(block.lines.hz == 0, 1.0, 2.0)[:, None]
    history = (white @ (double * np.exp(angle))).real
    third = history.reshape(len(z), 3, -1)
    return (third**2).mean(axis=2)


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

"""Where a gap is: its energy by response, frequency band, flight regime, injected signal and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from freqid.core.gap_map import GapMap
from freqid.core.record import FlightRecord
from freqid.gap.compare import Compared

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

EDGES_HZ = (0.0, 0.2, 0.5, 1.0, 2.0, 5.0, np.inf)


def gap_map(compared: Sequence[Compared], change: Sequence[Complex]) -> GapMap:
    """Return where a change of the residual is.

    Parameters
    ----------
    compared : sequence of Compared
    change : sequence of ndarray of complex, shape (row, line)
        What the gap is taken to be in each manoeuvre, free of noise: the signatures of what explains it.
    """
    names = tuple(dict.fromkeys(row.name for c in compared for row in c.rows))
    regimes = tuple(dict.fromkeys(regime_of(c) for c in compared))
    inputs = (*dict.fromkeys(n for c in compared for n in c.lines.inputs), "")
    top = max(float(c.lines.hz[-1]) for c in compared)
    low = min(float(c.lines.hz[0]) for c in compared)
    edges = [low, *(e for e in EDGES_HZ if low < e < top), top]
    bands = tuple(pairwise(edges))
    energy = np.zeros((len(names), len(bands), len(regimes), len(inputs)))
    phase = np.zeros((len(names), 3))
    for c, z in zip(compared, change, strict=True):
        each = np.abs(z) ** 2 / np.einsum("lii->il", c.noise.covariance).real
        rows = [names.index(row.name) for row in c.rows]
        band = np.clip(np.searchsorted(edges, c.lines.hz, side="left") - 1, 0, len(bands) - 1)
        owner = np.array([inputs.index(c.lines.inputs[o]) if o >= 0 else -1 for o in c.lines.owner])
        at = regimes.index(regime_of(c))
        for i, row in enumerate(rows):
            np.add.at(energy[row, :, at, :], (band, owner), each[i])
            phase[row] += each[i].sum() * _thirds(c, z[i])
    total = phase.sum(axis=1, keepdims=True)
    return GapMap(names, regimes, inputs, bands, energy, phase / np.maximum(total, 1e-300))


def regime_of(compared: Compared) -> str:
    """Return the regime of a manoeuvre's record."""
    return regime(compared.trial.maneuver.record)


def regime(record: FlightRecord) -> str:
    """Return the reference condition of a record, or its mean speed where none is stated."""
    if record.reference:
        return record.reference
    for name in ("state/u", "air/V"):
        if name in record:
            return f"{record[name].mean():.0f} m/s"
    return "all"


def coherence(compared: Sequence[Compared]) -> dict[str, dict[str, float]]:
    """Return the share of each row's energy on an injected signal's lines that noise does not account for.

    Returns
    -------
    dict of dict of float
        By row and injected signal; 0 where the lines hold noise alone, towards 1 where they hold none.
    """
    power: dict[tuple[str, str], list[float]] = {}
    for c in compared:
        each = np.abs(c.residual) ** 2 / np.einsum("lii->il", c.noise.covariance).real
        for i, row in enumerate(c.rows):
            for o, name in enumerate(c.lines.inputs):
                driven = c.lines.owner == o
                if driven.any():
                    power.setdefault((row.name, name), []).extend(each[i, driven])
    found: dict[str, dict[str, float]] = {}
    for (row, name), values in power.items():
        found.setdefault(row, {})[name] = float(max(1 - 1 / max(np.mean(values), 1.0), 0.0))
    return found


def explained(compared: Sequence[Compared], coefficients: Mapping[str, float]) -> list[Complex]:
    """Return the change that coefficients of signatures and tolerances make in each manoeuvre."""
    return [
        sum(
            (
                value * {**c.signatures, **c.common}[name]
                for name, value in coefficients.items()
                if name in c.signatures or name in c.common
            ),
            np.zeros_like(c.residual),
        )
        for c in compared
    ]


def _thirds(compared: Compared, z: Complex) -> Array:
    """Return the share of a row's energy in each third of a manoeuvre, shape (3,)."""
    hz, duration = compared.lines.hz, compared.trial.maneuver.record.duration
    time = np.linspace(0, duration, 3 * max(20, int(duration)), endpoint=False)
    history = (np.exp(2j * np.pi * np.outer(time, hz)) @ z).real
    each = (history.reshape(3, -1) ** 2).sum(axis=1)
    return each / max(float(each.sum()), 1e-300)

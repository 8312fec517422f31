"""Manoeuvres reduced to the inner products of their white columns, which are what evidence is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from freqid.gap.compare import Compared
from freqid.gap.evidence import IN_ROW, Evidence

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_STANDS_OUT = 0.02  # of a signature's energy over the noise, from which a row may have a size of its own
_ROWS = 6


def evidence_of(
    compared: Sequence[Compared],
    *,
    changes: Sequence[tuple[Complex, Mapping[str, Complex]]] | None = None,
    sources: Mapping[str, tuple[str, ...]] | None = None,
    null: bool = True,
    seed: int = 0,
    apart: bool = False,
) -> Evidence:
    """Reduce manoeuvres to the inner products of their white columns.

    Parameters
    ----------
    compared : sequence of Compared
    changes : sequence of tuple, optional
        For each manoeuvre what is taken from its residual, and columns by name in place of its signatures.
    sources : dict of tuple of str, optional
        Channels that columns beside the signatures are computed from, by name.
    null : bool
        Whether null draws are reduced too.
    seed : int
        Of the tolerances in the null draws.
    apart : bool
        Whether there are columns of signatures in each row and in each manoeuvre alone too.
    """
    taken = changes or [(np.zeros(()), c.signatures) for c in compared]
    plain = list(dict.fromkeys(n for _, columns in taken for n in columns))
    if apart:
        taken = [(z, {**columns, **_by_row(c)}) for c, (z, columns) in zip(compared, taken, strict=True)]
    signatures = list(dict.fromkeys([*plain, *(n for _, columns in taken for n in columns)]))
    common = list(dict.fromkeys(n for c in compared for n in c.common))
    white = [
        {**{n: c.white(z) for n, z in columns.items()}, **c.white_common}
        | {"data": c.white(c.residual - change), "draws": c.white_draws[: None if null else 0]}
        for c, (change, columns) in zip(compared, taken, strict=True)
    ]
    names = (*signatures, *common)
    shared = []
    for c, (_, columns) in zip(compared, taken, strict=True):
        extra = {**c.attenuation(columns, sources or {}), **c.attenuation_common}
        shared.append((np.array([extra.get(name, 0.0) for name in names]), c.attenuation_own))
    alone = [c.white_own for c in compared]
    found = gather(white, alone, signatures, common, shared, len(white[0]["draws"]), seed)
    return (
        found.by_maneuver([n for n in plain if any(n in c.signatures for c in compared)]) if apart else found
    )


def _by_row(compared: Compared) -> dict[str, Complex]:
    """Return signatures in one row each, by ``name#row``, where they stand out of the noise of several."""
    power = np.einsum("lij->jl", np.abs(compared.noise.whitening) ** 2)
    found: dict[str, Complex] = {}
    for name, z in compared.signatures.items():
        energy = (np.abs(z) ** 2 * power).sum(axis=1)
        rows = np.flatnonzero(energy > _STANDS_OUT * energy.sum())
        if len(rows) < 2:
            continue
        for row in rows[np.argsort(-energy[rows])][:_ROWS]:
            alone = np.zeros_like(z)
            alone[row] = z[row]
            found[f"{name}{IN_ROW}{compared.rows[row].name}"] = alone
    return found


def gather(
    white: Sequence[Mapping[str, Array]],
    own: Sequence[Array],
    signatures: Sequence[str],
    tolerances: Sequence[str],
    shared: Sequence[tuple[Array, Array]],
    draws: int,
    seed: int,
) -> Evidence:
    """Reduce white columns to inner products.

    Parameters
    ----------
    white : sequence of dict
        For each manoeuvre, white numbers by name: ``data``, shape (row,); signatures and tolerances by name,
        shape (row,), absent where they do nothing; ``draws``, shape (draw, row).
    own : sequence of ndarray, shape (tolerance, row)
        What each manoeuvre alone may be wrong by, in sigma.
    signatures, tolerances : sequence of str
    shared : sequence of tuple of 2 ndarray
        For each manoeuvre what noise that is in both adds to the products of the data with signatures and
        tolerances, and with its own tolerances.
    draws : int
    seed : int
        Of the tolerances in the null draws.
    """
    grams, rows = [], 0
    for columns, alone, (common, mine) in zip(white, own, shared, strict=True):
        size = columns["data"].size
        rows += size
        stack = np.zeros((1 + len(signatures) + len(tolerances) + draws, size))
        stack[0] = columns["data"]
        for i, name in enumerate((*signatures, *tolerances), start=1):
            if name in columns:
                stack[i] = columns[name]
        if draws:
            stack[-draws:] = columns["draws"]
        gram = stack @ stack.T
        gram[1 : 1 + common.size, 0] -= common
        gram[0, 1 : 1 + common.size] -= common
        if len(alone):
            across = alone @ stack.T
            across[:, 0] -= mine
            inner = alone @ alone.T + np.eye(len(alone))
            gram -= across.T @ cho_solve(cho_factor(inner), across)
            if draws:
                _shake(gram, across, inner, draws, seed + len(grams))
        grams.append(gram)
    null = np.random.default_rng(seed).standard_normal((draws, len(tolerances)))
    return Evidence(np.array(grams), tuple(signatures), tuple(tolerances), null, rows)


def _shake(gram: Array, across: Array, inner: Array, draws: int, seed: int) -> None:
    """Add to the null draws what the manoeuvre alone may be wrong by."""
    rng = np.random.default_rng([seed, 7])
    size = rng.standard_normal((len(inner), draws))
    # products of every column with `alone`, in the metric: across minus what is integrated over
    alone = inner - np.eye(len(inner))
    solved = cho_solve(cho_factor(inner), np.concatenate([across, alone], axis=1))
    left = np.concatenate([across, alone], axis=1) - alone @ solved
    kept, count = gram.shape[0] - draws, gram.shape[0]
    gram[:kept, kept:] += left[:, :kept].T @ size
    gram[kept:, :kept] = gram[:kept, kept:].T
    both = left[:, kept:count].T @ size
    gram[kept:, kept:] += both + both.T + size.T @ left[:, count:] @ size

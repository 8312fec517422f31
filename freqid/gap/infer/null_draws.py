"""Draws of the model without effect, in column space: what the statistic does where there is no gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpstrf
from scipy.special import logsumexp

from freqid.core.arrays import Array
from freqid.gap.infer.block_matrices import BlockMatrices, Form, forward
from freqid.gap.infer.evidence import Evidence
from freqid.gap.infer.system import System


class Drawn(NamedTuple):
    """Draws of the data as one error of form sees them.

    Attributes
    ----------
    g : ndarray, shape (column, draw)
    none : ndarray, shape (draw,)
        Log evidence of no effect less what all errors of form have in common.
    departures : ndarray, shape (tolerance, draw)
        Of the tolerances in sigmas, as they say where there is no effect.
    """

    g: Array
    none: Array
    departures: Array


def null_statistics(evidence: Evidence, count: int, seed: int) -> Array:
    """Return the statistic of draws without effect, shape (count,).

    The error of form of each draw is drawn from its posterior over all explanations.

    Parameters
    ----------
    evidence : Evidence
    count : int
    seed : int
    """
    rng = np.random.default_rng([seed, 77])
    return statistics_of(evidence, drawn_from_posterior(evidence, evidence.system, count, rng))


def drawn_from_posterior(
    evidence: Evidence, system: System, count: int, rng: np.random.Generator
) -> dict[Form, Drawn]:
    """Return draws of the data, each with an error of form of the evidence's posterior; see `drawn`."""
    weights = evidence.form_weights()
    chosen = rng.choice(len(weights), size=count, p=weights / weights.sum())
    return drawn(system, chosen, rng)


def threshold_of(null: Array, level: float) -> float:
    """Return the statistic from which a gap is called.

    Draws exceed it in a share `level` of cases, and the odds of no gap are no better than that share: draws
    know noise, form and motion as a record never does, so they alone would call too often.

    Parameters
    ----------
    null : ndarray, shape (draw,)
        Of `null_statistics`.
    level : float
    """
    return max(float(np.quantile(null, 1 - level)), float(np.log((1 - level) / level)))


def drawn(
    system: System, chosen: NDArray[np.intp], rng: np.random.Generator, mean: Array | None = None
) -> dict[Form, Drawn]:
    """Return draws of the data, as every error of form sees them, by error of form.

    Parameters
    ----------
    system : System
    chosen : ndarray of int, shape (draw,)
        Of each draw, its own among the system's errors of form.
    rng : Generator
    mean : ndarray, shape (column,), optional
        Weights of candidates' columns that are in the data beside noise, tolerances and form.
    """
    n, few, count = system.columns, len(system.tolerances), len(chosen)
    own = [system.form_errors[k] for k in chosen]
    tolerance = rng.standard_normal((few, count))
    alike = {f: system.blocks[0].shared_sizes(f) for f in dict.fromkeys(own)}
    wrong = (
        rng.standard_normal((len(system.blocks[0].shared_row), count)) * np.array([alike[f] for f in own]).T
    )
    shared = np.concatenate([tolerance, wrong])
    sampled = [_sampled(b, own, shared, n, rng, mean) for b in system.blocks]
    seen = {}
    for error in dict.fromkeys(f.loads for f in system.form_errors):
        parts = [_at_loads(b, error, *one) for b, one in zip(system.blocks, sampled, strict=True)]
        seen[error] = np.sum([z for z, _ in parts], axis=0), np.sum([x for _, x in parts], axis=0)
    found = {}
    for f in system.form_errors:
        z, log = seen[f.loads]
        inside = z[n : n + few]
        if f.shared:
            inside = np.concatenate([inside, system.blocks[0].shared_sizes(f)[:, None] * z[n + few :]])
        rows = system.metric(f).gram[n:]
        factor = cho_factor(np.eye(len(inside)) + rows[:, n:])
        solved = cho_solve(factor, inside)
        log = log + 0.5 * (inside * solved).sum(axis=0) - float(np.log(np.diag(factor[0])).sum())
        log = log + f.log_prior
        found[f] = Drawn(z[:n] - rows[:, :n].T @ solved, log, solved[:few])
    return found


def _at_loads(
    block: BlockMatrices, error: float | tuple[float, ...], inner: Array, form: Array
) -> tuple[Array, Array]:
    """Return drawn inner products of ``[X, T, A]`` less the loads' error of form, and its evidence."""
    lower, size, at = block.factor(error)
    if not at.size:
        return inner, np.full(inner.shape[1], -block.own_half)
    across, determinant = block.taken(error)
    projected = forward(lower, size[:, None] * form[at])
    log = 0.5 * (projected**2).sum(axis=0) - determinant
    return inner - across.T @ projected, log


def statistics_of(evidence: Evidence, data: Mapping[Form, Drawn]) -> Array:
    """Return the statistic of drawn data, shape (draw,)."""
    effects, none = effects_of(evidence, data)
    log_none = logsumexp(none, axis=0)
    joint = logsumexp(none[:, None] + effects, axis=0) - log_none
    return logsumexp(joint, axis=0) - np.log(len(joint))


def effects_of(evidence: Evidence, data: Mapping[Form, Drawn]) -> tuple[Array, Array]:
    """Return log Bayes factors by error of form, effect and draw, and log evidences of no effect."""
    effects, none = [], []
    for f, one in data.items():
        places = evidence.weighing.by_place(evidence.weighing.at(f), one.g, one.departures)
        effects.append(evidence.weighing.by_effect(places))
        none.append(one.none)
    return np.array(effects), np.array(none)


def _sampled(
    block: BlockMatrices,
    own: Sequence[Form],
    shared: Array,
    n: int,
    rng: np.random.Generator,
    mean: Array | None,
) -> tuple[Array, Array]:
    """Return inner products with drawn data of ``[X, T, A]``, and of the form's columns.

    `own` is each draw's error of form; `shared` are the tolerances and the errors of form that are the same
    in all blocks.
    """
    gram, form, count = block.gram, block.form, shared.shape[1]
    whole = np.block([[gram, form.T], [form, block.of_form.gram]])
    scale = np.sqrt(np.maximum(np.diag(whole), np.finfo(float).tiny ** 0.5))
    factor, order, rank, _ = dpstrf(whole / scale[:, None] / scale)  # pivoted: columns may repeat each other
    found = np.empty((len(whole), count))
    found[order - 1] = np.triu(factor[:rank]).T @ rng.standard_normal((rank, count))
    found *= scale[:, None]
    by_form = {f: block.sizes(f.loads) for f in dict.fromkeys(own)}
    size = np.array([by_form[f] for f in own]).T
    found += whole[:, len(gram) :] @ (size * rng.standard_normal(size.shape))
    found += whole[:, n : len(gram)] @ shared
    if mean is not None:
        found += (whole[:, :n] @ mean)[:, None]
    return found[: len(gram)], found[len(gram) :]

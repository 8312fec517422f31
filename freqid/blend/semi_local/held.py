"""The semi-local model: some derivatives held at their global laws, the rest estimated again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqid.blend.semi_local.parametric import fit_laws
from freqid.blend.semi_local.problem import LocalProblem, places
from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.results.advance_ratio import (
    AdvanceRatioLaw,
    AdvanceRatioModel,
    LocalDerivatives,
    TrimCluster,
)

_ITERATIONS, _HALVINGS = 30, 20  # steps of Gauss-Newton, and of the search along one
_CLOSE = 1e-5  # change in standard errors at which steps end


def confident(cluster: TrimCluster) -> tuple[str, ...]:
    """Return the derivatives that the laws of a cluster know better than its single manoeuvres do.

    Parameters
    ----------
    cluster : TrimCluster

    Returns
    -------
    tuple of str
        Those for which the law's variance and scatter together are below the local estimate's variance,
        in the median over the manoeuvres: holding them then makes an error that is smaller than the one
        it removes.
    """
    held = []
    for name, law in cluster.laws.items():
        j = cluster.local.place(name)
        told = np.isfinite(cluster.local.estimate[:, j])
        own = cluster.local.covariance[told, j, j]
        if np.median(_held_variance(law, cluster.local.advance_ratio[told]) / own) < 1:
            held.append(name)
    return tuple(held)


def semi_local_model(
    model: AdvanceRatioModel,
    problems: Mapping[str, LocalProblem],
    hold: Sequence[str] | None = None,
) -> AdvanceRatioModel:
    """Estimate derivatives again, manoeuvre by manoeuvre, with others held at the global laws.

    Parameters
    ----------
    model : AdvanceRatioModel
        Global.
    problems : mapping of str to LocalProblem
        By the id of the manoeuvre; all manoeuvres of the model.
    hold : sequence of str, optional
        Derivatives that are held, in all clusters; where absent those that are `confident`, of each cluster
        by itself, but for those that would leave a response with nothing to estimate.

    Returns
    -------
    AdvanceRatioModel
        Held derivatives keep their laws; the others' are fitted to the new estimates.

    Raises
    ------
    UsageError
        Where a derivative that shall be held is none of the model's, or none is left to estimate.
    """
    for name in hold or ():
        if name not in model.names:
            raise UsageError(f"'{name}' cannot be held, it is no derivative of the model",
                             remedy=nearest(name, model.names))  # fmt: skip
    made = []
    for cluster in model.clusters:
        names = tuple(hold) if hold is not None else _leaving_some(confident(cluster), cluster)
        if set(cluster.laws) <= set(names):
            raise UsageError(
                "all derivatives are held, none is left to estimate", remedy="hold fewer of them"
            )
        local = refit(cluster, problems, names)
        laws = fit_laws(local, {n: cluster.laws[n] for n in names if n in cluster.laws})
        made.append(TrimCluster(local, laws))
    held = tuple(dict.fromkeys(n for c, old in zip(made, model.clusters, strict=True) for n in c.laws
                               if c.laws[n] is old.laws[n]))  # fmt: skip
    return AdvanceRatioModel(
        clusters=tuple(made),
        kind="semi-local",
        vehicle=model.vehicle,
        held=held,
        provenance=model.provenance,
        remarks=model.remarks,
    )


def _leaving_some(names: Sequence[str], cluster: TrimCluster) -> tuple[str, ...]:
    """Return names without those of a response of which nothing else would be left: its least sure one."""
    kept = list(names)
    for response in {n.partition(".")[0] for n in cluster.laws}:
        own = [n for n in cluster.laws if n.partition(".")[0] == response]
        if set(own) <= set(kept):
            gain = {n: _gain(cluster, n) for n in own}
            kept.remove(max(gain, key=lambda n: gain[n]))
    return tuple(kept)


def _gain(cluster: TrimCluster, name: str) -> float:
    j = cluster.local.place(name)
    told = np.isfinite(cluster.local.estimate[:, j])
    variance = _held_variance(cluster[name], cluster.local.advance_ratio[told])
    return float(np.median(variance / cluster.local.covariance[told, j, j]))


def refit(
    cluster: TrimCluster, problems: Mapping[str, LocalProblem], hold: Sequence[str]
) -> LocalDerivatives:
    """Return a cluster's derivatives with some held at their laws, and the covariance of all.

    Parameters
    ----------
    cluster : TrimCluster
    problems : mapping of str to LocalProblem
    hold : sequence of str

    Returns
    -------
    LocalDerivatives
        The covariance of what is held is that of its law and scatter, and what this adds to the others is in
        theirs.
    """
    local = cluster.local
    estimate, covariance = local.estimate.copy(), local.covariance.copy()
    for i, identifier in enumerate(local.ids):
        problem = problems[identifier]
        at = places(problem, local.names)
        fixed = np.array([name in hold and name in cluster.laws for name in problem.names])
        theta = local.estimate[i, at].copy()
        j = local.advance_ratio[i]
        held = [cluster.laws[n] for n, f in zip(problem.names, fixed, strict=True) if f]
        theta[fixed] = [float(law.value(j)) for law in held]
        theta, gain, own = _estimate_free(problem, theta, fixed)
        variance = np.array([float(_held_variance(law, j)) for law in held])
        spread = np.zeros((at.size, at.size))
        spread[np.ix_(fixed, fixed)] = np.diag(variance)
        spread[np.ix_(~fixed, fixed)] = gain * variance
        spread[np.ix_(fixed, ~fixed)] = (gain * variance).T
        spread[np.ix_(~fixed, ~fixed)] = own + (gain * variance) @ gain.T
        estimate[i, at] = theta
        covariance[i][np.ix_(at, at)] = spread
    return replace(local, estimate=estimate, covariance=covariance)


def _estimate_free(
    problem: LocalProblem, theta: Array, fixed: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return derivatives with some fixed, how the free ones follow those, and the free ones' covariance."""
    free = ~fixed
    minimum, information = problem.expand(theta)
    reached = problem.misfit(theta)
    for _ in range(_ITERATIONS):
        inner, mixed = information[np.ix_(free, free)], information[np.ix_(free, fixed)]
        theta, before = theta.copy(), theta[free]
        theta[free] = minimum[free] - np.linalg.solve(inner, mixed @ (theta[fixed] - minimum[fixed]))
        step = theta[free] - before
        for _ in range(_HALVINGS):  # far from the minimum an expansion may overshoot
            if problem.misfit(theta) <= reached:
                break
            step = step / 2
            theta[free] = before + step
        reached = problem.misfit(theta)
        if step @ inner @ step < _CLOSE**2:
            break
        minimum, information = problem.expand(theta)
    inner, mixed = information[np.ix_(free, free)], information[np.ix_(free, fixed)]
    gain, covariance = -np.linalg.solve(inner, mixed), np.linalg.inv(inner)
    return theta, gain.astype(np.float64), covariance.astype(np.float64)


def _held_variance(law: AdvanceRatioLaw, advance_ratio: Array | float) -> Array:
    """Return the variance of a trim's derivative when its law is known: the law's own, and the scatter."""
    return law.std_error_at(advance_ratio) ** 2 + law.scatter**2

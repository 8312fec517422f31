"""All manoeuvres of a cluster in one fit: the laws' coefficients are the unknowns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from freqid.blend.semi_local.problem import LocalProblem
from freqid.core.arrays import Array
from freqid.core.results.advance_ratio import AdvanceRatioLaw, AdvanceRatioModel, TrimCluster
from freqid.identify.advance_ratio.law import rate_range

_ITERATIONS, _CLOSE = 60, 0.03  # steps of one solution; change in standard errors at which they end
_EXPANSIONS, _SWEEPS = 12, 6  # of the manoeuvres' likelihoods; of the scatter between them
_DRAWS = 2000


def one_shot_model(model: AdvanceRatioModel, problems: Mapping[str, LocalProblem]) -> AdvanceRatioModel:
    """Fit the coefficients of all laws of a cluster to all its manoeuvres at once.

    Parameters
    ----------
    model : AdvanceRatioModel
        Global: gives the laws' forms and the starts.
    problems : mapping of str to LocalProblem
        By the id of the manoeuvre.

    Returns
    -------
    AdvanceRatioModel
        Laws of the same forms. Their draws are normal about the estimate, with rates by their logarithm; a
        remark says where the laws cannot follow the manoeuvres, and the intervals allow for it.

    Notes
    -----
    Unlike the global model it uses how errors of one manoeuvre's derivatives go together, and a manoeuvre
    that tells a derivative badly does not spoil the others. Each derivative's scatter about its law enters as
    a random effect, whose variance is estimated in the same fit.
    """
    made, remarks = [], list(model.remarks)
    for cluster in model.clusters:
        laws, inflation, converged = _fit_cluster(cluster, [problems[i] for i in cluster.local.ids])
        made.append(TrimCluster(cluster.local, laws))
        if not converged:
            remarks.append(
                f"At {np.degrees(cluster.alpha):.3g} deg the fit of all manoeuvres at once did not settle in "
                f"{_EXPANSIONS} steps: the manoeuvres do not tell all coefficients of the laws."
            )
        if inflation > 1:
            remarks.append(
                f"At {np.degrees(cluster.alpha):.3g} deg the manoeuvres' derivatives are off the laws by "
                f"{np.sqrt(inflation):.2g} times what their errors explain; the intervals are wider by that."
            )
    return AdvanceRatioModel(
        clusters=tuple(made),
        kind="one-shot",
        vehicle=model.vehicle,
        provenance=model.provenance,
        remarks=tuple(remarks),
    )


class _Coefficients:
    """All coefficients of a cluster's laws in one vector: C_inf, amplitudes at the origin, log rates.

    Amplitudes are those at the lowest advance ratio: at J = 0, beyond all data, they would be badly scaled.
    """

    def __init__(self, laws: Mapping[str, AdvanceRatioLaw]):
        self.laws = laws
        self.slices: dict[str, slice] = {}
        start = 0
        for name, law in laws.items():
            self.slices[name] = slice(start, start + 1 + 2 * law.rate.size)
            start += 1 + 2 * law.rate.size
        self.size = start

    def pack(self) -> Array:
        out = np.empty(self.size)
        for name, law in self.laws.items():
            scaled = law.amplitude * np.exp(-law.rate * self._origin(law))
            out[self.slices[name]] = [law.unblown, *scaled, *np.log(law.rate)]
        return out

    def values(self, c: Array, names: Sequence[str], j: float) -> tuple[Array, Array]:
        """Return the derivatives at one advance ratio, shape (p,), and their gradient, shape (p, size)."""
        theta, gradient = np.empty(len(names)), np.zeros((len(names), self.size))
        for i, name in enumerate(names):
            law, part = self.laws[name], self.slices[name]
            own = c[part]
            k = law.rate.size
            p, r = own[1 : 1 + k], self._rates(law, own)
            off = j - self._origin(law)
            e = np.exp(-r * off) if np.isfinite(j) else np.zeros(k)
            theta[i] = own[0] + p @ e
            slope = -p * e * off * r if np.isfinite(j) else np.zeros(k)
            gradient[i, part] = np.concatenate(([1.0], e, slope))
        return theta, gradient

    def prior(self, c: Array) -> tuple[Array, Array, float]:
        """Return what is known of the rates beforehand, as normal equations: the prior of a single law.

        Normal with the mean and the variance of the uniform distribution of the logarithms: a rate that the
        manoeuvres do not tell stays where it can be told at all.
        """
        normal, gradient = np.zeros((self.size, self.size)), np.zeros(self.size)
        cost = 0.0
        for name, law in self.laws.items():
            part, k = self.slices[name], law.rate.size
            if k:
                low, high = np.log(rate_range(law.lowest, law.highest))
                at = np.arange(part.start + 1 + k, part.stop)
                weight = 12 / (high - low) ** 2
                off = c[at] - (low + high) / 2
                normal[at, at] = weight
                gradient[at] = weight * off
                cost += weight * float(off @ off)
        return normal, gradient, cost

    def unpack(self, c: Array, covariance: Array, scatter: Mapping[str, float]) -> dict[str, AdvanceRatioLaw]:
        """Return the laws that coefficients say, with draws of their covariance."""
        rng = np.random.default_rng(0)
        values, vectors = np.linalg.eigh(covariance)
        normal = rng.standard_normal((_DRAWS, self.size)) * np.sqrt(np.maximum(values, 0.0))
        drawn = c + normal @ vectors.T
        laws = {}
        for name, law in self.laws.items():
            unblown, amplitude, rate = self._terms(law, c[self.slices[name]][None])
            draws = np.zeros((_DRAWS, 5))
            k = law.rate.size
            draws[:, 0], draws[:, 1 : 2 * k : 2], draws[:, 2 : 2 * k + 1 : 2] = self._terms(
                law, drawn[:, self.slices[name]]
            )
            laws[name] = replace(
                law,
                unblown=float(unblown[0]),
                amplitude=amplitude[0],
                rate=rate[0],
                scatter=float(np.sqrt(scatter[name])),
                draws=draws,
            )
        return laws

    def _terms(self, law: AdvanceRatioLaw, own: Array) -> tuple[Array, Array, Array]:
        k = law.rate.size
        rate = self._rates(law, own)
        return own[:, 0], own[:, 1 : 1 + k] * np.exp(rate * self._origin(law)), rate

    @staticmethod
    def _rates(law: AdvanceRatioLaw, own: Array) -> Array:
        """Return rates of coefficients, shape (..., size of the law), within a factor of 20 of the start."""
        return np.exp(np.log(law.rate) + np.clip(own[..., 1 + law.rate.size :] - np.log(law.rate), -3, 3))

    @staticmethod
    def _origin(law: AdvanceRatioLaw) -> float:
        return law.lowest if np.isfinite(law.lowest) else 0.0


class _Terms(NamedTuple):
    """Manoeuvres expanded about derivatives: what each says of them, and its advance ratio."""

    names: tuple[str, ...]
    advance_ratio: float
    minimum: Array
    covariance: Array


def _fit_cluster(
    cluster: TrimCluster, problems: Sequence[LocalProblem]
) -> tuple[dict[str, AdvanceRatioLaw], float, bool]:
    """Return a cluster's laws, the reduced chi-square where it is above one, and whether they converged."""
    coefficients = _Coefficients(cluster.laws)
    scatter = {name: law.scatter**2 for name, law in cluster.laws.items()}
    c, close = coefficients.pack(), False
    fit: _Fit | None = None
    ratios = cluster.local.advance_ratio.tolist()
    for _ in range(_EXPANSIONS):
        terms = [_expanded(coefficients, c, p, j) for p, j in zip(problems, ratios, strict=True)]
        fit = _solve(coefficients, c, terms, scatter)
        for _ in range(_SWEEPS):
            scatter = _scatter(coefficients, fit.c, terms, scatter)
            fit = _solve(coefficients, fit.c, terms, scatter)
        step = fit.c - c
        c = fit.c
        if close := bool(step @ fit.normal @ step < _CLOSE**2 * c.size):
            break
    assert fit is not None
    inflation = max(fit.cost / max(fit.count - coefficients.size, 1), 1.0)
    scale = 1 / np.sqrt(np.diag(fit.normal) + 1e-300)
    inverse = np.linalg.pinv(scale[:, None] * fit.normal * scale, hermitian=True)
    covariance = inflation * scale[:, None] * inverse * scale
    return coefficients.unpack(c, covariance, scatter), inflation, close


def _expanded(coefficients: _Coefficients, c: Array, problem: LocalProblem, j: float) -> _Terms:
    theta, _ = coefficients.values(c, problem.names, j)
    minimum, information = problem.expand(theta)
    return _Terms(problem.names, j, minimum, _inverse(information))


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


class _Fit(NamedTuple):
    """Coefficients with the normal matrix, the weighted sum of squares and the number of its terms."""

    c: Array
    normal: Array
    cost: float
    count: int


def _solve(
    coefficients: _Coefficients, c: Array, terms: Sequence[_Terms], scatter: Mapping[str, float]
) -> _Fit:
    """Minimise the weighted sum of squares of expanded manoeuvres by Levenberg and Marquardt."""
    weights = [_inverse(t.covariance + np.diag([scatter[n] for n in t.names])) for t in terms]
    damping = 1e-4
    normal, gradient, cost = _normal_equations(coefficients, c, terms, weights)
    for _ in range(_ITERATIONS):
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-300), gradient)
        trial = _normal_equations(coefficients, c + step, terms, weights)
        if not trial[2] <= cost:
            damping *= 10
            if damping > 1e8:
                break
            continue
        close = step @ normal @ step < _CLOSE**2
        c, damping = c + step, max(damping / 10, 1e-9)
        normal, gradient, cost = trial
        if close:
            break
    return _Fit(c, normal, cost, sum(len(t.names) for t in terms))


def _normal_equations(
    coefficients: _Coefficients, c: Array, terms: Sequence[_Terms], weights: Sequence[Array]
) -> tuple[Array, Array, float]:
    normal, gradient, cost = coefficients.prior(c)
    for term, weight in zip(terms, weights, strict=True):
        theta, slope = coefficients.values(c, term.names, term.advance_ratio)
        off = theta - term.minimum
        normal += slope.T @ weight @ slope
        gradient += slope.T @ weight @ off
        cost += float(off @ weight @ off)
    return normal, gradient, cost


def _scatter(
    coefficients: _Coefficients, c: Array, terms: Sequence[_Terms], scatter: Mapping[str, float]
) -> dict[str, float]:
    """Return each derivative's variance about its law after one sweep of expectation maximisation.

    Divided by what the manoeuvres have more than the law has coefficients, as an unbiased variance is.
    """
    total = dict.fromkeys(scatter, 0.0)
    count = dict.fromkeys(scatter, 0)
    for term in terms:
        prior = np.diag([scatter[n] for n in term.names])
        theta, _ = coefficients.values(c, term.names, term.advance_ratio)
        gain = prior @ np.linalg.inv(term.covariance + prior)
        effect = gain @ (term.minimum - theta)
        left = np.diag(prior - gain @ prior)
        for name, e, v in zip(term.names, effect, left, strict=True):
            total[name] += float(e**2 + v)
            count[name] += 1
    return {
        name: total[name] / count[name] * _freedom(count[name], coefficients.laws[name].rate.size)
        if count[name]
        else scatter[name]
        for name in scatter
    }


def _freedom(count: int, exponentials: int) -> float:
    """Return by how much a mean square about a law of 1 + 2 k coefficients is too small."""
    return 1.0 if count <= 1 + 2 * exponentials else count / (count - 1 - 2 * exponentials)

"""Sizes of several effects at once: where they are likeliest together, and how far each is known then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import logsumexp, ndtri

from freqid.core.arrays import Array
from freqid.gap.infer.block_matrices import Form
from freqid.gap.infer.evidence import Estimate, Evidence, estimate, weigh
from freqid.gap.infer.system import System
from freqid.gap.model.candidate import Candidate
from freqid.gap.settings import INTERVAL

_STEPS = 30  # Gauss-Newton steps at most
_HALVINGS = 12  # of a step that leads downhill
_SETTLED = 1e-3  # nats that a step gains, below which sizes are found
_NEAR = 0.05  # of a size, on either side: how the change goes with the size there
_LEAST = 1e-3  # of a scalar's smallest size in its prior: a size below is as good as none


def joint_estimates(system: System, places: Sequence[int]) -> tuple[Estimate, ...]:
    """Return estimates of several candidates, each with the others' sizes unknown too.

    A tolerance of the same parameter only adds to the size of an effect: what both make is that of their sum.
    So the sum is estimated with that tolerance at zero, and its one sigma widens the interval. Beside it, a
    size would be known far too well: a tolerance is straight, a late channel is not, and where data are sharp
    the size would stay wherever the line was drawn.

    Parameters
    ----------
    system : System
    places : sequence of int
        Candidates.
    """
    if not places:
        return ()
    names, sums = system.tolerances, as_sums(system, places)
    found = _together(sums, range(len(places)))
    if not any(n in names for e in found for n in e.candidate.tolerances):
        return found
    few, form_error = system.of(places), _form_beside(sums, found)
    return tuple(_widened(few, form_error, k, e) for k, e in enumerate(found))


def as_sums(system: System, places: Sequence[int], rivals: Sequence[int] = ()) -> Evidence:
    """Return what the data say of some candidates alone, of sums with tolerances of the same parameters.

    These tolerances are held where they were asked for, what was asked of them added to the sizes.

    Parameters
    ----------
    system : System
    places : sequence of int
        Candidates whose sizes are sums of effect and tolerance.
    rivals : sequence of int
        More candidates, in whose stead one of these is.
    """
    few = system.of([*places, *rivals])
    held = {k: float(few.asked[k]) for k in few.own_tolerances(range(len(places)))}
    added = np.zeros(few.columns)
    for i in range(len(places)):
        if any(held.get(k) for k in few.own_tolerances([i])):
            added[few.columns_of(i)] = few.asked_together(i)
    return weigh(few.held(held, added))


def _widened(system: System, form_error: Form, index: int, e: Estimate) -> Estimate:
    """Return an estimate whose interval has room for the tolerances of the same parameters.

    Parameters
    ----------
    system : System
    form_error : Form
    index : int
        Of the candidate.
    e : Estimate
    """
    c, n, names = e.candidate, system.columns, system.tolerances
    if not any(name in names for name in c.tolerances):
        return e
    if c.kind == "vector":
        each = [c.spreads.get(name, 0.0) for name in c.tolerances]
        room = np.array(each) * float(ndtri((1 + INTERVAL) / 2))
        lo, hi = e.size - np.hypot(e.size - e.lo, room), e.size + np.hypot(e.hi - e.size, room)
        return replace(e, lo=lo, hi=hi, room=room)
    gram, tolerance = system.gram(form_error), names.index(c.tolerance)
    slope = np.zeros(n)
    slope[system.columns_of(index)] = slopes(c, e.size)[0]
    power = float(slope @ gram[:n, :n] @ slope)
    sigma = abs(float(slope @ gram[:n, n + tolerance])) / power if power > 0 else 0.0
    room = sigma * float(ndtri((1 + INTERVAL) / 2))
    low, high = min(c.prior.min(), 0.0), max(c.prior.max(), 0.0)
    lo, hi = e.size - np.hypot(e.size - e.lo, room), e.size + np.hypot(e.hi - e.size, room)
    return replace(e, lo=np.maximum(lo, low), hi=np.minimum(hi, high), room=room)


def _together(evidence: Evidence, places: Sequence[int]) -> tuple[Estimate, ...]:
    """Return estimates of several candidates.

    Gauss-Newton steps of all sizes together lead to the likeliest ones. Each then has its density given the
    others, and an interval as much wider as its standard deviation is where these are free (G. A. F. Seber,
    C. J. Wild, Nonlinear Regression, 1989, section 2.8): a delay and a lag that make up for each other are
    known less well than either is beside the other.
    """
    alone = tuple(estimate(evidence, i, INTERVAL) for i in places)
    if len(places) == 1:
        return alone
    fit = _Fit.of(evidence, places)
    sizes = fit.climbed([e.size[0] if e.candidate.kind == "scalar" else e.weights for e in alone])
    wider = fit.widening(sizes)
    found = []
    for k, (i, c) in enumerate(zip(places, fit.candidates, strict=True)):
        given = np.zeros(evidence.system.columns)
        for other, size, of in zip(places, sizes, fit.candidates, strict=True):
            if other != i:
                given[evidence.system.columns_of(other)] = _weights(of, size)
        e = estimate(evidence, i, INTERVAL, given=given)
        low, high = (c.prior.min(), c.prior.max()) if c.kind == "scalar" else (-np.inf, np.inf)
        found.append(
            replace(
                e,
                lo=np.maximum(e.size - wider[k] * (e.size - e.lo), min(low, 0.0)),
                hi=np.minimum(e.size + wider[k] * (e.hi - e.size), max(high, 0.0)),
            )
        )
    return tuple(found)


def form_beside(system: System, places: Sequence[int], estimates: Sequence[Estimate]) -> Form:
    """Return the likeliest error of form beside effects at their sizes."""
    return _form_beside(weigh(system.of(places)), estimates)


def _form_beside(few: Evidence, estimates: Sequence[Estimate]) -> Form:
    """Return it of a system of these alone."""
    fit = _Fit.of(few, range(len(estimates)))
    w = np.concatenate([e.weights for e in estimates])
    return few.system.form_errors[int(np.argmax(fit.none + fit.g @ w - 0.5 * (fit.G @ w) @ w))]


@dataclass(frozen=True, eq=False)
class _Fit:
    """What data say of some candidates, at each error of form.

    Attributes
    ----------
    candidates : list of Candidate
    none : ndarray, shape (form,)
        Log evidence of no effect.
    G : ndarray, shape (form, column, column)
    g : ndarray, shape (form, column)
    """

    candidates: list[Candidate]
    none: Array
    G: Array
    g: Array

    @classmethod
    def of(cls, evidence: Evidence, places: Sequence[int]) -> _Fit:
        system = evidence.system
        at = system.places(places)
        reduced = [system.reduced(f) for f in system.form_errors]
        return cls(
            [system.candidates[i] for i in places],
            evidence.none,
            np.array([r.G[np.ix_(at, at)] for r in reduced]),
            np.array([r.g[at] for r in reduced]),
        )

    def climbed(self, sizes: list) -> list:
        """Return the likeliest sizes, from others on."""
        value, G, g = self.at(sizes)
        for _ in range(_STEPS):
            w, D, precision, pull = self.slopes(sizes)
            curve = D @ G @ D.T + np.diag(precision)
            # the shortest step: two effects that do the same have no curvature between them
            step = np.linalg.lstsq(curve, D @ (g - G @ w) - pull, rcond=None)[0].astype(float)
            for _ in range(_HALVINGS):
                moved = self.moved(sizes, step)
                better, G_there, g_there = self.at(moved)
                if better >= value:
                    break
                step = step / 2
            else:
                break
            gained, sizes, value, G, g = better - value, moved, better, G_there, g_there
            if gained < _SETTLED:
                break
        return sizes

    def widening(self, sizes: list) -> list[Array]:
        """Return how much wider each standard deviation is than given the others, by candidate."""
        _, G, _ = self.at(sizes)
        _, D, precision, _ = self.slopes(sizes)
        inverse = D @ G @ D.T + np.diag(precision)
        covariance, found, k = np.linalg.pinv(inverse, hermitian=True), [], 0
        for c in self.candidates:
            n = 1 if c.kind == "scalar" else c.sizes.size
            own = np.linalg.pinv(inverse[k : k + n, k : k + n], hermitian=True)
            found.append(np.sqrt(np.maximum(np.diag(covariance[k : k + n, k : k + n]) / np.diag(own), 1.0)))
            k += n
        return found

    def at(self, sizes: list) -> tuple[float, Array, Array]:
        """Return the log evidence of sizes, and G and g at the errors of form that are likely there."""
        w = np.concatenate([_weights(c, s) for c, s in zip(self.candidates, sizes, strict=True)])
        log = self.none + self.g @ w - 0.5 * (self.G @ w) @ w
        value = logsumexp(log)
        mix = np.exp(log - value)
        pull = sum(0.5 * p for p in self._pulls(sizes))
        return float(value - pull), np.tensordot(mix, self.G, 1), mix @ self.g

    def slopes(self, sizes: list) -> tuple[Array, Array, Array, Array]:
        """Return weights of all columns, their slopes by each size, the prior's precision and its pull."""
        weights, moved, precision, pull = [], [], [], []
        for c, s in zip(self.candidates, sizes, strict=True):
            weights.append(_weights(c, s))
            moved.append(slopes(c, s))
            if c.kind == "scalar":
                precision, pull = [*precision, 0.0], [*pull, 0.0]
            else:
                wide = 1 / float(c.prior.max()) ** 2
                precision, pull = [*precision, *[wide] * c.sizes.size], [*pull, *(wide * s)]
        return np.concatenate(weights), block_diag(*moved), np.array(precision), np.array(pull)

    def moved(self, sizes: list, step: Array) -> list:
        """Return sizes after a step, a scalar's within its prior and of its sign."""
        found, k = [], 0
        for c, s in zip(self.candidates, sizes, strict=True):
            if c.kind == "scalar":
                least = _LEAST * float(np.abs(c.prior).min())
                low, high = (least, c.prior.max()) if s > 0 else (c.prior.min(), -least)
                found.append(float(np.clip(s + step[k], low, high)))
                k += 1
            else:
                found.append(s + step[k : k + c.sizes.size])
                k += c.sizes.size
        return found

    def _pulls(self, sizes: list) -> list[float]:
        each = zip(self.candidates, sizes, strict=True)
        return [float(s @ s) / float(c.prior.max()) ** 2 for c, s in each if c.kind == "vector"]


def slopes(candidate: Candidate, size) -> Array:
    """Return how the weights of a candidate's columns go with its sizes there, shape (size, column)."""
    c = candidate
    if c.kind == "vector":
        return np.eye(c.sizes.size)
    at = float(np.squeeze(size))
    h = _NEAR * max(abs(at), _LEAST * float(np.abs(c.prior).min()))
    return ((c.weights(at + h) - c.weights(at - h)) / (2 * h))[None]


def _weights(candidate: Candidate, size) -> Array:
    return candidate.weights(float(size)) if candidate.kind == "scalar" else np.asarray(size, dtype=float)

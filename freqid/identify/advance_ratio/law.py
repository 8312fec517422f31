"""One derivative's law against advance ratio: a mean, one or two exponentials, the simplest supported.

The derivative of manoeuvre i is ``y_i = C(J_i) + scatter + error``: C is the law, the error has the local
estimate's standard deviation s_i, and the scatter a standard deviation that is estimated too, so that
intervals stay honest where local standard errors do not explain how estimates scatter. Given decay rates
and scatter, a law is linear in its other coefficients. These are integrated in closed form, rates and scatter
on grids. Evidence, intervals and leave-one-out predictions are therefore exact to the grid, and rates that
the data do not tell widen the intervals as they should.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.results.advance_ratio import FORMS, TRIM_SHARE, AdvanceRatioLaw, FormEvidence, law_value

# Rates between a law that falls by a quarter over all advance ratios flown and one that is gone just above
# the lowest. Rates of two exponentials differ twofold at least: closer ones cannot be told from one.
SLOWEST, FASTEST, APART = 0.3, 10.0, 2.0
DRAWS = 2000  # 2.5 % quantiles are then off by a twentieth of a standard deviation
_COARSE, _FINE = {1: 64, 2: 32}, {1: 96, 2: 32}  # grid of rates, points a rate
_SCATTERS, _SCALES = 16, 6  # grids of scatter, and of the prior scale of amplitudes
_NEGLIGIBLE = 15.0  # e-folds of density below the largest


def fit_law(
    advance_ratio: Array, estimate: Array, std_error: Array, name: str = "", unit: str = "1"
) -> AdvanceRatioLaw:
    """Fit the law of one derivative to local estimates.

    Parameters
    ----------
    advance_ratio : ndarray, shape (n,)
        Positive; inf with stopped propellers.
    estimate, std_error : ndarray, shape (n,)
    name, unit : str
        Of the derivative.

    Returns
    -------
    AdvanceRatioLaw
        A more complex form takes the place of a simpler one where the evidence and the leave-one-out
        predictions both prefer it.

    Raises
    ------
    DataError
        Where no estimate is given, or one is not finite or has no positive standard error.

    Notes
    -----
    Amplitudes have the prior of Zellner and Siow (Cauchy about zero in units of what one manoeuvre tells),
    rates are uniform in their logarithm, the scatter is half-Cauchy with the median standard error as its
    scale (Gelman 2006), the level is flat. docs/theory/advance-ratio.md.
    """
    points = _Points.of(advance_ratio, estimate, std_error, name)
    remarks = []
    tried, fits = [], []
    for count, form in enumerate(FORMS):
        needed = 2 * count + 2  # one more than the form has coefficients, so that it can be wrong
        if count and points.trims < needed:
            remarks.append(
                f"{name or 'the derivative'}: {form} need{'s' if count == 1 else ''} {needed} different "
                f"advance ratios, {points.trims} "
                f"{'is' if points.trims == 1 else 'are'} there; fly more of them to tell."
            )
            break
        fits.append(_fit_form(points, count))
        tried.append(form)
    evidence = np.array([f.log_evidence for f in fits])
    probability = np.exp(evidence - _log_sum(evidence))
    predictive = [_leave_one_out(points, k) for k in range(len(fits))]
    chosen = 0
    for k in range(1, len(fits)):
        if evidence[k] > evidence[chosen] and predictive[k][0] > predictive[chosen][0]:
            chosen = k
    if points.j.size == 1:
        remarks.append(
            f"{name or 'the derivative'}: one manoeuvre tells no scatter; its interval is its own."
        )
    finite = points.j[np.isfinite(points.j)]
    unblown, amplitude, rate = fits[chosen].best
    return AdvanceRatioLaw(
        name=name,
        unit=unit,
        form=FORMS[chosen],
        unblown=unblown,
        amplitude=amplitude,
        rate=rate,
        scatter=fits[chosen].scatter,
        draws=_draw_all(fits, probability),
        forms=tuple(
            FormEvidence(form, float(e), float(p), float(lpd), float(rms))
            for form, e, p, (lpd, rms) in zip(tried, evidence, probability, predictive, strict=True)
        ),
        lowest=float(finite.min()) if finite.size else np.inf,
        highest=float(finite.max()) if finite.size else np.inf,
        reaches_unblown=bool(np.isinf(points.j).any()),
        points=points.j.size,
        remarks=tuple(remarks),
    )


@dataclass(frozen=True, eq=False)
class _Points:
    """Local estimates of one derivative, with the ranges of what is integrated over.

    ``rates`` is (slowest, fastest), ``scatters`` (t,) with log prior weights ``log_scatters`` (t,); they
    belong to all the data, so that leaving one manoeuvre out changes no prior.
    """

    j: Array
    y: Array
    s: Array
    trims: int
    origin: float
    rates: tuple[float, float]
    scatters: Array
    log_scatters: Array

    @classmethod
    def of(cls, j: Array, y: Array, s: Array, name: str) -> _Points:
        j, y, s = (np.asarray(x, dtype=np.float64) for x in (j, y, s))
        if not j.size:
            raise DataError(f"no manoeuvre tells {name or 'the derivative'}", remedy="fly one that does")
        if not (np.isfinite(y).all() and np.isfinite(s).all() and (s > 0).all() and (j > 0).all()):
            raise DataError(
                f"{name or 'the derivative'} has an estimate that is not finite, or no positive standard "
                "error or advance ratio",
                remedy="leave that manoeuvre out",
            )
        finite = np.sort(j[np.isfinite(j)])
        trims = int(np.isinf(j).any()) + count_trims(finite)
        low, high = (finite[0], finite[-1]) if finite.size else (1.0, 1.0)
        unit = float(np.median(s))
        scatters = np.geomspace(0.05 * unit, max(3 * y.std(), 3 * unit), _SCATTERS)
        steps = np.gradient(np.log(scatters)) * scatters
        density = steps / (1 + (scatters / unit) ** 2)
        # what is below the smallest is as good as none
        scatters, density = np.append(0.0, scatters), np.append(np.arctan(scatters[0] / unit) * unit, density)
        return cls(
            j, y, s, trims, float(low), rate_range(low, high), scatters,
            np.log(density / density.sum()),
        )  # fmt: skip

    def without(self, i: int) -> _Points:
        keep = np.arange(self.j.size) != i
        return _Points(
            self.j[keep], self.y[keep], self.s[keep], self.trims, self.origin, self.rates, self.scatters,
            self.log_scatters,
        )  # fmt: skip


def rate_range(lowest: float, highest: float) -> tuple[float, float]:
    """Return the slowest and the fastest decay that advance ratios from lowest to highest can tell."""
    return SLOWEST / highest, FASTEST / lowest


def count_trims(advance_ratio: Array) -> int:
    """Return how many different finite advance ratios there are, from sorted values, shape (n,)."""
    count, last = 0, -np.inf
    for j in advance_ratio:
        if j > last * (1 + TRIM_SHARE) or count == 0:
            count, last = count + 1, j
    return count


@dataclass(frozen=True, eq=False)
class _Grid:
    """Posterior of one form on a grid of c rates, t scatters and m prior scales.

    Attributes
    ----------
    rates : ndarray, shape (c, k)
    shrink : ndarray, shape (m,)
        g / (1 + g) of Zellner's g.
    level, level_variance : ndarray, shape (t,)
        Weighted mean of the estimates, and its variance.
    centre : ndarray, shape (c, t, k)
        Weighted means of the exponentials.
    amplitude : ndarray, shape (c, t, k)
        By weighted least squares.
    variance : ndarray, shape (c, t, k, k)
        Its covariance.
    log_weight : ndarray, shape (c, t, m)
        Joint density of data and cell.
    """

    rates: Array
    shrink: Array
    level: Array
    level_variance: Array
    centre: Array
    amplitude: Array
    variance: Array
    log_weight: Array

    @property
    def log_evidence(self) -> float:
        return _log_sum(self.log_weight)


def _evaluate(points: _Points, rates: Array, log_prior: Array) -> _Grid:
    """Return the grid of one form; `rates` has shape (c, k), `log_prior` (c,) is of the cells."""
    count = rates.shape[1]
    n = points.j.size
    weight = 1 / (points.s**2 + points.scatters[:, None] ** 2)  # (t, n)
    total = weight.sum(axis=1)
    level = weight @ points.y / total
    e = _exponentials(points, rates)  # (c, k, n)
    about = points.y - level[:, None]  # (t, n)
    centre = _sums(weight, e) / total[:, None]
    moment = _sums(weight * about, e)
    squares = _sums(weight, e**2)
    gram = squares - total[:, None] * centre**2  # diagonal
    alive = (gram > 1e-12 * squares).all(axis=2)
    gram = np.where(alive[..., None], gram, 1.0)
    inverse = np.zeros((*gram.shape, count))
    if count == 1:
        inverse[..., 0, 0] = 1 / gram[..., 0]
    elif count == 2:
        cross = _sums(weight, e[:, :1] * e[:, 1:])[..., 0] - total * centre[..., 0] * centre[..., 1]
        # exponentials that the trims do not tell apart make no second term
        alive &= cross**2 < (1 - 1e-9) * gram[..., 0] * gram[..., 1]
        cross = np.where(alive, cross, 0.0)
        determinant = gram[..., 0] * gram[..., 1] - cross**2
        inverse[..., 0, 0], inverse[..., 1, 1] = gram[..., 1] / determinant, gram[..., 0] / determinant
        inverse[..., 0, 1] = inverse[..., 1, 0] = -cross / determinant
    amplitude = (inverse @ moment[..., None])[..., 0]
    explained = (amplitude * moment).sum(axis=2)
    # Zellner and Siow: n / g is chi-square of one degree of freedom
    share = (np.arange(_SCALES) + 0.5) / _SCALES
    g = n / chi2.ppf(1 - share, 1) if count else np.zeros(1)
    shrink = g / (1 + g)
    residual = (weight * about**2).sum(axis=1)
    log_weight = (
        (0.5 * np.log(weight).sum(axis=1) - 0.5 * np.log(total) - 0.5 * residual)[:, None]
        - 0.5 * (n - 1) * np.log(2 * np.pi)
        - 0.5 * count * np.log1p(g)
        + 0.5 * shrink * explained[..., None]
        + points.log_scatters[:, None]
        - np.log(g.size)
        + log_prior[:, None, None]
    )
    log_weight = np.where(alive[..., None], log_weight, -np.inf)
    return _Grid(rates, shrink, level, 1 / total, centre, amplitude, inverse, log_weight)


def _log_sum(x: Array) -> float:
    """Return the logarithm of the sum of exponentials of all elements."""
    highest = float(x.max())
    return highest + float(np.log(np.exp(x - highest).sum())) if np.isfinite(highest) else -np.inf


def _sums(weight: Array, e: Array) -> Array:
    """Return weighted sums over the manoeuvres, shape (c, t, k), of weights (t, n) and terms (c, k, n)."""
    return (e @ weight.T).transpose(0, 2, 1)


def _exponentials(points: _Points, rates: Array, j: Array | None = None) -> Array:
    """Return ``exp(-rate (J - origin))``, shape (c, k, n); zero at J = inf."""
    j = points.j if j is None else j
    return np.exp(-rates[..., None] * (j - points.origin))


def _posterior(points: _Points, count: int) -> _Grid:
    """Return the posterior of a form, on a grid that is refined where the density is."""
    if count == 0:
        return _evaluate(points, np.zeros((1, 0)), np.zeros(1))
    low, high = np.log(points.rates)
    box = np.array([[low, high]])
    if count == 2:  # slower rate, and how much faster the other is
        box = np.array([[low, high - np.log(APART)], [np.log(APART), high - low]])
    volume = float(np.prod(box[:, 1] - box[:, 0]))
    grid = _evaluate(points, *_cells(box, _COARSE[count], high, volume))
    density = grid.log_weight.max(axis=(1, 2))
    if not np.isfinite(density).any():
        return grid
    inside = grid.rates[density > density.max() - _NEGLIGIBLE]
    places = np.log(inside)
    if count == 2:
        places = np.column_stack([places[:, 0], places[:, 1] - places[:, 0]])
    step = (box[:, 1] - box[:, 0]) / _COARSE[count]
    zoomed = np.column_stack(
        [np.maximum(places.min(axis=0) - step, box[:, 0]), np.minimum(places.max(axis=0) + step, box[:, 1])]
    )
    return _evaluate(points, *_cells(zoomed, _FINE[count], high, volume))


def _cells(box: Array, size: int, highest: float, volume: float) -> tuple[Array, Array]:
    """Return rates, shape (c, k), at midpoints of cells of a box of log rates, and the cells' log prior."""
    axes = [low + (np.arange(size) + 0.5) * (high - low) / size for low, high in box]
    cell = float(np.prod((box[:, 1] - box[:, 0]) / size))
    if len(axes) == 1:
        return np.exp(axes[0])[:, None], np.full(size, np.log(cell / volume))
    slow, apart = (a.ravel() for a in np.meshgrid(*axes, indexing="ij"))
    keep = slow + apart <= highest
    rates = np.exp(np.column_stack([slow, slow + apart])[keep])
    # the box's corner beyond the fastest rate is no part of the prior: half of the box, as it happens
    return rates, np.full(len(rates), np.log(2 * cell / volume))


@dataclass(frozen=True, eq=False)
class _FormFit:
    log_evidence: float
    best: tuple[float, Array, Array]
    scatter: float
    points: _Points
    grid: _Grid


def _fit_form(points: _Points, count: int) -> _FormFit:
    grid = _posterior(points, count)
    probability = np.exp(grid.log_weight - grid.log_evidence)
    scatter = float(np.einsum("ctm,t->", probability, points.scatters))
    c = int(probability.sum(axis=(1, 2)).argmax())
    there = probability[c] / probability[c].sum()
    amplitude = np.einsum("tm,tk,m->k", there, grid.amplitude[c], grid.shrink)
    level = np.einsum("tm,t->", there, grid.level) - np.einsum(
        "tm,tk,tk,m->", there, grid.centre[c], grid.amplitude[c], grid.shrink
    )
    best = float(level), amplitude * np.exp(grid.rates[c] * points.origin), grid.rates[c]
    return _FormFit(grid.log_evidence, best, scatter, points, grid)


def _draw_all(fits: list[_FormFit], probability: Array) -> Array:
    """Return posterior draws of all forms in proportion to their probabilities, shape (m, 5)."""
    rng = np.random.default_rng(0)  # the same law for the same estimates
    counts = np.diff(np.round(DRAWS * np.append(0.0, np.cumsum(probability)))).astype(int)
    return np.concatenate([_draw(fit, n, rng) for fit, n in zip(fits, counts, strict=True)])


def _draw(fit: _FormFit, number: int, rng: np.random.Generator) -> Array:
    """Return draws of one form, shape (number, 5): systematic over cells, normal within each."""
    grid, out = fit.grid, np.zeros((number, 5))
    if not number:
        return out
    cumulative = np.cumsum(np.exp(grid.log_weight - grid.log_evidence).ravel())
    at = (np.arange(number) + rng.random()) / number * cumulative[-1]
    cell = np.minimum(np.searchsorted(cumulative, at), cumulative.size - 1)
    c, t, m = np.unravel_index(cell, grid.log_weight.shape)
    level = grid.level[t] + np.sqrt(grid.level_variance[t]) * rng.standard_normal(number)
    count = grid.rates.shape[1]
    if count:
        shrink = grid.shrink[m]
        root = np.linalg.cholesky(grid.variance[c, t]) * np.sqrt(shrink)[:, None, None]
        amplitude = shrink[:, None] * grid.amplitude[c, t]
        amplitude = amplitude + np.einsum("njk,nk->nj", root, rng.standard_normal((number, count)))
        level = level - (grid.centre[c, t] * amplitude).sum(axis=1)
        out[:, 1 : 2 * count : 2] = amplitude * np.exp(grid.rates[c] * fit.points.origin)
        out[:, 2 : 2 * count + 1 : 2] = grid.rates[c]
    out[:, 0] = level
    return out


def _leave_one_out(points: _Points, count: int) -> tuple[float, float]:
    """Return the sum of log predictive densities and the rms error, each manoeuvre from all others."""
    if points.j.size < 2:
        return np.nan, np.nan
    densities, errors = [], []
    for i in range(points.j.size):
        grid = _posterior(points.without(i), count)
        if not np.isfinite(grid.log_evidence):
            return -np.inf, np.nan
        e = _exponentials(points, grid.rates, points.j[i : i + 1])[..., 0]  # (c, k)
        off = e[:, None, :] - grid.centre
        change = (off * grid.amplitude).sum(axis=2)
        doubt = (off * (grid.variance @ off[..., None])[..., 0]).sum(axis=2)
        mean = grid.level[:, None] + change[..., None] * grid.shrink
        own = points.s[i] ** 2 + points.scatters**2
        variance = (grid.level_variance + own)[:, None] + doubt[..., None] * grid.shrink
        weight = grid.log_weight - grid.log_evidence
        error = points.y[i] - mean
        density = -0.5 * (np.log(2 * np.pi * variance) + error**2 / variance)
        densities.append(_log_sum(weight + density))
        errors.append(float(np.sum(np.exp(weight) * error)))
    return float(np.sum(densities)), float(np.sqrt(np.mean(np.square(errors))))


__all__ = ["count_trims", "fit_law", "law_value", "rate_range"]

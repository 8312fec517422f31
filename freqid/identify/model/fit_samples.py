"""The regression of a point model on samples, the bias among the parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from freqid.core.arrays import Array
from freqid.core.results.point import Fit, ResponseModel
from freqid.identify.model.problem import Problem, numbered
from freqid.identify.regress.estimators import estimate
from freqid.identify.regress.regression import LeastSquares
from freqid.identify.regress.uncertainty import correct_coloured_samples


def fit_samples(problem: Problem, driven: Sequence[Array] | None = None) -> dict[str, ResponseModel]:
    """Fit all responses on samples.

    Parameters
    ----------
    problem : Problem
    driven : sequence of ndarray, shape (p, N_s), optional
        Instruments: each manoeuvre's regressors as the injected signals alone would have made them.

    Returns
    -------
    dict of str to ResponseModel
    """
    settings, count = problem.settings, len(problem.x)
    samples = [x.shape[1] for x in problem.x]
    ends = np.cumsum(samples)[:-1]
    time = [dt * np.arange(n) for dt, n in zip(problem.dt, samples, strict=True)]
    slope = settings.trend in ("line", "endpoints")
    ramps = [t / t[-1] - 0.5 for t in time] if slope else []
    nuisance = np.concatenate([block_diag(*map(np.ones_like, time)), *([block_diag(*ramps)] * slope)])
    about_trim = problem.mean - problem.trim  # of each manoeuvre's own means
    x = np.concatenate([x_s + d[:, None] for x_s, d in zip(problem.x, about_trim, strict=True)], axis=1)
    z = np.concatenate([w.history(dt) for w, dt in zip(problem.wrench, problem.dt, strict=True)], axis=1)
    instruments = None if driven is None else np.concatenate(driven, axis=1)

    def correct(fit: LeastSquares) -> LeastSquares:
        return correct_coloured_samples(fit, samples=samples) if settings.residuals == "coloured" else fit

    models: dict[str, ResponseModel] = {}
    for rows, columns in problem.groups():
        found = estimate(
            x[columns],
            z[rows],
            names=[problem.names[j] for j in columns],
            response_names=[settings.responses[r] for r in rows],
            nuisance=nuisance,
            nuisance_names=[numbered(n, m) for n in ("bias", "slope")[: 1 + slope] for m in range(count)],
            instruments=None if instruments is None else instruments[columns],
            correct=correct,
            independent=1.0,
            confidence=settings.confidence,
        )
        fit = found.fit
        covariance = fit.solution_covariance[:, :count, :count]
        bias_error = np.sqrt(np.einsum("m,rmn,n->r", problem.share, covariance, problem.share))
        fits: list[dict[str, Fit]] = [{} for _ in rows]
        split = [np.split(values, ends, axis=1) for values in (z[rows], fit.residual)]
        for m, (measured, residual) in enumerate(zip(*split, strict=True)):
            for i in range(len(rows)):
                fits[i][numbered("time", m)] = Fit(time[m], measured[i], measured[i] - residual[i])
        models |= problem.models(
            rows,
            columns,
            found,
            bias=(fit.nuisance_estimate[:, :count] @ problem.share, bias_error),
            rmse=np.sqrt(fit.residual_square / z.shape[1]),
            fits=fits,
        )
    return models

"""Manoeuvres of a blown aircraft as regressions, with a truth that no law has: momentum theory and tables."""

import numpy as np

from freqid.blend.semi_local.problem import estimated_maneuvers
from freqid.core.results.advance_ratio import LocalDerivatives
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel, ResponseModel
from freqid.core.scenario import Reference

NAMES = ("Cm.0", "Cm.alpha", "Cm.qhat", "Cm.de")
UNITS = ("1", "1/rad", "1", "1/rad")
TRIMS = (0.35, 0.45, 0.55, 0.7, 0.9, 1.1, np.inf)


def truth(j, alpha):
    """Return the derivatives, shape (4,): three follow the dynamic pressure of the slipstream."""
    disc = 0.0 if np.isinf(j) else 0.22 / j**2
    slip = np.sqrt(1 + disc)  # slipstream over free stream, far behind
    return np.array([0.05 - 0.06 * (slip - 1), -0.9 - 0.2 * alpha, -14 * slip, -1.1 * slip])


def campaign(seed, repeats=2, alphas=(0.04, 0.11), trims=TRIMS, noise=0.004):
    """Return local estimates of doublets: short and at small amplitude, so that regressors are correlated."""
    rng = np.random.default_rng(seed)
    ids, js, angles, estimates, covariances = [], [], [], [], []
    time = np.arange(0, 8, 0.02)
    for angle in alphas:
        for trim in trims:
            for _ in range(repeats):
                j = trim * (1 + 0.01 * rng.standard_normal())
                alpha0 = angle + 0.003 * rng.standard_normal()
                de = -0.08 + 0.05 * np.sign(np.sin(2 * np.pi * time / rng.uniform(1.5, 4)))
                q = 0.008 * np.convolve(de + 0.08, np.exp(-1.5 * time) * np.sin(3 * time))[: time.size] * -0.1
                alpha = alpha0 + np.cumsum(q) * 0.4
                alpha = alpha0 + 0.02 * (alpha - alpha0) / (alpha - alpha0).std()
                q = 0.001 * q / q.std()
                x = np.column_stack([np.ones(time.size), alpha, q, de])
                y = x @ truth(j, alpha0) + noise * rng.standard_normal(time.size)
                inverse = np.linalg.inv(x.T @ x)
                estimates.append(inverse @ x.T @ y)
                covariances.append(noise**2 * inverse)
                ids.append(f"m{len(ids)}")
                js.append(j)
                angles.append(alpha0)
    return LocalDerivatives(
        ids=tuple(ids),
        names=NAMES,
        units=UNITS,
        advance_ratio=np.array(js),
        alpha=np.array(angles),
        airspeed=np.full(len(ids), 15.0),
        estimate=np.array(estimates),
        covariance=np.array(covariances),
    )


def problems_of(local):
    return dict(zip(local.ids, estimated_maneuvers(local), strict=True))


def point_models(local):
    """Return the same manoeuvres as point models, expanded about their trims as identification does."""
    models = []
    for i in range(len(local.ids)):
        trim = np.array([local.alpha[i], 0.0, -0.08])
        to_trim = np.eye(4)
        to_trim[0, 1:] = trim  # bias at the trim from the constant at zero
        estimate = to_trim @ local.estimate[i]
        spread = to_trim @ local.covariance[i] @ to_trim.T
        spread[0, 1:] = spread[1:, 0] = 0.0
        none, one = np.zeros(3), np.ones(3)
        response = ResponseModel(
            response="M",
            unit="1",
            regressors=("alpha", "qhat", "de"),
            regressor_units=("rad", "1", "rad"),
            trim=trim,
            regressor_rms=one,
            estimate=estimate[1:],
            std_error=np.sqrt(np.diag(spread)[1:]),
            covariance=spread[1:, 1:],
            lower=none,
            upper=none,
            bias=float(estimate[0]),
            bias_std_error=float(spread[0, 0] ** 0.5),
            **dict.fromkeys(("r2", "pse", "rmse", "fit_error"), 0.1),
            t_statistic=none,
            variance_inflation=none,
            correlation=np.eye(3),
            condition_index=one,
            variance_proportion=np.eye(3),
            inseparable=(),
            fit={"time": Fit(one, one, one)},
        )
        models.append(
            PointModel(
                reference=Reference(id=local.ids[i], u=15.0, rho=1.225),
                responses={"M": response},
                method="frequency",
                form="coefficient",
                axes="stability",
                confidence=0.95,
                duration=20.0,
                vehicle="blown",
                trim={"V": 15.0, "alpha": local.alpha[i], "advance_ratio": local.advance_ratio[i]},
            )
        )
    return models

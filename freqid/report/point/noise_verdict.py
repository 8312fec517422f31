"""What noise does to a point model, in sentences: to its estimates, to what it leaves, and to R2."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from freqid.core.results.point import PointModel, ResponseModel
from freqid.identify.model.selection import DISTORTED
from freqid.identify.regress.estimators import LEAST_STRENGTH
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import number, share, symbol

NEAR_CEILING = 0.02
"""Below what noise allows, where R2 is still said to reach it."""
_NAMED = 12  # parameters in one sentence at most: more are counted


def noise_findings(model: PointModel) -> list[Finding]:
    """Return what noise is seen to do: to the estimates, to what is left, and to R2."""
    return [*_estimators(model), *_strength(model), *_distortion(model), *_ceiling(model)]


def _estimators(model: PointModel) -> list[Finding]:
    both = {name: r for name, r in model.responses.items() if r.errors_in_variables is not None}
    if not both:
        text = "Estimates are by least squares alone, which noise in the regressors biases."
        return [finding("note", text)]
    total = sum(len(r.regressors) for r in both.values())
    differing = {name: r.differing for name, r in both.items() if r.differing}
    if not differing:
        text = "Least squares and instruments agree within noise in all {} parameters."
        return [finding("good", text, total)]
    count = sum(map(len, differing.values()))
    if count <= _NAMED:
        said = [
            Markup("{}: {}").format(symbol(r, model.form), listed(map(code, names)))
            for r, names in differing.items()
        ]
    else:
        said = [
            Markup("{} of {} in {}").format(len(names), len(both[r].regressors), symbol(r, model.form))
            for r, names in differing.items()
        ]
    farthest, response, regressor = _farthest(model, differing)
    return [
        finding(
            "note",
            "Estimates are by instruments. Noise in the regressors biases least squares: {} of {} parameters "
            '<a href="#noise">differ beyond noise</a> ({}). The farthest is {} of {}, by {} of its standard '
            "errors.",
            count,
            total,
            Markup("; ").join(said),
            code(regressor),
            symbol(response, model.form),
            number(farthest, 2),
        )
    ]


def _farthest(model: PointModel, differing: dict[str, tuple[str, ...]]) -> tuple[float, str, str]:
    """Return by how many standard errors two estimates lie apart that differ, and whose they are."""
    apart = []
    for name, regressors in differing.items():
        response, beside = model[name], model[name].errors_in_variables
        if beside is None:
            continue
        for regressor in regressors:
            j = response.regressors.index(regressor)
            away = abs(response.estimate[j] - beside.estimate[j]) / response.std_error[j]
            apart.append((float(away), name, regressor))
    return max(apart)


def _strength(model: PointModel) -> list[Finding]:
    strength = {
        regressor: float(f)
        for response in model.responses.values()
        if response.errors_in_variables is not None
        for regressor, f in zip(response.regressors, response.errors_in_variables.strength, strict=True)
    }
    if not strength:
        return []
    weakest = min(strength, key=lambda name: strength[name])
    return [
        finding(
            "good",
            "The injected signals move every regressor: first-stage F is at least {} ({}), {:g} is enough.",
            number(strength[weakest]),
            code(weakest),
            LEAST_STRENGTH,
        )
    ]


def _distortion(model: PointModel) -> list[Finding]:
    known = {name: r.distortion for name, r in model.responses.items() if r.distortion is not None}
    if not known:
        return []
    more = {name: ratio for name, ratio in known.items() if not ratio <= DISTORTED}
    if not more:
        text = "What the model leaves on the harmonics is noise: at most {} times the power between them."
        return [finding("good", text, number(max(known.values())))]
    said = listed(
        Markup("{} ({} times)").format(symbol(name, model.form), number(ratio))
        for name, ratio in more.items()
    )
    return [
        finding(
            "note",
            "On the harmonics the model leaves more power than noise has between them in {}: motion that is "
            "not linear in the regressors, or lags behind them.",
            said,
        )
    ]


def _ceiling(model: PointModel) -> list[Finding]:
    known = {name: (r.r2, r.r2_ceiling) for name, r in model.responses.items() if r.r2_ceiling is not None}
    if not known:
        return []
    short = {name: at for name, at in known.items() if not reaches_ceiling(model[name])}
    if short:
        said = listed(
            Markup("{} ({} of {})").format(symbol(name, model.form), share(r2), share(ceiling))
            for name, (r2, ceiling) in short.items()
        )
        text = "R² falls short of what noise allows by more than {:g} and more than by chance in {}."
        return [finding("note", text, NEAR_CEILING, said)]
    least = min(known, key=lambda name: known[name][1])
    text = "R² reaches what noise allows in every response, but for {:g} or chance; the least is {} in {}."
    allowed = share(float(np.clip(known[least][1], -np.inf, 1.0)))
    return [finding("good", text, NEAR_CEILING, allowed, symbol(least, model.form))]


def reaches_ceiling(response: ResponseModel) -> bool:
    """Say whether R2 is what noise allows, but for a little or chance; false where that is not known."""
    if response.r2_ceiling is None:
        return False
    return response.r2 >= response.r2_ceiling - max(NEAR_CEILING, 2 * _by_chance(response))


def _by_chance(response: ResponseModel) -> float:
    """Return the standard deviation of R2 less its ceiling, were the residual noise alone.

    Powers on lines are exponential, their scatter is as large; noise lines are about as many as harmonics.
    """
    power = [fit.noise**2 for fit in response.fit.values() if fit.noise is not None]
    total = sum(np.sum(np.abs(fit.measured) ** 2) for fit in response.fit.values() if fit.noise is not None)
    return float(np.sqrt(2 * np.sum(np.concatenate(power) ** 2)) / total) if power and total else 0.0

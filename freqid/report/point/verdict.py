"""What a reviewer should know first about a point model, in sentences, and what noise did to it."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from freqid.core.results.judged.doubt import HIGH_INFLATION
from freqid.core.results.judged.gates import missed_gates, unjudged_gates
from freqid.core.results.point import DISTORTED, NEAR_CEILING, PointModel, ResponseModel
from freqid.core.scenario import Gates
from freqid.identify.regress.two_stage import LEAST_STRENGTH
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import number, share, symbol
from freqid.report.point.sensor_tables import sensor_findings

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
        phrases = [
            Markup("{}: {}").format(symbol(r, model.form), listed(map(code, names)))
            for r, names in differing.items()
        ]
    else:
        phrases = [
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
            Markup("; ").join(phrases),
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
    listing = listed(
        Markup("{} ({} times)").format(symbol(name, model.form), number(ratio))
        for name, ratio in more.items()
    )
    return [
        finding(
            "note",
            "On the harmonics the model leaves more power than noise has between them in {}: motion that is "
            "not linear in the regressors, or lags behind them. The intervals hold noise alone. Smaller "
            "amplitudes, products of regressors (--nonlinear products) or --align fit tell which.",
            listing,
        )
    ]


def _ceiling(model: PointModel) -> list[Finding]:
    known = {name: (r.r2, r.r2_ceiling) for name, r in model.responses.items() if r.r2_ceiling is not None}
    if not known:
        return []
    short = {name: at for name, at in known.items() if not model[name].reaches_ceiling}
    if short:
        listing = listed(
            Markup("{} ({} of {})").format(symbol(name, model.form), share(r2), share(ceiling))
            for name, (r2, ceiling) in short.items()
        )
        text = "R² falls short of what noise allows by more than {:g} and more than by chance in {}."
        return [finding("note", text, NEAR_CEILING, listing)]
    least = min(known, key=lambda name: known[name][1])
    text = "R² reaches what noise allows in every response, but for {:g} or chance; the least is {} in {}."
    allowed = share(float(np.clip(known[least][1], -np.inf, 1.0)))
    return [finding("good", text, NEAR_CEILING, allowed, symbol(least, model.form))]


def point_verdict(model: PointModel, gates: Gates | None = None) -> tuple[Finding, ...]:
    """Return the findings, the headline first.

    Parameters
    ----------
    model : PointModel
    gates : Gates, optional
        What the scenario asks for.
    """
    findings = [finding("note", "{}", remark[:1].upper() + remark[1:]) for remark in model.remarks]
    findings += [*sensor_findings(model), *noise_findings(model), _crossing(model)]
    findings += _collinear(model) or [_separable(model)]
    if model.prediction:
        findings.append(_prediction(model))
    findings.sort(key=lambda f: ("bad", "note", "good").index(f.kind))
    return (_headline(model, gates), *findings)


def missed_by_response(model: PointModel, gates: Gates) -> dict[str, tuple[Markup, ...]]:
    """Return by response what it should have reached; responses that reach everything are absent."""
    summary: dict[str, tuple[Markup, ...]] = {}
    for miss in missed_gates(model, gates):
        if miss.unjudged:
            continue  # one sentence for all responses, in the headline
        if miss.figure == "R2":
            text = Markup("R² {} where {:g} is asked").format(share(miss.value), miss.gate)
            allowed = model[miss.response].r2_ceiling
            if allowed is not None and allowed < miss.gate:
                text += Markup(" and noise allows {}").format(share(allowed))
        else:
            bound = "asked" if miss.figure == "coherence" else "allowed"
            text = Markup("{} {} where {:g} is {}").format(miss.figure, number(miss.value), miss.gate, bound)
            text += Markup(": {}").format(miss.why) if miss.why else ""
        summary[miss.response] = (*summary.get(miss.response, ()), text)
    return summary


def crosses_zero(response: ResponseModel) -> np.ndarray:
    """Return which parameters' 2-sigma bars include zero, shape (p,)."""
    return ~(np.abs(response.estimate) > 2 * response.std_error)


def _headline(model: PointModel, gates: Gates | None) -> Finding:
    scores = {name: response.r2 for name, response in model.responses.items()}
    spread = _spread(model, scores)
    if gates is None or not gates.of_points:
        return finding("note", "R² is {}. No gate was given to hold it against.", spread)
    missed = missed_by_response(model, gates)
    unjudged = unjudged_gates(model, gates)
    if not missed and unjudged:
        return finding("bad", "{} R² is {}.", _sentence(unjudged), spread)
    if not missed:
        return finding("good", "Every response reaches its gate: R² is {}.", spread)
    phrases = [
        Markup("{} ({})").format(symbol(name, model.form), Markup(", ").join(what))
        for name, what in missed.items()
    ]
    return finding(
        "bad",
        "{} of {} responses {} a gate: {}. R² is {}.{}",
        len(missed),
        len(scores),
        "misses" if len(missed) == 1 else "miss",
        listed(phrases),
        spread,
        f" {_sentence(unjudged)}" if unjudged else "",
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _prediction(model: PointModel) -> Finding:
    scores = {name: fit.r2 for name, fit in model.prediction.items()}
    worse = [symbol(name, model.form) for name, score in scores.items() if not score > 0]
    if worse:
        return finding(
            "bad",
            "A manoeuvre that was not used is predicted worse than by a constant in {}; R² is {}.",
            listed(worse),
            _spread(model, scores),
        )
    return finding("note", "A manoeuvre that was not used is predicted with R² {}.", _spread(model, scores))


def _separable(model: PointModel) -> Finding:
    responses = model.responses.values()
    return finding(
        "good",
        "The data separate every parameter: variance inflation is at most {}, the condition number {}.",
        number(max(float(response.variance_inflation.max(initial=1)) for response in responses)),
        number(max(response.condition_number for response in responses)),
    )


def _collinear(model: PointModel) -> list[Finding]:
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, response in model.responses.items():
        for group in response.inseparable:
            groups.setdefault(group, []).append(name)
    findings = [
        finding(
            "bad",
            "The data cannot separate {} in {}: only a combination of their parameters is known.",
            listed(map(code, group)),
            _responses(model, names),
        )
        for group, names in groups.items()
    ]
    largest: dict[str, float] = {}
    for response in model.responses.values():
        for name, value in zip(response.regressors, response.variance_inflation.tolist(), strict=True):
            if value > HIGH_INFLATION:
                largest[name] = max(value, largest.get(name, 0.0))
    if largest:
        names = sorted(largest, key=lambda name: -largest[name])
        listing = listed(Markup("{} ({})").format(code(name), number(largest[name])) for name in names)
        findings.append(finding("note", "Variance inflation is above {:g} for {}.", HIGH_INFLATION, listing))
    return findings


def _crossing(model: PointModel) -> Finding:
    total, weak = 0, []
    for name, response in model.responses.items():
        total += len(response.regressors)
        names = [code(n) for n, c in zip(response.regressors, crosses_zero(response), strict=True) if c]
        if names:
            weak.append((len(names), Markup("{}: {}").format(symbol(name, model.form), listed(names))))
    if not weak:
        return finding("good", "All {} parameters differ from zero by more than 2σ.", total)
    count = sum(n for n, _ in weak)
    return finding(
        "note",
        "{} of {} parameters cannot be told from zero: the 2σ bar includes it ({}).",
        count,
        total,
        Markup("; ").join(text for _, text in weak),
    )


def _spread(model: PointModel, scores: dict[str, float]) -> Markup:
    """Say the lowest and the highest of some scores, and whose they are."""
    if len(scores) == 1:
        ((name, score),) = scores.items()
        return Markup("{} ({})").format(share(score), symbol(name, model.form))
    worst = min(scores, key=lambda name: (scores[name] == scores[name], scores[name]))
    best = max(scores, key=lambda name: (scores[name] == scores[name], scores[name]))
    return Markup("from {} ({}) to {} ({})").format(
        share(scores[worst]), symbol(worst, model.form), share(scores[best]), symbol(best, model.form)
    )


def _responses(model: PointModel, names: list[str]) -> Markup:
    if len(names) == len(model.responses) > 2:
        return Markup("every response")
    return listed(symbol(name, model.form) for name in names)

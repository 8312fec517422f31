"""Each condition of a report: residual spectrum, table of parameters, and why they differ from the truth."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from freqid import __version__
from freqid.blend.corridor_study import (
    GOOD_R2,
    MOST_VALIDATION,
    StudiedPoint,
    StudyResults,
    doubts_of_points,
    left_to_noise,
)
from freqid.core.results.fit import Fit
from freqid.core.results.judged.doubt import DOUBT_KINDS, HIGH_INFLATION, MATTERS, WIDE, Doubt
from freqid.core.results.judged.truth import BEYOND, Miss
from freqid.core.results.point import PointModel, ResponseModel
from freqid.report.kit.findings import code, finding
from freqid.report.kit.notation import (
    NONE,
    exact,
    formula,
    measured_values,
    number,
    percent,
    pretty_unit,
    share,
    short,
    symbol,
    tenths,
)
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import Sheet, render
from freqid.report.study.figures import fits_over_frequency
from freqid.report.study.pictures import fitted_conditions
from freqid.report.study.verdict import truth_findings

_KINDS = {
    "wide interval": f"an interval wider than ±{100 * WIDE:g} % of the value",
    "collinear": "regressors that moved together",
    "misses the truth": "being off the simulation's truth",
}
_REASONS = {
    "wide interval": "wide interval",
    "collinear": "collinear",
    "misses the truth": "off the truth",
}
_MISSED = {
    "linearisation": "linearisation",
    "noise-free estimate": "noise-free",
    "both": "both",
}


def build_points_sheet(results: StudyResults) -> Sheet:
    """Return the page of all conditions of a study, or of point models that were put together as one.

    Parameters
    ----------
    results : StudyResults
    """
    points = results.points
    worst = min(
        ((p, r) for p in points for r in p.model.responses.values()),
        key=lambda one: (one[1].r2 == one[1].r2, one[1].r2),
    )
    count = len(points)
    doubts = list(doubts_of_points(points))
    return render(
        "points.html",
        title=f"{count} condition{'s' if count > 1 else ''}",
        what="Fit, prediction, residual spectrum and parameters of each condition.",
        version=__version__,
        findings=[
            finding(
                "note",
                "The response that fits worst is {} at {}: R² {}{}.{}",
                symbol(worst[1].response, worst[0].model.form),
                code(worst[0].id),
                share(worst[1].r2),
                "" if worst[1].r2_ceiling is None else f", where noise allows {share(worst[1].r2_ceiling)}",
                worst_band_text(worst[1]),
            ),
            *truth_findings(points),
        ],
        facts=[],
        points=[_sheet(results, point, place) for place, point in enumerate(points)],
        doubts=_doubt_rows(doubts),
        doubt_counts=_doubt_counts(points, [d for _, d in doubts]),
        truth=truth_summary(points),
        most=f"{MOST_VALIDATION:g}",
        provenance={p.id or f"model {k + 1}": p.model.provenance for k, p in enumerate(points)},
    )


def worst_band_text(response: ResponseModel) -> str:
    """Return where in frequency a response fits worst, with a space before; empty of histories."""
    fit = response.fit.get("frequency")
    band = fit.worst_band if fit is not None else None
    if band is None:
        return ""
    return band_text(band.low_hz, band.high_hz, band.over_noise, band.share)


def band_text(low_hz: float, high_hz: float, over_noise: float, part: float) -> str:
    """Return the sentence on the band in which a fit is worst, with a space before."""
    where = f" It fits worst from {number(low_hz, 2)} to {number(high_hz, 2)} Hz: what is left there"
    holds = f"holds {percent(part)} of all that the model leaves."
    if not math.isfinite(over_noise):
        return f"{where} {holds}"
    return f"{where} is {number(over_noise, 2)} times as large as noise, and {holds}"


def _doubt_rows(doubts: Sequence[tuple[StudiedPoint, Doubt]]) -> list[dict[str, Any]]:
    """Return the parameters that cannot be trusted: off the truth, the farthest first; then by reason.

    Within a reason those that move their response most are first; all that hardly matter come last.
    """
    rows = []
    order = {kind: k for k, kind in enumerate(DOUBT_KINDS)}
    for p, d in sorted(
        doubts,
        key=lambda one: (
            not one[1].matters,
            one[1].miss is None,
            -abs(one[1].miss.sigmas) if one[1].miss is not None else 0.0,
            [order[k] for k in one[1].kinds],
            -one[1].weight,
        ),
    ):
        error, estimate = measured_values(d.std_error, d.estimate)
        rows.append(
            {
                "name": Markup("{}<sub>{}</sub>").format(symbol(d.response, p.model.form), d.parameter),
                "response": d.response,
                "at": p.id,
                "unit": pretty_unit(d.unit),
                "estimate": exact(d.estimate, estimate),
                "error": exact(d.std_error, error),
                "half": exact(100 * d.half_width, number(100 * d.half_width, 2)),
                "wide": "wide interval" in d.kinds,
                "inflation": exact(d.inflation, number(d.inflation)),
                "collinear": bool(d.companions),
                "off": exact(d.miss.sigmas, tenths(d.miss.sigmas)) if d.miss is not None else NONE,
                "weight": exact(100 * d.weight, number(100 * d.weight, 2)),
                "small": not d.matters,
                "reason": " and ".join(_REASONS[k] for k in d.kinds),
                "why": _why(d),
            }
        )
    return rows


def _why(doubt: Doubt) -> Markup:
    """Return the reasons why a parameter cannot be trusted."""
    reasons: list[Markup] = []
    if "wide interval" in doubt.kinds:
        reasons.append(Markup("interval of ±{} of its value").format(percent(doubt.half_width)))
    if doubt.companions:
        reasons.append(Markup("cannot be told from {}").format(", ".join(doubt.companions)))
    if doubt.miss is not None:
        of = {"both": "linearisation and the noise-free estimate"}.get(doubt.miss.of, doubt.miss.of)
        text = Markup("outside 2σ of the {}: {}").format(of, _cause(doubt.miss))
        if "wide interval" not in doubt.kinds:
            text += Markup("; known to ±{}").format(percent(doubt.half_width))
        reasons.append(text)
    return Markup("; ").join(reasons)


def _doubt_counts(points: Sequence[StudiedPoint], doubts: Sequence[Doubt]) -> dict[str, Any]:
    """Return how many parameters cannot be trusted, by reason, and the bounds that decide."""
    return {
        "total": sum(len(r.regressors) for p in points for r in p.model.responses.values()),
        "doubtful": len(doubts),
        "matter": sum(d.matters for d in doubts),
        "by_noise": left_to_noise_text(left_to_noise(points)),
        "kinds": reasons_text(dict(Counter(" and ".join(d.kinds) for d in doubts).most_common())),
        "wide": f"{100 * WIDE:g} %",
        "inflation": f"{HIGH_INFLATION:g}",
        "small": f"{100 * MATTERS:g} %",
    }


def reasons_text(reasons: Mapping[str, int]) -> str:
    """Return how many parameters cannot be trusted for which reasons; the numbers add up to all of them.

    Parameters
    ----------
    reasons : mapping of str to int
        By the kinds of doubt, joined by `` and ``, as `Trust.reasons`.
    """
    several = len(reasons) > 1
    return ", ".join(
        f"{count} {'only ' if several and ' and ' not in kinds else ''}for "
        + " and ".join(_KINDS[kind] for kind in kinds.split(" and "))
        for kinds, count in reasons.items()
    )


def left_to_noise_text(count: int) -> str:
    """Return how many parameters are off the truth by noise alone, with a space before; empty of none."""
    if not count:
        return ""
    are = "are" if count > 1 else "is"
    return (
        f" {count} more {are} off, but would be within {BEYOND:g}σ without what noise adds; they are not "
        "counted as doubtful for that: noise puts no more parameters off than chance does."
    )


def _sheet(results: StudyResults, point: StudiedPoint, place: int) -> dict[str, Any]:
    model = point.model
    followed = any(p is point for p in results.followed())
    least = min(model.responses.values(), key=lambda r: (r.r2 == r.r2, r.r2))
    return {
        "id": point.id or f"model {place + 1}",
        "anchor": f"point-{place}",
        "how": f"{model.method}, {model.estimator}, {short(model.duration)} s",
        "worst": Markup("{} fits worst here, R² {}.{}").format(
            symbol(least.response, model.form), share(least.r2), worst_band_text(least)
        ),
        "condition": number(max(r.condition_number for r in model.responses.values())),
        "summary": [_summary(point, r) for r in model.responses.values()],
        "pictures": fitted_conditions(results, point) if followed else _spectrum(model, place),
        "tables": [_table(point, r, place) for r in model.responses.values()],
        "both": any(r.errors_in_variables is not None for r in model.responses.values()),
        "truth": bool(point.truth),
        "level": f"{100 * model.confidence:g}",
    }


def _summary(point: StudiedPoint, response: ResponseModel) -> dict[str, Any]:
    name, pair = response.response, response.most_collinear
    fitted, predicted, ratio = (
        point.modelling_rmse(name),
        point.prediction_rmse(name),
        point.validation_ratio(name),
    )
    away = point.from_noise_free(name)
    known = [abs(x) for x in away.tolist() if math.isfinite(x)]
    misses = point.misses(name)
    return {
        "symbol": symbol(name, point.model.form),
        "response": name,
        "unit": pretty_unit(response.unit),
        "r2": exact(response.r2, share(response.r2)),
        "ceiling": exact(response.r2_ceiling, share(response.r2_ceiling))
        if response.r2_ceiling is not None
        else NONE,
        "low": not (response.r2 >= GOOD_R2 or response.reaches_ceiling),
        "rmse": exact(fitted, number(fitted)),
        "predicted": exact(predicted, number(predicted)),
        "ratio": exact(ratio, number(ratio)),
        "far": ratio > MOST_VALIDATION,
        "distortion": number(response.distortion) if response.distortion is not None else NONE,
        "collinear": Markup("{} ({} with {})").format(
            number(pair.inflation), pair.regressors[0], pair.regressors[1]
        )
        if pair is not None
        else NONE,
        "weak": sum(abs(e) <= 2 * s for e, s in zip(response.estimate, response.std_error, strict=True)),
        "differing": len(response.differing) if response.errors_in_variables is not None else NONE,
        "near": f"{sum(x <= BEYOND for x in known)} of {len(known)}" if known else NONE,
        "off": f"{sum(m.of != 'noise-free estimate' for m in misses)} of {len(response.regressors)}"
        if point.truth
        else NONE,
    }


def _spectrum(model: PointModel, place: int) -> list[Picture]:
    """Draw the spectra of a condition that is not followed in detail."""
    fits: dict[str, tuple[str, Fit]] = {
        formula(name, model.form): (r.unit, r.fit["frequency"])
        for name, r in model.responses.items()
        if "frequency" in r.fit
    }
    if not fits:
        return []
    worst = min(model.responses.values(), key=lambda r: r.r2)
    return [
        picture(
            fits_over_frequency(fits),
            f"spectrum{place}",
            f"Residual spectra at {model.reference.id}: measured, model and residual over frequency",
            Markup(
                "Measured, model and residual on the lines of the fit; dotted is what noise leaves. {} is "
                "fitted worst here: R² {}. A residual above the dots is more than noise."
            ).format(symbol(worst.response, model.form), share(worst.r2)),
            responses=model.responses,
            conditions=[model.reference.id],
        )
    ]


def _table(point: StudiedPoint, response: ResponseModel, place: int) -> dict[str, Any]:
    name = response.response
    beside, truth = response.errors_in_variables, point.truth.get(name)
    if truth is not None and truth.regressors != response.regressors:
        truth = None
    misses = {m.parameter: m for m in point.misses(name)}
    rows = []
    for j, regressor in enumerate(response.regressors):
        error = float(response.std_error[j])
        values = [float(response.estimate[j]), float(response.lower[j]), float(response.upper[j])]
        extra = [float(beside.estimate[j])] if beside is not None else []
        if truth is not None:
            extra += [float(truth.linear[j]), float(truth.noise_free[j])]
        texts = measured_values(error, *values, *extra)
        cells = [exact(v, t) for v, t in zip((error, *values, *extra), texts, strict=True)]
        miss = misses.get(regressor)
        rows.append(
            {
                "name": regressor,
                "error": cells[0],
                "estimate": cells[1],
                "low": cells[2],
                "high": cells[3],
                "weak": abs(values[0]) <= 2 * error,
                "inflation": number(float(response.variance_inflation[j])),
                "collinear": response.variance_inflation[j] > HIGH_INFLATION,
                "least_squares": cells[4] if beside is not None else NONE,
                "differs": regressor in response.differing,
                "linear": cells[-2] if truth is not None else NONE,
                "noise_free": cells[-1] if truth is not None else NONE,
                "off": tenths(miss.sigmas) if miss is not None else "",
                "missed": _MISSED[miss.of] if miss is not None else "",
                "cause": _cause(miss) if miss is not None else "",
                "unit": pretty_unit(response.parameter_units[j]),
            }
        )
    return {
        "symbol": symbol(name, point.model.form),
        "response": name,
        "anchor": f"point-{place}-{list(point.model.responses).index(name)}",
        "rows": rows,
        "both": beside is not None,
        "truth": truth is not None,
    }


def _cause(miss: Miss) -> Markup:
    """Return the cause with its part, and what else is in the difference, all in standard errors."""
    if miss.of == "noise-free estimate":
        return Markup("noise {}σ").format(tenths(miss.parts["noise"]))
    rest = [f"{c} {tenths(x)}" for c, x in miss.parts.items() if c != miss.cause and abs(x) >= 1]
    more = Markup(' <span class="quiet">({})</span>').format(", ".join(rest)) if rest else ""
    return Markup("{} {}σ{}").format(miss.cause, tenths(miss.parts[miss.cause]), more)


def truth_summary(points: Sequence[StudiedPoint]) -> dict[str, Any] | None:
    """Return the parameters that are farthest off the linearisation, with the parts of the difference."""
    known = [p for p in points if p.truth]
    if not known:
        return None
    misses = [(p, r, m) for p in known for r in p.model.responses for m in p.misses(r)]
    off = [m for m in misses if m[2].of != "noise-free estimate"]
    farthest = sorted(off, key=lambda x: -abs(x[2].sigmas))[:_FARTHEST]
    return {
        "farthest": [
            {
                "at": p.id,
                "response": r,
                "name": Markup("{}<sub>{}</sub>").format(symbol(r, p.model.form), m.parameter),
                "sigmas": tenths(m.sigmas),
                "parts": [tenths(m.parts[c]) for c in _CAUSES],
                "missed": _MISSED[m.of],
                "cause": m.cause,
            }
            for p, r, m in farthest
        ],
        "heads": _CAUSES,
    }


_CAUSES = ("noise", "amplitude", "wake delay", "not explained")
_FARTHEST = 15  # listed

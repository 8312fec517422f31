"""One self-contained page about laws against advance ratio, or about a whole campaign."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from typing import Any

import numpy as np

from freqid import __version__
from freqid.blend.semi_local.advance_ratio_study import CampaignStudy
from freqid.core.results.advance_ratio import AdvanceRatioLaw, AdvanceRatioModel
from freqid.report.advance_ratio import figures
from freqid.report.kit.findings import Finding, finding
from freqid.report.kit.notation import formula, measured_values, number, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

_PANELS = 4  # in one figure: it then fits a screen
_OUTPUT_UNITS = {"V": "m/s", "alpha": "rad", "q": "rad/s", "theta": "rad", "u": "m/s", "w": "m/s"}
_OUTPUT_UNITS |= {"ax": "m/s2", "az": "m/s2"}
_SHOWN_OUTPUTS = 5


def build_advance_ratio_page(model: AdvanceRatioModel) -> str:
    """Return the page of one model: laws, their evidence, figures.

    Parameters
    ----------
    model : AdvanceRatioModel
    """
    return _page(model, _findings(model), [], [], [], [], model.provenance)


def build_study_by_advance_ratio_page(study: CampaignStudy) -> str:
    """Return the page of a campaign: the same, and how models compare in time and on held-out manoeuvres.

    Parameters
    ----------
    study : CampaignStudy
    """
    whole = study.model("global")
    findings = [*_comparison(study), *_findings(whole)]
    said = [r for r in study.remarks if r not in whole.remarks]
    findings += [finding("note", "{}", remark) for remark in said]
    scores = [
        {
            "model": kind,
            "misfit": number(value),
            "less": _less(study, kind),
            "parts": [number(float(x)) for x in np.nanmean(study.scores.by_response[k], axis=1)],
        }
        for k, (kind, value) in enumerate(study.scores.mean.items())
    ]
    return _page(
        whole,
        findings,
        _outputs(study),
        _coefficients(study),
        scores,
        [_misfits(study)],
        study.provenance,
        study.scores.responses,
    )


def _page(
    model: AdvanceRatioModel,
    findings: list[Finding],
    outputs: list[Picture],
    coefficients: list[Picture],
    scores: list[dict[str, Any]],
    misfits: list[Picture],
    provenance: dict[str, Any],
    responses: Sequence[str] = (),
) -> str:
    count = sum(len(c.local.ids) for c in model.clusters)
    alphas = ", ".join(f"{degrees(c.alpha):.1f}" for c in model.clusters)
    return render(
        "advance_ratio.html",
        title=model.vehicle or "Laws against advance ratio",
        what=f"{model.kind.capitalize()} model of {count} manoeuvres at trim angles of attack {alphas} deg.",
        version=__version__,
        findings=findings,
        facts=[
            ("Manoeuvres", str(count)),
            (
                "Clusters",
                ", ".join(f"{degrees(c.alpha):.1f} deg ({len(c.local.ids)})" for c in model.clusters),
            ),
            ("Derivatives", str(len(model.names))),
            ("Held", ", ".join(model.held) or "none"),
        ],
        laws=_laws(model),
        clusters=[f"{degrees(c.alpha):.1f}" for c in model.clusters],
        drawn=_derivatives(model),
        outputs=outputs,
        coefficients=coefficients,
        scores=scores,
        responses=list(responses),
        misfits=misfits,
        trims=_trims(model),
        provenance=provenance,
    )


def _findings(model: AdvanceRatioModel) -> list[Finding]:
    laws = [law for c in model.clusters for law in c.laws.values()]
    blown = [law for law in laws if law.form != "mean"]
    said = [
        finding(
            "good",
            "{} of {} laws depend on the advance ratio; the others are means.",
            len(blown),
            len(laws),
        )
    ]
    return said + [finding("note", "{}", remark) for remark in model.remarks]


def _comparison(study: CampaignStudy) -> list[Finding]:
    """Say which model tells held-out manoeuvres best, and whether the differences are beyond chance."""
    scores = study.scores
    said = []
    for model, other in (("semi-local", "global"), ("one-shot", "semi-local")):
        less, error = scores.difference(other, model)
        better = less > 0
        sure = abs(less) > 2 * error
        text = "On {} held-out manoeuvres the {} model's misfit is {} by {} ± {} than the {} model's{}."
        said.append(
            finding(
                "good" if better else "note",
                text,
                len(scores.ids),
                model,
                "lower" if better else "higher",
                number(abs(less)),
                number(error, 2),
                other,
                "" if sure else ", which may be chance",
            )
        )
    return said


def _less(study: CampaignStudy, kind: str) -> str:
    if kind == "global":
        return ""
    less, error = study.scores.difference("global", kind)
    return f"{number(less)} ± {number(error, 2)}"


def _laws(model: AdvanceRatioModel) -> list[dict[str, Any]]:
    """Return a row for each derivative and cluster that has a law."""
    return [
        _row(name, degrees(cluster.alpha), cluster.laws[name]) | {"held": name in model.held}
        for name in model.names
        for cluster in model.clusters
        if name in cluster.laws
    ]


def _row(name: str, alpha: float, law: AdvanceRatioLaw) -> dict[str, Any]:
    low, high = (float(x) for x in law.interval(np.inf))
    error, value, low_, high_ = measured_values(law.std_error, law.unblown, low, high)
    blown = law.increment(law.lowest)
    below, above = law.increment_interval(law.lowest)
    terms = "".join(
        f" {'−' if p < 0 else '+'} {short(abs(float(p)))} exp(−{short(float(r))} J)"
        for p, r in zip(law.amplitude, law.rate, strict=True)
    )
    return {
        "name": name,
        "alpha": f"{alpha:.1f}",
        "law": f"{short(law.unblown)}{terms}",
        "unblown": value,
        "error": error,
        "interval": f"{low_} to {high_}",
        "extrapolated": not law.reaches_unblown,
        "increment": f"{number(float(blown))} ({number(float(below))} to {number(float(above))})",
        "scatter": number(law.scatter, 2),
        "forms": [
            {
                "form": f.form,
                "chosen": f.form == law.form,
                "probability": f"{f.probability:.3f}",
                "predictive": number(f.log_predictive),
                "rms": number(f.prediction_rms, 2),
            }
            for f in law.forms
        ],
    }


def _derivatives(model: AdvanceRatioModel) -> list[Picture]:
    """Draw the derivatives of each response, a few to a figure."""
    drawn = []
    responses = dict.fromkeys(name.partition(".")[0] for name in model.names)
    for response in responses:
        names = [n for n in model.names if n.partition(".")[0] == response]
        for start in range(0, len(names), _PANELS):
            part = names[start : start + _PANELS]
            drawn.append(
                picture(
                    figures.derivatives_over_advance_ratio(model, part),
                    f"laws{len(drawn)}",
                    f"{', '.join(part)} against advance ratio by cluster of trim angle of attack",
                    f"{', '.join(part)}: estimates of single manoeuvres with 2σ, laws with 95 % intervals; "
                    "at the right stopped propellers and the laws' unblown limits.",
                )
            )
    return drawn


def _outputs(study: CampaignStudy) -> list[Picture]:
    if not study.outputs:
        return []
    names = [n for n in next(iter(study.outputs.values())) if n in _OUTPUT_UNITS][:_SHOWN_OUTPUTS]
    labels = {n: (n, _OUTPUT_UNITS[n]) for n in names}
    kinds = tuple(study.outputs)
    errors = "; ".join(
        f"{kind}: " + ", ".join(f"{n} {number(study.outputs[kind][n].r2)}" for n in names) for kind in kinds
    )
    return [
        picture(
            figures.histories_by_model(study.outputs, labels, kinds),
            "outputs",
            f"Motion of manoeuvre {study.shown}: measured, and simulated with both estimates",
            f"Manoeuvre {study.shown}, simulated with the parameters of equation error and of output error. "
            f"R²: {errors}.",
        )
    ]


def _coefficients(study: CampaignStudy) -> list[Picture]:
    """Draw longitudinal and lateral coefficients in time, one figure each."""
    drawn = []
    kinds = tuple(study.coefficients)
    for group in (("X", "Z", "M"), ("Y", "L", "N")):
        labels = {r: (formula(r, "coefficient"), "1") for r in group if r in study.coefficients[kinds[0]]}
        if not labels:
            continue
        errors = "; ".join(
            f"{kind}: " + ", ".join(number(study.coefficients[kind][r].rms) for r in labels) for kind in kinds
        )
        drawn.append(
            picture(
                figures.histories_by_model(study.coefficients, labels, kinds),
                f"coefficients{len(drawn)}",
                f"Coefficients of held-out manoeuvre {study.shown}: measured, and by model",
                f"Held-out manoeuvre {study.shown}; local is its own estimate, the others are predictions. "
                f"Root mean square errors ({', '.join(labels)}): {errors}.",
            )
        )
    return drawn


def _misfits(study: CampaignStudy) -> Picture:
    scores = study.scores
    by_model = dict(zip(scores.models, scores.misfit, strict=True))
    return picture(
        figures.held_out_misfits(scores.ids, by_model),
        "misfits",
        "Misfit of held-out manoeuvres by model",
        "Twice the log likelihood that a model loses against a manoeuvre's own fit, per derivative; one "
        "(grey) is what that fit's own errors make. Local: the estimates of the nearest manoeuvre "
        "that was used.",
    )


def _trims(model: AdvanceRatioModel) -> list[dict[str, str]]:
    rows = []
    for k, cluster in enumerate(model.clusters, 1):
        local = cluster.local
        order = np.argsort(local.advance_ratio, kind="stable")
        rows += [
            {
                "id": local.ids[i],
                "cluster": str(k),
                "j": short(float(local.advance_ratio[i]))
                if np.isfinite(local.advance_ratio[i])
                else "stopped",
                "alpha": f"{degrees(local.alpha[i]):.2f}",
                "speed": f"{local.airspeed[i]:.2f}" if np.isfinite(local.airspeed[i]) else "–",
            }
            for i in order
        ]
    return rows

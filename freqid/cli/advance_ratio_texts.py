"""A model over advance ratio as the terminal shows it."""

from __future__ import annotations

from math import degrees, inf
from typing import Any

from freqid.blend.semi_local.held_out import HeldOutScores
from freqid.core.results.advance_ratio import AdvanceRatioLaw, AdvanceRatioModel


def advance_ratio_result(model: AdvanceRatioModel, scores: HeldOutScores | None) -> dict[str, Any]:
    """Return laws with evidence and intervals by cluster, and the scores on held-out manoeuvres."""
    clusters = [
        {
            "alpha_deg": degrees(cluster.alpha),
            "manoeuvres": len(cluster.local.ids),
            "laws": {name: _law(law) for name, law in cluster.laws.items()},
        }
        for cluster in model.clusters
    ]
    result: dict[str, Any] = {"vehicle": model.vehicle, "kind": model.kind, "clusters": clusters}
    result |= {"held": list(model.held), "remarks": list(model.remarks)}
    if scores is not None:
        result["held_out"] = {"manoeuvres": len(scores.ids), "misfit": scores.mean}
    return result


def _law(law: AdvanceRatioLaw) -> dict[str, Any]:
    low, high = law.interval(inf)
    return {
        "form": law.form,
        "unit": law.unit,
        "unblown": {
            "estimate": law.unblown,
            "std_error": law.std_error,
            "lower": float(low),
            "upper": float(high),
            "extrapolated": not law.reaches_unblown,
        },
        "amplitude": law.amplitude.tolist(),
        "rate": law.rate.tolist(),
        "scatter": law.scatter,
        "advance_ratio": [_finite(law.lowest), _finite(law.highest)],
        "manoeuvres": law.points,
        "forms": {
            f.form: {
                "log_evidence": _finite(f.log_evidence),
                "probability": f.probability,
                "log_predictive": _finite(f.log_predictive),
                "prediction_rms": _finite(f.prediction_rms),
            }
            for f in law.forms
        },
    }


def _finite(value: float) -> float | None:
    return value if abs(value) < inf else None


def advance_ratio_table(model: AdvanceRatioModel, scores: HeldOutScores | None) -> str:
    """Return the laws by cluster, remarks and scores, as text."""
    lines = []
    for cluster in model.clusters:
        finite = [law.lowest for law in cluster.laws.values()], [law.highest for law in cluster.laws.values()]
        lines.append(
            f"trim alpha {degrees(cluster.alpha):.3g} deg: {len(cluster.local.ids)} manoeuvres, J "
            f"{min(finite[0]):.3g} to {max(finite[1]):.3g}"
        )
        lines.append(
            f"  {'':10s} {'unblown':>10s} {'+-':>9s}  {'at lowest J':>11s} {'+-':>9s}  law "
            "(probability; leave-one-out error)"
        )
        for name, law in cluster.laws.items():
            kept = next(f for f in law.forms if f.form == law.form)
            lines.append(
                f"  {name:10s} {law.unblown:10.4g} {law.std_error:9.2g}  {law.value(law.lowest):11.4g} "
                f"{law.std_error_at(law.lowest):9.2g}  {_formula(law)} ({kept.probability:.2f}; "
                f"{kept.prediction_rms:.2g})" + (" held" if name in model.held else "")
            )
    lines += model.remarks
    if scores is not None:
        lines.append(f"misfit of {len(scores.ids)} held-out manoeuvres (1: their own error alone):")
        lines += [f"  {name:10s} {value:8.3f}" for name, value in scores.mean.items()]
    return "\n".join(lines)


def _formula(law: AdvanceRatioLaw) -> str:
    terms = [f"{p:+.3g} exp(-{r:.3g} J)" for p, r in zip(law.amplitude, law.rate, strict=True)]
    return " ".join([f"{law.unblown:.4g}", *terms])

"""Sealed predictions and their scores as the terminal shows them."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from freqid.core.results.prediction import LEVEL, Prediction, Score


def prediction_result(prediction: Prediction) -> dict[str, Any]:
    """Return a prediction for machines, without its time histories."""
    return {
        "checksum": prediction.checksum,
        "date": prediction.date,
        "vehicle": prediction.vehicle,
        "reference": prediction.reference.to_json(),
        "model": {
            "file": prediction.model,
            "sha256": prediction.model_sha256,
            "kind": prediction.model_kind,
        },
        "design": {"file": prediction.design_name, "sha256": prediction.design_sha256},
        "level": LEVEL,
        "channels": {
            c.name: {
                "kind": c.kind,
                "unit": c.unit,
                "trim": _plain(c.trim),
                "rms": float(c.change.std()),
                "half_width_rms": float(np.sqrt(np.mean((c.upper - c.change) ** 2))),
                "std": {
                    "parameters": float(np.sqrt(np.mean(c.parameter_std**2))),
                    "residual": c.residual_std,
                    "gusts": c.gust_std,
                    "noise": c.noise_std,
                },
            }
            for c in prediction.channels
        },
        "parameters": {
            r.response: {
                n: {"estimate": float(e), "std_error": float(s)}
                for n, e, s in zip(r.regressors, r.estimate, r.std_error, strict=True)
            }
            for r in prediction.responses
        },
        "assumptions": [
            {"name": a.name, "statement": a.statement, "limit": _plain(a.limit), "unit": a.unit}
            for a in prediction.assumptions
        ],
        "remarks": list(prediction.remarks),
        "settings": prediction.settings,
    }


def prediction_text(prediction: Prediction) -> str:
    """Return one line for each channel, and what is assumed."""
    at = prediction.reference.id or f"u = {prediction.reference.u:.4g} m/s"
    lines = [
        f"{prediction.vehicle} at {at}, {prediction.time[-1]:.4g} s, sealed {prediction.date}",
        f"checksum {prediction.checksum}",
        "",
        "channel   kind      unit   rms moved   95 % half-width   of it: parameters  residual  gusts  noise",
    ]
    for c in prediction.channels:
        parts = np.array([np.mean(c.parameter_std**2), c.residual_std**2, c.gust_std**2, c.noise_std**2])
        total = parts.sum()
        shares = parts / total if total else parts
        width = float(np.sqrt(np.mean((c.upper - c.change) ** 2)))
        lines.append(
            f"{c.name:<10}{c.kind:<10}{c.unit:<6}{c.change.std():>10.4g}{width:>18.4g}"
            f"{_share(shares[0]):>21}{_share(shares[1]):>10}{_share(shares[2]):>7}{_share(shares[3]):>7}"
        )
    lines += ["", "assumed:"]
    lines += [f"  {a.name}: {a.statement}" for a in prediction.assumptions]
    return "\n".join(lines)


def score_result(score: Score) -> dict[str, Any]:
    """Return a score for machines, without its time histories."""
    return {
        "prediction": {"file": score.prediction, "checksum": score.checksum, "date": score.date},
        "record": {"file": score.record, "fingerprint": score.fingerprint, "flown": score.flown},
        "start_s": score.start_s,
        "coverage": score.coverage,
        "gate": score.gate,
        "passed": score.passed,
        "failed": list(score.failed),
        "channels": {
            f"{c.kind}/{c.name}": {
                "unit": c.unit,
                "coverage": c.coverage,
                "rmse": c.rmse,
                "expected_rmse": c.expected_rmse,
                "offset": _plain(c.offset),
                "drift": c.drift,
                "theil": _plain(c.theil),
                "bias_share": _plain(c.bias_share),
                "variance_share": _plain(c.variance_share),
                "covariance_share": _plain(c.covariance_share),
            }
            for c in score.channels
        },
        "assumptions": [
            {"name": c.name, "statement": c.statement, "held": c.held, "evidence": c.evidence}
            for c in score.checks
        ],
    }


def score_text(score: Score) -> str:
    """Return one line for each channel, and one for each assumption."""
    shares = ", ".join(f"{kind} {100 * share:.1f} %" for kind, share in score.coverage.items())
    lines = [
        f"in the 95 % bands: {shares} (gate {100 * score.gate:g} %)",
        "",
        "channel            unit   in band    RMSE   expected   Theil U   bias  variance  covariance",
    ]
    for c in score.channels:
        bias, variance, covariance = c.shares
        lines.append(
            f"{c.kind + ' ' + c.name:<19}{c.unit:<6}{100 * c.coverage:>6.1f} %{c.rmse:>9.3g}"
            f"{c.expected_rmse:>10.3g}{c.theil:>10.3f}{bias:>8.2f}{variance:>9.2f}{covariance:>11.2f}"
        )
    lines += ["", "assumptions:"]
    words = {"yes": "held", "no": "FAILED", "not testable": "not testable"}
    lines += [f"  {c.name:<13} {words[c.held]}: {c.evidence}" for c in score.checks]
    return "\n".join(lines)


def _share(value: float) -> str:
    return f"{100 * value:.0f} %"


def _plain(value: float) -> float | None:
    return float(value) if isfinite(value) else None

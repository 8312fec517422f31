"""A study as the terminal shows it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from freqid.blend.corridor_study import StudyResults


def study_result(results: StudyResults, folder: Path) -> dict[str, Any]:
    """Return figures of merit by condition and response."""
    points = {
        p.model.reference.id: {
            name: {
                "r2": r.r2,
                "distortion": r.distortion,
                "rmse": _known(p.modelling_rmse(name)),
                "validation_rmse": _known(p.prediction_rmse(name)),  # null without a flight that validates
            }
            for name, r in p.model.responses.items()
        }
        for p in results.points
    }
    held_out = {
        h.reference.id: {"global_rmse": dict(h.global_rmse), "point_rmse": dict(h.point_rmse)}
        for h in results.held_out
    }
    return {"folder": str(folder), "points": points, "held_out": held_out}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def study_table(results: StudyResults) -> str:
    """Return the coefficients of determination by condition and response."""
    names = list(results.points[0].model.responses)
    lines = ["R2      " + "".join(f"{name:>9s}" for name in names)]
    for point in results.points:
        model = point.model
        lines.append(f"{model.reference.id:10s}" + "".join(f"{model[name].r2:9.4f}" for name in names)[2:])
    return "\n".join(lines)

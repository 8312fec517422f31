"""A global model as the terminal shows it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.blend.consistency import Agreement
from freqid.core.results.corridor import Corridor
from freqid.core.results.fit import Fit


def blend_result(corridor: Corridor, agreement: list[Agreement], predicted: dict[str, Fit]) -> dict[str, Any]:
    """Return a corridor, the agreement of its densities and what was predicted, for machines."""
    responses = {}
    for name, knots in corridor.responses.items():
        columns = zip(knots.regressors, knots.estimate.tolist(), knots.std_error.tolist(), strict=True)
        parameters = {x: {"estimate": value, "std_error": error} for x, value, error in columns}
        parameters["bias"] = {"estimate": knots.bias.tolist(), "std_error": knots.bias_std_error.tolist()}
        responses[name] = {"parameters": parameters, "units": knots.unit}
    return {
        "reference": {
            "id": list(corridor.ids),
            "u": corridor.u.tolist(),
            "rho": corridor.rho.tolist(),
            **dict(zip(corridor.scheduled, corridor.schedule.tolist(), strict=True)),
            "line": corridor.line.tolist(),
        },
        "vehicle": corridor.vehicle,
        "form": corridor.form,
        "responses": responses,
        "agreement": [asdict(one) for one in agreement],
        "prediction": {
            name: {"r2": fit.r2, "rmse": fit.rms, "mean": float(fit.residual.mean())}
            for name, fit in predicted.items()
        },
    }


def _along(corridor: Corridor, on: NDArray[np.bool_]) -> str:
    """Return what a line runs along and how far, where that is not speed."""
    if corridor.along == "u":
        return ""
    place = corridor.coordinate[on]
    unit = corridor.scheduled_units[corridor.scheduled.index(corridor.along)]
    return f"along {corridor.along} {place[0]:.4g} to {place[-1]:.4g} {unit}, "


def blend_table(corridor: Corridor, agreement: list[Agreement], predicted: dict[str, Fit]) -> str:
    """Return what was blended, how densities agree and what was predicted, as text."""
    lines = []
    for i in range(corridor.line.max() + 1):
        on = corridor.line == i
        lines.append(
            f"line {i + 1}: {on.sum()} points, u {corridor.u[on][0]:.4g} to {corridor.u[on][-1]:.4g} m/s, "
            + _along(corridor, on)
            + f"rho {corridor.rho[on].mean():.4g} kg/m3"
        )
    lines += [
        f"{one.response}: rho {one.rho[1]:.4g} against {one.rho[0]:.4g} kg/m3 at {one.points} points: "
        f"chi-square {one.chi_square:.4g} of {one.degrees_of_freedom}, p {one.p:.2g}, "
        f"difference {100 * one.difference:.2g} %"
        for one in agreement
    ]
    lines += [
        f"{name} [{corridor[name].unit}]  predicted R2 {fit.r2:.4f}  rmse {fit.rms:.4g}, its mean "
        f"{fit.residual.mean():.4g}"
        for name, fit in predicted.items()
    ]
    return "\n".join(lines)

"""Least squares beside instruments, for all parameters of a point model at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from freqid.core.results.point import ErrorsInVariables, PointModel, ResponseModel
from freqid.core.results.point_file import per
from freqid.identify.regress.estimators import LEAST_STRENGTH
from freqid.report.kit.notation import NONE, exact, measured_values, number, pretty_unit, symbol, tenths


def difference_table(model: PointModel) -> dict[str, Any] | None:
    """Return differences of the two estimates by regressor and response, and how strong each instrument is.

    Returns
    -------
    dict or None
        ``heads``, symbols of the responses; ``rows`` with ``name``, ``strength``, ``weak`` and ``cells``;
        ``critical``, the least difference that is beyond noise; ``estimates``, rows of both by response.
        None where one estimator stands alone.
    """
    both = {name: r for name, r in model.responses.items() if r.errors_in_variables is not None}
    if not both:
        return None
    rows = []
    for regressor in dict.fromkeys(name for response in both.values() for name in response.regressors):
        cells, strength = [], np.inf
        for response in both.values():
            beside = response.errors_in_variables
            if beside is None or regressor not in response.regressors:
                cells.append({"text": NONE, "far": False})
                continue
            j = response.regressors.index(regressor)
            value = float(response.normalised_difference[j])
            cells.append({"text": exact(value, tenths(value)), "far": abs(value) > beside.critical[j]})
            strength = min(strength, float(beside.strength[j]))
        rows.append(
            {
                "name": regressor,
                "cells": cells,
                "strength": exact(strength, number(strength)),
                "weak": strength < LEAST_STRENGTH,
            }
        )
    critical = [r.errors_in_variables.critical for r in both.values() if r.errors_in_variables is not None]
    return {
        "heads": [symbol(name, model.form) for name in both],
        "rows": rows,
        "critical": number(float(np.min(np.concatenate(critical)))),
        "strong": f"{LEAST_STRENGTH:g}",
        "estimates": [
            {"symbol": symbol(name, model.form), "rows": _both(response, response.errors_in_variables)}
            for name, response in both.items()
            if response.errors_in_variables is not None
        ],
    }


def _both(response: ResponseModel, beside: ErrorsInVariables) -> list[dict[str, Any]]:
    """Return the two estimates of each parameter, beside each other."""
    rows = []
    for j, name in enumerate(response.regressors):
        error, other_error = float(response.std_error[j]), float(beside.std_error[j])
        estimate, other = float(response.estimate[j]), float(beside.estimate[j])
        apart = float(response.normalised_difference[j])
        texts, others = measured_values(error, estimate), measured_values(other_error, other)
        rows.append(
            {
                "name": name,
                "estimate": exact(estimate, texts[1]),
                "error": exact(error, texts[0]),
                "other": exact(other, others[1]),
                "other_error": exact(other_error, others[0]),
                "apart": exact(apart, tenths(apart)),
                "far": name in response.differing,
                "unit": pretty_unit(per(response.unit, response.regressor_units[j])),
            }
        )
    return rows

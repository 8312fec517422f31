"""Python: a model as one file that needs numpy alone and checks itself."""

from __future__ import annotations

import textwrap
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from freqid.blend.exports import exact, usable_range
from freqid.blend.global_model import GlobalModel
from freqid.blend.line import STILL_TILT, Line
from freqid.blend.similarity import ALIKE, goes_with_velocity, not_similar
from freqid.core.arrays import Array
from freqid.core.results.advance_ratio import TRIM_SHARE, AdvanceRatioModel
from freqid.core.results.corridor import Corridor
from freqid.core.results.point import PointModel
from freqid.core.store import replacing
from freqid.core.units import RHO0

_MARK = "# What follows goes into the exported file as it stands.\n"
_IMPORTS = """import sys
from itertools import pairwise

import numpy as np
"""
CHECKS = 40
ERROR_NODES = 65  # of standard errors against 1 / J


def write_python(path: Path, model: PointModel | GlobalModel | AdvanceRatioModel, version: str) -> None:
    """Write a model as a Python module.

    Parameters
    ----------
    path : Path
    model : PointModel, GlobalModel or AdvanceRatioModel
    version : str
        Of the program that writes.

    Raises
    ------
    DataError
        Where the file cannot be written.

    Notes
    -----
    The module has ``wrench(inputs)`` and ``standard_error(inputs)``, of an advance-ratio model
    ``derivatives(advance_ratio, alpha)``; run as a program, it compares itself with check cases in it.
    """
    if isinstance(model, GlobalModel):
        kind, data, notes = "corridor", _corridor(model), usable_range.range_notes(model)
    elif isinstance(model, PointModel):
        kind, data, notes = "point", _point(model), exact.range_notes(model)
    else:
        kind, data, notes = "laws", *_laws(model)
    evaluator = resources.files("freqid.blend.exports.standalone").joinpath(f"{kind}.py")
    code = evaluator.read_text(encoding="utf-8").partition(_MARK)[2]
    said = (f"Written by freqid {version}.", *notes, "Needs numpy alone; run as a program, it checks itself.")
    head = "\n".join(textwrap.fill(line, 100, initial_indent="# ", subsequent_indent="#   ") for line in said)
    model_text = "".join(f"    {name!r}: {_literal(value)},\n" for name, value in data.items())
    imports = f"{_IMPORTS}\nnan, inf = float('nan'), float('inf')\n"
    with replacing(path) as temporary:
        temporary.write_text(f"{head}\n\n{imports}DATA = {{\n{model_text}}}\n{code}", encoding="utf-8")


def _literal(value: Any) -> str:
    """Return a value as Python writes it, arrays as lists; floats have all their digits."""
    if isinstance(value, np.ndarray):
        return _literal(value.tolist())
    if isinstance(value, dict):
        return "{\n" + ",\n".join(f"{k!r}: {_literal(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        if any(isinstance(v, list | tuple | dict | np.ndarray) for v in value):
            return "[" + ",\n".join(_literal(v) for v in value) + "]"
        words = [_literal(v) for v in value]
        return "[" + ",\n".join(", ".join(words[i : i + 6]) for i in range(0, len(words), 6)) + "]"
    return repr(value.item() if isinstance(value, np.generic) else value)


def _corridor(model: GlobalModel) -> dict[str, Any]:
    c = model.corridor
    inputs = usable_range.states(model, CHECKS, seed=1)
    truth = model.wrench(inputs, outside="hold")
    scale = [float(np.abs(r.bias).max()) for r in c.responses.values()]
    units = usable_range.units_of(model)
    return {
        "vehicle": c.vehicle,
        "form": c.form,
        "conditions": list(c.ids),
        "inputs": list(model.inputs),
        "input_units": [units[n] for n in model.inputs],
        "responses": list(model.names),
        "units": [r.unit for r in c.responses.values()],
        "sizes": scale,
        "regressors": list(c.units),
        "velocity": goes_with_velocity(c.units),
        "scheduled": list(c.scheduled),
        "still": c.schedule[:, 0],
        "rho0": RHO0,
        "still_tilt": float(STILL_TILT),
        "tolerance": {"tilt": model.tolerance.tilt, "speed": model.tolerance.speed},
        "density_alike": ALIKE if not_similar(c.units) else None,
        "lines": [_line(c, line, i) for i, line in enumerate(model.lines)],
        "checks": {
            "inputs": inputs,
            "values": truth.values,
            "std_error": truth.std_error,
            "outside": truth.outside,
        },
    }


def _line(c: Corridor, line: Line, index: int) -> dict[str, Any]:
    responses = []
    for local in line.local:
        band = _band(local.parameters.slope_weights)
        p = len(local.columns)
        lower = local.covariance[:, 1:, 1:][:, *np.tril_indices(p)]
        responses.append(
            {
                "columns": list(local.columns),
                "values": local.parameters.values,
                "trims": local.trim.values,
                "slope_weights": band,
                "bias_variance": local.covariance[:, 0, 0],
                "covariance": lower,
            }
        )
    return {
        "rho": line.rho,
        "knots": line.knots,
        "turn": line.turn,
        "path": line.path.values,
        "responses": responses,
    }


def _band(weights: Array) -> Array:
    """Return of the weights of slopes (channel, knot, knot) those of the three knots that matter."""
    n = weights.shape[1]
    width = min(3, n)
    first = np.clip(np.arange(n) - 1, 0, n - width)
    return np.stack([weights[:, np.arange(n), first + j] for j in range(width)], axis=2)


def _point(model: PointModel) -> dict[str, Any]:
    factors = exact.factor_trims(model)
    inputs, outside = exact.states_about(model)
    values, errors = exact.values_at(model, inputs)
    return {
        "vehicle": model.vehicle,
        "form": model.form,
        "condition": model.reference.to_json(),
        "inputs": list(factors),
        "input_units": [unit for unit, _, _ in factors.values()],
        "responses": list(model.responses),
        "units": [r.unit for r in model.responses.values()],
        "departure": exact.DEPARTURE,
        "trim": {name: trim for name, (_, trim, _) in factors.items()},
        "rms": {name: rms for name, (_, _, rms) in factors.items()},
        "models": [
            {
                "bias": r.bias,
                "bias_std_error": r.bias_std_error,
                "regressors": list(r.regressors),
                "trim": r.trim,
                "estimate": r.estimate,
                "covariance": r.covariance,
            }
            for r in model.responses.values()
        ],
        "checks": {"inputs": inputs, "values": values, "std_error": errors, "outside": outside},
    }


def _laws(model: AdvanceRatioModel) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the laws, with standard errors as tables of 1 / J, and what to say of them."""
    clusters, checks, worst = [], [], 0.0
    for cluster in model.clusters:
        laws = {}
        for name, law in cluster.laws.items():
            nodes = np.linspace(0.0, 1.0 / law.lowest if np.isfinite(law.lowest) else 1.0, ERROR_NODES)
            errors = law.std_error_at(_over(nodes))
            middle = 0.5 * (nodes[1:] + nodes[:-1])
            between = law.std_error_at(_over(middle))
            worst = max(
                worst, float(np.max(np.abs(np.interp(middle, nodes, errors) / between - 1), initial=0))
            )
            laws[name] = {
                "unit": law.unit,
                "form": law.form,
                "unblown": law.unblown,
                "amplitude": law.amplitude,
                "rate": law.rate,
                "lowest": law.lowest,
                "highest": law.highest,
                "inverse_advance_ratio": nodes,
                "std_error": errors,
            }
        clusters.append({"trims": cluster.local.alpha, "laws": laws})
        lowest = max(law.lowest for law in cluster.laws.values())
        highest = max(law.highest for law in cluster.laws.values())
        places = np.linspace(lowest, highest, 5) if np.isfinite(lowest) else np.zeros(0)  # all are stopped
        for j in (*places, np.inf):
            values = {name: float(law.value(j)) for name, law in cluster.laws.items()}
            checks.append({"advance_ratio": float(j), "alpha": cluster.alpha, "values": values})
    data = {
        "vehicle": model.vehicle,
        "kind": model.kind,
        "trim_share": TRIM_SHARE,
        "clusters": clusters,
        "checks": checks,
    }
    notes = (
        f"Derivatives of {model.vehicle or 'an aircraft'} against the propellers' advance ratio "
        "J = V / (n d) and trim angle of attack, rad.",
        "Each law is held below the lowest advance ratio that it is made from, and outside() names it.",
        "Values are exact; standard errors, one sigma, are linear tables of 1 / J, right to a share of "
        f"{worst:.1g}.",
    )
    return data, notes


def _over(inverse: Array) -> Array:
    """Return the advance ratios of their inverses; inf of zero."""
    with np.errstate(divide="ignore"):
        return 1.0 / inverse

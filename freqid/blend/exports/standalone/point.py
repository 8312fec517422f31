"""The evaluator of a point model's Python file."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

DATA: dict[str, Any] = {}
# What follows goes into the exported file as it stands.

INPUTS = dict(zip(DATA.get("inputs", ()), DATA.get("input_units", ()), strict=True))
RESPONSES = dict(zip(DATA.get("responses", ()), DATA.get("units", ()), strict=True))


def wrench(inputs=None, **values):
    """Return the responses, shape (response, n), and whether each state is outside, shape (n,).

    Inputs are those of INPUTS by name, arrays of shape (n,) or numbers, SI and radians, absolute. Outside,
    more than a few rms from the trim, the model goes on linearly.
    """
    given = _given({**(inputs or {}), **values})
    found = [one["bias"] + np.array(one["estimate"]) @ _moved(given, one) for one in DATA["models"]]
    return np.array(found), _outside(given)


def standard_error(inputs=None, **values):
    """Return one standard error of the responses, shape (response, n)."""
    given, found = _given({**(inputs or {}), **values}), []
    for one in DATA["models"]:
        x = _moved(given, one)
        found.append(one["bias_std_error"] ** 2 + ((np.array(one["covariance"]) @ x) * x).sum(axis=0))
    return np.sqrt(found)


def _given(given):
    unknown, missing = set(given) - set(INPUTS), set(INPUTS) - set(given)
    if unknown or missing:
        raise ValueError(
            f"inputs are {' '.join(INPUTS)}; unknown {sorted(unknown)}, missing {sorted(missing)}"
        )
    size = np.broadcast_shapes((1,), *(np.shape(v) for v in given.values()))
    given = {name: np.broadcast_to(np.asarray(v, float), size) for name, v in given.items()}
    if not all(np.isfinite(v).all() for v in given.values()):
        raise ValueError("inputs are finite numbers")
    return given


def _moved(given, one):
    """Return the regressors less their trims, shape (p, n); a product is of its factors' departures."""
    rows = []
    for name, trim in zip(one["regressors"], one["trim"], strict=True):
        parts = name.split("*")
        if len(parts) == 1:
            rows.append(given[name] - trim)
        else:
            rows.append(np.prod([given[p] - DATA["trim"][p] for p in parts], axis=0) - trim)
    return np.array(rows)


def _outside(given):
    limits = {name: DATA["departure"] * rms for name, rms in DATA["rms"].items() if rms > 0}
    return np.any([np.abs(given[n] - DATA["trim"][n]) > limit for n, limit in limits.items()], axis=0)


def self_check(tolerance=1e-12):
    """Compare with the cases that freqid computed, and say how they compare."""
    checks = DATA["checks"]
    found, outside = wrench(checks["inputs"])
    expected = np.array(checks["values"])
    worst = float((np.abs(found - expected) / np.abs(expected).max(axis=1, keepdims=True)).max())
    error = np.array(checks["std_error"])
    worst_error = float(np.abs(standard_error(checks["inputs"]) / error - 1).max())
    same = bool((outside == np.array(checks["outside"])).all())
    good = worst <= tolerance and worst_error <= 1e-9 and same
    verdict = "good" if good else "NOT AS EXPECTED"
    text = f"{expected.shape[1]} check cases: responses within {worst:.1e} of their size"
    print(f"{text}, standard errors within {worst_error:.1e}; {verdict}")
    return good


if __name__ == "__main__":
    sys.exit(0 if self_check() else 1)

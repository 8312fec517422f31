"""The evaluator of an advance-ratio model's Python file."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

DATA: dict[str, Any] = {}
# What follows goes into the exported file as it stands.


def derivatives(advance_ratio, alpha):
    """Return all derivatives by name at one advance ratio, inf with stopped propellers, and alpha, rad.

    The laws of the cluster with the nearest trim are used: ``C_inf + sum p exp(-r J)``. Below the lowest
    advance ratio that a law is made from, it is held there; `outside` tells.
    """
    return {
        name: _value(law, max(advance_ratio, law["lowest"])) for name, law in _cluster(alpha)["laws"].items()
    }


def outside(advance_ratio, alpha):
    """Return the derivatives whose laws are made from higher advance ratios only."""
    laws = _cluster(alpha)["laws"]
    return [name for name, law in laws.items() if advance_ratio < law["lowest"] * (1 - DATA["trim_share"])]


def standard_error(advance_ratio, alpha):
    """Return one standard error of all derivatives by name."""
    return {
        name: float(np.interp(1.0 / advance_ratio, law["inverse_advance_ratio"], law["std_error"]))
        for name, law in _cluster(alpha)["laws"].items()
    }


def _cluster(alpha):
    return min(DATA["clusters"], key=lambda c: float(np.abs(np.array(c["trims"]) - alpha).min()))


def _value(law, j):
    return float(law["unblown"] + (np.array(law["amplitude"]) * _decay(np.array(law["rate"]), j)).sum())


def _decay(rate, j):
    return np.exp(-rate * j) if np.isfinite(j) else np.zeros_like(rate)


def self_check(tolerance=1e-12):
    """Compare with the cases that freqid computed, and say how they compare."""
    checks, worst = DATA["checks"], 0.0
    for case in checks:
        found = derivatives(case["advance_ratio"], case["alpha"])
        for name, value in case["values"].items():
            size = max(abs(c["values"][name]) for c in checks)
            worst = max(worst, abs(found[name] - value) / (size or 1.0))
    good = worst <= tolerance
    verdict = "good" if good else "NOT AS EXPECTED"
    print(f"{len(checks)} check cases: derivatives within {worst:.1e} of their size; {verdict}")
    return good


if __name__ == "__main__":
    sys.exit(0 if self_check() else 1)

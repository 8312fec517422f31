"""Derivative increments: by how much each derivative in flight differs from the simulation's."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from freqid.core.gap_result import Increment
from freqid.gap.evidence import Evidence, Hypothesis
from freqid.gap.tolerance import DERIVATIVES, OF_EFFECT, TOGETHER, TURNED, WHOLE

LEVEL = 0.95
WIDE = 1.0
"""One sigma of an increment before any data, of the derivative itself."""

_OF_DERIVATIVES = (
    f"{TOGETHER}:",
    f"{TURNED}:",
    f"{WHOLE}:",
    f"{OF_EFFECT}surface_effectiveness:",
    f"{OF_EFFECT}weak_rotor:",
)


def increments(evidence: Evidence, tolerance: float) -> tuple[Increment, ...]:
    """Return the increments of all derivatives together, clear ones first, largest first.

    Parameters
    ----------
    evidence : Evidence
    tolerance : float
        One sigma of a derivative's tolerance, of the derivative; at zero there is nothing to estimate with.

    Notes
    -----
    The metric already has each derivative's tolerance integrated over a prior a of one sigma; here it gets a
    part b more, of prior s sigma. What is asked for is their sum c, whose prior is ``1 + s^2``. Given c, b is
    ``k c`` with variance k, ``k = s^2 / (1 + s^2)``, so mean and covariance of c follow from those of b:
    ``E c = E b / k`` and ``cov c = (cov b - k I) / k^2``. Tolerances by which derivatives are off
    together are part of what is asked for, so nothing is left to them.
    """
    evidence = evidence.without([n for n in evidence.tolerances if n.startswith(_OF_DERIVATIVES)])
    names = [n for n in evidence.tolerances if n.startswith(f"{DERIVATIVES}:")]
    if not names or tolerance <= 0:
        return ()
    wide = max(WIDE / tolerance, 3.0)
    columns = tuple(evidence.column(n) for n in names)
    found = evidence.estimate(Hypothesis("increments", columns, (wide,) * len(columns)))
    k = wide**2 / (1 + wide**2)
    percent = 100 * tolerance * found.value / k
    variance = np.maximum(np.diag(found.covariance) - k, 0.0) / k**2
    half = 100 * tolerance * norm.ppf((1 + LEVEL) / 2) * np.sqrt(variance)
    every = []
    for name, value, reach in zip(names, percent.tolist(), half.tolist(), strict=True):
        _, response, moved = name.split(":", 2)
        every.append(Increment(response, moved, value, value - reach, value + reach))
    return tuple(sorted(every, key=lambda i: (not i.clear, -abs(i.percent))))

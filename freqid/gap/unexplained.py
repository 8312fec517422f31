"""How much of a residual no linear motion of the vehicle explains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import STATE
from freqid.core.record import Maneuver
from freqid.gap.histories import Histories
from freqid.gap.lines import Lines
from freqid.gap.quiet import ATTITUDE, MOTION

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MOVING = 30.0  # power ratio of a channel to its noise from which it moves at all


def unexplained(
    maneuver: Maneuver, lines: Lines, like: Histories, residual: Complex, sigma: dict[str, float]
) -> tuple[Array, Array]:
    """Return power that no linear motion explains, (row, line), and the share of freedom left, (row,)."""
    record = maneuver.record
    omega = 2j * np.pi * lines.hz

    def spectra(names: Sequence[str]) -> Complex:
        """Return transforms of channels that move; one at rest would explain its own noise away."""
        have = [n for n in names if n in record]
        z = lines.spectrum(record.matrix(have)) if have else np.empty((0, lines.hz.size), dtype=complex)
        floor = np.array([sigma.get(n, 0.0) ** 2 * record.dt for n in have])
        return z[np.mean(np.abs(z) ** 2, axis=1) > np.maximum(_MOVING * floor, 1e-300)]

    motion = spectra([f"state/{n}" for n in MOTION])
    effectors = spectra([f"effector/{n}" for n in record.group("effector")])
    if "state/u" not in record:
        motion = np.concatenate([motion, spectra([f"air/{n}" for n in ("V", "alpha", "beta")])])
    attitude = spectra([f"state/{n}" for n in ATTITUDE])
    columns = {
        "response": np.concatenate([motion, omega * motion, effectors]),
        "kinematic": np.concatenate([motion, attitude, effectors]),
    }
    # a state is the answer to all that its inputs did before: to delays and lags of them too
    late = np.concatenate([columns["response"], *(omega**k * effectors for k in (1, 2, 3))])
    left, freedom = np.empty(residual.shape), np.empty(len(like.rows))
    # residuals are without trends and ends, motions are not: so these go with the columns
    without = lines.taken_out
    for i, row in enumerate(like.rows):
        if row.kind == "response" and row.name in STATE:
            left[i], freedom[i] = _left(residual[i], np.concatenate([late, without]))
            continue
        if row.kind == "actuator":
            name = row.name.partition("/")[2]
            # a delay or a lag makes next to a straight line of the rate of what is reached, a gain of itself
            both = np.concatenate([spectra([f"command/{name}"]), spectra([f"effector/{name}"])])
            columns["actuator"] = np.concatenate([both, omega * both, omega**2 * both])
        left[i], freedom[i] = _left(residual[i], np.concatenate([columns[row.kind], without]))
    return left, freedom


def _left(row: Complex, columns: Complex) -> tuple[Array, float]:
    """Return the power of a row beyond columns with real coefficients, and the share of equations left.

    At most half of the equations go to columns: the strongest directions among them.
    """
    stacked = np.concatenate([row.real, row.imag])
    share = 1.0
    if len(columns):
        x = np.concatenate([columns.real, columns.imag], axis=1)
        x = x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-300)
        _, size, basis = np.linalg.svd(x, full_matrices=False)
        basis = basis[: min(int((size > 1e-6 * size[0]).sum()), x.shape[1] // 2)]
        stacked = stacked - (stacked @ basis.T) @ basis
        share = 1 - len(basis) / x.shape[1]
    return stacked[: row.size] ** 2 + stacked[row.size :] ** 2, share

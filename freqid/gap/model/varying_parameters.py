"""Parameters of the simulation that vary with the motion: errors of the formula of one part.

A parameter of a simulation, such as the thrust of a propeller, stands for a formula. Where the formula is
wrong, the parameter that would be right changes with the motion, and with it all loads that the part makes,
in fixed ratios. So does an effect. Errors of form of single loads know nothing of such ratios: it takes many
of them to do what one effect does, and the effect is the better explanation.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from freqid.core.arrays import Complex
from freqid.gap.settings import SEEN, VARIATIONS
from freqid.gap.stack.block import Block

NAME = "varying."
"""What names of these columns begin with."""


def varying_columns(block: Block, sizes: Mapping[str, float]) -> dict[str, Complex]:
    """Return what loads do where the simulation's own parameters change with the motion.

    Each parameter changes by the largest of `VARIATIONS` for each standard deviation of each motion: how much
    is likeliest, the record says (`Parts.likeliest`). There are hundreds of such products; their principal
    directions, in the noise of the loads, are the columns. Each condition has its own: a formula that is
    right at one speed may be wrong at another.

    Parameters
    ----------
    block : Block
    sizes : dict of float
        One sigma by name, where it is not that of the simulation.

    Returns
    -------
    dict of ndarray of complex, shape (row, line)
        One sigma of each direction; none where the simulation declares no parameters of its loads.
    """
    trial = block.drawn
    own, record = trial.simulation.tolerances, trial.maneuver.record
    asked = {n: s for n, t in own.items() if not t.actuator and (s := sizes.get(n, t.sigma))}
    rows = [i for i, row in enumerate(block.rows) if row.kind == "response"]
    if not (asked and trial.inputs and rows):
        return {}
    moves = np.array([record[n] - record[n].mean() for n in trial.inputs])
    moves *= VARIATIONS[-1] / moves.std(axis=1, keepdims=True)
    root = np.sqrt(block.power_alone[rows])
    each = []
    for change in trial.simulation.sensitivity(record, asked):
        z = block.grid.spectrum(change[None] * moves[:, None]) / root
        each.append(block.lines.real(z).reshape(len(moves), -1))
    products = np.concatenate(each)
    few = len(products) < products.shape[1]  # a matrix of the smaller side is quicker than singular values
    values, basis = np.linalg.eigh(products @ products.T if few else products.T @ products)
    kept = values > SEEN**2
    made = basis[:, kept].T @ products if few else np.sqrt(values[kept, None]) * basis[:, kept].T
    made = made.reshape(len(made), len(rows), 2 * block.lines.hz.size - 1)
    whole = np.zeros((len(made), len(block.rows), block.lines.hz.size), dtype=complex)
    whole[:, rows] = block.lines.complex(made) * root
    return {f"{NAME}{k}": z for k, z in enumerate(whole)}

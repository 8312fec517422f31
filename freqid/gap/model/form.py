"""Error of form: each term of the simulation times a smooth complex function of frequency.

Tolerances move parameters; beyond these a simulation is wrong in ways that nobody lists. How much is
learned from the record: the relative size is integrated over (M. C. Kennedy, A. O'Hagan, "Bayesian
calibration of computer models", Journal of the Royal Statistical Society B 63, 2001: model discrepancy).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev

from freqid.core.arrays import Array, Complex
from freqid.core.record import Maneuver
from freqid.gap.settings import FORM_CONSTANT, FORM_ERRORS, FORM_ORDER
from freqid.gap.stack.block import Block

_STEP = 1e-3  # share by which a channel is scaled for its terms
_KINEMATIC = tuple(
    f"state/{n}" for n in ("u", "v", "w", "p", "q", "r", "ax", "ay", "az", "phi", "theta", "psi")
)
_VISIBLE = 0.1  # of one unit of whitened energy at the largest size: terms below it are left out


def load_terms(block: Block) -> tuple[list[int], Complex]:
    """Return the terms of the loads: the row that each is in, and its spectrum, shape (term, line).

    Each derivative times what it acts on.
    """
    trial = block.trial
    rows: list[int] = []
    spectra: list[Complex] = []
    if trial.inputs:
        moves = _moves(block)
        for i in range(len(trial.predicted)):
            rows += [i] * len(moves)
            spectra.extend(block.grid.spectrum(trial.gradient[i] * moves))
    return rows, np.array(spectra).reshape(len(rows), block.lines.hz.size)


def load_errors(block: Block) -> tuple[list[int], Complex]:
    """Return what an error of form of the loads is made of, as `load_terms` does.

    Every motion in every load, as large as its own term there, or as the load's average term if that is
    larger. Whoever fits a load by a model with few terms leaves a share of the load, not of each term: what
    was left out altogether is wrong by all of it. A motion so small that it is below the average in every
    load is as much smaller in all.
    """
    trial = block.trial
    rows: list[int] = []
    spectra: list[Complex] = []
    if trial.inputs:
        moves = _moves(block)
        size = np.sqrt(((trial.gradient * moves) ** 2).mean(axis=2))  # by load and motion
        average = np.sqrt((size**2).mean(axis=1, keepdims=True))
        share = np.divide(size, average, out=np.zeros_like(size), where=average > 0).max(axis=0).clip(max=1.0)
        acts = share > 0
        unit = block.grid.spectrum(moves[acts] / moves[acts].std(axis=1, keepdims=True))
        for i, own in enumerate(np.maximum(size, share * average)[:, acts]):
            rows += [i] * len(unit)
            spectra.extend(own[:, None] * unit)
    return rows, np.array(spectra).reshape(len(rows), block.lines.hz.size)


def _moves(block: Block) -> Array:
    """Return what the loads depend on about its mean, shape (input, sample)."""
    record = block.trial.maneuver.record
    return np.array([record[n] - record[n].mean() for n in block.trial.inputs])


def actuator_terms(block: Block) -> tuple[list[int], Complex]:
    """Return the terms of the actuators: the simulated movement of each, in its own row."""
    rows: list[int] = []
    spectra: list[Complex] = []
    for i, row in enumerate(block.rows):
        if row.kind == "actuator":
            position = block.trial.positions[row.name.partition("/")[2]]
            rows.append(i)
            spectra.append(block.grid.spectrum(position - position.mean()))
    return rows, np.array(spectra).reshape(len(rows), block.lines.hz.size)


def kinematic_terms(block: Block) -> tuple[list[int], Complex]:
    """Return the terms of the kinematic relations: each channel's movement as every relation has it."""
    trial = block.trial
    record = trial.maneuver.record
    at = [i for i, row in enumerate(block.rows) if row.kind == "kinematic"]
    rows: list[int] = []
    spectra: list[Complex] = []
    for name in _KINEMATIC if at else ():
        if name not in record or not np.ptp(record[name]) > 0:
            continue
        values = record[name]
        channel = replace(record.channel(name), values=values + _STEP * (values - values.mean()))
        moved = trial.measured_on(Maneuver(record.with_channels(channel), trial.maneuver.vehicle))
        z = block.transform(moved - trial.measured) / _STEP
        for i in at:
            if np.any(z[i]):
                rows.append(i)
                spectra.append(z[i])
    return rows, np.array(spectra).reshape(len(rows), block.lines.hz.size)


def form_columns(block: Block, terms: tuple[list[int], Complex]) -> Complex:
    """Return the columns of an error of form of size one, shape (column, row, line), of visible terms.

    The constant of a load's term is larger than what varies with frequency: derivatives are wrong sooner than
    dynamics.
    """
    rows, spectra = terms
    hz = block.lines.hz
    shapes = _shapes(block)
    constant = np.ones(len(shapes))
    constant[0] = FORM_CONSTANT
    largest = max(FORM_ERRORS)
    kept = []
    for i, spectrum in zip(rows, spectra, strict=True):
        if largest**2 * float((np.abs(spectrum) ** 2 / block.noise_power[i]).sum()) < _VISIBLE:
            continue
        z = np.zeros((len(shapes), len(block.rows), hz.size), dtype=complex)
        own = constant if block.rows[i].kind == "response" else np.ones(len(shapes))
        z[:, i] = own[:, None] * shapes * spectrum
        kept.append(z)
    return np.concatenate(kept) if kept else np.zeros((0, len(block.rows), hz.size), dtype=complex)


def _shapes(block: Block) -> Complex:
    """Return smooth functions of frequency, shape (function, line): Chebyshev's, in and out of phase.

    Smooth in frequency, not in its logarithm: lags and wakes are smooth there, and would be taken for form.
    """
    hz = block.lines.hz
    weight = 1 / (1 + np.arange(FORM_ORDER + 1.0))
    shapes = chebyshev.chebvander(2 * hz / hz[-1] - 1, FORM_ORDER).T * weight[:, None]
    return np.concatenate([shapes, 1j * shapes])

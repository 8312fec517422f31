"""Error of form: what a simulation is wrong by beyond its parameters, to second order in the motion.

A load depends on motions. To first order its error is a smooth complex function of frequency times each
motion, to second order a number times each product of two.

Tolerances move parameters; beyond these a simulation is wrong in ways that nobody lists. How much is
learned from the record (M. C. Kennedy, A. O'Hagan, "Bayesian calibration of computer models", Journal of the
Royal Statistical Society B 63, 2001: model discrepancy).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from freqid.core.arrays import Array, Complex
from freqid.core.record import Maneuver
from freqid.gap.settings import FORM_CONSTANT, FORM_ERRORS, FORM_ORDER
from freqid.gap.stack.block import Block

PRODUCTS = "products of motions"
"""What the second order of a load's error is named by."""

_STEP = 1e-3  # share by which a channel is scaled for its terms
_KINEMATIC = tuple(
    f"state/{n}" for n in ("u", "v", "w", "p", "q", "r", "ax", "ay", "az", "phi", "theta", "psi")
)
_VISIBLE = 0.1  # of one unit of whitened energy at the largest size: terms below it are left out


class Term(NamedTuple):
    """What an error of form is proportional to.

    Attributes
    ----------
    row : int
        Of the block: the one that is wrong.
    by : str
        What it acts on; several terms of one name share the size of their errors.
    spectrum : ndarray of complex, shape (line,)
    """

    row: int
    by: str
    spectrum: Complex

    def name(self, block: Block) -> str:
        """Return what the size of its error is known by."""
        row = block.rows[self.row]
        return row.name if row.kind == "actuator" else f"{row.name} by {self.by}"


def row_of(term: str) -> str:
    """Return the row that a term's name is of."""
    return term.partition(" by ")[0]


def load_terms(block: Block) -> list[Term]:
    """Return the terms of the loads: each derivative times what it acts on."""
    trial = block.trial
    if not trial.inputs:
        return []
    moves = _moves(block)
    return [
        Term(i, name, z)
        for i in range(len(trial.predicted))
        for name, z in zip(trial.inputs, block.grid.spectrum(trial.gradient[i] * moves), strict=True)
    ]


def load_errors(block: Block) -> list[Term]:
    """Return what an error of form of the loads is made of to first order.

    Every motion in every load, as large as its own term there, or as the load's average term if that is
    larger. Whoever fits a load by a model with few terms leaves a share of the load, not of each term: what
    was left out altogether is wrong by all of it. A motion so small that it is below the average in every
    load is as much smaller in all.
    """
    if not block.trial.inputs:
        return []
    names, moves, size, average, share = _sizes(block)
    unit = block.grid.spectrum(moves)
    return [
        Term(i, name, own * z)
        for i in range(len(size))
        for name, own, z in zip(names, np.maximum(size[i], share * average[i]), unit, strict=True)
    ]


def load_products(block: Block) -> list[Term]:
    """Return what an error of form of the loads is made of to second order: products of two motions.

    Each as large as the load's average term. Those of one load share the size of their errors: there are
    hundreds of them.
    """
    if not block.trial.inputs:
        return []
    _, moves, _, average, share = _sizes(block)
    small = moves * share[:, None]
    one, other = np.triu_indices(len(moves))
    products = block.grid.spectrum(small[one] * small[other])
    return [Term(i, PRODUCTS, own * z) for i, own in enumerate(average.tolist()) for z in products]


def _sizes(block: Block) -> tuple[list[str], Array, Array, Array, Array]:
    """Return the motions that move any load, and how large their terms are.

    Returns
    -------
    names : list of str
    moves : ndarray, shape (motion, sample)
        Of unit standard deviation.
    size : ndarray, shape (load, motion)
        Root mean square of each term.
    average : ndarray, shape (load,)
        Of a load's terms.
    share : ndarray, shape (motion,)
        By which a motion is smaller than an average term in whatever load it is largest; one at most.
    """
    trial, moves = block.trial, _moves(block)
    size = np.sqrt(((trial.gradient * moves) ** 2).mean(axis=2))
    average = np.sqrt((size**2).mean(axis=1))
    share = np.divide(size, average[:, None], out=np.zeros_like(size), where=average[:, None] > 0)
    share = share.max(axis=0).clip(max=1.0)
    acts = share > 0
    names = [n for n, moved in zip(trial.inputs, acts.tolist(), strict=True) if moved]
    unit = moves[acts] / moves[acts].std(axis=1, keepdims=True)
    return names, unit, size[:, acts], average, share[acts]


def _moves(block: Block) -> Array:
    """Return what the loads depend on about its mean, shape (input, sample)."""
    record = block.trial.maneuver.record
    return np.array([record[n] - record[n].mean() for n in block.trial.inputs])


def actuator_terms(block: Block) -> list[Term]:
    """Return the terms of the actuators: the simulated movement of each, in its own row."""
    found = []
    for i, row in enumerate(block.rows):
        if row.kind == "actuator":
            name = row.name.partition("/")[2]
            position = block.trial.positions[name]
            found.append(Term(i, name, block.grid.spectrum(position - position.mean())))
    return found


def kinematic_terms(block: Block) -> list[Term]:
    """Return the terms of the kinematic relations: each channel's movement as every relation has it."""
    trial = block.trial
    record = trial.maneuver.record
    at = [i for i, row in enumerate(block.rows) if row.kind == "kinematic"]
    found = []
    for name in _KINEMATIC if at else ():
        if name not in record or not np.ptp(record[name]) > 0:
            continue
        values = record[name]
        channel = replace(record.channel(name), values=values + _STEP * (values - values.mean()))
        moved = trial.measured_on(Maneuver(record.with_channels(channel), trial.maneuver.vehicle))
        z = block.transform(moved - trial.measured) / _STEP
        found += [Term(i, name, z[i]) for i in at if np.any(z[i])]
    return sorted(found, key=lambda term: term.row)


def form_terms(block: Block) -> list[Term]:
    """Return all terms of first order: of loads, actuators and relations between sensors."""
    return [*load_errors(block), *actuator_terms(block), *kinematic_terms(block)]


def shared_columns(block: Block) -> dict[tuple[str, str], Complex]:
    """Return errors of form of size one that are the same in all conditions, shape (row, line) each.

    What a simulation leaves out at one speed it leaves out at the next. A load's derivative is wrong by a
    share of itself, or of the load's average term: what is a small difference of large numbers, as the
    pitching moment by angle of attack, is wrong by a share of these. A model that is quasi-steady leaves out
    how fast a motion changes, so a term is wrong by its first two derivatives in time too. An effector whose
    position is not simulated has none of these: that it is late is an effect, and only its loads show it. An
    actuator or a sensor errs in phase and out of it.

    Returns
    -------
    dict
        By the term's name, which the size of the error is known by, and which of its columns it is.
    """
    found = {}
    for term, ways in _shared(block):
        if _visible(block, term):
            name = term.name(block)
            for which, spectrum in ways.items():
                z = np.zeros((len(block.rows), block.lines.hz.size), dtype=complex)
                z[term.row] = spectrum
                found[name, which] = z
    return found


def _shared(block: Block) -> Iterator[tuple[Term, dict[str, Complex]]]:
    """Yield terms of first order, each with its columns."""
    if block.trial.inputs:
        names, moves, size, average, share = _sizes(block)
        sign = np.sign(block.trial.gradient.mean(axis=2))[:, [n in names for n in block.trial.inputs]]
        unit = block.grid.spectrum(moves)
        rate = 1j * block.lines.hz / block.lines.hz[-1]
        # whether these are late shows in no row of their own
        unseen = {n for n in names if n.startswith("effector/") and n[9:] not in block.trial.positions}
        for i, (own, mean) in enumerate(zip(sign * size, average, strict=True)):
            for name, a, b, z in zip(names, own, share * mean, unit, strict=True):
                largest = max(abs(a), b) * z
                ways = {"share": a * z, "average": b * z}
                if name not in unseen:
                    ways |= {"rate": rate * largest / 2, "curve": rate**2 * largest / 3}
                yield Term(i, name, largest), {which: FORM_CONSTANT * x for which, x in ways.items()}
    for term in [*actuator_terms(block), *kinematic_terms(block)]:
        yield term, {"in phase": term.spectrum, "out of phase": 1j * term.spectrum}


class FormColumns(NamedTuple):
    """Columns of an error of form of size one, of one term: all are in its row.

    Attributes
    ----------
    term : str
        Its name, which the size of the error is known by.
    row : int
    spectra : ndarray of complex, shape (column, line)
    """

    term: str
    row: int
    spectra: Complex


def form_columns(block: Block, terms: Iterable[Term]) -> list[FormColumns]:
    """Return the columns of an error of form of visible terms, each times smooth functions of frequency.

    The constant of a load's term is larger than what varies with frequency: derivatives are wrong sooner than
    dynamics.
    """
    shapes = _shapes(block)
    one, derivative = np.ones((len(shapes), 1)), np.ones((len(shapes), 1))
    derivative[0] = FORM_CONSTANT
    return [
        FormColumns(
            term.name(block),
            term.row,
            (derivative if block.rows[term.row].kind == "response" else one) * shapes * term.spectrum,
        )
        for term in terms
        if _visible(block, term)
    ]


def product_columns(block: Block) -> list[FormColumns]:
    """Return the columns of an error of form to second order: of each load's visible products."""
    by_row: dict[int, list[Term]] = {}
    for term in load_products(block):
        if _visible(block, term):
            by_row.setdefault(term.row, []).append(term)
    return [
        FormColumns(terms[0].name(block), i, np.array([t.spectrum for t in terms]))
        for i, terms in by_row.items()
    ]


def in_rows(block: Block, columns: Sequence[FormColumns]) -> Complex:
    """Return columns of terms as columns of the block, shape (column, row, line)."""
    whole = np.zeros((sum(len(c.spectra) for c in columns), len(block.rows), block.lines.hz.size), complex)
    start = 0
    for _, row, spectra in columns:
        whole[start : start + len(spectra), row] = spectra
        start += len(spectra)
    return whole


def _visible(block: Block, term: Term) -> bool:
    power = float((np.abs(term.spectrum) ** 2 / block.noise_power[term.row]).sum())
    return max(FORM_ERRORS) ** 2 * power >= _VISIBLE


def _shapes(block: Block) -> Complex:
    """Return smooth functions of frequency, shape (function, line): Chebyshev's, in and out of phase.

    Smooth in frequency, not in its logarithm: lags and wakes are smooth there, and would be taken for form.
    """
    hz = block.lines.hz
    weight = 1 / (1 + np.arange(FORM_ORDER + 1.0))
    shapes = chebyshev.chebvander(2 * hz / hz[-1] - 1, FORM_ORDER).T * weight[:, None]
    return np.concatenate([shapes, 1j * shapes])

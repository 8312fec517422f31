"""Two simulations on one stack: the same rows, lines, motion and draws; one noise, one error of form."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.record import Maneuver
from freqid.gap.infer.block_matrices import Form, Products
from freqid.gap.infer.system import System
from freqid.gap.infer.where import bands_of
from freqid.gap.model.form import actuator_terms, form_columns, in_rows, load_terms
from freqid.gap.model.tolerance import record_columns, tolerance_columns
from freqid.gap.settings import ACTUATOR_FORM_ERRORS, FORM_ERRORS
from freqid.gap.simulation import Simulation
from freqid.gap.stack.block import Block, stack_of
from freqid.gap.stack.lines import Lines
from freqid.gap.stack.motion import Motion
from freqid.gap.stack.noise import Draws, antithetic, covariance_of, least_power, sensor_power, whitening_of
from freqid.gap.stack.trial import Trial
from freqid.simulate.effects.effect import Effect

BandHz = tuple[float, float]
NamedColumns = dict[str, Complex]

# of all terms, and of actuators
_FORMS = tuple(Form(a, b) for a in FORM_ERRORS for b in ACTUATOR_FORM_ERRORS)


@dataclass(frozen=True, eq=False)
class SharedBlock:
    """One condition and what two simulations leave of it; spectra in the row's unit times sqrt(s).

    Attributes
    ----------
    names : tuple of str
        Records that are repeats of each other.
    rows : tuple of str
        That both simulations predict. Kinematic rows are left out: no simulation is in them.
    regime : str
    lines : Lines
    residuals : tuple of 2 ndarray of complex, shape (row, line)
        Of A and B, mean over the repeats, less the bias of replays on noisy states.
    covariance : ndarray of complex, shape (line, row, row)
        Of the noise in the mean of both residuals; beyond the sensors' own, the lesser of what either leaves.
    noise : tuple of 2 ndarray of complex, shape (draw, row, line)
        What the same draws of the sensors' noise make of each residual.
    louder : ndarray of complex, shape (draw, row, line)
        Draws of all noise of that covariance.
    tolerances : tuple of 2 dict of ndarray of complex, shape (row, line)
        One sigma of each tolerance that all blocks share, by name, of A and of B.
    own : tuple of 2 ndarray of complex, shape (column, row, line)
        One sigma of what is unknown in this block's records alone.
    form : tuple of 2 ndarray of complex, shape (column, row, line)
        Errors of form of size one, of the loads.
    actuators : tuple of 2 ndarray of complex, shape (column, row, line)
        ... and of the actuators.
    missed : ndarray, shape (row,)
        Share of what the record's motion does to a row that this motion does not; by it the columns of
        tolerances are wrong. Zero of actuators: commands are known.
    noise_from : str
        What the noise was learned from.
    motion : str
        Source of the motion without noise.
    """

    names: tuple[str, ...]
    rows: tuple[str, ...]
    regime: str
    lines: Lines
    residuals: tuple[Complex, Complex]
    covariance: Complex
    noise: tuple[Complex, Complex]
    louder: Complex
    tolerances: tuple[NamedColumns, NamedColumns]
    own: tuple[Complex, Complex]
    form: tuple[Complex, Complex]
    actuators: tuple[Complex, Complex]
    missed: Array
    noise_from: str = ""
    motion: str = ""

    @cached_property
    def _whitening(self) -> Complex:
        return whitening_of(self.covariance)

    def white(self, z: Complex, row: int | slice = slice(None)) -> Array:
        """Return rows on lines, shape (..., row, line), as independent real numbers of variance one.

        Parameters
        ----------
        z : ndarray of complex, shape (..., row, line)
        row : int or slice
            One row by itself, or all of them with one Cholesky factor a line.
        """
        if isinstance(row, int):
            return self.lines.real(z[..., row, :] / np.sqrt(self.covariance[:, row, row].real))
        flat = np.moveaxis(z.reshape(-1, *z.shape[-2:]), (0, 2), (2, 0))
        found = np.moveaxis(self._whitening @ flat, (0, 2), (2, 0)).reshape(z.shape)
        real = self.lines.real(found)
        return real.reshape(*real.shape[:-2], real.shape[-2] * real.shape[-1])

    def apart(self, row: str) -> Array:
        """Return the difference of the residuals in one row, as real numbers."""
        i = self.rows.index(row)
        return self.lines.real(self.residuals[0][i] - self.residuals[1][i])

    def stacked(self, columns: Sequence[Complex | None]) -> Complex:
        """Return columns, shape (column, row, line); zero where one is missing."""
        none = np.zeros((len(self.rows), self.lines.hz.size), dtype=complex)
        return np.array([none if z is None else z for z in columns]).reshape(-1, *none.shape)


@dataclass(frozen=True)
class SharedForm:
    """The errors of form that count for both simulations: those of the one whose form is better.

    Attributes
    ----------
    loads, actuators : tuple of 2 floats
        Likeliest share of each term, of A and of B.
    better_loads, better_actuators : {0, 1}
        Of which simulation the terms are.
    """

    loads: tuple[float, float]
    actuators: tuple[float, float]
    better_loads: int
    better_actuators: int

    @property
    def size(self) -> float:
        """Of the loads."""
        return self.loads[self.better_loads]

    def actuators_of(self, block: SharedBlock) -> Complex:
        """Return the errors of form of actuators in a block, shape (column, row, line)."""
        return self.actuators[self.better_actuators] * block.actuators[self.better_actuators]


def shared_stack(
    pair: tuple[Simulation, Simulation],
    maneuvers: tuple[Sequence[Maneuver], Sequence[Maneuver]],
    names: Sequence[str],
    library: Mapping[str, Effect],
    sizes: tuple[Mapping[str, float], Mapping[str, float]],
    band_hz: BandHz,
    *,
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[list[SharedBlock], tuple[BandHz, ...]]:
    """Return two simulations on one stack, and the bands in which a diagnosis says where a gap is.

    Parameters
    ----------
    pair : tuple of 2 Simulation
    maneuvers : tuple of 2 sequence of Maneuver
        The same flights for A and for B; rotors have inertia where a simulation leaves their moments out.
    names : sequence of str
        Of the manoeuvres.
    library : dict of Effect
        Whose parameters may be off by a tolerance.
    sizes : tuple of 2 dict of float
        Tolerances of A and B, of `freqid.gap.model.tolerance.stated`.
    band_hz : tuple of 2 floats
    seed : int
    tell : callable, optional
        Called with what is being done.

    Raises
    ------
    DataError
        Where a record lacks a channel that one of them needs.
    """
    stacks = []
    for label, simulation, flown in zip("AB", pair, maneuvers, strict=True):
        tell(f"replaying {label}")
        stacks.append(stack_of(simulation, flown, names, band_hz, seed=seed))
    bands = bands_of(stacks[0])
    found = []
    for i, (a, b) in enumerate(zip(*stacks, strict=True)):
        tell(f"computing tolerances of {a.names[0]} ({i + 1} of {len(stacks[0])})")
        found.append(_shared((a, b), library, sizes, seed + 1000 * i))
    return found, bands


def _shared(
    blocks: tuple[Block, Block],
    library: Mapping[str, Effect],
    sizes: tuple[Mapping[str, float], Mapping[str, float]],
    seed: int,
) -> SharedBlock:
    other = {row.name for row in blocks[1].rows}
    rows = [row.name for row in blocks[0].rows if row.name in other and row.kind != "kinematic"]
    at = [[[row.name for row in one.rows].index(name) for name in rows] for one in blocks]
    repeats = len(blocks[0].names)
    scale = np.minimum(*(_louder(one, i) * repeats for one, i in zip(blocks, at, strict=True)))
    a, b = _one_motion(blocks, seed)
    odd = [one.draws.odd[:, i] for one, i in zip((a, b), at, strict=True)]
    least = least_power(a.trial, a.grid)[at[0]]
    middle = Draws((odd[0] + odd[1]) / 2, np.zeros_like(odd[0][0]), np.zeros(scale.shape))
    covariance = covariance_of(middle, scale, least) / repeats
    power = np.maximum(sensor_power(middle), least[:, None])
    louder = np.sqrt(np.einsum("lii->il", covariance).real / power)
    tolerances, own, form = [], [], {"loads": [], "actuators": []}
    for one, i, size in zip((a, b), at, sizes, strict=True):
        columns = tolerance_columns(one, library, size)
        tolerances.append({n: z[i] for n, z in columns.items() if np.any(z[i])})
        unknown = [z[i] for z in record_columns(one, library, size).values()]
        own.append(np.array([z for z in unknown if np.any(z)]).reshape(-1, *scale.shape))
        for kind, terms in (("loads", load_terms(one)), ("actuators", actuator_terms(one))):
            whole = in_rows(one, form_columns(one, terms))[:, i]
            form[kind].append(whole[np.any(whole, axis=(1, 2))])
    return SharedBlock(
        names=a.names,
        rows=tuple(rows),
        regime=a.regime,
        lines=a.lines,
        residuals=(a.residual[at[0]], b.residual[at[1]]),
        covariance=covariance,
        noise=(odd[0] / np.sqrt(repeats), odd[1] / np.sqrt(repeats)),
        louder=middle.odd * louder,
        tolerances=(tolerances[0], tolerances[1]),
        own=(own[0], own[1]),
        form=(form["loads"][0], form["loads"][1]),
        actuators=(form["actuators"][0], form["actuators"][1]),
        missed=np.minimum(*(_missed(one, i) for one, i in zip((a, b), at, strict=True))),
        noise_from=a.noise_from,
        motion=a.motion.source,
    )


def _louder(block: Block, rows: Sequence[int]) -> Array:
    """Return the ratio of flown noise to what the sensors make of rows, shape (row, line)."""
    own = sensor_power(block.draws)[rows]
    least = least_power(block.trial, block.grid)[rows]
    return block.noise_power[rows] / np.maximum(own, least[:, None])


def _missed(block: Block, rows: Sequence[int]) -> Array:
    """Return the share of what the record's motion does to rows that the motion without noise does not do.

    Each input's difference, noise apart, counts as the row's derivative makes it count.
    """
    trial, lines = block.trial, block.lines
    record = block.motion.maneuver.record
    found = np.zeros(len(block.rows))
    if not trial.inputs:
        return found[rows]
    flown = np.mean([lines.spectrum(m.record.matrix(trial.inputs)) for m in block.maneuvers], axis=0)[:, 1:]
    free = lines.spectrum(record.matrix(trial.inputs))[:, 1:]
    noise = np.array([block.sigma.get(n, 0.0) for n in trial.inputs]) ** 2 * lines.dt / len(block.maneuvers)
    wrong = np.maximum((np.abs(flown - free) ** 2 - noise[:, None]).sum(axis=1), 0.0)
    slopes = (trial.gradient**2).mean(axis=2)
    moved = slopes @ (np.abs(free) ** 2).sum(axis=1)
    found[: len(slopes)] = np.sqrt((slopes @ wrong) / np.maximum(moved, 1e-300))
    return np.minimum(found, 1.0)[rows]


def _one_motion(blocks: tuple[Block, Block], seed: int) -> tuple[Block, Block]:
    """Return blocks on the motion without noise that misses less of the record.

    With their own motions, simulations that say the same would differ by their columns and biases.
    """
    a, b = blocks
    if a.motion.missed == b.motion.missed:
        return blocks
    if a.motion.missed < b.motion.missed:
        return a, _on(b, a.motion, seed)
    return _on(a, b.motion, seed), b


def _on(block: Block, motion: Motion, seed: int) -> Block:
    """Return a block whose trial and draws are of another motion; its vehicle stays."""
    flown = replace(motion.maneuver, vehicle=block.trial.maneuver.vehicle)
    trial = Trial.of(block.trial.simulation, flown)
    draws = antithetic(trial, block.lines, block.sigma, seed)
    residuals = block.residuals + block.draws.bias - draws.bias
    return replace(
        block, motion=motion, trial=trial.thinned(block.trial.every), draws=draws, residuals=residuals
    )


def form_of(blocks: Sequence[SharedBlock]) -> SharedForm:
    """Return the likeliest errors of form of either simulation, each with all its tolerances allowed for."""
    (a, log_a), (b, log_b) = (_likeliest(blocks, i) for i in (0, 1))
    assert isinstance(a.loads, float)  # one share holds for all rows
    assert isinstance(b.loads, float)
    return SharedForm(
        (a.loads, b.loads),
        (a.shared, b.shared),
        int((b.loads, -log_b) < (a.loads, -log_a)),
        int((b.shared, -log_b) < (a.shared, -log_a)),
    )


def _likeliest(blocks: Sequence[SharedBlock], simulation: int) -> tuple[Form, float]:
    """Return the likeliest errors of form of a simulation, and their log evidence."""
    i = simulation
    names = tuple(dict.fromkeys(n for b in blocks for n in b.tolerances[i]))
    matrices = []
    for b in blocks:
        columns = b.stacked([b.tolerances[i].get(n) for n in names])
        parts = (columns, b.residuals[i], b.own[i], b.form[i], b.actuators[i])
        white = [b.white(z) for z in parts]
        matrices.append(Products.of(white[0][:0], *white).matrices())
    system = System([], names, matrices, _FORMS)
    log = [system.reduced(form).log_evidence for form in system.form_errors]
    at = int(np.argmax(log))
    return system.form_errors[at], log[at]

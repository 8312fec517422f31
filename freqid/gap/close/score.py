"""How far a gap shrinks on what was left out: effect alone, tolerances alone, both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from freqid.core.arrays import Array, Complex
from freqid.core.results.diagnosis import Change, Share
from freqid.gap.close.fit import Fit
from freqid.gap.infer.columns import Columns
from freqid.gap.infer.system import System
from freqid.gap.stack.block import Block

_DRAWS = 400  # of the bootstrap
_ACTS = 0.05  # of an effect's energy over noise, from which it acts in a row
_CLEAR = 1.0  # of the noise's energy: a gap below it leaves no share to speak of


@dataclass(frozen=True, eq=False)
class Scored:
    """One block that was left out, with what a fit to others makes of it.

    Attributes
    ----------
    block : Block
    columns : Columns
    fit : Fit
    """

    block: Block
    columns: Columns
    fit: Fit

    def left(self, effect: Array, tolerances: Array) -> Array:
        """Return the energy of what is left by real number, own unknowns and error of form integrated out."""
        c = self.columns
        y = c.residual - effect @ c.effects - tolerances @ c.tolerances
        own = np.concatenate([c.own, *c.form_at(self.fit.form_error)])
        if not len(own):
            return y * y
        return y * (y - own.T @ cho_solve(cho_factor(np.eye(len(own)) + own @ own.T), own @ y))

    def spectra(self, system: System, index: int, effect: Array) -> Complex:
        """Return what weights of a system's columns make of the block, its `index`-th, shape (row, line)."""
        z = np.zeros((len(self.block.rows), self.block.lines.hz.size), dtype=complex)
        for i, c in enumerate(system.candidates):
            w = effect[system.columns_of(i)]
            if np.any(w):
                z += np.tensordot(w, c.columns[index], 1)
        return z


def shares(scored: Sequence[Scored], seed: int, level: float) -> dict[str, Share]:
    """Return the shares of a gap that go: ``effect``, ``tolerances`` and ``both``, with bootstrap intervals.

    ``G = 1 - (P_after - P_noise) / (P_before - P_noise)`` with P the mean whitened squared residual; one
    means "to the noise", and nothing above is said.
    """
    zero = [(np.zeros_like(s.fit.effect), np.zeros_like(s.fit.tolerances)) for s in scored]
    ways = {
        "effect": [(s.fit.effect_alone, t) for s, (_, t) in zip(scored, zero, strict=True)],
        "tolerances": [(e, s.fit.tolerances_alone) for s, (e, _) in zip(scored, zero, strict=True)],
        "both": [(s.fit.effect, s.fit.tolerances) for s in scored],
    }
    before = np.concatenate([s.left(*z) for s, z in zip(scored, zero, strict=True)])
    rng = np.random.default_rng([seed, 3])
    afters = {
        name: np.concatenate([s.left(*h) for s, h in zip(scored, how, strict=True)])
        for name, how in ways.items()
    }
    return shares_of(before, afters, rng, level)


def shares_of(
    before: Array, afters: Mapping[str, Array], rng: np.random.Generator, level: float
) -> dict[str, Share]:
    """Return the shares of energies over noise that go, with bootstrap intervals of a level.

    Parameters
    ----------
    before : ndarray, shape (number,)
        Each one where noise is all.
    afters : dict of ndarray, shape (number,)
        By name.
    rng : numpy.random.Generator
    level : float
    """
    drawn = rng.integers(0, before.size, size=(_DRAWS, before.size))
    return {name: _share(before, after, drawn, level) for name, after in afters.items()}


def _share(before: Array, after: Array, drawn: NDArray[np.intp], level: float) -> Share:
    over = before.sum() - before.size
    if over < _CLEAR * np.sqrt(2 * before.size):
        return Share(float("nan"), float("nan"), float("nan"), "the gap is no larger than the noise there")
    gone, there = before - after, before[drawn].sum(axis=1) - before.size
    # where a few numbers hold the gap, as means do, draws without them have none to close
    some = there >= _CLEAR * np.sqrt(2 * before.size)
    each = gone[drawn[some]].sum(axis=1) / there[some]
    lo, hi = np.quantile(each, [(1 - level) / 2, (1 + level) / 2])
    whole = float(gone.sum() / over)
    return Share(min(whole, 1.0), min(float(lo), 1.0), min(float(hi), 1.0))


@dataclass(frozen=True, eq=False)
class Responses:
    """Classical figures by response, before and after, and where an effect acts.

    Attributes
    ----------
    rmse, theil : dict of Change
    acting : tuple of str
        Rows that hold a twentieth of the effect's energy over noise or more.
    rises : bool
        Whether the error of these rows, each over its noise, is larger with effect and tolerances than the
        nominal simulation's.
    """

    rmse: dict[str, Change]
    theil: dict[str, Change]
    acting: tuple[str, ...]
    rises: bool


def responses(scored: Sequence[Scored], indices: Sequence[int], system: System) -> Responses:
    """Return classical figures of replays on blocks that were left out.

    Parameters
    ----------
    scored : sequence of Scored
    indices : sequence of int
        Of the blocks among those of the candidates' columns.
    system : System
        Of the candidates.
    """
    rms: dict[str, list[tuple[float, float, float, float]]] = {}
    energy: dict[str, float] = {}
    error = {"before": 0.0, "after": 0.0}
    parts = []
    for s, index in zip(scored, indices, strict=True):
        effect = s.spectra(system, index, s.fit.effect)
        moved = np.tensordot(s.fit.tolerances, s.columns.sigmas, 1)
        residual = s.block.residual
        simulated = s.block.transform(s.block.trial.nominal.simulated)
        parts.append((s.block, residual, residual - effect - moved))
        for i, row in enumerate(s.block.rows):
            own, left = (_rms(s.block, z[i]) for z in (residual, residual - effect - moved))
            moves = _rms(s.block, simulated[i] + residual[i])
            said = _rms(s.block, simulated[i])
            rms.setdefault(row.name, []).append((own, left, moves, said))
            power = (np.abs(effect[i]) ** 2 / s.block.noise_power[i]).sum()
            energy[row.name] = energy.get(row.name, 0.0) + float(power)
    total = max(sum(energy.values()), 1e-300)
    acting = tuple(n for n, e in energy.items() if e >= _ACTS * total)
    for block, before, after in parts:
        for i, row in enumerate(block.rows):
            if row.name in acting:
                for end, z in (("before", before), ("after", after)):
                    error[end] += float((np.abs(z[i, 1:]) ** 2 / block.noise_power[i, 1:]).sum())
    changes, theil = {}, {}
    for name, each in rms.items():
        before, after, moves, said = (float(np.sqrt(np.mean(np.square(x)))) for x in zip(*each, strict=True))
        changes[name] = Change(before, after, moves)
        below = max(moves + said, 1e-300)
        theil[name] = Change(before / below, after / below)
    return Responses(changes, theil, acting, error["after"] > error["before"])


def _rms(block: Block, z: Complex) -> float:
    """Return the root mean square over time of a spectrum's changes, the mean left out, unit of the row."""
    power = 2 * (np.abs(z[1:]) ** 2).sum() / block.lines.duration
    return float(np.sqrt(power))

"""The share of the gap between flown and simulated motion that goes: closures of the responses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.results.diagnosis import Change, Share
from freqid.gap.close.own_flight import CannotFly, OwnFlight
from freqid.gap.close.score import Scored, shares_of
from freqid.gap.fidelity import frequency_cost
from freqid.gap.infer.explain import Explanation
from freqid.gap.infer.system import System
from freqid.gap.model.testable import in_force_of
from freqid.gap.model.tolerance import of_effects
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

_COHERENT = 0.6  # coherence from which a frequency response is used: Tischler & Remple, sec. 11.2


@dataclass(eq=False)
class Flown:
    """The simulation's own flights under the blocks that are scored, each flown once.

    Attributes
    ----------
    blocks : sequence of Block
    known_effects : dict of Effect
    tolerances : dict of float
        One sigma by name.
    """

    blocks: Sequence[Block]
    known_effects: Mapping[str, Effect]
    tolerances: Mapping[str, float]
    _flights: dict[int, OwnFlight | str] = field(default_factory=dict, repr=False)

    def flight(self, index: int) -> OwnFlight | str:
        """Return the flight under a block's injected signals, or why there is none."""
        if index not in self._flights:
            try:
                self._flights[index] = OwnFlight.of(self.blocks[index])
            except CannotFly as why:
                self._flights[index] = str(why)
        return self._flights[index]


@dataclass(frozen=True, eq=False)
class Motions:
    """What goes of the gap in motion, and J by state.

    Attributes
    ----------
    share : Share
        With effect and tolerances.
    effect_only : Share
        With the effect at nominal tolerances.
    cost : dict of Change
    """

    share: Share
    effect_only: Share
    cost: dict[str, Change]


def motions(
    flown: Flown,
    scored: Sequence[Scored],
    indices: Sequence[int],
    system: System,
    explanations: Sequence[Explanation],
    seed: int,
    level: float,
) -> Motions:
    """Return the share of the gap between measured and simulated motion that an explanation takes away.

    Parameters
    ----------
    flown : Flown
    scored : sequence of Scored
    indices : sequence of int
        Of the blocks among those flown.
    system : System
        Of the candidates and tolerances.
    explanations : sequence of Explanation
        By block, as they are fitted to the others.
    seed : int
    level : float
        Of the intervals.
    """
    before, only, both = [], [], []
    costs: dict[str, list[tuple[float, float]]] = {}
    for s, index, explanation in zip(scored, indices, explanations, strict=True):
        own = flown.flight(index)
        if isinstance(own, str):
            nothing = Share(float("nan"), float("nan"), float("nan"), own)
            return Motions(nothing, nothing, {})
        apart = own.measured - own.flown
        logged, places = _logged(own, flown.known_effects, explanation)
        effect = _moved(own, s, system, index, s.fit.effect, places) + logged
        alone = _moved(own, s, system, index, s.fit.effect_alone, places) + logged
        tolerances = _within(own, flown, system.tolerances, s)
        left = apart - effect - tolerances
        before.append(own.energy(apart))
        only.append(own.energy(apart - alone))
        both.append(own.energy(left))
        _add_costs(costs, own, own.steady(apart), own.steady(left))
    whole = np.concatenate(before)
    rng = np.random.default_rng([seed, 4])
    afters = {"both": np.concatenate(both), "effect": np.concatenate(only)}
    found = shares_of(whole, afters, rng, level)
    return Motions(found["both"], found["effect"], _changes(costs))


def _logged(
    own: OwnFlight, library: Mapping[str, Effect], explanation: Explanation
) -> tuple[Complex, set[int]]:
    """Return what effects of sensors make of the flight's log, and which candidates these are."""
    total, found = np.zeros_like(own.flown), set()
    for i, e in zip(explanation.places, explanation.estimates, strict=True):
        effect = library.get(e.candidate.effect)
        if effect is not None and effect.distort is not None:
            force = in_force_of(effect, own.block.trial.simulation)
            total = total + own.logged_with(effect, e.candidate.place.settings(force, e.size))
            found.add(i)
    return total, found


def _moved(
    own: OwnFlight,
    scored: Scored,
    system: System,
    index: int,
    weights: Array,
    logged: set[int],
) -> Complex:
    """Return the increment of the motion by the candidates' columns, those of sensors left out."""
    kept = weights.copy()
    for i in logged:
        kept[system.columns_of(i)] = 0.0
    return own.moved_by(scored.spectra(system, index, kept))


def _within(own: OwnFlight, flown: Flown, names: Sequence[str], scored: Scored) -> Complex:
    """Return what fitted tolerances make of the motion, those of sensors of its log."""
    fitted = dict(zip(names, scored.fit.tolerances.tolist(), strict=True))
    total, moving = np.zeros_like(own.flown), scored.fit.tolerances.copy()
    for key, effect, name, sigma in of_effects(own.block.trial, flown.known_effects, flown.tolerances):
        if effect.distort is not None and key in fitted:
            moving[names.index(key)] = 0.0
            at = in_force_of(effect, own.block.trial.simulation)[name]
            total = total + own.logged_with(effect, {name: at + fitted[key] * sigma})
    return total + own.moved_by(np.tensordot(moving, scored.columns.sigmas, 1))


def _add_costs(
    costs: dict[str, list[tuple[float, float]]], own: OwnFlight, before: Complex, after: Complex
) -> None:
    """Add J of each state to each injected signal, from what is left before and after."""
    lines = own.block.lines
    owner, hz = lines.owner[own.lines], lines.hz[own.lines]
    coherence = np.clip(1 - own.power / np.maximum(np.abs(own.measured) ** 2, 1e-300), 0.0, 1.0)
    for i, name in enumerate(own.states):
        for k in range(len(lines.inputs)):
            on = (owner == k) & (coherence[i] > _COHERENT)
            z, trust = own.measured[i, on], coherence[i, on]
            pair = [frequency_cost(hz[on], z, z - x[i, on], trust, points=None) for x in (before, after)]
            if np.isfinite(pair).all():
                costs.setdefault(name, []).append((pair[0], pair[1]))


def _changes(costs: Mapping[str, Sequence[tuple[float, float]]]) -> dict[str, Change]:
    """Return mean J by response, over inputs and blocks."""
    means = {n: np.mean(each, axis=0) for n, each in costs.items()}
    return {n: Change(float(m[0]), float(m[1])) for n, m in means.items()}

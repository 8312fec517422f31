"""What proposals for the next test are judged on: flights at hand, and the pairs that they leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.scenario import Scenario
from freqid.gap.compare import Compared
from freqid.gap.evidence import Evidence
from freqid.gap.explanations import Explanation, alike, apart, as_plain
from freqid.gap.simulation import Simulation
from freqid.simulate.effects.effect import Effect

Array = NDArray[np.float64]
Pair = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Bench:
    """What proposals are judged on.

    Attributes
    ----------
    simulation : Simulation
    compared : sequence of Compared
        Flights at hand.
    evidence : Evidence
        Of them.
    rivals : dict of Explanation
    pairs : tuple of tuple of str
        That are to be told apart.
    candidates : dict of Effect
    sizes : dict of float
        Tolerances.
    scenario : Scenario or None
        Where one describes excitation and conditions.
    loops : dict
        Trims and law of the simulation by density, as they are needed.
    """

    simulation: Simulation
    compared: Sequence[Compared]
    evidence: Evidence
    rivals: Mapping[str, Explanation]
    pairs: tuple[Pair, ...]
    candidates: Mapping[str, Effect]
    sizes: Mapping[str, float]
    scenario: Scenario | None = None
    loops: dict[float, Any] = field(default_factory=dict)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Signatures of the rivals, then common tolerances."""
        signatures = dict.fromkeys(n for r in self.rivals.values() for n in r.signatures)
        return (*signatures, *self.evidence.tolerances)

    @cached_property
    def faced(self) -> dict[Pair, tuple[Explanation, Explanation]]:
        """Each pair at the size of the gap that was seen."""
        seen = self.with_more(self.at_hand)
        return {p: as_plain(seen, self.rivals[p[0]], self.rivals[p[1]]) for p in self.pairs}

    @cached_property
    def at_hand(self) -> Array:
        """Products of the columns over the flights at hand, shape (column, column)."""
        at = [self.evidence.column(n) for n in self.columns]
        return self.evidence.gram.sum(axis=0)[np.ix_(at, at)]

    def with_more(self, gram: Array) -> Evidence:
        """Return the evidence of an experiment with such products of columns; it has no data."""
        count = len(self.columns) - len(self.evidence.tolerances)
        whole = np.zeros((1, len(gram) + 1, len(gram) + 1))
        whole[0, 1:, 1:] = gram
        return Evidence(
            whole, self.columns[:count], self.evidence.tolerances, np.zeros((0, len(gram) - count)), 0
        )

    def separations(self, gram: Array) -> dict[Pair, float]:
        """Return the expected separation of each pair by an experiment."""
        evidence = self.with_more(gram)
        return {p: apart(evidence, *both) for p, both in self.faced.items()}

    def same(self, gram: Array) -> set[Pair]:
        """Return the pairs whose changes are the same in an experiment."""
        evidence = self.with_more(gram)
        return {p for p, both in self.faced.items() if alike(evidence, *both)}

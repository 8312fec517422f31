"""A vehicle that open cases are flown with, and what is asked of any: metric, change, detectability.

Nothing that the flights are made of is seen by the diagnosis: a record describes the nominal vehicle.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from truth import Part, Truth

from freqid.core.record import FlightRecord, Maneuver
from freqid.gap.compare import Compared, compare
from freqid.gap.gather import evidence_of
from freqid.gap.histories import Histories
from freqid.gap.residual import residual
from freqid.gap.simulation import Simulation
from freqid.gap.tolerance import stated
from freqid.simulate.effects import shipped
from freqid.simulate.effects.effect import Effect

DURATION = 60.0  # s, of a manoeuvre

Case = dict[str, Any]
Complex = np.ndarray


@dataclass(frozen=True)
class Circumstances:
    """In which a manoeuvre of a case is flown.

    Attributes
    ----------
    noise : float
        Times the sensors' usual noise.
    gusts : float
        m/s.
    seed : int
        Of noise and gusts.
    scatter : int, optional
        Seed of what the whole vehicle is a little off by; without it the vehicle is the nominal one.
    signals : int
        Which phases of the excitation.
    """

    noise: float = 0.0
    gusts: float = 0.0
    seed: int = 0
    scatter: int | None = None
    signals: int = 0


Fly = Callable[[str, Sequence[Part], Circumstances], FlightRecord]


@dataclass(frozen=True, eq=False)
class Bench:
    """One vehicle of the open cases.

    Attributes
    ----------
    name : str
        Of the vehicle, as cases have it.
    at : tuple of str
        Manoeuvres of a case.
    simulation : Simulation
        Of the nominal vehicle: the one that is diagnosed.
    fly : Fly
        Flies a manoeuvre with truths and returns its log, as the nominal vehicle's. Raises ArithmeticError
        where the flight diverges.
    find : callable
        ``find(identifier, form)``: one of the vehicle's truths.
    tolerance : mapping
        One sigma by name of what is no effect, over the defaults.
    candidates : mapping
        Candidate effects, by identifier.
    band_hz : tuple of 2 floats
    draws : int
        Of the null.
    """

    name: str
    at: tuple[str, ...]
    simulation: Simulation
    fly: Fly
    find: Callable[[str, str], Truth]
    tolerance: Mapping[str, float] = field(default_factory=dict)
    candidates: Mapping[str, Effect] = field(default_factory=shipped)
    band_hz: tuple[float, float] = (0.05, 1.9)
    draws: int = 60

    @property
    def tolerances(self) -> dict[str, float]:
        """One sigma of all that is no effect, by name."""
        return stated(self.tolerance, self.candidates)

    @property
    def allowed(self) -> dict[str, Effect]:
        """Effects that hold tolerances."""
        held = {name.partition(".")[0] for name in self.tolerances}
        return {i: e for i, e in self.candidates.items() if i in held}

    def in_force(self, identifier: str) -> dict[str, float]:
        """Return an effect's parameters in the simulation."""
        nothing = dict.fromkeys(self.candidates[identifier].parameters, 0.0)
        return dict(self.simulation.effects.get(identifier, nothing))

    def measured(self, record: FlightRecord, seed: int, **more: Effect) -> Compared:
        """Return a manoeuvre with its noise and tolerances, for the metric that they make.

        More effects, by identifier, are compared along with those that hold tolerances.
        """
        return compare(
            self.simulation,
            Maneuver.of(record),
            {**self.allowed, **more},
            self.tolerances,
            self.band_hz,
            count=self.draws,
            seed=seed,
        )

    def change(
        self, at: str, parts: Sequence[Part], compared: Compared, circumstances: Circumstances
    ) -> Complex:
        """Return what truths make of one manoeuvre's stack without noise, on the lines of what is compared.

        Both flights have the scatter that is asked for, neither has gusts: they are noise, and two flights
        through the same ones differ by what each makes of them. What has to come up before the record comes
        up in both, to nothing in one. The metric has to be of a flight with the truths: what tolerances may
        do goes with the motion, which the truths change.
        """
        silent = replace(circumstances, noise=0.0, gusts=0.0)
        made = residual(self.simulation, Maneuver.of(self.fly(at, parts, silent)))
        nothing = tuple(replace(p, size=0.0) for p in parts if p.truth.rises)
        return compared.lines.transform(made - _without(self, at, nothing, silent))


@lru_cache(maxsize=16)
def _without(bench: Bench, at: str, nothing: tuple[Part, ...], circumstances: Circumstances) -> Histories:
    return residual(bench.simulation, Maneuver.of(bench.fly(at, nothing, circumstances)))


def detectability(compared: Sequence[Compared], s: Sequence[Complex]) -> float:
    """Return lambda of a change, tolerances integrated over."""
    evidence = evidence_of(compared, changes=[(0 * z, {"truth": z}) for z in s], null=False)
    return float(evidence.metric[1, 1])

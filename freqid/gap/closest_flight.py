"""Which flight of the simulation columns are computed on: with which departures, and with which effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from freqid.gap.infer.evidence import Evidence
from freqid.gap.infer.joint_sizes import joint_estimates
from freqid.gap.model.testable import in_force_of, route_of
from freqid.gap.simulation import Settings, Simulation, side_by_side
from freqid.gap.stack.block import Block, flown_again
from freqid.simulate.effects.effect import Effect

_OFF = 0.01  # share of the rates' motion: below it, columns are off by less than tolerances are known
_NEAR = 0.2  # share of an effect's size: below it, tolerances' columns beside it change by less than a tenth


def flown(
    simulation: Simulation,
    blocks: Sequence[Block],
    departures: dict[str, float],
    found: Mapping[str, Settings],
    *,
    seen: bool = False,
) -> tuple[list[Block], dict[str, float]]:
    """Return blocks on the motion that a simulation flies with departures, and the departures.

    Parameters
    ----------
    simulation : Simulation
    blocks : sequence of Block
    departures : dict of float
        Of its own parameters.
    found : dict of dict of dict of float
        Effects of its own, as `effects` and `acting` of `flown_again`.
    seen : bool
        Whether the body moves as repeats tell, as there.
    """
    effects, acting = found.get("effects"), found.get("acting")

    def fly(block: Block) -> Block:
        return flown_again(block, departures, effects, acting, seen=seen)

    return side_by_side(simulation, fly, blocks), departures


def closest(
    *flights: tuple[list[Block], dict[str, float]],
) -> tuple[list[Block], dict[str, float]]:
    """Return those of several flights, each with its departures, that miss least of the records.

    Departures that are fitted where a large effect is not allowed for are worse than none.
    """
    return min(flights, key=lambda one: sum(b.motion.missed for b in one[0]))


def nearer(told: Sequence[Block], blocks: Sequence[Block]) -> list[Block]:
    """Return blocks, each moved as told where that misses so much less of the record that columns change."""
    each = zip(told, blocks, strict=True)
    return [t if t.motion.missed < b.motion.missed - _OFF else b for t, b in each]


def effect_of_its_own(
    evidence: Evidence, simulation: Simulation, library: Mapping[str, Effect]
) -> dict[str, Settings]:
    """Return the settings of the likeliest effect, where it has one size and the simulation has it itself.

    As `effects`, with which it flies; one that it adds to the loads also as `acting`, beside which all other
    changes are asked for. What an actuator does is known to its own changes.
    """
    i = int(np.argmax(evidence.candidate))
    c = evidence.system.candidates[i]
    if c.kind != "scalar" or c.effect not in simulation.effects:
        return {}
    effect = library[c.effect]
    in_force = {**in_force_of(effect, simulation), **simulation.effects[c.effect]}  # what was found is on top
    size = float(joint_estimates(evidence.system, [i])[0].size[0])
    settings = {c.effect: {**in_force, **c.place.settings(in_force, size)}}
    loads = route_of(effect, simulation) == "own" and effect.stage != "command"
    return {"effects": settings, "acting": settings} if loads else {"effects": settings}


def apart(
    one: Mapping[str, float],
    other: Mapping[str, float],
    simulation: Simulation,
    tolerances: Mapping[str, float],
) -> float:
    """Return how far two sets of departures of a simulation's own parameters are apart at most, in sigmas."""
    own = simulation.tolerances
    sigma = {n: tolerances.get(n, own[n].sigma) for n in {*one, *other}}
    return max((abs(one.get(n, 0.0) - other.get(n, 0.0)) / s for n, s in sigma.items() if s), default=0.0)


def as_near(one: Settings, other: Settings) -> bool:
    """Return whether the same effects act, at sizes so near that tolerances do the same beside them."""
    if {n: set(s) for n, s in one.items()} != {n: set(s) for n, s in other.items()}:
        return False
    return all(abs(x - other[n][k]) <= _NEAR * abs(x) for n, s in one.items() for k, x in s.items())

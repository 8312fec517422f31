"""From multisines with low peaks to those that are flown: net loads, best amplitudes, exchanged combs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from freqid.core.errors import UsageError, nearest
from freqid.core.results.design import Multisine, MultisineDesign
from freqid.core.sections.excitation import Excitation
from freqid.core.vehicle import Effector
from freqid.design.forecast.modelled import Criterion, ModelledAircraft, Wanted
from freqid.design.forecast.optimal import Optimum
from freqid.design.multisine.orthogonal_set import check_feasible, excited, with_low_net_loads


def swap_combs(design: MultisineDesign, pairs: Sequence[tuple[str, str]]) -> MultisineDesign:
    """Return the design with the combs of named effectors exchanged.

    Two effectors that do nearly the same to the aircraft are told apart by what differs between their
    combs. Flown on the exchanged combs as well, each is seen at the other's frequencies too.

    Parameters
    ----------
    design : MultisineDesign
    pairs : sequence of pairs of str
        Effectors, each in one pair at most.

    Returns
    -------
    MultisineDesign
        Harmonics, proportions of amplitudes and phases are those of the partner, so that the relative
        peak factor is the partner's; every effector keeps its rms.

    Raises
    ------
    UsageError
        Where a name is unknown or comes twice.
    """
    partner: dict[str, str] = {}
    for pair in pairs:
        for name, other in (pair, pair[::-1]):
            if name not in design.names:
                raise UsageError(f"the design has no effector '{name}'", remedy=nearest(name, design.names))
            if name in partner or name == other:
                raise UsageError(f"'{name}' is to be swapped more than once", remedy="name it in one pair")
            partner[name] = other
    by_name = {signal.name: signal for signal in design.signals}

    def swapped(own: Multisine) -> Multisine:
        if own.name not in partner:
            return own
        other = by_name[partner[own.name]]
        factor = np.linalg.norm(own.amplitude) / np.linalg.norm(other.amplitude)
        return replace(own, index=other.index, phase=other.phase, amplitude=factor * other.amplitude)

    provenance = {**design.provenance, "swapped": [list(pair) for pair in pairs]}
    return replace(design, signals=tuple(map(swapped, design.signals)), provenance=provenance)


@dataclass(frozen=True, eq=False)
class FinishedSet:
    """One set of multisines as it is flown.

    Attributes
    ----------
    design : MultisineDesign
    before : MultisineDesign, optional
        The same before its net loads and motion were lowered; None where they were not asked for.
    optimum : Optimum, optional
        How its amplitudes were found, where they were not the scenario's.
    """

    design: MultisineDesign
    before: MultisineDesign | None = None
    optimum: Optimum | None = None


def finish(
    searched: MultisineDesign,
    excitation: Excitation,
    effectors: Sequence[Effector],
    *,
    aircraft: ModelledAircraft | None = None,
    criterion: Criterion | None = None,
    wanted: Wanted | None = None,
) -> FinishedSet:
    """Lower what all signals do together, then scale them for the best information inside the limits.

    Parameters
    ----------
    searched : MultisineDesign
        As `design_multisines` or `swapped` gives it.
    excitation : Excitation
    effectors : sequence of Effector
        Of the vehicle.
    aircraft : ModelledAircraft, optional
        Needed for a criterion; with it, states that have abort limits count among the net loads.
    criterion, wanted
        As for `optimal_amplitudes`; without a criterion the amplitudes stay.
    """
    design, before = searched, None
    if excitation.net_load or (aircraft and excitation.abort):
        loop = aircraft.loop if aircraft else None
        design, before = with_low_net_loads(searched, excitation, effectors, loop), searched
    if aircraft is None or criterion is None:
        return FinishedSet(design, before)
    optimum = aircraft.optimal(design, excitation, criterion, wanted)
    if before is not None:  # scaled likewise, so that the two differ by how they are played alone
        signals = tuple(
            replace(s, amplitude=s.amplitude * k) for s, k in zip(before.signals, optimum.scale, strict=True)
        )
        before = replace(before, signals=signals)
    return FinishedSet(optimum.design, before, optimum)


def swapped(
    searched: MultisineDesign,
    pairs: Sequence[tuple[str, str]],
    excitation: Excitation,
    effectors: Sequence[Effector],
) -> MultisineDesign:
    """Return the set in which effectors exchange their combs, which each of them has to be able to follow.

    Raises
    ------
    UsageError
        As `swap_combs`, and where an effector cannot follow its partner's harmonics.
    """
    exchanged = swap_combs(searched, pairs)
    check_feasible(exchanged, excitation, excited(excitation, effectors))
    return exchanged

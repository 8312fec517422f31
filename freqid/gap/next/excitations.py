"""Which excitations could be flown next, and how strong limits allow them to be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.results.design import MultisineDesign
from freqid.core.scenario import Reference, Scenario
from freqid.core.sections.excitation import Excitation
from freqid.core.vehicle import Vehicle
from freqid.design.multisine.orthogonal_set import design_multisines, excited
from freqid.gap.stack.block import Block

STRONGEST = 2.0
"""How much stronger than flown a signal may be: what was diagnosed says nothing of larger motion."""

_SHARE = 0.8  # of the abort limits
_ROOM = 0.9  # of an effector's travel and rate
_STARTS = 1  # of the search for phases
_GENTLE = 0.1  # of an amplitude, at which a design is always feasible; it is scaled afterwards
_STILL = 1e-6  # of an effector's travel: what moves less does not move
_OF_TRAVEL = 0.02  # of a tilt drive's travel, where nobody states an amplitude
_SAME_DENSITY = 0.03
_SLOWEST = 1.0  # m/s: below it flow angles are undefined, and what was seen in forward flight says nothing


@dataclass(frozen=True, eq=False)
class Plan:
    """One excitation at one condition.

    Attributes
    ----------
    at : str
        Reference condition; empty where it has none.
    effectors : str
        What is excited: ``all``, or a kind of effector.
    design : MultisineDesign
        At the amplitudes flown, or stated where nobody flew them.
    """

    at: str
    effectors: str
    design: MultisineDesign


def stated_excitation(blocks: Sequence[Block], scenario: Scenario | None) -> Excitation | None:
    """Return what can be flown: the scenario's excitation, else one like the flights at hand, else None.

    Amplitudes are those flown, where a signal was flown.

    Parameters
    ----------
    blocks : sequence of Block
        That were used.
    scenario : Scenario, optional

    Raises
    ------
    UsageError
        Where it excites what the vehicle does not have, or what has no amplitude.
    """
    flown = amplitudes_flown(blocks)
    stated = scenario.excitation if scenario else None
    if stated is None:
        if not flown:
            return None
        lines = next(b.lines for b in blocks if b.lines.driven.any())
        driven = lines.hz[lines.driven]
        half = 0.5 / lines.duration
        band = (max(float(driven[0]) - half, half), float(driven[-1]) + half)
        return Excitation(
            band_hz=band,
            period_s=lines.duration,
            periods=1,
            dt_s=min(0.02, 0.25 / band[1]),
            effectors=tuple(flown),
            amplitude=flown,
            starts=_STARTS,
        )
    names = tuple(e.name for e in excited(stated, blocks[0].trial.maneuver.vehicle.effectors))
    said = stated.amplitude
    amplitude = {n: flown.get(n, said[n] if isinstance(said, dict) else said) for n in names}
    starts = min(stated.starts, _STARTS)
    return msgspec.structs.replace(stated, effectors=names, amplitude=amplitude, spectrum=None, starts=starts)


def amplitudes_flown(blocks: Sequence[Block]) -> dict[str, float]:
    """Return the largest amplitude flown by effector: of the sine that has the signal's rms."""
    found: dict[str, float] = {}
    for block in blocks:
        record = block.maneuvers[0].record
        for name in record.group("excitation"):
            size = float(np.sqrt(2) * np.std(record[f"excitation/{name}"]))
            if size > 0:
                found[name] = max(size, found.get(name, 0.0))
    return found


def whole(stated: Excitation, vehicle: Vehicle) -> MultisineDesign:
    """Return a design of all effectors over the whole band.

    Raises
    ------
    UsageError
        Where there are fewer lines than effectors.
    """
    return _designed(stated, vehicle, stated.effectors or (), stated.band_hz)


def halves(stated: Excitation, vehicle: Vehicle) -> list[MultisineDesign]:
    """Return designs of all effectors over either half of the band, where it has enough lines.

    Each signal keeps its rms in fewer lines.
    """
    low, high = stated.band_hz
    middle = 0.5 * (low + high)
    found = []
    for band in ((low, middle), (middle, high)):
        try:
            found.append(_designed(stated, vehicle, stated.effectors or (), band))
        except UsageError:  # fewer lines than effectors
            continue
    return found


def tilting(stated: Excitation, vehicle: Vehicle) -> MultisineDesign | None:
    """Return multisines of the tilt drives alone, where there are any that the excitation leaves out."""
    tilts = [e for e in vehicle.effectors if e.kind == "tilt"]
    if not tilts or any(e.name in (stated.effectors or ()) for e in tilts):
        return None
    amplitude = {e.name: _OF_TRAVEL * (e.limits[1] - e.limits[0]) for e in tilts}
    asked = msgspec.structs.replace(stated, amplitude=amplitude)
    try:
        return _designed(asked, vehicle, tuple(amplitude), stated.band_hz)
    except UsageError:
        return None


def _designed(
    stated: Excitation, vehicle: Vehicle, names: tuple[str, ...], band_hz: tuple[float, float]
) -> MultisineDesign:
    said = stated.amplitude
    amplitude = said if isinstance(said, dict) else dict.fromkeys(names, said)
    mixed = names == stated.effectors and band_hz == stated.band_hz
    asked = msgspec.structs.replace(
        stated,
        band_hz=band_hz,
        effectors=names,
        amplitude={n: _GENTLE * amplitude[n] for n in names},
        allocation=stated.allocation if mixed else "interleaved",
    )
    return scaled_signals(design_multisines(asked, vehicle.effectors), 1 / _GENTLE)


def scaled_signals(design: MultisineDesign, factor: float) -> MultisineDesign:
    """Return a design with all amplitudes multiplied."""
    return replace(design, signals=tuple(replace(s, amplitude=factor * s.amplitude) for s in design.signals))


def largest_scale(record: FlightRecord, vehicle: Vehicle, abort: Mapping[str, float]) -> float:
    """Return by how much all signals of a flight may be scaled until a limit is reached.

    States may go to 80 % of their abort limits, effectors to 90 % of their travel and rate.

    Parameters
    ----------
    record : FlightRecord
        Simulated, without noise.
    vehicle : Vehicle
    abort : dict of float
        Largest deviation by state.
    """
    found = [np.inf]
    for name, limit in abort.items():
        if f"state/{name}" in record:
            values = record[f"state/{name}"]
            found.append(_SHARE * limit / _peak(values - values[0]))
    for name in record.group("effector"):
        if name not in vehicle.effector_kinds:
            continue
        effector, position = vehicle.effector(name), record[f"effector/{name}"]
        at = float(position[0])
        low, high = effector.limits
        for travel, moved in ((at - low, at - position.min()), (high - at, position.max() - at)):
            if moved > _STILL * (high - low):
                found.append(_ROOM * max(travel, 0.0) / moved)
        if effector.rate_limit:
            found.append(_ROOM * effector.rate_limit / _peak(np.gradient(position, record.dt)))
    return float(min(found))


def _peak(values: Array) -> float:
    return max(float(np.max(np.abs(values))), 1e-300)


def unflown(references: Sequence[Reference], flown: Sequence[Reference], most: int) -> list[Reference]:
    """Return conditions that nobody flew: the furthest in speed from those flown, at the same density.

    Parameters
    ----------
    references, flown : sequence of Reference
    most : int
    """
    if not flown:
        return []
    density, slowest = flown[0].rho, min(_SLOWEST, *(k.u for k in flown))
    near = _SAME_DENSITY * max(density, 1e-9)
    known = {k.id for k in flown}
    left = [r for r in references if r.id not in known and r.u >= slowest and abs(r.rho - density) <= near]
    found: list[Reference] = []
    while left and len(found) < most:
        far = max(left, key=lambda r: min(abs(r.u - k.u) for k in (*flown, *found)))
        found.append(far)
        left.remove(far)
    return found

"""A trial of the diagnosis: fly with an effect that only a sealed file names, diagnose, open the seal."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError
from freqid.core.record import write_record
from freqid.core.results.diagnosis import Which
from freqid.core.results.gap import FILE as GAP_FILE
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.sealed_trial import SEAL_FILE, OpenedAs, SealedEffect, TrialOutcome
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.simulate.effects import library, settings
from freqid.simulate.maneuver import with_effects
from freqid.simulate.motion import whole_vehicle
from freqid.workflows.fly import Design, simulate
from freqid.workflows.inputs import File, Tell, scenario_of, silent

SEAL = "seal.h5"
_SIZES = (2.0, 4.0)  # of what is expected of the effect before any data (its parameter's `scale`)
_TRIES = 100  # until the simulation can fly what is drawn
_DRAWN: dict[str, tuple[str, ...]] = {
    "surface_effectiveness": ("surface",),
    "weak_rotor": ("rotor",),
    "actuator_delay": ("=surface", "=rotor"),
    "actuator_lag": ("=extra",),
    "motor_lag": ("=extra",),
    "mass": ("=fraction",),
    "cg_offset": ("=x", "=z"),
    "inertia": ("=xx", "=yy"),
    "wing_wake": ("=strength",),
    "slipstream": ("=strength",),
    "rotor_inplane_force": ("=strength",),
    "extra_drag": ("=coefficient",),
}
"""Effects that are drawn from, and where they act: a kind of effector, one of which is drawn, or ``=`` and a
parameter. Faults of sensors are none: a simulation cannot lack them."""
_EITHER_SIGN = ("mass", "cg_offset", "inertia")


@dataclass(frozen=True)
class SealedFlights:
    """Flights with an effect that is not told.

    Attributes
    ----------
    records : tuple of Path
    seal : Path
        File that names the effect.
    checksum : str
        Of its contents; to be noted before the diagnosis.
    """

    records: tuple[Path, ...]
    seal: Path
    checksum: str


@on_one_thread
def fly_sealed(
    scenario: Scenario | File,
    folder: File,
    *,
    at: Sequence[str],
    design: Design | None = None,
    duration: float | None = None,
    sensors: str = "research",
    noise: float = 1.0,
    seed: int = 0,
    tell: Tell = silent,
) -> SealedFlights:
    """Fly manoeuvres of an aircraft with an effect that its scenario does not have, and seal which one.

    Parameters
    ----------
    scenario : Scenario, path or name
        The simulation, and apart from the effect the aircraft.
    folder : path
        Where the records, named after their conditions, and ``seal.h5`` go. No truth is written.
    at : sequence of str
        Reference conditions, one manoeuvre at each.
    design : DesignedInputs, MultisineDesign or path, optional
        Excitation; the scenario's where absent.
    duration : float, optional
        s of each manoeuvre; as long as the design where absent.
    sensors, noise
        As `simulate`.
    seed : int
        Draws the effect, its place and its size, and the errors of the sensors.
    tell : callable

    Returns
    -------
    SealedFlights

    Raises
    ------
    UsageError
        Where no condition is named, or the vehicle has nothing that an effect could act on.
    DataError
        Where a flight diverges.

    Examples
    --------
    >>> sealed = fly_sealed("la8", "sealed", at=("u30", "u45"), seed=1)  # doctest: +SKIP
    >>> gap = fq.diagnose_gap(None, sealed.records, scenario="la8")  # doctest: +SKIP
    """
    described = scenario_of(scenario)
    if not at:
        raise UsageError("no condition is named", remedy="name one or more, as u30,u45")
    for identifier in at:
        described.reference_of(identifier)
    effect, parameter, unit, before, after = draw_effect(described, seed)
    if design is None:
        from freqid.workflows.design import design_inputs

        tell("inputs")
        design = design_inputs(described)
    records = []
    for place, identifier in enumerate(at):
        tell(f"sealed flight at {identifier}")
        flown = simulate(
            described,
            design,
            at=identifier,
            duration=duration,
            sensors=sensors,
            noise=noise,
            seed=1000 * (seed + 1) + place,
            effects={effect: {parameter: after}},
        )
        if flown.divergence:  # its sentence could say why: by the effect
            raise DataError(
                f"the sealed flight at {identifier} diverges", remedy="draw another effect by another seed"
            )
        path = Path(folder) / f"{identifier}.h5"
        write_record(path, flown.record, described.sha256)
        records.append(path)
    tell("")
    sealed = SealedEffect(
        described.sha256,
        seed,
        effect,
        parameter,
        unit,
        before,
        after,
        {path.name: _sha256(path) for path in records},
    ).seal()
    SEAL_FILE.write(Path(folder) / SEAL, sealed, described.sha256)
    return SealedFlights(tuple(records), Path(folder) / SEAL, sealed.checksum)


def draw_effect(scenario: Scenario, seed: int) -> tuple[str, str, str, float, float]:
    """Return an effect drawn by a seed: id, parameter, unit, its value in the simulation and in the aircraft.

    Kind of effect first, then its place, then its size: `_SIZES` times what is expected of it. What the
    simulation cannot fly is drawn again.
    """
    vehicle = scenario.aircraft()
    rng = np.random.default_rng([seed, 27])
    own = settings(scenario.simulation.effects, vehicle)
    possible = {i: places for i in _DRAWN if (places := _places(i, vehicle))}
    if not possible:
        raise UsageError(
            f"'{vehicle.name}' has no surface, rotor or wing that an effect could act on",
            remedy="choose another scenario",
        )
    for _ in range(_TRIES):
        effect = str(rng.choice(sorted(possible)))
        parameter = str(rng.choice(possible[effect]))
        described = library()[effect].of(vehicle).parameters[parameter]
        size = float(rng.uniform(*_SIZES)) * described.scale
        before = own[effect][parameter]
        down = before > 0 or (effect in _EITHER_SIGN and bool(rng.integers(2)))
        after = min(max(before - size if down else before + size, described.low), described.high)
        with suppress(UsageError):  # no body has such moments of inertia, no command can be as late
            whole_vehicle.parameters(with_effects(scenario, {effect: {parameter: after}}))
            return effect, parameter, described.unit, float(before), float(after)
    raise UsageError(
        f"none of {_TRIES} effects that were drawn can be flown by '{vehicle.name}'",
        remedy="choose another scenario",
    )


def open_seal(seal: File, gap: GapResult | File) -> TrialOutcome:
    """Open a seal after the diagnosis, and say whether the diagnosis was right.

    Parameters
    ----------
    seal : path
    gap : GapResult or path
        Diagnosis of the flights that were sealed.

    Returns
    -------
    TrialOutcome

    Raises
    ------
    DataError
        Where the seal was edited, a flight is another than it was, or the diagnosis is of other flights.

    Examples
    --------
    >>> open_seal(sealed.seal, gap).answer  # doctest: +SKIP
    'right'
    """
    sealed = SEAL_FILE.read(Path(seal))
    found = GAP_FILE.read(Path(gap)) if isinstance(gap, str | Path) else gap
    _refuse_other_flights(Path(seal), sealed, found)
    which = found.which
    named = _named(which)
    answer, why = _judge(sealed, found, named)
    chance = which.probabilities.get(sealed.effect, 0.0)
    fitted = which.parameters.get(sealed.effect, {})
    size = fitted.get(sealed.parameter) or next(iter(fitted.values()), None)
    place = which.places.get(sealed.effect, "")
    change = sealed.after - sealed.before
    sentence = (
        f"The diagnosis is {answer}: {why}. Sealed was {sealed.effect}, {sealed.parameter} changed by "
        f"{change:.3g}{_unit(sealed.unit)}"
    )
    if size is not None and answer == "right":
        inside = "inside" if size.lo <= change <= size.hi else "outside"
        sentence += (
            f"; found {size.estimate:.3g}{_unit(sealed.unit)}, and the truth is {inside} the 90 % interval "
            f"({size.lo:.3g} to {size.hi:.3g})"
        )
    ends = (math.nan, math.nan, math.nan) if size is None else (size.estimate, size.lo, size.hi)
    return TrialOutcome(
        answer,
        f"{sentence}.",
        sealed.effect,
        sealed.parameter,
        sealed.unit,
        sealed.before,
        sealed.after,
        named,
        chance,
        place,
        *ends,
        found.verdict,
        sealed.checksum,
        sealed.seed,
    )


def _named(which: Which) -> tuple[str, ...]:
    """Return what is given as the answer; a name that was withdrawn is none."""
    return tuple(n for n in which.pair or which.named if n not in which.withdrawn)


def _judge(sealed: SealedEffect, found: GapResult, named: tuple[str, ...]) -> tuple[OpenedAs, str]:
    which, gap = found.which, found.gap
    if not gap.exists:
        least = gap.largest_undetected.get(sealed.effect, math.inf)
        if abs(sealed.after - sealed.before) > least:
            return "wrong", f"it sees no gap, though it would have seen this effect from {least:.2g} on"
        return "undecided", "it sees no gap, and says that an effect of this size could hide"
    if not named and which.withdrawn:
        name, reason = next(iter(which.withdrawn.items()))
        return "undecided", f"{name} fits best and is withdrawn, {reason}"
    if not named:
        chance = which.probabilities.get(sealed.effect, 0.0)
        return "undecided", f"it gives no single name; the probability of the effect is {chance:.2f}"
    said = " and ".join(named) if which.pair else " or ".join(named)
    if which.pair:
        return ("right" if set(named) == {sealed.effect} else "wrong"), f"it names {said} together"
    if sealed.effect in named:
        return "right", f"it names {said}"
    return "wrong", f"it names {said}"


def _refuse_other_flights(seal: Path, sealed: SealedEffect, found: GapResult) -> None:
    diagnosed = {Path(name).name for name in found.diagnosis.records}
    if diagnosed != set(sealed.records):
        raise DataError(
            f"is of the flights {', '.join(sorted(sealed.records))}, but the diagnosis is of "
            f"{', '.join(sorted(diagnosed))}",
            where=str(seal),
            remedy="diagnose the flights that were sealed",
        )
    for name, sha256 in sealed.records.items():
        path = seal.parent / name
        if path.is_file() and _sha256(path) != sha256:
            raise DataError(f"{name} is not the flight that was sealed", where=str(seal), remedy="fly again")


def _places(effect: str, vehicle: Vehicle) -> list[str]:
    """Return the parameters of an effect that may be drawn on a vehicle."""
    kinds = [e.kind for e in vehicle.effectors]
    if effect in ("wing_wake",) and len(vehicle.wings) < 2:
        return []
    if effect in ("slipstream", "rotor_inplane_force", "motor_lag") and "rotor" not in kinds:
        return []
    known = library()[effect].of(vehicle).parameters
    found = []
    for place in _DRAWN[effect]:
        if place.startswith("="):
            name = place[1:]
            if name in ("surface", "rotor") and name not in kinds:
                continue
            found.append(name)
        else:
            found += [e.name for e in vehicle.effectors if e.kind == place and e.name in known]
    return [name for name in found if name in known]


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()

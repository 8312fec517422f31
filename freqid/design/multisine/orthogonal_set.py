"""From a scenario's excitation to a set of orthogonal multisines that can be flown, and its samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError, nearest
from freqid.core.results.design import Multisine, MultisineDesign, SampledInputs
from freqid.core.sections.excitation import MOST_HARMONICS, Excitation
from freqid.core.vehicle import Effector
from freqid.design.forecast.closed_loop import STATES, PerturbedAircraft
from freqid.design.multisine.allocation import (
    check_sets,
    fractions,
    interleave,
    limits_from_db,
    lines_in_band,
    mirrored,
    search,
)
from freqid.design.multisine.merit import merit
from freqid.design.multisine.net_load import load_gains, lowest_nets, net_peaks
from freqid.design.multisine.phases import lowest_peaks
from freqid.design.multisine.signals import at_least, at_most

Progress = Callable[[int, int], None]

SMALLEST_AMPLITUDE = 1e-12  # rad or rad/s: no actuator follows it, and correlations of smaller ones underflow


def design_multisines(
    excitation: Excitation,
    effectors: Sequence[Effector],
    *,
    seed: int = 0,
    quick: bool = False,
    progress: Progress | None = None,
) -> MultisineDesign:
    """Design the multisines that a scenario asks for.

    Parameters
    ----------
    excitation : Excitation
    effectors : sequence of Effector
        Of the vehicle; tilts are left out unless they are named.
    seed : int
    quick : bool
        Search the allocation with less effort: for comparisons, not for flight.
    progress : callable, optional
        Called with how many signals are done and how many there are.

    Returns
    -------
    MultisineDesign

    Raises
    ------
    UsageError
        Where there are fewer harmonics than effectors, or a signal is beyond what its effector can do;
        with the key and the nearest feasible value.
    """
    chosen = excited(excitation, effectors)
    lines = _lines(excitation, excitation.period_s)
    limits = limits_from_db(excitation.power_db)
    sets = _allocate(excitation, chosen, lines, limits, seed, quick)
    powers = _reference_powers(excitation, sets)
    waves = lowest_peaks(sets, powers, limits=limits, starts=excitation.starts, seed=seed, progress=progress)
    signals = tuple(
        Multisine(e.name, e.unit, w.index, w.amplitude * amplitude_of(excitation, e) / np.sqrt(2), w.phase)
        for e, w in zip(chosen, waves, strict=True)
    )
    design = MultisineDesign(
        signals=signals,
        period_s=excitation.period_s,
        periods=excitation.periods,
        band_hz=excitation.band_hz,
        dt_s=excitation.dt_s,
        seed=seed,
    )
    check_feasible(design, excitation, chosen)
    return design


def excited(excitation: Excitation, effectors: Sequence[Effector]) -> list[Effector]:
    """Return the effectors that are excited, in the order of the scenario.

    Raises
    ------
    UsageError
        Where one is named that the vehicle does not have, or that has no amplitude.
    """
    by_name = {e.name: e for e in effectors}
    named = excitation.effectors
    if named is None and isinstance(excitation.amplitude, dict):
        named = tuple(excitation.amplitude)
    wanted = [e.name for e in effectors if e.kind != "tilt"] if named is None else list(named)
    for name in wanted:
        if name not in by_name:
            raise UsageError(
                f"[excitation] names effector '{name}', which is not described",
                remedy=nearest(name, by_name),
            )
        if isinstance(excitation.amplitude, dict) and name not in excitation.amplitude:
            raise UsageError(f"excitation.amplitude lacks '{name}'", remedy="give it an amplitude")
    if len(set(wanted)) < len(wanted):
        raise UsageError("excitation.effectors names an effector more than once", remedy="name each once")
    if not wanted:
        raise UsageError("[excitation] excites no effector", remedy="name some in excitation.effectors")
    return [e for e in effectors if e.name in wanted]


def amplitude_of(excitation: Excitation, effector: Effector) -> float:
    """Return the amplitude that is asked of an effector.

    Raises
    ------
    UsageError
        Where it is not positive, or too small for its square.
    """
    given = excitation.amplitude
    value = given[effector.name] if isinstance(given, dict) else given
    if not SMALLEST_AMPLITUDE <= value < np.inf:
        raise UsageError(
            f"excitation.amplitude of '{effector.name}' is {value:g} {effector.unit}, expected it positive, "
            f"{SMALLEST_AMPLITUDE:g} or more",
            remedy="leave the effector out where it shall rest",
        )
    return value


def _lines(excitation: Excitation, period_s: float) -> NDArray[np.int64]:
    """Return the harmonics of 1/T that may have power."""
    lines = lines_in_band(period_s, excitation.band_hz)
    free = ~np.isin(lines, excitation.empty)
    for low, high in excitation.forbidden_hz:
        free &= (lines / period_s < low) | (lines / period_s > high)
    return lines[free]


def _allocate(
    excitation: Excitation,
    chosen: Sequence[Effector],
    lines: NDArray[np.int64],
    limits: tuple[float, float] | None,
    seed: int,
    quick: bool = False,
) -> tuple[NDArray[np.int64], ...]:
    """Return the harmonics of each chosen effector."""
    if isinstance(excitation.allocation, dict):
        missing = [e.name for e in chosen if e.name not in excitation.allocation]
        if missing:
            raise UsageError(
                f"excitation.allocation lacks '{missing[0]}'", remedy="give every excited effector harmonics"
            )
        return check_sets({e.name: excitation.allocation[e.name] for e in chosen}, lines)
    if lines.size < len(chosen):
        low, high = excitation.band_hz
        # The band gains a harmonic where T times its end is a whole number.
        tops = range(math.ceil(high * excitation.period_s), MOST_HARMONICS)
        periods = (float(at_least(top / high)) for top in tops)
        enough = next((T for T in periods if _lines(excitation, T).size >= len(chosen)), None)
        longer = f"lengthen excitation.period_s to {enough:g} s, or " if enough else ""
        raise UsageError(
            f"harmonics of 1/{excitation.period_s:g} s between {low:g} and {high:g} Hz that may have power: "
            f"{lines.size}, too few for {len(chosen)} effectors",
            remedy=f"{longer}widen excitation.band_hz",
        )
    if excitation.allocation == "interleaved":
        loads = effectiveness(chosen) * [amplitude_of(excitation, e) for e in chosen]
        return mirrored(interleave(lines, len(chosen)), _importance(excitation)[:, None] * loads)
    ceiling = int(lines[round(excitation.propulsor_share * lines.size) - 1])
    low = [e.kind in ("rotor", "thrust", "throttle") for e in chosen]
    return search(lines, low, ceiling, limits=limits, seed=seed, quick=quick)


def _reference_powers(excitation: Excitation, sets: Sequence[NDArray[np.int64]]) -> list[Array] | None:
    """Return the power fractions of the wanted spectrum; None where it is flat."""
    if excitation.spectrum is None:
        return None
    frequency, density = zip(*excitation.spectrum, strict=True)
    return [fractions(index, excitation.period_s, frequency, density) for index in sets]


def check_feasible(
    design: MultisineDesign,
    excitation: Excitation,
    chosen: Sequence[Effector],
    trim: Mapping[str, float] | None = None,
) -> None:
    """Refuse signals that leave their effector's range or outrun its rate; the worst of each is named.

    The range is about the trim where that is given, by effector, else about its middle, which is the most.

    Raises
    ------
    UsageError
    """
    judged = merit(design)
    known = trim or {}
    middle = [known.get(e.name, sum(e.limits) / 2) for e in chosen]
    room = np.array([min(at - e.limits[0], e.limits[1] - at) for e, at in zip(chosen, middle, strict=True)])
    out = np.flatnonzero(room <= 0)
    if out.size:
        effector, at = chosen[out[0]], middle[out[0]]
        raise UsageError(
            f"'{effector.name}' is at {at:.4g} {effector.unit} there, where its limits "
            f"{list(effector.limits)} leave no room for an excitation",
            remedy="correct the reference or the limits, or leave it out of excitation.amplitude",
        )
    rate = np.array([np.inf if e.rate_limit is None else e.rate_limit for e in chosen])
    with np.errstate(over="ignore"):  # a range or a rate may be as small as a number can be
        peaks, slews = judged.peak / room, judged.slew / rate
    i = int(np.argmax(peaks))
    effector, asked, share = chosen[i], amplitude_of(excitation, chosen[i]), peaks[i]
    if share > 1:
        raise UsageError(
            f"excitation.amplitude of '{effector.name}', {asked:g} {effector.unit}, makes peaks of "
            f"{judged.peak[i]:.4g} {effector.unit} where the limits allow {room[i]:.4g} about "
            + (f"{middle[i]:.4g}, where it is" if effector.name in known else "the middle of their range"),
            remedy=f"at most {at_most(asked / share)} is feasible",
        )
    i = int(np.argmax(slews))
    effector, asked, share = chosen[i], amplitude_of(excitation, chosen[i]), slews[i]
    if share > 1:
        raise UsageError(
            f"excitation.amplitude of '{effector.name}', {asked:g} {effector.unit}, needs "
            f"{judged.slew[i]:.4g} {effector.unit}/s where its rate_limit is {rate[i]:g}",
            remedy=f"lower excitation.amplitude to {at_most(asked / share)}, or the band",
        )


def effectiveness(effectors: Sequence[Effector]) -> Array:
    """Return the loads of unit positions, shape (6, effector), X Y Z L M N by effector."""
    return np.array([[e.effectiveness.get(axis, 0.0) for e in effectors] for axis in WRENCH])


def _importance(excitation: Excitation) -> Array:
    """Return the weights of the axes' net loads, shape (6,)."""
    return np.array([excitation.net_load.get(axis, 0.0) for axis in WRENCH])


def with_low_net_loads(
    design: MultisineDesign,
    excitation: Excitation,
    effectors: Sequence[Effector],
    loop: PerturbedAircraft | None = None,
) -> MultisineDesign:
    """Play the signals of a design so that their sum loads and moves the aircraft little.

    Parameters
    ----------
    design : MultisineDesign
        As `design_multisines` gives it.
    excitation : Excitation
        Says which axes count, how far powers may move, and at which states a run is broken off.
    effectors : sequence of Effector
        Of the vehicle, with their effectiveness.
    loop : PerturbedAircraft, optional
        Predicts the motion; with it the states in ``excitation.abort`` count too.

    Raises
    ------
    UsageError
        Where axes count but no effector states its effectiveness, or a signal gets beyond what its effector
        can do.

    Notes
    -----
    Each axis is judged by its own peak. States are judged by the share of their abort limits that they
    use, and together weigh as much as one axis: the state that comes nearest to its limit matters, one
    that stays far from it does not.
    """
    chosen = excited(excitation, effectors)
    loads = effectiveness(chosen)
    if excitation.net_load and not loads.any():
        raise UsageError(
            "excitation.net_load is asked for, but no [[effector]] states its effectiveness",
            remedy="add effectiveness = { X = ..., N = ... } to the effectors, or drop net_load",
        )
    gains = load_gains(design.signals, loads).astype(complex)
    weights = _importance(excitation)
    allowed = {state: limit for state, limit in excitation.abort.items() if state in STATES}
    if loop is not None and allowed:
        moved = [
            loop.response(tuple(allowed), [s.name], s.index / design.period_s)[:, 0] for s in design.signals
        ]
        states = np.concatenate(moved, axis=1) / np.array([*allowed.values()])[:, None]
        share = net_peaks(design.signals, states)
        gains, weights = (
            np.concatenate([gains, states]),
            np.concatenate([weights, share / (share.max() or 1.0)]),
        )
    signals = lowest_nets(
        design.signals,
        gains,
        weights,
        powers=_reference_powers(excitation, [s.index for s in design.signals]),
        limits=limits_from_db(excitation.power_db),
        seed=design.seed,
    )
    quiet = replace(design, signals=tuple(signals))
    check_feasible(quiet, excitation, chosen)
    return quiet


def sampled(design: MultisineDesign) -> SampledInputs:
    """Sample a design from start to end, both included."""
    time = design.dt_s * np.arange(round(design.duration_s / design.dt_s) + 1, dtype=float)
    angle = 2 * np.pi * time / design.period_s
    rows = [s.amplitude @ np.sin(np.outer(s.index, angle) + s.phase[:, None]) for s in design.signals]
    return SampledInputs(design.names, tuple(s.unit for s in design.signals), time, np.array(rows))

"""From a scenario's excitation to a set of orthogonal multisines, its samples and its figures of merit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import WRENCH
from freqid.core.design import Multisine, MultisineDesign
from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Excitation
from freqid.core.vehicle import Effector
from freqid.design.allocation import check_sets, interleave, lines_in_band, search
from freqid.design.inputs import SampledInputs
from freqid.design.net_load import lowest_net_loads
from freqid.design.phases import lowest_peaks
from freqid.design.power import fractions, limits_from_db
from freqid.design.signals import PEAK_POINTS, relative_peak_factor, sample, samples_per_period

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]


def design_multisines(
    excitation: Excitation, effectors: Sequence[Effector], *, seed: int = 0, progress: Progress | None = None
) -> MultisineDesign:
    """Design the multisines that a scenario asks for.

    Parameters
    ----------
    excitation : Excitation
    effectors : sequence of Effector
        Of the vehicle; tilts are left out unless they are named.
    seed : int
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
    lines = lines_in_band(excitation.period_s, excitation.band_hz)
    lines = lines[[_allowed(int(k), excitation) for k in lines]]
    limits = limits_from_db(excitation.power_db)
    sets = _allocate(excitation, chosen, lines, limits, seed)
    powers = _reference_powers(excitation, sets)
    waves = lowest_peaks(sets, powers, limits=limits, starts=excitation.starts, seed=seed, progress=progress)
    signals = tuple(
        Multisine(e.name, e.unit, w.index, w.amplitude * _amplitude(excitation, e) / np.sqrt(2), w.phase)
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
    _check_feasible(design, excitation, chosen)
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


def _amplitude(excitation: Excitation, effector: Effector) -> float:
    given = excitation.amplitude
    value = given[effector.name] if isinstance(given, dict) else given
    if not 0 < value < np.inf:
        raise UsageError(
            f"excitation.amplitude of '{effector.name}' is {value:g} {effector.unit}, expected it positive",
            remedy="leave the effector out where it shall rest",
        )
    return value


def _allowed(k: int, excitation: Excitation) -> bool:
    frequency = k / excitation.period_s
    return k not in excitation.empty and not any(
        low <= frequency <= high for low, high in excitation.forbidden_hz
    )


def _allocate(
    excitation: Excitation,
    chosen: Sequence[Effector],
    lines: NDArray[np.int64],
    limits: tuple[float, float] | None,
    seed: int,
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
        enough = excitation.period_s * len(chosen) / max(lines.size, 1)
        raise UsageError(
            f"{lines.size} harmonics between {low:g} and {high:g} Hz are too few for {len(chosen)} effectors",
            remedy=f"lengthen excitation.period_s to {enough:.4g} s, or widen excitation.band_hz",
        )
    if excitation.allocation == "interleaved":
        return interleave(lines, len(chosen))
    ceiling = int(lines[round(excitation.propulsor_share * lines.size) - 1])
    low = [e.kind in ("rotor", "thrust", "throttle") for e in chosen]
    return search(lines, low, ceiling, limits=limits, seed=seed)


def _reference_powers(excitation: Excitation, sets: Sequence[NDArray[np.int64]]) -> list[Array] | None:
    """Return the power fractions of the wanted spectrum; None where it is flat."""
    if excitation.spectrum is None:
        return None
    frequency, density = zip(*excitation.spectrum, strict=True)
    return [fractions(index, excitation.period_s, frequency, density) for index in sets]


def _check_feasible(design: MultisineDesign, excitation: Excitation, chosen: Sequence[Effector]) -> None:
    """Refuse signals that leave their effector's range or outrun its rate."""
    judged = merit(design)
    for i, effector in enumerate(chosen):
        asked = _amplitude(excitation, effector)
        low, high = effector.limits
        share = 2 * judged.peak[i] / (high - low)
        if share > 1:
            raise UsageError(
                f"excitation.amplitude of '{effector.name}', {asked:g} {effector.unit}, makes peaks of "
                f"{judged.peak[i]:.4g} {effector.unit} where the limits allow {(high - low) / 2:.4g} about "
                "the middle of their range",
                remedy=f"at most {asked / share:.4g} is feasible",
            )
        if effector.rate_limit is not None and judged.slew[i] > effector.rate_limit:
            raise UsageError(
                f"'{effector.name}' would have to move at {judged.slew[i]:.4g} {effector.unit}/s, its "
                f"rate_limit is {effector.rate_limit:g}",
                remedy=f"lower excitation.amplitude to {asked * effector.rate_limit / judged.slew[i]:.4g}, "
                "or the band",
            )


def effectiveness(effectors: Sequence[Effector]) -> Array:
    """Return the loads of unit positions, shape (6, effector), X Y Z L M N by effector."""
    return np.array([[e.effectiveness.get(axis, 0.0) for e in effectors] for axis in WRENCH])  # type: ignore[call-overload]


def with_low_net_loads(
    design: MultisineDesign, excitation: Excitation, effectors: Sequence[Effector]
) -> MultisineDesign:
    """Play the signals of a design so that their sum loads the aircraft little on the axes that count.

    Parameters
    ----------
    design : MultisineDesign
        As `design_multisines` gives it.
    excitation : Excitation
        Says which axes count, and how far powers may move.
    effectors : sequence of Effector
        Of the vehicle, with their effectiveness.

    Raises
    ------
    UsageError
        Where no effector states its effectiveness.
    """
    loads = effectiveness(excited(excitation, effectors))
    if not loads.any():
        raise UsageError(
            "excitation.net_load is asked for, but no [[effector]] states its effectiveness",
            remedy="add effectiveness = { X = ..., N = ... } to the effectors, or drop net_load",
        )
    weights = np.array([excitation.net_load.get(axis, 0.0) for axis in WRENCH])  # type: ignore[call-overload]
    signals = lowest_net_loads(
        design.signals,
        loads,
        weights,
        powers=_reference_powers(excitation, [s.index for s in design.signals]),
        limits=limits_from_db(excitation.power_db),
        seed=design.seed,
    )
    return replace(design, signals=tuple(signals))


def sampled(design: MultisineDesign) -> SampledInputs:
    """Sample a design from start to end, both included."""
    time = design.dt_s * np.arange(round(design.duration_s / design.dt_s) + 1, dtype=float)
    angle = 2 * np.pi * time / design.period_s
    rows = [s.amplitude @ np.sin(np.outer(s.index, angle) + s.phase[:, None]) for s in design.signals]
    return SampledInputs(design.names, tuple(s.unit for s in design.signals), time, np.array(rows))


@dataclass(frozen=True)
class Merit:
    """How good a design is, signal by signal and as a set.

    Attributes
    ----------
    names : tuple of str
    rpf, rms, peak, slew : ndarray, shape (effector,)
        Relative peak factor; the others in effector units, slew per second, largest magnitudes.
    correlation : ndarray, shape (effector, effector)
        Over one period.
    max_correlation : float
        Largest magnitude between two signals over one period.
    condition_number : float
        Of the matrix of normalised signals over one period, ``U^T U``.
    """

    names: tuple[str, ...]
    rpf: Array
    rms: Array
    peak: Array
    slew: Array
    correlation: Array
    max_correlation: float
    condition_number: float


def merit(design: MultisineDesign) -> Merit:
    """Judge a design on at least 64 points per shortest period."""
    rows = [(s.index, s.amplitude, s.phase) for s in design.signals]
    samples = samples_per_period(np.concatenate([s.index for s in design.signals]), PEAK_POINTS)
    signals = np.array([sample(*row, samples) for row in rows])
    speed = 2 * np.pi / design.period_s
    slew = [np.abs(sample(k, a * k * speed, p + np.pi / 2, samples)).max() for k, a, p in rows]
    correlation = _correlation(signals)
    return Merit(
        names=design.names,
        rpf=np.array([float(relative_peak_factor(*row)) for row in rows]),
        rms=np.sqrt([0.5 * np.sum(a**2) for _, a, _ in rows]),
        peak=np.abs(signals).max(axis=1),
        slew=np.array(slew),
        correlation=correlation,
        max_correlation=_largest_pair(correlation),
        condition_number=float(np.linalg.cond(correlation)),
    )


@dataclass(frozen=True)
class Truncation:
    """What is left of orthogonality while a manoeuvre is not finished.

    Attributes
    ----------
    time : ndarray, shape (time,)
        Length flown, s.
    max_correlation, condition_number : ndarray, shape (time,)
        As in `Merit`, over that length.
    """

    time: Array
    max_correlation: Array
    condition_number: Array


def truncated(design: MultisineDesign, steps: int = 40) -> Truncation:
    """Judge correlation and condition over growing parts of the first period.

    Parameters
    ----------
    design : MultisineDesign
    steps : int
        Lengths judged, evenly from T / `steps` to T.
    """
    samples = samples_per_period(np.concatenate([s.index for s in design.signals]), 16)
    signals = np.array([sample(s.index, s.amplitude, s.phase, samples) for s in design.signals])
    ends = np.linspace(samples / steps, samples, steps).round().astype(int)
    parts = [_correlation(signals[:, :end]) for end in ends]
    return Truncation(
        time=design.period_s * ends / samples,
        max_correlation=np.array([_largest_pair(c) for c in parts]),
        condition_number=np.array([np.linalg.cond(c) for c in parts]),
    )


def _correlation(signals: Array) -> Array:
    norm = np.linalg.norm(signals, axis=1)
    return signals @ signals.T / np.outer(norm, norm)


def _largest_pair(correlation: Array) -> float:
    return float(np.abs(correlation - np.eye(len(correlation))).max()) if len(correlation) > 1 else 0.0

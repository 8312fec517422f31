"""Classic inputs: doublets, multisteps and sweeps, and the sequence that plays them one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.design import ClassicDesign, SampledInputs
from freqid.core.sections.excitation import MOST_SAMPLES, Excitation
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.limits import effector_travel
from freqid.design.multisine.orthogonal_set import amplitude_of, excited
from freqid.design.multisine.signals import at_least, at_most


def multistep(widths_s: Sequence[float], dt_s: float, *, rise_s: float = 0.0) -> Array:
    """Return steps of alternating sign and amplitude one, from zero to zero.

    Parameters
    ----------
    widths_s : sequence of float
        Duration of each step, s, rounded to whole samples.
    dt_s : float
        Sampling interval, s.
    rise_s : float
        Time of the ramp from zero to full deflection, s; steps are ramps where an actuator cannot jump.

    Returns
    -------
    ndarray, shape (sample,)
        The first sample is zero where the rise takes time, the last one always.

    Raises
    ------
    UsageError
        Where a step is shorter than one sample or than its ramps.

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2nd ed., ch. 9 (doublet, 2-1-1, 3-2-1-1).
    """
    edges = np.concatenate([[0], np.cumsum([round(width / dt_s) for width in widths_s])])
    shortest = dt_s * min(np.diff(edges).tolist(), default=0)
    least = max(dt_s, 2 * rise_s)
    if shortest < least * (1 - 1e-9):
        raise UsageError(
            f"the shortest step lasts {shortest:g} s, expected at least a sample, {dt_s:g} s, and twice the "
            f"rise of {rise_s:g} s",
            remedy=f"take a step_s of at least {at_least(least)} s, or shorten rise_s or dt_s",
        )
    levels = (-1.0) ** np.arange(len(widths_s))
    if rise_s == 0.0:
        return np.append(np.repeat(levels, np.diff(edges)), 0.0)
    # Every step is a trapezoid between its edges, so that those of a doublet still cancel.
    edges = edges * dt_s
    corners = np.column_stack([edges[:-1], edges[:-1] + rise_s, edges[1:] - rise_s, edges[1:]])
    heights = levels[:, None] * [0.0, 1.0, 1.0, 0.0]
    return np.interp(dt_s * np.arange(round(edges[-1] / dt_s) + 1), corners.ravel(), heights.ravel())


def doublet(width_s: float, dt_s: float, *, rise_s: float = 0.0) -> Array:
    """Return a doublet, one step up and one down of `width_s` each; see `multistep`."""
    return multistep((width_s, width_s), dt_s, rise_s=rise_s)


def three_two_one_one(unit_s: float, dt_s: float, *, rise_s: float = 0.0) -> Array:
    """Return steps of 3, 2, 1 and 1 times `unit_s`; see `multistep`."""
    return multistep((3 * unit_s, 2 * unit_s, unit_s, unit_s), dt_s, rise_s=rise_s)


def frequency_sweep(
    band_hz: tuple[float, float],
    duration_s: float,
    dt_s: float,
    *,
    fade_s: float,
    spacing: Literal["logarithmic", "linear"] = "logarithmic",
) -> Array:
    """Return a sine of amplitude one whose frequency rises through a band, from zero to zero.

    Parameters
    ----------
    band_hz : tuple of 2 floats
        First and last frequency, Hz.
    duration_s, dt_s : float
        s.
    fade_s : float
        Time over which the amplitude grows at the start and dies at the end, as half a raised cosine, s.
    spacing : {"logarithmic", "linear"}
        Equal time per octave, or per hertz.

    Returns
    -------
    ndarray, shape (sample,)

    Raises
    ------
    UsageError
        For a band that is not rising or above Nyquist, a record shorter than a period of the lowest
        frequency, or fades that do not fit.

    References
    ----------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., ch. 5 (automated sweeps).
    """
    low, high = band_hz
    if not 0 < low < high <= 0.5 / dt_s:
        raise UsageError(
            f"a sweep from {low:g} to {high:g} Hz is asked for, expected rising positive frequencies up to "
            f"Nyquist, {0.5 / dt_s:g} Hz",
            remedy="correct the band or sample faster",
        )
    if not (duration_s * low >= 1 and 0 < fade_s <= duration_s / 2):
        raise UsageError(
            f"a sweep of {duration_s:g} s with fades of {fade_s:g} s is asked for, expected a period of the "
            f"lowest frequency, {1 / low:g} s, or more, and fades of up to half the sweep",
            remedy="lengthen the sweep or correct fade_s",
        )
    time = dt_s * np.arange(round(duration_s / dt_s) + 1)
    if spacing == "linear":
        cycles = low * time + (high - low) * time**2 / (2 * duration_s)
    else:
        growth = np.log(high / low) / duration_s
        cycles = low * np.expm1(growth * time) / growth
    inside = np.clip(np.minimum(time, time[-1] - time) / fade_s, 0.0, 1.0)
    return np.sin(2 * np.pi * cycles) * np.sin(0.5 * np.pi * inside) ** 2


ClassicWaveform = Literal["doublet", "3-2-1-1", "sweep"]

ROUNDING = 1e-9


def design_classic(
    waveform: ClassicWaveform, excitation: Excitation, vehicle: Vehicle, trim: Mapping[str, float]
) -> ClassicDesign:
    """Design the classic inputs that a scenario asks for.

    Parameters
    ----------
    waveform : {"doublet", "3-2-1-1", "sweep"}
    excitation : Excitation
    vehicle : Vehicle
    trim : mapping of str to float
        Position of every excited effector that the signals are added to, SI.

    Returns
    -------
    ClassicDesign

    Raises
    ------
    UsageError
        Where a waveform does not fit its times, or an effector cannot follow; with the key and the
        nearest feasible value.

    Notes
    -----
    A doublet of steps s has most of its power about 0.37 / s; its default steps are half a period of the
    middle of the band each. The 2 of a 3-2-1-1 is made as long, so that its 3 and its 1 lie on both sides.
    """
    asked, dt = excitation.classic, excitation.dt_s
    amplitude = {e.name: amplitude_of(excitation, e) for e in excited(excitation, vehicle.effectors)}
    if waveform == "sweep":
        duration = excitation.period_s if asked.sweep_s is None else asked.sweep_s
        shape = frequency_sweep(excitation.band_hz, duration, dt, fade_s=asked.fade_s, spacing=asked.spacing)
    else:
        half = 0.5 / np.sqrt(np.prod(excitation.band_hz))
        rise = _slowest_rise(amplitude, vehicle) if asked.rise_s is None else asked.rise_s
        if waveform == "doublet":
            shape = doublet(half if asked.step_s is None else asked.step_s, dt, rise_s=rise)
        else:
            shape = three_two_one_one(half / 2 if asked.step_s is None else asked.step_s, dt, rise_s=rise)
    inputs = in_turn(
        shape, amplitude, vehicle, dt, rest_s=asked.rest_s, repeats=excitation.periods, trim=trim
    )
    return ClassicDesign(
        waveform=waveform,
        inputs=inputs,
        amplitude=amplitude,
        periods=excitation.periods,
        band_hz=excitation.band_hz,
        dt_s=dt,
    )


def _worst(
    amplitude: Mapping[str, float], units: tuple[str, ...], used: Array
) -> tuple[str, float, str, float]:
    """Return the effector that uses most of a limit: name, amplitude, unit and share."""
    i = int(np.argmax(used))
    name = tuple(amplitude)[i]
    return name, amplitude[name], units[i], float(used[i])


@dataclass(frozen=True, eq=False)
class Extent:
    """How far and how fast classic inputs move each effector.

    Attributes
    ----------
    names : tuple of str
    rms, peak, slew : ndarray, shape (effector,)
        Effector units, slew per second, largest magnitudes; the rms while the effector is moved.
    """

    names: tuple[str, ...]
    rms: Array
    peak: Array
    slew: Array


def extent(design: ClassicDesign) -> Extent:
    """Judge classic inputs by their samples."""
    values = design.inputs.values
    moved = values != 0.0
    return Extent(
        names=design.inputs.names,
        rms=np.sqrt(np.sum(values**2, axis=1) / moved.sum(axis=1)),
        peak=np.abs(values).max(axis=1),
        slew=np.abs(np.diff(values, axis=1, prepend=0.0)).max(axis=1) / design.dt_s,
    )


def _slowest_rise(amplitude: Mapping[str, float], vehicle: Vehicle) -> float:
    """Return how long the slowest effector takes to its amplitude, s; zero where none has a rate limit."""
    limits = {name: vehicle.effector(name).rate_limit for name in amplitude}
    return max((amplitude[name] / rate for name, rate in limits.items() if rate is not None), default=0.0)


def in_turn(
    waveform: Array,
    amplitude: Mapping[str, float],
    vehicle: Vehicle,
    dt_s: float,
    *,
    rest_s: float,
    repeats: int = 1,
    trim: Mapping[str, float] | None = None,
) -> SampledInputs:
    """Give one waveform to one effector after the other, with a rest before each and at the end.

    Parameters
    ----------
    waveform : ndarray, shape (sample,)
        Of amplitude one, as the functions above return it.
    amplitude : mapping of str to float
        By effector, in its unit; their order is flown.
    vehicle : Vehicle
        Units and limits of the effectors.
    dt_s : float
        Sampling interval, s.
    rest_s : float
        Time at the trim, s.
    repeats : int
        How often the whole sequence is flown.
    trim : mapping of str to float, optional
        Positions that the signals are added to; zero where absent.

    Returns
    -------
    SampledInputs

    Raises
    ------
    UsageError
        Where an effector would exceed a limit or a rate that it cannot follow, with the nearest feasible
        value; or where a name is unknown.
    """
    if repeats < 1 or not rest_s >= 0:
        raise UsageError(
            f"{repeats} repeats with rests of {rest_s:g} s are asked for, expected 1 or more and 0 s or more"
        )
    units = tuple(vehicle.effector(name).unit for name in amplitude)
    distance, rate = effector_travel(vehicle, tuple(amplitude), trim or {})
    peak = float(np.abs(waveform).max())
    steepest = float(np.abs(np.diff(waveform, prepend=0.0)).max()) / dt_s
    sizes = np.abs(list(amplitude.values()))
    room_used = peak * sizes / [distance[name] for name in amplitude]
    rate_used = steepest * sizes / [rate.get(name, np.inf) for name in amplitude]
    name, size, unit, used = _worst(amplitude, units, room_used)
    if used > 1 + ROUNDING:
        raise UsageError(
            f"excitation.amplitude of '{name}' is {size:g} {unit} where its limits leave "
            f"{distance[name]:.4g} {unit} about the trim",
            remedy=f"at most {at_most(abs(size) / used)} is feasible",
        )
    name, size, unit, used = _worst(amplitude, units, rate_used)
    if used > 1 + ROUNDING:
        rise = at_least(peak * abs(size) / rate[name])
        raise UsageError(
            f"excitation.amplitude of '{name}', {size:g} {unit}, needs {steepest * abs(size):.4g} {unit}/s "
            f"where its rate_limit is {rate[name]:g}",
            remedy=f"at most {at_most(abs(size) / used)} is feasible, or take lower frequencies, or for "
            f"steps a rise_s of {rise} s",
        )
    rest = round(rest_s / dt_s)
    turn = rest + len(waveform)
    if repeats * len(amplitude) * turn > MOST_SAMPLES:
        raise UsageError(
            f"{repeats} times {len(amplitude)} effectors make {repeats * len(amplitude) * turn} samples, "
            f"expected at most {MOST_SAMPLES}",
            remedy="lower excitation.periods, the times of excitation.classic or the effectors",
        )
    once = np.zeros((len(amplitude), len(amplitude) * turn))
    for i, size in enumerate(amplitude.values()):
        once[i, i * turn + rest : (i + 1) * turn] = size * waveform
    values = np.pad(np.tile(once, repeats), ((0, 0), (0, rest)))
    return SampledInputs(
        names=tuple(amplitude),
        units=units,
        time=dt_s * np.arange(values.shape[1]),
        values=values,
    )

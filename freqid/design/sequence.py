"""From a scenario's excitation to classic inputs: one waveform for one effector after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.excitation import MOST_SAMPLES, Excitation
from freqid.core.results.design import ClassicDesign, SampledInputs
from freqid.core.vehicle import Vehicle
from freqid.design.classic import doublet, frequency_sweep, three_two_one_one
from freqid.design.forecast.limits import room
from freqid.design.multisine.bounds import at_least, at_most
from freqid.design.multisine.orthogonal_set import amplitude_of, excited

Waveform = Literal["doublet", "3-2-1-1", "sweep"]

ROUNDING = 1e-9


def design_classic(
    waveform: Waveform, excitation: Excitation, vehicle: Vehicle, trim: Mapping[str, float]
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
    distance, rate = room(vehicle, tuple(amplitude), trim or {})
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

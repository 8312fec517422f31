"""Which excitations could be flown next: parts of a rehearsed one, as strong as limits allow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core.design import Multisine, MultisineDesign
from freqid.core.errors import UsageError
from freqid.core.excitation import Excitation
from freqid.core.record import FlightRecord
from freqid.core.vehicle import Vehicle
from freqid.design.multisine import design_multisines
from freqid.gap.rehearsal import Rehearsal

Array = NDArray[np.float64]

STRONGEST = 2.0
"""How much larger than flown any state or signal is proposed to be: beyond that nothing linear is known."""

_SHARE = 0.8  # of the abort limits
_ROOM = 0.9  # of an effector's travel and rate
_WEAKEST = 0.2  # of what was flown: less is no experiment
_MOTION = ("u", "v", "w", "p", "q", "r", "phi", "theta")
_STARTS = 2  # of the search for phases
_GENTLE = 0.1  # of it, at which a design is always feasible
_OF_TRAVEL = 0.02  # of a tilt drive's travel, where nobody states an amplitude


@dataclass(frozen=True, eq=False)
class Option:
    """A part of a rehearsed flight's excitation.

    Attributes
    ----------
    rehearsal : Rehearsal
    kinds : str
        Effectors that are excited: a kind, or ``all``.
    names : tuple of str
    band_hz : tuple of 2 floats
    power : ndarray, shape (line,)
        Of each line over the rehearsed one.
    gain : dict of float
        Of each signal's rms over the rehearsed one.
    """

    rehearsal: Rehearsal
    kinds: str
    names: tuple[str, ...]
    band_hz: tuple[float, float]
    power: Array
    gain: dict[str, float]


def options(rehearsal: Rehearsal, abort: Mapping[str, float]) -> list[Option]:
    """Return parts of a flight's excitation: kinds of effectors, and halves of the band.

    Each signal keeps its power when it is put into fewer lines; then all are scaled together until a state
    is at its limit, an effector at its travel or rate, or anything at `STRONGEST` times what was rehearsed.

    Parameters
    ----------
    rehearsal : Rehearsal
    abort : dict of float
        Largest deviation by state.
    """
    lines, record = rehearsal.lines, rehearsal.trial.maneuver.record
    driven = np.flatnonzero(lines.owner >= 0)
    if not driven.size:
        return []
    kind_of = rehearsal.trial.maneuver.vehicle.effector_kinds
    kinds = [kind_of.get(n, "") for n in lines.inputs]
    groups = {"all": set(range(len(kinds)))}
    for kind in dict.fromkeys(kinds):
        if kinds.count(kind) < len(kinds):
            groups[kind or "other"] = {i for i, k in enumerate(kinds) if k == kind}
    low, mid, high = lines.hz[driven[0]], lines.hz[driven[driven.size // 2]], lines.hz[driven[-1]]
    found = []
    for label, group in groups.items():
        for band in ((low, high), (low, mid), (mid, high)):
            option = _part(rehearsal, label, group, (float(band[0]), float(band[1])))
            if option is None:
                continue
            scale = _reach(option, record, abort)
            if scale > _WEAKEST:
                gain = {n: g * scale for n, g in option.gain.items()}
                found.append(replace(option, power=option.power * scale**2, gain=gain))
    return found


def _part(rehearsal: Rehearsal, label: str, group: set[int], band: tuple[float, float]) -> Option | None:
    lines = rehearsal.lines
    inside = (lines.hz >= band[0] - 1e-9) & (lines.hz <= band[1] + 1e-9)
    power, gain = np.zeros(lines.hz.size), {}
    for i in sorted(group):
        mine = lines.owner == i
        kept = mine & inside
        if kept.any():
            power[kept] = mine.sum() / kept.sum()
            gain[lines.inputs[i]] = 1.0
    return Option(rehearsal, label, tuple(gain), band, power, gain) if gain else None


def _reach(option: Option, record: FlightRecord, abort: Mapping[str, float]) -> float:
    """Return by how much an option's signals may be scaled."""
    rehearsal = option.rehearsal
    lines, vehicle = rehearsal.lines, rehearsal.trial.maneuver.vehicle
    driven = lines.owner >= 0
    scale = STRONGEST

    def moved(name: str, values: Array) -> float:
        """Return the rms of a channel over the rehearsed one, from its lines."""
        z = np.abs(lines.spectrum(values[None])[0]) ** 2
        return float(np.sqrt((z * option.power)[driven].sum() / max(z[driven].sum(), 1e-300)))

    for name in record.group("state"):
        values = record[f"state/{name}"]
        peak = float(np.max(np.abs(values - values.mean())))
        share = moved(name, values)
        if name in abort and share * peak > 0:
            scale = min(scale, _SHARE * abort[name] / (share * peak))
        elif name in _MOTION and share > 0:
            scale = min(scale, STRONGEST / share)
    for name in option.names:
        injected = record[f"excitation/{name}"]
        scale = min(scale, STRONGEST / max(moved(name, injected), 0.5))
        if name not in vehicle.effector_kinds:
            continue
        effector = vehicle.effector(name)
        at = record[f"effector/{name}" if f"effector/{name}" in record else f"excitation/{name}"]
        room = min(at.mean() - effector.limits[0], effector.limits[1] - at.mean())
        peak = float(np.max(np.abs(at - at.mean()))) * moved(name, at)
        scale = min(scale, _ROOM * max(room, 0.0) / max(peak, 1e-300))
        if effector.rate_limit:
            fastest = float(np.max(np.abs(np.gradient(injected, record.dt)))) * moved(name, injected)
            scale = min(scale, _ROOM * effector.rate_limit / max(fastest, 1e-300))
    return scale


def design(option: Option, stated: Excitation | None, vehicle: Vehicle, seed: int = 0) -> MultisineDesign:
    """Return the multisines of an option.

    Parameters
    ----------
    option : Option
    stated : Excitation, optional
        Of the scenario: period, periods, forbidden bands and the like; without it those of the rehearsal.
    vehicle : Vehicle
    seed : int

    Raises
    ------
    UsageError
        Where there are fewer lines than effectors or a signal is beyond what its effector can do.
    """
    record = option.rehearsal.trial.maneuver.record
    amplitude = {
        n: float(np.sqrt(2) * np.std(record[f"excitation/{n}"]) * option.gain[n]) for n in option.names
    }
    low, high = option.band_hz
    base = stated or Excitation(band_hz=(low, high), period_s=record.duration, periods=1, dt_s=0.02)
    mixed = option.kinds == "all" and option.band_hz[1] >= 0.99 * base.band_hz[1]
    half = 0.5 / base.period_s
    asked = msgspec.structs.replace(
        base,
        band_hz=(max(low - half, 1 / base.period_s), high + half),
        effectors=option.names,
        amplitude=amplitude,
        allocation=base.allocation if mixed and isinstance(base.allocation, str) else "interleaved",
        starts=min(base.starts, _STARTS),
        spectrum=None,
    )
    return design_multisines(asked, vehicle.effectors, seed=seed)


def scaled(design: MultisineDesign, factor: float) -> MultisineDesign:
    """Return a design with all amplitudes multiplied."""
    signals = tuple(replace(s, amplitude=factor * s.amplitude) for s in design.signals)
    return replace(design, signals=signals)


def tilting(vehicle: Vehicle, stated: Excitation, period_s: float) -> MultisineDesign | None:
    """Return multisines of the tilt drives alone, as strong as their rates allow; None without any.

    Parameters
    ----------
    vehicle : Vehicle
    stated : Excitation
    period_s : float
    """
    tilts = [e for e in vehicle.effectors if e.kind == "tilt"]
    if not tilts:
        return None
    asked = msgspec.structs.replace(
        stated,
        period_s=period_s,
        periods=1,
        effectors=tuple(e.name for e in tilts),
        amplitude={e.name: _GENTLE * _OF_TRAVEL * (e.limits[1] - e.limits[0]) for e in tilts},
        allocation="interleaved",
        starts=1,
        spectrum=None,
    )
    try:
        made = design_multisines(asked, tilts)
    except UsageError:
        return None
    pairs = zip(tilts, made.signals, strict=True)
    slack = [_ROOM * e.rate_limit / _fastest(s, period_s) for e, s in pairs if e.rate_limit]
    return scaled(made, min([1 / _GENTLE, *slack]))


def _fastest(signal: Multisine, period_s: float) -> float:
    """Return the largest rate of a multisine, unit per s."""
    time = np.linspace(0, period_s, 40 * int(signal.index.max()), endpoint=False)
    angle = 2 * np.pi * np.outer(signal.index, time) / period_s + signal.phase[:, None]
    rate = (signal.amplitude * signal.index * 2 * np.pi / period_s) @ np.cos(angle)
    return float(np.max(np.abs(rate)))

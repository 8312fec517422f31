"""A manoeuvre with the delays of its sensors taken out, and u v w from velocity over the ground."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.core.frames import level_from_body
from freqid.core.record import Channel, Maneuver

VELOCITY = ("state/u", "state/v", "state/w")
GROUND = ("state/vn", "state/ve", "state/vd")
ATTITUDE = ("state/phi", "state/theta", "state/psi")
WINDS = ("wind north", "wind east")
BIASES = ("phi bias", "theta bias", "psi bias")
RATES = ("state/p", "state/q", "state/r")
SCALES = ("p scale", "q scale", "r scale")
_SOURCE = "velocity over the ground less the fitted wind"


@dataclass(frozen=True, eq=False)
class Misaligned:
    """A manoeuvre as it was logged, ready to be brought into line as often as a fit asks for it.

    Attributes
    ----------
    maneuver : Maneuver
    effectors : mapping of str to tuple of str
        Effectors that share a clock, by kind.
    """

    maneuver: Maneuver
    effectors: Mapping[str, tuple[str, ...]]

    @property
    def over_ground(self) -> bool:
        """Tell whether u v w have to be made from velocity over the ground and attitude."""
        record = self.maneuver.record
        known = any(n in record for n in (*VELOCITY, "air/alpha", "air/beta"))
        return not known and all(n in record for n in (*GROUND, *ATTITUDE))

    def clocks(self) -> dict[str, tuple[str, ...]]:
        """Return the channels that come late together, by the name of their delay."""
        record = self.maneuver.record
        velocity = GROUND if self.over_ground else VELOCITY
        groups = {"velocity delay": velocity, "attitude delay": ATTITUDE}
        groups |= {f"{k} delay": tuple(f"effector/{n}" for n in of) for k, of in self.effectors.items()}
        return {name: group for name, group in groups.items() if all(n in record for n in group)}

    def at(self, errors: Mapping[str, float]) -> Maneuver:
        """Return the manoeuvre without errors of these sizes.

        Parameters
        ----------
        errors : mapping of str to float
            Delays of `clocks`, s, biases of the attitude, rad, scale errors of the rates, and wind, m/s;
            zero where absent.

        Returns
        -------
        Maneuver
            On the same samples: a channel brought forward is held over the last stretch.
        """
        record = self.maneuver.record
        changed = {}
        for delay, group in self.clocks().items():
            values = self._late(delay, errors.get(delay, 0.0))
            changed |= {n: replace(record.channel(n), values=v) for n, v in zip(group, values, strict=True)}
        for name, bias in zip(ATTITUDE, BIASES, strict=True):
            if name in changed:
                changed[name] = replace(changed[name], values=changed[name].values - errors.get(bias, 0.0))
        for name, scale in zip(RATES, SCALES, strict=True):
            if errors.get(scale):
                channel = record.channel(name)
                changed[name] = replace(channel, values=channel.values / (1 + errors[scale]))
        if self.over_ground:
            turn = level_from_body(np.array([changed[n].values for n in ATTITUDE]))
            wind = [errors.get(n, 0.0) for n in WINDS]
            through = np.array([changed[n].values for n in GROUND]) - np.array([*wind, 0.0])[:, None]
            for name, values in zip(VELOCITY, np.einsum("jin,jn->in", turn, through), strict=True):
                seen = record.channel(GROUND[0])
                changed[name] = Channel(name, "m/s", values, seen.native_rate_hz, _SOURCE, seen.position_m)
        return Maneuver(record.with_channels(*changed.values()), self.maneuver.vehicle)

    @cached_property
    def _late(self) -> Callable[[str, float], tuple[Array, ...]]:
        """Return the channels of a clock, brought forward; the last few are kept."""
        record, clocks = self.maneuver.record, self.clocks()
        splines = {
            name: [_spline(record.time, record.channel(n), n in ATTITUDE) for n in group]
            for name, group in clocks.items()
        }

        def late(delay: str, by: float) -> tuple[Array, ...]:
            at = np.clip(record.time + by, record.time[0], record.time[-1])
            return tuple(spline(at) for spline in splines[delay])

        return lru_cache(maxsize=2 * len(clocks))(late)


def kind_of(unknown: str) -> str:
    """Return ``"delay"``, ``"bias"``, ``"scale"`` or ``"wind"``."""
    first, _, last = unknown.partition(" ")
    return first if first == "wind" else last


def _spline(time: Array, channel: Channel, turns: bool) -> CubicSpline:
    """Return a channel as a cubic spline through its own samples.

    Where a log is faster than a sensor and draws straight lines between its samples, these take
    ``(pi f / rate)^2 / 3`` off a wave's amplitude, 1 % at 1.2 Hz of 20 Hz; a spline through the corners
    does not.
    """
    values = np.unwrap(channel.values) if turns else channel.values
    rate = (time.size - 1) / (time[-1] - time[0])
    every = round(rate / channel.native_rate_hz)
    if every > 1 and abs(rate / channel.native_rate_hz - every) < 1e-6:
        for first in range(every):
            own = slice(first, None, every)
            drawn = np.interp(time, time[own], values[own])
            inside = slice(first, time.size - (time.size - 1 - first) % every)
            if np.allclose(drawn[inside], values[inside], rtol=0, atol=1e-9 * np.ptp(values) + 1e-15):
                at = np.unique(np.concatenate(([0], np.arange(time.size)[own], [time.size - 1])))
                return CubicSpline(time[at], values[at])
    return CubicSpline(time, values)

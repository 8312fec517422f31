"""Errors of sensors: how a channel reads, what the errors are called, and estimates of them.

A channel reads ``(1 + scale) true(t - delay) + bias``; the inertial sensors' clock is the one that delays are
against. Errors are found in two ways, by integrating the motion in time (`kinematics`) and on the lines of an
excitation (`alignment`), and are named, taken out and reported alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.arrays import Array
from freqid.core.channels import AIR, ANGLES, ATTITUDE, GROUND, STATE
from freqid.core.errors import UsageError, nearest
from freqid.core.record import Channel
from freqid.core.viewable import Viewable

_UNITS = {"delay": "s", "scale": "1"}
_CLEAR = 3.0  # standard errors from which an error is in the short text


def error_name(channel: str, kind: str) -> str:
    """Return the name of a channel's scale, bias or delay; attitudes share a clock, ground velocities too."""
    if kind == "delay":
        for group, name in ((ATTITUDE, "attitude"), (GROUND, "ground")):
            if channel in group:
                return f"{name} delay"
    return f"{channel.partition('/')[2]} {kind}"


def error_kind(name: str) -> str:
    """Return ``"delay"``, ``"bias"``, ``"scale"`` or, of ``"wind north"``, ``"wind"``."""
    first, _, last = name.partition(" ")
    return first if first == "wind" else last


def error_unit(name: str) -> str:
    """Return the SI unit of an error."""
    kind = error_kind(name)
    if kind == "wind":
        return "m/s"
    return _UNITS.get(kind) or (STATE | AIR)[name.partition(" ")[0]][0]


@dataclass(frozen=True)
class Reading:
    """How one channel reads: ``(1 + scale) true(t - delay) + bias``.

    Attributes
    ----------
    scale : float
    bias : float
        In the channel's unit.
    delay : float
        s; positive for a channel later than the inertial sensors.
    """

    scale: float = 0.0
    bias: float = 0.0
    delay: float = 0.0

    @classmethod
    def of(cls, channel: str, errors: Mapping[str, float], clock: str | None = None) -> Reading:
        """Return the reading of a channel under errors by name; zero where absent.

        Parameters
        ----------
        channel : str
        errors : mapping of str to float
            SI units.
        clock : str, optional
            Name of the channel's delay, where it shares a clock with others.
        """
        delay = clock or error_name(channel, "delay")
        names = (error_name(channel, "scale"), error_name(channel, "bias"), delay)
        return cls(*(errors.get(name, 0.0) for name in names))

    def __bool__(self) -> bool:
        return bool(self.scale or self.bias or self.delay)

    def undone(self, later: Array) -> Array:
        """Return true values from those that were read `delay` later."""
        return (later - self.bias) / (1 + self.scale)


def spline_of(time: Array, channel: Channel) -> CubicSpline:
    """Return a channel as a cubic spline through its own samples; angles without jumps.

    Where a log is faster than a sensor and draws straight lines between its samples, these take
    ``(pi f / rate)^2 / 3`` off a wave's amplitude, 1 % at 1.2 Hz of 20 Hz; a spline through the corners
    does not.
    """
    values = np.unwrap(channel.values) if channel.name in ANGLES else channel.values
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


@dataclass(frozen=True, eq=False)
class SensorErrors(Viewable):
    """Estimated errors of a record's sensors, and of the wind that velocity is seen through.

    Attributes
    ----------
    names : tuple of str, length p
        ``"ax bias"``, ``"alpha scale"``, ``"attitude delay"``, ``"wind east"`` ...
    estimate : ndarray, shape (p,)
        SI units.
    covariance : ndarray, shape (p, p)
    """

    names: tuple[str, ...]
    estimate: Array
    covariance: Array

    def __repr__(self) -> str:
        rows = zip(self.names, self.estimate, self.std_error, self.units, strict=True)
        beyond = [f"{n} {e:.3g} +- {s:.2g} {u}" for n, e, s, u in rows if abs(e) > _CLEAR * s]
        return (
            f"<{type(self).__name__}: {len(self.names)} sensor errors, beyond {_CLEAR:g} standard errors: "
            f"{', '.join(beyond) or 'none'}>"
        )

    @property
    def units(self) -> tuple[str, ...]:
        """SI, length p."""
        return tuple(map(error_unit, self.names))

    @property
    def std_error(self) -> Array:
        """Standard errors, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def errors(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.names, self.estimate.tolist(), strict=True))

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Return estimate and standard error of one error."""
        if name not in self.names:
            raise UsageError(f"the check did not estimate '{name}'", remedy=nearest(name, self.names))
        i = self.names.index(name)
        return float(self.estimate[i]), float(self.std_error[i])

    def account(self) -> dict[str, Any]:
        """Return estimates with their standard errors and units by name, JSON-compatible."""
        rows = zip(self.names, self.estimate, self.std_error, self.units, strict=True)
        return {n: {"estimate": float(e), "std_error": float(s), "units": u} for n, e, s, u in rows}

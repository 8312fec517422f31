"""What is flown to excite the aircraft: section ``[excitation]`` of a scenario."""

from __future__ import annotations

from math import inf
from typing import Any, Literal

import msgspec

from freqid.core.channels import AIR, RESPONSE, STATE
from freqid.core.errors import nearest
from freqid.core.vehicle import Strict

MOST_HARMONICS = 10_000  # in the band; more is a slip in a unit, and fills the memory
MOST_STARTS = 1000
LONGEST_S = 3600.0  # of one step or sweep
MOST_SAMPLES = 10_000_000  # of one signal; likewise


class Classic(Strict, frozen=True):
    """Table ``[excitation.classic]``: doublets, 3-2-1-1 and sweeps, flown by one effector after the other.

    Attributes
    ----------
    step_s : float, optional
        Duration of a doublet's two steps, or of the short steps of a 3-2-1-1. Where absent, a doublet is
        one period, and the 2 of a 3-2-1-1 half a period, of the middle of `band_hz` on a logarithmic scale.
    rise_s : float, optional
        Time from zero to full deflection, s; where absent, what the slowest effector needs.
    rest_s : float
        Time at the trim before each effector and at the end, s.
    sweep_s : float, optional
        Duration of one sweep; `period_s` where absent.
    fade_s : float
        Time over which the amplitude of a sweep grows and dies, s.
    spacing : {"logarithmic", "linear"}
        Of a sweep's frequencies: equal time per octave, or per hertz.
    """

    step_s: float | None = None
    rise_s: float | None = None
    rest_s: float = 5.0
    sweep_s: float | None = None
    fade_s: float = 3.0
    spacing: Literal["logarithmic", "linear"] = "logarithmic"

    def __post_init__(self) -> None:
        for name in ("step_s", "sweep_s", "fade_s"):
            value = getattr(self, name)
            if value is not None and not 0 < value < LONGEST_S:
                raise ValueError(
                    f"{name} is {value:g}, expected a positive time of less than {LONGEST_S:g} s"
                )
        for name in ("rise_s", "rest_s"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < inf:
                raise ValueError(f"{name} is {value:g}, expected zero or a positive time")


class Excitation(Strict, frozen=True):
    """Section ``[excitation]``: the multisines, or classic inputs, that are flown.

    Attributes
    ----------
    band_hz : tuple of 2 floats
    period_s : float
        Fundamental period T; the harmonics are multiples of 1/T.
    periods : int
        How many are flown; two or more leave lines that measure noise. Of classic inputs, how often the
        sequence of all effectors is flown.
    amplitude : float or dict
        In effector units, for all or by effector: of the single sine that has a multisine's rms, or of
        the steps or sweep.
    effectors : tuple of str, optional
        Those that are excited; where absent, those that `amplitude` names, or all but tilts.
    allocation : {"interleaved", "propulsors-low"} or dict
        Who gets which harmonic: dealt out in turn; the same with rotors confined to the lower part of
        the band; or lists of harmonic numbers by effector.
    propulsor_share : float
        Part of the band's harmonics, from its low end, that rotors are confined to.
    empty : tuple of int
        Harmonic numbers left without power, which then show nonlinearity and noise.
    forbidden_hz : tuple of (low, high)
        Bands kept clear, for example of structural modes.
    power_db : float
        Power of each harmonic may differ from `spectrum` by so much, to lower the peaks.
    spectrum : tuple of (Hz, power), optional
        Relative power, linear between the points; flat where absent.
    dt_s : float
        Interval at which the signals are sampled.
    starts : int
        Random starts of the search for phases, by effector.
    net_load : dict
        Importance of the net peak of each axis, X to N; axes that are not named do not count.
    fade_s : tuple of 2 floats, optional
        Times in which the flight software fades the signals in and out, for the test card.
    abort : dict
        Largest deviation from the trim by state, SI, at which a run is broken off, for the test card.
    excursions : dict
        Largest deviation from the trim by state or axis, X to N, SI, that optimal amplitudes may lead to;
        for states that are not named, half of `abort`.
    classic : Classic
    at : dict of str to dict
        What is different at a reference condition, by its id; keys as here, tables are merged.
    """

    band_hz: tuple[float, float]
    period_s: float
    periods: int = 2
    amplitude: float | dict[str, float] = 1.0
    effectors: tuple[str, ...] | None = None
    allocation: Literal["interleaved", "propulsors-low"] | dict[str, tuple[int, ...]] = "interleaved"
    propulsor_share: float = 0.7
    empty: tuple[int, ...] = ()
    forbidden_hz: tuple[tuple[float, float], ...] = ()
    power_db: float = 0.0
    spectrum: tuple[tuple[float, float], ...] | None = None
    dt_s: float = 0.02
    starts: int = 20
    net_load: dict[Literal["X", "Y", "Z", "L", "M", "N"], float] = msgspec.field(default_factory=dict)
    fade_s: tuple[float, float] | None = None
    abort: dict[str, float] = msgspec.field(default_factory=dict)
    excursions: dict[str, float] = msgspec.field(default_factory=dict)
    classic: Classic = Classic()
    at: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)

    def at_reference(self, identifier: str) -> Excitation:
        """Return what is flown at a reference condition: this, with what `at` says for it.

        Raises
        ------
        ValueError
            Where a key is unknown or the values do not fit together.
        """
        table = msgspec.to_builtins(self) | {"at": {}}
        for key, value in self.at.get(identifier, {}).items():
            if key not in table or key == "at":
                raise ValueError(f"key '{key}' is unknown; {nearest(key, set(table) - {'at'})}")
            both = isinstance(value, dict) and isinstance(table.get(key), dict)
            table[key] = table[key] | value if both else value
        return msgspec.convert(table, Excitation)

    def __post_init__(self) -> None:
        low, high = self.band_hz
        if not 0 < low < high < inf:
            raise ValueError(f"band_hz is {list(self.band_hz)}, expected 0 < low < high")
        for name in ("period_s", "dt_s"):
            if not 0 < getattr(self, name) < inf:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected a positive time")
        if high > 0.5 / self.dt_s:
            raise ValueError(
                f"band_hz reaches {high:g} Hz, above the Nyquist frequency of dt_s = {self.dt_s:g} s; "
                f"expected at most {0.5 / self.dt_s:g} Hz, or a dt_s of at most {0.5 / high:.4g} s"
            )
        if self.periods < 1 or self.starts < 1:
            raise ValueError("periods and starts are counts, expected at least 1")
        if self.starts > MOST_STARTS:
            raise ValueError(
                f"starts is {self.starts}, expected at most {MOST_STARTS}: peaks gain nothing more"
            )
        harmonics = (high - low) * self.period_s
        if harmonics > MOST_HARMONICS:
            raise ValueError(
                f"period_s is {self.period_s:g}, which gives the band {harmonics:.3g} harmonics, expected at "
                f"most {MOST_HARMONICS}, or a period_s of {MOST_HARMONICS / (high - low):.3g}"
            )
        if self.period_s * self.periods / self.dt_s > MOST_SAMPLES:
            raise ValueError(
                f"{self.periods} periods of {self.period_s:g} s at a dt_s of {self.dt_s:g} s are more than "
                f"{MOST_SAMPLES} samples, expected fewer periods or a larger dt_s"
            )
        if self.spectrum is not None and not self.spectrum:
            raise ValueError("spectrum is empty, expected points [Hz, power] or no spectrum")
        if not 0 <= self.power_db <= 20:
            raise ValueError(f"power_db is {self.power_db:g}, expected 0 to 20")
        if not 0 < self.propulsor_share <= 1:
            raise ValueError(f"propulsor_share is {self.propulsor_share:g}, expected above 0 and at most 1")
        channels = {**STATE, **AIR, **RESPONSE}
        for table in ("abort", "excursions"):
            for name, limit in getattr(self, table).items():
                if name not in channels:
                    raise ValueError(f"{table} names '{name}'; {nearest(name, channels)}")
                if not limit > 0:
                    raise ValueError(f"{table} of '{name}' is {limit:g}, expected it positive")

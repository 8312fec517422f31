"""How a design is to be flown: where, between which limits, and what the aircraft is expected to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.vehicle import Vehicle
from freqid.design.forecast.excursions import Excursions
from freqid.report.kit.effectors import reach

EMPTY = 1e-3  # share of a classic input's power below which a band counts as empty


@dataclass(frozen=True, eq=False)
class FlightPlan:
    """What the design itself does not say.

    Attributes
    ----------
    vehicle : Vehicle
    condition : str
        Where it is flown, in words or a reference id.
    trim : mapping of str to float
        Effector positions there, SI.
    source, sha256 : str
        The design's file and its checksum.
    forbidden_hz : tuple of (low, high)
        Bands that must have no power, for example of structural modes.
    fade_s : tuple of 2 floats, optional
        Times in which the signals are faded in and out, s.
    abort : mapping of str to float
        Largest deviation from the trim by state at which the run is broken off, SI.
    control : str
        The control law that is engaged.
    motion : Excursions, optional
        Expected at full size, effectors with their feedback included.
    varied : sequence of Excursions
        The same channels from models as far off as they may be: their scatter is the spread.
    """

    vehicle: Vehicle
    condition: str = ""
    trim: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    sha256: str = ""
    forbidden_hz: Sequence[tuple[float, float]] = ()
    fade_s: tuple[float, float] | None = None
    abort: Mapping[str, float] = field(default_factory=dict)
    control: str = ""
    motion: Excursions | None = None
    varied: Sequence[Excursions] = ()

    @property
    def states(self) -> tuple[str, ...]:
        """Channels with an expectation or an abort limit that are no effectors, in order."""
        effectors = {effector.name for effector in self.vehicle.effectors}
        expected = self.motion.names if self.motion else ()
        return tuple(dict.fromkeys(n for n in (*expected, *self.abort) if n not in effectors))

    def expected(self, channel: str) -> tuple[float, float, float] | None:
        """Return rms, peak, and the standard deviation of the peak, SI; None where nothing is predicted.

        The last is nan where fewer than two varied models have the channel.
        """
        if self.motion is None or channel not in self.motion.names:
            return None
        i = self.motion.names.index(channel)
        peaks = [v.peak[v.names.index(channel)] for v in self.varied if channel in v.names]
        spread = float(np.std(peaks, ddof=1)) if len(peaks) > 1 else float("nan")
        return float(self.motion.rms[i]), float(self.motion.peak[i]), spread

    def saturated(self, level: float) -> dict[str, float]:
        """Return the share of time that effectors spend beyond their position or rate limit.

        Parameters
        ----------
        level : float
            Size of the excitation, 1 for all of it.

        Returns
        -------
        dict of str to float
            By effector whose motion is predicted and whose trim is known; feedback included.
        """
        if self.motion is None:
            return {}
        known = {e.name: e for e in self.vehicle.effectors}
        # The motion is periodic, so its rate is exact from its transform.
        line = np.fft.rfftfreq(self.motion.time.size, self.motion.time[1] - self.motion.time[0])
        shares = {}
        for name, row in zip(self.motion.names, self.motion.values, strict=True):
            room = reach(self.vehicle, name, self.trim) if name in known else None
            if room is None:
                continue
            beyond = (level * row < room[0]) | (level * row > room[1])
            rate_limit = known[name].rate_limit
            if rate_limit is not None:
                rate = np.fft.irfft(2j * np.pi * line * np.fft.rfft(row), row.size)
                beyond |= np.abs(level * rate) > rate_limit
            shares[name] = float(np.mean(beyond))
        return shares


def intrusions(design: MultisineDesign, band: tuple[float, float]) -> list[tuple[str, float]]:
    """Return which signals have power in a band, ends included: effector and frequency in Hz."""
    low, high = band
    margin = 1e-9 / design.period_s
    found = []
    for signal in design.signals:
        f = signal.index[signal.amplitude != 0] / design.period_s
        found += [(signal.name, float(x)) for x in f[(f >= low - margin) & (f <= high + margin)]]
    return sorted(found, key=lambda pair: pair[1])


def power_in_band(design: ClassicDesign, band: tuple[float, float]) -> tuple[float, str]:
    """Return the largest share of an effector's power that lies in a band, and whose it is."""
    power = np.abs(np.fft.rfft(design.inputs.values)) ** 2
    f = np.fft.rfftfreq(design.inputs.time.size, design.dt_s)
    share = power[:, (f >= band[0]) & (f <= band[1])].sum(axis=1) / power.sum(axis=1)
    worst = int(share.argmax())
    return float(share[worst]), design.names[worst]

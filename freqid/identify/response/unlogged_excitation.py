"""When a designed excitation was flown that the log does not have: its start and the drift of the two clocks.

The log holds the excitation inside commands, or effectors, together with what feedback and the pilot added.
The design is fitted to these at a start and a rate of its clock that are searched for. A free gain for each
effector, the aircraft's logged motion (feedback), a constant and a trend are fitted with it and taken out
(variable projection). What is left is taken as autoregressive noise and whitened, so that lines count by what
noise leaves of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_toeplitz
from scipy.optimize import least_squares
from scipy.signal import correlate, lfilter

from freqid.core.channels import ATTITUDE, RATES, VELOCITY
from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord
from freqid.core.results.design import SampledInputs
from freqid.identify.response.injection import correlations, source_of

GROUPS = ("command", "effector")  # where the excitation is looked for, in this order
_FEEDBACK = (*RATES, *ATTITUDE, *VELOCITY)
_FOUND = 6.0  # standard errors of the largest gain: chance gives it at none of 1e6 starts
_ORDER = 40  # of the autoregressive noise
_ENDS_S = 0.1  # s, by which the first guess of the start may be off
_WHITENED = 2  # times that the noise is estimated anew and the fit repeated
_STEP_S, _STEP_DRIFT = 1e-3, 1e-6  # s and 1: sizes on which start and drift are searched


@dataclass(frozen=True)
class ExcitationTiming:
    """Where an excitation stands on a record's clock: the design's time is ``(t - start) (1 + drift)``.

    Attributes
    ----------
    start_s, start_std_s : float
        On the record's clock, and its standard error.
    drift, drift_std : float
        By how much the design's clock runs faster, and its standard error.
    channels : dict of str to str
        The channel that it was found in, by effector.
    gains : dict of str to float
        Size in that channel by size in the design.
    """

    start_s: float
    start_std_s: float
    drift: float
    drift_std: float
    channels: dict[str, str]
    gains: dict[str, float]


def align_excitation(record: FlightRecord, inputs: SampledInputs) -> tuple[FlightRecord, ExcitationTiming]:
    """Find a design in a record's commands or effectors, and add its signals as excitations.

    Parameters
    ----------
    record : FlightRecord
        With ``command/<name>`` or ``effector/<name>`` for at least one effector of the design; the
        excitation lies inside it.
    inputs : SampledInputs
        The design.

    Returns
    -------
    record : FlightRecord
        With ``excitation/<name>`` for all effectors of the design; the timing is in its provenance.
    timing : ExcitationTiming

    Raises
    ------
    DataError
        Where the record has none of the effectors, has an excitation already, is shorter than the design,
        or the design is not found.

    Notes
    -----
    In a command the start is that of the injection. In an effector it is that of the motion, an actuator's
    lag included. Standard errors allow for coloured residuals (Newey & West, Econometrica 55, 1987).
    """
    channels = {name: source for name in inputs.names if (source := source_of(record, name, GROUPS))}
    if not channels:
        raise DataError(
            f"has none of the design's effectors {', '.join(inputs.names)}, as command or effector",
            remedy="name its channels as the design does",
        )
    logged = [name for name in inputs.names if f"excitation/{name}" in record]
    if logged:
        raise DataError(f"already holds the excitation of {', '.join(logged)}", remedy="leave --align out")
    if record.duration < 0.9 * float(inputs.time[-1]):
        raise DataError(
            f"lasts {record.duration:.6g} s, expected at least the {inputs.time[-1]:.6g} s of the design"
        )
    fit = _Fit(record, inputs, channels)
    unknowns = np.array([fit.coarse(), 0.0])
    fit.leave_out_ends(unknowns[0])
    for _ in range(_WHITENED + 1):
        solution = least_squares(
            fit.residual,
            unknowns,
            jac=lambda at: fit.slopes(*at).T,
            x_scale=[_STEP_S, _STEP_DRIFT],
            xtol=1e-12,
            ftol=1e-12,
        )
        unknowns = solution.x
        fit.whiten(fit.unfiltered_residual(*unknowns))
    start, drift = (float(x) for x in unknowns)
    gains, errors = fit.gains(start, drift)
    if max(abs(gains[name]) / errors[name] for name in gains) < _FOUND:
        raise DataError(
            "the design's excitation is not found in "
            + ", ".join(channels.values())
            + f": its largest gain is {max(abs(gains[n]) / errors[n] for n in gains):.2g} standard errors",
            remedy="check the design and the names of effectors",
        )
    spread = _covariance(fit.slopes(start, drift), fit.residual(unknowns), len(channels), fit.memory)
    timing = ExcitationTiming(
        start_s=start + float(record.time[0]),
        start_std_s=float(np.sqrt(spread[0, 0])),
        drift=drift,
        drift_std=float(np.sqrt(spread[1, 1])),
        channels=channels,
        gains=gains,
    )
    return _with_excitation(record, inputs, fit, start, drift, timing), timing


class _Fit:
    """The design against the channels, as a function of start and drift."""

    def __init__(self, record: FlightRecord, inputs: SampledInputs, channels: dict[str, str]) -> None:
        self.time = record.time - record.time[0]
        self.inputs = inputs
        self.names = list(channels)
        self._splines = [CubicSpline(inputs.time, x) for x in inputs.values]
        motion = [record[name] for name in _FEEDBACK if name in record]
        nuisance = np.array([np.ones(self.time.size), self.time, *motion])
        size = np.linalg.norm(nuisance, axis=1, keepdims=True)
        self._nuisance = nuisance / np.where(size > 0, size, 1)
        raw = record.matrix(channels.values())
        self._size = raw.std(axis=1)
        still = [c for c, s in zip(channels.values(), self._size, strict=True) if s == 0]
        if still:
            raise DataError(f"channel '{still[0]}' does not move", remedy="leave it out of the map")
        self._raw = raw / self._size[:, None]
        self._used = np.ones(self.time.size)
        self._set_filters([np.ones(1)] * len(raw))
        # Residuals are taken to be related over the longest period of the excitation at most.
        spectrum = np.abs(np.fft.rfft(inputs.values - inputs.values.mean(axis=1, keepdims=True), axis=1)).sum(
            0
        )
        strong = np.flatnonzero(spectrum > 0.1 * spectrum.max())
        slowest = max(1, int(strong[0])) / float(inputs.time[-1])
        self.memory = max(1, round(1 / slowest / record.dt))

    def _set_filters(self, filters: list[NDArray[np.float64]]) -> None:
        """Filter all channels so that their noise becomes white; where filters start, samples are zero."""
        self._filters = filters
        self._motion = [np.linalg.qr(self._filtered(self._nuisance, f).T)[0] for f in filters]
        self.measured = self._without_motion(self._raw)

    def whiten(self, residual: NDArray[np.float64]) -> None:
        """Take the noise of each channel as autoregressive, as its residual, shape (effector, sample), is."""
        filters = []
        for row in residual:
            every = correlate(row, row, mode="full", method="fft")[row.size - 1 :][: _ORDER + 1] / row.size
            every[0] *= 1 + 1e-9  # what rounding leaves of a noise that has no power at some frequency
            filters.append(np.concatenate([[1.0], -solve_toeplitz(every[:-1], every[1:])]))
        self._set_filters(filters)

    def leave_out_ends(self, start: float) -> None:
        """Leave out the samples around the design's ends: it may jump there, and a jump has no slope."""
        step = float(self.time[-1]) / (self.time.size - 1)
        for end in (start, start + float(self.inputs.time[-1])):
            self._used[(self.time > end - _ENDS_S) & (self.time < end + _ENDS_S + _ORDER * step)] = 0.0
        self._set_filters(self._filters)

    def _filtered(self, rows: NDArray[np.float64], taps: NDArray[np.float64]) -> NDArray[np.float64]:
        found = lfilter(taps, np.ones(1), rows, axis=-1)
        found[..., : taps.size - 1] = 0.0
        return found * self._used

    def _without_motion(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        filtered = [self._filtered(row, taps) for row, taps in zip(rows, self._filters, strict=True)]
        return np.array([x - basis @ (x @ basis) for x, basis in zip(filtered, self._motion, strict=True)])

    def unfiltered_residual(self, start: float, drift: float) -> NDArray[np.float64]:
        """Return what the fit leaves of the channels as they were logged, shape (effector, sample)."""
        filtered = self._raw - self._gain(start, drift)[:, None] * self._own_rows(start, drift)
        left = []
        for row, taps in zip(filtered, self._filters, strict=True):
            motion, *_ = np.linalg.lstsq(
                self._filtered(self._nuisance, taps).T, self._filtered(row, taps), rcond=None
            )
            left.append(row - motion @ self._nuisance)
        return np.array(left)

    def _own_rows(self, start: float, drift: float) -> NDArray[np.float64]:
        every = self.excitation(start, drift)
        return every[[self.inputs.names.index(name) for name in self.names]]

    def _gain(self, start: float, drift: float) -> NDArray[np.float64]:
        x = self._projected(start, drift)
        power = (x**2).sum(axis=1)
        return (x * self.measured).sum(axis=1) / np.where(power > 0, power, 1)

    def excitation(self, start: float, drift: float) -> NDArray[np.float64]:
        """Return the design on the record's clock, shape (effector, sample); zero outside of it."""
        own = (self.time - start) * (1 + drift)
        inside = (own >= 0) & (own <= self.inputs.time[-1])
        return np.array([np.where(inside, spline(own), 0.0) for spline in self._splines])

    def coarse(self) -> float:
        """Return the start at which the correlations of all channels together are largest, s, to a sample."""
        step = float(self.time[-1]) / (self.time.size - 1)
        own = np.arange(0, float(self.inputs.time[-1]), step)
        flown = np.array([self._splines[self.inputs.names.index(name)](own) for name in self.names])
        each = correlations(self.measured, flown) * np.linalg.norm(self.measured, axis=1, keepdims=True)
        shift = int(np.argmax((each**2).sum(axis=0)))
        return (shift if shift < self.time.size else shift - each.shape[1]) * step

    def _projected(self, start: float, drift: float) -> NDArray[np.float64]:
        return self._without_motion(self._own_rows(start, drift))

    def residual(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the fit leaves of the filtered channels, shape (effector * sample,)."""
        x = self._projected(*unknowns)
        return (self.measured - self._gain(*unknowns)[:, None] * x).ravel()

    def slopes(self, start: float, drift: float) -> NDArray[np.float64]:
        """Return the derivatives of the residual by start and drift, shape (2, effector * sample)."""
        at = np.array([start, drift])
        steps = np.diag([0.1 * _STEP_S, 10 * _STEP_DRIFT])
        return np.array([(self.residual(at + h) - self.residual(at - h)) / (2 * h.sum()) for h in steps])

    def gains(self, start: float, drift: float) -> tuple[dict[str, float], dict[str, float]]:
        """Return the gain of each effector, SI, and its standard error."""
        x = self._projected(start, drift)
        left = self.residual(np.array([start, drift])).reshape(x.shape)
        gains, errors = {}, {}
        for name, row, rest, measured, size in zip(
            self.names, x, left, self.measured, self._size, strict=True
        ):
            power = float(row @ row)
            gains[name] = size * float(row @ measured) / power
            errors[name] = size * float(np.sqrt(_covariance(row[None], rest, 1, self.memory)[0, 0]))
        return gains, errors


def _covariance(
    slopes: NDArray[np.float64], residual: NDArray[np.float64], blocks: int, memory: int
) -> NDArray[np.float64]:
    """Return the covariance of least-squares unknowns whose residuals are coloured.

    Parameters
    ----------
    slopes : ndarray, shape (k, block * sample)
    residual : ndarray, shape (block * sample,)
    blocks : int
        Channels, each with its own noise.
    memory : int
        Samples over which residuals are related.
    """
    scores = (slopes * residual).reshape(len(slopes), blocks, -1)
    middle = np.einsum("ibt,jbt->ij", scores, scores)
    for lag in range(1, min(memory, scores.shape[2] - 1) + 1):
        weight = 1 - lag / (memory + 1)
        cross = np.einsum("ibt,jbt->ij", scores[:, :, lag:], scores[:, :, :-lag])
        middle += weight * (cross + cross.T)
    normal = np.linalg.inv(slopes @ slopes.T)
    spread = normal @ middle @ normal
    return np.maximum(spread, 0.0) if len(slopes) == 1 else spread


def _with_excitation(
    record: FlightRecord,
    inputs: SampledInputs,
    fit: _Fit,
    start: float,
    drift: float,
    timing: ExcitationTiming,
) -> FlightRecord:
    """Return the record with the excitations in place and the timing in its provenance."""
    added = [
        Channel(
            name=f"excitation/{name}",
            unit=unit,
            values=values,
            native_rate_hz=1 / record.dt,
            source=f"design, from {timing.start_s:.6g} s, clock {1e6 * drift:+.3g} ppm, not logged",
        )
        for name, unit, values in zip(inputs.names, inputs.units, fit.excitation(start, drift), strict=True)
    ]
    found = record.with_channels(*added)
    about = {
        "start_s": timing.start_s,
        "start_std_s": timing.start_std_s,
        "drift_ppm": 1e6 * drift,
        "drift_std_ppm": 1e6 * timing.drift_std,
        "found_in": timing.channels,
        "gains": timing.gains,
    }
    return FlightRecord(
        time=found.time,
        channels=found.channels,
        vehicle=found.vehicle,
        mass_properties=found.mass_properties,
        reference=found.reference,
        configuration=found.configuration,
        provenance={**found.provenance, "excitation_aligned": about},
    )

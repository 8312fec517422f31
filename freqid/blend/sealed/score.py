"""A flight held against a sealed prediction: what stayed in the bands, and which assumption failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import detrend
from scipy.stats import f as f_distribution

from freqid.blend.sealed.bands import POOLED
from freqid.core.arrays import Array
from freqid.core.channels import STATE
from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.results.prediction import (
    WRENCH_HZ,
    ChannelScore,
    Check,
    PredictedResponse,
    Prediction,
)
from freqid.core.results.quicklook import InputLook
from freqid.dynamics.small_motion import STATES
from freqid.identify.loads.explanatory import history
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.response.injection import flown_span, line_transforms
from freqid.identify.spectra.trend import up_to


@dataclass(frozen=True, eq=False)
class Flown:
    """What of a flight a prediction is held against.

    Attributes
    ----------
    time : ndarray, shape (sample,)
        s, from the design's start, within it.
    channels : mapping of str to ndarray, shape (sample,)
        States and effectors that the record has.
    wrench : mapping of str to ndarray, shape (sample,)
        Reconstructed, of all frequencies.
    regressors : mapping of str to ndarray, shape (sample,)
    maneuver : Maneuver
        Cut to `time`.
    """

    time: Array
    channels: Mapping[str, Array]
    wrench: Mapping[str, Array]
    regressors: Mapping[str, Array]
    maneuver: Maneuver

    @classmethod
    def of(cls, prediction: Prediction, maneuver: Maneuver, start_s: float) -> Flown:
        """Cut a flight to the design, and reconstruct its wrench.

        Raises
        ------
        DataError
            Where the record lacks a regressor, or what the wrench is reconstructed from.
        """
        record = maneuver.record
        since = record.time - start_s
        inside = np.flatnonzero((since >= -1e-6) & (since <= prediction.time[-1] + 1e-6))
        if inside.size < 100:
            raise DataError(
                f"the record holds {inside.size} samples of the design, which starts at {start_s:.4g} s",
                remedy="score a record that holds the manoeuvre",
            )
        cut = Maneuver(
            record.cut(float(record.time[inside[0]]), float(record.time[inside[-1]])), maneuver.vehicle
        )
        names = [r.response for r in prediction.responses]
        wrench = applied_wrench(cut, names)
        regressors = {n: history(cut, n) for r in prediction.responses for n in r.regressors}
        channels = {}
        for channel in prediction.channels:
            if channel.kind == "wrench":
                continue
            try:
                channels[channel.name] = history(cut, channel.name)
            except DataError:
                continue  # not logged, so not scored
        time = cut.record.time - start_s
        rows = dict(zip(names, wrench.history(cut.record.dt), strict=True))
        return cls(time, channels, rows, regressors, cut)


def scored_channels(prediction: Prediction, flown: Flown) -> tuple[ChannelScore, ...]:
    """Return every predicted channel beside what was flown, free-running ones first.

    Parameters
    ----------
    prediction : Prediction
    flown : Flown
    """
    dt, top = flown.maneuver.record.dt, prediction.highest_hz
    found = []

    def scored(kind: str, name: str, unit: str, rows: Array, std: Array, offset: float, ends: int) -> None:
        keep = slice(ends, flown.time.size - ends)
        time = flown.time[keep]
        both = detrend(rows[:, keep])
        slope = float(np.polyfit(time, rows[0, keep] - rows[1, keep], 1)[0])
        found.append(ChannelScore(kind, name, unit, time, both[0], both[1], std[keep], offset, slope))

    # a history up to a highest frequency says more about its ends there than about the model
    ends = int(np.ceil(2 / top / dt)) if np.isfinite(top) else 0
    run_top = float(prediction.settings.get(WRENCH_HZ, top))
    run_ends = int(np.ceil(2 / run_top / dt)) if np.isfinite(run_top) else 0
    for channel in prediction.channels:
        wrench = channel.kind == "wrench"
        measured = flown.wrench.get(channel.name) if wrench else flown.channels.get(channel.name)
        if measured is None:
            continue
        at = flown.time
        rows = np.array([measured, np.interp(at, prediction.time, channel.change)])
        spread = np.interp(at, prediction.time, channel.std)
        offset = float(rows[0].mean() - channel.trim - rows[1].mean())
        if wrench and np.isfinite(run_top):
            rows = up_to(rows, dt, run_top)  # both: the highest line is on the edge, and half of it is cut
        scored("free-run", channel.name, channel.unit, rows, spread, offset, run_ends if wrench else 0)
    for response in prediction.responses:
        x = np.array([flown.regressors[n] for n in response.regressors])
        rows = np.array([flown.wrench[response.response], response.estimate @ x])
        if np.isfinite(top):
            rows, x = up_to(rows, dt, top), up_to(x, dt, top)
        about = detrend(x)
        own = response.residual_rms if np.isfinite(response.residual_rms) else 0.0
        spread = np.sqrt(np.einsum("it,ij,jt->t", about, response.covariance, about) + own**2)
        expected = response.bias + response.estimate @ (x.mean(axis=1) - response.trim)
        offset = float(rows[0].mean() - expected)
        scored("one-step", response.response, response.unit, rows, spread, offset, ends)
    return tuple(found)


def checks(
    prediction: Prediction, flown: Flown, looks: Sequence[InputLook], start_s: float
) -> tuple[Check, ...]:
    """Hold every assumption of a prediction against the flight.

    Parameters
    ----------
    prediction : Prediction
    flown : Flown
    looks : sequence of InputLook
        What a quick look finds of each input.
    start_s : float
        Of the design, on the record's clock.
    """
    testing = {
        "excitation": lambda limit: _excitation(prediction, looks, limit),
        "trim": lambda limit: _trim(prediction, flown, limit),
        "density": lambda limit: _density(prediction, flown, limit),
        "amplitude": lambda limit: _amplitude(prediction, flown, limit),
        "limits": lambda limit: _limits(looks, limit),
        "noise": lambda limit: _noise(prediction, flown, limit),
        "disturbances": lambda limit: _disturbances(prediction, flown, limit),
        "structure": lambda limit: _structure(prediction, flown, limit),
    }
    found = []
    for one in prediction.assumptions:
        held, evidence = (None, "nothing in a record tells")
        if one.name in testing:
            held, evidence = testing[one.name](one.limit)
        word = {True: "yes", False: "no", None: "not testable"}[held]
        found.append(Check(one.name, one.statement, word, evidence))
    return tuple(found)


_Finding = tuple[bool | None, str]


def _excitation(prediction: Prediction, looks: Sequence[InputLook], limit: float) -> _Finding:
    absent = [look.name for look in looks if not look.present]
    if absent:
        return False, f"not injected: {' '.join(absent)}"
    periods = prediction.design.periods if prediction.design else 1
    least = min(look.periods for look in looks)
    if least < 0.98 * periods:
        return False, f"the record holds {least:.2f} of {periods} periods"
    # a position comes after its actuator, so it tells the presence of an injection and not its size
    told = [look for look in looks if look.source.startswith("excitation/")]
    if not told:
        return None, "all inputs are there; their size is not logged, no excitation/ channel is in the record"
    worst = max(told, key=lambda look: abs(look.gain - 1))
    text = f"{worst.name} was injected at {worst.gain:.3f} of its design, the farthest of {len(told)} inputs"
    return abs(worst.gain - 1) <= limit, text


def _moved(prediction: Prediction) -> dict[str, tuple[float, float, str]]:
    """Return trim and rms of the identification by regressor, with the unit."""
    return {
        n: (float(t), float(m), u)
        for r in prediction.responses
        for n, t, m, u in zip(r.regressors, r.trim, r.regressor_rms, r.regressor_units, strict=True)
    }


def _trim(prediction: Prediction, flown: Flown, limit: float) -> _Finding:
    rows = []
    for name, (trim, rms, unit) in _moved(prediction).items():
        off = float(flown.regressors[name].mean()) - trim
        if rms > 0:
            rows.append((abs(off) / rms, name, off, unit))
    ratio, name, off, unit = max(rows)
    text = f"{name} is {off:+.3g} {unit} off its trim, {ratio:.2f} of its rms in the identification"
    return ratio <= limit, f"{text}; the limit is {limit:g}"


def _density(prediction: Prediction, flown: Flown, limit: float) -> _Finding:
    record, rho = flown.maneuver.record, prediction.reference.rho
    if "air/rho" not in record or not rho > 0:
        return None, "air/rho is not in the record" if rho > 0 else "the model's condition states no density"
    found = float(record["air/rho"].mean())
    text = f"{found:.4g} kg/m3, {100 * (found / rho - 1):+.1f} %; the limit is {100 * limit:g} %"
    return abs(found / rho - 1) <= limit, text


def _amplitude(prediction: Prediction, flown: Flown, limit: float) -> _Finding:
    rows = []
    for name, (_, rms, _unit) in _moved(prediction).items():
        if rms > 0:
            rows.append((float(flown.regressors[name].std()) / rms, name))
    ratio, name = max(rows)
    return (
        ratio <= limit,
        f"{name} moved {ratio:.2f} times as much as in the identification; the limit is {limit:g}",
    )


def _limits(looks: Sequence[InputLook], limit: float) -> _Finding:
    rows = [(look.at_limit, look.name, "position") for look in looks if np.isfinite(look.at_limit)]
    rows += [(look.at_rate_limit, look.name, "rate") for look in looks if np.isfinite(look.at_rate_limit)]
    if not rows:
        return None, "no limit is stated, or no position or command is in the record"
    share, name, kind = max(rows)
    text = f"{name} is at a {kind} limit for {100 * share:.1f} % of the time; the limit is {100 * limit:g} %"
    return share <= limit, text


def _noise(prediction: Prediction, flown: Flown, limit: float) -> _Finding:
    """Judge sensors by third differences, which motion in the band hardly enters."""
    record, rows = flown.maneuver.record, []
    for channel in prediction.channels:
        group = "state" if channel.name in STATE else "effector"
        name = f"{group}/{channel.name}"
        if channel.kind == "wrench" or channel.noise_std == 0 or name not in record:
            continue
        if record.channel(name).native_rate_hz < 0.999 / record.dt:
            continue  # between its own samples a log is smooth, whatever the noise
        third = np.diff(record[name], 3)
        sigma = float(np.median(np.abs(third)) / 0.6745 / np.sqrt(20.0))
        rows.append((sigma / channel.noise_std, channel.name, sigma, channel.unit))
    if not rows or not np.isfinite(limit):
        return None, "no channel is logged at the record's rate and has a stated noise"
    ratio, name, sigma, unit = max(rows)
    text = f"{name} has {sigma:.3g} {unit}, {ratio:.2f} of what is stated; the limit is {limit:g}"
    return ratio <= limit, text


def _lines(prediction: Prediction, flown: Flown) -> tuple[slice, Array, Array, float] | None:
    """Return whole periods of the flight, lines with and without excitation, and their length, s."""
    design = prediction.design
    if design is None:
        return None
    record = flown.maneuver.record
    start = float(record.time[0] - flown.time[0])
    span = flown_span(record, design, prediction.inputs, start)
    duration = (span.stop - span.start - 1) * record.dt
    whole = round(duration / design.period_s)
    if not whole:
        return None
    low, high = design.band_hz
    count = np.arange(
        int(np.ceil(low * whole * design.period_s)), int(high * whole * design.period_s + 1e-9) + 1
    )
    excited = np.unique(np.concatenate([s.index for s in design.signals]))
    on = np.isin(count, excited * whole)
    harmonic = count % whole == 0  # of distortion too, where nothing is excited
    f = count / (whole * design.period_s)
    return (
        slice(span.start, span.start + round(whole * design.period_s / record.dt)),
        f[on],
        f[~harmonic],
        duration,
    )


def _disturbances(prediction: Prediction, flown: Flown, limit: float) -> _Finding:
    """Hold motion between the harmonics, less the predicted transients, against what the bands hold there."""
    lines = _lines(prediction, flown)
    if lines is None or not lines[2].size:
        return None, "it takes two periods of a multisine, between whose harmonics nothing is excited"
    span, _, quiet, duration = lines
    low, high = prediction.design.band_hz if prediction.design else (0.0, 0.0)
    time, rows = flown.time[span], []
    for channel in prediction.channels:
        if channel.name not in STATES or channel.name not in flown.channels or channel.band_std == 0:
            continue
        off = flown.channels[channel.name][span] - np.interp(time, prediction.time, channel.change)
        y = line_transforms(off, time, quiet)[0]
        density = 2 * np.abs(y) ** 2 / duration
        variance = float(density.mean() * (high - low))
        freedom = float(2 * density.sum() ** 2 / np.sum(density**2))
        ratio = variance / channel.band_std**2
        rows.append((float(f_distribution.sf(ratio, freedom, 2 * POOLED)), -ratio, channel.name))
    if not rows:
        return None, "no state of the prediction is in the record"
    p, ratio, name = min(rows)
    p = min(1.0, p * len(rows))
    text = f"between the harmonics {name} moves with {-ratio:.2f} times the variance predicted, p = {p:.2g}"
    return p >= limit, f"{text}; the limit is {limit:g}"


def _structure(prediction: Prediction, flown: Flown, limit: float) -> _Finding:
    """Hold what the model leaves on excited lines against what its fit left there."""
    lines = _lines(prediction, flown)
    told = [r for r in prediction.responses if r.residual_hz.size]
    if lines is None or not told:
        return None, "it takes a multisine, and a model that keeps the residual on its lines"
    span, excited, _, duration = lines
    time, rows = flown.time[span], []
    for response in told:
        x = np.array([flown.regressors[n][span] for n in response.regressors])
        transforms = line_transforms(np.vstack([flown.wrench[response.response][span], x]), time, excited)
        left = transforms[0] - response.estimate @ transforms[1:]
        density = 2 * np.abs(left) ** 2 / duration
        uncertain = np.einsum("il,ij,jl->l", transforms[1:].conj(), response.covariance, transforms[1:]).real
        expected = _expected(response, excited, duration) + 2 * uncertain / duration
        ratio = float(np.mean(density / expected))
        p = float(f_distribution.sf(ratio, 2 * excited.size, 2 * response.residual_hz.size))
        rows.append((p, -ratio, response.response))
    p, ratio, name = min(rows)
    p = min(1.0, p * len(rows))
    text = f"on excited lines {name} leaves {-ratio:.2f} times the power that the fit left, p = {p:.2g}"
    return p >= limit, f"{text}; the limit is {limit:g}"


def _expected(response: PredictedResponse, hz: Array, duration: float) -> Array:
    """Return the one-sided density that a residual is expected to have, shape (line,)."""
    order = np.argsort(response.residual_hz, kind="stable")
    order = order[response.residual_hz[order] > hz[0] * (1 - 1e-9)]  # without the drift
    own, power = response.residual_hz[order], np.abs(response.residual[order]) ** 2
    noise = response.residual_noise[order] ** 2
    density = []
    for pool in np.array_split(np.arange(own.size), max(1, own.size // POOLED)):
        total, random = power[pool].mean(), noise[pool].mean()
        if np.isfinite(random):  # distortion is a line: its density grows with the time it is seen for
            twisted = max(total - random, 0.0)
            total = min(random, total) + twisted * duration / response.duration
        density.append((own[pool].mean(), total))
    centres, values = np.array(density).T
    return values[np.abs(np.log(hz[:, None] / centres)).argmin(axis=1)]

"""Do the sensors of a flight agree? Their biases, scale factors and delays, found by kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import overload

import numpy as np
from scipy.special import stdtrit

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, FORCES, RATES, VELOCITY
from freqid.core.errors import UsageError, nearest
from freqid.core.frames import flow_angles
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.point import Fit
from freqid.identify.sensors.errors import Reading, SensorErrors, spline_of
from freqid.identify.sensors.kinematic_fit import fit_compatibility
from freqid.identify.sensors.kinematic_model import INITIAL, CompatibilityProblem, sensors_of

# Size that each error may well have, SI units: for weighing what the data tell against what is known anyway.
PLAUSIBLE = {
    "turn": 0.3,
    "start": 30.0,
    "height": 1000.0,
    "wind": 20.0,
    "delay": 0.3,
    "p q r bias": 0.02,
    "ax ay az bias": 0.5,
    "phi theta bias": 0.03,
    "alpha beta bias": 0.05,
    "alpha beta scale": 0.3,
    "V u v w bias": 3.0,
    "V u v w scale": 0.2,
}


@dataclass(frozen=True)
class KinematicSettings:
    """What a compatibility check estimates.

    Attributes
    ----------
    parameters : tuple of str, optional
        Sensor errors to estimate, such as ``"alpha delay"``, ``"ax bias"``, ``"V scale"``; where absent, all
        that the channels of the record allow. Those that the data do not tell are held at zero and named.
    wind_walk : float
        Intensity of a random walk of the wind, m/s per square root of a second: 0 for a constant wind.
    longest_delay_s : float
        Longest delay that is tried, s; as much of the record is left out at both ends.
    plausible : mapping of str to float
        Size that an error may well have, SI units, by parameter; replaces the built-in sizes.
    confidence : float
        Of the intervals.
    """

    parameters: tuple[str, ...] | None = None
    wind_walk: float = 0.0
    longest_delay_s: float = 1.0
    plausible: Mapping[str, float] = field(default_factory=dict)
    confidence: float = 0.95


@dataclass(frozen=True, eq=False, repr=False)
class KinematicCheck(SensorErrors):
    """What a record's kinematics say of its sensors.

    Attributes
    ----------
    names, estimate, covariance
        As in `SensorErrors`: of the errors that the data tell. Standard errors allow for drift by sensor
        noise and for coloured residuals.
    lower, upper : ndarray, shape (p,)
        Confidence limits.
    undetermined : mapping of str to tuple of str
        Errors that the data do not tell, or put at three times their plausible size, and that were held at
        zero; with the names of those unknowns that would take an actual error of this kind up, initial
        values among them.
    rms_before, rms_after : mapping of str to float
        By channel: residual of the integrated motion with initial values alone, and with the sensor errors.
    fit : mapping of str to Fit
        By channel: measured and modelled history, with the sensor errors.
    noise_std : mapping of str to float
        White noise by channel that the weights rest on.
    """

    lower: Array
    upper: Array
    undetermined: Mapping[str, tuple[str, ...]]
    rms_before: Mapping[str, float]
    rms_after: Mapping[str, float]
    fit: Mapping[str, Fit]
    noise_std: Mapping[str, float]


def check_kinematics(
    flown: FlightRecord | Maneuver, settings: KinematicSettings = KinematicSettings()
) -> KinematicCheck:
    """Estimate sensor errors from the disagreement between channels that kinematics tie together.

    Parameters
    ----------
    flown : FlightRecord or Maneuver
        With ``p q r ax ay az`` and any of airspeed, flow angles, ``u v w``, attitude, altitude and velocity
        over ground.
    settings : KinematicSettings

    Returns
    -------
    KinematicCheck

    Raises
    ------
    DataError
        Channels are missing, the record is too short, the estimates do not settle, or a delay runs to its
        limit.
    UsageError
        A parameter is asked for that the record's channels do not have, or a setting is impossible.

    Notes
    -----
    Output error: rates and specific forces less their biases are integrated, and the other channels compared
    with the result (docs/theory/kinematics.md). The clock of the inertial sensors is the reference of delays.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., ch. 10; Jategaonkar, Flight Vehicle System
    Identification, 2nd ed., ch. 10.
    """
    if not (settings.longest_delay_s > 0 and settings.wind_walk >= 0):
        raise UsageError(
            f"longest_delay_s is {settings.longest_delay_s:g} and wind_walk {settings.wind_walk:g}, expected "
            "a positive time and an intensity of zero or more"
        )
    record = flown.record if isinstance(flown, Maneuver) else flown
    problem = CompatibilityProblem(sensors_of(record, _centre_of_gravity(flown)), settings.longest_delay_s)
    possible = problem.names[INITIAL:]
    wanted = possible if settings.parameters is None else settings.parameters
    for name in (*wanted, *settings.plausible):
        if name not in possible:
            raise UsageError(
                f"parameter '{name}' is none of this record's sensor errors", remedy=nearest(name, possible)
            )
    plausible = np.array([settings.plausible.get(n, _plausible(n)) for n in problem.names])
    found = fit_compatibility(problem, wanted, plausible, settings.wind_walk)

    errors = [i for i, n in enumerate(found.names) if n in possible]
    names = tuple(found.names[i] for i in errors)
    estimate, covariance = found.estimate[errors], found.covariance[np.ix_(errors, errors)]
    std_error = np.sqrt(np.diag(covariance))
    half = stdtrit(found.degrees_of_freedom[errors], 0.5 + settings.confidence / 2) * std_error
    channels, time = problem.sensors.names, record.time[problem.window]
    measured = found.after.modelled + found.after.residual
    return KinematicCheck(
        names=names,
        estimate=estimate,
        covariance=covariance,
        lower=estimate - half,
        upper=estimate + half,
        undetermined=found.undetermined,
        rms_before=_rms(channels, found.before.residual),
        rms_after=_rms(channels, found.after.residual),
        fit={n: Fit(time, *both) for n, *both in zip(channels, measured, found.after.modelled, strict=True)},
        noise_std=dict(
            zip(
                (*RATES, *FORCES, *channels),
                (*found.noise.rates, *found.noise.force, *found.noise.outputs),
                strict=True,
            )
        ),
    )


def _centre_of_gravity(flown: FlightRecord | Maneuver) -> tuple[float, float, float] | None:
    if isinstance(flown, Maneuver):
        return flown.vehicle.mass_properties.cg_m
    if flown.mass_properties is not None:
        return flown.mass_properties.cg_m
    return flown.vehicle.mass_properties.cg_m if flown.vehicle else None


def _plausible(name: str) -> float:
    """Return the size that an unknown may well have."""
    first, _, kind = name.partition(" ")
    if kind.endswith("start") or name == "alt start":
        return PLAUSIBLE["turn" if first == "turn" else "height" if first == "alt" else "start"]
    if first == "wind" or kind == "delay":
        return PLAUSIBLE["wind" if first == "wind" else "delay"]
    return next(v for k, v in PLAUSIBLE.items() if k.endswith(f" {kind}") and first in k.split())


def _rms(channels: tuple[str, ...], residual: Array) -> dict[str, float]:
    return dict(zip(channels, np.sqrt((residual**2).mean(axis=1)).tolist(), strict=True))


@overload
def corrected(flown: FlightRecord, check: KinematicCheck) -> FlightRecord: ...
@overload
def corrected(flown: Maneuver, check: KinematicCheck) -> Maneuver: ...
def corrected(flown: FlightRecord | Maneuver, check: KinematicCheck) -> FlightRecord | Maneuver:
    """Return a record, or a manoeuvre, without the sensor errors that a check found.

    Parameters
    ----------
    flown : FlightRecord or Maneuver
        The one that was checked, or another flown with the same sensors.
    check : KinematicCheck

    Returns
    -------
    FlightRecord or Maneuver
        Channels ``(measured(t + delay) - bias) / (1 + scale)``, cut to the time that all of them cover.
        Airspeed and flow angles follow corrected ``u v w``, dynamic pressure a corrected airspeed. The
        provenance lists the corrections.
    """
    record = flown.record if isinstance(flown, Maneuver) else flown
    error = check.errors
    changed, delays = [], [0.0]
    for channel in record.channels.values():
        reading = Reading.of(channel.name, error)
        if reading and channel.name.startswith(("state/", "air/")):
            later = spline_of(record.time, channel)(record.time + reading.delay)
            source = f"{channel.source}, corrected by kinematics"
            changed.append(replace(channel, values=reading.undone(later), source=source))
            delays.append(reading.delay)
    there = _air_data_following(record.with_channels(*changed), record)
    # A channel brought forward has no samples for the last stretch, one put back none for the first.
    first = int(np.ceil(max(0.0, -min(delays)) / record.dt - 1e-9))
    last = record.time.size - 1 - int(np.ceil(max(delays) / record.dt - 1e-9))
    there = there.cut(record.time[first], record.time[last])
    there = replace(there, provenance={**there.provenance, "kinematics": error})
    if isinstance(flown, Maneuver):
        return Maneuver(there, flown.vehicle)
    return there


def _air_data_following(there: FlightRecord, before: FlightRecord) -> FlightRecord:
    """Return a corrected record with those air data recomputed that were not compared themselves."""

    def changed(name: str) -> bool:
        return name in there and there[name] is not before[name]

    if any(changed(n) for n in VELOCITY):
        first = there.channel(VELOCITY[0])
        flow = zip(FLOW, flow_angles(there.matrix(VELOCITY)), strict=True)
        there = there.with_channels(
            *(
                replace(there.channel(n), values=v, position_m=first.position_m, source=first.source)
                for n, v in flow
                if n in there
            )
        )
    if changed("air/V") and "air/qbar" in there:
        still = before["air/V"] == 0
        ratio = np.where(still, 1.0, there["air/V"]) / np.where(still, 1.0, before["air/V"])
        qbar = there.channel("air/qbar")
        there = there.with_channels(replace(qbar, values=qbar.values * ratio**2))
    return there

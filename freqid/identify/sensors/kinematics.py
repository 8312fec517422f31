"""Do the sensors of a flight agree? Their biases, scale factors and delays, found by kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, overload

import numpy as np
from scipy.linalg import block_diag

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, FORCES, GROUND, RATES, VELOCITY
from freqid.core.errors import UsageError, nearest
from freqid.core.record import FlightRecord, Maneuver
from freqid.core.results.fit import Fit
from freqid.dynamics.frames import flow_angles
from freqid.identify.regress.confidence_interval import half_width
from freqid.identify.sensors.air_data_lag import UNSTEADY, LagByLoads
from freqid.identify.sensors.errors import Reading, SensorErrors, error_kind, error_name, spline_of
from freqid.identify.sensors.inclusion import average_over_inclusion
from freqid.identify.sensors.kinematic_fit import LARGEST_ERROR_SHARE, fit_compatibility
from freqid.identify.sensors.kinematic_model import (
    INITIAL,
    CompatibilityProblem,
    computed_flow,
    sensors_of,
)
from freqid.identify.sensors.path_noise import GustStrength

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
    "V u v w bias": 3.0,  # of V: AIRSPEED_BIAS
    "V u v w scale": 0.2,
}


AIRSPEED_BIAS = 0.05  # of the airspeed: static ports and pitot tubes of small aircraft err by less
AIR_BIASES = tuple(error_name(n, "bias") for n in (*FLOW, *VELOCITY))


@dataclass(frozen=True)
class KinematicSettings:
    """What a compatibility check estimates.

    Attributes
    ----------
    parameters : tuple of str, optional
        Sensor errors to estimate, such as ``"alpha delay"``, ``"ax bias"``, ``"V scale"``; where absent, all
        that the channels of the record allow. Those that the data do not tell are held at zero and named.
    gusts : float, optional
        Standard deviation of each axis of the gusts, m/s: 0 for a constant wind; estimated where absent.
    gust_length_m : float
        Scale of the gusts, m: they change within the time that this takes to fly.
    longest_delay_s : float
        Longest delay that is tried, s; as much of the record is left out at both ends.
    plausible : mapping of str to float
        Size that an error may well have, SI units, by parameter; replaces the built-in sizes.
    confidence : float
        Of the intervals.
    """

    parameters: tuple[str, ...] | None = None
    gusts: float | None = None
    gust_length_m: float = 150.0  # L_u of MIL-F-8785C at 40 m, L_w at 150 m
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
    gusts : GustStrength
        Of the wind about its mean.
    instruments : bool
        Scales and delays of the air data are told by what the injected signals move, and by nothing else.
        Otherwise their standard errors hold what an aircraft that rides the gusts may do to them.
    probability : mapping of str to float
        That a scale, a delay or a bias of the air data is there at all, by the evidence for it; even
        beforehand.
    correction : SensorErrors
        What `corrected` takes out: the estimates averaged over whether each error is there. One that hardly
        is, is hardly taken out; the covariance holds the doubt.
    computed : tuple of str
        Air data that the record computed from u v w; they follow these.
    by_loads : tuple of str
        Delays of the air data that kinematics do not tell, as in gusts that drown the injected motion, and
        that the loads tell in their place (`air_data_lag`): they hold as far as loads follow the motion at
        once.
    """

    lower: Array
    upper: Array
    undetermined: Mapping[str, tuple[str, ...]]
    rms_before: Mapping[str, float]
    rms_after: Mapping[str, float]
    fit: Mapping[str, Fit]
    noise_std: Mapping[str, float]
    gusts: GustStrength
    instruments: bool
    probability: Mapping[str, float]
    correction: SensorErrors
    computed: tuple[str, ...]
    by_loads: tuple[str, ...] = ()

    def account(self) -> dict[str, Any]:
        """Return what was found and what is taken out, by name, JSON-compatible."""
        rows = super().account()
        applied = self.correction.account()
        for name, row in rows.items():
            row["applied"] = applied[name]["estimate"]
            row["applied_std_error"] = applied[name]["std_error"]
            if name in self.probability:
                row["probability"] = self.probability[name]
            if name in self.by_loads:
                row["told_by"] = "loads"
        return rows


def check_kinematics(
    flown: FlightRecord | Maneuver,
    settings: KinematicSettings = KinematicSettings(),
    driven: FlightRecord | None = None,
    lag: LagByLoads | None = None,
) -> KinematicCheck:
    """Estimate sensor errors from the disagreement between channels that kinematics tie together.

    Parameters
    ----------
    flown : FlightRecord or Maneuver
        With ``p q r ax ay az`` and any of airspeed, flow angles, ``u v w``, attitude, altitude and velocity
        over ground.
    settings : KinematicSettings
    driven : FlightRecord, optional
        The flight as the injected signals alone would have made it, u v w p q r on the same samples
        (`instruments.driven_maneuvers`). What it says of the motion no gust has made.
    lag : LagByLoads, optional
        Of the air data: stands in for delays of theirs that kinematics do not tell.

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
    with the result, from which gusts part the air data (docs/theory/kinematics.md). The clock of the inertial
    sensors is the reference of delays.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., ch. 10; Jategaonkar, Flight Vehicle System
    Identification, 2nd ed., ch. 10.
    """
    for name, value in (
        ("longest_delay_s", settings.longest_delay_s),
        ("gust_length_m", settings.gust_length_m),
    ):
        if not value > 0:
            raise UsageError(f"{name} is {value:g}, expected a positive number")
    if settings.gusts is not None and not settings.gusts >= 0:
        raise UsageError(f"gusts is {settings.gusts:g} m/s, expected zero or more, or none to estimate them")
    record = flown.record if isinstance(flown, Maneuver) else flown
    sensors = sensors_of(record, _centre_of_gravity(flown))
    problem = CompatibilityProblem(
        sensors, settings.longest_delay_s, None if driven is None else driven.matrix((*VELOCITY, *RATES))
    )
    possible = problem.names[INITIAL:]
    wanted = possible if settings.parameters is None else settings.parameters
    for name in (*wanted, *settings.plausible):
        if name not in possible:
            raise UsageError(
                f"parameter '{name}' is none of this record's sensor errors", remedy=nearest(name, possible)
            )
    speed = max(_airspeed(record), SLOWEST)
    sizes = {"V bias": AIRSPEED_BIAS * speed, **settings.plausible}
    plausible = np.array([sizes[n] if n in sizes else _plausible(n) for n in problem.names])
    gust_time = settings.gust_length_m / speed
    found = fit_compatibility(problem, wanted, plausible, settings.gusts, gust_time)

    errors = [i for i, n in enumerate(found.names) if n in possible]
    names = tuple(found.names[i] for i in errors)
    estimate, covariance = found.estimate[errors], found.covariance[np.ix_(errors, errors)]
    std_error = np.sqrt(np.diag(covariance))
    level, dof = settings.confidence, found.degrees_of_freedom[errors]
    half = half_width(std_error, level=level, degrees_of_freedom=dof)
    by_loads: tuple[str, ...] = ()
    if lag is not None and lag.std_error < LARGEST_ERROR_SHARE * PLAUSIBLE["delay"]:
        told = {n for n, a in zip(problem.names, problem.on_air, strict=True) if a and n.endswith("delay")}
        by_loads = tuple(n for n in found.undetermined if n in told)
    if lag is not None and by_loads:
        more = len(by_loads)
        names, estimate = (*names, *by_loads), np.append(estimate, np.full(more, lag.estimate))
        # One lag of all, and what each channel may have of its own.
        shared = np.full((more, more), lag.std_error**2) + UNSTEADY**2 * np.eye(more)
        covariance = block_diag(covariance, shared)
        half = np.append(half, half_width(np.sqrt(np.diag(shared)), level=level))
    tried = np.array([error_kind(n) in ("scale", "delay") or n in AIR_BIASES for n in names], dtype=bool)
    averaged = average_over_inclusion(estimate, covariance, plausible[_rows(problem.names, names)], tried)
    channels, time = problem.sensors.names, record.time[problem.window]
    measured = found.after.modelled + found.after.residual
    return KinematicCheck(
        names=names,
        estimate=estimate,
        covariance=covariance,
        lower=estimate - half,
        upper=estimate + half,
        undetermined={n: by for n, by in found.undetermined.items() if n not in by_loads},
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
        gusts=found.gusts,
        instruments=problem.driven is not None,
        probability={n: float(averaged.probability[i]) for i, n in enumerate(names) if tried[i]},
        correction=SensorErrors(names, averaged.estimate, averaged.covariance),
        computed=computed_flow(record),
        by_loads=by_loads,
    )


SLOWEST = 1.0  # m/s; gusts pass an aircraft that stands no slower than a light air


def _rows(names: tuple[str, ...], wanted: tuple[str, ...]) -> list[int]:
    return [names.index(n) for n in wanted]


def _airspeed(record: FlightRecord) -> float:
    """Return the mean speed through the air, or over the ground; zero where neither is known."""
    if "air/V" in record:
        return float(record["air/V"].mean())
    for group in (VELOCITY, GROUND):
        if all(n in record for n in group):
            return float(np.linalg.norm(record.matrix(group), axis=0).mean())
    return 0.0


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
        Channels ``(measured(t + delay) - bias) / (1 + scale)`` with the errors of ``check.correction``, cut
        to the time that all of them cover. A channel that was measured keeps its own history: airspeed and
        flow angles follow ``u v w`` only where they were computed from these, dynamic pressure follows a
        corrected airspeed. The provenance lists the corrections.
    """
    return without_errors(flown, check.correction.errors, check.computed)


@overload
def without_errors(
    flown: FlightRecord, error: Mapping[str, float], computed: tuple[str, ...] = ()
) -> FlightRecord: ...
@overload
def without_errors(
    flown: Maneuver, error: Mapping[str, float], computed: tuple[str, ...] = ()
) -> Maneuver: ...
def without_errors(
    flown: FlightRecord | Maneuver, error: Mapping[str, float], computed: tuple[str, ...] = ()
) -> FlightRecord | Maneuver:
    """Return a record without given errors of its sensors.

    Parameters
    ----------
    flown : FlightRecord or Maneuver
    error : mapping of str to float
        By name, SI units.
    computed : tuple of str
        Air data that are computed from u v w.

    Returns
    -------
    FlightRecord or Maneuver
    """
    record = flown.record if isinstance(flown, Maneuver) else flown
    changed, delays = [], [0.0]
    for channel in record.channels.values():
        reading = Reading.of(channel.name, error)
        if reading and channel.name.startswith(("state/", "air/")):
            later = spline_of(record.time, channel)(record.time + reading.delay)
            source = f"{channel.source}, corrected by kinematics"
            changed.append(replace(channel, values=reading.undone(later), source=source))
            delays.append(reading.delay)
    there = _air_data_following(record.with_channels(*changed), record, computed)
    # A channel brought forward has no samples for the last stretch, one put back none for the first.
    first = int(np.ceil(max(0.0, -min(delays)) / record.dt - 1e-9))
    last = record.time.size - 1 - int(np.ceil(max(delays) / record.dt - 1e-9))
    there = there.cut(record.time[first], record.time[last])
    there = replace(there, provenance={**there.provenance, "kinematics": dict(error)})
    if isinstance(flown, Maneuver):
        return Maneuver(there, flown.vehicle)
    return there


def _air_data_following(there: FlightRecord, before: FlightRecord, computed: tuple[str, ...]) -> FlightRecord:
    """Return a corrected record with those air data recomputed that are no measurement."""

    def changed(name: str) -> bool:
        return name in there and there[name] is not before[name]

    if any(changed(n) for n in VELOCITY):
        first = there.channel(VELOCITY[0])
        flow = zip(FLOW, flow_angles(there.matrix(VELOCITY)), strict=True)
        there = there.with_channels(
            *(
                replace(there.channel(n), values=v, position_m=first.position_m, source=first.source)
                for n, v in flow
                if n in computed and n in there
            )
        )
    if changed("air/V") and "air/qbar" in there:
        still = before["air/V"] == 0
        ratio = np.where(still, 1.0, there["air/V"]) / np.where(still, 1.0, before["air/V"])
        qbar = there.channel("air/qbar")
        there = there.with_channels(replace(qbar, values=qbar.values * ratio**2))
    return there

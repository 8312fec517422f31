"""A record without the sensor errors that a compatibility check found."""

from __future__ import annotations

from dataclasses import replace
from typing import overload

import numpy as np
from scipy.interpolate import CubicSpline

from freqid.core.frames import flow_angles
from freqid.core.record import FlightRecord, Maneuver
from freqid.identify.sensors.kinematic_problem import unknown
from freqid.identify.sensors.kinematic_sensors import ANGLES, FLOW, VELOCITY
from freqid.identify.sensors.kinematics import KinematicCheck


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
        Channels ``(measured(t + skew) - bias) / (1 + scale)``, cut to the time that all of them cover.
        Airspeed and flow angles follow corrected ``u v w``, dynamic pressure a corrected airspeed. The
        provenance lists the corrections.
    """
    record = flown.record if isinstance(flown, Maneuver) else flown
    error = dict(zip(check.names, check.estimate.tolist(), strict=True))
    changed, skews = [], [0.0]
    for channel in record.channels.values():
        if not channel.name.startswith(("state/", "air/")):
            continue
        scale, bias = (error.get(unknown(channel.name, kind), 0.0) for kind in ("scale", "bias"))
        skew = error.get(unknown(channel.name, "skew"), 0.0)
        if scale or bias or skew:
            values = np.unwrap(channel.values) if channel.name in ANGLES else channel.values
            values = CubicSpline(record.time, values)(record.time + skew) if skew else values
            source = f"{channel.source}, corrected by kinematics"
            changed.append(replace(channel, values=(values - bias) / (1 + scale), source=source))
            skews.append(skew)
    there = _air_data_following(record.with_channels(*changed), record)
    # A channel brought forward has no samples for the last stretch, one put back none for the first.
    first = int(np.ceil(max(0.0, -min(skews)) / record.dt - 1e-9))
    last = record.time.size - 1 - int(np.ceil(max(skews) / record.dt - 1e-9))
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

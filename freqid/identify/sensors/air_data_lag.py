"""How late the air data are by the loads, which follow them best when they are on time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, RATES, VELOCITY
from freqid.core.record import Maneuver
from freqid.core.sections.identification import Identification
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.model.line_equations import on_lines
from freqid.identify.regress.equations import real_equations
from freqid.identify.sensors.errors import spline_of

LATEST, STEP = 0.4, 0.02  # s, of the lags that are tried
UNSTEADY = 0.02  # s, one sigma: loads follow the motion themselves, a tail by the time that a wake takes


@dataclass(frozen=True, eq=False)
class LagByLoads:
    """One lag of u v w, or of airspeed and flow angles where these were not all logged.

    Attributes
    ----------
    estimate, std_error : float
        s.
    on_time : Maneuver
        With its air data brought forward by that, on the same samples; the last ones are held.
    """

    estimate: float
    std_error: float
    on_time: Maneuver


def lag_by_loads(flown: Maneuver, lines_hz: Array, settings: Identification) -> LagByLoads:
    """Return the lag of the air data at which motion and effectors explain the loads best.

    Parameters
    ----------
    flown : Maneuver
    lines_hz : ndarray, shape (M,)
        Hz, where the manoeuvre was excited.
    settings : Identification
        Motion, and the effectors among its regressors, explain the loads here.

    Returns
    -------
    LagByLoads

    Notes
    -----
    Each of the six components of the wrench is fitted by least squares at lags up to `LATEST`, either way.
    Its likelihood ``-M log(power left)`` over M lines has its own best lag and information; the answer is
    their mean by information, at the sum of the likelihoods' best. Where the components disagree by more than
    noise, the error is that much larger (Birge, *Physical Review* 40, 1932). Gusts are no matter, since loads
    follow the whole motion through the air. Loads that follow it late pass for early air data; `UNSTEADY`
    allows for a wake's way to a tail.
    """
    record = flown.record
    measured = VELOCITY if all(n in record for n in VELOCITY) else FLOW
    air = [record.channel(n) for n in measured if n in record]
    if not air:
        return LagByLoads(0.0, np.inf, flown)
    splines = [spline_of(record.time, channel) for channel in air]
    named = {n for r in settings.responses for n in settings.regressors_of(r)}
    moving = [n.partition("/")[2] for n in (*VELOCITY, *RATES)]
    effectors = [n for n in record.group("effector") if n in named]
    wrench = applied_wrench(flown, angular_acceleration=settings.angular_acceleration)

    def on_time(lag: float) -> Maneuver:
        at = np.clip(record.time + lag, record.time[0], record.time[-1])
        changed = (replace(c, values=s(at)) for c, s in zip(air, splines, strict=True))
        return Maneuver(record.with_channels(*changed), flown.vehicle)

    def unlikely(lag: float) -> Array:
        moved = explanatory_variables(on_time(lag), (*moving, *effectors))[0]
        equations = on_lines([moved], [wrench], [record.dt], lines_hz)
        columns, rows = real_equations(np.concatenate([equations.nuisance, equations.x]), equations.z)
        length = np.linalg.norm(columns, axis=1)
        basis = np.linalg.qr((columns[length > 0] / length[length > 0, None]).T)[0]
        left = ((rows - (rows @ basis) @ basis.T) ** 2).sum(axis=1)
        return lines_hz.size * np.log(np.maximum(left, np.finfo(float).tiny))

    lags = np.arange(-round(LATEST / STEP), round(LATEST / STEP) + 1) * STEP
    tried = np.array([unlikely(lag) for lag in lags])
    best = int(np.argmin(tried[1:-1].sum(axis=1))) + 1
    below, there, above = tried[best - 1 : best + 2]
    information = np.maximum((above - 2 * there + below) / STEP**2, 0.0)  # of each component
    away = -(above - below) / (2 * STEP)  # information times the way to the component's own best lag
    if not information.any():
        return LagByLoads(0.0, np.inf, flown)
    step = float(np.clip(away.sum() / information.sum(), -STEP, STEP))
    used = information > 0
    disagreement = (away[used] - information[used] * step) ** 2 / information[used]
    birge = max(1.0, float(disagreement.sum()) / max(int(used.sum()) - 1, 1))
    lag = float(lags[best] + step)
    return LagByLoads(lag, float(np.hypot(np.sqrt(birge / information.sum()), UNSTEADY)), on_time(lag))

"""How late the air data are, to a first guess: the loads follow them best when they are on time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import FLOW, VELOCITY
from freqid.core.record import Maneuver
from freqid.core.sections.identification import Identification
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.loads.wrench import applied_wrench
from freqid.identify.model.line_equations import on_lines
from freqid.identify.regress.equations import real_equations
from freqid.identify.sensors.errors import spline_of

MOTION = (*(n.partition("/")[2] for n in VELOCITY), "p", "q", "r")
LATEST, STEP = 0.4, 0.02  # s, of the lags that are tried


def with_air_data_on_time(flown: Maneuver, lines_hz: Array, settings: Identification) -> Maneuver:
    """Return a manoeuvre with its air data brought forward by one lag that suits its loads best.

    Parameters
    ----------
    flown : Maneuver
    lines_hz : ndarray, shape (M,)
        Hz, where the manoeuvre was excited.
    settings : Identification
        Motion, and the effectors among its regressors, explain the loads here.

    Returns
    -------
    Maneuver
        On the same samples; the last ones of what was brought forward are held.

    Notes
    -----
    Of the lags up to `LATEST`, either way, the one is taken at which least squares of all six components of
    the wrench leave least, by the sum of the logarithms of what each leaves. That holds gusts too, since
    loads follow the whole motion through the air. Loads that follow late, as a wake does, pass for air data
    that are early: good enough for a model of the loop to make instruments of, not for an answer.
    """
    record = flown.record
    air = [record.channel(n) for n in (*FLOW, *VELOCITY) if n in record]
    if not air:
        return flown
    splines = [spline_of(record.time, channel) for channel in air]
    named = {n for r in settings.responses for n in settings.regressors_of(r)}
    effectors = [n for n in record.group("effector") if n in named]
    wrench = applied_wrench(flown, angular_acceleration=settings.angular_acceleration)

    def brought_forward(lag: float) -> Maneuver:
        at = np.clip(record.time + lag, record.time[0], record.time[-1])
        changed = (replace(c, values=s(at)) for c, s in zip(air, splines, strict=True))
        return Maneuver(record.with_channels(*changed), flown.vehicle)

    def left(lag: float) -> float:
        moved = explanatory_variables(brought_forward(lag), (*MOTION, *effectors))[0]
        equations = on_lines([moved], [wrench], [record.dt], lines_hz)
        columns, rows = real_equations(np.concatenate([equations.nuisance, equations.x]), equations.z)
        length = np.linalg.norm(columns, axis=1, keepdims=True)
        used = columns[length[:, 0] > 0] / length[length[:, 0] > 0]
        fitted = np.linalg.lstsq(used.T, rows.T)[0].T @ used
        power = ((rows - fitted) ** 2).sum(axis=1)
        return float(np.log(power[power > 0]).sum())

    lags = np.arange(-round(LATEST / STEP), round(LATEST / STEP) + 1) * STEP
    return brought_forward(float(lags[np.argmin([left(lag) for lag in lags])]))

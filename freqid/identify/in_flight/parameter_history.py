"""Parameters and standard errors against time over a recorded manoeuvre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import FrequencyGrid, Identification
from freqid.identify.in_flight.recursive import RecursiveRegression, RunningEstimate
from freqid.identify.loads.explanatory import explanatory_variables
from freqid.identify.model.problem import measured_responses
from freqid.identify.spectra.fourier import frequency_grid, harmonics

_HISTORIES = ("time", "estimate", "std_error", "lower", "upper", "bias", "bias_std_error", "r2")
# Samples that are transformed by one product, since the whole manoeuvre is at hand.
BLOCK = 64


@dataclass(frozen=True, eq=False)
class ParameterHistory:
    """Parameters of one response against time, each from all samples up to then.

    Attributes
    ----------
    response, unit : str
        Name and unit of the response.
    regressors, regressor_units : tuple of str, length p
    time : ndarray, shape (k,)
        s from the first sample; starts where the data first determine the parameters.
    estimate, std_error, lower, upper : ndarray, shape (k, p)
        Unit of the response per unit of the regressor.
    bias, bias_std_error, r2 : ndarray, shape (k,)
    """

    response: str
    unit: str
    regressors: tuple[str, ...]
    regressor_units: tuple[str, ...]
    time: Array
    estimate: Array
    std_error: Array
    lower: Array
    upper: Array
    bias: Array
    bias_std_error: Array
    r2: Array


def parameter_history(
    maneuver: Maneuver,
    settings: Identification,
    *,
    every_s: float = 1.0,
    excitation: Excitation | None = None,
) -> dict[str, ParameterHistory]:
    """Return parameters and standard errors against time over a manoeuvre.

    Parameters
    ----------
    maneuver : Maneuver
    settings : Identification
        As for `identify_point`, by equation error in the frequency domain.
    every_s : float
        Time between estimates, s; the last one is at the end of the record.
    excitation : Excitation, optional
        Gives the lines, its harmonics, where the settings name none.

    Returns
    -------
    dict of str to ParameterHistory
        By response. The estimates at any time are those of `identify_point` on the record cut there,
        where wings that tilt do not make it differentiate angles; but products of regressors are of the
        departures from the means of the whole record.

    Raises
    ------
    DataError
        The whole record does not determine the parameters, or lacks a channel.
    UsageError
        No lines are named, or the method is not "frequency".
    """
    record = maneuver.record
    lines = _lines(settings, excitation)
    regression = RecursiveRegression(settings, record.dt, lines)
    record.check_band(_used(maneuver, regression.names, settings), float(lines[-1]))
    x, units = explanatory_variables(maneuver, regression.names)
    wrench = measured_responses(maneuver, settings)
    if not every_s > 0:
        raise UsageError(f"estimates every {every_s:g} s are asked for, expected a positive time")
    step = max(1, round(every_s / record.dt))
    stops = [*range(step + 1, record.time.size - step // 2, step), record.time.size]
    found: list[dict[str, RunningEstimate]] = []
    start = 0
    for stop in stops:
        while start < stop:
            part = slice(start, min(start + BLOCK, stop))
            regression.update(x[:, part], wrench.direct[:, part], wrench.momentum[:, part])
            start = part.stop
        try:
            found.append(regression.estimate())
        except DataError:
            if stop == stops[-1]:
                raise  # early on it is no error that the data do not suffice yet
    unit_of = dict(zip(regression.names, units, strict=True))
    histories = {}
    for response, unit in zip(settings.responses, wrench.units, strict=True):
        estimates = [each[response] for each in found]
        regressors = estimates[0].regressors
        histories[response] = ParameterHistory(
            response,
            unit,
            regressors,
            tuple(unit_of[n] for n in regressors),
            **{name: np.array([getattr(e, name) for e in estimates]) for name in _HISTORIES},
        )
    return histories


def _used(maneuver: Maneuver, names: tuple[str, ...], settings: Identification) -> list[str]:
    """Return the channels of the record that must carry the band: regressors, rates, forces and rotors."""
    if settings.response_source == "reconstruct":
        names += ("p", "q", "r", "ax", "ay", "az", *(r.name for r in maneuver.vehicle.rotors if r.inertia))
    wanted = (f"{group}/{name}" for group in ("state", "air", "effector") for name in names)
    return [name for name in wanted if name in maneuver.record]


def _lines(settings: Identification, excitation: Excitation | None) -> Array:
    lines = settings.frequencies_hz
    if lines is None:
        if excitation is None:
            raise UsageError(
                "no frequencies are named",
                remedy="give identification.frequencies_hz, or [excitation] whose harmonics are then used",
            )
        return harmonics(excitation.period_s, excitation.band_hz)
    if isinstance(lines, FrequencyGrid):
        return frequency_grid(lines.start, lines.step, lines.stop)
    return np.array(lines)

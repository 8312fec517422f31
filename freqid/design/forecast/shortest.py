"""The shortest manoeuvre that reaches a wanted accuracy."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import replace
from math import inf

from freqid.core.errors import UsageError
from freqid.core.identification import Identification
from freqid.core.results.design import MultisineDesign
from freqid.core.vehicle import Vector
from freqid.design.forecast.closed_loop import ClosedLoop
from freqid.design.forecast.experiment import refuse_unidentified
from freqid.design.forecast.standard_errors import Forecast, forecast


def shortest(
    design: MultisineDesign,
    loop: ClosedLoop,
    settings: Identification,
    noise: Mapping[str, float],
    wanted: Mapping[str, Mapping[str, float]],
    *,
    longest_s: float = 600.0,
    accelerometer_m: Vector | None = None,
) -> Forecast:
    """Find the fewest periods of a design that reach wanted standard errors.

    Parameters
    ----------
    design, loop, settings, noise, accelerometer_m
        As for `forecast`; the design's own number of periods does not matter.
    wanted : mapping of str to mapping of str to float
        Highest standard error by response and regressor, unit of the parameter.
    longest_s : float
        Longest manoeuvre that may be flown, s.

    Returns
    -------
    Forecast
        Of the shortest manoeuvre, whose design says its periods and duration.

    Raises
    ------
    UsageError
        Where the longest manoeuvre does not reach them: which parameter is worst, and what it reaches.
    """
    refuse_unidentified(settings, wanted)
    if not 0 < longest_s < inf:
        raise UsageError(f"the longest manoeuvre is {longest_s:g} s, expected a positive time")
    most = int(longest_s / design.period_s + 1e-9)
    if most < 1:
        raise UsageError(
            f"one period lasts {design.period_s:g} s, longer than the {longest_s:g} s allowed",
            remedy="allow a longer manoeuvre or shorten period_s",
        )

    def flown(periods: int) -> Forecast:
        longer = replace(design, periods=periods)
        return forecast(longer, loop, settings, noise, accelerometer_m=accelerometer_m)

    def worst(result: Forecast) -> tuple[float, str, str]:
        return max(
            (result[r].std_error[result[r].regressors.index(j)] / error, r, j)
            for r, row in wanted.items()
            for j, error in row.items()
        )

    if not any(wanted.values()):
        return flown(1)
    ratio, response, regressor = worst(flown(most))
    if ratio > 1:
        error = wanted[response][regressor]
        raise UsageError(
            f"a standard error of {error:.4g} of '{regressor}' in '{response}' is out of reach: "
            f"{most} periods, {most * design.period_s:g} s, reach {ratio * error:.4g}, the nearest feasible",
            remedy=f"accept that, allow about {most * design.period_s * ratio**2:.4g} s, or raise amplitudes",
        )
    # The standard error falls with every period, so the first that suffices is found by halving.
    return flown(1 + bisect_left(range(1, most), True, key=lambda n: worst(flown(n))[0] <= 1))

"""The condition that was flown, and how far it is from the one that was stated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.scenario import Reference
from freqid.identify.loads.explanatory import history

# A stated condition that is further off than this changes forces by some per cent, more than a model's
# standard errors. Dynamic pressure goes with the square of speed: 5 % of it are 10 %; a slow flight is
# allowed what air data are usually wrong by.
SPEED_SHARE, LEAST_SPEED = 0.05, 0.5
DENSITY_SHARE = 0.02
TILT = np.radians(2.0)  # turns 3.5 % of a wing's thrust and lift into the other axis


def flown_reference(maneuvers: Sequence[Maneuver]) -> Reference:
    """Return the condition that was flown, from the means of what the records hold; nan where they do not."""
    vehicle = maneuvers[0].vehicle
    tilts = [_mean(maneuvers, wing.tilt) for wing in vehicle.wings] + [0.0, 0.0]
    return Reference(
        id=maneuvers[0].record.reference or "flown",
        u=_mean(maneuvers, "u"),
        rho=_mean(maneuvers, "rho"),
        dw1=tilts[0],
        dw2=tilts[1],
    )


def departures(stated: Reference, flown: Reference) -> tuple[str, ...]:
    """Say where a stated condition is not the one that was flown, one sentence for each quantity.

    Parameters
    ----------
    stated, flown : Reference
        What the flown one does not know, nan, is not compared.
    """
    degree = np.degrees(1.0)
    rows = [
        ("forward speed u", "m/s", 1.0, stated.u, flown.u, max(LEAST_SPEED, SPEED_SHARE * abs(stated.u))),
        ("air density rho", "kg/m3", 1.0, stated.rho, flown.rho, DENSITY_SHARE * stated.rho),
        ("front wing tilt dw1", "deg", degree, stated.dw1, flown.dw1, TILT),
        ("rear wing tilt dw2", "deg", degree, stated.dw2, flown.dw2, TILT),
    ]
    return tuple(
        f"reference '{stated.id}' states {what} = {factor * said:.4g} {unit}, but the mean flown is "
        f"{factor * was:.4g}, off by {factor * abs(was - said):.3g} where {factor * bound:.2g} is allowed; "
        "the model holds where it was flown."
        for what, unit, factor, said, was, bound in rows
        if abs(was - said) > bound
    )


def _mean(maneuvers: Sequence[Maneuver], name: str) -> float:
    try:
        values = [np.mean(history(m, name)) for m in maneuvers]
    except DataError:
        return float("nan")
    return float(np.average(values, weights=[m.record.duration for m in maneuvers]))

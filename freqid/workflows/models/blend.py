"""Point models become one global model, and models predict flights that they were not made from."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.blend.predict import replay
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.core.toml import overridden
from freqid.identify import point
from freqid.identify.model.problem import measured_responses
from freqid.workflows.inputs import (
    File,
    Flight,
    identification_of,
    maneuver_of,
    names_of,
    point_of,
    scenario_of,
    several,
)


@on_one_thread
def blend(
    points: PointModel | File | Iterable[PointModel | File],
    *,
    densities: Literal["apart", "together"] = "apart",
    along: str = "",
) -> GlobalModel:
    """Blend point models into one model over the transition corridor.

    Parameters
    ----------
    points : PointModel or path, several
        Of one aircraft, at two conditions or more.
    densities : {"apart", "together"}
        A line for each air density, or all points on one line in equivalent speed.
    along : str
        What the lines run along: ``u``, or a variable that the references set, such as a flap's angle.
        Where empty, speed, or if all points have the same, the first of these that varies.

    Returns
    -------
    GlobalModel
        ``model.wrench(u=30.0, de1=0.05)`` gives the responses there, N and N m (or as the points' form has
        it), with standard errors; what is not given is at the corridor's own trim.

    Raises
    ------
    UsageError
        Where points do not fit each other, or there are too few.
    DataError
        Where a file is no intact point model.

    Notes
    -----
    Shape-preserving cubics of equivalent speed on every line, linear in density between lines
    (docs/theory/global-model.md).

    Examples
    --------
    >>> aircraft = blend(["points/u20.h5", "points/u45.h5"])  # doctest: +SKIP
    >>> aircraft.wrench(u=10.0, de1=0.05)  # doctest: +SKIP
    """
    given = several(points)
    read = [point_of(one) for one in given]
    names = [
        str(g) if isinstance(g, str | Path) else r.reference.id for g, r in zip(given, read, strict=True)
    ]
    return GlobalModel(line_up(read, names, densities, along))


def predict(
    model: PointModel | GlobalModel,
    flight: Flight,
    scenario: Scenario | File | None = None,
    *,
    responses: Sequence[str] = (),
    outside: Literal["refuse", "hold"] = "refuse",
) -> dict[str, Fit]:
    """Predict the responses of a flight that a model was not made from.

    Parameters
    ----------
    model : PointModel or GlobalModel
    flight : FlightRecord, Maneuver or path
    scenario : Scenario, path or name, optional
        Describes the vehicle. A point model needs its ``[identification]``, which says how responses are had
        from the record; of a global model they are made from the motion without it.
    responses : sequence of str
        All of the model where empty.
    outside : {"refuse", "hold"}
        What a global model does where the flight leaves the corridor.

    Returns
    -------
    dict of str to Fit
        By response: history as measured and as predicted, N and N m or as the model's form has it. A point
        model's is about its own mean; it says how loads change about a trim, not what another's trim was.

    Raises
    ------
    DataError
        Where the record cannot be read, lacks a channel, or leaves the corridor and that is refused.
    UsageError
        Where a point model comes without a scenario that identifies anything.

    Warns
    -----
    UserWarning
        Where the model was made from this very flight: then nothing is validated.

    Examples
    --------
    >>> fits = predict(model, other, scenario)
    >>> sorted(fits) == sorted(model.responses)
    True
    """
    described = scenario_of(scenario) if scenario is not None else None
    try:
        maneuver = maneuver_of(flight, described)
        source = model.corridor.provenance if isinstance(model, GlobalModel) else model.provenance
        if maneuver.record.fingerprint in json.dumps(source, default=str):
            text = f"{names_of([flight])[0]} is predicted by a model that was made from it"
            warnings.warn(f"{text}, which validates nothing", stacklevel=2)
        if isinstance(model, GlobalModel):
            settings = described.identification if described is not None else None
            recorded = settings is not None and settings.response_source == "record"
            measured = measured_responses(maneuver, settings) if settings is not None and recorded else None
            fits = replay(model, maneuver, measured=measured, outside=outside)
            return {name: fit for name, fit in fits.items() if name in (responses or fits)}
        if described is None:
            raise UsageError(
                "a point model predicts with the settings that it was identified with",
                remedy="give the scenario",
            )
        settings = overridden(
            identification_of(described),
            responses=tuple(responses or model.responses),
            method=model.method,
            form=model.form,
            axes=model.axes,
        )
        return point.predict_responses(model, maneuver, settings)
    except DataError as error:
        raise error.at(names_of([flight])[0]) from None

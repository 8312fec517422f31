"""A model predicts a flight that it was not made from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from freqid.blend.global_model import GlobalModel
from freqid.blend.predict import replay
from freqid.core.errors import DataError, UsageError
from freqid.core.results.point import Fit, PointModel
from freqid.core.scenario import Scenario
from freqid.core.toml import overridden
from freqid.identify import point
from freqid.workflows.inputs import File, Flight, identification_of, maneuver_of, names_of, scenario_of


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
        from the record.
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

    Examples
    --------
    >>> fits = predict(model, flight, scenario)
    >>> sorted(fits) == sorted(model.responses)
    True
    """
    described = scenario_of(scenario) if scenario is not None else None
    try:
        maneuver = maneuver_of(flight, described)
        if isinstance(model, GlobalModel):
            fits = replay(model, maneuver, outside=outside)
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
        return point.predict(model, maneuver, settings)
    except DataError as error:
        raise error.at(names_of([flight])[0]) from None

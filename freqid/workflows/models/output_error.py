"""Flights become the parameters of a dynamic model, by output error or filter error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import msgspec

from freqid import __version__
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import Maneuver
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import MAXIMUM_LIKELIHOOD, Identification
from freqid.core.toml import overridden
from freqid.identify.output_error.estimate import Settings, estimate
from freqid.identify.output_error.forms.form import parted
from freqid.identify.output_error.model import DynamicModel
from freqid.identify.output_error.parameters import Choices, Initial, Tie
from freqid.identify.output_error.point_model import (
    account_of,
    parameter_units,
    point_model,
    ready_model,
)
from freqid.identify.output_error.signals import signals_of
from freqid.identify.point import lines_of
from freqid.workflows.inputs import (
    File,
    Flight,
    identification_of,
    names_of,
    scenario_of,
    several,
    source_of,
)
from freqid.workflows.models.identify import Names, TimeSpan, flown_maneuvers


@on_one_thread
def identify_output_error(
    flights: Flight | Iterable[Flight],
    scenario: Scenario | File | None = None,
    *,
    model: DynamicModel | None = None,
    method: Literal["output-error", "filter-error"] = "output-error",
    domain: Literal["time", "frequency"] = "time",
    at: str = "",
    cut: TimeSpan | Sequence[TimeSpan] = (),
    channels: Mapping[str, str] | None = None,
    outputs: Sequence[str] | None = None,
    responses: Sequence[str] | None = None,
    regressors: Names | None = None,
    form: Literal["force", "specific", "coefficient"] | None = None,
    start: Mapping[str, float] | None = None,
    fixed: Mapping[str, float] | None = None,
    tied: Mapping[str, Tie] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    initial: Initial = "estimated",
    noise: Literal["diagonal", "full"] = "diagonal",
    residuals: Literal["coloured", "white"] = "coloured",
    process_noise: Sequence[str] | None = None,
    frequencies_hz: Sequence[float] | None = None,
    trend: Literal["endpoints", "line", "mean", "none"] = "endpoints",
    confidence: float | None = None,
) -> OutputErrorModel:
    """Estimate the parameters of a dynamic model whose outputs are nearest to the measured ones.

    Parameters
    ----------
    flights : FlightRecord, Maneuver or path, or several
        Several make one model; each has its own initial states and biases.
    scenario : Scenario, path or name, optional
        Its ``[identification]`` names responses and regressors of a ready model. Not needed with `model`
        where the records describe their vehicle.
    model : DynamicModel, optional
        Any other model, as a pure function.
    method : {"output-error", "filter-error"}
        Noise in the outputs alone, or in the motion too, as turbulence is.
    domain : {"time", "frequency"}
        Lines of the band, for linear models and delays.
    at : str
        Id of the reference condition; the records' own where empty.
    cut : (start, stop), or one for each flight
        Stretches that are used, s on the record's clock.
    channels : mapping of str to str, optional
        Channels of the record by the model's names, where these are others.
    outputs : sequence of str, optional
        What a ready model is compared with; all that were recorded where absent.
    responses, regressors, form
        In place of the scenario's.
    start, fixed : mapping of str to float, optional
        Starts (equation error otherwise), and parameters that are not estimated. A ready model's are named
        ``M_de``, ``M_bias``.
    tied : mapping of str to str or (str, float), optional
        Parameters that equal another, or a factor times it.
    bounds : mapping of str to (float, float), optional
    initial : {"estimated", "measured", "zero"}
        Initial states.
    noise : {"diagonal", "full"}
        Covariance of the outputs' noise, in time by output error.
    residuals : {"coloured", "white"}
        What the standard errors allow residuals to be.
    process_noise : sequence of str, optional
        States that process noise drives, by filter error; all where absent.
    frequencies_hz : sequence of float, optional
        Lines of the frequency domain; the scenario's where absent.
    trend : {"endpoints", "line", "mean", "none"}
        What is removed before a transform.
    confidence : float, optional
        Of the intervals; the scenario's where absent, or 0.95.

    Returns
    -------
    OutputErrorModel
        ``found["M_de"]`` is an estimate with its standard error; ``found.valid`` says whether the residuals
        are white, ``found.remarks`` what a reader should know. With a ready model ``found.point`` is the same
        as a point model.

    Raises
    ------
    UsageError
        Where options do not fit, or a state that is not measured leaves a parameter without a start.
    DataError
        Where a record cannot be read, or lacks a channel.

    Notes
    -----
    Maximum likelihood (Klein & Morelli, 2nd ed., ch. 6; docs/theory/output-error.md).

    Examples
    --------
    >>> found = identify_output_error(flight, scenario, responses=("X", "Z", "M"))
    >>> round(found["M_de"][0]), found.valid
    (-42, False)
    """
    if method not in MAXIMUM_LIKELIHOOD:
        raise UsageError(f"method is '{method}'", remedy=nearest(method, MAXIMUM_LIKELIHOOD))
    described = scenario_of(scenario) if scenario is not None else None
    given = several(flights)
    flown = flown_maneuvers(given, described, at, cut)
    described = described.at(flown.reference) if described is not None else None
    identification = None
    if model is None:
        if described is None:
            raise UsageError(
                "neither a model nor a scenario is given", remedy="give one that says what is identified"
            )
        identification = overridden(
            identification_of(described),
            responses=None if responses is None else tuple(responses),
            regressors=regressors
            if regressors is None or isinstance(regressors, Mapping)
            else tuple(regressors),
            form=form,
        )
    if (
        domain == "frequency"
        and frequencies_hz is None
        and described is not None
        and described.identification
    ):
        frequencies_hz = lines_of(described.identification, described.at(flown.reference).excitation).tolist()
    stated = described.identification if described is not None else None
    settings = Settings(
        method,
        domain,
        noise,
        residuals,
        confidence or (stated.confidence if stated else 0.95),
        tuple(frequencies_hz) if frequencies_hz is not None else None,
        trend,
        tuple(process_noise) if process_noise is not None else None,
    )
    choices = Choices(start, fixed, tied, bounds, initial)
    reference = described.reference_of(flown.reference) if described and flown.reference else None
    try:
        if identification is not None:
            result = _ready(
                flown.maneuvers,
                identification,
                settings,
                choices,
                reference,
                outputs,
                _highest(identification, described.at(flown.reference).excitation if described else None),
            )
        else:
            assert model is not None
            each = zip(flown.maneuvers, flown.names, strict=True)
            result = estimate(model, [signals_of(m, model, channels, n) for m, n in each], choices, settings)
    except DataError as error:
        raise error.at(" and ".join(names_of(given))) from None
    sources = {**flown.sources(), "scenario": source_of(described), "freqid_version": __version__}
    point = result.point
    if point is not None:
        point = replace(point, provenance={**sources, "output_error": {result.model: account_of(result)}})
    return replace(result, provenance=sources, point=point)


def ready_point(
    maneuvers: Sequence[Maneuver],
    identification: Identification,
    reference: Reference | None,
    excitation: Excitation | None,
) -> PointModel:
    """Return the point model of ready forms, by the method of an identification.

    Longitudinal and lateral responses are identified one after the other, each with the other's motion as an
    input where it is a regressor.

    Raises
    ------
    UsageError, DataError
        As `identify_output_error`.
    """
    assert identification.method in MAXIMUM_LIKELIHOOD
    residuals: Literal["white", "coloured"] = "white" if identification.residuals == "white" else "coloured"
    settings = Settings(
        "filter-error" if identification.method == "filter-error" else "output-error",
        residuals=residuals,
        confidence=identification.confidence,
    )
    models: list[PointModel] = []
    accounts = {}
    for responses in parted(identification.responses, identification.form):
        part = msgspec.structs.replace(identification, responses=responses)
        result = _ready(maneuvers, part, settings, Choices(), reference, None, _highest(part, excitation))
        assert result.point is not None
        models.append(result.point)
        accounts[result.model] = account_of(result)
    by_response = {name: response for model in models for name, response in model.responses.items()}
    return replace(
        models[0],
        responses={name: by_response[name] for name in identification.responses},
        remarks=tuple(dict.fromkeys(remark for model in models for remark in model.remarks)),
        provenance={**models[0].provenance, "output_error": accounts},
    )


def _ready(
    maneuvers: Sequence[Maneuver],
    identification: Identification,
    settings: Settings,
    choices: Choices,
    reference: Reference | None,
    outputs: Sequence[str] | None,
    highest_hz: float | None,
) -> OutputErrorModel:
    model = ready_model(maneuvers, identification, outputs)
    result = estimate(model, [signals_of(m, model) for m in maneuvers], choices, settings)
    units = parameter_units(maneuvers[0], identification)
    result = replace(result, units=tuple(units.get(n.partition("@")[0], "") for n in result.names))
    return replace(result, point=point_model(result, maneuvers, identification, reference, highest_hz))


def _highest(identification: Identification, excitation: Excitation | None) -> float | None:
    """Return the highest line of an identification, Hz; None where it names none."""
    if identification.frequencies_hz is None and excitation is None:
        return None
    return float(lines_of(identification, excitation)[-1])

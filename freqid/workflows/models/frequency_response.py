"""Flights at one condition become frequency responses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from freqid import __version__
from freqid.blend.global_model import GlobalModel
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.identify.response import frequency_response as estimate
from freqid.workflows.inputs import (
    File,
    Flight,
    flight_of,
    maneuver_of,
    model_of,
    name_of,
    names_of,
    record_of,
    scenario_of,
    several,
    source_of,
)


@on_one_thread
def frequency_response(
    flights: Flight | Iterable[Flight],
    outputs: str | Sequence[str],
    inputs: str | Sequence[str] = (),
    *,
    scenario: Scenario | File | None = None,
    period_s: float | None = None,
    band_hz: tuple[float, float] | None = None,
    order: int = 2,
    poles: int = 0,
    sweeps: bool = False,
    model: PointModel | GlobalModel | File | None = None,
    simulation: Scenario | File | None = None,
    fit: str | Sequence[str] = (),
) -> FrequencyResponse:
    """Estimate frequency responses from flights at one condition, with their random errors.

    Parameters
    ----------
    flights : FlightRecord, Maneuver or path, or several
    outputs : str, or several
        Among X Y Z L M N, a channel as ``state/q``, or a regressor as ``q`` or ``alpha``.
    inputs : str, or several
        Effectors, or ``command/NAME``; all that are excited where empty.
    scenario : Scenario, path or name, optional
        For the vehicle, and the multisines' period.
    period_s : float, optional
        Of the multisines.
    band_hz : tuple of 2 floats, optional
        All lines that are excited where absent.
    order : int
        Of the local polynomials.
    poles : int
        Of a local denominator; 2 where many effectors share the lines and modes lie between them.
    sweeps : bool
        For sweeps, chirps and doublets from rest to rest, one input after the other, in one record or in
        several; without injected signals `inputs` are needed, and feedback biases the responses.
    model : PointModel, GlobalModel or path, optional
        Whose response is put beside the measured one, with the cost J and the share of frequencies inside
        the bounds of maximum unnoticeable added dynamics.
    simulation : Scenario, path or name, optional
        The same of its simulation, linearised at the records' condition.
    fit : str, or several
        ``"1/2"`` fits a transfer function of that order, with a delay, to every pair; ``"state-space"`` the
        ready forms of the scenario's ``[identification]`` to all responses together.

    Returns
    -------
    FrequencyResponse
        Values of shape (output, input, frequency), output unit per input unit; ``compared`` and ``fits``.

    Raises
    ------
    UsageError
        Where an input is none that is excited, no period is known, or commands are compared with models,
        whose inputs are positions.
    DataError
        Where a record cannot be read, lacks a channel or does not fit the others, or a fit is not found.

    Notes
    -----
    With the injected signals as instruments feedback does not bias the responses
    (docs/theory/frequency-response.md).

    Examples
    --------
    >>> response = frequency_response(flight, "q", "de", scenario=scenario)
    >>> response.value.shape[:2]
    (1, 1)
    """
    described = scenario_of(scenario) if scenario is not None else None
    given = several(flights)
    names = names_of(given)
    wanted, driven = (([x] if isinstance(x, str) else list(x)) for x in (outputs, inputs))
    read = [flight_of(flight) for flight in given]
    if period_s is None and described is not None and described.excitation is not None:
        there = described.at(record_of(read[0]).reference).excitation if read else None
        period_s = (there or described.excitation).period_s
    try:
        maneuvers = [maneuver_of(flight, described) for flight in read]
        if sweeps:
            found = estimate.estimate_swept_response(
                maneuvers, driven or None, wanted, band_hz=band_hz, order=order
            )
        else:
            found = estimate.estimate_frequency_response(
                maneuvers,
                driven or None,
                wanted,
                period_s=period_s,
                band_hz=band_hz,
                order=order,
                poles=poles,
            )
        if model is not None or simulation is not None or fit:
            found = _beside(found, maneuvers, described, model, simulation, fit, driven)
    except DataError as error:
        raise (error if error.where else error.at(" and ".join(names))) from None
    provenance = {
        "records": names,
        "vehicle": maneuvers[0].vehicle.name,
        "scenario": source_of(described),
        "order": order,
        "poles": poles,
        "freqid_version": __version__,
    }
    return replace(found, provenance=provenance)


def _beside(
    found: FrequencyResponse,
    maneuvers: Sequence[Maneuver],
    described: Scenario | None,
    model: PointModel | GlobalModel | File | None,
    simulation: Scenario | File | None,
    fit: str | Sequence[str],
    driven: Sequence[str],
) -> FrequencyResponse:
    """Add models, simulations and fits."""
    from freqid.workflows.models import response_comparison as beside

    commands = any(n.startswith("command/") for n in driven) or not all(
        f"effector/{n}" in maneuvers[0].record for n in found.inputs
    )
    if commands and (model is not None or simulation is not None):
        raise UsageError(
            "responses to commands cannot be compared, as inputs of models are positions",
            remedy="ask for effectors, whose positions were logged",
        )
    at = maneuvers[0].record.reference
    if model is not None:
        read, source = model_of(model)
        where = described or (scenario_of(simulation) if simulation is not None else None)
        reference = where.reference_of(at) if where is not None and at else None
        found = beside.compared_with_model(found, read, source, maneuvers, reference)
    if simulation is not None:
        simulated = scenario_of(simulation)
        found = beside.compared_with_simulation(found, simulated, name_of(simulated), at)
    if fit:
        words = [fit] if isinstance(fit, str) else list(fit)
        found = beside.fitted(found, words, maneuvers, described, None)
    return found

"""Flights at one condition become frequency responses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from freqid import __version__
from freqid.core.errors import DataError
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.scenario import Scenario
from freqid.identify.response import frequency_response as estimate
from freqid.workflows.inputs import (
    File,
    Flight,
    flight_of,
    maneuver_of,
    names_of,
    record_of,
    scenario_of,
    several,
    source_of,
)


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

    Returns
    -------
    FrequencyResponse
        Values of shape (output, input, frequency), output unit per input unit.

    Raises
    ------
    UsageError
        Where an input is none that is excited, or no period is known.
    DataError
        Where a record cannot be read, lacks a channel or does not fit the others.

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
    except DataError as error:
        raise error.at(" and ".join(names)) from None
    provenance = {
        "records": names,
        "vehicle": maneuvers[0].vehicle.name,
        "scenario": source_of(described),
        "order": order,
        "poles": poles,
        "freqid_version": __version__,
    }
    return replace(found, provenance=provenance)

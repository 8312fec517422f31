"""Flights at one condition become frequency responses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from freqid import __version__
from freqid.core.channels import RESPONSE
from freqid.core.errors import DataError, UsageError
from freqid.core.record import Maneuver
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.scenario import Scenario
from freqid.identify.loads.explanatory import unit_of
from freqid.identify.response import frequency_response as estimate
from freqid.identify.response.frequency_response import window_response
from freqid.identify.response.injected_lines import output_history
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

_LINES = 60  # of a response by windows


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
    windows: bool = False,
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
    windows : bool
        For sweeps and doublets: one input and one output by overlapped windows; needs `band_hz`.

    Returns
    -------
    FrequencyResponse
        Values of shape (output, input, frequency), output unit per input unit.

    Raises
    ------
    UsageError
        Where windows are asked for without one input, one output and a band, or no period is known.
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
        if windows:
            if len(driven) != 1 or len(wanted) != 1 or band_hz is None:
                raise UsageError("--windows needs one --input, one --output and --band")
            found = _by_windows(maneuvers, driven[0], wanted[0], band_hz)
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


def _by_windows(
    maneuvers: Sequence[Maneuver], input_: str, output: str, band_hz: tuple[float, float]
) -> FrequencyResponse:
    """Return the response to one input, with the injected signal as instrument where all records have it."""
    path = input_ if "/" in input_ else f"effector/{input_}"
    injected_path = f"excitation/{path.rpartition('/')[2]}"
    dt = maneuvers[0].record.dt
    if any(abs(m.record.dt - dt) > 1e-6 * dt for m in maneuvers):
        raise DataError("the records have different sampling rates", remedy="import them with --resample")
    outputs, injected = [], []
    for m in maneuvers:
        direct, momentum = output_history(m, output)
        outputs.append(direct + np.gradient(momentum, m.record.dt) if momentum.any() else direct)
        if injected_path in m.record:
            injected.append(m.record[injected_path])
    return window_response(
        [m.record[path] for m in maneuvers],
        outputs,
        dt,
        np.geomspace(*band_hz, _LINES),
        injected=injected if len(injected) == len(maneuvers) else None,
        names=(input_, output),
        units=(maneuvers[0].record.channel(path).unit, _unit(maneuvers[0], output)),
    )


def _unit(maneuver: Maneuver, output: str) -> str:
    if output in RESPONSE:
        return RESPONSE[output][0]
    return maneuver.record.channel(output).unit if "/" in output else unit_of(maneuver, output)

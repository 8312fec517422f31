"""Which of two simulations is nearer to the flights, where, and whether the flights can tell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from freqid import __version__
from freqid.compare.two_simulations import compare_two
from freqid.core.blas import on_one_thread
from freqid.core.errors import UsageError
from freqid.core.record import Maneuver
from freqid.core.results.rivals import Rivals
from freqid.core.scenario import Scenario
from freqid.gap import flights as gap_flights
from freqid.gap.bookkeeping.check import check
from freqid.workflows import diagnose
from freqid.workflows.connect import Connected, connect, resolve_simulation
from freqid.workflows.inputs import File, Flight, Tell, names_of, record_of, several, silent, source_of


def pair_of(
    sims: Sequence[Connected], predictions: Sequence[File], held_out: Sequence[Flight], effects: Sequence[str]
) -> tuple[Connected, Connected] | None:
    """Return the two simulations where two are given, and None for one.

    Raises
    ------
    UsageError
        For more than two, and for what is asked of one simulation alone.
    """
    pair = [*sims, *([connect(predictions=predictions)] if predictions else [])]
    if len(pair) < 2:
        return None
    if len(pair) > 2:
        raise UsageError(f"{len(pair)} simulations are given", remedy="compare two at a time")
    if held_out:
        raise UsageError(
            "--holdout is for closures, and two simulations are compared as they are",
            remedy="name all flights as records",
        )
    if effects:
        raise UsageError(
            "--effect is for one simulation, and two are given",
            remedy="diagnose each by itself with --effect",
        )
    return pair[0], pair[1]


@on_one_thread
def compare_simulations(
    first: Connected,
    second: Connected,
    flights: Flight | Iterable[Flight],
    *,
    scenario: Scenario | File | None = None,
    own_effects: File | None = None,
    band_hz: tuple[float, float] | None = None,
    tolerances: Mapping[str, float] | None = None,
    level: float = 0.02,
    seed: int = 0,
    tell: Tell = silent,
) -> Rivals:
    """Say which of two simulations is nearer to the flights, where, and whether that is beyond noise.

    Parameters
    ----------
    first, second : ConnectedSimulation, callable or str
        A and B, as `connect` takes or returns them.
    flights : FlightRecord, Maneuver or path, or several
    scenario : Scenario, path or name, optional
        Vehicle, tolerances and band; the one that a simulation was connected with where absent.
    own_effects : path, optional
        Python file with effects of your own, whose tolerances count.
    band_hz : tuple of 2 floats, optional
        The scenario's, else what the injected signals drive.
    tolerances : mapping of str to float, optional
        One sigma by name of what is no difference, over the scenario's.
    level : float
        How often equal simulations would be told apart anywhere.
    seed : int
        Of the draws.
    tell : callable
        Told what is being done.

    Returns
    -------
    Rivals
        Its ``verdict`` is one line, ``nearer`` is ``"A"``, ``"B"``, ``"both"`` or empty.

    Raises
    ------
    UsageError
        Where a flight is given twice or the simulations have no response in common.
    DataError
        Where flights and simulations do not fit together.

    Notes
    -----
    docs/two-simulations.md.

    Examples
    --------
    >>> compare_simulations("model.py:a", "model.py:b", ["flight.h5"]).nearer  # doctest: +SKIP
    'B'
    """
    given = several(flights)
    diagnose.refuse_twice(given, ())
    candidates = diagnose.effects_with(own_effects)
    described = diagnose.described_by(scenario, [first, second])
    sigmas = {**(described.tolerance if described else {}), **(tolerances or {})}
    records = [record_of(flight) for flight in given]
    names = names_of(given)
    pair = tuple(resolve_simulation(one, scenario=described, record=records[0])[0] for one in (first, second))
    stated = described.aircraft() if described else None
    remarks: list[str] = []
    every: list[Maneuver] = []
    for label, simulation in zip("AB", pair, strict=True):
        vehicle = gap_flights.vehicle_of(records, next((s for s in pair if s.vehicle), simulation), stated)
        found = gap_flights.maneuvers(records, names, simulation, vehicle)
        if not every or simulation.kind == "scenario":  # of which velocities are made where they are missing
            every = found
        tell(f"looking for mistakes of bookkeeping in {label}")
        faults = check(simulation, [m.record for m in found], vehicle)
        remarks += [f"{label}: bookkeeping, not physics: {f.sentence}; {f.remedy}" for f in faults]
        remarks += [f"{label}: {said}" for said in gap_flights.differing(found, simulation)]
    band = band_hz or diagnose.band_of(described) or gap_flights.injected_band(records)
    compared = compare_two(
        (pair[0], pair[1]), every, names, candidates, sigmas, band, level=level, seed=seed, tell=tell
    )
    provenance = {
        "A": {"simulation": pair[0].name, "kind": pair[0].kind},
        "B": {"simulation": pair[1].name, "kind": pair[1].kind},
        "records": names,
        "scenario": source_of(described),
        "effects": str(own_effects or ""),
        "band_hz": list(band),
        "level": level,
        "seed": seed,
        "tolerances": dict(sigmas),
        "freqid_version": __version__,
    }
    return replace(compared, remarks=(*remarks, *compared.remarks), provenance=provenance)

"""The owner's simulation of an aircraft, identified from flights other than those that are judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from records import Flight

from freqid.core.record import Maneuver
from freqid.core.sections.identification import FrequencyGrid, Identification
from freqid.identify.point import identify_point, predict_responses

RELATIVE = 0.08  # one sigma of a derivative that its owner states, as a fraction
LOADS = {"CX": "X", "CY": "Y", "CZ": "Z", "Cl": "L", "Cm": "M", "Cn": "N"}
# Absolute floors by coefficient and kind of regressor: what a derivative matters less than.
FLOORS = {
    "CX": {"angle": 0.03, "rate": 0.3, "surface": 0.01, "0": 0.004},
    "CY": {"angle": 0.03, "rate": 0.05, "surface": 0.02, "0": 0.004},
    "CZ": {"angle": 0.15, "rate": 2.0, "surface": 0.03, "0": 0.01},
    "Cl": {"angle": 0.005, "rate": 0.02, "surface": 0.004, "0": 0.0005},
    "Cm": {"angle": 0.02, "rate": 0.5, "surface": 0.02, "0": 0.003},
    "Cn": {"angle": 0.004, "rate": 0.015, "surface": 0.003, "0": 0.0005},
}


@dataclass(frozen=True)
class Shape:
    """What an aircraft's simulation consists of.

    Attributes
    ----------
    regressors : mapping of str to tuple of str
        By coefficient; a constant is always added.
    responses : tuple of str
        Coefficients that the simulation gives; the others serve its own flight.
    band_hz : tuple of 2 floats
        Of the identification and of the diagnosis.
    fly : str
        ``"lateral"``, ``"longitudinal"``, or empty where the simulation cannot fly.
    """

    regressors: Mapping[str, tuple[str, ...]]
    responses: tuple[str, ...]
    band_hz: tuple[float, float]
    fly: str = ""

    def lines(self, duration: float) -> FrequencyGrid:
        """Return lines a little closer than the record tells apart."""
        start = max(self.band_hz[0], round(1.05 / duration, 3))
        return FrequencyGrid(start=start, step=round(min(0.1, 0.8 / duration), 3), stop=self.band_hz[1])

    def settings(self, duration: float, coefficients: Sequence[str] | None = None) -> Identification:
        """Return the settings of an equation-error fit of some coefficients, all where none are named."""
        chosen = tuple(coefficients or self.regressors)
        return Identification(
            responses=tuple(LOADS[c] for c in chosen),
            regressors={LOADS[c]: self.regressors[c] for c in chosen},
            form="coefficient",
            frequencies_hz=self.lines(duration),
        )


def _kind(regressor: str) -> str:
    if regressor in ("alpha", "beta", "lagged", "V"):
        return "angle"
    return "0" if regressor == "0" else "rate" if regressor.endswith("hat") else "surface"


def tolerance(coefficient: str, regressor: str, value: float, std_error: float = 0.0) -> float:
    """Return one sigma that an owner would state: 8 %, a floor, and the fit's own standard error."""
    floor = FLOORS[coefficient][_kind(regressor)]
    relative = 0.0 if regressor == "0" else RELATIVE * value
    return float(np.sqrt(relative**2 + floor**2 + std_error**2))


def _maneuvers(flights: Sequence[Flight]) -> list[Maneuver]:
    return [Maneuver.of(f.record) for f in flights]


def identified(
    flights: Sequence[Flight],
    shape: Shape,
    speed_mps: float | None = None,
) -> dict[str, Any]:
    """Identify a simulation by equation error in the frequency domain.

    Parameters
    ----------
    flights : sequence of Flight
        None of those that it is judged on.
    shape : Shape
    speed_mps : float, optional
        Speed that ``V`` is a departure from.

    Returns
    -------
    dict
        Content of ``simulation.json``.
    """
    derivatives: dict[str, dict[str, float]] = {}
    errors: dict[str, dict[str, float]] = {}
    speed = speed_mps or float(np.mean([f.record["air/V"].mean() for f in flights]))
    for coefficient, names in shape.regressors.items():
        shortest = min(f.record.duration for f in flights)
        model = identify_point(_maneuvers(flights), shape.settings(shortest, (coefficient,)))
        row = model.responses[LOADS[coefficient]]
        unit = np.array([speed if n == "V" else 1.0 for n in names])  # the simulation's V is V / speed - 1
        trim = row.trim / unit - np.array([n == "V" for n in names])
        found, error = row.estimate * unit, row.std_error * unit
        derivatives[coefficient] = dict(zip(names, found.tolist(), strict=True))
        errors[coefficient] = dict(zip(names, error.tolist(), strict=True))
        derivatives[coefficient]["0"] = float(row.bias - found @ trim)
        errors[coefficient]["0"] = float(np.hypot(row.bias_std_error, np.linalg.norm(error * trim)))
    about = described(flights[0], shape, derivatives, errors, speed)
    about["identified_from"] = [f.name for f in flights]
    return about


def described(
    flight: Flight,
    shape: Shape,
    derivatives: Mapping[str, Mapping[str, float]],
    errors: Mapping[str, Mapping[str, float]] | None = None,
    speed_mps: float | None = None,
) -> dict[str, Any]:
    """Return the content of ``simulation.json`` for derivatives that are known."""
    vehicle = flight.record.vehicle
    mass = vehicle.mass_properties
    tolerances = {
        f"{c}_{x}": tolerance(c, x, value, (errors or {}).get(c, {}).get(x, 0.0))
        for c, row in derivatives.items()
        for x, value in row.items()
    }
    return {
        "aircraft": vehicle.name,
        "derivatives": {c: dict(row) for c, row in derivatives.items()},
        "tolerances": tolerances,
        "std_errors": {c: dict(row) for c, row in (errors or {}).items()},
        "responses": list(shape.responses),
        "fly": shape.fly,
        "effectors": [e.name for e in vehicle.effectors],
        "mass_kg": mass.mass_kg,
        "inertia": [getattr(mass.inertia, k) for k in ("xx", "yy", "zz", "xz")],
        "area_m2": vehicle.area_m2,
        "span_m": vehicle.span_m,
        "chord_m": vehicle.chord_m,
        "speed_mps": speed_mps or float(flight.record["air/V"].mean()),
    }


def levelled(
    flight: Flight,
    shape: Shape,
    derivatives: Mapping[str, Mapping[str, float]],
    errors: Mapping[str, Mapping[str, float]],
) -> dict[str, Any]:
    """Return a simulation of published derivatives, its constants from the flight that they are of."""
    own = identified([flight], shape)
    pattern = identify_point([Maneuver.of(flight.record)], shape.settings(flight.record.duration))
    rows = {}
    for c, names in shape.regressors.items():
        row = pattern.responses[LOADS[c]]
        value = np.array([derivatives[c][x] for x in names])
        rows[c] = {**derivatives[c], "0": float(row.bias - value @ row.trim)}
        errors = {**errors, c: {**errors[c], "0": own["std_errors"][c]["0"]}}
    about = described(flight, shape, rows, errors)
    about["identified_from"] = [flight.name]
    return about


def quality(model: Mapping[str, Any], flight: Flight, shape: Shape) -> dict[str, float]:
    """Return the coefficient of determination of a simulation on a flight, by coefficient.

    Measured and simulated histories up to the band's upper end, each about its own mean: a trim of
    another flight is no error of form.
    """
    settings = shape.settings(flight.record.duration)
    maneuver = Maneuver.of(flight.record)
    pattern = identify_point([maneuver], settings)
    known = {}
    for c, names in shape.regressors.items():
        row = pattern.responses[LOADS[c]]
        unit = [model["speed_mps"] if x == "V" else 1.0 for x in names]
        value = np.array([model["derivatives"][c][x] for x in names]) / unit
        known[LOADS[c]] = replace(row, estimate=value)
    fits = predict_responses(replace(pattern, responses=known), maneuver, settings)
    found = {}
    for c in shape.regressors:
        measured, simulated = fits[LOADS[c]].measured, fits[LOADS[c]].modelled
        found[c] = float(1 - np.var(measured - simulated) / np.var(measured))
    return found


def departures(model: Mapping[str, Any], flights: Sequence[Flight], shape: Shape) -> dict[str, float]:
    """Return how far the judged flights' own derivatives lie from the simulation's, in sigma.

    Sigma is the stated tolerance and the standard error of the flights' own fit together. A null whose
    simulation is wrong beyond its tolerances would not be one; constants are left out, as trims differ.
    """
    given = replace(shape, regressors={c: shape.regressors[c] for c in shape.responses})
    own = identified(flights, given, speed_mps=model["speed_mps"])
    found = {}
    for c in shape.responses:
        for x in shape.regressors[c]:
            sigma = np.hypot(model["tolerances"][f"{c}_{x}"], own["std_errors"][c][x])
            found[f"{c}_{x}"] = float((own["derivatives"][c][x] - model["derivatives"][c][x]) / sigma)
    return found

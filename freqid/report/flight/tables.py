"""What the page of a simulated flight says in words and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.report.flight.trims import TrimCurve
from freqid.report.kit.effectors import engineering
from freqid.report.kit.findings import Finding, code, finding, listed
from freqid.report.kit.notation import NONE, exact, number, percent, pretty_unit, short, shown_unit

_ROUNDING = 1e-9  # SI
_AT_LIMIT = 1e-4  # of the range: nearer to a limit is at it
_AT_RATE = 0.95  # of the rate limit, which actuators approach but do not reach


@dataclass(frozen=True, eq=False)
class SimulatedFlight:
    """What a page is made from.

    Attributes
    ----------
    scenario : Scenario
    truth : FlightRecord
        What the vehicle truly did; its provenance says how it was simulated.
    thrust : ndarray, shape (rotor, sample)
        N, in the order of the scenario's rotors, at the truth's samples.
    excursions : mapping of str to mapping
        By state: ``largest`` deviation from the start and ``unit``, SI, and where the scenario has an abort
        limit ``limit`` and ``inside``.
    trims : sequence of TrimCurve
    record : str
        File of what was logged.
    design : str
        File of the excitation; empty without one.
    to : str
        Reference condition that was flown to; empty where the first was held.
    diverged : str
        Where and how the flight left all limits; empty where it did not.
    scenario_sha256 : str
    """

    scenario: Scenario
    truth: FlightRecord
    thrust: Array
    excursions: Mapping[str, Mapping[str, Any]]
    trims: tuple[TrimCurve, ...]
    record: str
    design: str = ""
    to: str = ""
    diverged: str = ""
    scenario_sha256: str = ""

    @property
    def how(self) -> Mapping[str, Any]:
        """How it was simulated."""
        return self.truth.provenance.get("simulation", {})

    @property
    def tilt(self) -> dict[str, float]:
        """Wing tilts at the start, rad, by effector."""
        wings = self.scenario.wing
        return {wing.tilt: float(self.truth[f"effector/{wing.tilt}"][0]) for wing in wings}


def flight_findings(flight: SimulatedFlight) -> list[Finding]:
    """Return what to know of a flight first."""
    limited = {name: row for name, row in flight.excursions.items() if "limit" in row}
    beyond = listed(code(name) for name, row in limited.items() if not row["inside"])
    where = f"from {flight.truth.reference} to {flight.to}" if flight.to else f"at {flight.truth.reference}"
    flown = f"Flew {short(flight.truth.duration)} s {where}"
    if flight.diverged:
        findings = [finding("bad", "The flight diverged: {}.", flight.diverged)]
    elif beyond:
        findings = [finding("bad", "{}, beyond the abort limit of {}.", flown, beyond)]
    else:
        findings = [finding("good", "{}.", flown)]
    if limited and not beyond:
        nearest = max(limited, key=lambda name: limited[name]["largest"] / limited[name]["limit"])
        used = limited[nearest]["largest"] / limited[nearest]["limit"]
        text = "All deviations are inside the abort limits; {} comes nearest, to {} of its limit."
        findings.append(finding("good", text, code(nearest), percent(used)))
    stuck = [row["name"] for row in effector_rows(flight) if row["saturated"]]
    if stuck:
        findings.append(
            finding("note", "At a limit for some of the time: {}.", listed(code(n) for n in stuck))
        )
    else:
        findings.append(finding("good", "No effector reached a position or rate limit."))
    text = "This page shows the simulation's truth; what the aircraft logged of it is in {}."
    return [*findings, finding("note", text, code(flight.record))]


def flight_facts(flight: SimulatedFlight) -> list[tuple[str, str]]:
    """Return what was flown, label and text."""
    how, start = flight.how, flight.scenario.reference_of(flight.truth.reference)
    wind = np.linalg.norm(how.get("wind_m_s", (0.0, 0.0))[:2])
    effects = {name: dict(values) for name, values in how.get("effects", {}).items()}
    gusts = effects.pop("turbulence", {}).get("wind_20ft", 0.0)
    strengths = [
        f"{name} {'' if i == 0 else parameter + ' '}{short(value)}"  # the first one is the effect's size
        for name, values in effects.items()
        for i, (parameter, value) in enumerate(values.items())
    ]
    tilts = ", ".join(f"{name} {np.degrees(angle):.1f}°" for name, angle in flight.tilt.items())
    facts = [
        ("From", f"{start.id}: u {short(start.u)} m/s, ρ {short(start.rho)} kg/m³, {tilts}"),
        ("To", flight.to),
        ("Duration", f"{short(flight.truth.duration)} s"),
        ("Excitation", flight.design or "none"),
        ("Control law", "engaged" if how.get("feedback", True) else "off: the trim's commands are held"),
        ("Mean wind", f"{short(float(wind))} m/s" if wind else "none"),
        ("Turbulence", f"{short(gusts)} m/s of wind at 20 ft" if gusts else "none"),
        ("Sensors", f"{how.get('sensors', NONE)}, noise × {short(how.get('noise', 0.0))}"),
        ("Seed", str(how.get("seed", NONE))),
        ("Effects", ", ".join(strengths).replace("_", " ")),
    ]
    return [(label, text) for label, text in facts if text]


def excursion_rows(flight: SimulatedFlight) -> list[dict[str, Any]]:
    """Return the rows of the table of excursions, in engineering units."""
    rows = []
    for name, found in flight.excursions.items():
        unit, factor = shown_unit(f"state/{name}", str(found["unit"]))
        # Of a symmetric flight the lateral motion is rounding alone.
        largest = factor * found["largest"] if found["largest"] > _ROUNDING else 0.0
        limit = factor * found.get("limit", np.nan)
        rows.append(
            {
                "name": name,
                "unit": pretty_unit(unit),
                "largest": exact(largest, number(largest)) if largest else "0",
                "limit": short(limit),
                "used": percent(largest / limit) if largest else short(0 * limit),
                "beyond": not found.get("inside", True),
            }
        )
    return rows


def effector_rows(flight: SimulatedFlight) -> list[dict[str, Any]]:
    """Return the rows of the table of effectors: what was used, and for how long there was no more."""
    rows = []
    for effector in flight.scenario.effector:
        values = flight.truth[f"effector/{effector.name}"]
        low, high = effector.limits
        unit, factor = engineering(effector.unit)
        near = _AT_LIMIT * (high - low)
        at_limit = float(np.mean((values <= low + near) | (values >= high - near)))
        at_rate = np.nan
        if effector.rate_limit is not None:
            rate = np.gradient(values, flight.truth.dt)
            at_rate = float(np.mean(np.abs(rate) >= _AT_RATE * effector.rate_limit))
        rows.append(
            {
                "name": effector.name,
                "unit": pretty_unit(unit),
                "start": number(factor * values[0]),
                "lowest": number(factor * values.min()),
                "highest": number(factor * values.max()),
                "limits": f"{short(factor * low)} to {short(factor * high)}",
                "margin": percent(float(np.minimum(values - low, high - values).min()) / (high - low)),
                "at_limit": percent(at_limit) if at_limit else "0",
                "at_rate": percent(at_rate) if at_rate else "0",
                "saturated": at_limit > 0 or at_rate > 0,
            }
        )
    return rows

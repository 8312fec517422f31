"""One long flight through the trims of a campaign, in place of the aircraft."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan, pi
from pathlib import Path

import numpy as np

from freqid.core.blas import on_one_thread
from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.flightlog.cut import find_maneuvers
from freqid.simulate import trim_sequence
from freqid.simulate.loads.coefficients import HIGHEST_ADVANCE_RATIO
from freqid.simulate.maneuver import Conditions, with_effects
from freqid.workflows.design import design_inputs
from freqid.workflows.fly import Design, Effects, SimulatedManeuver, design_samples, effect_settings
from freqid.workflows.inputs import File, name_of, scenario_of


@on_one_thread
def simulate_campaign(
    scenario: Scenario | File,
    design: Design | None = None,
    *,
    sensors: str = "research",
    noise: float = 0.0,
    turbulence: float = 0.0,
    seed: int = 0,
    effects: Effects = (),
    own_effects: File | None = None,
) -> SimulatedManeuver:
    """Fly all trims of ``[campaign]`` in one flight, a manoeuvre at each, and log it.

    Parameters
    ----------
    scenario : Scenario, path or name
        With ``[campaign]``, and ``[control.tecs]`` that holds the trims.
    design : DesignedInputs, MultisineDesign, ClassicDesign, SampledInputs or path, optional
        Flown at every trim; where absent, the multisines of ``[excitation]``, as stated for the condition
        that the campaign starts from.
    sensors, noise, turbulence, seed, effects, own_effects
        As in `simulate`.

    Returns
    -------
    SimulatedManeuver
        Its record is the whole flight; `split_flight` cuts the manoeuvres from it.

    Raises
    ------
    UsageError
        Where a section is missing or at fault, or the start cannot be trimmed.
    DataError
        Where a file cannot be read, or the flight diverges before there is anything to log.

    Examples
    --------
    >>> flight = simulate_campaign("dep6", noise=1.0, turbulence=1.0, seed=1)  # doctest: +SKIP
    >>> len(split_flight(flight.record))  # doctest: +SKIP
    27
    """
    described = scenario_of(scenario)
    if described.campaign is None:
        raise UsageError(
            "the scenario has no [campaign]", where=name_of(described), remedy="add the trims to be flown"
        )
    described = with_effects(described, effect_settings(effects, own_effects))
    if design is None:
        design = design_inputs(described, at=described.campaign_start, seed=0)
    inputs = design_samples(design)
    assert inputs is not None  # a design was given or made
    conditions = Conditions(sensors, noise, turbulence=turbulence, seed=seed)
    flown, loop = trim_sequence.fly_campaign(described, inputs, conditions)
    name = Path(design).name if isinstance(design, str | Path) else ""
    return SimulatedManeuver(described, flown, loop, name)


@dataclass(frozen=True)
class FlownTrim:
    """What a campaign truly was at one manoeuvre, in the mean.

    Attributes
    ----------
    span_s : tuple of 2 floats
        Where it was found in the flight, s.
    speed : float
        Airspeed, m/s.
    climb, alpha : float
        Flight path angle and angle of attack, rad.
    advance_ratio : float
        V over the mean of n D; inf with stopped propellers, nan where no rotor states its diameter.
    """

    span_s: tuple[float, float]
    speed: float
    climb: float
    alpha: float
    advance_ratio: float


def trims_flown(found: SimulatedManeuver) -> tuple[FlownTrim, ...]:
    """Return what each manoeuvre of a campaign truly was; they are found in what was logged."""
    truth = found.truth
    return tuple(_trim_over(truth.cut(*span), span) for span in find_maneuvers(found.record, margin_s=0.0))


def _trim_over(truth: FlightRecord, span: tuple[float, float]) -> FlownTrim:
    speed, height = truth["air/V"], truth["state/alt"]
    climb = np.arcsin((height[-1] - height[0]) / np.trapezoid(speed, truth.time))
    rotors = [r for r in (truth.vehicle.rotors if truth.vehicle else ()) if r.diameter_m]
    tips = [truth[f"effector/{r.name}"].mean() * (r.diameter_m or 0.0) for r in rotors]
    ratio = nan
    if tips:
        turning = float(np.mean(tips)) / (2 * pi)
        ratio = float(speed.mean()) / turning if turning * HIGHEST_ADVANCE_RATIO > speed.mean() else inf
    return FlownTrim(
        span,
        float(speed.mean()),
        float(climb),
        float(truth["air/alpha"].mean()),
        ratio,
    )

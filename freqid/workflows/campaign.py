"""One long flight through the trims of a campaign, in place of the aircraft."""

from __future__ import annotations

from freqid.core.errors import UsageError
from freqid.core.scenario import Scenario
from freqid.simulate import campaign
from freqid.simulate.maneuver import Conditions, with_effects
from freqid.workflows.design import design_inputs
from freqid.workflows.fly import Design, Effects, SimulatedManeuver, effect_settings, samples_of
from freqid.workflows.inputs import File, name_of, scenario_of


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
        Flown at every trim; the multisines of ``[excitation]`` where absent.
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
        design = design_inputs(described, seed=0)
    inputs = samples_of(design)
    assert inputs is not None
    conditions = Conditions(sensors, noise, turbulence=turbulence, seed=seed)
    flown, loop = campaign.fly_campaign(described, inputs, conditions)
    return SimulatedManeuver(described, flown, loop, str(design) if isinstance(design, str) else "")

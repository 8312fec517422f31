"""One long flight through many trims that a total-energy controller holds, with a manoeuvre at each."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.results.design import SampledInputs
from freqid.core.scenario import Scenario
from freqid.core.sections.trim_sequence import Campaign
from freqid.dynamics.precision import doubles
from freqid.simulate.air.atmosphere import air, altitude_of
from freqid.simulate.control.lq import ClosedLoop
from freqid.simulate.control.tecs import Goal, tecs
from freqid.simulate.control.trim import trim
from freqid.simulate.fly import DT, fly, sortie
from freqid.simulate.maneuver import Conditions, Flown, flyable, logged
from freqid.simulate.motion import whole_vehicle as motion


@dataclass(frozen=True)
class Plan:
    """When what is flown.

    Attributes
    ----------
    begins : ndarray, shape (trim,)
        When each trim is commanded, s.
    excited : ndarray, shape (trim, 2)
        Start and end of its excitation, s.
    duration : float
        s.
    """

    begins: Array
    excited: Array
    duration: float


def plan(campaign: Campaign, inputs: SampledInputs) -> Plan:
    """Return when the trims of a campaign are flown, with these inputs at each."""
    length = float(inputs.time[-1] - inputs.time[0])
    each = campaign.settle_s + length + campaign.rest_s
    begins = each * np.arange(len(campaign.trim), dtype=float)
    start = begins + campaign.settle_s
    return Plan(begins, np.stack([start, start + length], axis=1), float(each * len(campaign.trim)))


def fly_campaign(
    scenario: Scenario, inputs: SampledInputs, conditions: Conditions
) -> tuple[Flown, ClosedLoop]:
    """Fly the campaign of a scenario in one flight and log it.

    Parameters
    ----------
    scenario : Scenario
        With ``[campaign]`` and ``[control.tecs]``.
    inputs : SampledInputs
        Flown at every trim.
    conditions : Conditions

    Returns
    -------
    flown : Flown
        Its record is of the whole flight.
    loop : ClosedLoop
        Controller, and the trim of the start.

    Raises
    ------
    UsageError
        Where a section is missing or at fault, or the start cannot be trimmed.
    DataError
        Where the flight diverges before there is anything to log.

    Notes
    -----
    Density is that of the standard atmosphere along the planned climbs.
    """
    campaign = scenario.campaign
    if campaign is None:
        raise UsageError("the scenario has no [campaign]", remedy="add the trims that are to be flown")
    start = scenario.reference_of(scenario.campaign_start)
    scenario, wind = flyable(scenario, conditions)
    parameters = jax.device_put(motion.parameters(scenario))
    at = trim(scenario, parameters, start)
    law = tecs(scenario, parameters.actuators, at)
    times = plan(campaign, inputs)
    whole = repeated(inputs, times)
    loop = ClosedLoop(parameters, {start.id: at}, law)
    base = sortie(
        scenario,
        loop,
        start,
        whole,
        duration=times.duration,
        wind=wind,
        feedback=True,
        seed=conditions.seed,
    )
    steps = base.around.rho.size
    time = DT * np.arange(steps)
    which = np.clip(np.searchsorted(times.begins, time, side="right") - 1, 0, None)
    speed, climb, stopped = (
        np.array([value(one) for one in campaign.trim], dtype=float)[which]
        for value in (lambda t: t.speed, lambda t: t.climb_rad, lambda t: t.rotors == "stopped")
    )
    held = (time >= times.excited[which, 0]) & (time < times.excited[which, 1])
    climbed = np.concatenate([[0.0], np.cumsum(speed * np.sin(climb) * DT)[:-1]])
    level = altitude_of(start.rho)
    ready = base._replace(
        aim=doubles(
            Goal,
            speed=speed,
            climb=climb,
            stopped=stopped,
            held=held,
            wind=np.tile(wind, (steps, 1)),
        ),
        around=base.around._replace(
            rho=air(jnp.asarray(level + climbed)).rho,
            # numpy's array stands for JAX's, as those of `doubles` do
            ground=np.full(steps, level - campaign.altitude_m),  # pyrefly: ignore[bad-argument-type]
        ),
    )
    flight = fly(ready)
    return logged(scenario, flight, inputs.names, "", conditions, wind), loop


def repeated(inputs: SampledInputs, times: Plan) -> SampledInputs:
    """Return inputs flown at every trim of a plan, zero between."""
    step = float(inputs.time[1] - inputs.time[0])
    grid = step * np.arange(round(times.duration / step) + 1, dtype=float)
    values = np.zeros((len(inputs.names), grid.size))
    for first in np.searchsorted(grid, times.excited[:, 0] - step / 2):
        stop = min(first + inputs.time.size, grid.size)
        values[:, first:stop] = inputs.values[:, : stop - first]
    return SampledInputs(inputs.names, inputs.units, grid, values)

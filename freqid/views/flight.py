"""The page of a simulated flight: what the simulation knows, as the plain numbers of a page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from freqid.core.scenario import Reference, Scenario
    from freqid.report.flight.trims import TrimCurve
    from freqid.simulate.control.lq import ClosedLoop
    from freqid.simulate.control.trim import Trim
    from freqid.workflows.fly import SimulatedManeuver


def flight_page(found: SimulatedManeuver, record: str = "") -> str:
    """Return the page of a simulated flight.

    Parameters
    ----------
    found : SimulatedManeuver
        The trims of its loop are drawn, and those of the scenario's other densities.
    record : str
        File of what was logged.
    """
    import numpy as np

    from freqid.report.flight.page import build_simulation_page
    from freqid.report.flight.tables import SimulatedFlight

    scenario, loop = found.scenario, found.loop
    flight = SimulatedFlight(
        scenario=scenario,
        truth=found.truth,
        thrust=np.asarray(found.flown.flight.samples.details.aero.thrust).T,
        excursions=found.excursions,
        trims=tuple(
            _curve(scenario, loop, trims) for trims in (list(loop.trims.values()), *_others(scenario, loop))
        ),
        diverged=found.divergence,
        record=record,
        design=found.design,
        to=found.to,
        scenario_sha256=scenario.sha256,
    )
    return build_simulation_page(flight)


def _others(scenario: Scenario, loop: ClosedLoop) -> list[list[Trim]]:
    """Return trims along the corridors of other densities, without conditions that have none."""
    from freqid.core.errors import UsageError
    from freqid.simulate.control.trim import trim

    flown = next(iter(loop.trims.values())).reference.rho
    others: dict[float, list[Reference]] = {}
    for reference in sorted(scenario.reference, key=lambda r: r.u):
        if reference.rho != flown:
            others.setdefault(reference.rho, []).append(reference)
    found = []
    for along in others.values():
        trims = []
        for reference in along:
            try:
                trims.append(trim(scenario, loop.parameters, reference))
            except UsageError:
                continue
        if trims:
            found.append(trims)
    return found


def _curve(scenario: Scenario, loop: ClosedLoop, trims: Sequence[Trim]) -> TrimCurve:
    import jax
    import numpy as np

    from freqid.report.flight.trims import TrimCurve
    from freqid.simulate.motion.battery import power

    positions = {}
    for kind, values in (
        ("surface", [at.positions.surface for at in trims]),
        ("tilt", [at.positions.tilt for at in trims]),
        ("rotor", [at.positions.speed for at in trims]),
    ):
        names = [effector.name for effector in scenario.effector if effector.kind == kind]
        positions |= dict(zip(names, np.array(values, dtype=float).T, strict=True))
    battery = loop.parameters.actuators.battery
    torque, speed = (
        np.array(rows) for rows in zip(*((at.aero.torque, at.positions.speed) for at in trims), strict=True)
    )
    given = jax.jit(jax.vmap(power, (None, None, 0, 0)))(battery, battery.charge, torque, speed)
    return TrimCurve(
        rho=trims[0].reference.rho,
        u=np.array([at.reference.u for at in trims]),
        pitch=np.array([at.angles[1] for at in trims]),
        positions=positions,
        power=np.asarray(given.voltage) * np.asarray(given.current),
    )

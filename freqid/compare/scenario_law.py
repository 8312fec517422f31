"""A scenario's own control law and simulation, linearised, at the conditions of a model."""

from __future__ import annotations

from functools import cache

import jax
import numpy as np

from freqid.blend.state_space import StateSpace
from freqid.compare.loop_margins import MotionAt, Place
from freqid.compare.scenario_consequence import condition_at, design_law_at
from freqid.core.scenario import Reference, Scenario
from freqid.dynamics.control_law import ControlLaw, LawAt
from freqid.dynamics.small_motion import STATES
from freqid.simulate.control import linearize
from freqid.simulate.control.trim import trim
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import by_kind

_INTEGRATED = {0: "u", 1: "v", 3: "psi"}  # of the law's four integral terms, those that are states of the law
_ALTITUDE = 2  # the one that is measured


def scenario_law(scenario: Scenario) -> LawAt:
    """Return the law that a scenario flies, with its actuators, as a function of the condition.

    Parameters
    ----------
    scenario : Scenario
        Its ``[control]`` is designed anew at every condition that is asked for, as the simulation does at its
        reference conditions. A law by total energy, which a campaign flies, is not this one.
    """

    @cache
    def designed(u: float, rho: float, scheduled: tuple[tuple[str, float], ...]) -> ControlLaw:
        reference = Reference.of("", u, rho, **dict(scheduled))
        loop = condition_at(scenario, reference, {}, design_law_at(scenario, reference, {})).loop
        k, measured = len(linearize.STATES), (*linearize.STATES, "alt")
        integrals = loop.gain[:, k:]
        D = -np.hstack([loop.gain[:, :k], integrals[:, [_ALTITUDE]]])
        kept = [i for i in _INTEGRATED if integrals[:, i].any()]
        B = np.array([[float(_INTEGRATED[i] == n) for n in measured] for i in kept])
        return ControlLaw(
            signals=measured,
            axes=loop.axes,
            effectors=loop.effectors,
            A=np.zeros((len(kept), len(kept))),
            B=B.reshape(len(kept), len(measured)),
            C=-integrals[:, kept],
            D=D,
            allocation=loop.allocation,
            actuation=loop.actuation,
            name=scenario.vehicle.name,
        )

    return lambda u, rho, scheduled: designed(u, rho, tuple(scheduled.items()))


def simulated_motion(scenario: Scenario) -> MotionAt:
    """Return the linearised simulation as a function of the place, wakes in their steady state.

    Parameters
    ----------
    scenario : Scenario

    Notes
    -----
    The returned function raises UsageError where the place cannot be trimmed.
    """
    parameters = jax.device_put(motion.parameters(scenario))
    order = by_kind(scenario.aircraft(), np.arange(len(scenario.effector)))

    def at(place: Place) -> StateSpace:
        reference = Reference.of(place.id, place.u, place.rho, **place.scheduled)
        level = trim(scenario, parameters, reference)
        found = linearize.linearize(scenario, parameters, level)
        positions: dict[str, float] = {}
        for kind in ("surface", "tilt", "speed"):
            values = np.asarray(getattr(level.positions, kind)).tolist()
            names = [found.effectors[int(i)] for i in np.asarray(getattr(order, kind))]
            positions |= dict(zip(names, values, strict=True))
        u, v, w = np.asarray(level.body.velocity).tolist()
        trimmed = positions | {"u": u, "v": v, "w": w, "theta": float(level.angles[1])}
        return StateSpace(STATES, found.effectors, found.A[:8, :8], found.B[:8], trimmed)

    return at

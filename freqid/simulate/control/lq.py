"""The control law's design: linear-quadratic gains with integral action, and control allocation.

References
----------
B. L. Stevens, F. L. Lewis, E. N. Johnson, *Aircraft Control and Simulation*, 3rd ed., Wiley, 2016,
sec. 5.3-5.4 (linear-quadratic regulators, integral action).
A. E. Bryson, Y.-C. Ho, *Applied Optimal Control*, Hemisphere, 1975, sec. 5.2 (weights by deviations
that count alike).
M. W. Oppenheimer, D. B. Doman, M. A. Bolender, "Control Allocation for Over-actuated Systems", 14th
Mediterranean Conference on Control and Automation, 2006 (weighted pseudo-inverse).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from scipy.linalg import solve_continuous_are

from freqid.core.arrays import Array
from freqid.core.channels import WRENCH
from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Reference, Scenario
from freqid.core.toml import convert
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Strict
from freqid.dynamics.precision import doubles
from freqid.simulate.control.law import AXES, Law, Setting
from freqid.simulate.control.linearize import STATES, linearize
from freqid.simulate.control.trim import Trim, trim
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import Commands, Servos, by_kind

_SPEED_SHARE = 0.15  # of the highest speed: a rotor's move that counts like a surface's to its stop
_SLOWEST = 1e-4  # 1/s: what decays more slowly is not held


class LqSection(Strict, frozen=True):
    """Section ``[control.lq]``: deviations that count alike, as in Bryson's rule.

    Attributes
    ----------
    velocity : float
        m/s, of u, v and w.
    rate : float
        rad/s, of p, q and r.
    angle : float
        rad, of phi, theta and psi.
    altitude : float
        m.
    settling_s : float
        Time over which a velocity or a heading that stays off counts like its deviation.
    force : float
        Of X and Z, over the weight.
    moment : float
        Of L, M and N, over the weight times the span.
    axes : tuple of str
        Of the wrench that the effectors can make apart: without Z where no flap makes lift.
    """

    velocity: float = 1.0
    rate: float = 0.5
    angle: float = 0.15
    altitude: float = 1.0
    settling_s: float = 3.0
    force: float = 0.1
    moment: float = 0.02
    axes: tuple[str, ...] = AXES

    def __post_init__(self) -> None:
        for axis in self.axes:
            if axis not in AXES or self.axes.count(axis) > 1:
                raise ValueError(f"axes are {list(self.axes)}, expected some of {' '.join(AXES)}, each once")
        for name in self.__struct_fields__:
            if name != "axes" and not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected a positive number")


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A vehicle with its control law.

    Attributes
    ----------
    parameters : motion.Parameters
    trims : dict of Trim
        By reference id, along one corridor.
    law : Law or Tecs
    """

    parameters: motion.Parameters
    trims: dict[str, Trim]
    law: Any


def close_loop(scenario: Scenario, reference: Reference) -> ClosedLoop:
    """Trim a vehicle along the corridor of a reference condition and design its control law.

    Parameters
    ----------
    scenario : Scenario
        With the effects that act in ``[simulation.effects]``: the law is tuned to the vehicle that flies.
    reference : Reference

    Raises
    ------
    UsageError
        Where the reference cannot be trimmed. Other conditions of the corridor that cannot are left out.
    """
    parameters = jax.device_put(motion.parameters(scenario))
    trims = {}
    for at in corridor(scenario, reference):
        try:
            trims[at.id] = trim(scenario, parameters, at)
        except UsageError:
            if at.id == reference.id:
                raise
    return ClosedLoop(parameters, trims, design_law(scenario, parameters, list(trims.values())))


def corridor(scenario: Scenario, reference: Reference) -> list[Reference]:
    """Return the reference conditions of one density, by increasing speed, the given one among them."""
    along = {at.u: at for at in scenario.reference if at.rho == reference.rho}
    along[reference.u] = reference
    return [along[u] for u in sorted(along)]


def design_law(scenario: Scenario, parameters: motion.Parameters, trims: Sequence[Trim]) -> Law:
    """Design the law at the trims of a corridor.

    Parameters
    ----------
    scenario : Scenario
        With the gains of ``[control.gains]``, by effector and state; or else with the weights in
        ``[control.lq]``, the defaults where that is absent.
    parameters : motion.Parameters
        Of the vehicle as the law's author knows it.
    trims : sequence of Trim
        By increasing speed.

    Returns
    -------
    Law

    Raises
    ------
    UsageError
        Where the section has unknown keys, or at a trim the effectors cannot make the five axes of the
        wrench apart.
    """
    section = _section(scenario)
    vehicle = scenario.aircraft()
    commanded = [e.name for kind in ("surface", "rotor") for e in vehicle.effectors if e.kind == kind]
    stated = stated_gains(scenario, commanded)
    rows = [WRENCH.index(axis) for axis in section.axes]
    order = by_kind(vehicle, np.arange(len(vehicle.effectors)))
    act = parameters.actuators
    span = vehicle.span_m or 1.0
    weight = float(parameters.mass.mass) * STANDARD_GRAVITY
    settings = []
    for at in trims:
        linear = linearize(scenario, parameters, at)
        surface, speed = (linear.wrench[rows][:, 6 + places] for places in (order.surface, order.speed))
        velocity, cut = np.asarray(at.body.velocity), surface.shape[1]
        if stated is None:
            authority = np.concatenate([_range(act.surface), _SPEED_SHARE * np.asarray(act.motor.high)])
            share = _allocation(np.hstack([surface, speed]), authority, at, section.axes)
            drive = linear.B[:, np.concatenate([order.surface, order.speed])] @ share
            gain = _gain(linear.A, drive, velocity, at, section, weight, span)
        else:
            gain, share = -stated, np.eye(len(commanded))
        settings.append(
            doubles(
                Setting,
                at.commands,
                np.concatenate([velocity, np.zeros(3), at.angles, np.zeros(1)]),
                linear.centre,
                gain,
                share[:cut],
                share[cut:],
            )
        )
    return doubles(
        Law,
        u=[at.reference.u for at in trims],
        settings=jax.tree.map(lambda *values: np.stack(values), *settings),
        low=Commands(act.surface.low, act.tilt.low, act.motor.low),
        high=Commands(act.surface.high, act.tilt.high, act.motor.high),
    )


def _range(servos: Servos) -> Array:
    """Return how far servos go to the nearer side."""
    return np.minimum(np.abs(servos.low), np.abs(servos.high))


def _allocation(effect: Array, authority: Array, at: Trim, axes: Sequence[str]) -> Array:
    """Return the least moves, over the authorities, that make each axis, shape (effector, axis)."""
    scaled = effect * authority
    size = np.linalg.norm(scaled, axis=1)
    values = np.linalg.svd(scaled / np.maximum(size, 1e-12)[:, None], compute_uv=False)
    if size.min() == 0 or values[-1] < 1e-3:
        raise UsageError(
            f"the effectors cannot make the axes {' '.join(axes)} of the wrench apart",
            where=f"reference '{at.reference.id}'",
            remedy="name those that they can in [control.lq] axes, without Z where nothing makes lift alone, "
            "or fly another condition",
        )
    return authority[:, None] * np.linalg.pinv(scaled)


def _gain(
    dynamics: Array, drive: Array, velocity: Array, at: Trim, section: LqSection, weight: float, span: float
) -> Array:
    """Return the gain of the linear-quadratic regulator, shape (axis, 13)."""
    (u, _, w), theta = velocity, at.angles[1]
    whole, driven = np.zeros((13, 13)), np.zeros((13, drive.shape[1]))
    whole[:9, :9], driven[:9] = dynamics, drive
    whole[9, 0] = whole[10, 1] = whole[12, 8] = 1.0
    whole[11, [0, 2, 7]] = np.sin(theta), -np.cos(theta), u * np.cos(theta) + w * np.sin(theta)
    s = section
    deviation = np.repeat([s.velocity, s.rate, s.angle], 3)
    drift = s.settling_s * np.array([s.velocity, s.velocity, 0.0, s.angle])
    drift[2] = s.altitude
    effort = weight * np.array([s.force if axis in ("X", "Z") else s.moment * span for axis in s.axes])
    q, r = np.concatenate([deviation, drift]) ** -2, np.diag(effort**2)
    gain = None
    try:
        gain = r @ driven.T @ solve_continuous_are(whole, driven, np.diag(q), np.linalg.inv(r))
        # some builds of LAPACK find a solution where there is none, which leaves what drifts as it is
        holds = np.linalg.eigvals(whole - driven @ gain).real.max() < -_SLOWEST
    except np.linalg.LinAlgError:
        holds = False
    if gain is None or not holds:
        raise UsageError(
            f"no feedback through the axes {' '.join(s.axes)} holds speed, heading and altitude",
            where=f"reference '{at.reference.id}'",
            remedy="add the axis that is missing, X for the speed, or state [control.gains]",
        )
    return gain


def _section(scenario: Scenario) -> LqSection:
    return convert(scenario.control.get("lq", {}), LqSection, "[control.lq]")


def axes_of(scenario: Scenario) -> tuple[str, ...]:
    """Return what the law asks for: axes of the wrench, or with stated gains the effectors themselves."""
    if "gains" in scenario.control:
        kinds = ("surface", "rotor")
        return tuple(e.name for kind in kinds for e in scenario.effector if e.kind == kind)
    return _section(scenario).axes


def stated_gains(scenario: Scenario, commanded: Sequence[str]) -> Array | None:
    """Return ``[control.gains]`` from states and integrals, shape (effector, 13); None where there are none.

    Raises
    ------
    UsageError
        Where an effector or a state is unknown, or a gain is no finite number.
    """
    if "gains" not in scenario.control:
        return None
    table = scenario.control["gains"]
    gain = np.zeros((len(commanded), 13))
    for name, row in (table if isinstance(table, dict) else {}).items():
        where = f"[control.gains] {name}"
        if name not in commanded:
            raise UsageError(f"effector '{name}' is unknown", where=where, remedy=nearest(name, commanded))
        for state, value in row.items() if isinstance(row, dict) else ():
            if state not in STATES:
                raise UsageError(f"state '{state}' is unknown", where=where, remedy=nearest(state, STATES))
            if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
                raise UsageError(f"the gain of {state} is {value!r}", where=where, remedy="give a number")
            gain[commanded.index(name), STATES.index(state)] = value
    return gain

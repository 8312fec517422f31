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

import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import solve_continuous_are

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.scenario import Reference, Scenario
from freqid.core.toml import convert
from freqid.core.units import STANDARD_GRAVITY
from freqid.core.vehicle import Strict
from freqid.simulate.control.law import AXES, Law, Setting
from freqid.simulate.control.linearize import linearize
from freqid.simulate.control.trim import Trim, trim
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import Commands, Servos, by_kind

_ROWS = [0, 2, 3, 4, 5]  # of the wrench: the axes
_SPEED_SHARE = 0.15  # of the highest speed: a rotor's move that counts like a surface's to its stop


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
    """

    velocity: float = 1.0
    rate: float = 0.5
    angle: float = 0.15
    altitude: float = 1.0
    settling_s: float = 3.0
    force: float = 0.1
    moment: float = 0.02

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected a positive number")


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A vehicle with its control law.

    Attributes
    ----------
    parameters : motion.Parameters
    trims : dict of Trim
        By reference id, along one corridor.
    law : Law
    """

    parameters: motion.Parameters
    trims: dict[str, Trim]
    law: Law


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
    parameters = jax.tree.map(jnp.asarray, motion.parameters(scenario))
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
        With the weights in ``[control.lq]``; the defaults where that is absent.
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
    section = convert(scenario.control.get("lq", {}), LqSection, "[control.lq]")
    vehicle = scenario.aircraft()
    order = by_kind(vehicle, np.arange(len(vehicle.effectors)))
    act = parameters.actuators
    span = vehicle.span_m or 1.0
    weight = float(parameters.mass.mass) * STANDARD_GRAVITY
    settings = []
    for at in trims:
        linear = linearize(scenario, parameters, at)
        surface, speed = (linear.wrench[_ROWS][:, 6 + places] for places in (order.surface, order.speed))
        authority = np.concatenate([_range(act.surface), _SPEED_SHARE * np.asarray(act.motor.high)])
        share = _allocation(np.hstack([surface, speed]), authority, at)
        drive = linear.B[:, np.concatenate([order.surface, order.speed])] @ share
        velocity, cut = np.asarray(at.body.velocity), surface.shape[1]
        settings.append(
            Setting(
                at.commands,
                jnp.asarray(np.concatenate([velocity, np.zeros(3), at.angles, np.zeros(1)])),
                jnp.asarray(linear.centre),
                jnp.asarray(_gain(linear.A, drive, velocity, at.angles, section, weight, span)),
                jnp.asarray(share[:cut]),
                jnp.asarray(share[cut:]),
            )
        )
    return Law(
        u=jnp.asarray([at.reference.u for at in trims]),
        settings=jax.tree.map(lambda *values: jnp.asarray(np.stack(values)), *settings),
        low=Commands(act.surface.low, act.tilt.low, act.motor.low),
        high=Commands(act.surface.high, act.tilt.high, act.motor.high),
    )


def _range(servos: Servos) -> Array:
    """Return how far servos go to the nearer side."""
    return np.minimum(np.abs(servos.low), np.abs(servos.high))


def _allocation(effect: Array, authority: Array, at: Trim) -> Array:
    """Return the least moves, over the authorities, that make each axis, shape (effector, axis)."""
    scaled = effect * authority
    size = np.linalg.norm(scaled, axis=1)
    values = np.linalg.svd(scaled / np.maximum(size, 1e-12)[:, None], compute_uv=False)
    if size.min() == 0 or values[-1] < 1e-3:
        raise UsageError(
            f"the effectors cannot make the axes {' '.join(AXES)} of the wrench apart",
            where=f"reference '{at.reference.id}'",
            remedy="check surfaces and rotors of the scenario, or fly another condition",
        )
    return authority[:, None] * np.linalg.pinv(scaled)


def _gain(
    dynamics: Array,
    drive: Array,
    velocity: Array,
    angles: Array,
    section: LqSection,
    weight: float,
    span: float,
) -> Array:
    """Return the gain of the linear-quadratic regulator, shape (axis, 13)."""
    (u, _, w), theta = velocity, angles[1]
    whole, driven = np.zeros((13, 13)), np.zeros((13, len(AXES)))
    whole[:9, :9], driven[:9] = dynamics, drive
    whole[9, 0] = whole[10, 1] = whole[12, 8] = 1.0
    whole[11, [0, 2, 7]] = np.sin(theta), -np.cos(theta), u * np.cos(theta) + w * np.sin(theta)
    s = section
    deviation = np.repeat([s.velocity, s.rate, s.angle], 3)
    drift = s.settling_s * np.array([s.velocity, s.velocity, 0.0, s.angle])
    drift[2] = s.altitude
    effort = weight * np.array([s.force, s.force, *[s.moment * span] * 3])
    q, r = np.concatenate([deviation, drift]) ** -2, np.diag(effort**2)
    return r @ driven.T @ solve_continuous_are(whole, driven, np.diag(q), np.linalg.inv(r))

"""Steady level flight at a reference condition: what every effector has to do for it.

A vehicle with many effectors can be trimmed in many ways. The one taken here has the smallest
deflections, rotor speeds as equal as they can be and a body as level as it can be, subject to all six
equations of equilibrium; nothing is assumed about symmetry.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares, minimize

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.scenario import Reference, Scenario
from freqid.core.units import STANDARD_GRAVITY
from freqid.simulate.air.atmosphere import altitude_of
from freqid.simulate.air.surroundings import Surroundings, calm
from freqid.simulate.loads.quantities import Aero, Positions
from freqid.simulate.motion import whole_vehicle as motion
from freqid.simulate.motion.actuators import Commands
from freqid.simulate.motion.derivatives import HEIGHT, Derivatives, derivatives, split
from freqid.simulate.motion.rigid_body import BodyState

LARGEST_ANGLE = 0.6  # rad, of roll and pitch in a level flight that is worth the name
EQUATIONS = ("forward force", "side force", "vertical force", "roll moment", "pitch moment", "yaw moment")

_BALANCED = 1e-10  # of the weight (times 1 m)
_ANGLE = 0.2  # rad of roll or pitch that weighs like a surface at its limit
_SPREAD = 0.1  # deviation of a rotor from the mean, of the highest speed, that does
_FIRST_SPEEDS = (0.5, 0.35, 0.7)  # of the highest speed, where the search starts
_STEPS = np.array([3.0, 0.1])  # m/s and rad: changes of speed and tilts that count as equally far
_FARTHEST = 40.0  # of these steps, to a condition that can be flown
_SIDE = 0.01  # weight of the effectors' effort beside that distance
_MARGIN = 1.02  # of the way there, so that rounding does not leave it at the edge of what flies

_FOUND: dict[Hashable, Array] = {}
"""Unknowns of trims by all that they depend on: laws, flights and pages ask for the same ones again."""
_KEPT = 1000


@dataclass(frozen=True, eq=False)
class Trim:
    """Steady level flight.

    Attributes
    ----------
    reference : Reference
    angles : ndarray, shape (2,)
        Roll and pitch angle, rad.
    body : BodyState
        At the density's standard altitude, heading north.
    positions : Positions
        Of all effectors.
    commands : Commands
        That hold them there, on a battery as full as the scenario says.
    aero : Aero
    around : Surroundings
        Calm air of the reference's density, `HEIGHT` above ground.
    residual : ndarray, shape (6,)
        Force, N, and moment about the centre of gravity, N m, that is left.
    """

    reference: Reference
    angles: Array
    body: BodyState
    positions: Positions
    commands: Commands
    aero: Aero
    around: Surroundings
    residual: Array


def trim(scenario: Scenario, parameters: motion.Parameters, reference: Reference) -> Trim:
    """Find the controls of steady level flight.

    Parameters
    ----------
    scenario : Scenario
        For the names of the effectors.
    parameters : motion.Parameters
    reference : Reference
        Its `u` is the velocity along the body's x axis; the effectors that it sets are held.

    Returns
    -------
    Trim

    Raises
    ------
    UsageError
        Where no position of the effectors inside their limits balances the vehicle: which equation
        cannot be met and by how much, and the nearest condition that can be flown.
    """
    held = _held(scenario, reference)
    tilts = [reference.scheduled.get(e.name, 0.0) for e in scenario.effector if e.kind == "tilt"]
    condition = np.array([reference.rho, reference.u, *tilts])
    leaves, structure = jax.tree.flatten(parameters)
    asked = structure, *(np.asarray(x).tobytes() for x in (*leaves, held, condition))
    x = _FOUND.get(asked)
    if x is None:
        problem = _Problem(parameters, held)
        x = problem.solve(condition)
        if x is None:
            raise UsageError(
                problem.shortfall(condition),
                where=f"reference '{reference.id}'",
                remedy=problem.nearest(condition),
            )
        if len(_FOUND) >= _KEPT:
            _FOUND.clear()
        _FOUND[asked] = x
    found, residual, _, _ = _balance(parameters, condition, x)
    around = _around(reference.rho)
    body = found.body._replace(position=jnp.asarray(np.array([0.0, 0.0, -HEIGHT - float(around.ground)])))
    _check_battery(scenario, reference, found.commands)
    positions = split(parameters, jnp.asarray(_effectors(parameters, condition, x)))
    return Trim(reference, x[:2], body, positions, found.commands, found.aero, around, residual)


def _held(scenario: Scenario, reference: Reference) -> Array:
    """Return what the reference sets of surfaces and rotor speeds, SI; nan where they are free."""
    names = [e.name for kind in ("surface", "rotor") for e in scenario.effector if e.kind == kind]
    return np.array([reference.scheduled.get(name, np.nan) for name in names])


def _check_battery(scenario: Scenario, reference: Reference, commands: Commands) -> None:
    """Refuse a trim for which the battery's voltage is too low."""
    rotors = [e for e in scenario.effector if e.kind == "rotor"]
    for rotor, command in zip(rotors, np.asarray(commands.speed), strict=True):
        if command > rotor.limits[1]:
            raise UsageError(
                f"rotor '{rotor.name}' would need a command of {command:.4g} rad/s on this battery, "
                f"its highest is {rotor.limits[1]:g} rad/s",
                where=f"reference '{reference.id}'",
                remedy="raise the charge in [simulation.actuators.battery] or lower the weight",
            )


def _around(rho: float) -> Surroundings:
    """Return calm air of a density, at the standard altitude that has it."""
    return calm(rho, ground=altitude_of(rho) - HEIGHT)


def _effectors(parameters: motion.Parameters, condition: Array, x: Array) -> Array:
    """Return all positions by kind: surfaces, tilts, rotor speeds."""
    surfaces = 2 + parameters.actuators.surface.low.size
    return np.concatenate([x[2:surfaces], condition[2:], x[surfaces:]])


def _balance(
    parameters: motion.Parameters, condition: Array, x: Array
) -> tuple[Derivatives, Array, Array, Array]:
    """Return what is unbalanced and its exact derivatives.

    Parameters
    ----------
    parameters : motion.Parameters
    condition : ndarray, shape (2 + wing,)
        Density, u, tilts.
    x : ndarray, shape (2 + surface + rotor,)
        Roll and pitch angle, surfaces, rotor speeds.

    Returns
    -------
    found : Derivatives
    unbalanced : ndarray, shape (6,)
        Force with the weight, N, and moment about the centre of gravity, N m.
    by_condition : ndarray, shape (6, 1 + wing)
        By u and the tilts.
    by_x : ndarray, shape (6, 2 + surface + rotor)
    """
    (rho, u), (phi, theta) = condition[:2], x[:2]
    wings, surfaces = condition.size - 2, parameters.actuators.surface.low.size
    (sr, sp), (cr, cp) = np.sin([phi, theta]), np.cos([phi, theta])
    # level flight without sideslip: the velocity has no component along what is down
    w = u * sp / (cp * cr)
    state = np.array([u, 0.0, w, 0.0, 0.0, 0.0, phi, theta, 0.0])
    found = derivatives(parameters, _around(rho), state, _effectors(parameters, condition, x))
    weight = float(parameters.mass.mass) * STANDARD_GRAVITY
    unbalanced = np.array(found.value.wrench)
    unbalanced[:3] += weight * np.array([-sp, sr * cp, cr * cp])
    by_state, by_position = np.asarray(found.by_state.wrench), np.asarray(found.by_position.wrench)
    by_angles = by_state[:, 6:8] + np.outer(by_state[:, 2], [w * sr / cr, u / (cp**2 * cr)])
    by_angles[:3] += weight * np.array([[0.0, -cp], [cr * cp, -sr * sp], [-sr * cp, -cr * sp]])
    by_u = by_state[:, 0] + by_state[:, 2] * sp / (cp * cr)
    by_surface, by_tilt, by_speed = np.split(by_position, (surfaces, surfaces + wings), axis=1)
    return (
        found,
        unbalanced,
        np.column_stack([by_u, by_tilt]),
        np.hstack([by_angles, by_surface, by_speed]),
    )


class _Problem:
    """The search for a trim, in scaled unknowns: angles, surfaces and speeds of comparable weight."""

    def __init__(self, parameters: motion.Parameters, held: Array):
        surface, motor = parameters.actuators.surface, parameters.actuators.motor
        rotors = motor.high.size
        largest = np.maximum(np.abs(surface.low), np.abs(surface.high))
        self._parameters = parameters
        self._last: tuple[Array, Array, tuple[Array, Array, Array]] | None = None
        self._scale = np.concatenate([np.full(2, _ANGLE), largest, _SPREAD * np.asarray(motor.high)])
        low = np.concatenate([np.full(2, -LARGEST_ANGLE), surface.low, motor.low])
        high = np.concatenate([np.full(2, LARGEST_ANGLE), surface.high, motor.high])
        fixed = np.concatenate([np.full(2, np.nan), held])
        self._low = np.where(np.isnan(fixed), low, fixed) / self._scale
        self._high = np.where(np.isnan(fixed), high, fixed) / self._scale
        self._weight = float(parameters.mass.mass) * STANDARD_GRAVITY
        self._effort = np.eye(low.size)  # what is made small: all, but of the speeds only their spread
        speeds = np.arange(low.size) >= low.size - rotors
        self._effort -= np.outer(speeds, speeds) / max(rotors, 1)
        free = [np.where(speeds, share * self._high, 0.0) for share in _FIRST_SPEEDS]
        self._starts = [np.clip(start, self._low, self._high) for start in free]  # what is held stays

    def solve(self, condition: Array) -> Array | None:
        """Return the unknowns of the trim, not scaled, or None where there is none."""
        for start in self._starts:
            x = self._polished(condition, self._search(condition, start)[: start.size])
            if x is not None:
                return x * self._scale
        return None

    def shortfall(self, condition: Array) -> str:
        """Say which equation cannot be met and by how much, and which effectors are at their limits."""
        bounds = (self._low - 1e-9, self._high + 1e-9)  # apart, also where a position is held
        best = min(
            (
                least_squares(
                    lambda x: self._balance(condition, x)[0],
                    start,
                    jac=lambda x: self._balance(condition, x)[2],
                    bounds=bounds,
                    x_scale="jac",
                )
                for start in self._starts
            ),
            key=lambda found: found.cost,
        )
        worst = int(np.argmax(np.abs(best.fun)))
        size, unit = best.fun[worst] * self._weight, "N" if worst < 3 else "N m"
        return (
            f"level flight is not possible: the {EQUATIONS[worst]} cannot be balanced, "
            f"{size:+.4g} {unit} is left ({100 * abs(best.fun[worst]):.3g} % of the weight"
            + (")" if worst < 3 else " times 1 m)")
        )

    def nearest(self, condition: Array) -> str:
        """Say which condition of the same density, near by, can be flown."""
        for start in self._starts:
            found = self._search(condition, start, moving=True)
            there = self._moved(condition, _MARGIN * found[start.size :])
            speed, *tilts = (f"{value:.4g}" for value in there[1:])
            there[1:] = [float(speed), *map(float, tilts)]
            if self.solve(there) is not None:
                found = f"the nearest that was found to fly is u = {speed} m/s"
                return found + (f" with tilts {', '.join(tilts)} rad" if tilts else "")
        return "no condition near it was found to fly either; check mass, rotors and wings"

    def _search(self, condition: Array, start: Array, *, moving: bool = False) -> Array:
        """Return the least effort that balances; with `moving`, speed and tilts change by the least."""
        more = 2 if moving else 0
        small = _SIDE * self._effort if moving else self._effort
        effort = np.block(
            [[small, np.zeros((start.size, more))], [np.zeros((more, start.size)), np.eye(more)]]
        )
        bounds = [*zip(self._low, self._high, strict=True), *[(-_FARTHEST, _FARTHEST)] * more]

        def unbalanced(x: Array) -> Array:
            return self._balance(self._moved(condition, x[start.size :]), x[: start.size])[0]

        def slope(x: Array) -> Array:
            _, by_condition, by_x = self._balance(self._moved(condition, x[start.size :]), x[: start.size])
            by_move = np.stack([by_condition[:, 0], by_condition[:, 1:].sum(1)], axis=1) * _STEPS
            return np.hstack([by_x, by_move[:, :more]])

        # scipy's stubs know no constraint of many values
        balanced: Any = {"type": "eq", "fun": unbalanced, "jac": slope}
        found = minimize(
            lambda x: 0.5 * np.sum((effort @ x) ** 2),
            np.concatenate([np.clip(start, self._low, self._high), np.zeros(more)]),
            jac=lambda x: effort.T @ (effort @ x),
            bounds=bounds,
            constraints=balanced,
            method="SLSQP",
            options={"maxiter": 60, "ftol": 1e-12},  # 5 to 30 where it can be balanced
        )
        return found.x

    def _polished(self, condition: Array, x: Array) -> Array | None:
        """Return the nearest balanced unknowns by Newton's method, those at their limits held."""
        x = np.clip(x, self._low, self._high)
        for _ in range(8):
            unbalanced, _, slope = self._balance(condition, x)
            if np.abs(unbalanced).max() < _BALANCED:
                return x
            free = (x > self._low) & (x < self._high)
            step = np.zeros_like(x)
            step[free] = np.linalg.lstsq(slope[:, free], -unbalanced, rcond=1e-9)[0]
            x = np.clip(x + step, self._low, self._high)
        return None

    def _balance(self, condition: Array, x: Array) -> tuple[Array, Array, Array]:
        """Return the unbalance over the weight (times 1 m), and its two Jacobians.

        The search asks for the unbalance, and then for its slope at the same place.
        """
        last = self._last
        if last is None or not (np.array_equal(last[0], condition) and np.array_equal(last[1], x)):
            _, unbalanced, by_condition, by_x = _balance(self._parameters, condition, x * self._scale)
            weight = self._weight
            found = unbalanced / weight, by_condition / weight, by_x * self._scale / weight
            self._last = last = condition.copy(), x.copy(), found
        return last[2]

    def _moved(self, condition: Array, steps: Array) -> Array:
        """Return the condition with its speed and all its tilts changed."""
        if not steps.size:
            return condition
        low, high = self._parameters.actuators.tilt.low, self._parameters.actuators.tilt.high
        moved = condition + np.concatenate(
            [[0.0, _STEPS[0] * steps[0]], np.full(condition.size - 2, _STEPS[1] * steps[1])]
        )
        moved[2:] = np.clip(moved[2:], low, high)
        return moved

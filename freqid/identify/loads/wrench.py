"""Response variables: the aerodynamic and propulsive wrench that a measured motion needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from freqid.core.arrays import Array
from freqid.core.channels import FORCES, RATES, WRENCH
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.record import Maneuver
from freqid.core.vehicle import Vehicle
from freqid.dynamics.frames import cross, stability_from_body
from freqid.identify.loads.explanatory import history
from freqid.identify.loads.mass import Differentiate, MovingMass, moving_mass
from freqid.identify.loads.momentum import airframe_momentum, rotor_momentum

Form = Literal["force", "specific", "coefficient"]
Axes = Literal["body", "stability"]

# Below 5 Pa, 2.9 m/s at sea level, or a twentieth of the manoeuvre's median, dividing by dynamic
# pressure turns sensor noise into coefficients.
LOWEST_QBAR = 5.0
LOWEST_QBAR_SHARE = 0.05
# Stability axes are fixed at the mean angle of attack: further off than this they say nothing.
LARGEST_ALPHA_EXCURSION = np.pi / 4

_ACCELERATIONS = ("state/pdot", "state/qdot", "state/rdot")
_UNITS = {
    "force": ("N",) * 3 + ("N m",) * 3,
    "specific": ("m/s2",) * 3 + ("rad/s2",) * 3,
    "coefficient": ("1",) * 6,
}


@dataclass(frozen=True, eq=False)
class AppliedWrench:
    """Responses as ``wrench = direct + d(momentum)/dt``, so that nothing measured need be differentiated.

    Attributes
    ----------
    names : tuple of str, length n
        Among X Y Z L M N.
    units : tuple of str, length n
        Of the responses; those of `momentum` are these times s.
    direct : ndarray, shape (n, sample)
    momentum : ndarray, shape (n, sample)
        Zero where a response needs no derivative.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    direct: Array
    momentum: Array

    def history(self, dt: float, differentiate: Differentiate | None = None) -> Array:
        """Return the responses in time, shape (n, sample), in `units`.

        Parameters
        ----------
        dt : float
            Sampling interval, s.
        differentiate : callable, optional
            ``differentiate(x, dt)``, x of shape (n, sample); a local polynomial where absent.
        """
        if not self.momentum.any():
            return self.direct.copy()
        return self.direct + (differentiate or _local_polynomial)(self.momentum, dt)

    def mean(self, dt: float) -> Array:
        """Return the responses' means over the record, shape (n,), in `units`.

        The mean of a derivative is the change over the duration, no differentiation needed.
        """
        duration = dt * (self.direct.shape[1] - 1)
        return self.direct.mean(axis=1) + (self.momentum[:, -1] - self.momentum[:, 0]) / duration


def applied_wrench(
    maneuver: Maneuver,
    responses: Sequence[str] = WRENCH,
    form: Form = "force",
    axes: Axes = "body",
    *,
    angular_acceleration: Literal["transform", "record"] = "transform",
    rotors: bool = True,
    wings: bool = True,
    differentiate: Differentiate | None = None,
) -> AppliedWrench:
    """Reconstruct the applied force and the applied moment about the centre of gravity.

    Parameters
    ----------
    maneuver : Maneuver
        Only the channels that the responses need must be in its record.
    responses : sequence of str
        Among X Y Z L M N.
    form : {"force", "specific", "coefficient"}
        N and N m; forces per mass and moments per moment of inertia about the same axis, m/s2 and
        rad/s2; or divided by ``qbar S`` and ``qbar S b``, ``qbar S cbar``, ``qbar S b``.
    axes : {"body", "stability"}
        Stability axes are fixed at the manoeuvre's mean angle of attack.
    angular_acceleration : {"transform", "record"}
        Whether the derivative of p q r is left in `momentum`, or taken from ``state/pdot qdot rdot``.
    rotors, wings : bool
        False leaves out the rotors' angular momentum, or keeps the wings' mass where the stated mass
        properties hold: for showing what these terms are worth, not for identification.
    differentiate : callable, optional
        ``differentiate(x, dt)``, x of shape (channel, sample), for tilt angles and dynamic pressure; a local
        polynomial where absent.

    Returns
    -------
    AppliedWrench
        Aerodynamic plus propulsive: inertia of rotors and tilting wings is on the other side.

    Raises
    ------
    DataError
        Where a channel is missing, or coefficients or stability axes are asked for near zero airspeed.
    UsageError
        Where a response is unknown, or the vehicle lacks what the form or its wings need.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2nd ed., chapter 3 (rigid body and rotor terms) and
    chapter 5 (the wrench as response variable). Moving wings: docs/theory/wrench.md, eqs. 1 to 9.
    """
    for asked, known in ((responses, WRENCH), ((form,), _UNITS), ((axes,), ("body", "stability"))):
        for name in asked:
            if name not in known:
                raise UsageError(f"'{name}' is no response, form or axes", remedy=nearest(name, known))
    differentiate = differentiate or _local_polynomial
    rows = [WRENCH.index(r) for r in responses]
    turn = stability_from_body(_reference_alpha(maneuver)) if axes == "stability" else np.eye(3)
    mass = moving_mass(maneuver, differentiate, wings=wings)
    recorded = angular_acceleration == "record"

    direct, momentum = np.zeros((2, 6, maneuver.record.time.size))
    wanted = turn[[r for r in rows if r < 3]].any(axis=0)
    for axis in np.flatnonzero(wanted):  # body components that the responses are made of
        direct[axis], momentum[axis] = _force(maneuver, mass, axis, recorded)
    if any(r >= 3 for r in rows):
        direct[3:], momentum[3:] = _moment(maneuver, mass, rotors, recorded)
    direct, momentum = (np.concatenate((turn @ part[:3], turn @ part[3:])) for part in (direct, momentum))
    if form == "coefficient":
        direct, momentum = _per_dynamic_pressure(maneuver, direct, momentum, differentiate)
    size = _size(maneuver.vehicle, form, turn, rows)[:, None]
    units = tuple(_UNITS[form][r] for r in rows)
    return AppliedWrench(tuple(responses), units, direct[rows] / size, momentum[rows] / size)


def response_name(response: str, form: Form) -> str:
    """Return the name that a response has in a form: ``Cm`` for M as a coefficient, M otherwise."""
    if form != "coefficient":
        return response
    return "C" + (response if response in "XYZ" else response.lower())


def response_unit(response: str, form: Form) -> str:
    """Return the unit of a response in a form."""
    return _UNITS[form][WRENCH.index(response)]


def _force(maneuver: Maneuver, mass: MovingMass, axis: np.intp, recorded: bool) -> tuple[Array, Array]:
    """Return one component of the force in its two parts, N and N s, shape (sample,) each.

    ``F = m (a_m + w x v + dv/dt)`` with v the velocity of the centre of gravity relative to the sensor,
    ``w x d + d'``: in it are the tangential, centripetal, Coriolis and relative acceleration.
    """
    record, stated = maneuver.record, maneuver.vehicle.mass_properties
    sensor = record.channel(FORCES[axis])
    fixed = np.subtract(stated.cg_m, sensor.position_m or stated.cg_m)[:, None]
    if sensor.position_m is None or not (fixed.any() or mass.wings):
        return mass.mass * sensor.values, np.zeros_like(sensor.values)
    rates = record.matrix(RATES)
    velocity = cross(rates, fixed + mass.cg) + mass.cg_rate
    direct = sensor.values + cross(rates, velocity)[axis]
    if recorded:  # of the part that is fixed in the body; what the wings add is differentiated still
        direct = direct + cross(record.matrix(_ACCELERATIONS), fixed)[axis]
        velocity = velocity - cross(rates, fixed)
    return mass.mass * direct, mass.mass * velocity[axis]


def _moment(maneuver: Maneuver, mass: MovingMass, rotors: bool, recorded: bool) -> tuple[Array, Array]:
    """Return the moment in its two parts, N m and N m s, shape (3, sample) each: ``w x H`` and H."""
    record = maneuver.record
    rates = record.matrix(RATES)
    momentum = airframe_momentum(mass, rates)
    if rotors:
        momentum += rotor_momentum(maneuver)
    direct = cross(rates, momentum)
    if recorded:  # of the stated inertia; what the tilt changes in it is differentiated still
        inertia = maneuver.vehicle.mass_properties.inertia.matrix
        direct += inertia @ record.matrix(_ACCELERATIONS)
        momentum -= inertia @ rates
    return direct, momentum


def _per_dynamic_pressure(
    maneuver: Maneuver, direct: Array, momentum: Array, differentiate: Differentiate
) -> tuple[Array, Array]:
    """Divide a wrench by a dynamic pressure that changes: ``B'/q = (B/q)' + B q'/q^2``.

    A constant in B has no derivative; without it the last term, which differentiates, is small.
    """
    qbar = history(maneuver, "qbar")
    lowest, median = int(np.argmin(qbar)), float(np.median(qbar))
    floor = max(LOWEST_QBAR, LOWEST_QBAR_SHARE * median)
    if qbar[lowest] < floor:
        raise DataError(
            f"dynamic pressure falls to {qbar[lowest]:.3g} Pa at t = {maneuver.record.time[lowest]:.4g} s, "
            f"too near zero for coefficients, expected at least {floor:.3g} Pa",
            remedy="use the form 'force' or 'specific', or cut the record",
        )
    momentum = momentum - momentum.mean(axis=1, keepdims=True)
    change = differentiate(qbar[None], maneuver.record.dt) / qbar**2
    return direct / qbar + momentum * change, momentum / qbar


def _size(vehicle: Vehicle, form: Form, turn: Array, rows: Sequence[int]) -> Array:
    """Return what a response is divided by in its form, apart from dynamic pressure, shape (n,)."""
    if form == "force":
        return np.ones(len(rows))
    if form == "specific":
        stated = vehicle.mass_properties
        inertia = np.diag(turn @ stated.inertia.matrix @ turn.T)
        return np.concatenate((np.full(3, stated.mass_kg), inertia))[list(rows)]

    def stated_length(key: str) -> float:
        value = getattr(vehicle, key)
        if value is None:
            raise UsageError(
                f"coefficients need {key} of vehicle '{vehicle.name}', which is not stated",
                remedy=f"add {key} to [vehicle] of the scenario, or use the form 'force'",
            )
        return value

    arms = {"L": "span_m", "M": "chord_m", "N": "span_m"}
    lengths = [stated_length(arms[WRENCH[r]]) if WRENCH[r] in arms else 1.0 for r in rows]
    return stated_length("area_m2") * np.array(lengths)


def _reference_alpha(maneuver: Maneuver) -> float:
    """Return the mean angle of attack, rad, where the manoeuvre stays near it."""
    alpha = history(maneuver, "alpha")
    mean = float(alpha.mean())
    excursion = float(np.abs(alpha - mean).max())
    if excursion > LARGEST_ALPHA_EXCURSION:
        raise DataError(
            f"angle of attack leaves its mean of {np.degrees(mean):.3g} deg by {np.degrees(excursion):.3g}, "
            f"too far for stability axes, expected at most {np.degrees(LARGEST_ALPHA_EXCURSION):.3g} deg",
            remedy="use body axes, as near zero airspeed, or cut the record",
        )
    return mean


def _local_polynomial(x: Array, dt: float) -> Array:
    """Differentiate by local polynomials; imported when first needed."""
    from freqid.identify.spectra.smoothing import local_derivative

    # A quartic over nine samples passes as much noise as a parabola over five and, at 1.8 Hz sampled at
    # 50 Hz, loses 0.2 % where that loses 3 %.
    return local_derivative(x, dt, window=9, degree=4)

"""Mass of a vehicle whose wings tilt: its centre of gravity, and what is left of it without its wings.

The stated mass properties hold with the wings at ``vehicle.tilt_rad`` and contain them. The wings are taken
out there, by parallel axes, and put back where they are (docs/theory/wrench.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array
from freqid.core.errors import UsageError
from freqid.core.vehicle import Inertia, Vehicle, Wing
from freqid.dynamics.frames import turn_about_y


def centre_of_gravity(vehicle: Vehicle, tilt: Mapping[str, ArrayLike]) -> Array:
    """Return the centre of gravity as the wings tilt.

    Parameters
    ----------
    vehicle : Vehicle
    tilt : mapping of str to array_like of shape (...)
        By tilt effector, rad, of every wing that has mass.

    Returns
    -------
    ndarray, shape (3, ...)
        Vehicle axes, m; of shape (3,) where no wing has mass.

    Raises
    ------
    UsageError
        Where a wing has a mass but no place.
    """
    whole = vehicle.mass_properties
    place = np.array(whole.cg_m)  # (..., 3) until it is returned
    for wing in vehicle.wings:
        if wing.mass_kg > 0:
            arm = turn_about_y(wing_arm(wing), tilt[wing.tilt]).T
            place = place + wing.mass_kg / whole.mass_kg * (arm - stated_arm(vehicle, wing))
    return place.T


def with_tilted_wings(vehicle: Vehicle, tilt: Mapping[str, float]) -> Vehicle:
    """Return the vehicle with the mass properties that it has at other tilts of its wings.

    Parameters
    ----------
    vehicle : Vehicle
    tilt : mapping of str to float
        By tilt effector, rad; a wing without one stays where the vehicle has it.

    Returns
    -------
    Vehicle
        Its centre of gravity, inertia and ``tilt_rad`` are those at these tilts.

    Raises
    ------
    UsageError
        As `without_wings`.
    """
    turned = [w for w in vehicle.wings if w.tilt in tilt and (w.mass_kg > 0 or w.inertia.matrix.any())]
    if not turned:
        return vehicle
    whole = vehicle.mass_properties
    stated = {w.tilt: vehicle.tilt_rad.get(w.name, 0.0) for w in vehicle.wings}
    at = {name: float(tilt.get(name, angle)) for name, angle in stated.items()}
    cg = centre_of_gravity(vehicle, at)
    _, inertia = without_wings(vehicle, turned, cg)
    for wing in turned:
        turn = turn_about_y(np.eye(3), at[wing.tilt])
        place = np.subtract(wing.pivot_m, cg) + turn_about_y(wing_arm(wing), at[wing.tilt])
        inertia = inertia + turn @ wing.inertia.matrix @ turn.T + point_inertia(wing.mass_kg, place)
    (xx, yy, zz), (xy, xz, yz) = np.diag(inertia), -inertia[[0, 0, 1], [1, 2, 2]]
    mass_properties = msgspec.structs.replace(
        whole, cg_m=tuple(cg.tolist()), inertia=Inertia(xx=xx, yy=yy, zz=zz, xz=xz, xy=xy, yz=yz)
    )
    angles = vehicle.tilt_rad | {w.name: at[w.tilt] for w in turned}
    return msgspec.structs.replace(vehicle, mass_properties=mass_properties, tilt_rad=angles)


def wing_arm(wing: Wing) -> Array:
    """Return a wing's centre of gravity from its pivot at zero tilt, m, shape (3,).

    Raises
    ------
    UsageError
        Where the wing has a mass but no place.
    """
    if wing.mass_kg == 0:
        return np.zeros(3)
    if wing.cg_m is None:
        raise UsageError(
            f"wing '{wing.name}' has a mass of {wing.mass_kg:g} kg but no centre of gravity",
            remedy="add cg_m to its [[wing]] of the scenario, or set its mass_kg to 0",
        )
    return np.subtract(wing.cg_m, wing.pivot_m)


def stated_arm(vehicle: Vehicle, wing: Wing) -> Array:
    """Return `wing_arm` turned to where the vehicle's mass properties are stated, m, shape (3,)."""
    return turn_about_y(wing_arm(wing), vehicle.tilt_rad.get(wing.name, 0.0))


def without_wings(vehicle: Vehicle, wings: Sequence[Wing], about: ArrayLike) -> tuple[Array, Array]:
    """Return first moment, kg m, shape (3,), and inertia, kg m2, shape (3, 3), of all that does not tilt.

    Parameters
    ----------
    vehicle : Vehicle
    wings : sequence of Wing
        What tilts.
    about : array_like, shape (3,)
        The point that both are about, vehicle axes, m.

    Raises
    ------
    UsageError
        Where a wing has a mass but no place, or the wings outweigh the vehicle or have more inertia.
    """
    whole = vehicle.mass_properties
    mass, centre = whole.mass_kg, np.subtract(whole.cg_m, about)
    moment, inertia = mass * centre, whole.inertia.matrix + point_inertia(mass, centre)
    for wing in wings:
        place = np.subtract(wing.pivot_m, about) + stated_arm(vehicle, wing)
        turn = turn_about_y(np.eye(3), vehicle.tilt_rad.get(wing.name, 0.0))
        mass -= wing.mass_kg
        moment = moment - wing.mass_kg * place
        inertia = inertia - turn @ wing.inertia.matrix @ turn.T - point_inertia(wing.mass_kg, place)
    # What is left must be a body: a mass, and an inertia about its own centre that is not negative.
    own = inertia - point_inertia(mass, moment / mass) if mass > 0 else -np.eye(3)
    lowest = np.linalg.eigvalsh(own)[0]
    if lowest < -1e-9 * np.trace(whole.inertia.matrix):
        raise UsageError(
            f"vehicle '{vehicle.name}' without its wings has a mass of {mass:.4g} kg and a lowest moment of "
            f"inertia of {lowest:.4g} kg m2, expected both positive",
            remedy="correct the mass properties of [vehicle] or of a [[wing]]: those of the vehicle hold "
            "with its wings on, each with its mass at its arm",
        )
    return moment, inertia


def point_inertia(mass: float, place: Array) -> Array:
    """Return the inertia of a point mass at a place about the origin, kg m2, shape (3, 3)."""
    return mass * (place @ place * np.eye(3) - np.outer(place, place))

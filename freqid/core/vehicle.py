"""The aircraft: mass properties, geometry, tilting wings, rotors and effectors.

Positions are in vehicle axes: x forward, y right, z down, metres, from one fixed origin of the
constructor's choice. A tilt angle is positive leading edge up, that is about +y.
"""

from __future__ import annotations

from math import inf
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import EFFECTOR_UNITS, TAKEN
from freqid.core.errors import UsageError, nearest

Vector = tuple[float, float, float]


class Strict(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every section of a scenario shares: immutable, and an unknown key is an error."""


class Inertia(Strict, frozen=True):
    """Moments and products of inertia in kg m2; products as ``Ixz = + integral of x z dm``."""

    xx: float
    yy: float
    zz: float
    xz: float = 0.0
    xy: float = 0.0
    yz: float = 0.0

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Inertia matrix, shape (3, 3): products enter with a minus sign."""
        return np.array(
            [
                [self.xx, -self.xy, -self.xz],
                [-self.xy, self.yy, -self.yz],
                [-self.xz, -self.yz, self.zz],
            ]
        )


class MassProperties(Strict, frozen=True):
    """Mass, centre of gravity and inertia about it, with one-sigma uncertainties.

    Attributes
    ----------
    mass_kg : float
    cg_m : tuple of 3 floats
        Centre of gravity in vehicle axes, m.
    inertia : Inertia
        About the centre of gravity, body axes, rotors locked.
    mass_sigma_kg, cg_sigma_m, inertia_sigma
        One sigma of the above; zero or None where not stated.
    """

    mass_kg: float
    inertia: Inertia
    cg_m: Vector = (0.0, 0.0, 0.0)
    mass_sigma_kg: float = 0.0
    cg_sigma_m: Vector = (0.0, 0.0, 0.0)
    inertia_sigma: Inertia | None = None

    def __post_init__(self) -> None:
        if not 0 < self.mass_kg < inf:
            raise ValueError(f"mass_kg is {self.mass_kg:g}, expected a positive mass")
        if not np.isfinite(self.inertia.matrix).all():
            raise ValueError("inertia holds a number that is not finite")
        moments = np.linalg.eigvalsh(self.inertia.matrix)
        if moments[0] <= 0 or moments[2] > moments[0] + moments[1]:
            raise ValueError(
                f"inertia has principal moments {np.array2string(moments, precision=4)} kg m2, "
                "expected positive ones of which none exceeds the sum of the other two"
            )


class Effector(Strict, frozen=True):
    """A control that can be moved and excited: surface, tilt, rotor, thrust or throttle.

    Attributes
    ----------
    name : str
    kind : str
        Decides the SI unit: surface and tilt rad, rotor rad/s, thrust N, throttle 1.
    limits : tuple of 2 floats
        Lowest and highest position, in that unit.
    rate_limit : float, optional
        Largest rate, in that unit per second.
    effectiveness : dict
        N by force axis and N m by moment axis, ``X`` to ``N``, per unit of position, near the
        conditions that are flown; for the net load of many effectors that move together.
    """

    name: str
    kind: Literal["surface", "tilt", "rotor", "thrust", "throttle"]
    limits: tuple[float, float]
    rate_limit: float | None = None
    effectiveness: dict[Literal["X", "Y", "Z", "L", "M", "N"], float] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.name in TAKEN or "/" in self.name or not self.name:
            raise ValueError(f"effector '{self.name}' has the name of a state, of air data or of nothing")
        if not self.limits[0] < self.limits[1]:
            raise ValueError(f"limits of '{self.name}' are {list(self.limits)}, expected the lower one first")
        if self.rate_limit is not None and not self.rate_limit > 0:
            raise ValueError(f"rate_limit of '{self.name}' is {self.rate_limit:g}, expected a positive rate")

    @property
    def unit(self) -> str:
        """SI unit of the position."""
        return EFFECTOR_UNITS[self.kind]


class Wing(Strict, frozen=True):
    """A wing, with the rotors on it, that tilts about an axis parallel to y.

    Attributes
    ----------
    name : str
    tilt : str
        Effector whose position is the tilt angle.
    pivot_m : tuple of 3 floats
        A point of the tilt axis, vehicle axes, m.
    mass_kg : float
        Everything that turns with the wing, included in the vehicle's mass.
    cg_m : tuple of 3 floats
        Centre of gravity of the tilting part at zero tilt, vehicle axes, m.
    inertia : Inertia
        Of the tilting part about `cg_m` at zero tilt, body axes, rotors locked, kg m2.
    """

    name: str
    tilt: str
    pivot_m: Vector
    mass_kg: float = 0.0
    cg_m: Vector | None = None
    inertia: Inertia = msgspec.field(default_factory=lambda: Inertia(xx=0.0, yy=0.0, zz=0.0))


class Rotor(Strict, frozen=True):
    """A spinning rotor or propeller.

    Attributes
    ----------
    name : str
        Also the effector whose position is the speed, rad/s, never negative.
    spin : {1, -1}
        +1 where the rotor turns right-handed about `axis`.
    inertia : float
        Polar moment of inertia of all that spins, kg m2.
    axis : tuple of 3 floats
        Shaft direction in vehicle axes at zero tilt, thrust side; made a unit vector when used.
    position_m : tuple of 3 floats
        Hub at zero tilt, vehicle axes, m.
    wing : str, optional
        Tilting wing that carries it.
    diameter_m : float, optional
    """

    name: str
    spin: Literal[1, -1]
    inertia: float
    axis: Vector = (1.0, 0.0, 0.0)
    position_m: Vector = (0.0, 0.0, 0.0)
    wing: str | None = None
    diameter_m: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.inertia < inf:
            raise ValueError(f"inertia of rotor '{self.name}' is {self.inertia:g}, expected zero or more")


class Surface(Strict, frozen=True):
    """Where a surface is, for drawings of an aircraft that is not simulated.

    Attributes
    ----------
    name : str
        Of the effector.
    hinge_m : tuple of 2 points
        Ends of its hinge line, vehicle axes, m, at zero tilt.
    chord_m : float
        How far it reaches behind its hinge, m.
    wing : str, optional
        Tilting wing that it turns with.
    """

    name: str
    hinge_m: tuple[Vector, Vector]
    chord_m: float
    wing: str | None = None

    def __post_init__(self) -> None:
        ends = np.array(self.hinge_m)
        if not (np.isfinite(ends).all() and np.ptp(ends, axis=0).any()):
            raise ValueError(f"hinge_m of '{self.name}' is {self.hinge_m}, expected two different points")
        if not 0 < self.chord_m < inf:
            raise ValueError(f"chord_m of '{self.name}' is {self.chord_m:g}, expected a positive length")


class Group(Strict, frozen=True):
    """Effectors that share a cause of error: a V-tail, a row of propellers, surfaces on one bus.

    Attributes
    ----------
    name : str
    effectors : tuple of str
        Two or more, each once.
    kind : str
        What they share, in the user's words; empty where not stated.
    """

    name: str
    effectors: tuple[str, ...]
    kind: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise ValueError("a group has no name")
        if len(set(self.effectors)) < 2 or len(set(self.effectors)) < len(self.effectors):
            raise ValueError(
                f"group '{self.name}' has effectors {list(self.effectors)}, expected two or more, each once"
            )


class Vehicle(Strict, frozen=True):
    """All that is known of an aircraft without flying it.

    Attributes
    ----------
    name : str
    mass_properties : MassProperties
        Of the whole aircraft, with every wing at `tilt_rad`.
    tilt_rad : dict
        Tilt angle by wing name at which `mass_properties` hold; zero where absent.
    area_m2, span_m, chord_m : float, optional
        Reference wing area, span and mean aerodynamic chord, for coefficients.
    effectors, rotors, wings, groups : tuple
    """

    name: str
    mass_properties: MassProperties
    tilt_rad: dict[str, float] = msgspec.field(default_factory=dict)
    area_m2: float | None = None
    span_m: float | None = None
    chord_m: float | None = None
    effectors: tuple[Effector, ...] = ()
    rotors: tuple[Rotor, ...] = ()
    wings: tuple[Wing, ...] = ()
    groups: tuple[Group, ...] = ()

    def __post_init__(self) -> None:
        for kind in ("effectors", "rotors", "wings", "groups"):
            names = [item.name for item in getattr(self, kind)]
            twice = {n for n in names if names.count(n) > 1}
            if twice:
                raise ValueError(f"{kind} name {sorted(twice)} more than once, expected each name once")
        for length in ("area_m2", "span_m", "chord_m"):
            value = getattr(self, length)
            if value is not None and not 0 < value < inf:
                raise ValueError(f"{length} is {value:g}, expected a positive number")
        wings = {w.name for w in self.wings}
        effectors = self.effector_kinds
        for name in self.tilt_rad:
            if name not in wings:
                raise ValueError(
                    f"tilt_rad names wing '{name}', which is not described; {nearest(name, wings)}"
                )
        for rotor in self.rotors:
            if effectors.get(rotor.name, "rotor") != "rotor":
                raise ValueError(
                    f"rotor '{rotor.name}' is an effector of kind '{effectors[rotor.name]}', expected 'rotor'"
                )
            if rotor.wing is not None and rotor.wing not in wings:
                raise ValueError(
                    f"rotor '{rotor.name}' is on wing '{rotor.wing}', which is not described; "
                    + nearest(rotor.wing, wings)
                )
        for wing in self.wings:
            if effectors and effectors.get(wing.tilt) != "tilt":
                raise ValueError(
                    f"wing '{wing.name}' tilts by '{wing.tilt}', which is no effector of kind 'tilt'; "
                    + nearest(wing.tilt, (n for n, kind in effectors.items() if kind == "tilt"))
                )

        for group in self.groups:
            for name in group.effectors:
                if name not in effectors:
                    raise ValueError(
                        f"group '{group.name}' names effector '{name}', which is not described; "
                        + nearest(name, effectors)
                    )

    @property
    def effector_kinds(self) -> dict[str, str]:
        """Kind by effector name."""
        return {e.name: e.kind for e in self.effectors}

    def effector(self, name: str) -> Effector:
        """Return one effector.

        Parameters
        ----------
        name : str
            As in the scenario, ``de1``.

        Raises
        ------
        UsageError
            Where the vehicle has none of that name.
        """
        for effector in self.effectors:
            if effector.name == name:
                return effector
        raise UsageError(
            f"vehicle '{self.name}' has no effector '{name}'",
            remedy=nearest(name, (e.name for e in self.effectors)),
        )

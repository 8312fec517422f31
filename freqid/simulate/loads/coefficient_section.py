"""Section ``[simulation.coefficients]`` of a scenario: any aircraft by its derivatives and tables."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Scenario
from freqid.core.toml import convert
from freqid.core.vehicle import Strict, Vector, Vehicle
from freqid.simulate.loads.coefficients import ADVANCE_RATIO, MOTION
from freqid.simulate.loads.sections import PropellerSection

SECTION = "simulation.coefficients"
COEFFICIENTS = ("CD", "CL", "CX", "CY", "CZ", "Cl", "Cm", "Cn")
FORCES = ("X", "Y", "Z", "L", "M", "N")
CONSTANT = "bias"  # as in the models that are identified
_FLOWN = ("surface", "tilt", "rotor")


class Table(Strict, frozen=True):
    """A derivative that depends on one or more variables.

    Attributes
    ----------
    of : str or tuple of str
        The variables: ``"J"``, ``["alpha", "J"]``.
    at : tuple of float, or tuple of tuple of float
        Their points, increasing; one list for each variable.
    values : nested tuple of float
        At the points, the first variable outermost.
    """

    of: str | tuple[str, ...]
    at: tuple[Any, ...]
    values: tuple[Any, ...]

    @property
    def variables(self) -> tuple[str, ...]:
        """The variables, always as a tuple."""
        return (self.of,) if isinstance(self.of, str) else self.of


Term = float | Table
Terms = dict[str, Term]


class CoefficientSection(Strict, frozen=True):
    """``[simulation.coefficients]``.

    Attributes
    ----------
    CD, CL, CX, CY, CZ, Cl, Cm, Cn : dict
        Terms by their product of variables, such as ``alpha``, ``alpha*alpha`` or ``bias``. Lift and drag
        are along stability axes, all others along body axes; Cl and Cn by the span, Cm by the chord.
    X, Y, Z, L, M, N : dict
        Of form ``"force"``: N and N m, body axes.
    form : {"coefficient", "force"}
    about : dict
        By variable: products are of the departures from these values; zero where absent.
    point_m : tuple of 3 floats, optional
        Where the motion is taken and about which the moments are; the stated centre of gravity where absent.
    propeller : PropellerSection, optional
        Of all rotors; without it a rotor acts through the terms that name it.
    """

    CD: Terms = msgspec.field(default_factory=dict)
    CL: Terms = msgspec.field(default_factory=dict)
    CX: Terms = msgspec.field(default_factory=dict)
    CY: Terms = msgspec.field(default_factory=dict)
    CZ: Terms = msgspec.field(default_factory=dict)
    Cl: Terms = msgspec.field(default_factory=dict)
    Cm: Terms = msgspec.field(default_factory=dict)
    Cn: Terms = msgspec.field(default_factory=dict)
    X: Terms = msgspec.field(default_factory=dict)
    Y: Terms = msgspec.field(default_factory=dict)
    Z: Terms = msgspec.field(default_factory=dict)
    L: Terms = msgspec.field(default_factory=dict)
    M: Terms = msgspec.field(default_factory=dict)
    N: Terms = msgspec.field(default_factory=dict)
    form: Literal["coefficient", "force"] = "coefficient"
    about: dict[str, float] = msgspec.field(default_factory=dict)
    point_m: Vector | None = None
    propeller: PropellerSection | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients that have terms."""
        return tuple(name for name in (*COEFFICIENTS, *FORCES) if getattr(self, name))

    def terms(self) -> Iterator[tuple[str, str, Term]]:
        """Yield coefficient, product and derivative of every term."""
        for name in self.names:
            for product, term in getattr(self, name).items():
                yield name, product, term


def read_coefficients(scenario: Scenario) -> CoefficientSection:
    """Return the section, checked against the vehicle.

    Raises
    ------
    UsageError
        Where it is missing, has an unknown key, a table is at fault or it does not fit the vehicle.
    """
    if not scenario.simulation.coefficients:
        raise UsageError(
            f"[simulation] is of kind 'coefficients', but there is no [{SECTION}]",
            remedy="give the derivatives there",
        )
    section = convert(scenario.simulation.coefficients, CoefficientSection, SECTION)
    vehicle = scenario.aircraft()
    _check_vehicle(section, vehicle)
    known = (*MOTION, ADVANCE_RATIO, *(e.name for e in vehicle.effectors))
    for name, product, term in section.terms():
        where = f"{SECTION}.{name}, term '{product}'"
        used = [*factors_of(product), *(term.variables if isinstance(term, Table) else ())]
        for variable in used:
            _check_variable(variable, known, vehicle, where)
        points_and_values(term, where)
    for variable in section.about:
        _check_variable(variable, known, vehicle, f"{SECTION}.about")
    return section


def factors_of(product: str) -> tuple[str, ...]:
    """Return the factors of a term: none of ``bias``, twice ``alpha`` of ``alpha*alpha``."""
    return () if product == CONSTANT else tuple(part.strip() for part in product.split("*"))


def points_and_values(term: Term, where: str) -> tuple[tuple[tuple[float, ...], ...], NDArray[np.float64]]:
    """Return the points of a term's variables and its values; no points of a number.

    Raises
    ------
    UsageError
        Where points do not increase, or the values do not fit them.
    """
    if not isinstance(term, Table):
        if not np.isfinite(term):
            raise UsageError(f"the derivative is {term}, expected a finite number", where=where)
        return (), np.array(float(term))
    points = term.at if term.at and isinstance(term.at[0], list | tuple) else (term.at,)
    if len(points) != len(term.variables):
        raise UsageError(
            f"the table is of {len(term.variables)} variables, but 'at' has points for {len(points)}",
            where=where,
            remedy="give one list of points for each variable",
        )
    for variable, row in zip(term.variables, points, strict=True):
        if not all(isinstance(x, int | float) and np.isfinite(x) for x in row):
            raise UsageError(f"the points of '{variable}' are not all finite numbers", where=where)
        if len(row) < 2 or any(b <= a for a, b in pairwise(row)):
            raise UsageError(
                f"the points of '{variable}' are {list(row)[:6]}, expected two or more that increase",
                where=where,
            )
    shape = tuple(len(row) for row in points)
    try:
        values = np.array(term.values, dtype=float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != shape or not np.isfinite(values).all():
        found = "not all finite" if values.shape == shape else f"of shape {list(values.shape)}"
        if not values.size:
            found = "no numbers in rows of equal length"
        raise UsageError(
            f"the values are {found}, expected {' by '.join(str(n) for n in shape)} finite numbers",
            where=where,
            remedy="give one value for each point, the first variable outermost",
        )
    return tuple(tuple(float(x) for x in row) for row in points), values


def _check_vehicle(section: CoefficientSection, vehicle: Vehicle) -> None:
    """Refuse a section without terms, of two forms or axes at once, or without the lengths it needs."""
    allowed = COEFFICIENTS if section.form == "coefficient" else FORCES
    wrong = [name for name in section.names if name not in allowed]
    if wrong:
        raise UsageError(
            f"{SECTION} has form '{section.form}', but gives {wrong[0]}",
            remedy=f"expected {' '.join(allowed)}",
        )
    if not section.names:
        raise UsageError(f"{SECTION} has no term", remedy=f"give some of {' '.join(allowed)}")
    for names in (("CD", "CX"), ("CL", "CZ"), ("CD", "CZ"), ("CL", "CX")):
        if all(name in section.names for name in names):
            raise UsageError(
                f"{SECTION} gives {names[0]} and {names[1]}", remedy="give CD and CL, or CX and CZ"
            )
    if section.form == "coefficient":
        for length in ("area_m2", "span_m", "chord_m"):
            if getattr(vehicle, length) is None:
                raise UsageError(
                    f"{SECTION} needs {length} of vehicle '{vehicle.name}'", remedy="add it to [vehicle]"
                )
    for effector in vehicle.effectors:
        if effector.kind not in _FLOWN:
            raise UsageError(
                f"effector '{effector.name}' is of kind '{effector.kind}', which the simulation cannot move",
                remedy=f"describe it as one of {', '.join(_FLOWN)}",
            )
        if effector.name == ADVANCE_RATIO:
            raise UsageError("an effector is called 'J', the advance ratio", remedy="give it another name")
    speeds = [e.name for e in vehicle.effectors if e.kind == "rotor"]
    described = [rotor.name for rotor in vehicle.rotors]
    if speeds != described:
        raise UsageError(
            f"the effectors of kind rotor are {speeds}, but the [[rotor]] entries are {described}",
            remedy="describe each rotor in both, in the same order",
        )
    for rotor in vehicle.rotors if section.propeller else ():
        if rotor.diameter_m is None:
            raise UsageError(
                f"rotor '{rotor.name}' has no diameter_m, which {SECTION}.propeller needs",
                remedy="add it to its [[rotor]]",
            )


def _check_variable(variable: str, known: tuple[str, ...], vehicle: Vehicle, where: str) -> None:
    if variable not in known:
        raise UsageError(f"variable '{variable}' is unknown", where=where, remedy=nearest(variable, known))
    if variable == ADVANCE_RATIO and not any(rotor.diameter_m for rotor in vehicle.rotors):
        raise UsageError(
            "variable 'J' needs a rotor with a diameter",
            where=where,
            remedy="add diameter_m to the [[rotor]] entries",
        )
    if variable in ("phat", "rhat", "qhat"):
        length = "chord_m" if variable == "qhat" else "span_m"
        if getattr(vehicle, length) is None:
            raise UsageError(
                f"variable '{variable}' needs the vehicle's {length}",
                where=where,
                remedy="add it to [vehicle]",
            )

"""A scenario: one TOML file that says which aircraft, which conditions, what is done and what suffices."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf, isfinite, pi, radians
from pathlib import Path
from typing import Any, Literal

import msgspec

from freqid.core.channels import ADVANCE_RATIO, AIR, STATE, WRENCH
from freqid.core.errors import DataError, UsageError, nearest
from freqid.core.sections.excitation import Excitation
from freqid.core.sections.identification import Identification
from freqid.core.sections.trim_sequence import Campaign
from freqid.core.toml import parse_toml, read_toml
from freqid.core.vehicle import (
    Effector,
    Group,
    Inertia,
    MassProperties,
    Rotor,
    Strict,
    Surface,
    Vector,
    Vehicle,
    Wing,
)

SHIPPED = Path(__file__).resolve().parents[1] / "scenarios"
"""Folder of the scenarios that come with the package."""

FILL_IN = "fill in"
"""What marks a line of a new scenario that holds a placeholder."""

_FROM_THE_FILE = ("file", "sha256")


class Airframe(Strict, frozen=True):
    """Section ``[vehicle]``: mass properties and reference lengths, SI."""

    name: str
    mass_kg: float
    inertia: Inertia
    cg_m: Vector = (0.0, 0.0, 0.0)
    mass_sigma_kg: float = 0.0
    cg_sigma_m: Vector = (0.0, 0.0, 0.0)
    inertia_sigma: Inertia | None = None
    tilt_rad: dict[str, float] = msgspec.field(default_factory=dict)
    area_m2: float | None = None
    span_m: float | None = None
    chord_m: float | None = None


class Reference(Strict, frozen=True):
    """One ``[[reference]]``: the condition that a point model holds at.

    Attributes
    ----------
    id : str
    u : float
        Forward speed, m/s; nan in a model whose record does not tell.
    rho : float
        Air density, kg/m3; likewise.
    scheduled : dict of str to float
        What else is set for the condition, by name, SI: tilts, flap settings, any effector or air quantity.
        In a file they stand beside `u`: ``nac_l = 0.3``. A tilt that is not stated is at zero.
    """

    id: str
    u: float
    rho: float
    scheduled: dict[str, float] = msgspec.field(default_factory=dict)

    @classmethod
    def of(cls, id: str, u: float, rho: float, **scheduled: float) -> Reference:
        """Return a condition whose scheduled variables are named as in a file.

        Examples
        --------
        >>> Reference.of("u20", u=20.0, rho=1.2, nac_l=0.3)["nac_l"]
        0.3
        """
        return cls(id=id, u=u, rho=rho, scheduled=scheduled)

    def __getitem__(self, name: str) -> float:
        try:
            return self.scheduled[name]
        except KeyError:
            raise UsageError(
                f"reference '{self.id}' states no '{name}'", remedy=nearest(name, self.scheduled)
            ) from None

    def to_json(self) -> dict[str, Any]:
        """Return a flat table, as a scenario file has it."""
        return {"id": self.id, "u": self.u, "rho": self.rho, **self.scheduled}

    @classmethod
    def from_json(cls, table: Mapping[str, Any]) -> Reference:
        """Return the condition of a flat table."""
        return msgspec.convert(_nested(table), cls)


def _nested(table: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of a reference with what is scheduled in a table of its own."""
    own = {k: v for k, v in table.items() if k in ("id", "u", "rho")}
    return own | {"scheduled": {k: v for k, v in table.items() if k not in own}}


class Gates(Strict, frozen=True):
    """Section ``[gates]``: what a result must reach for a command to end with exit code 0.

    Attributes
    ----------
    r2 : float or dict, optional
        Lowest coefficient of determination, for all responses or by response.
    condition_number : float, optional
        Highest condition number of the scaled regressors.
    collinearity : float, optional
        Highest variance inflation factor of a regressor, ``1 / (1 - R2)`` of that regressor on the others: 10
        in common use, which two regressors reach at a correlation of 0.95 (Klein & Morelli, 2nd ed., ch. 5).
    coherence : float, optional
        Lowest coherence of measured and modelled responses, in the worst octave of the band.
    validation : float or dict, optional
        Highest Theil coefficient on a manoeuvre that was not used, for all responses or by response; without
        such a manoeuvre the gate is missed.
    consistency : float, optional
        Of a study: lowest probability that repeated flights, and points of different densities, agree; each
        of m comparisons is held to this over m.
    """

    r2: float | dict[str, float] | None = None
    condition_number: float | None = None
    collinearity: float | None = None
    coherence: float | None = None
    validation: float | dict[str, float] | None = None
    consistency: float | None = None

    @property
    def of_points(self) -> bool:
        """Whether anything is asked of a point model."""
        return any(
            getattr(self, name) is not None for name in self.__struct_fields__ if name != "consistency"
        )

    def __post_init__(self) -> None:
        bars = [self.condition_number, self.collinearity, self.coherence, self.consistency]
        for name in ("r2", "validation"):
            asked = getattr(self, name)
            for response in asked if isinstance(asked, dict) else ():
                if response not in WRENCH:
                    raise ValueError(f"gate {name} names response '{response}'; {nearest(response, WRENCH)}")
            bars += asked.values() if isinstance(asked, dict) else [asked]
        if not all(isfinite(bar) for bar in bars if bar is not None):
            raise ValueError("a gate is not finite, expected a number that can be reached")
        if self.collinearity is not None and not self.collinearity > 1:
            raise ValueError(
                f"gate collinearity is {self.collinearity:g}, expected more than 1, which is the variance "
                "inflation of regressors that have nothing to do with each other"
            )


class Simulation(Strict, frozen=True):
    """Section ``[simulation]``: what only the simulation knows; its modules validate their parts.

    Attributes
    ----------
    kind : {"airframe", "coefficients"}
        Which of the two sections of that name gives the loads: strips, slipstreams and wakes of a tilt-wing
        aircraft, or derivatives and tables of any aircraft.
    effects : dict
        Settings by effect id.
    airframe, coefficients, actuators, sensors, wind : dict
    """

    kind: Literal["airframe", "coefficients"] = "airframe"
    effects: dict[str, Any] = msgspec.field(default_factory=dict)
    airframe: dict[str, Any] = msgspec.field(default_factory=dict)
    coefficients: dict[str, Any] = msgspec.field(default_factory=dict)
    actuators: dict[str, Any] = msgspec.field(default_factory=dict)
    sensors: dict[str, Any] = msgspec.field(default_factory=dict)
    wind: dict[str, Any] = msgspec.field(default_factory=dict)

    @property
    def loads(self) -> dict[str, Any]:
        """The section that gives the loads."""
        return self.coefficients if self.kind == "coefficients" else self.airframe


def _refuse_as_file(identifier: str) -> None:
    """Refuse an id that leads out of a folder: results of a condition are files of its name."""
    if identifier in (".", "..") or len(identifier) > 100 or re.search(r"[/\\\x00-\x1f]", identifier):
        raise ValueError(f"id {identifier[:100]!r} cannot be the name of a file, expected one such as 'u20'")


class Scenario(Strict, frozen=True):
    """One aircraft and campaign.

    Attributes
    ----------
    vehicle : Airframe
    effector, rotor, wing, group, reference : tuple
        One entry for each ``[[effector]]``, ``[[rotor]]``, ``[[wing]]``, ``[[group]]``, ``[[reference]]``.
    surface : tuple of Surface
        One for each ``[[surface]]``: where surfaces are, for drawings alone.
    excitation : Excitation, optional
    identification : Identification, optional
    campaign : Campaign, optional
    control, simulation, tolerance, noise, gates
        The remaining sections; tolerance and noise give one sigma by name, tolerance of one effector by
        a dotted one: ``de1.natural_frequency``.
    file, sha256 : str
        Where it was read from, and the hash of that file's bytes; empty of a scenario made in Python.
    """

    vehicle: Airframe
    effector: tuple[Effector, ...] = ()
    rotor: tuple[Rotor, ...] = ()
    wing: tuple[Wing, ...] = ()
    group: tuple[Group, ...] = ()
    reference: tuple[Reference, ...] = ()
    surface: tuple[Surface, ...] = ()
    excitation: Excitation | None = None
    identification: Identification | None = None
    campaign: Campaign | None = None
    control: dict[str, Any] = msgspec.field(default_factory=dict)
    simulation: Simulation = Simulation()
    tolerance: dict[str, float] = msgspec.field(default_factory=dict)
    noise: dict[str, float] = msgspec.field(default_factory=dict)
    gates: Gates = Gates()
    file: str = ""
    sha256: str = ""

    def __repr__(self) -> str:
        return (
            f"<Scenario {self.vehicle.name!r}: {self.vehicle.mass_kg:g} kg, {len(self.effector)} effectors, "
            f"{len(self.rotor)} rotors, {len(self.reference)} reference conditions"
            + (f", from {self.file}>" if self.file else ">")
        )

    def __post_init__(self) -> None:
        for at in self.reference:
            _refuse_as_file(at.id)
            if not (isfinite(at.u) and 0 <= at.rho < inf):
                raise ValueError(
                    f"reference '{at.id}' has u = {at.u:g} and rho = {at.rho:g}, expected finite numbers"
                )
            for name, value in at.scheduled.items():
                known = self.schedulable
                if name not in known:
                    raise ValueError(
                        f"reference '{at.id}' sets '{name}', which is no effector and no air quantity; "
                        + nearest(name, ("id", "u", "rho", *known))
                    )
                if not isfinite(value):
                    raise ValueError(f"reference '{at.id}' has {name} = {value:g}, expected a finite number")
        self._check_angles()
        self._check_excitations()
        self._check_surfaces()
        self.aircraft()  # what does not fit together is refused when the file is read

    def aircraft(self) -> Vehicle:
        """Return the vehicle that the sections describe together."""
        body = self.vehicle
        return Vehicle(
            name=body.name,
            mass_properties=MassProperties(
                mass_kg=body.mass_kg,
                cg_m=body.cg_m,
                inertia=body.inertia,
                mass_sigma_kg=body.mass_sigma_kg,
                cg_sigma_m=body.cg_sigma_m,
                inertia_sigma=body.inertia_sigma,
            ),
            tilt_rad=body.tilt_rad,
            area_m2=body.area_m2,
            span_m=body.span_m,
            chord_m=body.chord_m,
            effectors=self.effector,
            rotors=self.rotor,
            wings=self.wing,
            groups=self.group,
        )

    def _check_angles(self) -> None:
        """Refuse surfaces and tilts that go beyond a full turn: they are stated in degrees."""
        for one in self.effector:
            if one.unit == "rad" and any(isfinite(x) and abs(x) > 2 * pi for x in one.limits):
                low, high = (radians(x) for x in one.limits)
                raise ValueError(
                    f"limits of '{one.name}' are {list(one.limits)} rad, more than a full turn; angles are "
                    f"in rad: were they meant in degrees, state [{low:.4g}, {high:.4g}]"
                )

    def _check_excitations(self) -> None:
        """Refuse an excitation for a reference that is not there, or one that does not fit."""
        ids = [at.id for at in self.reference]
        for identifier in self.excitation.at if self.excitation else ():
            if identifier not in ids:
                raise ValueError(
                    f"excitation.at names reference '{identifier}', which is not described; "
                    + nearest(identifier, ids)
                )
            self.at(identifier)

    def _check_surfaces(self) -> None:
        """Refuse a place of what is no surface, one stated twice, or one on a wing that is not described."""
        known = {e.name for e in self.effector if e.kind == "surface"}
        wings = {w.name for w in self.wing}
        names = [s.name for s in self.surface]
        for one in self.surface:
            if one.name not in known:
                raise ValueError(
                    f"surface '{one.name}' is no effector of kind 'surface'; {nearest(one.name, known)}"
                )
            if names.count(one.name) > 1:
                raise ValueError(f"surface '{one.name}' is described more than once")
            if one.wing is not None and one.wing not in wings:
                raise ValueError(
                    f"surface '{one.name}' is on wing '{one.wing}', which is not described; "
                    + nearest(one.wing, wings)
                )

    def at(self, identifier: str) -> Scenario:
        """Return the scenario as it is flown at a reference condition: with the excitation stated for it.

        Parameters
        ----------
        identifier : str
            Of the reference; nothing changes where nothing is stated for it.
        """
        if self.excitation is None or identifier not in self.excitation.at:
            return self
        try:
            there = self.excitation.at_reference(identifier)
        except (ValueError, msgspec.ValidationError) as error:
            raise ValueError(f"excitation.at.{identifier}: {error}") from None
        return msgspec.structs.replace(self, excitation=there)

    @property
    def campaign_start(self) -> str:
        """Id of the reference condition that a campaign starts from; empty where the scenario has none."""
        named = self.campaign.start if self.campaign else ""
        return named or (self.reference[0].id if self.reference else "")

    @property
    def schedulable(self) -> tuple[str, ...]:
        """What a reference condition may set beside speed and density: tilts first."""
        effectors = sorted(self.effector, key=lambda e: e.kind != "tilt")
        known = (*(e.name for e in effectors), *(n for n in (*STATE, *AIR) if n not in ("u", "rho")))
        return (*known, ADVANCE_RATIO) if any(r.diameter_m for r in self.rotor) else known

    def reference_of(self, identifier: str) -> Reference:
        """Return one reference condition.

        Parameters
        ----------
        identifier : str
            Its id, ``u45``.

        Raises
        ------
        UsageError
            Where the scenario has none of that id.
        """
        for reference in self.reference:
            if reference.id == identifier:
                return reference
        raise UsageError(
            f"the scenario has no reference '{identifier}'",
            remedy=nearest(identifier, (r.id for r in self.reference)),
        )


class _Written(Scenario, frozen=True):
    """A scenario as TOML has it: ``de1.gain = 0.01`` without quotes is a table in a table."""

    tolerance: dict[str, float | dict[str, Any]] = msgspec.field(default_factory=dict)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        for name in _FROM_THE_FILE:
            if getattr(self, name):
                raise ValueError(f"Object contains unknown field `{name}`")
        super().__post_init__()


def find_scenario(name: Path | str) -> Path:
    """Return the path of a scenario file, or of a shipped scenario that is named without path and suffix.

    Examples
    --------
    >>> find_scenario("la8").name
    'la8.toml'
    >>> find_scenario("my.toml").name
    'my.toml'
    """
    path = Path(name)
    if path.parent == Path() and not path.suffix and not path.exists():
        shipped = SHIPPED / f"{path}.toml"
        if shipped.is_file():
            return shipped
    return path


def is_scenario(path: Path | str) -> bool:
    """Tell whether a path or name is that of a scenario: a TOML file that describes a vehicle."""
    found = find_scenario(path)
    if found.suffix != ".toml" or not found.is_file():
        return False
    try:
        return "vehicle" in parse_toml(found)[0]
    except DataError:
        return False


def read_scenario(path: Path | str) -> tuple[Scenario, str]:
    """Read and validate a scenario file, or a shipped scenario by its name.

    Returns
    -------
    scenario : Scenario
    sha256 : str
        Of the file's bytes, which the scenario has too.

    Raises
    ------
    DataError, UsageError
        As `freqid.core.toml.read_toml`.
    """
    written, sha256 = read_toml(find_scenario(path), _Written, _with_scheduled)
    sections: dict[str, Any] = {name: getattr(written, name) for name in Scenario.__struct_fields__}
    try:
        sections["tolerance"] = msgspec.convert(_dotted(written.tolerance), dict[str, float])
    except msgspec.ValidationError as error:
        raise UsageError(f"at tolerance: {error}", where=str(path)) from None
    sections |= {"file": str(path), "sha256": sha256}
    return Scenario(**sections), sha256


def _with_scheduled(table: dict[str, Any]) -> dict[str, Any]:
    """Return a file's table with what its references set in tables of their own.

    Earlier releases knew two angles, ``dw1`` and ``dw2``, of the first and the second wing whatever their
    effectors were called; they are still read so.
    """
    if not isinstance(table.get("reference"), list):
        return table
    rows = {kind: table.get(kind, []) for kind in ("effector", "wing")}
    effectors, wings = (
        [row for row in found if isinstance(row, dict)] if isinstance(found, list) else []
        for found in rows.values()
    )
    names = {e.get("name") for e in effectors}
    second: dict[str, Any] = {
        n: w.get("tilt") for n, w in zip(("dw1", "dw2"), wings, strict=False) if n not in names
    }

    def current(reference: Any) -> Any:
        if not isinstance(reference, dict):
            return reference
        renamed = {second.get(k, k): v for k, v in reference.items()}
        still = [n for n in ("dw1", "dw2") if n not in names and renamed.get(n) == 0]
        return _nested({k: v for k, v in renamed.items() if k not in still})

    return table | {"reference": [current(one) for one in table["reference"]]}


def _dotted(table: Mapping[str, Any], stem: str = "") -> dict[str, Any]:
    """Return the entries of tables in tables by dotted name."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        out |= _dotted(value, f"{stem}{key}.") if isinstance(value, dict) else {f"{stem}{key}": value}
    return out

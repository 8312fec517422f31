"""Section ``[simulation.airframe]`` of a scenario: what only the simulation knows of the airframe."""

from __future__ import annotations

from freqid.core.errors import UsageError, nearest
from freqid.core.scenario import Scenario
from freqid.core.toml import convert
from freqid.core.vehicle import Strict, Vector, Vehicle
from freqid.dynamics.frames import shaft_axis

PANELS = ("tail-left", "tail-right")


class PropellerSection(Strict, frozen=True):
    """``propeller``: coefficients of `propeller.Propellers`, the same for all rotors.

    Attributes
    ----------
    thrust, torque : tuple of 4 floats
        c0 to c3 of CT and CQ.
    crossflow_thrust, inplane_force, hub_moment : float
        Zero where absent.
    """

    thrust: tuple[float, float, float, float]
    torque: tuple[float, float, float, float]
    crossflow_thrust: float = 0.0
    inplane_force: float = 0.0
    hub_moment: float = 0.0


class AerofoilSection(Strict, frozen=True):
    """``aerofoil`` of the wings or the tail.

    Attributes
    ----------
    lift_slope : float
        Of the section, per rad.
    zero_lift_rad : float
        Angle of attack without lift.
    stall_rad : float
        Angle of attack where half the flow has separated.
    drag, lift_drag, plate, moment : float
        As in `wing.Section`.
    """

    lift_slope: float
    zero_lift_rad: float
    stall_rad: float
    drag: float
    lift_drag: float
    plate: float
    moment: float


class WingSection(Strict, frozen=True):
    """``wing``: one for each ``[[wing]]``, front first; its quarter-chord line is straight, along y.

    Attributes
    ----------
    name : str
        Of the ``[[wing]]``.
    span_m : float
    chord_m : tuple of 2 floats
        At the root and the tip.
    quarter_chord_m : tuple of 2 floats
        x and z of the quarter-chord line at zero tilt, vehicle axes.
    """

    name: str
    span_m: float
    chord_m: tuple[float, float]
    quarter_chord_m: tuple[float, float]


class SurfaceSection(Strict, frozen=True):
    """``surface``: where one effector of kind surface is.

    Attributes
    ----------
    name : str
        Of the effector.
    on : str
        A wing, or ``tail-left`` or ``tail-right``.
    span_m : tuple of 2 floats
        From and to, positive to the right; ignored on the tail, where it spans the panel.
    chord_fraction : float
        Of the section's chord, over 0 and up to 1.
    """

    name: str
    on: str
    chord_fraction: float
    span_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.chord_fraction <= 1.0:
            raise ValueError(f"chord_fraction is {self.chord_fraction:g}, expected over 0 and up to 1")


class TailSection(Strict, frozen=True):
    """``tail``: two panels, mirrored.

    Attributes
    ----------
    centre_m : tuple of 3 floats
        Quarter-chord point of the right panel's middle, vehicle axes.
    span_m, chord_m : float
        Of one panel.
    dihedral_rad : float
        Negative where the panels hang down (inverted V).
    incidence_rad : float
        Leading edge up.
    """

    centre_m: Vector
    span_m: float
    chord_m: float
    dihedral_rad: float
    incidence_rad: float
    aerofoil: AerofoilSection


class FuselageSection(Strict, frozen=True):
    """``fuselage``: as in `fuselage.Fuselage`."""

    centre_m: Vector
    drag_area_m2: Vector
    volume_m3: float


class WakeSection(Strict, frozen=True):
    """``wake``: as in `wake.Wakes`."""

    depth_m: float
    downwash: float
    blowing: float


class AirframeSection(Strict, frozen=True):
    """``[simulation.airframe]``.

    Attributes
    ----------
    strips : int
        On each wing.
    mixing_m : float
        Half the thickness of the slipstreams' edges.
    surface_efficiency : float
        Of all surfaces, over thin-aerofoil theory.
    """

    propeller: PropellerSection
    aerofoil: AerofoilSection
    wing: tuple[WingSection, WingSection]
    surface: tuple[SurfaceSection, ...]
    tail: TailSection
    fuselage: FuselageSection
    wake: WakeSection
    mixing_m: float
    surface_efficiency: float
    strips: int = 16


def read_airframe(scenario: Scenario) -> AirframeSection:
    """Return the section, checked against the vehicle.

    Raises
    ------
    UsageError
        Where it is missing, has an unknown key or does not fit the vehicle.
    """
    if not scenario.simulation.airframe:
        raise UsageError("the scenario has no [simulation.airframe]", remedy="describe the airframe there")
    section = convert(scenario.simulation.airframe, AirframeSection, "simulation.airframe")
    _check(section, scenario.aircraft())
    return section


def _check(section: AirframeSection, vehicle: Vehicle) -> None:
    """Refuse names that do not fit the vehicle, and rotors that the slipstream cannot place."""
    wings = [w.name for w in vehicle.wings]
    described = [w.name for w in section.wing]
    if described != wings:
        raise UsageError(
            f"simulation.airframe.wing names {described}, expected {wings} in the same order as [[wing]]"
        )
    surfaces = [e.name for e in vehicle.effectors if e.kind == "surface"]
    for surface in section.surface:
        if surface.name not in surfaces:
            raise UsageError(
                f"simulation.airframe.surface '{surface.name}' is no effector of kind surface",
                remedy=nearest(surface.name, surfaces),
            )
        if surface.on not in (*wings, *PANELS):
            raise UsageError(
                f"simulation.airframe.surface '{surface.name}' is on '{surface.on}'",
                remedy=nearest(surface.on, (*wings, *PANELS)),
            )
    missing = [name for name in surfaces if name not in {s.name for s in section.surface}]
    if missing:
        raise UsageError(
            f"simulation.airframe.surface has no entry for {missing}", remedy="say where each is"
        )
    for rotor in vehicle.rotors:
        if rotor.diameter_m is None:
            raise UsageError(f"rotor '{rotor.name}' has no diameter_m", remedy="add it to its [[rotor]]")
        if rotor.wing is not None and abs(shaft_axis(rotor.axis, 0.0)[0] - 1) > 1e-9:
            raise UsageError(
                f"rotor '{rotor.name}' on wing '{rotor.wing}' has axis {list(rotor.axis)}, expected "
                "[1, 0, 0]: the slipstream is taken to flow along the chord"
            )

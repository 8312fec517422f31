"""Whether a scenario says enough: what each command would miss, and the point that moments are about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from freqid.core.channels import AIR, STATE, WRENCH
from freqid.core.errors import FreqidError
from freqid.core.scenario import Scenario, find_scenario
from freqid.core.sections.identification import factors_of
from freqid.dynamics.mass import centre_of_gravity, without_wings
from freqid.workflows.inputs import File, scenario_of
from freqid.workflows.scenarios.new_scenario import Placeholder, placeholders


@dataclass(frozen=True)
class MomentPoint:
    """The point that applied moments are about at a reference condition: the centre of gravity there.

    Attributes
    ----------
    reference : str
        Its id; empty for the vehicle as it is described.
    position_m : tuple of 3 floats
        Vehicle axes, m, with all wings at the tilts of the reference.
    """

    reference: str
    position_m: tuple[float, float, float]


@dataclass(frozen=True)
class ScenarioCheck:
    """What a scenario says, by what it is needed for.

    Attributes
    ----------
    vehicle : str
    missing : dict of str to tuple of str
        By command, one sentence for each thing that is missing; none where it is ready.
    notes : tuple of str
        What may be meant so, and is worth a look.
    placeholders : tuple of Placeholder
        Lines of the file that are to be filled in, with their section and key.
    moment_points : tuple of MomentPoint
    """

    vehicle: str
    missing: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...] = ()
    placeholders: tuple[Placeholder, ...] = ()
    moment_points: tuple[MomentPoint, ...] = field(default=())

    def ready(self, command: str) -> bool:
        """Tell whether nothing is missing for a command."""
        return not self.missing[command]

    def to_json(self) -> dict[str, Any]:
        """Return everything as plain tables, for ``freqid check --json``."""
        return asdict(self)

    def __str__(self) -> str:
        lines = [self.vehicle, ""]
        for command, sentences in self.missing.items():
            lines.append(
                f"{command:<16}" + ("ready" if not sentences else "missing: " + "; ".join(sentences))
            )
        lines += [
            "",
            "Moments are about the centre of gravity, vehicle axes, m (x forward, y right, z down):",
        ]
        for point in self.moment_points:
            x, y, z = (f"{value + 0.0:.4f}" for value in point.position_m)
            lines.append(f"  {point.reference or 'as described':<16}x {x}  y {y}  z {z}")
        if self.notes:
            lines += ["", "Worth a look:", *(f"  {note}" for note in self.notes)]
        if self.placeholders:
            lines += ["", "To be filled in:"]
            for section, group in groupby(self.placeholders, key=lambda p: p.section):
                left = list(group)
                keys = ", ".join(p.key for p in left if p.key) or "all"
                first, last = left[0].line, left[-1].line
                where = f"line {first}" if first == last else f"lines {first} to {last}"
                lines.append(f"  {section:<28}{keys} ({where})")
        return "\n".join(lines)


def check_scenario(scenario: Scenario | File) -> ScenarioCheck:
    """Say for each command what a scenario lacks, and where its moments are taken.

    Parameters
    ----------
    scenario : Scenario, path or name

    Returns
    -------
    ScenarioCheck

    Raises
    ------
    DataError, UsageError
        Where the file cannot be read, or something in it does not fit together.

    Examples
    --------
    >>> check_scenario("la8").ready("design-inputs")
    True
    """
    described = scenario_of(scenario)
    designs, identifies = _design(described), _identify(described)
    simulates = _simulate(described)
    missing = {
        "design-inputs": designs,
        "simulate": simulates,
        "import-log": () if described.effector else ("[[effector]]: kinds, and so units, of what is logged",),
        "identify-point": identifies,
        "global-blend": (*identifies, *_blend(described)),
        # with --sim it needs no regressors
        "diagnose-gap": identifies if described.simulation.loads else _body(described),
        "study --flights": (*identifies, *_blend(described)),
        "study": tuple(dict.fromkeys((*designs, *simulates, *identifies, *_blend(described)))),
    }
    path = find_scenario(described.file) if described.file else None
    found = placeholders(path) if path is not None else []
    try:
        points = _moment_points(described)
    except FreqidError as error:
        raise error.at(described.file) from None
    return ScenarioCheck(
        vehicle=repr(described).strip("<>"),
        missing=missing,
        notes=_notes(described),
        placeholders=tuple(found),
        moment_points=points,
    )


def _design(scenario: Scenario) -> tuple[str, ...]:
    """Return what inputs cannot be designed without; where all is there, a condition that is not feasible."""
    from freqid.design.multisine.orthogonal_set import excited

    if not scenario.effector:
        return ("[[effector]]: what is moved",)
    if scenario.excitation is None:
        return ("[excitation]: band_hz, period_s and amplitudes",)
    out = []
    for at in ("", *scenario.excitation.at):
        excitation = scenario.at(at).excitation
        assert excitation is not None
        try:
            chosen = excited(excitation, scenario.effector)
        except FreqidError as error:
            return (error.message,)
        low, high = excitation.band_hz
        room = int((high - low) * excitation.period_s)
        if room < len(chosen):
            out.append(f"[excitation]: {room} harmonics in the band are too few for {len(chosen)} effectors")
    for reference in scenario.reference:
        for effector in scenario.effector:
            value = reference.scheduled.get(effector.name)
            if value is not None and not effector.limits[0] <= value <= effector.limits[1]:
                out.append(
                    f"reference '{reference.id}' sets {effector.name} = {value:g}, outside its limits "
                    f"{list(effector.limits)}"
                )
    return tuple(out)


def _identify(scenario: Scenario) -> tuple[str, ...]:
    out = []
    if not scenario.reference:
        out.append("[[reference]]: the condition that a model holds at")
    settings = scenario.identification
    if settings is None:
        return (*out, "[identification]: regressors")
    if settings.frequencies_hz is None and scenario.excitation is None:
        out.append("identification.frequencies_hz, or [excitation] whose harmonics are used")
    known = {*STATE, *AIR, *(e.name for e in scenario.effector)}
    named = {f for r in settings.responses for n in settings.regressors_of(r) for f in factors_of(n)}
    unknown = sorted(named - known)
    if unknown:
        out.append(f"[[effector]] of regressor {', '.join(unknown)}")
    if settings.residuals == "noise-lines" and scenario.excitation and scenario.excitation.periods < 2:
        out.append("excitation.periods of two or more, for residuals 'noise-lines'")
    return (*out, *_body(scenario))


def _body(scenario: Scenario) -> tuple[str, ...]:
    """Return why what does not tilt is no body: applied moments need its mass and inertia."""
    vehicle = scenario.aircraft()
    heavy = [w for w in vehicle.wings if w.mass_kg or w.inertia.matrix.any()]
    try:
        without_wings(vehicle, heavy, vehicle.mass_properties.cg_m)
    except FreqidError as error:
        return (error.message,)
    return ()


def _blend(scenario: Scenario) -> tuple[str, ...]:
    out = []
    if len(scenario.reference) < 2:
        out.append(f"[[reference]]: two conditions or more, found {len(scenario.reference)}")
    settings = scenario.identification
    if settings and settings.axes != "body":
        out.append("identification.axes 'body'")
    lacking = [r for r in WRENCH if settings and r not in settings.responses]
    if lacking:
        out.append(f"identification.responses {' '.join(lacking)}, for state-space models")
    return tuple(out)


def _simulate(scenario: Scenario) -> tuple[str, ...]:
    """Return what a flight of freqid's own simulation lacks; the simulation itself is asked."""
    out = []
    if not scenario.reference:
        out.append("[[reference]]: where the flight starts")
    if not any(name in scenario.control for name in ("lq", "gains", "tecs")):
        out.append("[control]: the law that flies it, such as [control.lq]")
    if not scenario.simulation.loads:
        return (
            *out,
            f"[simulation.{scenario.simulation.kind}]: the loads, or fly it with your own simulation",
        )
    from freqid.simulate.motion.whole_vehicle import parameters  # loads jax

    try:
        parameters(scenario)
    except FreqidError as error:
        out.append(error.message)
    if not scenario.simulation.sensors:
        out.append("[simulation.sensors.NAME]: what is logged")
    return tuple(out)


def _notes(scenario: Scenario) -> tuple[str, ...]:
    vehicle, notes = scenario.aircraft(), []
    described = {r.name for r in vehicle.rotors}
    bare = [e.name for e in vehicle.effectors if e.kind == "rotor" and e.name not in described]
    if bare:
        notes.append(f"no [[rotor]] for {', '.join(bare)}: their angular momentum is left out")
    still = [r.name for r in vehicle.rotors if not r.inertia]
    if still:
        notes.append(f"rotors without inertia: {', '.join(still)}; their angular momentum is left out")
    carried = {w.tilt for w in vehicle.wings}
    alone = [e.name for e in vehicle.effectors if e.kind == "tilt" and e.name not in carried]
    if alone:
        notes.append(
            f"no [[wing]] turns with {', '.join(alone)}: centre of gravity and rotors stay where they are"
        )
    if not scenario.simulation.airframe:
        placed = {s.name for s in scenario.surface}
        unplaced = [e.name for e in vehicle.effectors if e.kind == "surface" and e.name not in placed]
        if unplaced:
            notes.append(f"no [[surface]] says where {', '.join(unplaced)} are: they are not drawn")
        shapeless = [r.name for r in vehicle.rotors if not r.diameter_m]
        if shapeless:
            notes.append(f"[[rotor]] without diameter_m: {', '.join(shapeless)}; no disc is drawn")
        notes.append("no [simulation.airframe]: wings, tails and body have no shape and are not drawn")
    light = [w.name for w in vehicle.wings if not w.mass_kg]
    if light:
        notes.append(
            f"[[wing]] without mass: {', '.join(light)}; the centre of gravity does not move with it"
        )
    if not scenario.simulation.loads:
        notes.append("no loads in [simulation]: diagnose-gap needs a simulation of your own, with --sim")
    tilts = [e.name for e in vehicle.effectors if e.kind == "tilt"]
    unset = {r.id: [t for t in tilts if t not in r.scheduled] for r in scenario.reference if tilts}
    for identifier, names in unset.items():
        if names:
            notes.append(f"reference '{identifier}' does not set {', '.join(names)}: taken as zero")
    return tuple(notes)


def _moment_points(scenario: Scenario) -> tuple[MomentPoint, ...]:
    vehicle = scenario.aircraft()
    if not any(w.mass_kg for w in vehicle.wings):
        return (MomentPoint("", vehicle.mass_properties.cg_m),)
    points = []
    for reference in scenario.reference:
        tilts = {w.tilt: reference.scheduled.get(w.tilt, 0.0) for w in vehicle.wings}
        x, y, z = (float(value) for value in centre_of_gravity(vehicle, tilts))
        points.append(MomentPoint(reference.id, (x, y, z)))
    return tuple(points) or (MomentPoint("", vehicle.mass_properties.cg_m),)


def three_view_of(scenario: Scenario | File) -> Path:
    """Return the default file of a scenario's drawing: its name with -three-view.svg."""
    described = scenario_of(scenario)
    stem = Path(described.file).stem if described.file else described.vehicle.name
    return Path(f"{stem}-three-view.svg")

"""A flight in place of the aircraft, logged as the aircraft would log it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, write_record
from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs, read_inputs
from freqid.core.scenario import Reference, Scenario
from freqid.design.multisine.orthogonal_set import sampled
from freqid.simulate import effects as library
from freqid.simulate.control.lq import ClosedLoop, close_loop
from freqid.simulate.effects.files import load_file
from freqid.simulate.maneuver import Conditions, Flown, fly_maneuver, with_effects
from freqid.simulate.truth import truth_path, write_truth
from freqid.workflows.design import DesignedInputs
from freqid.workflows.inputs import File, name_of, scenario_of

Design = DesignedInputs | MultisineDesign | ClassicDesign | SampledInputs | File
Effects = Mapping[str, float | Mapping[str, float]] | Sequence[str]


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedManeuver:
    """A manoeuvre that was flown in place of the aircraft.

    Attributes
    ----------
    scenario : Scenario
        With the effects that acted.
    flown : Flown
        What was logged, what was true, and the flight itself.
    loop : ClosedLoop
        Control law, and the trims of its corridor.
    design : str
        File of the excitation; empty without one, or of one that has no file.
    to : str
        Reference condition that was flown to; empty where the first was held.
    """

    scenario: Scenario
    flown: Flown
    loop: ClosedLoop = field(repr=False)
    design: str = ""
    to: str = ""

    def __repr__(self) -> str:
        return f"<SimulatedManeuver at {self.truth.reference!r}: {self.record!r}>"

    def to_frame(self) -> Any:
        """Return what was logged as a `pandas.DataFrame`."""
        return self.record.to_frame()

    def plot(self) -> Any:
        """Return what was logged drawn, as a `matplotlib.figure.Figure`."""
        return self.record.plot()

    def _repr_html_(self) -> str:
        return self.record._repr_html_()

    @property
    def record(self) -> FlightRecord:
        """What the aircraft logged."""
        return self.flown.record

    @property
    def truth(self) -> FlightRecord:
        """What the vehicle truly did; no identification may see it."""
        return self.flown.truth

    @property
    def divergence(self) -> str:
        """Where and how the flight left all limits; empty where it did not."""
        return str(self.flown.divergence or "")

    @cached_property
    def excursions(self) -> dict[str, dict[str, Any]]:
        """By state: ``largest`` deviation from the start and ``unit``, SI; with abort limits ``limit``."""
        abort = self.scenario.excitation.abort if self.scenario.excitation else {}
        found = {}
        for name in dict.fromkeys(("u", "v", "w", "p", "q", "r", "phi", "theta", *abort)):
            values = self.truth[f"state/{name}"]
            largest = float(np.max(np.abs(values - values[0])))
            found[name] = {"largest": largest, "unit": self.truth.channel(f"state/{name}").unit}
            if name in abort:
                found[name] |= {"limit": abort[name], "inside": largest <= abort[name]}
        return found

    def save(self, path: File) -> Path:
        """Write the record, and the truth beside it in a file that no other command reads."""
        write_record(Path(path), self.record, self.scenario.sha256)
        write_truth(truth_path(Path(path)), self.truth, self.scenario.sha256)
        return Path(path)

    def refuse_divergence(self, where: str) -> None:
        """Raise where the flight left all limits.

        Raises
        ------
        DataError
            With how it did; `where` is the record's file.
        """
        if self.divergence:
            raise DataError(
                self.divergence,
                where=where,
                remedy="the record holds the flight up to there; lower the inputs, or fly with feedback",
            )


@on_one_thread
def simulate(
    scenario: Scenario | File,
    design: Design | None = None,
    *,
    at: str | None = None,
    to: str | None = None,
    duration: float | None = None,
    sensors: str = "research",
    noise: float = 0.0,
    turbulence: float = 0.0,
    seed: int = 0,
    effects: Effects = (),
    own_effects: File | None = None,
    feedback: bool = True,
    loop: ClosedLoop | None = None,
) -> SimulatedManeuver:
    """Fly the vehicle of a scenario, excited by a design after its control law, and log what it logs.

    Parameters
    ----------
    scenario : Scenario, path or name
    design : DesignedInputs, MultisineDesign, ClassicDesign or path, optional
        Excitation; without it the condition is held.
    at : str, optional
        Reference condition to start from, trimmed; needed where there are several.
    to : str, optional
        Fly on to this condition, for example through the transition.
    duration : float, optional
        s; as long as the design where not given.
    sensors : str
        Suite of the scenario.
    noise : float
        Multiple of the suite's noise; at zero the sensors have no error at all.
    turbulence : float
        Wind at 20 ft that the gusts go with, m/s; zero for none.
    seed : int
        Of wind, gusts and sensor errors.
    effects : mapping, or sequence of str
        By effect id: its size, or its parameters by name; or words such as ``"wing_wake=0.5"``.
    own_effects : path, optional
        Python file with effects of your own, set like the others.
    feedback : bool
        Without it the trim's commands are held.
    loop : ClosedLoop, optional
        Of the same scenario and density, where it is at hand.

    Returns
    -------
    SimulatedManeuver
        Its ``record`` is a `FlightRecord`; its ``truth`` is for judging results alone. A flight that left all
        limits ends there and says so in ``divergence``.

    Raises
    ------
    UsageError
        Where no condition is chosen, it cannot be trimmed, or an effect or suite is unknown.
    DataError
        Where a file cannot be read, or the flight diverges before there is anything to log.

    Notes
    -----
    Tilting wings and rotors on a rigid body, strip theory in the slipstream
    (docs/theory/simulation-airframe.md).

    Examples
    --------
    >>> flown = simulate("la8", at="u45", duration=2.0)
    >>> flown.record.reference
    'u45'
    """
    described = scenario_of(scenario)
    start = start_of(described, at)
    inputs = design_samples(design)
    settings = effect_settings(effects, own_effects)
    if turbulence:
        settings["turbulence"] = turbulence
    described = with_effects(described, settings)
    loop = loop or close_loop(described, start)
    flown = fly_maneuver(
        described,
        start,
        inputs,
        Conditions(sensors, noise, feedback=feedback, seed=seed),
        loop=loop,
        duration=duration,
        to=described.reference_of(to) if to else None,
    )
    name = Path(design).name if isinstance(design, str | Path) else ""
    return SimulatedManeuver(described, flown, loop, name, to or "")


def start_of(scenario: Scenario, at: str | None = "") -> Reference:
    """Return the condition that a flight starts from; the only one, where there is one and none is named.

    Raises
    ------
    UsageError
        Where there are several, none, or none of that id.
    """
    identifiers = [reference.id for reference in scenario.reference]
    if not at and len(identifiers) != 1:
        raise UsageError(
            f"the scenario has {len(identifiers)} reference conditions",
            where=name_of(scenario),
            remedy=f"choose one with --at, such as --at {identifiers[0]}" if identifiers else "add one",
        )
    return scenario.reference_of(at or identifiers[0])


def design_samples(design: Design | None) -> SampledInputs | None:
    """Return the samples of a design, read where a path is given."""
    if isinstance(design, str | Path):
        return read_inputs(Path(design))
    if isinstance(design, MultisineDesign):
        return sampled(design)
    return design.inputs if isinstance(design, DesignedInputs | ClassicDesign) else design


def effect_settings(effects: Effects, own: File | None = None) -> dict[str, Any]:
    """Return effect settings from ``NAME=VALUE`` and ``NAME.PARAMETER=VALUE``; a file's effects count too.

    Raises
    ------
    UsageError
        Where a text is none of these, or names an unknown effect.
    """
    for effect in load_file(Path(own)).values() if own else ():
        library.register(effect)
    if isinstance(effects, Mapping):
        return {name: dict(value) if isinstance(value, Mapping) else value for name, value in effects.items()}
    settings: dict[str, Any] = {}
    for text in effects:
        name, _, value = text.partition("=")
        identifier, _, parameter = name.partition(".")
        try:
            number = float(value)
        except ValueError:
            raise UsageError(
                f"--effect is NAME=VALUE with a number, such as wing_wake=0.5, not '{text}'"
            ) from None
        parameter = parameter or library.find(identifier).size
        settings.setdefault(identifier, {})[parameter] = number
    return settings

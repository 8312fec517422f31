"""Cases on disk: records, the simulation, the scenario and what is true of them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from models import LOADS
from records import Flight, scenario_text
from splice import Splice

from freqid.core.record import FlightRecord, write_record

HERE = Path(__file__).parent
Span = tuple[str, float, float]


@dataclass(frozen=True)
class Judged:
    """Flights that are diagnosed together, and the simulation that they are held against.

    Attributes
    ----------
    name : str
        Unique within the aircraft.
    aircraft : str
    use, holdout : sequence of (Flight, span or None)
        A span is its label, start and stop, s from the beginning.
    model : mapping
        Content of ``simulation.json``.
    identification : str
        Section ``[identification]`` of the scenario.
    band_hz : tuple of 2 floats
    splices : sequence of Splice
        Each makes one case beside the untouched one.
    null : bool
        Whether the untouched flights are a case without a gap.
    simulation : str
        File of this folder that is copied into the case.
    function : str
        In that file.
    truth : mapping, optional
        Effects of the untouched flight where it is known to have a gap.
    knows_mass : bool
        Whether the scenario states uncertainties of mass and inertia.
    """

    name: str
    aircraft: str
    use: Sequence[tuple[Flight, Span | None]]
    model: Mapping[str, Any]
    identification: str
    band_hz: tuple[float, float]
    splices: Sequence[Splice] = ()
    holdout: Sequence[tuple[Flight, Span | None]] = ()
    null: bool = True
    simulation: str = "simulation.py"
    function: str = "wrench"
    truth: Mapping[str, Any] | None = None
    knows_mass: bool = True

    def flights(self) -> list[Flight]:
        """Return the untouched flights, cut."""
        return [_cut(flight, span, None) for flight, span in self.use]


def identification_text(
    responses: Sequence[str],
    regressors: Mapping[str, Sequence[str]],
    lines: Any,
    extra: str = 'form = "coefficient"',
) -> str:
    """Return section ``[identification]`` as TOML."""
    grid = f"{{ start = {lines.start:g}, step = {lines.step:g}, stop = {lines.stop:g} }}"
    text = ["[identification]", f"responses = {json.dumps(list(responses))}", extra]
    text += [f"frequencies_hz = {grid}", "", "[identification.regressors]"]
    text += [f"{r} = {json.dumps(list(names))}" for r, names in regressors.items()]
    return "\n".join(text)


def write_cases(judged: Judged, out: Path, quality: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Write the untouched case and every spliced one; return what is true of each.

    Parameters
    ----------
    judged : Judged
    out : Path
        Folder of the cases.
    quality : mapping
        How well the simulation fits the untouched flights, kept beside the truth.
    """
    chosen: list[Splice | None] = [None] if judged.null or judged.truth else []
    return [_write(judged, splice, out, quality) for splice in [*chosen, *judged.splices]]


def as_logged(record: FlightRecord) -> FlightRecord:
    """Return a record without velocities where only flow angles were measured.

    Where the vanes of these aircraft are is not published: velocities at the centre of gravity would have to
    assume it, and their relations to accelerations miss by a boom of 2 to 15 m, which is no splice of ours.
    """
    if "air/alpha" not in record:
        return record
    velocities = ("state/u", "state/v", "state/w")
    return replace(record, channels={n: c for n, c in record.channels.items() if n not in velocities})


def remove_cases(aircraft: str, out: Path) -> None:
    """Remove the cases of an aircraft that an earlier run left."""
    for about in out.glob(f"{aircraft}-*/case.json"):
        shutil.rmtree(about.parent)


def _cut(flight: Flight, span: Span | None, splice: Splice | None) -> Flight:
    changed = flight if splice is None else Flight(flight.name, splice.change(flight.record))
    return changed if span is None else changed.segment(*span)


def _write(judged: Judged, splice: Splice | None, out: Path, quality: Mapping[str, Any]) -> dict[str, Any]:
    suffix = splice.label if splice else ("known" if judged.truth else "null")
    case = f"{judged.aircraft}-{judged.name}-{suffix}"
    folder = out / case
    folder.mkdir(parents=True)
    names: dict[str, list[str]] = {"use": [], "holdout": []}
    first = None
    for role, flights in (("use", judged.use), ("holdout", judged.holdout)):
        for flight, span in flights:
            cut = _cut(flight, span, splice)
            first = first or cut
            write_record(folder / f"{cut.name}.h5", as_logged(cut.record))
            names[role].append(f"{cut.name}.h5")
    scenario = scenario_text(first.record, judged.identification, judged.knows_mass)
    (folder / "scenario.toml").write_text(scenario)
    shutil.copy(HERE / judged.simulation, folder / judged.simulation)
    model = {**judged.model, **_believed(first.record)}
    (folder / "simulation.json").write_text(json.dumps(model, indent=1) + "\n")
    about = {
        "case": case,
        "vehicle": first.record.vehicle.name,
        "set": "real",
        "aircraft": judged.aircraft,
        **_truth(judged, splice),
        "stratum": None,
        **names,
        "simulation": f"{judged.simulation}:{judged.function}",
        "scenario": "scenario.toml",
        "band_hz": list(judged.band_hz),
        "identified_from": judged.model.get("identified_from", []),
        **quality,
    }
    (folder / "case.json").write_text(json.dumps(about, indent=1) + "\n")
    return about


def _believed(record: FlightRecord) -> dict[str, Any]:
    """Return the mass properties that the simulation flies with: those that its owner states."""
    mass = record.vehicle.mass_properties
    return {
        "mass_kg": mass.mass_kg,
        "inertia": [getattr(mass.inertia, k) for k in ("xx", "yy", "zz", "xz")],
    }


def _truth(judged: Judged, splice: Splice | None) -> dict[str, Any]:
    if splice is not None:
        return {
            "kind": "single",
            "effects": {splice.effect: {splice.parameter: splice.size}},
            "place": {splice.effect: splice.place},
            "aliases": list(splice.aliases),
        }
    if judged.truth:
        return {"kind": "single", **judged.truth}
    return {"kind": "null", "effects": {}, "place": {}, "aliases": []}


def shaped_text(shape: Any, duration: float) -> str:
    """Return section ``[identification]`` of the responses that a linear simulation gives."""
    loads = {LOADS[c]: shape.regressors[c] for c in shape.responses}
    return identification_text(list(loads), loads, shape.lines(duration))


def linear_case(
    name: str,
    aircraft: str,
    use: Sequence[tuple[Flight, Span | None]],
    model: Mapping[str, Any],
    shape: Any,
    **more: Any,
) -> Judged:
    """Return flights held against a linear simulation of their `shape`."""
    shortest = min(_cut(f, span, None).record.duration for f, span in use)
    text = shaped_text(shape, shortest)
    return Judged(name, aircraft, use, {**model}, text, shape.band_hz, **more)

"""One self-contained page about a simulated flight: what was flown, what it took, and a filmstrip of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import Self

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from freqid import __version__
from freqid.core.arrays import Array
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.dynamics.frames import turn_about_y
from freqid.report.design.figures import GROUP_COLOURS, signal_rows
from freqid.report.flight import figures, tables
from freqid.report.flight.aircraft import SIDE, Solid, draw_parts, outline, three_view, tilted_shaft
from freqid.report.flight.figures import draw_wide_enough
from freqid.report.flight.tables import SimulatedFlight
from freqid.report.flight.trims import name_lines, trim_curves
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    ORANGE,
    few_ticks,
    name_panel,
    share_time,
    stacked_panels,
    styled,
)
from freqid.report.kit.effectors import effector_groups, engineering
from freqid.report.kit.notation import number, pretty_unit, short
from freqid.report.kit.pictures import Picture, picture
from freqid.report.kit.rendering import render

FRAMES = 8
_WIDTH = 10.6  # inches: the strip is as wide as the page
_LEFT, _RIGHT = 0.62, 0.12
_WORDS = 0.68  # inches for what stands below a frame
_LONGEST = 0.8  # m, of the arrow of the largest thrust
_ARROW = "#009E73"


@styled
def filmstrip(scenario: Scenario, truth: FlightRecord, thrust: Array) -> Figure:
    """Draw a flight in pictures above its time histories.

    Parameters
    ----------
    scenario : Scenario
    truth : FlightRecord
        Of the flight: speed, altitude, pitch angle and effectors as they were.
    thrust : ndarray, shape (rotor, sample)
        N, in the order of the scenario's rotors; drawn summed over each wing.
    """
    vehicle = scenario.aircraft()
    instants = np.linspace(0, truth.time.size - 1, FRAMES).round().astype(int)
    scenes = [_scene(scenario, truth, thrust, int(i)) for i in instants]
    corners = np.hstack([part.points for parts, arrows in scenes for part in (*parts, *arrows)])
    (left, low), (right, high) = (SIDE @ corners).min(axis=1) - 0.04, (SIDE @ corners).max(axis=1) + 0.04
    # Frames stand over the times they show, so the first and last are centred on the ends of the axis.
    pitch = (_WIDTH - _LEFT - _RIGHT) / FRAMES
    scale = 0.98 * pitch / (right - left)
    tall = scale * (high - low)
    figure, panels = stacked_panels(
        [0.62] * 5, width=_WIDTH, top=tall + _WORDS + 0.4, left=_LEFT + pitch / 2, right=_RIGHT + pitch / 2
    )
    height = figure.get_figheight()
    for k, (i, (parts, arrows)) in enumerate(zip(instants, scenes, strict=True)):
        place = (_LEFT + (k + 0.01) * pitch, height - tall, 0.98 * pitch, tall)
        frame = figure.add_axes(
            (place[0] / _WIDTH, place[1] / height, place[2] / _WIDTH, place[3] / height), frameon=False
        )
        frame.set(xlim=(left, right), ylim=(low, high), xticks=[], yticks=[])
        draw_parts(frame, parts, SIDE, 0.5)
        for arrow in arrows:
            start, end = (SIDE @ arrow.points).T
            frame.annotate(
                "",
                end,
                start,
                arrowprops={
                    "arrowstyle": "-|>",
                    "color": _ARROW,
                    "linewidth": 1.2,
                    "shrinkA": 0,
                    "shrinkB": 0,
                },
                zorder=6,
            )
        frame.annotate(
            _words(truth, vehicle, int(i)),
            (0.5, 0.0),
            (0, -2),
            "axes fraction",
            "offset points",
            ha="center",
            va="top",
            linespacing=1.25,
        )
    _histories(panels, truth, vehicle)
    for panel in panels:
        for time in truth.time[instants]:
            panel.axvline(time, color=GREY, linewidth=0.6, linestyle=(0, (2, 2)), zorder=0.5)
    share_time(panels, truth.time)
    return figure


def largest_thrust(vehicle: Vehicle, thrust: Array) -> float:
    """Return the largest thrust of all rotors of a wing that a film of this flight shows, N."""
    return max(float(np.abs(thrust[rows].sum(axis=0)).max()) for rows in _by_wing(vehicle).values())


def _scene(
    scenario: Scenario, truth: FlightRecord, thrust: Array, sample: int
) -> tuple[list[Solid], list[Solid]]:
    """Return the aircraft at its pitch angle, and its arrows of thrust."""
    vehicle = scenario.aircraft()
    tilt = {wing.tilt: float(truth[f"effector/{wing.tilt}"][sample]) for wing in vehicle.wings}
    pitch = float(truth["state/theta"][sample])
    longest = _LONGEST / largest_thrust(vehicle, thrust)
    arrows = []
    for name, rows in _by_wing(vehicle).items():
        hubs, ahead = zip(*(tilted_shaft(vehicle, vehicle.rotors[i], tilt) for i in rows), strict=True)
        hub = np.mean(hubs, axis=0)
        tip = hub + longest * thrust[rows, sample].sum() * ahead[0]
        arrows.append(Solid("arrow", name, np.stack([hub, tip], axis=1)))
    scene = outline(scenario, tilt), arrows
    return tuple([Solid(p.kind, p.name, turn_about_y(p.points, pitch), p.group) for p in s] for s in scene)  # type: ignore[return-value]


def _by_wing(vehicle: Vehicle) -> dict[str, list[int]]:
    """Return places of the rotors by the wing that carries them."""
    places: dict[str, list[int]] = {}
    for i, rotor in enumerate(vehicle.rotors):
        places.setdefault(rotor.wing or "body", []).append(i)
    return places


def _words(truth: FlightRecord, vehicle: Vehicle, sample: int) -> str:
    tilts = [degrees(truth[f"effector/{wing.tilt}"][sample]) for wing in vehicle.wings]
    alike = not tilts or max(tilts) - min(tilts) < 0.5
    phrases = [f"{tilt:.1f}°" for tilt in (tilts[:1] if alike else tilts)]
    lines = [
        f"{truth.time[sample]:.1f} s",
        f"u {truth['state/u'][sample]:.1f} m/s",
        f"tilt {' / '.join(phrases)}" if phrases else "",
        f"pitch {degrees(truth['state/theta'][sample]):.1f}°",
    ]
    return "\n".join(line for line in lines if line).replace("-", "−")


def _histories(panels: list[Axes], truth: FlightRecord, vehicle: Vehicle) -> None:
    speed, altitude, tilt, pitch, rotors = panels
    draw_wide_enough(speed, truth.channel("state/u"), BLUE, time=truth.time)
    draw_wide_enough(altitude, truth.channel("state/alt"), BLUE, time=truth.time)
    draw_wide_enough(pitch, truth.channel("state/theta"), BLUE, time=truth.time)
    time = truth.time
    for wing, colour, width in zip(vehicle.wings, (BLUE, ORANGE), (2.0, 0.9), strict=False):
        channel = truth.channel(f"effector/{wing.tilt}")
        draw_wide_enough(tilt, channel, colour, time=time, label=wing.tilt, linewidth=width)
    for (name, rows), colour in zip(_by_wing(vehicle).items(), (BLUE, ORANGE, _ARROW), strict=False):
        for k, i in enumerate(rows):
            channel = truth.channel(f"effector/{vehicle.rotors[i].name}")
            label = {"label": f"{name} rotors"} if k == 0 else {}
            draw_wide_enough(rotors, channel, colour, time=time, linewidth=0.8, **label)
    for panel, words, unit in zip(
        panels,
        ("Forward speed u", "Altitude", "Wing tilt", "Pitch angle", "Rotor speeds"),
        ("m/s", "m", "deg", "deg", "rpm"),
        strict=True,
    ):
        name_panel(panel, words, unit)
        few_ticks(panel)
    for panel in (tilt, rotors):
        name_lines(panel)


_ROWS = 10  # signals in one figure at most, where one is enough
_STATES = ("u v w p q r", "phi theta psi alt")


def build_simulation_page(flight: SimulatedFlight) -> str:
    """Return the page of a simulated flight: one text that fetches nothing, the same for the same flight."""
    return render(
        "simulation.html",
        title=flight.scenario.vehicle.name,
        what=_what(flight),
        version=__version__,
        findings=tables.flight_findings(flight),
        facts=tables.flight_facts(flight),
        film=_film(flight) if flight.to else None,
        excursions=tables.excursion_rows(flight),
        states=_states(flight),
        effectors=tables.effector_rows(flight),
        movements=[*_effectors(flight), _bars(flight)],
        excitation=_excitation(flight),
        aircraft=[*_view(flight), *_trims(flight)],
        provenance={
            "record": flight.record,
            "scenario SHA-256": flight.scenario_sha256,
            **flight.truth.provenance,
        },
    )


def _what(flight: SimulatedFlight) -> str:
    where = f"from {flight.truth.reference} to {flight.to}" if flight.to else f"at {flight.truth.reference}"
    return f"Simulated flight {where}."


def _film(flight: SimulatedFlight) -> Picture:
    most = largest_thrust(flight.scenario.aircraft(), flight.thrust)
    return picture(
        filmstrip(flight.scenario, flight.truth, flight.thrust),
        "film",
        f"The aircraft from the side at {FRAMES} instants, and speed, altitude, tilt, pitch and rotor speeds",
        f"From the side at {FRAMES} instants, which dashed lines mark below. Green: thrust of each wing's "
        f"rotors, {number(most, 2)} N at the most. As the wings come down, lift takes over from thrust; "
        "altitude and pitch angle should stay where they are. All is truth.",
    )


def _states(flight: SimulatedFlight) -> list[Picture]:
    truth, pictures = flight.truth, []
    limits = {}
    for name, row in flight.excursions.items():
        if "limit" in row:
            start = float(truth[f"state/{name}"][0])
            limits[f"state/{name}"] = (start - row["limit"], start + row["limit"])
    power = [f"power/{name}" for name in ("voltage", "current") if f"power/{name}" in truth]
    for part, names in enumerate(_STATES):
        channels = [f"state/{name}" for name in names.split()] + (power if part else [])
        words = ("Velocity relative to the air and angular rates", "Attitude, altitude and battery")[part]
        pictures.append(
            picture(
                figures.history_strips(truth, channels, limits),
                f"states{part}",
                f"{words} over time: {', '.join(channels)}",
                f"{words}, truth. Dashed orange: abort limit, where a state comes half way to it.",
            )
        )
    return pictures


def _bars(flight: SimulatedFlight) -> Picture:
    effectors = flight.scenario.effector
    values = flight.truth.matrix([f"effector/{e.name}" for e in effectors])
    flown = np.percentile(values, [0, 5, 95, 100], axis=1).T
    return picture(
        figures.range_bars(effectors, flown, values[:, 0]),
        "bars",
        "Share of the range between its limits that each effector used",
        "Where effectors were between their limits: grey all of the time, blue 90 % of it, black at the "
        "start. What touches a dashed line had no more to give.",
    )


def _effectors(flight: SimulatedFlight) -> list[Picture]:
    truth, effectors = flight.truth, flight.scenario.effector
    names = [e.name for e in effectors]
    values, commands = (truth.matrix([f"{group}/{n}" for n in names]) for group in ("effector", "command"))
    moved, commands = values - values[:, :1], commands - commands[:, :1]
    rows = _Rows.of(names, [e.unit for e in effectors], moved, flight)
    return [
        picture(
            figures.draw_effector_rows(
                [effectors[i] for i in part], truth.time, moved[part], commands[part], *rows.looks(part)
            ),
            f"effectors{part[0]}",
            f"Effector positions over time: {', '.join(names[i] for i in part)}",
            "Positions less those at the start, truth; grey behind: commands less those at the start. "
            "Effectors of one colour have one scale; beside each, how far it went.",
        )
        for part in rows.parts
    ]


def _excitation(flight: SimulatedFlight) -> list[Picture]:
    truth = flight.truth
    names = list(truth.group("excitation"))
    if not names:
        return []
    channels = [f"excitation/{name}" for name in names]
    values = truth.matrix(channels)
    rows = _Rows.of(names, [truth.channel(name).unit for name in channels], values, flight)
    return [
        picture(
            signal_rows([names[i] for i in part], truth.time, values[part], *rows.looks(part)),
            f"excitation{part[0]}",
            f"Excitation over time: {', '.join(names[i] for i in part)}",
            "What was added to the control law's commands. Effectors of one colour have one scale; "
            "beside each, its largest value.",
        )
        for part in rows.parts
    ]


@dataclass(frozen=True)
class _Rows:
    """How signals are drawn one below the other: in which figures, and each one's scale, note and colour."""

    parts: list[list[int]]
    scale: dict[int, float]
    notes: dict[int, str]
    colours: dict[int, str]

    @classmethod
    def of(cls, names: Sequence[str], units: Sequence[str], values: Array, flight: SimulatedFlight) -> Self:
        """Return it for signals, shape (row, sample), SI: groups keep together and share scale and colour."""
        peak, order = np.abs(values).max(axis=1), []
        scale, notes, colours = {}, {}, {}
        groups = list(effector_groups(names, flight.scenario.aircraft()).values())
        for colour, places in zip(GROUP_COLOURS, groups, strict=False):
            order += places
            for i in places:
                unit, factor = engineering(units[i])
                moves = factor * peak[i] > 1e-6
                scale[i], colours[i] = max(float(peak[places].max()), 1e-9), colour
                notes[i] = f"{number(factor * peak[i]) if moves else 0} {pretty_unit(unit)}"
        cut = len(order)
        if cut > _ROWS:  # between two groups, as near to the middle as they allow
            ends = np.cumsum([len(places) for places in groups])
            cut = int(ends[np.abs(2 * ends - cut).argmin()])
        return cls([part for part in (order[:cut], order[cut:]) if part], scale, notes, colours)

    def looks(self, part: Sequence[int]) -> tuple[list[float], list[str], list[str]]:
        """Return scales, notes and colours of one figure."""
        return tuple([table[i] for i in part] for table in (self.scale, self.notes, self.colours))  # type: ignore[return-value]


def _view(flight: SimulatedFlight) -> list[Picture]:
    """Return the three-view; none where the scenario describes no shape."""
    if not outline(flight.scenario, flight.tilt):
        return []
    tilts = ", ".join(f"{name} {np.degrees(angle):.1f}°" for name, angle in flight.tilt.items())
    drawn = picture(
        three_view(flight.scenario, flight.tilt),
        "view",
        "Three-view of the aircraft with the names of its effectors",
        Markup(
            "The described aircraft with its wings as at the start{}. Orange: rotors, named and with their "
            "sense of rotation in the view that shows the discs; blue: surfaces. Dot: tilt axis; crossed "
            "circle: centre of gravity. The description has no shape of the fuselage: it is drawn as a "
            "spheroid of its volume."
        ).format(f" ({tilts})" if tilts else ""),
    )
    return [drawn]


def _trims(flight: SimulatedFlight) -> list[Picture]:
    if not flight.trims:
        return []
    densities = [f"ρ {short(curve.rho)} kg/m³" for curve in flight.trims]
    lines = ("solid", "dashed", "dotted")
    keyed = ", ".join(f"{line}: {rho}" for line, rho in zip(lines, densities, strict=False))
    return [
        picture(
            trim_curves(flight.scenario.aircraft(), flight.trims),
            "trims",
            "Trim curves over forward speed: tilt, rotor speeds, surfaces, pitch angle, power, margins",
            f"Level flight along the corridor, a dot for each reference condition; {keyed}. Dash-dotted "
            "orange: limits. The lowest panel says how far the nearest effector of a kind is from a limit.",
        )
    ]

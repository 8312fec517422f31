"""A flight as a filmstrip: the aircraft from the side at several instants, and what it did in between."""

from __future__ import annotations

from math import degrees

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from freqid.core.arrays import Array
from freqid.core.frames import turn_about_y
from freqid.core.record import FlightRecord
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Vehicle
from freqid.report.flight.figures import draw_wide_enough
from freqid.report.flight.outline import Part, outline, shaft
from freqid.report.flight.three_view import SIDE, draw_parts
from freqid.report.flight.trims import name_lines
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
) -> tuple[list[Part], list[Part]]:
    """Return the aircraft at its pitch angle, and its arrows of thrust."""
    vehicle = scenario.aircraft()
    tilt = {wing.tilt: float(truth[f"effector/{wing.tilt}"][sample]) for wing in vehicle.wings}
    pitch = float(truth["state/theta"][sample])
    longest = _LONGEST / largest_thrust(vehicle, thrust)
    arrows = []
    for name, rows in _by_wing(vehicle).items():
        hubs, ahead = zip(*(shaft(vehicle, vehicle.rotors[i], tilt) for i in rows), strict=True)
        hub = np.mean(hubs, axis=0)
        tip = hub + longest * thrust[rows, sample].sum() * ahead[0]
        arrows.append(Part("arrow", name, np.stack([hub, tip], axis=1)))
    scene = outline(scenario, tilt), arrows
    return tuple([Part(p.kind, p.name, turn_about_y(p.points, pitch), p.group) for p in s] for s in scene)  # type: ignore[return-value]


def _by_wing(vehicle: Vehicle) -> dict[str, list[int]]:
    """Return places of the rotors by the wing that carries them."""
    places: dict[str, list[int]] = {}
    for i, rotor in enumerate(vehicle.rotors):
        places.setdefault(rotor.wing or "body", []).append(i)
    return places


def _words(truth: FlightRecord, vehicle: Vehicle, sample: int) -> str:
    tilts = [degrees(truth[f"effector/{wing.tilt}"][sample]) for wing in vehicle.wings]
    alike = not tilts or max(tilts) - min(tilts) < 0.5
    said = [f"{tilt:.1f}°" for tilt in (tilts[:1] if alike else tilts)]
    lines = [
        f"{truth.time[sample]:.1f} s",
        f"u {truth['state/u'][sample]:.1f} m/s",
        f"tilt {' / '.join(said)}" if said else "",
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

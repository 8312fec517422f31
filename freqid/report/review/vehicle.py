"""The vehicle and the conditions that were identified: drawing, corridor, mass properties and effectors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from freqid.core.errors import FreqidError
from freqid.core.results.point import PointModel
from freqid.core.scenario import Reference, Scenario
from freqid.core.vehicle import Vehicle
from freqid.report.flight.aircraft import outline, three_view
from freqid.report.kit.drawing import (
    BLUE,
    GREY,
    few_ticks,
    literal,
    name_panel,
    plain,
    stacked_panels,
    styled,
)
from freqid.report.kit.effectors import effector_groups
from freqid.report.kit.notation import number, pretty_unit, short, shown_unit
from freqid.report.kit.pictures import Picture, picture

_MOST = 3  # scheduled variables that are drawn


@styled
def corridor_figure(
    flown: Sequence[Reference], planned: Sequence[Reference], units: dict[str, str]
) -> Figure:
    """Draw what is set along the corridor against speed: conditions that were identified, and others planned.

    Parameters
    ----------
    flown, planned : sequence of Reference
    units : dict of str to str
        SI unit of each scheduled variable.
    """
    names = list(dict.fromkeys(n for r in (*flown, *planned) for n in r.scheduled))[:_MOST]
    figure, panels = stacked_panels([0.8] * (len(names) + 1))
    for axes, name in zip(panels, [*names, "rho"], strict=True):
        unit = "kg/m3" if name == "rho" else units.get(name, "rad")
        shown, factor = (unit, 1.0) if name == "rho" else shown_unit(f"state/{name}", unit)
        for references, look in (
            (planned, {"color": GREY, "markersize": 3.0}),
            (flown, {"color": BLUE, "markersize": 5.0}),
        ):
            u = [r.u for r in references]
            y = [factor * (r.rho if name == "rho" else r.scheduled.get(name, math.nan)) for r in references]
            axes.plot(u, y, linestyle="none", marker="o", markeredgewidth=0, **look)
        name_panel(axes, "Air density" if name == "rho" else literal(name, 24), shown)
        axes.margins(0.05, 0.2)
        few_ticks(axes)
        axes.yaxis.set_major_formatter(plain)
    panels[-1].set_xlabel("Reference speed u (m/s)")
    panels[-1].xaxis.set_major_formatter(plain)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    return figure


def vehicle_values(
    vehicle: Vehicle | None, models: Sequence[PointModel], scenario: Scenario | None
) -> dict[str, Any]:
    """Return what the template shows of the vehicle; without a scenario there is no drawing.

    Parameters
    ----------
    vehicle : Vehicle, optional
    models : sequence of PointModel
        Of the conditions that were identified.
    scenario : Scenario, optional
    """
    flown = [m.reference for m in models if np.isfinite(m.reference.u)]
    pictures = []
    if scenario is not None:
        pictures += _drawing(scenario, flown)
    if flown:
        units = {n: u for m in models for n, u in m.scheduled_units.items()}
        planned = scenario.reference if scenario is not None else ()
        pictures.append(
            picture(
                corridor_figure(flown, planned, units),
                "corridor-flown",
                "What is set along the corridor against reference speed",
                Markup(
                    "Blue: {} that were identified. Between them the model is interpolated; the verdict says "
                    "where its answers hold.{}"
                ).format(
                    f"{len(flown)} conditions" if len(flown) > 1 else "the condition",
                    " Grey: other conditions of the scenario, which were not flown." if planned else "",
                ),
            )
        )
    return {"pictures": pictures, "facts": _facts(vehicle) if vehicle is not None else []}


def _drawing(scenario: Scenario, flown: Sequence[Reference]) -> list[Picture]:
    reference = flown[0] if flown else next(iter(scenario.reference), None)
    tilts = {w.tilt: reference.scheduled.get(w.tilt, 0.0) for w in scenario.wing} if reference else {}
    try:
        if not outline(scenario, tilts):
            return []
        figure = three_view(scenario, tilts)
    except FreqidError:  # a vehicle that is described for identification alone has no shape
        return []
    where = f" at {reference.id}" if reference is not None and reference.id else ""
    return [
        picture(
            figure,
            "three-view",
            "Three-view drawing of the vehicle",
            f"From above, from behind and from the right{where}, to one scale; the cross is the centre of "
            "gravity, about which moments are taken.",
        )
    ]


def _facts(vehicle: Vehicle) -> list[tuple[str, str]]:
    mass = vehicle.mass_properties
    facts = [("Mass", f"{number(mass.mass_kg, 4)} kg")]
    inertia = mass.inertia
    facts.append(
        (
            "Inertia",
            f"{number(inertia.xx)}, {number(inertia.yy)}, {number(inertia.zz)} {pretty_unit('kg m2')}",
        )
    )
    facts.append(("Centre of gravity", f"{', '.join(short(x) for x in mass.cg_m)} m"))
    names = [e.name for e in vehicle.effectors]
    if names:
        facts.append(("Effectors", "; ".join(effector_groups(names, vehicle))))
    return facts

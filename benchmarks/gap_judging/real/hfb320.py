"""HFB-320 business jet: elevator pulses in turbulence, one flight of 60 s.

Companion data of Jategaonkar, "Flight Vehicle System Identification", 2nd ed.; 10 Hz. Published are mass,
S / m, S c / Iy and c / 2. Rolling and yawing inertia are not, and serve no response here.
"""

from __future__ import annotations

import numpy as np
from cases import Judged, linear_case
from models import Shape, identified
from records import Flight, data_file, make_record, surfaces, with_flow
from splice import (
    biased,
    dragging,
    heavier,
    late_group,
    late_surface,
    lost_surface,
    scaled,
    stiffer,
    upwash,
)

from freqid.core.vehicle import Inertia, MassProperties, Vehicle

MASS, CHORD = 7472.0, 2.43
AREA = 0.004028 * MASS
VEHICLE = Vehicle(
    name="HFB-320",
    mass_properties=MassProperties(
        mass_kg=MASS,
        inertia=Inertia(xx=40000.0, yy=AREA * CHORD / 0.00080027, zz=115000.0),  # xx and zz assumed
    ),
    area_m2=AREA,
    span_m=14.49,
    chord_m=CHORD,
    effectors=surfaces("de", "da", "dr"),
)
SHAPE = Shape(
    regressors={
        "CX": ("alpha", "V"),
        "CZ": ("alpha", "V", "qhat", "de"),
        "Cm": ("alpha", "qhat", "de"),
    },
    responses=("CX", "CZ", "Cm"),
    band_hz=(0.1, 1.5),
    fly="longitudinal",
)
COLUMNS = {
    "effector/de": 2,
    "air/qbar": 3,
    "air/V": 5,
    "air/alpha": 6,
    "state/theta": 7,
    "state/q": 8,
    "state/ax": 10,
    "state/az": 11,
    "state/ay": 12,
    "state/p": 13,
    "state/r": 14,
    "air/beta": 17,
    "state/phi": 18,
    "effector/da": 19,
    "effector/dr": 20,
}


def read() -> Flight:
    """Return the flight."""
    path = data_file("fvsysid", "hfb320_1_10.asc")
    table = np.loadtxt(path)
    values = {name: table[:, column - 1] for name, column in COLUMNS.items()}
    values["air/rho"] = 2 * values["air/qbar"] / values["air/V"] ** 2
    return Flight("hfb", make_record(table[:, 0], with_flow(values), VEHICLE, path.name, "cruise"))


def longitudinal() -> list[Judged]:
    """Return parts of the flight, each judged by the others."""
    flight = read()
    pulses, steps = ("pulses", 0.0, 22.0), ("steps", 22.0, 60.0)
    splices = [
        *(late_surface("de", s, only=True) for s in (0.1, 0.2)),
        *(late_group("rates", s) for s in (0.1, 0.2)),
        late_group("velocity", 0.2),
        *(lost_surface(x, ["de"], only=True) for x in (-0.4, 0.35)),
        *(scaled("state/q", x) for x in (0.15, 0.35)),
        biased("state/q", 0.02),
        scaled("state/az", 0.12),
        *(upwash("alpha", x) for x in (0.15, 0.35)),
        *(heavier(x) for x in (0.07, 0.15)),
        stiffer("yy", -0.25),
        *(dragging(x) for x in (0.015, 0.05)),
    ]

    def case(name, judged, known, chosen=()):
        model = identified([flight.segment(*known)], SHAPE)
        return linear_case(name, "hfb320", [(flight, judged)], model, SHAPE, splices=chosen)

    return [
        case("pulses", pulses, steps, splices),
        case("steps", steps, pulses),
        case("middle", ("middle", 22.0, 41.0), pulses),
        case("end", ("end", 38.0, 60.0), pulses),
    ]

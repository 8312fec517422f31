"""ATTAS in-flight simulator: aileron and rudder steps, and two elevator manoeuvres.

Companion data of Jategaonkar, "Flight Vehicle System Identification", 2nd ed.; 25 Hz, mass properties as
published with them. Mass, inertia and geometry are constants of the test cases.
"""

from __future__ import annotations

import numpy as np
from cases import Judged, linear_case
from models import Shape, identified
from records import Flight, data_file, make_record, surfaces, with_flow
from scipy.io import loadmat
from splice import (
    Splice,
    biased,
    dragging,
    heavier,
    late_group,
    late_surface,
    late_surfaces,
    lost_surface,
    off_lever,
    scaled,
    stiffer,
    turned,
    upwash,
)

from freqid.core.vehicle import Inertia, MassProperties, Vehicle

VEHICLE = Vehicle(
    name="ATTAS",
    mass_properties=MassProperties(
        mass_kg=17631.0, inertia=Inertia(xx=133367.0, yy=252687.0, zz=359593.0, xz=11442.0)
    ),
    area_m2=64.0,
    span_m=21.5,
    chord_m=3.159,
    effectors=surfaces("de", "da", "dr"),
)
LATERAL = Shape(
    regressors={
        "CY": ("beta", "rhat", "dr"),
        "Cl": ("beta", "phat", "rhat", "da", "dr"),
        "Cn": ("beta", "phat", "rhat", "da", "dr"),
    },
    responses=("Cl", "Cn"),
    band_hz=(0.1, 2.0),
    fly="lateral",
)
SHORT_PERIOD = Shape(
    regressors={
        "CX": ("alpha", "qhat", "de"),
        "CZ": ("alpha", "qhat", "de"),
        "Cm": ("alpha", "qhat", "de"),
    },
    responses=("CX", "CZ", "Cm"),
    band_hz=(0.1, 2.0),
    fly="longitudinal",
)
# Channel and column, from one; degrees where marked.
COLUMNS = (
    ("state/ax", 2, False),
    ("state/ay", 3, False),
    ("state/az", 4, False),
    ("state/p", 7, True),
    ("state/q", 8, True),
    ("state/r", 9, True),
    ("state/phi", 10, True),
    ("state/theta", 11, True),
    ("state/psi", 12, True),
    ("air/alpha", 13, True),
    ("air/beta", 14, True),
    ("air/V", 15, False),
    ("air/rho", 34, False),
    ("effector/de", 22, True),
    ("effector/dr", 30, True),
)


def read(name: str) -> Flight:
    """Return one flight by the name of its file, ``fAttasAil1``."""
    path = data_file("fvsysid", f"{name}.mat")
    table = np.asarray(loadmat(path)[name], dtype=float)
    values = {c: np.deg2rad(table[:, n - 1]) if d else table[:, n - 1] for c, n, d in COLUMNS}
    # Left and right move against each other; half the difference rolls.
    values["effector/da"] = np.deg2rad(0.5 * (table[:, 27] - table[:, 28]))
    record = make_record(table[:, 0], with_flow(values), VEHICLE, path.name, "cruise")
    return Flight(name.removeprefix("fAttas").lower(), record)


def _lateral_splices(surface: str, rate: str) -> list[Splice]:
    """Return changes to a flight in which one surface was moved."""
    other = "r" if rate == "p" else "p"
    return [
        *(late_surface(surface, s, only=True) for s in (0.04, 0.12, 0.24)),
        *(late_group("rates", s) for s in (0.04, 0.12, 0.2)),
        *(lost_surface(x, [surface], only=True) for x in (-0.5, 0.15, 0.4)),
        *(scaled(f"state/{rate}", x) for x in (0.1, 0.3)),
        biased(f"state/{other}", 0.02),
        *(turned("y", x) for x in (0.06, 0.2)),
        *(upwash("beta", x) for x in (0.15, 0.4)),
        # Of the other sign, the moments would not be those of a body.
        *(stiffer("xx", x) if rate == "p" else stiffer("zz", -x) for x in (-0.15, -0.3)),
    ]


def lateral() -> list[Judged]:
    """Return the aileron and rudder flights, each judged by what the rest of the data say."""
    ail, rud = read("fAttasAil1"), read("fAttasRud1")
    first, last = ("a", 0.0, 8.2), ("b", 8.2, 30.0)
    early, late = ("a", 0.0, 7.6), ("b", 7.6, 30.0)
    doublet, after = ("doublet", 0.0, 9.4), ("after", 9.4, 30.0)

    def case(name, judged, known, splices=()):
        flights = [f if span is None else f.segment(*span) for f, span in known]
        model = identified(flights, LATERAL)
        return linear_case(name, "attas_lateral", judged, model, LATERAL, splices=splices)

    both = [
        *(late_surfaces(s) for s in (0.08, 0.16)),
        *(late_surface("da", s) for s in (0.08, 0.2)),
        *(late_surface("dr", s) for s in (0.12, 0.24)),
        late_group("rates", 0.08),
        lost_surface(0.25, ["da"]),
        lost_surface(0.35, ["dr"]),
        lost_surface(0.25, ["da", "dr", "de"], every=True),
        turned("y", 0.1),
        late_group("velocity", 0.2),
    ]
    return [
        case("ail", [(ail, last)], [(rud, None), (ail, first)], _lateral_splices("da", "p")),
        case("rud", [(rud, late)], [(ail, None), (rud, early)], _lateral_splices("dr", "r")),
        case("ail_start", [(ail, first)], [(rud, None), (ail, last)]),
        case("both", [(ail, last), (rud, after)], [(ail, first), (rud, doublet)], both),
        case("both_start", [(ail, first), (rud, early)], [(ail, last), (rud, late)]),
    ]


def short_period() -> list[Judged]:
    """Return the elevator flights, each judged by a simulation from the other."""
    one, two = read("fAttasElv1"), read("fAttasElv2")
    splices = [
        *(late_surface("de", s, only=True) for s in (0.04, 0.12, 0.2)),
        *(late_group("rates", s) for s in (0.04, 0.12)),
        *(late_group("velocity", s) for s in (0.04, 0.12)),
        late_group("accelerometers", 0.08),
        *(lost_surface(x, ["de"], only=True) for x in (-0.3, 0.2, 0.4)),
        *(scaled("state/q", x) for x in (0.1, 0.3)),
        biased("state/q", 0.02),
        *(scaled("state/az", x) for x in (0.05, 0.15)),
        *(upwash("alpha", x) for x in (0.1, 0.25)),
        *(heavier(x) for x in (0.05, 0.15)),
        *(stiffer("yy", x) for x in (-0.12, -0.25)),
        *(dragging(x) for x in (0.01, 0.04)),
        off_lever(2.0),
        off_lever(6.0),
    ]
    spans = (("a", 0.0, 10.6), ("b", 10.6, 25.0))

    def case(name, judged, known, splices=()):
        model = identified(known, SHORT_PERIOD)
        return linear_case(name, "attas_short_period", judged, model, SHORT_PERIOD, splices=splices)

    return [
        case("elv1", [(one, None)], [two], splices),
        case("elv2", [(two, None)], [one], splices[::2]),
        case("elv1_parts", [(one, s) for s in spans], [two]),
        case("elv2_parts", [(two, s) for s in spans], [one]),
        case("elv1_end", [(one, ("end", 8.0, 25.0))], [two]),
        case("elv2_end", [(two, ("end", 9.0, 25.0))], [one]),
    ]

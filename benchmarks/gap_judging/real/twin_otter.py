"""Twin Otter: rudder and aileron doublets of two flights, and elevator doublets of a third.

Data of the worked examples of Klein & Morelli, "Aircraft System Identification"; mass properties come with
each record. Derivatives that the author published for f1_017 serve as simulations too.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
from cases import Judged, linear_case
from models import Shape, identified, levelled
from records import Flight, data_file, make_record, surfaces, with_flow
from splice import (
    biased,
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

from freqid.flightlog.readers.sidpac import read_sidpac

LATERAL = Shape(
    regressors={
        "CY": ("beta", "rhat", "dr"),
        "Cl": ("beta", "phat", "rhat", "da", "dr"),
        "Cn": ("beta", "phat", "rhat", "da", "dr"),
    },
    responses=("CY", "Cl", "Cn"),
    band_hz=(0.1, 1.5),
    fly="lateral",
)
ELEVATOR = Shape(
    regressors={
        "CX": ("alpha", "de"),
        "CZ": ("alpha", "qhat", "de"),
        "Cm": ("alpha", "qhat", "de"),
    },
    responses=("CZ", "Cm"),
    band_hz=(0.2, 2.0),
    fly="longitudinal",
)
CHANNELS = (
    *(f"state/{n}" for n in ("p", "q", "r", "phi", "theta", "psi", "ax", "ay", "az")),
    *(f"air/{n}" for n in ("V", "alpha", "beta", "qbar", "rho")),
    *(f"effector/{n}" for n in ("de", "da", "dr")),
)
# Published derivatives of f1_017 with their standard errors, by output error: example 6.1 in the time
# domain, example 7.1 in the frequency domain. In the order of the regressors of LATERAL.
PUBLISHED = {
    "ex61": {
        "CY": ((-0.86457, 0.93313, 0.37999), (0.0028, 0.0167, 0.0081)),
        "Cl": ((-0.11959, -0.58590, 0.18888, -0.22818, 0.04221), (0.0006, 0.0026, 0.0018, 0.0009, 0.0007)),
        "Cn": ((0.08638, -0.06441, -0.19059, -0.00298, -0.13548), (0.0002, 0.001, 0.0006, 0.0004, 0.0003)),
    },
    "ex71": {
        "CY": ((-0.86083, 0.88883, 0.34170), (0.0071, 0.0438, 0.0217)),
        "Cl": ((-0.11979, -0.59285, 0.17381, -0.23304, 0.02606), (0.0009, 0.004, 0.0029, 0.0015, 0.0014)),
        "Cn": ((0.08547, -0.06610, -0.19329, -0.00364, -0.13737), (0.0006, 0.0025, 0.0017, 0.0009, 0.0008)),
    },
}


def read(name: str) -> Flight:
    """Return one flight by the name in its file, ``f1_017``."""
    raw = read_sidpac(data_file("sidpac", f"totter_{name}_data.mat"))
    values = {c: raw[c] for c in CHANNELS if c in raw}
    if "air/rho" not in values:  # one file has dynamic pressure and speed only
        values["air/rho"] = 2 * values["air/qbar"] / values["air/V"] ** 2
    vehicle = msgspec.structs.replace(raw.vehicle, effectors=surfaces("de", "da", "dr"))
    source = f"totter_{name}_data.mat"
    record = make_record(raw.time, with_flow(values), vehicle, source, "cruise")
    return Flight(name, replace(record, mass_properties=None))


def _published(flight: Flight, which: str) -> dict:
    rows = PUBLISHED[which]
    derivatives, errors = (
        {c: dict(zip(LATERAL.regressors[c], rows[c][i], strict=True)) for c in rows} for i in (0, 1)
    )
    return levelled(flight, LATERAL, derivatives, errors)


def lateral() -> list[Judged]:
    """Return two lateral flights, each judged by the other or by what is published of the other."""
    f17, f14 = read("f1_017"), read("f1_014")
    splices = [
        *(late_surface("da", s) for s in (0.04, 0.1, 0.2)),
        *(late_surface("dr", s) for s in (0.06, 0.16)),
        *(late_surfaces(s) for s in (0.04, 0.12)),
        *(late_group("rates", s) for s in (0.02, 0.06, 0.14)),
        *(late_group("velocity", s) for s in (0.06, 0.16)),
        late_group("accelerometers", 0.12),
        *(lost_surface(x, ["da"]) for x in (0.15, 0.35)),
        *(lost_surface(x, ["dr"]) for x in (-0.3, 0.25)),
        lost_surface(0.25, ["da", "dr", "de"], every=True),
        *(scaled("state/p", x) for x in (0.1, 0.3)),
        *(scaled("state/r", x) for x in (0.12, -0.3)),
        scaled("state/ay", 0.2),
        biased("state/p", 0.02),
        *(turned("y", x) for x in (0.06, 0.2)),
        turned("x", 0.1),
        *(upwash("beta", x) for x in (0.12, 0.35)),
        heavier(0.15),
        *(stiffer("xx", x) for x in (-0.15, -0.3)),
        stiffer("zz", 0.12),
        stiffer("zz", 0.25),
        off_lever(2.0),
    ]
    by_014, by_017 = identified([f14], LATERAL), identified([f17], LATERAL)
    parts_17 = (("rudder", 0.0, 8.4), ("aileron", 8.4, 20.0))
    parts_14 = (("rudder", 0.0, 6.7), ("aileron", 6.7, 20.0))

    def case(name, judged, model, chosen=()):
        return linear_case(name, "twin_otter_lateral", judged, model, LATERAL, splices=chosen)

    return [
        case("f014", [(f14, None)], by_017, splices),
        case("f017", [(f17, None)], by_014, splices[::3]),
        case("f014_ex61", [(f14, None)], _published(f17, "ex61"), splices[1::4]),
        case("f014_ex71", [(f14, None)], _published(f17, "ex71")),
        case("f017_parts", [(f17, s) for s in parts_17], by_014),
        case("f014_parts", [(f14, s) for s in parts_14], by_017),
        case("f014_parts_ex61", [(f14, s) for s in parts_14], _published(f17, "ex61")),
    ]


def elevator() -> list[Judged]:
    """Return the elevator flight, each half judged by the other."""
    flight = read("9752ed20")
    first, last = ("a", 0.0, 4.0), ("b", 4.0, 10.0)
    splices = [
        *(late_surface("de", s, only=True) for s in (0.04, 0.1, 0.2)),
        *(late_group("rates", s) for s in (0.03, 0.1)),
        *(lost_surface(x, ["de"], only=True) for x in (0.2, 0.4)),
        scaled("state/q", 0.25),
        *(upwash("alpha", x) for x in (0.15, 0.35)),
        *(heavier(x) for x in (0.06, 0.15)),
        *(stiffer("yy", x) for x in (-0.12, -0.25)),
    ]

    def case(name, judged, known, chosen=()):
        model = identified([flight.segment(*known)], ELEVATOR)
        return linear_case(name, "twin_otter_elevator", [(flight, judged)], model, ELEVATOR, splices=chosen)

    return [case("end", last, first, splices), case("start", first, last)]

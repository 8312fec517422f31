"""F-16XL model, forced oscillation in pitch in a water tunnel, angle of attack 30 to 40 deg.

Data of Klein & Morelli's example 7.2 (Schroeder sweep, 305 s). The run is brought to the aircraft's size
and 100 m/s with nondimensional rates kept, so that its lags are those of an aircraft. The balance's normal
force becomes an accelerometer of an assumed mass. Attitude is left out: the tunnel moves the model, not its
loads, so the equations of free flight do not hold between the channels.

The quasi-steady simulation (angle of attack and pitch rate) lacks what is known of this aircraft there: a
part of the normal force follows the angle of attack late.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from cases import Judged, identification_text
from models import Shape, described
from numpy.typing import NDArray
from records import Flight, data_file, make_record, with_flow
from scipy.io import loadmat
from scipy.signal import butter, lfilter, sosfiltfilt
from splice import late_group, scaled, upwash

from freqid.core.vehicle import Inertia, MassProperties, Vehicle

Array = NDArray[np.float64]

FOOT, SPEED, DENSITY = 0.3048, 100.0, 1.225
MODEL_SCALE = 0.025  # of the span that the file's own w b / 2V says, 0.81 ft, to 32.4 ft
VEHICLE = Vehicle(
    name="F-16XL",
    mass_properties=MassProperties(
        mass_kg=15000.0, inertia=Inertia(xx=25000.0, yy=150000.0, zz=165000.0)
    ),  # all assumed: forces are measured here
    area_m2=60.0,
    span_m=32.4 * FOOT,
    chord_m=24.7 * FOOT,
)
SHAPE = Shape(regressors={"CZ": ("alpha", "qhat")}, responses=("CZ",), band_hz=(0.08, 1.8))
LAGS = np.geomspace(0.1, 4.0, 40)  # s, at the aircraft's size
QUARTERS = tuple((name, 76.25 * i, 76.25 * (i + 1)) for i, name in enumerate(("q1", "q2", "q3", "q4")))


def lagged(time: Array, x: Array, time_constant: float) -> Array:
    """Return `x` after a first-order lag that is at rest in the beginning."""
    share = float(np.exp(-(time[1] - time[0]) / time_constant))
    middle = np.concatenate(([0.0], 0.5 * (x[1:] + x[:-1]) - x[0]))
    return x[0] + lfilter([1 - share], [1, -share], middle)


def read() -> tuple[Flight, float]:
    """Return the run at the aircraft's size, and the factor of its time."""
    path = data_file("sidpac", "f16xl_r1263e_data.mat")
    table = np.asarray(loadmat(path)["dat"], dtype=float)
    speed = FOOT * table[:, 1]
    factor = speed.mean() / (MODEL_SCALE * SPEED)
    force = -table[:, 10] * 0.5 * DENSITY * SPEED**2 * VEHICLE.area_m2
    zero = np.zeros(table.shape[0])
    values = {
        "air/V": SPEED * speed / speed.mean(),
        "air/alpha": np.deg2rad(table[:, 2]),
        "air/beta": zero,
        "air/rho": zero + DENSITY,
        "state/p": zero,
        "state/q": np.deg2rad(table[:, 5]) / factor,
        "state/r": zero,
        "state/az": force / VEHICLE.mass_properties.mass_kg,
    }
    # the file's coefficients were made with the dynamic pressure of each sample
    values["state/az"] *= (values["air/V"] / SPEED) ** 2
    record = make_record(factor * table[:, 0], with_flow(values), VEHICLE, path.name, "alpha35")
    return Flight("r1263e", record), factor


def _columns(flight: Flight, lag: float | None) -> tuple[Array, Array]:
    record = flight.record
    rate = record["state/q"] * VEHICLE.chord_m / (2 * record["air/V"])
    columns = [record["air/alpha"], rate]
    if lag is not None:
        columns.append(lagged(record.time, record["air/alpha"], lag))
    response = record["state/az"] * VEHICLE.mass_properties.mass_kg / (record["air/qbar"] * VEHICLE.area_m2)
    sections = butter(3, 1.5 * SHAPE.band_hz[1], fs=1 / record.dt, output="sos")
    smooth = [sosfiltfilt(sections, x) for x in (*columns, response)]
    return np.array([*smooth[:-1], np.ones(record.time.size)]).T, smooth[-1]


def _fitted(flights: Sequence[Flight], lag: float | None) -> tuple[Array, float]:
    """Return the derivatives by least squares on samples, constant last, and the residual's power."""
    parts = [_columns(f, lag) for f in flights]
    x, z = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    found = np.linalg.lstsq(x, z, rcond=None)[0]
    return found, float(np.mean((z - x @ found) ** 2))


def simulated(flights: Sequence[Flight], unsteady: bool) -> dict:
    """Return the content of ``simulation.json``: quasi-steady, or with a part that lags."""
    lag = min(LAGS, key=lambda s: _fitted(flights, s)[1]) if unsteady else None
    value = _fitted(flights, lag)[0]
    names = ("alpha", "qhat", "lagged", "0") if unsteady else ("alpha", "qhat", "0")
    model = described(flights[0], SHAPE, {"CZ": dict(zip(names, value.tolist(), strict=True))})
    model["identified_from"] = [f.name for f in flights]
    if lag is not None:
        model["lag_s"] = float(lag)
    return model


def fit_of(judged: Judged) -> dict[str, dict[str, float]]:
    """Return R2 of a simulation on the judged parts."""
    row, found = judged.model["derivatives"]["CZ"], {}
    for flight in judged.flights():
        x, z = _columns(flight, judged.model.get("lag_s"))
        found[flight.name] = {"CZ": float(1 - np.var(z - x @ list(row.values())) / np.var(z))}
    return found


def oscillation() -> list[Judged]:
    """Return parts of the run, judged by simulations from the other parts."""
    flight, factor = read()
    spans = [(name, factor * start, factor * stop) for name, start, stop in QUARTERS]
    quarters = [flight.segment(*span) for span in spans]
    half = ("half2", factor * 152.5, factor * 305.0)
    first = [flight.segment("half1", 0.0, factor * 152.5)]
    odd, even = [quarters[0], quarters[2]], [quarters[1], quarters[3]]
    splices = [
        *(late_group("velocity", s) for s in (0.03, 0.1)),
        *(late_group("rates", s) for s in (0.06, 0.2)),
        *(upwash("alpha", x) for x in (0.15, 0.4)),
        scaled("state/az", 0.2),
        scaled("state/q", 0.5),
    ]
    lag = simulated(first, True)["lag_s"]
    known = {
        "effects": {"unsteady_lift": {"time_constant": lag}},
        "place": {"unsteady_lift": None},
        # the force leads at first and then settles: no library effect has just that form
        "aliases": ["downwash_lag", "stall", "other"],
    }

    def case(name, use, model, **more):
        seconds = min(stop - start for _, start, stop in use)
        text = identification_text(["Z"], {"Z": SHAPE.regressors["CZ"]}, SHAPE.lines(seconds))
        used = [(flight, span) for span in use]
        return Judged(name, "f16xl", used, model, text, SHAPE.band_hz, knows_mass=False, **more)

    return [
        case("half", [half], simulated(first, True), splices=splices),
        case("even", spans[1::2], simulated(odd, True)),
        case("odd", spans[0::2], simulated(even, True)),
        case("last", spans[3:], simulated(quarters[:3], True)),
        case("steady_half", [half], simulated(first, False), null=False, truth=known),
        case("steady_even", spans[1::2], simulated(odd, False), null=False, truth=known),
        case("steady_odd", spans[0::2], simulated(even, False), null=False, truth=known),
    ]

"""Nano quadcopter: real flights at 100 Hz with motor speeds and motion capture.

IDSIA benchmark (Busetto et al., Control Engineering Practice 172, 2026, 106871). Mass, inertia, arm and
thrust constant are the published simulator's. The log's accelerations are in earth axes (they match the
rate of the velocity without being turned), gravity added; they are turned into body axes here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from cases import Judged, identification_text
from numpy.typing import NDArray
from records import Flight, data_file, make_record
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation
from splice import Splice, biased, blown, heavier, late_group, late_surfaces, scaled, turned, weak

from freqid.core.sections.identification import FrequencyGrid
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle

Array = NDArray[np.float64]

MASS, ARM, DIAMETER, RHO = 0.045, 0.0353, 0.055, 1.2  # diameter and density assumed
HIGHEST_SPEED = 3000.0  # rad/s; beyond it the log has a spike
HIGHEST_FORCE = 20.0  # m/s2 off its median, likewise
BAND_HZ = (0.1, 3.0)
ROTORS = ("n1", "n2", "n3", "n4")
PLACES = ((1, 1), (-1, 1), (-1, -1), (1, -1))  # forward, right; in the order of the motors
VEHICLE = Vehicle(
    name="Nano quadcopter",
    mass_properties=MassProperties(mass_kg=MASS, inertia=Inertia(xx=2.3951e-5, yy=2.3951e-5, zz=3.2347e-5)),
    effectors=tuple(Effector(name=n, kind="rotor", limits=(0.0, 2500.0)) for n in ROTORS),
    rotors=tuple(
        Rotor(
            name=n,
            spin=1 if i % 2 == 0 else -1,
            inertia=0.0,  # forces are judged, which it does not enter
            axis=(0.0, 0.0, -1.0),
            position_m=(ARM * x, ARM * y, 0.0),
            diameter_m=DIAMETER,
        )
        for i, (n, (x, y)) in enumerate(zip(ROTORS, PLACES, strict=True))
    ),
)
# Of seven flights, those whose motor speeds and accelerations are within 5 ms of each other; in the rest
# the log's own clocks differ by some 20 ms, which is a gap of the log's.
FLIGHTS = {
    "multisine1": ("multisine_20251017_run1", 3.0, 61.0),
    "multisine2": ("multisine_20251017_run2", 3.0, 61.0),
    "random2": ("random2_20251017_run2", 3.0, 61.0),
    "square3": ("square_20251017_run3", 2.5, 21.5),
}
TOLERANCES = {"thrust": 0.02, "drag_x": 0.1, "drag_y": 0.1, "inflow": 0.25}  # fractions
FORCE_TOLERANCE_N = 0.004


def _without(x: Array, bad: Array) -> Array:
    good = np.flatnonzero(~bad)
    return np.interp(np.arange(x.size), good, x[good])


def read(name: str) -> Flight:
    """Return one flight, airborne part, body axes forward-right-down."""
    file, start, stop = FLIGHTS[name]
    table = pd.read_parquet(data_file("nanodrone", f"{file}.parquet"))
    table = table[(table["t"] >= start) & (table["t"] <= stop)]
    time = table["t"].to_numpy(dtype=float, copy=True)
    force = table[["ax", "ay", "az"]].to_numpy(dtype=float, copy=True)
    off = np.abs(force - np.median(force, axis=0)) > HIGHEST_FORCE
    force = np.array([_without(force[:, i], off[:, i]) for i in range(3)]).T
    attitude = Rotation.from_quat(table[["qx", "qy", "qz", "qw"]].to_numpy(dtype=float, copy=True))
    velocity = attitude.inv().apply(table[["vx", "vy", "vz"]].to_numpy(dtype=float, copy=True))
    force = attitude.inv().apply(force)
    down = np.array([1.0, -1.0, -1.0])  # forward-left-up to forward-right-down
    velocity, force = velocity * down, force * down
    rates = table[["wx", "wy", "wz"]].to_numpy(dtype=float, copy=True) * down
    yaw, pitch, roll = attitude.as_euler("ZYX").T
    angles = np.array([roll, -pitch, -np.unwrap(yaw)]).T
    values = {}
    for names, x in (("uvw", velocity), ("pqr", rates)):
        values |= {f"state/{n}": x[:, i] for i, n in enumerate(names)}
    values |= {f"state/{n}": angles[:, i] for i, n in enumerate(("phi", "theta", "psi"))}
    values |= {f"state/{n}": force[:, i] for i, n in enumerate(("ax", "ay", "az"))}
    values["air/rho"] = np.full(time.size, RHO)
    for i, n in enumerate(ROTORS):
        speed = table[f"m{i + 1}_erpm"].to_numpy(dtype=float, copy=True) * 2 * np.pi / 360
        values[f"effector/{n}"] = _without(speed, ~(speed < HIGHEST_SPEED))
    return Flight(name, make_record(time, values, VEHICLE, f"{file}.parquet", "hover"))


def _rows(flight: Flight) -> list[tuple[Array, Array]]:
    """Return regressors and force of each axis, up to twice the band."""
    record = flight.record
    sections = butter(3, 2 * BAND_HZ[1], fs=1 / record.dt, output="sos")
    speeds = record.matrix(f"effector/{n}" for n in ROTORS)
    total, ones = speeds.sum(axis=0), np.ones(record.time.size)
    rows = []
    for axis, velocity, more in (("ax", "u", []), ("ay", "v", []), ("az", "w", [-(speeds**2).sum(axis=0)])):
        columns = [sosfiltfilt(sections, x) for x in (*more, total * record[f"state/{velocity}"])]
        rows.append((np.array([*columns, ones]).T, sosfiltfilt(sections, MASS * record[f"state/{axis}"])))
    return rows


NAMES = (("drag_x", "X_0"), ("drag_y", "Y_0"), ("thrust", "inflow", "Z_0"))


def simulated(flights: Sequence[Flight], drag: bool = True) -> dict:
    """Return the content of ``simulation.json`` from flights; without in-plane drag where asked."""
    every, parameters = [_rows(f) for f in flights], {}
    for i, names in enumerate(NAMES):
        x = np.concatenate([rows[i][0] for rows in every])
        z = np.concatenate([rows[i][1] for rows in every])
        found = np.linalg.lstsq(x, z, rcond=None)[0]
        parameters |= dict(zip(names, found.tolist(), strict=True))
    if not drag:
        parameters |= {"drag_x": 0.0, "drag_y": 0.0}
    tolerances = {n: [s, "1"] for n, s in TOLERANCES.items() if parameters[n]}
    tolerances |= {n: [FORCE_TOLERANCE_N, "N"] for n in ("X_0", "Y_0", "Z_0")}
    return {
        "parameters": parameters,
        "tolerances": tolerances,
        "rotors": list(ROTORS),
        "mass_kg": MASS,
        "identified_from": [f.name for f in flights],
    }


def fit_of(judged: Judged) -> dict[str, dict[str, float]]:
    """Return R2 of a simulation on the judged flights, about their means."""
    found = {}
    for flight in judged.flights():
        row = {}
        for axis, names, (x, z) in zip("XYZ", NAMES, _rows(flight), strict=True):
            value = np.array([judged.model["parameters"][n] for n in names])
            row[axis] = float(1 - np.var(z - x @ value) / np.var(z))
        found[flight.name] = row
    return found


def _splices() -> list[Splice]:
    return [
        *(late_surfaces(s) for s in (0.03, 0.06, 0.12)),
        *(late_group("accelerometers", s) for s in (0.04, 0.1)),
        *(late_group("velocity", s) for s in (0.1, 0.25)),
        late_group("attitude", 0.06),
        *(scaled("state/az", x) for x in (0.06, 0.15)),
        scaled("state/ax", 0.3),
        biased("state/ay", 0.3),
        *(turned("x", x) for x in (0.04, 0.12)),
        turned("y", 0.08),
        *(heavier(x) for x in (0.06, 0.12)),
        *(weak(x) for x in (0.06, 0.12)),
        *(blown(x) for x in (0.4, 1.2)),
    ]


def translation() -> list[Judged]:
    """Return the flights, each judged by what the others say."""
    flights = {name: read(name) for name in FLIGHTS}
    splices = _splices()
    known = {
        "effects": {"rotor_inplane_force": {"strength": None}},
        "place": {"rotor_inplane_force": None},
        "aliases": ["extra_drag"],
    }
    grid = FrequencyGrid(start=BAND_HZ[0], step=0.04, stop=BAND_HZ[1])
    regressors = {"X": ("u", *ROTORS), "Y": ("v", *ROTORS), "Z": ("w", *ROTORS)}
    text = identification_text(list("XYZ"), regressors, grid, 'form = "force"')

    def case(name, use, others, drag=True, **more):
        model = simulated([flights[n] for n in others], drag)
        more = {"simulation": "nanodrone_simulation.py", **more}
        return Judged(name, "nanodrone", use, model, text, BAND_HZ, **more)

    def rest(*names):
        return [n for n in flights if n not in names]

    halves = (("a", 0.0, 29.0), ("b", 29.0, 58.0))
    held = [(flights["multisine2"], None)]
    others = rest("multisine1", "multisine2")
    cases = [
        case("multisine1", [(flights["multisine1"], None)], others, splices=splices, holdout=held),
        case("multisine2", [(flights["multisine2"], None)], rest("multisine2")),
        case("random2", [(flights["random2"], None)], rest("random2"), splices=splices[1::3]),
        case("square3", [(flights["square3"], None)], rest("square3"), splices=splices[2::4]),
    ]
    cases += [
        case(f"{name}_parts", [(flights[name], s) for s in halves], rest(name))
        for name in ("multisine1", "multisine2", "random2")
    ]
    pair = [(flights["multisine1"], None), (flights["multisine2"], None)]
    cases.append(case("multisines", pair, rest("multisine1", "multisine2")))
    mixed = [(flights["random2"], None), (flights["square3"], None)]
    cases.append(case("mixed", mixed, rest("random2", "square3")))
    for name in ("multisine2", "random2", "square3"):
        use = [(flights[name], None)]
        cases.append(case(f"{name}_nodrag", use, rest(name), drag=False, null=False, truth=known))
    return cases

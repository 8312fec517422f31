"""What it costs to leave out angular momentum or moving mass: `python benchmarks/study_momentum.py`.

Flights of the LA-8 class simulation, without sensor errors so that the difference is the model's alone, are
identified with the whole vehicle and with a poorer one; the simulation is unchanged. Differences are over the
standard errors of the same flight at full research noise, and over the parameter. The poorer vehicles:

no rotor momentum   the rotors have no inertia: no gyroscopic moments, no reaction to their acceleration
frozen mass         inertia and centre of gravity stay where they are at zero tilt, as stated
frozen inertia      only the inertia does; the centre of gravity is stated where it is at this tilt

Writes benchmarks/study_momentum.csv.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from _la8 import EXCITATION, SCENARIO, SETTINGS, write
from _la8_flights import REFERENCES, flights, measured

import freqid as fq
from freqid.core.vehicle import Inertia
from freqid.dynamics.frames import turn_about_y
from freqid.identify.point import identify_point

LARGE = 2.0  # standard errors from which a parameter is listed


def still_rotors(vehicle: fq.Vehicle, tilt: float) -> fq.Vehicle:
    """Return a vehicle whose rotors have no inertia."""
    rotors = tuple(msgspec.structs.replace(r, inertia=0.0) for r in vehicle.rotors)
    return msgspec.structs.replace(vehicle, rotors=rotors)


def frozen(vehicle: fq.Vehicle, tilt: float) -> fq.Vehicle:
    """Return a vehicle whose wings have no mass of their own: all of it is where it is stated."""
    light = Inertia(xx=0.0, yy=0.0, zz=0.0)
    wings = tuple(msgspec.structs.replace(w, mass_kg=0.0, inertia=light) for w in vehicle.wings)
    return msgspec.structs.replace(vehicle, wings=wings)


def frozen_inertia(vehicle: fq.Vehicle, tilt: float) -> fq.Vehicle:
    """Return the same with the centre of gravity where it is at this tilt."""
    stated = vehicle.mass_properties
    moved = np.zeros(3)
    for wing in vehicle.wings:
        arm = np.subtract(wing.cg_m or wing.pivot_m, wing.pivot_m)
        moved += wing.mass_kg / stated.mass_kg * (turn_about_y(arm, tilt) - arm)
    x, y, z = np.array(stated.cg_m) + moved
    mass = msgspec.structs.replace(stated, cg_m=(float(x), float(y), float(z)))
    return msgspec.structs.replace(frozen(vehicle, tilt), mass_properties=mass)


POORER = {
    "no rotor momentum": still_rotors,
    "frozen mass": frozen,
    "frozen inertia": frozen_inertia,
}


def identified(record: fq.FlightRecord, vehicle: fq.Vehicle) -> fq.PointModel:
    """Identify as the scenario says, with another vehicle."""
    return identify_point(fq.Maneuver.of(record, vehicle), SETTINGS, excitation=EXCITATION)


def main() -> None:
    """Print and write the tables."""
    vehicle, rows = SCENARIO.aircraft(), []
    for reference, (at, truth) in zip(REFERENCES, flights([r.id for r in REFERENCES]).items(), strict=True):
        exact = measured(truth, 0, 0.0)
        whole, noisy = identified(exact, vehicle), identified(measured(truth, 0), vehicle)
        for what, poorer in POORER.items():
            model = identified(exact, poorer(vehicle, reference["dw1"]))
            print(f"{at:<5}{what}")
            for name, response in whole.responses.items():
                change = model[name].estimate - response.estimate
                sigmas, share = change / noisy[name].std_error, np.abs(change / response.estimate)
                told = np.abs(response.estimate) > 5 * noisy[name].std_error
                worst = int(np.argmax(np.abs(sigmas)))
                hurt = np.flatnonzero(np.abs(sigmas) > LARGE)
                row = {
                    "condition": at,
                    "left_out": what,
                    "response": name,
                    "rms_sigmas": f"{np.sqrt((sigmas**2).mean()):.2f}",
                    "worst_sigmas": f"{sigmas[worst]:.1f}",
                    "worst_parameter": response.regressors[worst],
                    "its_change_percent": f"{100 * share[worst]:.1f}",
                    "median_change_percent": f"{100 * np.median(share[told]):.2f}" if told.any() else "",
                    "largest_change_percent": f"{100 * share[told].max():.1f}" if told.any() else "",
                    "beyond_2_sigmas": " ".join(response.regressors[i] for i in hurt),
                }
                rows.append(row)
                print("      " + "  ".join(str(v) for v in list(row.values())[2:]), flush=True)
    write(Path(__file__), rows)


if __name__ == "__main__":
    main()

"""A quasi-steady model of an F-16XL in a water tunnel against data, and what a lag in separation takes away.

Run: python benchmarks/gap_f16xl.py
Prints a table and writes benchmarks/gap_f16xl.csv. Needs the data of ../shared/data; without them nothing is
done.

The model oscillates in pitch at angles of attack of 30 to 40 deg by a sweep from 0.008 to 0.2 Hz over 305 s
(Klein and Morelli, Aircraft System Identification, example 7.2). The simulation is the quasi-steady one,
CN = a + b alpha + c q fitted to the same data; the effect is examples/separation_lag.py, a user's own. RMS is
that of the spectrum of CN's residual on 0.008:0.002:0.2 Hz, least-squares line removed: the quasi-steady fit
has 0.660, the literature's output error with a lag 0.229 by its transfer function and 0.243 as a lag in time.
One row scores on the data of the refit, two on the half of the record that the refit did not see: the sweep
makes these other frequencies, low ones first. G weighs lines by their noise, RMS does not.
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.gap.connect.callable import CallableSimulation
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.together import together
from freqid.gap.tolerance import stated
from freqid.gap.undescribed import without_vehicle
from freqid.identify.fourier import FourierPlan
from freqid.identify.trend import remove_trend
from freqid.simulate.effects import library
from freqid.simulate.effects.files import load_file

PROJECT = Path(__file__).resolve().parents[1]
DATA = PROJECT.parent / "shared" / "data" / "sidpac" / "f16xl_r1263e_data.mat"
BAND_HZ = (0.008, 0.2)
GRID_HZ = np.arange(0.008, 0.2001, 0.002)
EFFECT = "separation_lag"

Array = NDArray[np.float64]


def record(path: Path = DATA) -> FlightRecord:
    """Return the tunnel's record: angle of attack, pitch rate, speed and CZ = -CN."""
    table = loadmat(path)
    columns = dict(zip([str(x[0]) for x in table["lab"][0]], table["dat"].T, strict=True))
    time = np.linspace(0.0, columns["time_s"][-1] - columns["time_s"][0], columns["time_s"].size)
    held = {
        "air/alpha": ("rad", np.radians(columns["alph_d"])),
        "state/q": ("rad/s", np.radians(columns["q_dps"])),
        "air/V": ("m/s", 0.3048 * columns["vel_fps"]),
        "response/CZ": ("1", -columns["cnorm"]),
    }
    return FlightRecord(time, {n: Channel(n, unit, x, 10.0, "tunnel") for n, (unit, x) in held.items()})


def spectrum(values: Array, dt: float) -> NDArray[np.complex128]:
    """Return finite Fourier integrals about the least-squares line, on the grid."""
    plan = FourierPlan(values.shape[-1], dt, GRID_HZ)
    return plan(remove_trend(np.atleast_2d(values), dt, "line").x)


def rms(values: Array, dt: float) -> float:
    """Return the root mean square of a residual's spectrum."""
    return float(np.sqrt(np.mean(np.abs(spectrum(values, dt)) ** 2)))


def quasi_steady(data: FlightRecord) -> CallableSimulation:
    """Return the simulation whose slopes fit the data best on the grid."""
    columns = spectrum(data.matrix(["air/alpha", "state/q"]), data.dt).T
    normal = spectrum(-data["response/CZ"], data.dt)[0]
    stacked = np.concatenate([columns.real, columns.imag])
    slope, damping = np.linalg.lstsq(stacked, np.concatenate([normal.real, normal.imag]), rcond=None)[0]

    def steady(time, state, effector, air, parameters):
        return {"CZ": -(slope * air["alpha"] + damping * state["q"])}

    return CallableSimulation(steady, "quasi-steady", ("CZ",))


def found(
    simulation: CallableSimulation, used: FlightRecord, kept: FlightRecord | None = None, draws: int = 100
) -> Findings:
    """Return the diagnosis with the closure of the lag."""
    effects = {**library(), **load_file(PROJECT / "examples" / f"{EFFECT}.py")}
    vehicle = without_vehicle("F-16XL model")
    question = Question(effects, stated({"form": 0.0}, effects), BAND_HZ, named=(EFFECT,), draws=draws)
    held = [Maneuver(kept, vehicle)] if kept else []
    return diagnose(simulation, [Maneuver(used, vehicle)], question, held_out=held)


def before_and_after(findings: Findings, data: FlightRecord) -> tuple[float, float]:
    """Return the RMS of the scored record's residual as it is and with the refitted effect."""
    compared = (findings.held_out or findings.compared)[0]
    refit = findings.refits[EFFECT]
    left = data["response/CZ"] - compared.predicted[0]
    change = together(refit.effects, compared.flown, refit.settings)
    return rms(left, data.dt), rms(left - change.direct[0], data.dt)


def main() -> None:
    """Print and write the table."""
    if not DATA.is_file():
        print("the tunnel's data are not beside this checkout (../shared/data): nothing done")
        sys.exit(0)
    data = record()
    simulation = quasi_steady(data)
    middle = 0.5 * data.duration
    halves = data.cut(0.0, middle), data.cut(middle, data.duration)
    rows = []
    for name, used, kept in (
        ("whole record", data, None),
        ("fitted to the first half", *halves),
        ("fitted to the second half", *halves[::-1]),
    ):
        findings = found(simulation, used, kept)
        diagnosis = findings.diagnosis
        closure = diagnosis.how_far[0]
        share, settings = closure.wrench, closure.settings[EFFECT]
        before, after = before_and_after(findings, kept or used)
        rows.append(
            [name, f"{before:.3f}", f"{after:.3f}", f"{share.G:.3f}", f"{share.lo:.3f}", f"{share.hi:.3f}"]
            + [f"{settings[n].estimate:.3f}" for n in ("strength", "time_constant", "static", "rate")]
            + [f"{diagnosis.gap.p:.2g}", next(iter(diagnosis.which.probabilities)), closure.note]
        )
        print(diagnosis.verdict)
        for n, x in settings.items():
            print(f"   {n} {x.estimate:.3f} [{x.lo:.3f}, {x.hi:.3f}] {x.unit}")
        print("  ", *rows[-1], sep="  ")
    header = ["case", "rms_before", "rms_after", "G", "G_lo", "G_hi"]
    header += ["strength", "time_constant_s", "static", "rate_s", "p", "likeliest", "note"]
    with Path(__file__).with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


if __name__ == "__main__":
    main()

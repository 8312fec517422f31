"""A nano-drone's real flights beside simulations of its thrust: commands, battery, motor speeds, rotor drag.

Run: python benchmarks/gap_nanodrone.py
Prints a table and writes benchmarks/gap_nanodrone.csv. Needs the data of ../shared/data, and pandas with
pyarrow; without the data nothing is done.

The simulation makes thrust from the four commands alone, as b times the sum of their squares with b fitted
to the flights used, and no force along x. Forces are 0.045 kg times the specific force that motion
capture's velocity asks for, differentiated by a parabola over 70 ms. Effects are those of
examples/small_multicopter_effects.py: the measured battery voltage, measured motor speeds in place of
commands, and rotor drag. Two multisine flights
are used, a third and two of random setpoints and two of a square are held out, each scored by itself and all
together. RMS is that of the force about its mean, N, in the diagnosed band; weight is 0.441 N.
"""

from __future__ import annotations

import csv
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import savgol_filter
from scipy.spatial.transform import Rotation

from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.gap.compare import Compared
from freqid.gap.connect.callable import CallableSimulation
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.score import closure, followed
from freqid.gap.simulation import Settings
from freqid.gap.tolerance import stated
from freqid.gap.undescribed import without_vehicle
from freqid.simulate.effects.effect import Effect
from freqid.simulate.effects.files import load_file

PROJECT = Path(__file__).resolve().parents[1]
DATA = PROJECT.parent / "shared" / "data" / "nanodrone"
EFFECTS = PROJECT / "examples" / "small_multicopter_effects.py"
MASS, GRAVITY, RATE_HZ = 0.045, 9.81, 100.0
LOW_M, FASTEST = 0.3, 3000.0  # m, above ground; rad/s, of which larger readings are spikes
BAND_HZ = (0.1, 5.0)
USED = ("multisine_20251017_run1", "multisine_20251017_run2")
KEPT = (
    "multisine_20251017_run3",
    "random2_20251017_run1",
    "random2_20251017_run2",
    "square_20251017_run3",
    "square_20251017_run4",
)

Array = NDArray[np.float64]


def record(name: str) -> FlightRecord:
    """Return a flight between its first and last second above `LOW_M`: forward, right, down."""
    table = pd.read_parquet(DATA / f"{name}.parquet")
    aloft = np.flatnonzero(table["z"].to_numpy() > LOW_M)
    table = table.iloc[aloft[0] + 100 : aloft[-1] - 100]
    turn = Rotation.from_quat(table[["qx", "qy", "qz", "qw"]].to_numpy(copy=True))
    moving = table[["vx", "vy", "vz"]].to_numpy(copy=True)
    speeding = savgol_filter(moving, 7, 2, deriv=1, delta=1 / RATE_HZ, axis=0)
    down = np.array([1.0, -1.0, -1.0])  # from forward, left, up
    force = MASS * down * turn.inv().apply(speeding + np.array([0.0, 0.0, GRAVITY]))
    velocity = down * turn.inv().apply(moving)
    held = {f"state/{n}": ("m/s", x) for n, x in zip("uvw", velocity.T, strict=True)}
    held |= {"response/X": ("N", force[:, 0]), "response/Z": ("N", force[:, 2])}
    held["power/voltage"] = ("V", table["Vbat"].to_numpy())
    for i in (1, 2, 3, 4):
        sent = ("1", table[f"m{i}_thrust"].to_numpy())
        held |= {f"command/m{i}": sent, f"effector/m{i}": sent}  # the same: no sensor is in between
        held[f"effector/n{i}"] = ("rad/s", _speed(table[f"m{i}_erpm"].to_numpy()))
    time = np.arange(len(table)) / RATE_HZ
    channels = {
        n: Channel(n, unit, np.ascontiguousarray(x, dtype=float), RATE_HZ, name)
        for n, (unit, x) in held.items()
    }
    return FlightRecord(time, channels)


def _speed(erpm: Array) -> Array:
    """Return a motor's speed, rad/s, spikes and gaps bridged."""
    speed = erpm * 2 * np.pi / 360
    good = np.isfinite(speed) & (speed < FASTEST)
    at = np.arange(speed.size)
    return np.interp(at, at[good], speed[good])


def squares(values) -> Array:
    """Return the sum of squares over motors, shape (sample,)."""
    return np.square(values).sum(axis=0)


def commanded(records: list[FlightRecord]) -> CallableSimulation:
    """Return the simulation of thrust from commands, its one number fitted to records."""
    total = np.concatenate([squares(r.matrix(f"effector/m{i}" for i in (1, 2, 3, 4))) for r in records])
    thrust = np.concatenate([-r["response/Z"] for r in records])
    slope = float(total @ thrust / (total @ total))

    def thrusts(time, state, effector, air, parameters):
        return {"X": 0 * time, "Z": -slope * squares([effector[f"m{i}"] for i in (1, 2, 3, 4)])}

    return CallableSimulation(thrusts, "thrust from commands", ("X", "Z"))


def diagnosed(used: dict[str, FlightRecord], kept: dict[str, FlightRecord]) -> Findings:
    """Return the diagnosis with the closures of all three effects."""
    library = load_file(EFFECTS)
    vehicle = without_vehicle("nano-drone", next(iter(used.values())))
    # the simulation's one number is fitted to these flights, so no derivative is off by a tolerance
    question = Question(
        library,
        stated({"form": 0.0, "derivatives": 0.0}, library),
        BAND_HZ,
        named=tuple(library),
        draws=40,
    )
    return diagnose(
        commanded(list(used.values())),
        [Maneuver(r, vehicle) for r in used.values()],
        question,
        held_out=[Maneuver(r, vehicle) for r in kept.values()],
        names=[*used, *kept],
    )


def rms(compared: list[Compared], effect: Effect, settings: Settings, response: str) -> tuple[float, float]:
    """Return the RMS of a response's residual about its mean before and after, N."""
    found = []
    for c in compared:
        at = [row.name for row in c.rows].index(response)
        measured, before, after = (x[at] for x in followed(c, [effect], settings))
        found.append([(measured - x - (measured - x).mean()) for x in (before, after)])
    before, after = (np.concatenate(x) for x in zip(*found, strict=True))
    return float(np.sqrt(np.mean(before**2))), float(np.sqrt(np.mean(after**2)))


def main() -> None:
    """Print and write the table."""
    if not DATA.is_dir():
        print("the drone's data are not beside this checkout (../shared/data): nothing done")
        sys.exit(0)
    used, kept = {n: record(n) for n in USED}, {n: record(n) for n in KEPT}
    findings = diagnosed(used, kept)
    print(findings.diagnosis.verdict)
    library = load_file(EFFECTS)
    header = ["effect", "flights", "response", "rms_before", "rms_after", "G", "G_lo", "G_hi", "settings"]
    rows = []
    for identifier, response in (("supply_voltage", "Z"), ("measured_speed", "Z"), ("rotor_drag", "X")):
        effect, refit = library[identifier], findings.refits[identifier]
        for kind in ("used", "all held out", *dict.fromkeys(n.split("_")[0] for n in KEPT)):
            scored = {
                n: c
                for n, c in zip(kept, findings.held_out, strict=True)
                if kind == "all held out" or n.startswith(kind)
            }
            if kind == "used":
                scored = dict(zip(used, findings.compared, strict=True))
            names = [*used, *scored]
            args = (findings.compared, list(scored.values()), names, [effect], refit.settings, 0.90)
            found = closure(*args)[0]
            before, after = rms(list(scored.values()), effect, refit.settings, response)
            share = found.wrench
            fitted = "; ".join(
                f"{n} {x.estimate:.4g} [{x.lo:.4g}, {x.hi:.4g}]"
                for n, x in found.settings[identifier].items()
            )
            numbers = [f"{x:.4f}" for x in (before, after, share.G, share.lo, share.hi)]
            rows.append([identifier, kind, response, *numbers, fitted, found.note or share.why_undefined])
            print(*rows[-1], sep="  ", flush=True)
    with Path(__file__).with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([[*header, "note"], *rows])


if __name__ == "__main__":
    main()

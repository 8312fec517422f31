"""A JSBSim c172p as the simulation, an edited copy of it as the aircraft that flew: found, named, closed.

Run: python benchmarks/gap_c172p.py
Prints a table and writes benchmarks/gap_c172p.csv. Needs the extra ``jsbsim``.

The flights are JSBSim's own, from trim, with a light attitude hold and 20 s multisines on elevator, aileron,
rudder and throttle, two periods, logged at 50 Hz with white sensor noise. The copy that flies has 85 % of the
elevator's coefficients of lift and pitching moment and a 60 ms delay in front of its elevator; both are
edits of the aircraft's XML file, made in a temporary folder. Three manoeuvres are compared, a fourth of other
phases and speed is held out. Per case and seed
of the noise: is there a gap, where, which, and how much of it goes on the flight that was not used.
"""

from __future__ import annotations

import csv
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from freqid.core.channels import si_unit
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.gap.connect import connect
from freqid.gap.diagnose import Findings, Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import library
from freqid.simulate.effects.effect import Effect

FOOT, POUND, SLUG = 0.3048, 4.4482216152605, 14.593902937206364
RATE_HZ, STEPS, PERIOD_S, BAND_HZ = 50.0, 8, 20.0, (0.1, 2.0)
LOSS, DELAY_S = 0.15, 0.06
EFFECTS = ("surface_effectiveness", "actuator_delay")
SPEEDS = (48.0, 54.0, 60.0)  # m/s, compared
HELD_OUT = 51.0  # m/s
# of second order: Euler's rule, JSBSim's own choice, puts moments half a step before the rates they make
INTEGRATORS = {
    "rate/rotational": 3,
    "rate/translational": 4,
    "position/rotational": 3,
    "position/translational": 3,
}
CONTROLS = {
    "elevator": "fcs/elevator-pos-rad",
    "aileron": "fcs/left-aileron-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
    "throttle": "fcs/throttle-pos-norm",
}
AMPLITUDE = {"elevator": 0.05, "aileron": 0.05, "rudder": 0.08, "throttle": 0.05}  # of full travel, peak
NOISE = {
    **dict.fromkeys(("state/u", "state/v", "state/w"), 0.1),
    **dict.fromkeys(("state/p", "state/q", "state/r"), np.radians(0.05)),
    **dict.fromkeys(("state/phi", "state/theta", "state/psi"), np.radians(0.05)),
    **dict.fromkeys(("state/ax", "state/ay", "state/az"), 0.03),
    **dict.fromkeys(("effector/elevator", "effector/aileron", "effector/rudder"), np.radians(0.05)),
    "effector/throttle": 0.001,
}
KINDS = dict.fromkeys(("elevator", "aileron", "rudder"), "surface") | {"throttle": "throttle"}

Array = NDArray[np.float64]


def aircraft(folder: Path, *, loss: float = 0.0, delay_s: float = 0.0) -> Path:
    """Copy the c172p of the installed JSBSim into a folder and edit it; return the folder of aircraft."""
    import jsbsim

    source = Path(jsbsim.get_default_root_dir()) / "aircraft" / "c172p"
    there = folder / "aircraft" / "c172p"
    shutil.copytree(source, there)
    file = there / "c172p.xml"
    text = file.read_text(encoding="utf-8", errors="surrogateescape")
    for name in ("CLDe", "Cmde"):
        pattern = rf'(<function name="aero/coefficient/{name}">.*?<value>\s*)([-\d.]+)(\s*</value>)'
        text, count = re.subn(
            pattern, lambda m: f"{m[1]}{(1 - loss) * float(m[2]):.6f}{m[3]}", text, count=1, flags=re.DOTALL
        )
        assert count == 1, name
    if delay_s:
        # an actuator that does nothing but wait, between the trim's sum and the elevator's scale; JSBSim's
        # actuators wait one step less than they are told
        told = delay_s + 1.001 / (STEPS * RATE_HZ)
        part = '<actuator name="fcs/late-elevator"><input>fcs/pitch-trim-sum</input>'
        part += f'<delay type="time">{told}</delay></actuator>'
        old = r'(<aerosurface_scale name="Elevator Control">\s*<input>)fcs/pitch-trim-sum(</input>)'
        text, count = re.subn(old, rf"{part}\n\1fcs/late-elevator\2", text, count=1)
        assert count == 1
    file.write_text(text, encoding="utf-8", errors="surrogateescape")
    return there.parent


def excitation(time: Array, seed: int) -> Array:
    """Return multisines of full travel, shape (control, sample): interleaved harmonics of one period."""
    rng = np.random.default_rng(seed)
    first, last = (round(f * PERIOD_S) for f in BAND_HZ)
    found = []
    for i, name in enumerate(CONTROLS):
        k = np.arange(first + i, last + 1, len(CONTROLS))
        turns = 2 * np.pi * np.outer(time / PERIOD_S, k)
        tries = (np.sin(turns + rng.uniform(0, 2 * np.pi, k.size)).sum(axis=1) for _ in range(30))
        best = min(tries, key=np.ptp)
        found.append(AMPLITUDE[name] * best / np.abs(best).max())
    return np.array(found)


def fly(folder: Path, speed: float, seed: int, *, periods: int = 2, noise: float = 1.0) -> FlightRecord:
    """Return the record of a flight of JSBSim's aircraft in a folder, from trim at a speed, m/s."""
    time = np.arange(round(RATE_HZ * PERIOD_S * periods)) / RATE_HZ
    signals = excitation(time, seed)
    fdm, trim = _trimmed(folder, speed)
    level, rows, before = fdm["attitude/theta-rad"], [], trim
    for k in range(time.size):
        pitch = 0.6 * (fdm["attitude/theta-rad"] - level) + 0.2 * fdm["velocities/q-rad_sec"]
        roll = -0.5 * fdm["attitude/phi-rad"] - 0.1 * fdm["velocities/p-rad_sec"]
        now = trim + signals[:, k] + np.array([pitch, roll, 0.0, 0.0])
        for share in np.arange(1, STEPS + 1) / STEPS if k else ():
            for name, value in zip(CONTROLS, before + share * (now - before), strict=True):
                fdm[f"fcs/{name}-cmd-norm"] = float(value)
            fdm.run()
        if k == 0:
            now = trim
        rows.append(_seen(fdm, now, signals[:, k]))
        before = now
    return _record(time, rows, seed, noise)


def _trimmed(folder: Path, speed: float) -> tuple[Any, Array]:
    """Return JSBSim in trim, and the commands that hold it there."""
    import jsbsim

    root = Path(jsbsim.get_default_root_dir())
    fdm = jsbsim.FGFDMExec(str(folder.parent))
    fdm.set_debug_level(0)
    fdm.set_dt(1 / (STEPS * RATE_HZ))
    fdm.load_model_with_paths("c172p", str(folder), str(root / "engine"), str(root / "systems"))
    given = {"h-sl-ft": 3000.0, "vt-fps": speed / FOOT, "gamma-deg": 0.0, "psi-true-deg": 90.0}
    return fdm, in_trim(fdm, given)


def in_trim(fdm: Any, given: Mapping[str, float]) -> Array:
    """Start JSBSim from initial conditions, by name, and return the commands that hold it in trim."""
    for name, value in given.items():
        fdm[f"ic/{name}"] = value
    fdm["fcs/mixture-cmd-norm"] = 1.0
    fdm["propulsion/set-running"] = -1
    for what, how in INTEGRATORS.items():
        fdm[f"simulation/integrator/{what}"] = how
    fdm.run_ic()
    fdm["simulation/do_simple_trim"] = 1
    trim = np.array([fdm[f"fcs/{n}-cmd-norm"] for n in CONTROLS])
    trim[0] += fdm["fcs/pitch-trim-cmd-norm"]
    fdm["fcs/pitch-trim-cmd-norm"] = 0.0
    return trim


def _seen(fdm: Any, command: Array, injected: Array) -> dict[str, float]:
    """Return one row of the log, SI."""
    row = {f"state/{n}": FOOT * fdm[f"velocities/{n}-fps"] for n in "uvw"}
    row |= {f"state/{n}": fdm[f"velocities/{n}-rad_sec"] for n in "pqr"}
    row |= {f"state/{n}": fdm[f"attitude/{n}-rad"] for n in ("phi", "theta", "psi")}
    for n in "xyz":
        load = fdm[f"forces/fb{n}-aero-lbs"] + fdm[f"forces/fb{n}-prop-lbs"]
        row[f"state/a{n}"] = FOOT * load / fdm["inertia/mass-slugs"]
    row |= {
        "state/alt": FOOT * fdm["position/h-sl-ft"],
        "air/rho": SLUG / FOOT**3 * fdm["atmosphere/rho-slugs_ft3"],
    }
    for name, sent, added in zip(CONTROLS, command, injected, strict=True):
        row[f"effector/{name}"] = fdm[CONTROLS[name]]
        row[f"command/{name}"], row[f"excitation/{name}"] = sent, added
    return row


def _record(time: Array, rows: list[dict[str, float]], seed: int, noise: float) -> FlightRecord:
    rng = np.random.default_rng([seed, 1])
    channels = {}
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        if name in NOISE and noise:
            values = values + noise * NOISE[name] * rng.standard_normal(time.size)
        unit = "1" if name.startswith(("command", "excitation")) else si_unit(name, KINDS) or "1"
        channels[name] = Channel(name, unit, values, RATE_HZ, "JSBSim")
    return FlightRecord(time, channels)


def diagnosed(folder: Path, tolerances: dict[str, float], seed: int, library: dict[str, Effect]) -> Findings:
    """Return the diagnosis of four flights of an aircraft in a folder, the last one held out."""
    simulation = connect("jsbsim:c172p")
    speeds = (*SPEEDS, HELD_OUT)
    flights = [fly(folder, v, seed + i) for i, v in enumerate(speeds)]
    maneuvers = [Maneuver.of(f, simulation.vehicle) for f in flights]
    question = Question(
        library, stated(tolerances, library, simulation, simulation.vehicle), BAND_HZ, seed=seed
    )
    names = [f"at {v:g} metres per second" for v in speeds]
    return diagnose(simulation, maneuvers[:-1], question, held_out=maneuvers[-1:], names=names)


def main() -> None:
    """Print and write the table."""
    rows = []
    with tempfile.TemporaryDirectory() as there:
        folders = {
            "unedited": aircraft(Path(there) / "unedited"),
            "edited": aircraft(Path(there) / "edited", loss=LOSS, delay_s=DELAY_S),
        }
        for case, seed in product(folders, (10, 20)):
            said = diagnosed(folders[case], {}, seed, library()).diagnosis
            print(case, seed, said.verdict)
            row = {"case": case, "seed": seed, "gap": said.gap.exists, "p": f"{said.gap.p:.2g}"}
            row |= {"where": "; ".join(f"{p.response} {p.input} {p.share:.2f}" for p in said.where)}
            row |= {"named": "+".join(said.which.pair or said.which.named), "G": "", "sizes": ""}
            for closure in said.how_far[:1]:
                row["G"] = f"{closure.wrench.G:.3f}"
                sizes = {f"{e}.{n}": x for e, v in closure.settings.items() for n, x in v.items()}
                row["sizes"] = "; ".join(
                    f"{n} {x.estimate:.4f} [{x.lo:.4f}, {x.hi:.4f}]" for n, x in sizes.items()
                )
            rows.append(row)
            print("  ", *row.values(), sep="  ", flush=True)
    with Path(__file__).with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()

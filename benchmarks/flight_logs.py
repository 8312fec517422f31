"""What a log costs: an estimate through several clocks, jitter and gaps; alignment; memory; real flights.

Writes flight_logs.csv. Rows about real flights are left out where the data are not there. With the argument
``memory`` only those rows are made, and printed.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from freqid.core.record import Channel, FlightRecord
from freqid.core.results.design import SampledInputs
from freqid.dynamics.frames import level_from_body
from freqid.flightlog.column_map import AttitudePlace, ChannelPlace, ColumnMap, TimePlace
from freqid.flightlog.read import read_log
from freqid.identify.response.unlogged_excitation import align_excitation

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "nanodrone"
SEEDS = 20
PERIOD = 30.0


def flight(seed):
    """Short-period motion to two periods of a multisine at 1 kHz: time, elevator, w, q."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 2 * PERIOD, 0.001)
    lines = np.arange(3, 60, 2) / PERIOD
    phase = rng.uniform(0, 2 * np.pi, lines.size)
    de = 0.01 * np.sin(2 * np.pi * np.outer(t, lines) + phase).sum(axis=1)
    a = np.array([[-1.2, 18.0], [-0.4, -2.5]])
    b = np.array([-3.0, -12.0])
    state, rows = np.zeros(2), np.empty((2, t.size))
    for i in range(t.size):
        rows[:, i] = state
        half = state + 0.0005 * (a @ state + b * de[i])
        state = state + 0.001 * (a @ half + b * de[i])
    return t, de, rows[0], rows[1]


def estimate(record):
    """Equation error of q on the lines of a multisine, with the ends of the record left out."""
    keep = (record.time > 2) & (record.time < 2 * PERIOD - 2)
    time = record.time[keep]
    lines = np.arange(3, 60) / PERIOD
    kernel = np.exp(-2j * np.pi * np.outer(lines, time))
    window = np.hanning(time.size)
    x = {
        n: kernel @ (window * record[f][keep])
        for n, f in (("w", "state/w"), ("q", "state/q"), ("de", "effector/de"))
    }
    dw = np.gradient(window, time)
    y = 2j * np.pi * lines * x["q"] - kernel @ (dw * record["state/q"][keep])
    z = np.array([x["w"], x["q"], x["de"]]).T
    stacked = np.concatenate([z.real, z.imag])
    return np.linalg.lstsq(stacked, np.concatenate([y.real, y.imag]), rcond=None)[0]


TRUTH = np.array([-0.4, -2.5, -12.0])
CLOCKS = ColumnMap(
    time=TimePlace(column="t_q", unit="s"),
    channel=(
        ChannelPlace(name="state/q", column="q", unit="rad/s", time="t_q"),
        ChannelPlace(name="state/w", column="w", unit="m/s", time="t_w"),
        ChannelPlace(name="effector/de", column="de", unit="rad", time="t_de"),
    ),
)


def logged(folder, seed, *, multirate):
    """Write and read one flight; several clocks with jitter and missing samples, or one clock."""
    rng = np.random.default_rng(1000 + seed)
    t, de, w, q = flight(seed)
    noise = {"q": 0.003, "w": 0.05, "de": 0.0005}
    table = pd.DataFrame()
    for name, x, rate, offset in (("q", q, 250, 0.001), ("w", w, 50, 0.007), ("de", de, 100, 0.003)):
        rate = rate if multirate else 100
        own = (offset if multirate else 0.0) + np.arange(0, 2 * PERIOD - 0.02, 1 / rate)
        if multirate:
            own = own + rng.uniform(-0.1, 0.1, own.size) / rate
            lost = rng.random(own.size) < 0.03
            lost[:2] = lost[-2:] = False
            own = own[~lost]
        # Noise of one density, whatever the rate, so that rates compare.
        values = np.interp(own, t, x) + noise[name] * np.sqrt(rate / 100) * rng.normal(size=own.size)
        part = pd.DataFrame({f"t_{name}": own, name: values})
        table = pd.concat([table, part], axis=1)
    table.to_csv(folder / "x.csv", index=False)
    return read_log(folder / "x.csv", CLOCKS, resample_hz=50.0)


def losses():
    with tempfile.TemporaryDirectory() as folder:
        errors = {
            kind: np.array(
                [
                    estimate(logged(Path(folder), s, multirate=kind == "multirate")) - TRUTH
                    for s in range(SEEDS)
                ]
            )
            for kind in ("uniform", "multirate")
        }
    for kind, rows in errors.items():
        for name, row in zip(("Mw", "Mq", "Mde"), rows.T, strict=True):
            size = abs(TRUTH[("Mw", "Mq", "Mde").index(name)])
            yield f"{name} through a {kind} log: bias", "%", 100 * row.mean() / size
            yield f"{name} through a {kind} log: rms error", "%", 100 * np.sqrt((row**2).mean()) / size


def alignment():
    worst = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        lines = np.arange(3, 60, 2) / PERIOD
        phase = rng.uniform(0, 2 * np.pi, lines.size)

        def signal(t, lines=lines, phase=phase):
            x = 0.02 * np.sin(2 * np.pi * np.outer(t, lines) + phase).sum(axis=1)
            return np.where((t >= 0) & (t <= 2 * PERIOD), x, 0.0)

        own = np.arange(0, 2 * PERIOD + 0.01, 0.02)
        inputs = SampledInputs(("de",), ("rad",), own, signal(np.minimum(own, 2 * PERIOD))[None])
        start = rng.uniform(2, 10)
        t = np.arange(0, 75, 0.02)
        slow = np.convolve(rng.normal(size=t.size), np.ones(20) / np.sqrt(20), mode="same")
        x = signal((t - start) * (1 + 50e-6)) + 0.006 * slow
        record = FlightRecord(time=t, channels={"command/de": Channel("command/de", "rad", x, 50.0, "made")})
        _, timing = align_excitation(record, inputs)
        ends = np.array([0.0, 2 * PERIOD])
        there, found = start + ends / (1 + 50e-6), timing.start_s + ends / (1 + timing.drift)
        worst.append(1e3 * np.abs(there - found).max())
    yield "alignment at 50 Hz, drift 50 ppm: worst end, median of flights", "ms", np.median(worst)
    yield f"alignment at 50 Hz, drift 50 ppm: worst end of {SEEDS} flights", "ms", max(worst)


def memory():
    """Import 2 h x 60 channels x 200 Hz by the command, as it is and resampled; its peak memory."""
    import pyarrow as pa
    import pyarrow.csv as pc
    import pyarrow.parquet as pq

    names = [f"x{i}" for i in range(60)]
    schema = pa.schema([(name, pa.float64()) for name in ("t", *names)])
    t = np.arange(2 * 3600 * 200) / 200
    with tempfile.TemporaryDirectory() as folder:
        column_map = Path(folder) / "map.toml"
        channels = [f'[[channel]]\nname = "effector/{n}"\ncolumn = "{n}"\nunit = "deg"\n' for n in names]
        column_map.write_text('[time]\ncolumn = "t"\nunit = "s"\n' + "".join(channels))
        for kind, suffix, writer in (
            ("Parquet", ".parquet", pq.ParquetWriter),
            ("CSV", ".csv", pc.CSVWriter),
        ):
            path = (Path(folder) / "x").with_suffix(suffix)
            with writer(path, schema) as file:
                for rows in np.array_split(np.arange(t.size), 72):
                    waves = [np.round(np.sin((0.1 + 0.01 * i) * t[rows]), 6) for i in range(60)]
                    file.write_table(pa.table([t[rows], *waves], schema=schema))
            for rate in (0, 50):
                options = ["--map", column_map, "-o", Path(folder) / "x.h5"]
                options += ["--resample", str(rate)] if rate else []
                peak = peak_mib([sys.executable, "-m", "freqid", "import-log", path, *options])
                how = f"resampled to {rate} Hz" if rate else "not resampled"
                yield f"import-log of 2 h x 60 channels x 200 Hz, {kind}, {how}: peak memory", "MiB", peak
            path.unlink()


def peak_mib(command):
    """Run a command and return its largest resident memory, as `/usr/bin/time -v` does."""
    child = subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)  # Popen shall not wait for it again
    if child.returncode:
        raise SystemExit(f"{command[3]} ended with {child.returncode}")
    return used.ru_maxrss / 1024


def nanodrone():
    """Force along the rotors, by velocity and attitude, against the sum of squared speeds; three flights."""
    column_map = ColumnMap(
        time=TimePlace(column="t", unit="s"),
        # East, north, up and forward, left, up: the algebra of the attitude is that of our own axes.
        attitude=AttitudePlace(quaternion=("qw", "qx", "qy", "qz")),
        channel=(
            *(
                ChannelPlace(name=f"state/{ours}", column=theirs, unit="m/s")
                for ours, theirs in (("vn", "vx"), ("ve", "vy"), ("vd", "vz"))
            ),
            # Six pole pairs: mechanical speed by electrical.
            *(
                ChannelPlace(name=f"effector/n{i}", column=f"m{i}_erpm", unit="rpm", scale=1 / 6)
                for i in range(1, 5)
            ),
        ),
    )
    spikes, top, bottom = 0, 0.0, 0.0
    for path in sorted(DATA.glob("multisine_*.parquet")):
        record = read_log(path, column_map, resample_hz=100.0, despike=True)
        flying = (record.time > 5) & (record.time < record.time[-1] - 5)
        spikes += sum(n for name, n in record.provenance["spikes"].items() if name.startswith("effector"))
        squares = sum(record[f"effector/n{i}"] ** 2 for i in range(1, 5))
        acceleration = np.gradient(record.matrix(["state/vn", "state/ve", "state/vd"]), record.dt, axis=1)
        acceleration[2] += 9.80665
        up = level_from_body(record.matrix(["state/phi", "state/theta", "state/psi"]))[:, 2]
        force = 0.045 * (up * acceleration).sum(axis=0)
        top += float(force[flying] @ squares[flying])
        bottom += float(squares[flying] @ squares[flying])
    yield "nano drone, three multisine flights: thrust constant", "1e-8 N/(rad/s)2", 1e8 * top / bottom
    yield "nano drone, three multisine flights: spikes of rotor speeds left out", "samples", spikes


def main():
    if sys.argv[1:] == ["memory"]:  # these rows alone
        for what, unit, value in memory():
            print(f"{what}: {value:.4g} {unit}", flush=True)
        return
    rows = [*losses(), *alignment(), *memory()]
    if DATA.is_dir():
        rows += [*nanodrone()]
    with open(Path(__file__).with_suffix(".csv"), "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["what", "unit", "value"])
        for what, unit, value in rows:
            print(f"{what}: {value:.4g} {unit}")
            writer.writerow([what, unit, f"{value:.4g}"])


if __name__ == "__main__":
    main()

"""When parameters settle on one manoeuvre: `python benchmarks/study_convergence.py`.

Two periods of 60 s of the LA-8 class simulation, research sensors, their full noise, three seeds at each
condition. Every parameter of the six responses is followed by the recursive regression, every second, until
it stays within two standard errors of its value at 120 s. Beside it: by how much the recursive estimate at
the end differs from the batch one, offline (`parameter_history`) and sample by sample (`InFlight`, wings held
at the mean tilt). Writes benchmarks/study_convergence.csv; times of one update: benchmarks/recursive.py.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
from _la8 import EXCITATION, write
from _la8 import SETTINGS as STATED
from _la8_flights import flights, measured

import freqid as fq
from freqid.identify.in_flight.parameter_history import parameter_history
from freqid.identify.in_flight.running import InFlight
from freqid.identify.loads.explanatory import history
from freqid.identify.point import identify_point
from freqid.identify.spectra.fourier import harmonics

CONDITIONS = ("u00", "u10", "u20", "u36", "u45", "u62", "u85")
SEEDS = 3
SHARE, SIGMAS, LIMIT = 0.95, 2.0, 100.0  # of the parameters; of a final standard error; s
TIMES = (60.0, 80.0, 90.0, 100.0, 110.0)
SETTINGS = msgspec.structs.replace(STATED, estimator="least-squares", residuals="coloured")


def in_flight(maneuver: fq.Maneuver) -> dict[str, np.ndarray]:
    """Return the estimates at the end of a manoeuvre that is taken in sample by sample."""
    record, vehicle = maneuver.record, maneuver.vehicle
    flight = InFlight(
        vehicle,
        SETTINGS,
        record.dt,
        harmonics(EXCITATION.period_s, EXCITATION.band_hz),
        tilt_rad={w.tilt: float(record[f"effector/{w.tilt}"].mean()) for w in vehicle.wings},
        accelerometer_m=record.channel("state/ax").position_m,
    )
    samples = np.array(
        [record[f"state/{n}"] if f"state/{n}" in record else history(maneuver, n) for n in flight.channels]
    )
    for name in "uvw":  # in flight these are those of the centre of gravity
        samples[flight.channels.index(name)] = history(maneuver, name)
    for sample in samples.T:
        flight.update(sample)
    return {name: found.estimate for name, found in flight.estimate().items()}


def main() -> None:
    """Print and write the tables."""
    rows = []
    for at, truth in flights(CONDITIONS).items():
        for seed in range(SEEDS):
            maneuver = fq.Maneuver.of(measured(truth, seed))
            found = parameter_history(maneuver, SETTINGS, excitation=EXCITATION)
            batch = identify_point(maneuver, SETTINGS, excitation=EXCITATION)
            beside = in_flight(maneuver)
            time = next(iter(found.values())).time
            away = np.hstack([np.abs(h.estimate - h.estimate[-1]) / h.std_error[-1] for h in found.values()])
            beyond = away > SIGMAS  # (time, parameter)
            # after the last instant at which it is beyond, a parameter has settled
            settled = np.array(
                [
                    time[min(np.flatnonzero(b)[-1] + 1, time.size - 1)] if b.any() else time[0]
                    for b in beyond.T
                ]
            )
            names = list(found)
            offline = max(
                np.abs((found[n].estimate[-1] - batch[n].estimate) / batch[n].estimate).max() for n in names
            )
            sigmas = max(np.abs((beside[n] - batch[n].estimate) / batch[n].std_error).max() for n in names)
            rows.append(
                {
                    "condition": at,
                    "seed": seed,
                    "parameters": str(settled.size),
                    "settled_95_percent_s": f"{np.quantile(settled, SHARE, method='higher'):.0f}",
                    "settled_all_s": f"{settled.max():.0f}",
                    **{
                        f"within_2_sigma_at_{t:.0f}_s": f"{np.mean(~beyond[np.argmin(np.abs(time - t))]):.3f}"
                        for t in TIMES
                    },
                    "settled_by_100_s": f"{np.mean(settled <= LIMIT):.3f}",
                    "recursive_minus_batch_relative": f"{offline:.1e}",
                    "in_flight_minus_batch_sigmas": f"{sigmas:.1e}",
                }
            )
            print(
                "  ".join(f"{k} {v}" if k in ("condition", "seed") else v for k, v in rows[-1].items()),
                flush=True,
            )
    write(Path(__file__), rows)


if __name__ == "__main__":
    main()

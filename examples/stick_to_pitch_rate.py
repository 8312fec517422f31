"""A simulation of one response, pitch rate from a stick, and flights of an aircraft that answers later.

``pitch_rate`` is the simulation: ``--sim examples/stick_to_pitch_rate.py:pitch_rate``. Run as
``python examples/stick_to_pitch_rate.py FOLDER``, the file flies four records of the aircraft, whose stick
is read 70 ms late and passes through a lag of 0.1 s, and writes them as logs.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter, lsim

from freqid import FlightRecord

DELAY_S, LAG_S = 0.07, 0.10
RATE_HZ, PERIOD_S = 50.0, 20.0
NOISE = 0.002  # rad/s
# Short period: q/stick = K (s + 1/T) / (s^2 + 2 zeta omega s + omega^2)
GAIN, LEAD, OMEGA, ZETA = 4.0, 1.2, 3.0, 0.6
SHORT_PERIOD = ([GAIN, GAIN * LEAD], [1, 2 * ZETA * OMEGA, OMEGA**2])


def pitch_rate(time, state, effector, air, parameters):
    """Return the pitch rate, rad/s, that the stick, rad, makes from rest."""
    b, a = cont2discrete(SHORT_PERIOD, time[1] - time[0], method="foh")[:2]  # type: ignore[arg-type]
    return {"q": lfilter(b[0], a, effector["stick"])}


pitch_rate.responses = ("q",)  # type: ignore[attr-defined]


def fly(seed: int, *, delay: float = DELAY_S, lag: float = LAG_S) -> FlightRecord:
    """Return two periods of a multisine on the stick and the pitch rate that was measured."""
    rng = np.random.default_rng(seed)
    fine = 4  # steps for each sample
    time = np.arange(round(2 * PERIOD_S * RATE_HZ * fine)) / (RATE_HZ * fine)
    harmonics = np.arange(2, 61, 2)[:, None]
    phases = rng.uniform(0, 2 * np.pi, harmonics.shape)

    def stick(at):
        """From rest within a second."""
        tones = np.sin(2 * np.pi * harmonics * at / PERIOD_S + phases).sum(axis=0)
        return 0.01 * np.clip(at, 0.0, 1.0) * tones

    moved = lsim(([1], [lag, 1]), stick(time - delay), time)[1] if lag else stick(time - delay)
    q = lsim(SHORT_PERIOD, moved, time)[1]
    kept = slice(None, None, fine)
    clock = time[kept]
    sent = {f"{group}/stick": stick(clock) for group in ("effector", "command", "excitation")}
    values = {"state/q": q[kept] + NOISE * rng.standard_normal(clock.size), **sent}
    return FlightRecord.of(clock, values, units=dict.fromkeys(sent, "rad"))


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for seed in (1, 2, 3, 4):
        record = fly(seed)
        rows = np.column_stack([record.time, record["state/q"], record["effector/stick"]])
        header = "time,q,stick"
        np.savetxt(folder / f"flight{seed}.csv", rows, delimiter=",", header=header, comments="")

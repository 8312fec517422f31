"""Responses of whole aircraft in simulated closed-loop flight: errors without noise, coverage, and bias.

Conditions u20, u45 and u70 of the tilt-wing, and u18 of the six-propeller aircraft. The tilt-wing has
eighteen effectors, more than one flight's lines can tell apart without much smoothing: one measurement is six
flights of two periods, three effectors each, on every third line. The other aircraft's three surfaces fly
once; its propellers follow the control law, and what they do is counted for the surfaces.

The truth is the simulation's own response without noise and not its linearisation, whose wakes are steady.
Each effector is excited by itself at a tenth of the amplitude, and on each line the outputs of all flights
are divided by the inputs, with no smoothing, in the second period.

Without noise the flights have the full amplitude, and a tenth of it: the difference between the two is the
aircraft's nonlinearity. Errors are those of pairs that move the output by at least a tenth of what the
strongest effector does at that frequency. There the local denominator has two poles (--poles 2).

Noise is that of the research sensors, in turbulence, and the estimates are those of the command's defaults,
without poles. Coverage: how often the 95 % circle holds the truth; beside it that of two poles, whose columns
hold the output's noise and have weak instruments. Bias: the mean error over its own standard error, rms;
beside it the same with the measured inputs in place of the injected signals, S_uy / S_uu.

    python benchmarks/frequency_response_aircraft.py [FIRST_SEED [SETS [CASE...]]]

writes frequency_response_aircraft.csv, only the rows of cases that are named. Flights are kept in
the folder for temporary files.
"""

from __future__ import annotations

import csv
import pickle
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

import numpy as np

import freqid as fq
from freqid.core.errors import DataError
from freqid.core.record import Maneuver
from freqid.core.results.design import SampledInputs
from freqid.identify.response.injected_lines import injected_lines
from freqid.identify.response.local_response import ResponseLines, local_response
from freqid.simulate.control.lq import close_loop
from freqid.simulate.fly import fly, sortie
from freqid.simulate.maneuver import Conditions, flyable, logged

HERE = Path(__file__).resolve().parent
FOLDER = Path(tempfile.gettempdir()) / "freqid-responses-aircraft"
DT = 0.02
ORDER, LINES, POLES = 2, 4, 2  # the last of flights without noise
OUTPUTS = ("state/p", "state/q", "state/r", "state/phi", "state/theta", "state/ay", "state/az")
SEEN = 0.1  # of an output's largest motion at a frequency: pairs below are not judged in dB
CASES = {
    # scenario, condition, effectors, flights of a measurement, period, harmonics, turbulence at 20 ft, m/s
    "u20": ("la8", "u20", 6, 60.0, (3, 106), 2.0),
    "u45": ("la8", "u45", 6, 60.0, (3, 106), 2.0),
    "u70": ("la8", "u70", 6, 60.0, (3, 106), 2.0),
    "dep6 u18": (str(HERE.parent / "scenarios" / "dep6.toml"), "u18", 1, 40.0, (4, 100), 2.0),
}


class Case:
    """One condition: its scenario, who is excited in which flight, and how it is flown."""

    def __init__(self, name: str):
        path, self.reference, self.flights, self.period, span, self.turbulence = CASES[name]
        self.name, self.scenario = name, fq.read_scenario(path)
        amplitude = self.scenario.excitation.amplitude
        self.effectors = tuple(e.name for e in self.scenario.effector if e.name in amplitude)
        self.units = tuple(e.unit for e in self.scenario.effector if e.name in amplitude)
        self.amplitude = np.array([amplitude[n] for n in self.effectors])
        self.harmonics = np.arange(*span)

    def together(self, flight: int) -> list[int]:
        """Return the effectors that one flight of a measurement excites."""
        return list(range(flight, len(self.effectors), self.flights))

    def inputs(self, excited: list[int], scale: float, periods: int, seed: int) -> SampledInputs:
        """Return multisines of some effectors, harmonics in turn, phases of the lowest peak of many."""
        time = DT * np.arange(round(periods * self.period / DT) + 1)
        values = np.zeros((len(self.effectors), time.size))
        rng = np.random.default_rng([seed, *excited])
        for place, e in enumerate(excited):
            k = self.harmonics[place :: len(excited)]
            waves = [
                np.sin(2 * np.pi * np.outer(time, k) / self.period + rng.uniform(0, 2 * np.pi, k.size)).sum(
                    axis=1
                )
                for _ in range(40)
            ]
            best = min(waves, key=np.ptp)
            values[e] = scale * self.amplitude[e] * best / np.sqrt(k.size)
        return SampledInputs(self.effectors, self.units, time, values)

    @lru_cache(maxsize=2)  # noqa: B019  two cases live at a time
    def loop(self, turbulence: float):
        """Return the scenario in turbulence, its wind, and its control loop."""
        scenario, wind = flyable(self.scenario, Conditions(turbulence=turbulence))
        return scenario, wind, close_loop(scenario, scenario.reference_of(self.reference))

    def fly(self, excited: list[int], scale: float, periods: int, noise: float, seed: int) -> fq.FlightRecord:
        """Return what is logged of one flight."""
        turbulence = self.turbulence * noise
        scenario, wind, loop = self.loop(turbulence)
        inputs = self.inputs(excited, scale, periods, seed)
        at = scenario.reference_of(self.reference)
        flown = fly(sortie(scenario, loop, at, inputs, wind=wind, seed=seed))
        if flown.divergence:
            raise DataError(str(flown.divergence))
        condition = Conditions(noise=noise, turbulence=turbulence, seed=seed)
        return logged(scenario, flown, inputs.names, self.reference, condition, wind).record


def kept(name: str, make):
    """Return a result that is kept in a file."""
    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / f"{name}.pickle"
    if not path.exists():
        path.write_bytes(pickle.dumps(make()))
    return pickle.loads(path.read_bytes())


def truth(case: Case) -> np.ndarray:
    """Return the responses on all harmonics, shape (output, effector, harmonic), by division."""

    def make():
        u, y = [], []
        for e in range(len(case.effectors)):
            record = case.fly([e], 0.1, 2, 0.0, 0)
            size = round(case.period / record.dt)

            def on_lines(names, record=record, size=size):
                rows = np.array([record[n][size : 2 * size + 1] for n in names])
                # what is not periodic, such as a battery that empties, is a line over one period
                drift = (rows[:, -1:] - rows[:, :1]) * np.arange(size) / size
                return np.fft.fft(rows[:, :-1] - drift, axis=1)[:, case.harmonics]

            u.append(on_lines(f"effector/{n}" for n in case.effectors))
            y.append(on_lines(OUTPUTS))
        u, y = np.array(u), np.array(y)  # flight, channel, harmonic
        return np.stack([np.linalg.solve(u[..., k], y[..., k]).T for k in range(u.shape[-1])], axis=-1)

    return kept(f"truth-{case.name}", make)


def measurement(case: Case, scale: float, noise: float, seed: int) -> ResponseLines:
    """Return the lines of all flights of one measurement."""

    def make():
        parts = [
            injected_lines(
                Maneuver.of(case.fly(case.together(i), scale, 2, noise, seed + i), case.scenario.aircraft()),
                i,
                case.effectors,
                "effector",
                OUTPUTS,
                case.period,
            )
            for i in range(case.flights)
        ]
        names = ("hz", "record", "excited", "r", "u", "y")
        return ResponseLines(*(np.concatenate([getattr(p, n) for p in parts], axis=-1) for n in names))

    return kept(f"lines-{case.name}-{scale:g}-{noise:g}-{seed}", make)


def estimated(case: Case, lines: ResponseLines, at: np.ndarray, plain: bool = False, poles: int = 0):
    """Return values and radii of 95 %, shape (output, effector, line) each."""
    if plain:  # the inputs as their own instruments: least squares, S_uy / S_uu
        lines = ResponseLines(lines.hz, lines.record, lines.excited, lines.u, lines.u, lines.y)
    found = [local_response(lines, f, ORDER, LINES, poles) for f in case.harmonics[at] / case.period]
    value = np.stack([one.value for one in found], axis=-1)
    dof = np.array([one.degrees_of_freedom for one in found])
    variance = np.stack([one.variance for one in found], axis=-1)
    return value, np.sqrt(variance * dof * (0.05 ** (-1 / dof) - 1))


def errors(case: Case, value: np.ndarray, exact: np.ndarray) -> dict[str, float]:
    """Return dB and degrees: median and that which 95 % of pairs and frequencies stay below."""
    size = np.abs(exact) * case.amplitude[:, None]
    seen = size >= SEEN * size.max(axis=1, keepdims=True)
    ratio = (value / exact)[seen]
    gain, phase = np.abs(20 * np.log10(np.abs(ratio))), np.abs(np.degrees(np.angle(ratio)))
    both = {"db": gain, "deg": phase}
    return {
        f"{unit}_{word}": round(float(np.quantile(x, q)), 4)
        for unit, x in both.items()
        for word, q in (("median", 0.5), ("95", 0.95))
    }


def judge(name: str, first: int, sets: int) -> dict:
    case = Case(name)
    exact = truth(case)
    at = np.arange(2, case.harmonics.size - 2, 3)  # the outermost windows are one-sided
    row: dict = {"case": name, "flights": case.flights, "sets": sets}
    for label, scale in (("", 1.0), ("tenth_", 0.1)):
        clean = estimated(case, measurement(case, scale, 0.0, 0), at, poles=POLES)[0]
        row |= {f"{label}{k}": v for k, v in errors(case, clean, exact[..., at]).items()}
    found, plain, by_poles = [], [], []
    for s in range(sets):
        lines = measurement(case, 1.0, 1.0, first + 100 * s)
        found.append(estimated(case, lines, at))
        plain.append(estimated(case, lines, at, plain=True)[0])
        by_poles.append(estimated(case, lines, at, poles=POLES))
        print(name, s, flush=True)
    if sets:
        value, radius = (np.array(x) for x in zip(*found, strict=True))
        plain = np.array(plain)
        truth_at = exact[..., at]
        row["coverage_95"] = round(float(np.mean(np.abs(value - truth_at) < radius)), 4)
        near, wide = (np.array(x) for x in zip(*by_poles, strict=True))
        row["coverage_95_poles"] = round(float(np.mean(np.abs(near - truth_at) < wide)), 4)
        for label, x in (("instruments", value), ("plain", plain)):
            mean = x.mean(axis=0)
            scatter = np.mean(np.abs(x - mean) ** 2, axis=0) / (sets - 1)
            row[f"bias_{label}"] = round(float(np.sqrt(np.mean(np.abs(mean - truth_at) ** 2 / scatter))), 2)
            row |= {
                f"mean_{label}_{k}": v for k, v in errors(case, mean, truth_at).items() if k.startswith("db")
            }
    print(row, flush=True)
    return row


def main(first: int, sets: int, names) -> None:
    path = Path(__file__).with_suffix(".csv")
    rows = {}
    if path.exists():
        with path.open(newline="") as file:
            rows = {row["case"]: row for row in csv.DictReader(file)}
    for name in names:
        rows[name] = judge(name, first, sets)
        columns = list(dict.fromkeys(key for row in rows.values() for key in row))
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows[n] for n in CASES if n in rows)


if __name__ == "__main__":
    words = sys.argv[1:]
    main(int(words[0]) if words else 1000, int(words[1]) if words[1:] else 20, words[2:] or CASES)

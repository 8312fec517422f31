"""Whether a quick look tells logs that are usable from those whose flight must be repeated.

Thirty seeded logs of three aircraft in gusts, flown by the simulation: half as they should be (some without
logged excitation, on another clock or a little smaller), half with a fault put into the flight or the
logger. A verdict counts as right where it is as expected and, for a fault, where a reason names it. Run as
``python benchmarks/quicklook.py``; ``--unseen`` flies an aircraft that it was not written with, ``--seed
1000`` the logs that it was.
"""

from __future__ import annotations

import csv
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from _logged_flights import asked, design, logged, scenario

import freqid as fq
from freqid.core.errors import FreqidError
from freqid.core.results.design import MultisineDesign
from freqid.core.scenario import Scenario

LOGS, FIRST_SEED = 30, 70


@dataclass
class Case:
    """One log, what it is held against, and what a reason must name; nothing for a usable log."""

    record: fq.FlightRecord
    plan: MultisineDesign
    described: Scenario
    reason: str = ""


def flown(name: str, at: str, seed: int, change: Callable[[MultisineDesign], MultisineDesign]) -> Case:
    """Fly a changed design in gusts, and hold the log against the design itself."""
    plan = design(name, seed % 3)
    gusts = float(np.random.default_rng(seed).uniform(0.0, 1.5))
    return Case(logged(name, at, seed, turbulence=gusts, flown=change(plan)), plan, scenario(name))


def scaled(plan: MultisineDesign, factors: dict[str, float]) -> MultisineDesign:
    """Return a design with other amplitudes of some inputs."""
    signals = tuple(replace(s, amplitude=factors.get(s.name, 1.0) * s.amplitude) for s in plan.signals)
    return replace(plan, signals=signals)


def picked(plan: MultisineDesign, seed: int, kind: str = "") -> str:
    """Return one of the effectors, of a kind where one is named."""
    names = [s.name for s in plan.signals if not kind or s.unit == kind]
    return names[np.random.default_rng(seed).integers(len(names))]


def without(record: fq.FlightRecord, *groups: str) -> fq.FlightRecord:
    """Return a record without some groups of channels."""
    kept = {n: c for n, c in record.channels.items() if not n.startswith(groups)}
    return replace(record, channels=kept)


def good(name: str, at: str, seed: int) -> Case:
    return flown(name, at, seed, lambda plan: plan)


def no_excitation_logged(name: str, at: str, seed: int) -> Case:
    """Log commands and positions only."""
    case = good(name, at, seed)
    return replace(case, record=without(case.record, "excitation/"))


def on_another_clock(name: str, at: str, seed: int) -> Case:
    """Log the time of day, from a moment before the design starts."""
    case = good(name, at, seed)
    record, lead = case.record, round(3.7 / case.record.dt)
    rng = np.random.default_rng(seed)
    channels = {}
    for n, c in record.channels.items():
        rest = 0.0 if n.startswith("excitation/") else float(np.std(np.diff(c.values)) / np.sqrt(2.0))
        level = 0.0 if n.startswith("excitation/") else c.values[0]
        before = level + rest * rng.standard_normal(lead)
        channels[n] = replace(c, values=np.concatenate((before, c.values)))
    clock = 36000.0 + record.dt * np.arange(record.time.size + lead)
    return replace(case, record=replace(record, time=clock, channels=channels))


def slightly_smaller(name: str, at: str, seed: int) -> Case:
    """Fly the design at 80 % of its amplitudes."""
    return flown(name, at, seed, lambda plan: scaled(plan, {s.name: 0.8 for s in plan.signals}))


def missing_input(name: str, at: str, seed: int) -> Case:
    """Fly without the injection on one effector."""
    plan = design(name, seed % 3)
    gone = picked(plan, seed)
    case = flown(name, at, seed, lambda plan: scaled(plan, {gone: 0.0}))
    return replace(case, reason=f"injection on '{gone}'")


def wrong_design(name: str, at: str, seed: int) -> Case:
    """Fly the same harmonics with other phases."""
    case = good(name, at, seed)
    return replace(case, plan=design(name, seed % 3 + 3), reason="another design")


def injection_interchanged(name: str, at: str, seed: int) -> Case:
    """Inject the signals of two effectors into each other's."""
    plan = design(name, seed % 3)
    unit = next(s.unit for s in plan.signals if sum(t.unit == s.unit for t in plan.signals) > 1)
    a, b = [s for s in plan.signals if s.unit == unit][:2]

    def exchanged(plan: MultisineDesign) -> MultisineDesign:
        other = {a.name: b, b.name: a}
        signals = tuple(
            replace(
                s, index=other[s.name].index, phase=other[s.name].phase, amplitude=other[s.name].amplitude
            )
            if s.name in other
            else s
            for s in plan.signals
        )
        return replace(plan, signals=signals)

    return replace(flown(name, at, seed, exchanged), reason=f"injection on '{a.name}'")


def saturated(name: str, at: str, seed: int) -> Case:
    """Fly one surface into stops that the scenario states."""
    case = good(name, at, seed)
    n = picked(case.plan, seed, "rad")
    position = case.record[f"effector/{n}"]
    low, high = (float(x) for x in np.quantile(position, [0.15, 0.85]))
    clipped = replace(case.record.channel(f"effector/{n}"), values=np.clip(position, low, high))
    effectors = tuple(
        msgspec.structs.replace(e, limits=(low, high)) if e.name == n else e for e in case.described.effector
    )
    described = msgspec.structs.replace(case.described, effector=effectors)
    return replace(
        case, record=case.record.with_channels(clipped), described=described, reason=f"'{n}' is at"
    )


def weak_actuator(name: str, at: str, seed: int) -> Case:
    """Let one effector follow half of its command."""
    case = good(name, at, seed)
    n = picked(case.plan, seed)
    channel = case.record.channel(f"effector/{n}")
    mean = channel.values.mean()
    slack = replace(channel, values=mean + 0.5 * (channel.values - mean))
    return replace(case, record=case.record.with_channels(slack), reason=f"'{n}' achieved")


def slow_rate(name: str, at: str, seed: int) -> Case:
    """Log rates and positions at so low a rate that the band is not inside."""
    case = good(name, at, seed)
    step = int(np.ceil(0.6 / case.plan.band_hz[1] / case.record.dt))
    slow = [
        replace(c, values=np.repeat(c.values[::step], step)[: c.values.size])
        for n, c in case.record.channels.items()
        if n in ("state/p", "state/q", "state/r")
    ]
    return replace(case, record=case.record.with_channels(*slow), reason="tell nothing above")


def ended_early(name: str, at: str, seed: int) -> Case:
    """Break the run off after half of it."""
    case = good(name, at, seed)
    first = float(case.record.time[0])
    record = case.record.cut(first, first + 0.55 * case.plan.duration_s)
    return replace(case, record=record, reason="periods of the design")


def too_small(name: str, at: str, seed: int) -> Case:
    """Fly the design at a fiftieth of its amplitudes in strong gusts: the aircraft is hardly moved."""
    plan = design(name, seed % 3)
    tiny = scaled(plan, {s.name: 0.02 for s in plan.signals})
    return Case(
        logged(name, at, seed, turbulence=0.0, flown=tiny), plan, scenario(name), "parameters have not met"
    )


def too_noisy(name: str, at: str, seed: int) -> Case:
    """Log with vibration on the accelerometers and gyros, as of a loose mount."""
    case = good(name, at, seed)
    rng = np.random.default_rng(seed)
    shaken = [
        replace(c, values=c.values + 3.0 * np.std(c.values) * rng.standard_normal(c.values.size) * grown)
        for n, c in case.record.channels.items()
        for grown in ((4.0,) if n.startswith("state/a") and n != "state/alt" else (1.0,))
        if n in ("state/p", "state/q", "state/r", "state/ax", "state/ay", "state/az")
    ]
    return replace(case, record=case.record.with_channels(*shaken), reason="parameters have not met")


USABLE = (good, no_excitation_logged, good, on_another_clock, slightly_smaller)
FAULTY = (
    missing_input,
    wrong_design,
    saturated,
    slow_rate,
    ended_early,
    weak_actuator,
    injection_interchanged,
    too_small,
    too_noisy,
)


def main() -> None:
    """Judge and write the table."""
    first, aircraft, table = asked(FIRST_SEED)
    rows = []
    for i in range(LOGS):
        kinds = FAULTY if i % 2 else USABLE
        make, (name, at) = kinds[(i // 2) % len(kinds)], aircraft[(i + i // 4) % len(aircraft)]
        case = make(name, at, first + i)
        start = time.perf_counter()
        try:
            found = fq.quicklook(case.record, case.plan, case.described, at=at)
            said, usable = found.sentence, found.usable
        except FreqidError as error:
            said, usable = str(error), False
        took = time.perf_counter() - start
        right = (not usable and re.search(re.escape(case.reason), said)) if case.reason else usable
        rows.append(
            {
                "log": make.__name__,
                "aircraft": name,
                "at": at,
                "seed": first + i,
                "expected": "repeat" if case.reason else "usable",
                "verdict": said,
                "seconds": f"{took:.2f}",
                "right": bool(right),
            }
        )
        print("  ".join(f"{value!s:<12}" for value in rows[-1].values()), flush=True)
    print(f"{sum(bool(r['right']) for r in rows)} of {LOGS} right")
    if table:
        path = Path(__file__)
        with path.with_name(path.stem + table).open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()

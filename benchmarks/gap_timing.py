"""How long a diagnosis takes, step by step, beside one prediction of the simulation.

Run: python benchmarks/gap_timing.py [CONDITIONS ...]
Prints a table; of conditions that are named, their diagnosis alone, and its verdict. Ten manoeuvres of 60 s
of the LA-8 class vehicle with an actuator 30 ms late, compared, named and closed, all of it fresh; then one
case of two of them. Beside every time stands this process's time on the processors: where others use the
machine too, that grows less. Memory is counted on Linux.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import resource
import sys
import time
from collections.abc import Callable

from _la8 import SCENARIO, inputs

from freqid.core.record import Maneuver
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import library
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

AT = ("u05", "u10", "u15", "u20", "u25", "u30", "u40", "u45", "u62", "u70")
CASE = (3, 7)  # manoeuvres of one case
SETTINGS = {"actuator_delay": {"extra": 0.03}}


class Clock:
    """Times the steps that a diagnosis tells of."""

    def __init__(self, label: str) -> None:
        self.label, self.step = label, ""
        self.began = self.since = (time.perf_counter(), time.process_time())

    def __call__(self, step: str) -> None:
        """Print how long the step before took."""
        now = time.perf_counter(), time.process_time()
        if self.step:
            self._say(self.step, self.since, now)
        self.step, self.since = step, now

    def end(self) -> None:
        """Print how long the last step and all of it took, and the most memory that was held so far."""
        self("")
        self._say("all of it", self.began, self.since)
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
        print(f"{self.label:<16}most memory so far {most:.1f} GiB")

    def _say(self, what: str, since: tuple[float, float], now: tuple[float, float]) -> None:
        wall, processor = (b - a for a, b in zip(since, now, strict=True))
        print(f"{self.label:<16}{what:<50}{wall:8.2f} s, processors {processor:8.2f} s", flush=True)


def timed(label: str, work: Callable[[Callable[[str], None]], object]) -> None:
    """Print how long the steps of some work take."""
    clock = Clock(label)
    work(clock)
    clock.end()


def main() -> None:
    """Print the table."""
    references = {r.id: r for r in SCENARIO.reference}
    late, sent = with_effects(SCENARIO, SETTINGS), inputs(0)
    flown = [
        fly_maneuver(late, references[at], sent, Conditions(noise=1.0, seed=k), duration=60.0).record
        for k, at in enumerate(AT)
    ]
    maneuvers = [Maneuver.of(r) for r in flown]
    simulation, effects = ScenarioSimulation(SCENARIO), library()
    tolerances = stated(dict(SCENARIO.tolerance), effects, simulation, SCENARIO.aircraft())
    band = SCENARIO.excitation.band_hz if SCENARIO.excitation else (0.05, 2.0)
    question = Question(effects, tolerances, band)
    simulation.predict(flown[0])  # compiled
    if sys.argv[1:]:
        clock = Clock("some manoeuvres")
        found = diagnose(simulation, [maneuvers[AT.index(at)] for at in sys.argv[1:]], question, tell=clock)
        clock.end()
        print(found.diagnosis.verdict)
        return
    timed("one record", lambda tell: (tell("one prediction of 60 s"), simulation.predict(flown[0])))
    some = [maneuvers[k] for k in CASE]
    for label, of in (("ten manoeuvres", maneuvers), ("two, a case", some), ("the case again", some)):
        timed(label, lambda tell, of=of: diagnose(simulation, of, question, tell=tell))


if __name__ == "__main__":
    main()

"""How long a diagnosis of ten manoeuvres takes, step by step, beside one prediction of the simulation.

python benchmarks/gap_timing.py

Ten manoeuvres of 60 s of the LA-8 class vehicle with a late actuator, 200 draws of the null. Beside every
time stands this process's time on the processors: where others use the machine too, that grows less. One case
is two of the manoeuvres diagnosed whole, with the draws that the comparison before has kept; first it is
named only, then refitted and closed too.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from _la8 import SCENARIO, inputs

from freqid.core.record import Maneuver
from freqid.gap import attribute, locate, score
from freqid.gap.closures import start_of
from freqid.gap.compare import Compared, compare
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.gather import evidence_of
from freqid.gap.simulation import side_by_side
from freqid.gap.tolerance import stated
from freqid.simulate.effects import shipped
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

AT = ("u05", "u10", "u15", "u20", "u25", "u30", "u40", "u45", "u62", "u70")
NAME, SETTINGS = "actuator_delay", {"actuator_delay": {"extra": 0.03}}
DRAWS = 200
CASE = slice(0, 2)  # manoeuvres of one case


@contextmanager
def timed(label: str) -> Iterator[list[str]]:
    """Print how long what is done within took, and the notes that were put into the list meanwhile."""
    notes: list[str] = []
    began, used = time.perf_counter(), time.process_time()
    yield notes
    wall, processor = time.perf_counter() - began, time.process_time() - used
    print(f"{label:<34}{wall:8.2f} s, processors {processor:8.2f} s  {'; '.join(notes)}", flush=True)


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        measured(Path(folder))


def measured(cache: Path) -> None:
    references = {r.id: r for r in SCENARIO.reference}
    late, sent = with_effects(SCENARIO, SETTINGS), inputs(0)
    records = [
        fly_maneuver(late, references[at], sent, Conditions(noise=1.0, seed=k), duration=60.0).record
        for k, at in enumerate(AT)
    ]
    simulation, library = ScenarioSimulation(SCENARIO), shipped()
    sizes = stated(dict(SCENARIO.tolerance), library)
    band = SCENARIO.excitation.band_hz if SCENARIO.excitation else (0.05, 2.0)
    compare(simulation, Maneuver.of(records[0]), library, sizes, band, count=25)  # compiled
    with timed("one prediction of 60 s"):
        simulation.predict(records[0])

    def one(k: int) -> Compared:
        return compare(
            simulation, Maneuver.of(records[k]), library, sizes, band, count=DRAWS, seed=1000 * k, cache=cache
        )

    with timed(f"compared, {DRAWS} draws each"):
        side_by_side(simulation, one, range(len(records)))
    with timed("again, the draws kept"):
        used = side_by_side(simulation, one, range(len(records)))
    with timed("weighed and located") as notes:
        evidence = evidence_of(used, apart=True)
        effects = {i: e.of(used[0].maneuver.vehicle) for i, e in library.items()}
        judged = attribute.judge(evidence, effects)
        attribute.existence(judged)
        best = next(j for j in judged if j.name == NAME)
        found = locate.gap_map(used, locate.explained(used, attribute.coefficients(best, evidence)))
        notes.append(f"{judged[0].name}, {next(iter(found.share('row')))}")
    with timed("one effect refitted and closed") as notes:
        start = start_of((NAME,), evidence, judged, effects, used)
        closure, _ = score.closure(used, [], list(AT), [effects[NAME]], start, 0.90)
        notes.append(f"G {closure.wrench.G:.3f}")
    for label, close in (("one case of two manoeuvres, named", False), ("the same, closed too", True)):
        question = Question(library, sizes, band, draws=DRAWS, close=close, cache=cache)
        with timed(label) as notes:
            diagnosed = diagnose(simulation, [Maneuver.of(r) for r in records[CASE]], question)
            notes.append(", ".join(diagnosed.diagnosis.which.named or ("no name",)))


if __name__ == "__main__":
    main()

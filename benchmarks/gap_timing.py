"""How long a diagnosis of ten manoeuvres takes, step by step, beside one prediction of the simulation.

python benchmarks/gap_timing.py

Ten manoeuvres of 60 s of the LA-8 class vehicle with a late actuator, 200 draws of the null.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

from _la8 import SCENARIO, inputs

from freqid.core.record import Maneuver
from freqid.gap import attribute, locate, score
from freqid.gap.closures import start_of
from freqid.gap.compare import Compared, compare
from freqid.gap.connect.scenario import ScenarioSimulation
from freqid.gap.gather import evidence_of
from freqid.gap.simulation import side_by_side
from freqid.gap.tolerance import stated
from freqid.simulate.effects import shipped
from freqid.simulate.maneuver import Conditions, fly_maneuver, with_effects

AT = ("u05", "u10", "u15", "u20", "u25", "u30", "u40", "u45", "u62", "u70")
NAME, SETTINGS = "actuator_delay", {"actuator_delay": {"extra": 0.03}}
DRAWS = 200
FEW = 4  # manoeuvres that are compared both ways


def main() -> None:
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
    began = time.perf_counter()
    simulation.predict(records[0])
    print(f"one prediction of 60 s          {time.perf_counter() - began:7.2f} s")
    began = time.perf_counter()

    def one(k: int) -> Compared:
        return compare(simulation, Maneuver.of(records[k]), library, sizes, band, count=DRAWS, seed=k)

    used = side_by_side(simulation, one, range(len(records)))
    print(f"compared, {DRAWS} draws each        {time.perf_counter() - began:7.2f} s")
    began = time.perf_counter()
    for k in range(FEW):
        one(k)
    alone = time.perf_counter() - began
    began = time.perf_counter()
    side_by_side(simulation, one, range(FEW))
    share = (time.perf_counter() - began) / alone
    print(f"{FEW} of them side by side           {share:7.2f} of one after the other")
    began = time.perf_counter()
    evidence = evidence_of(used, apart=True)
    effects = {i: e.of(used[0].maneuver.vehicle) for i, e in library.items()}
    judged = attribute.judge(evidence, effects)
    attribute.existence(judged)
    best = next(j for j in judged if j.name == NAME)
    found = locate.gap_map(used, locate.explained(used, attribute.coefficients(best, evidence)))
    told = f"{judged[0].name}, {next(iter(found.share('row')))}"
    print(f"weighed and located             {time.perf_counter() - began:7.2f} s: {told}")
    began = time.perf_counter()
    start = start_of((NAME,), evidence, judged, effects, used)
    closure, _ = score.closure(used, [], list(AT), [effects[NAME]], start, 0.90)
    print(f"one effect refitted and closed  {time.perf_counter() - began:7.2f} s: G {closure.wrench.G:.3f}")


if __name__ == "__main__":
    main()

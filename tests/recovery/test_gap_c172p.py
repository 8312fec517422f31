"""JSBSim's c172p as the simulation, a copy with edited XML as the aircraft: located, named and closed."""

import pytest

from freqid.core.record import Maneuver
from freqid.gap.connect import connect
from freqid.gap.diagnose import Question, diagnose
from freqid.gap.model.tolerance import stated
from freqid.simulate.effects import shipped

pytest.importorskip("jsbsim", reason="JSBSim is not installed")


@pytest.mark.slow
def test_a_weak_and_late_elevator_is_found_and_refitted(script, tmp_path):
    benchmark = script("benchmarks/gap_c172p.py")
    folder = benchmark.aircraft(tmp_path, loss=benchmark.LOSS, delay_s=benchmark.DELAY_S)
    simulation = connect("jsbsim:c172p")
    flight = benchmark.fly(folder, 54.0, 3, periods=1)
    library = {i: shipped()[i] for i in (*benchmark.EFFECTS, "inertia", "time_skew")}
    question = Question(library, stated({}, shipped()), benchmark.BAND_HZ, named=benchmark.EFFECTS)
    found = diagnose(simulation, [Maneuver.of(flight, simulation.vehicle)], question).diagnosis
    assert found.gap.exists
    assert {p.response for p in found.where} >= {"actuator/elevator", "M"}
    assert {p.input for p in found.where if p.input} == {"elevator"}  # the mean is driven by none
    closure = found.how_far[0]
    assert set(closure.effects) == set(benchmark.EFFECTS)
    assert closure.wrench.G > 0.8  # on every other line of one short flight
    loss, delay = (closure.settings[i]["elevator"] for i in benchmark.EFFECTS)
    assert loss.estimate == pytest.approx(benchmark.LOSS, rel=0.03)
    assert delay.lo < benchmark.DELAY_S < delay.hi
    position = closure.rmse["actuator/elevator"]
    assert position.after < 0.25 * position.before
    assert closure.log_score > max(c.log_score for c in found.how_far[1:])

"""Diagnoses on real data: a water tunnel's lag of separation, a nano-drone's thrust and rotor drag."""

import numpy as np
import pytest

from freqid.gap.score import closure


@pytest.fixture(scope="module")
def tunnel(script, shared_data):
    benchmark = script("benchmarks/gap_f16xl.py")
    if not benchmark.DATA.is_file():
        pytest.skip("the F-16XL's tunnel data are not in ../shared/data/sidpac")
    return benchmark


def test_a_lag_of_separation_shrinks_the_quasi_steady_residual(tunnel):
    data = tunnel.record()
    found = tunnel.found(tunnel.quasi_steady(data), data, draws=30)
    before, after = tunnel.before_and_after(found, data)
    assert before == pytest.approx(0.660, abs=0.001)  # as published
    assert after < 0.26  # published 0.229 by a transfer function; the same lag run in time leaves 0.243
    assert found.diagnosis.gap.exists
    assert next(iter(found.diagnosis.which.probabilities)) == "separation_lag"
    settings = found.diagnosis.how_far[0].settings["separation_lag"]
    # the published transfer function (p1 s^2 + p2 s + p3) / (s + p4), taken apart
    p1, p2, p3, p4 = 0.83204, 3.21089, 0.19455, 0.15502
    assert settings["strength"].estimate == pytest.approx(p2 - p1 * p4 - p3 / p4, rel=0.05)
    assert settings["time_constant"].estimate == pytest.approx(1 / p4, rel=0.1)
    assert "fitted to" in found.diagnosis.verdict


@pytest.fixture(scope="module")
def drone(script, shared_data):
    pytest.importorskip("pyarrow", reason="pyarrow reads the drone's logs")
    benchmark = script("benchmarks/gap_nanodrone.py")
    if not benchmark.DATA.is_dir():
        pytest.skip("the nano-drone's logs are not in ../shared/data/nanodrone")
    used = {n: benchmark.record(n) for n in benchmark.USED}
    kept = {n: benchmark.record(n) for n in (benchmark.KEPT[0], benchmark.KEPT[3])}
    return benchmark, benchmark.diagnosed(used, kept), used, kept


def test_thrust_is_nearer_with_the_battery_and_nearest_with_motor_speeds(drone):
    benchmark, found, used, _ = drone
    effects = benchmark.load_file(benchmark.EFFECTS)
    (command, battery), (same, speed) = (
        benchmark.rms(found.compared, effects[name], found.refits[name].settings, "Z")
        for name in ("supply_voltage", "measured_speed")
    )
    assert command == same
    assert battery < 0.85 * command
    assert speed < 0.75 * battery
    assert speed < 0.65 * command  # published 0.0440 N and 0.0257 N, with other filters: 0.58
    alone = next(c for c in found.diagnosis.how_far if c.effects == ("measured_speed",))
    measured = alone.settings["measured_speed"]
    constant = measured["thrust_constant"]
    # lines leave out the mean, so the interval is about the slope of a straight line; published is the ratio
    for flight in used.values():
        turning = benchmark.squares(flight.matrix(f"effector/n{i}" for i in (1, 2, 3, 4)))
        assert constant.lo < np.polyfit(turning, -flight["response/Z"], 1)[0] < constant.hi
    assert constant.estimate == pytest.approx(3.72e-8, rel=0.05)
    # motors' speeds make all of the thrust, commands none
    assert measured["share"].lo < 1 < measured["share"].hi


def test_rotor_drag_is_said_not_to_transfer_to_the_square(drone):
    benchmark, found, _, kept = drone
    effect = benchmark.load_file(benchmark.EFFECTS)["rotor_drag"]
    settings = found.refits["rotor_drag"].settings
    said = []
    for name, compared in zip(kept, found.held_out, strict=True):
        names = [*benchmark.USED, name]
        said.append(closure(found.compared, [compared], names, [effect], settings, 0.9)[0])
    multisine, square = said
    assert multisine.wrench.lo > 0.3
    assert not multisine.note
    assert "transfer" in square.note
    assert np.isfinite(square.wrench.G)

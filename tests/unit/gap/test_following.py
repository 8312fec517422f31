"""How a simulated motor's time constant is read from the simulation that declares it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lsim

from freqid.gap.model.following import late, time_constant
from freqid.gap.simulation import Tolerance

DT, TIME_CONSTANT, DELAY = 0.01, 0.07, 0.03


def motor(time_constant_s: float) -> np.ndarray:
    """Return what a motor makes of a command that is late, by an integrator of its own."""
    rng = np.random.default_rng(3)
    time = DT * np.arange(2000)
    lines = zip(np.arange(0.2, 4.0, 0.3), rng.uniform(0, 6.28, 13), strict=True)
    command = sum(np.sin(2 * np.pi * f * (time - DELAY) + phase) for f, phase in lines)
    return lsim(([1.0], [time_constant_s, 1.0]), command, time)[1]


def trial(tolerances):
    position = motor(TIME_CONSTANT)
    command = np.roll(motor(1e-9), -round(DELAY / DT))

    class Record(dict):
        dt = DT

    return SimpleNamespace(
        simulation=SimpleNamespace(tolerances=tolerances),
        positions={"n1": position},
        maneuver=SimpleNamespace(record=Record({"command/n1": command})),
        positions_with=lambda departures: {"n1": motor(TIME_CONSTANT * (1 + departures["n1.time_constant"]))},
    )


def test_a_declared_time_constant_is_read_beside_a_delay():
    asked = trial({"n1.time_constant": Tolerance(0.1)})
    assert time_constant(asked, "n1") == pytest.approx(TIME_CONSTANT, rel=0.01)


@pytest.mark.parametrize("own", [{}, {"n1.time_constant": Tolerance(0.01, "s")}])
def test_what_declares_no_share_has_all_of_its_delay_taken_for_a_lag(own):
    asked = trial(own)
    assert time_constant(asked, "n1") == late(asked, "n1") > 1.2 * TIME_CONSTANT

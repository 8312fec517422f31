from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from freqid.core.errors import UsageError
from freqid.core.scenario import read_scenario
from freqid.simulate.air.dryden import gusts, low_altitude, steady_wind

SCENARIO = read_scenario(Path(__file__).parents[4] / "scenarios" / "la8.toml")[0]


def test_scales_and_intensities_are_those_of_the_specification():
    # MIL-F-8785C at 1000 ft, where the low-altitude model is isotropic, and at 100 ft by hand.
    top = low_altitude(10.0, 304.8, 20.0, 1.83)
    assert np.allclose(top.length, 304.8, rtol=1e-9)
    assert np.allclose(top.sigma, 1.0, rtol=1e-9)
    low = low_altitude(10.0, 30.48, 20.0, 1.83)
    ratio = 0.177 + 0.0823
    assert low.length == pytest.approx((30.48 / ratio**1.2, 30.48 / ratio**1.2, 30.48))
    assert low.sigma == pytest.approx((1 / ratio**0.4, 1 / ratio**0.4, 1.0))


def test_a_seed_gives_the_same_gusts_and_another_gives_others():
    dryden = low_altitude(5.0, 60.0, 15.0, 1.83)
    first = gusts(dryden, 50, 0.02, 3)
    assert np.array_equal(first, gusts(dryden, 50, 0.02, 3))
    assert not np.allclose(first, gusts(dryden, 50, 0.02, 4))
    assert first.shape == (6, 50)


def test_turning_gusts_follow_the_gradients_of_the_velocities():
    # tau r' + r = (dv/dt) / V and the same for -q and w, integrated once over time.
    dryden, dt = low_altitude(5.0, 200.0, 10.0, 1.83), 0.001
    _, v, w, _, q, r = gusts(dryden, 4000, dt, 0)
    for velocity, turning, spans in ((v, r, 3.0), (w, -q, 4.0)):
        tau = spans * 1.83 / (np.pi * 10.0)
        travelled = cumulative_trapezoid(turning, dx=dt, initial=0.0) + tau * (turning - turning[0])
        assert np.allclose(10.0 * travelled, velocity - velocity[0], atol=0.02 * np.std(velocity))


@pytest.mark.parametrize(
    ("height", "airspeed", "message"),
    [
        (400.0, 20.0, r"from 3.048 to 304.8 m above ground, not at 400 m"),
        (60.0, 0.2, r"at least 1 m/s, not 0.2"),
    ],
)
def test_outside_the_model_is_refused(height, airspeed, message):
    with pytest.raises(UsageError, match=message):
        low_altitude(5.0, height, airspeed, 1.83)


def test_wind_is_drawn_within_what_the_day_states():
    winds = np.array([steady_wind(SCENARIO, "owner", seed) for seed in range(200)])
    speeds = np.linalg.norm(winds, axis=1)
    assert 3.0 <= speeds.min() < 3.2
    assert 5.8 < speeds.max() <= 6.0
    assert np.all(winds[:, 2] == 0)
    assert np.all(np.abs(winds[:, :2].mean(axis=0)) < 0.8)  # from everywhere
    assert np.array_equal(steady_wind(SCENARIO, "research", 1), np.zeros(3))
    with pytest.raises(UsageError, match=r"no wind 'ownr'; did you mean 'owner'"):
        steady_wind(SCENARIO, "ownr", 1)

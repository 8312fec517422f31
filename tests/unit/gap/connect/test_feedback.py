"""The control law that a record shows."""

import numpy as np

from freqid.core.record import Channel, FlightRecord
from freqid.gap.connect.feedback import HEARD, law

GAINS = {"theta": 0.6, "q": 0.2}


def flight(seed=0, samples=2000, noise=0.0):
    """Return a record of motions that have nothing to do with each other, and commands made of two."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / 50
    motion = {f"state/{n}": np.cumsum(rng.standard_normal(samples)) / 100 for n in HEARD}
    made = 0.1 + sum(k * motion[f"state/{n}"] for n, k in GAINS.items())
    pilot = np.cumsum(rng.standard_normal(samples)) / 100
    seen = {n: x + noise * rng.standard_normal(samples) for n, x in motion.items()}
    record = FlightRecord(time, {n: Channel(n, "rad", x, 50.0, "test") for n, x in seen.items()})
    return record, np.array([made, pilot, np.full(samples, 0.3)])


def test_a_law_of_attitude_and_rates_is_found_exactly():
    record, rest = flight()
    gains, by_law = law(record, rest, [True, True, True])
    expected = [GAINS.get(n, 0.0) for n in HEARD]
    assert np.allclose(gains[0], expected, atol=1e-9)
    assert by_law[0]


def test_what_no_law_makes_is_left_as_it_was_commanded():
    gains, by_law = law(*flight(), [True, True, True])
    assert not by_law[1]
    assert not gains[1].any()


def test_a_command_that_stands_still_has_no_law():
    gains, _ = law(*flight(), [True, True, True])
    assert np.abs(gains[2]).max() < 1e-9


def test_sensor_noise_moves_the_gains_by_its_share():
    record, rest = flight(noise=0.01)
    gains, by_law = law(record, rest, [True, True, True])
    assert by_law[0]
    assert np.allclose(gains[0], [GAINS.get(n, 0.0) for n in HEARD], atol=0.05)


def test_without_the_injected_signal_no_law_is_fitted():
    gains, by_law = law(*flight(), [False, False, False])
    assert not by_law.any()
    assert not gains.any()

"""Signals through a lag and a delay, against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import detrend

from freqid.core.channels import STATE
from freqid.core.record import Channel, FlightRecord
from freqid.core.units import STANDARD_GRAVITY
from freqid.gap.model.following import slope_of
from freqid.gap.stack.motion import own_flight
from freqid.simulate.effects.signals import delayed, lagged

DT, HZ = 0.04, 2.0
TIME = DT * np.arange(1500)
SETTLED = slice(700, 1450)


def wave(response: complex = 1.0) -> np.ndarray:
    """Return a sine as coarse as a diagnosis takes it, behind a frequency response."""
    return np.imag(response * np.exp(2j * np.pi * HZ * TIME))


@pytest.mark.parametrize("time_constant", [0.003, 0.016, 0.05, 0.3])
def test_a_lag_of_coarse_samples_is_that_of_the_continuous_signal(time_constant):
    expected = wave(1 / (1 + 2j * np.pi * HZ * time_constant))
    np.testing.assert_allclose(lagged(wave(), DT, time_constant)[SETTLED], expected[SETTLED], atol=1e-3)


def test_a_lag_starts_in_its_steady_state_and_takes_rows_one_by_one():
    rows = np.array([np.full(50, 3.0), np.linspace(0, 1, 50)])
    both = lagged(rows, DT, 0.1)
    np.testing.assert_allclose(both[0], 3.0, rtol=1e-12)
    np.testing.assert_allclose(both[1], lagged(rows[1], DT, 0.1), rtol=1e-12)


def test_a_delay_of_a_part_of_a_coarse_sample_takes_nothing_off():
    expected = wave(np.exp(-2j * np.pi * HZ * 0.02))
    both = delayed(np.array([wave(), 2 * wave()]), DT, 0.02)
    np.testing.assert_allclose(both[0, SETTLED], expected[SETTLED], atol=2e-3)
    np.testing.assert_allclose(both[1], 2 * both[0], rtol=1e-12)


def test_a_rate_of_coarse_samples_is_not_short():
    np.testing.assert_allclose(
        slope_of(wave(), DT)[SETTLED], wave(2j * np.pi * HZ)[SETTLED], atol=2e-3 * 2 * np.pi * HZ
    )


def test_attitude_and_felt_acceleration_of_an_own_flight_are_not_short():
    """A pitching aircraft: theta is the integral of q, az the derivative of w less q u and gravity."""
    dt, speed, amplitude, turn = 0.02, 20.0, 0.5, 2 * np.pi * HZ
    time = dt * np.arange(1501)
    w, q = amplitude * np.sin(turn * time), 0.02 * np.cos(turn * time)
    theta = 0.02 / turn * np.sin(turn * time)
    az = amplitude * turn * np.cos(turn * time) - q * speed - STANDARD_GRAVITY * np.cos(theta)
    still = np.zeros_like(time)
    own = {"u": still + speed, "v": still, "w": w, "p": still, "q": q, "r": still}
    measured = {"phi": still, "theta": theta, "ax": still, "ay": still, "az": az}
    channels = {f"state/{n}": STATE[n][0] for n in (*own, *measured)}
    values = {f"state/{n}": x for n, x in (own | measured).items()}
    record = FlightRecord(
        time, {n: Channel(n, unit, values[n], 50.0, "closed form") for n, unit in channels.items()}
    )

    class Flies:
        kind = "callable"

        def fly(self, record, effects=None, departures=None):
            return {f"state/{n}": x for n, x in own.items()}

    found = own_flight(Flies(), record)
    inside = slice(50, -50)
    apart = detrend(found["state/theta"]) - detrend(theta)  # a line of the attitude is the record's own
    assert np.ptp(apart[inside]) < 1e-3 * np.ptp(theta)
    assert np.ptp((found["state/az"] - az)[inside]) < 2e-3 * np.ptp(az)

"""Multisines found again in a record."""

from __future__ import annotations

import numpy as np
import pytest

from freqid.core.errors import DataError, UsageError
from freqid.core.record import Channel, FlightRecord, Maneuver
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.identify.response.frequency_response import estimate_frequency_response
from freqid.identify.response.injected_lines import injected_lines, repeated_period

VEHICLE = Vehicle(name="one", mass_properties=MassProperties(mass_kg=1.0, inertia=Inertia(xx=1, yy=1, zz=1)))
TIME = 0.02 * np.arange(2001)
LINES = np.array([3, 7, 12, 25])


def multisine(period, time=TIME):
    return np.sin(2 * np.pi * LINES[:, None] * time / period + LINES[:, None] ** 2).sum(axis=0)


def record(signal, time=TIME, lead=0.0):
    """Return a record in which q is twice the effector, and the effector the injected signal."""
    rows = {"excitation/de1": signal, "effector/de1": 0.3 + signal, "state/q": 2 * signal}
    channels = {n: Channel(n, "rad/s" if n == "state/q" else "rad", v, 50.0, "test") for n, v in rows.items()}
    return Maneuver(FlightRecord(time + lead, channels, VEHICLE), VEHICLE)


@pytest.mark.parametrize("period", [20.0, 10.0, 13.3])
def test_a_period_that_repeats_is_found(period):
    assert repeated_period(multisine(period)[None], 0.02) == pytest.approx(period, abs=0.011)


def test_fades_do_not_hide_the_period():
    fade = np.clip(np.minimum(TIME, TIME[-1] - TIME) / 1.0, 0, 1)
    assert repeated_period((fade * multisine(20.0))[None], 0.02) == pytest.approx(20.0, abs=0.011)


def test_what_does_not_repeat_has_no_period():
    rng = np.random.default_rng(0)
    assert repeated_period(rng.standard_normal((2, 500)), 0.02) is None
    assert repeated_period(multisine(40.0)[None], 0.02) is None  # one period only
    sweep = np.sin(2 * np.pi * (0.1 * TIME + 0.02 * TIME**2))
    assert repeated_period(sweep[None], 0.02) is None


def test_lines_are_the_harmonics_and_noise_lines_between():
    found = injected_lines(record(multisine(20.0)), 0, ("de1",), "effector", ("q",), 20.0)
    assert found.hz[found.excited[0]] == pytest.approx(LINES / 20.0)
    dark = found.hz[~found.excited[0]]
    assert np.all(np.round(dark * 40) % 2 == 1)  # harmonics without power are no noise lines
    assert found.y[0, found.excited[0]] == pytest.approx(2 * found.u[0, found.excited[0]])


def test_a_lead_in_and_a_tail_at_rest_are_left_out():
    signal = np.concatenate([np.zeros(300), multisine(20.0)[:-1], np.zeros(217)])
    time = 0.02 * np.arange(signal.size)
    found = injected_lines(record(signal, time), 0, ("de1",), "effector", ("q",), 20.0)
    assert found.hz[found.excited[0]] == pytest.approx(LINES / 20.0)


def test_a_gain_of_two_is_a_gain_of_two():
    found = estimate_frequency_response([record(multisine(20.0))], ["de1"], ["q"], order=0, lines=1)
    assert found.value[0, 0] == pytest.approx(np.full(LINES.size, 2.0), rel=1e-6)


def test_records_without_injected_signals_are_refused():
    m = record(multisine(20.0))
    bare = FlightRecord(
        m.record.time, {n: c for n, c in m.record.channels.items() if "exc" not in n}, VEHICLE
    )
    with pytest.raises(UsageError, match="injected signals"):
        estimate_frequency_response([Maneuver(bare, VEHICLE)], None, ["q"])


def test_a_single_period_without_its_length_is_refused():
    with pytest.raises(DataError, match="do not repeat"):
        estimate_frequency_response([record(multisine(40.0))], None, ["q"])


@pytest.mark.parametrize("period", [20.0, None])
def test_a_record_without_signals_beside_one_with_them_is_one_sentence(period):
    flights = [record(multisine(20.0)), record(0 * TIME)]
    with pytest.raises(DataError, match="1 of 2 records hold no injected signals"):
        estimate_frequency_response(flights, None, ["q"], period_s=period)

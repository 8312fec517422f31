"""Predictions that were recorded: matched to manoeuvres, put on their clock, differentiated by regression."""

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, write_record
from freqid.gap.connect import connect

SLOPES = {"state/w": -40.0, "state/q": -6.0, "effector/de": 25.0}
UNITS = {
    "state/w": "m/s",
    "state/q": "rad/s",
    "effector/de": "rad",
    "excitation/de": "rad",
    "response/Z": "N",
}


def flight(seed, reference="cruise", rate=50.0, duration=20.0, start=0.0):
    rng, time = np.random.default_rng(seed), np.arange(round(rate * duration) + 1) / rate
    values = {}
    for i, name in enumerate(SLOPES):
        lines = np.arange(2 + i, 36, 3)[:, None]
        phases = rng.uniform(0, 2 * np.pi, lines.shape)
        values[name] = 0.1 * np.sin(2 * np.pi * lines * time / duration + phases).sum(axis=0)
    values["excitation/de"] = values["effector/de"]
    values["response/Z"] = -200 + sum(slope * values[n] for n, slope in SLOPES.items())
    channels = {n: Channel(n, UNITS[n], v, rate, "made") for n, v in values.items()}
    return FlightRecord(time + start, channels, reference=reference)


def flown(record):
    return replace(record, channels={n: c for n, c in record.channels.items() if n != "response/Z"})


@pytest.fixture
def connected(tmp_path):
    def write(*logs):
        paths = []
        for i, log in enumerate(logs):
            paths.append(tmp_path / f"{i}.h5")
            write_record(paths[-1], log)
        return connect(predictions=paths)

    return write


def test_each_record_gets_the_prediction_of_its_own_manoeuvre(connected):
    logs = [flight(1), flight(2), flight(1, "hover")]
    simulation = connected(*logs)
    assert simulation.responses == ("Z",)
    for log in logs:
        assert np.array_equal(simulation.predict(flown(log)), [log["response/Z"]])


def test_a_prediction_at_another_rate_is_put_on_the_records_clock(connected):
    fast, slow = flight(3, rate=200.0), flight(3, rate=50.0)
    found = connected(fast).predict(flown(slow))
    assert np.allclose(found, slow["response/Z"], atol=1e-3)


def test_a_cut_of_the_record_gets_that_part_of_the_prediction(connected):
    whole = flight(4)
    found = connected(whole).predict(flown(whole).cut(5.0, 12.0))
    assert np.allclose(found[0], whole.cut(5.0, 12.0)["response/Z"])


def test_derivatives_are_identified_from_the_predictions(connected):
    log = flight(5)
    names = [*SLOPES, "excitation/de"]
    found = connected(log).gradient(flown(log), names)
    assert found.shape == (1, 4, log.time.size)
    for i, slope in enumerate(SLOPES.values()):
        assert np.allclose(found[0, i], slope, rtol=1e-3)
    assert not found[0, 3].any()


@pytest.mark.parametrize(
    ("log", "words"),
    [
        (flight(6, start=100.0), "no prediction covers the record of 'cruise' from 0 to 20 s"),
        (flight(6, "hover"), "'hover' 0 to 20 s"),
        (flown(flight(6)), "holds no prediction"),
    ],
)
def test_predictions_that_do_not_fit_are_refused(connected, log, words):
    with pytest.raises(DataError, match=words):
        connected(log).predict(flown(flight(6)))

"""Finding manoeuvres: where they are put, they are found; where nothing moves, it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, write_record
from freqid.flightlog.cut import find_maneuvers
from freqid.workflows.import_log import read_pieces, split_flight

RATE = 50.0
T = 10.0 + np.arange(0, 60, 1 / RATE)
UNITS = {"effector": "rad", "command": "rad", "excitation": "rad", "state": "rad/s"}


def doublet(start, width=1.0, size=0.05):
    up = (start <= T) & (start + width > T)
    down = (start + width <= T) & (start + 2 * width > T)
    return size * (up.astype(float) - down)


def decay(start, size=0.2, seconds=1.5):
    after = np.maximum(T - start, 0)
    return size * np.sin(3 * after) * np.exp(-after / seconds)


def record_of(noise=1e-3, units=None, **signals):
    rng = np.random.default_rng(0)
    channels = {}
    for name, x in signals.items():
        full = name.replace("__", "/")
        unit = (units or {}).get(full, UNITS[full.split("/")[0]])
        values = x + (0 if full.startswith("excitation") else noise * rng.normal(size=T.size))
        channels[full] = Channel(name=full, unit=unit, values=values, native_rate_hz=RATE, source="test")
    return FlightRecord(time=T, channels=channels)


def test_two_manoeuvres_are_found_with_their_trims():
    record = record_of(
        effector__de=doublet(20) + doublet(45),
        effector__da=0 * T,
        state__q=decay(20) + decay(45),
        state__p=0 * T,
    )
    spans = find_maneuvers(record)
    assert len(spans) == 2
    for (start, stop), put in zip(spans, (20.0, 45.0), strict=True):
        # half a window and one second of trim come before the first movement
        assert start == pytest.approx(put - 1.5, abs=0.1)
        assert put + 2.0 + 1.5 <= stop < put + 12.0
    assert find_maneuvers(record) == spans


def test_the_margin_is_asked_for_and_never_takes_a_neighbours_trim():
    record = record_of(effector__de=doublet(20) + doublet(26), state__q=0 * T)
    short, long = find_maneuvers(record, margin_s=0.0), find_maneuvers(record, margin_s=60.0)
    assert short[0][0] == pytest.approx(19.5, abs=0.1)
    assert long[0][1] < long[1][0]
    assert long[0][0] < short[0][0] - 3.0


def test_a_hold_inside_a_manoeuvre_does_not_split_it():
    step = 0.05 * ((T > 20) & (T < 26))
    record = record_of(effector__de=step, state__q=decay(20, seconds=3.0) - decay(26))
    assert len(find_maneuvers(record)) == 1


def test_a_gust_is_neither_trim_nor_manoeuvre():
    record = record_of(effector__de=doublet(20), state__q=decay(20) + decay(45))
    (span,) = find_maneuvers(record)
    assert span[1] < 40


def test_turbulence_does_not_hide_the_trim():
    rng = np.random.default_rng(5)
    rough = np.convolve(rng.normal(size=T.size), np.ones(25) / 25, mode="same") * 0.1
    assert np.ptp(rough[:50]) > np.deg2rad(2)  # above the floor of a calm flight
    record = record_of(effector__de=doublet(30, size=0.2), state__q=rough + decay(30, size=1.5))
    (span,) = find_maneuvers(record)
    assert span[0] == pytest.approx(28.5, abs=0.3)
    assert span[1] < 45


def test_a_short_small_correction_is_passed_over():
    record = record_of(effector__de=doublet(20, size=0.1) + 0.02 * (T > 45), state__q=decay(20))
    (span,) = find_maneuvers(record)
    assert span[1] < 40


def test_a_record_that_is_all_manoeuvre_is_kept_whole():
    record = record_of(
        effector__de=0.05 * np.sin(2 * np.pi * 0.7 * T), state__q=0.2 * np.cos(2 * np.pi * 0.7 * T)
    )
    assert find_maneuvers(record) == ((T[0], T[-1]),)


def test_injected_signals_count_before_effectors_however_small():
    excitation = np.where((T > 20) & (T < 40), 1e-3 * np.sin(2 * np.pi * 0.5 * T), 0.0)
    busy = 0.05 * np.sin(2 * np.pi * 0.5 * T)
    (span,) = find_maneuvers(record_of(excitation__de=excitation, effector__de=busy))
    assert span == (pytest.approx(18.5, abs=0.1), pytest.approx(41.5, abs=0.1))


def test_rotor_speeds_move_when_they_change_by_a_share_of_their_size():
    speed = 600.0 + np.where((T > 30) & (T < 33), 60.0, 0.0)
    quiet = record_of(noise=3.0, units={"effector/n1": "rad/s"}, effector__n1=speed)
    (span,) = find_maneuvers(quiet)
    assert span == (pytest.approx(28.5, abs=0.1), pytest.approx(34.5, abs=0.1))


def test_nothing_found_is_said():
    with pytest.raises(DataError, match="no manoeuvre found"):
        find_maneuvers(record_of(effector__de=0 * T, state__q=0 * T))
    with pytest.raises(DataError, match="no effector, command or excitation"):
        find_maneuvers(record_of(state__q=0 * T))


def stretch(moves):
    time = np.arange(0, 20, 0.02)
    de = np.where((time > 5) & (time < 15), moves * np.sin(2 * time), 0.0)
    channels = {"effector/de": ("rad", de), "state/q": ("rad/s", de)}
    return FlightRecord(time, {n: Channel(n, u, x, 50.0, "test") for n, (u, x) in channels.items()})


def test_a_stretch_without_a_manoeuvre_is_passed_over():
    assert len(split_flight([stretch(0.2), stretch(0.0)])) == 1


def test_stretches_of_a_log_are_none_of_the_record_that_was_kept(tmp_path):
    """Nor are the log's dropouts told again."""
    about = {"whole_spans_s": [[-30.0, -2.0], [0.0, 19.98]], "dropouts": [{"channel": "state/q"}], "kept": 1}
    write_record(tmp_path / "kept.h5", replace(stretch(0.2), provenance=about))
    (piece,) = read_pieces(tmp_path / "kept.h5")
    assert piece.duration == pytest.approx(19.98)
    assert piece.provenance["kept"] == 1
    assert not {"dropouts", "whole_spans_s"} & set(piece.provenance)

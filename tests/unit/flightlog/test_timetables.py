"""Timetables, alone and in Simulink's Datasets: the rows that went in come out, at the times MATLAB means.

The files are written here, with mat-io's writer, with the fields that MATLAB writes: `test_matlab_files`
reads files of its own.
"""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
import simulink_logs as m
from test_simulink_objects import FAST, VERSIONS, T, read

from freqid.core.errors import DataError
from freqid.flightlog.column_map import ChannelPlace, ColumnMap, TimePlace
from freqid.flightlog.listing import list_log
from freqid.flightlog.read import read_log
from freqid.flightlog.readers.matlab import lookup

NOON = datetime(2026, 5, 1, 12, tzinfo=UTC).timestamp()
Q = np.sin(T)
ZERO, STEP = m.duration(0.0), m.duration(0.02)


@VERSIONS
def test_rows_come_back_at_the_times_that_matlab_means(tmp_path, version):
    """Against times counted here, of every way to keep them, and of every save version."""
    cube = np.arange(200 * 2 * 3.0).reshape(200, 2, 3)
    thirds = np.arange(200) / 3
    fine = np.full(200, 1e3 * NOON) + 1j * np.arange(200) * 1e-4  # 100 ns, which the real part cannot hold
    path = m.write(
        tmp_path / "x.mat",
        version,
        stored=m.timetable(m.duration(T), {"q": Q, "both": np.column_stack([Q, T])}, version=5),
        dates=m.timetable(m.moment(1e3 * (NOON + T)), {"q": Q}, version=7),
        zoned=m.timetable(m.moment(1e3 * (NOON + T), "Europe/Berlin"), {"q": Q}),
        complex=m.timetable(m.moment(fine, ts="none"), {"q": Q}, version=8),
        stepped=m.timetable(m.regular(m.duration(0.5), STEP), {"q": Q}),
        rated=m.timetable(m.regular(ZERO, m.duration(1 / 3), 3), {"q": Q}),
        began=m.timetable(m.regular(m.moment(1e3 * NOON), STEP), {"q": Q}, version=5),
        arrays=m.timetable(m.duration(T), {"q": cube, "on": T > 1, "n": np.arange(200, dtype=np.int16)}),
        once=m.timetable(m.duration(1.0), {"q": np.array([[3.0, 4.0]])}),
        none=m.timetable(m.moment(np.empty(0)), {}),
        deep={"in": {"here": m.timetable(m.duration(T), {"q": Q})}},
        cells=m.cell(m.timetable(m.duration(T), {"q": 2 * Q}), 3.0),
    )
    found = read(path)
    for name, time, samples in (
        ("stored.q", T, Q),
        ("stored.both", T, np.column_stack([Q, T])),
        ("dates.q", NOON + T, Q),
        ("zoned.q", NOON + T, Q),
        ("complex.q", NOON + 1e-7 * np.arange(200), Q),
        ("stepped.q", 0.5 + T, Q),
        ("rated.q", thirds, Q),
        ("began.q", NOON + T, Q),
        # the column of element (i, j) of a sample is i + 2 j, as MATLAB counts
        ("arrays.q", T, np.stack([cube[:, i, j] for j in range(3) for i in range(2)], axis=1)),
        ("arrays.on", T, T > 1),
        ("arrays.n", T, np.arange(200)),
        ("once.q", [1.0], [[3.0, 4.0]]),
        ("deep.in.here.q", T, Q),
        ("cells{1}.q", T, 2 * Q),
    ):
        clock = name.rpartition(".")[0] + ".Time"
        np.testing.assert_allclose(lookup(found, clock), time, rtol=2e-16, atol=1e-14)
        np.testing.assert_array_equal(lookup(found, name), samples)
    assert list(found["none"]) == ["Time"]
    assert found["none"]["Time"].size == 0


@VERSIONS
@pytest.mark.parametrize("save", [6, 8])
def test_names_are_those_that_were_given_and_a_number_where_that_is_no_path(tmp_path, version, save):
    long = "q" + 99 * "_"
    name = long if save == 8 else "q [deg per s]"
    variables = {name: Q, "x(1)": T, "a.b": 2 * T}
    path = m.write(
        tmp_path / "x.mat",
        version,
        tt=m.timetable(m.duration(T), variables, ["deg/s", "m", ""], version=save, dimension="Time (s)"),
        uhr=m.timetable(m.duration(T), {"q": Q}, version=save, dimension="Zeit"),
    )
    listed = {c.name: (c.unit, c.label, c.source) for c in list_log(path).channels}
    assert listed == {
        f"tt.{name}": ("deg/s", "", "tt{4}"),
        "tt{2}": ("m", "x(1)", "tt{4}"),
        "tt{3}": ("", "a.b", "tt{4}"),
        "uhr.q": ("", "", "uhr.Zeit"),
    }
    found = read(path)
    for place, values in ((f"tt.{name}", Q), ("tt{1}", Q), ("tt{2}", T), ("tt{3}", 2 * T), ("tt{4}", T)):
        np.testing.assert_allclose(lookup(found, place), values, rtol=4e-16)  # times are kept in ms


@VERSIONS
def test_a_dataset_of_timetables_is_read_by_the_map_that_is_proposed(tmp_path, version):
    """As Simulink logs in the format of timetables: one variable, Data, a signal; a bus is a struct."""
    pitch = m.timetable(m.duration(T), {"Data": np.sin(T)}, ["deg"])
    rate = m.timetable(m.regular(ZERO, m.duration(0.005)), {"Data": np.cos(FAST)}, ["deg/s"])
    path = m.write(
        tmp_path / "x.mat",
        version,
        out=m.output(logsout=m.dataset(m.element(pitch, "theta"), m.element(m.struct(q=rate), "rates"))),
    )
    listing = list_log(path)
    assert {c.name: (c.unit, c.samples, c.label) for c in listing.channels} == {
        "out.logsout.theta.Data": ("deg", 200, "theta"),
        "out.logsout.rates.q.Data": ("deg/s", 800, "q"),
    }
    (tmp_path / "map.toml").write_text(listing.map)
    record = read_log(path, tmp_path / "map.toml", resample_hz=50)
    inside = slice(50, -50)
    for name, of_time in (("state/theta", np.sin), ("state/q", np.cos)):
        error = record[name] - np.radians(of_time(record.time))
        assert np.abs(error[inside]).max() < 1e-6  # of the resampling, 1.4e-5 of the amplitude at the most


def test_dates_start_the_record_and_stand_in_its_provenance(tmp_path):
    """The log's own clock of dates, and one of another rate beside it, which starts later."""
    path = m.write(
        tmp_path / "x.mat",
        slow=m.timetable(m.regular(m.moment(1e3 * NOON), STEP), {"theta": np.sin(T)}, ["deg"]),
        fast=m.timetable(m.moment(1e3 * (NOON + 0.5 + FAST)), {"q": np.cos(0.5 + FAST)}, ["deg/s"]),
    )
    proposed = list_log(path).map
    assert 'variable = "slow.Time"\nunit = "s"\nepoch = "unix"\n' in proposed
    (tmp_path / "map.toml").write_text(proposed)
    record = read_log(path, tmp_path / "map.toml", resample_hz=50)
    assert record.provenance["clock_start"] == "2026-05-01T12:00:00+00:00 (UTC)"
    assert record.time[0] == pytest.approx(0.5, abs=0.02)
    error = record["state/q"] - np.radians(np.cos(record.time))
    assert np.abs(error[50:-50]).max() < 1e-6


def test_what_is_not_read_is_refused_by_name_and_class_and_hinders_nothing_else(tmp_path):
    levels = m.MatlabOpaque({"codes": np.ones((200, 1), np.uint8)}, "categorical")
    short = m.duration(T[:50])
    path = m.write(
        tmp_path / "x.mat",
        good=m.timetable(m.duration(T), {"q": Q, "level": levels, "word": m.cell(*["a"] * 200)}),
        months=m.timetable(m.regular(m.moment(0.0), m.calendar(months=1.0)), {"q": Q}),
        short=m.timetable(short, {"q": Q}),
        uneven=m.timetable(m.duration(T), {"q": Q, "p": Q[:50]}),
        later=m.timetable(m.duration(T), {"q": Q}, compatible=9.0),
        never=m.timetable(m.regular(m.duration(np.nan), STEP), {"q": Q}),
        odd=m.timetable(m.duration(T), {"q": Q}, rows=1.5),
        table=m.MatlabOpaque({"data": m.cell(Q[:, None])}, "table"),
    )
    for place, said in (
        ("good.level", "'good' is a MATLAB object of class categorical, which only MATLAB can read"),
        ("good.word", "variable 'good.word' is no real vector or matrix"),
        (
            "months.q",
            r"class timetable, whose row times step by a calendar duration, which is no fixed time; .* "
            r"q = months.q; t = seconds\(months.Time - months.Time\(1\)\)\.",
        ),
        ("short.q", "class timetable, without row times in s to its 200 rows"),
        ("uneven.q", "class timetable, with 200 rows to a variable of shape 50 x 1"),
        ("later.q", "class timetable, in a layout that only MATLAB can read"),
        ("never.q", "class timetable, without row times in s to its 200 rows"),
        ("odd.q", "class timetable, in a layout that only MATLAB can read"),
        ("table.q", "'table' is a MATLAB object of class table, .* such as q = table.q"),
    ):
        column_map = ColumnMap(
            time=TimePlace(variable="good.Time", unit="s"),
            channel=(ChannelPlace(name="state/q", variable=place, unit="rad/s"),),
        )
        with pytest.raises(DataError, match=said) as caught:
            read_log(path, column_map)
        assert caught.value.where == str(path)
    listing = list_log(path)
    assert "# Not mapped:\n" in listing.map
    assert "\n#   months (timetable)\n" in listing.map
    listed = {c.name: (c.label, c.samples) for c in listing.channels}
    assert listed["good.q"] == ("", 200)
    assert listed["good.level"] == ("categorical", 0)
    assert listed["months"] == ("timetable", 0)


def test_a_timetable_claims_no_more_rows_than_its_file_may_unpack_to(tmp_path):
    path = m.write(tmp_path / "x.mat", endless=m.timetable(m.regular(ZERO, STEP), {}, rows=1e12))
    with pytest.raises(DataError, match="unpacks to more than is believed of a file of its size"):
        list_log(path)

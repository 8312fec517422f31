"""Files that MATLAB wrote, where there are some: set FREQID_MATLAB_FILES to their folder.

None belongs to this project. Those of mat-io's source distributions (0.2.0 and later, under ``tests``) hold
the timetables named here; what is expected of them are the numbers in the scripts beside them, which made
them. Of every other file it is asked that it ends in channels or in one sentence.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from freqid.core.errors import DataError
from freqid.flightlog.listing import list_log
from freqid.flightlog.readers.mat5 import MatlabObject
from freqid.flightlog.readers.matlab import load_variables
from freqid.flightlog.readers.matlab_objects import with_logs_read

pytest.importorskip("matio", reason="mat-io is not installed (extra logs)")
FOLDER = os.environ.get("FREQID_MATLAB_FILES", "")
FILES = sorted(Path(FOLDER).rglob("*.mat")) if FOLDER else []

pytestmark = pytest.mark.skipif(not FILES, reason="FREQID_MATLAB_FILES names no folder of MATLAB's files")


def since_1970(*date):
    return datetime(*date, tzinfo=UTC).timestamp()


ONE, TWO = np.array([1.0, 2, 3]), np.array([[1.0, 4], [2, 5], [3, 6]])
COUNT = np.arange(3.0)
DAYS, NEW_YEAR = since_1970(2023, 1, 1) + 86400 * COUNT, since_1970(2020, 1, 1)
LONG = 100 * "A"
# By the names of variables: name of the row times, row times in s, variables, and units where there are any.
EXPECTED = {
    "tt1 timetable_datetime timetable_v8": ("Time", DAYS, {"data1": ONE}),
    "tt2 timetable_multi_col": ("Time", 10 + 10 * COUNT, {"data2": TWO}),
    "tt3": ("Time", DAYS, {"data1": ONE, "data3": ONE + 6}),
    "tt4 timetable_from_sample_rate": ("Time", 1e-4 * COUNT, {"data1": ONE}),
    "tt5 timetable_from_duration": ("Time", COUNT, {"data1": ONE}),
    "tt6 timetable_from_starttime_duration": ("Time", 10 + COUNT, {"data1": ONE}),
    "tt7 timetable_from_starttime_datetime": ("Time", NEW_YEAR + COUNT, {"data1": ONE}),
    "tt8 timetable_var_names": ("Time", DAYS, {"Pressure": ONE}),
    "tt9 timetable_with_attrs": ("Date", DAYS, {"data1": ONE}, ["m/s"]),
    "timetable_duration": ("Time", 10 + 10 * COUNT, {"data1": ONE}),
    "timetable_step_millis": ("Time", NEW_YEAR + 0.25 + 0.01 * COUNT, {"data1": ONE}),
    "timetable_step_start_offset": ("Time", NEW_YEAR + 0.25 + COUNT, {"data1": ONE}),
    "timetable_step_years": ("Time", NEW_YEAR + 365.2425 * 86400 * COUNT, {"data1": ONE}),
    "timetable_sample_rate": ("Time", np.arange(4) / 3, {"data1": np.arange(1.0, 5)}),
    "timetable_v7_long_varname timetable_v8_long_varname": ("Time", DAYS, {LONG: ONE}),
    "timetable_v7_long_dimname": (100 * "R", DAYS, {"Value": ONE}),
    "timetable_original_names": ("Time [s]", [1, 2], {"p [bar]": ONE[:2]}),
    "timetable_struct": ("Time", [1, 2], {"S": None, "Value": ONE[:2] + 2}),
    "timetable_categorical": ("Time", ONE, {"Level": None}),
    "timetable_empty": ("Time", [], {}),
}
CALENDAR = {
    "tt10",
    "timetable_from_starttime_calendarDuration",
    "timetable_step_caldays",
    "timetable_step_calmonths",
}


def test_timetables_are_what_the_scripts_made():
    count, unknown = 0, set()
    expected = {name: what for names, what in EXPECTED.items() for name in names.split()}
    for path in FILES:
        try:
            variables = load_variables(path)
        except DataError:  # of version 4
            continue
        for name, held in variables.items():
            if not isinstance(held, MatlabObject) or held.class_name != "timetable":
                continue
            table = with_logs_read(path, {name: held})[name]
            if name in CALENDAR:
                assert "calendar duration" in table.because
            elif name in expected:
                clock, time, columns, *units = expected[name]
                assert list(table) == [*columns, clock]
                np.testing.assert_allclose(table[clock], time, rtol=2e-16, atol=1e-15)
                for column, values in columns.items():
                    if values is None:
                        assert not isinstance(table[column], np.ndarray)
                    else:
                        np.testing.assert_array_equal(table[column], values)
                assert [unit for _, unit in table.stated.values()] == (
                    units[0] if units else [""] * len(columns)
                )
            else:
                unknown.add(name)
            count += 1
    if not count:
        pytest.skip("no timetable is among them")
    assert not unknown  # of other files: add what their scripts say


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path).removeprefix(FOLDER))
def test_every_file_ends_in_channels_or_one_sentence(path):
    said = ""
    try:
        list_log(path)
    except DataError as error:
        said = str(error)
    assert said.startswith(str(path)) or not said
    assert "\n" not in said

"""Diagnoses on disk: what is written is read, and what is damaged is refused."""

import json
import math
from dataclasses import replace

import h5py
import numpy as np
import pytest
from made_up_gap import made_up

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.results.diagnosis import Change, GapDiagnosis
from freqid.core.results.gap import read_gap, write_gap


def test_what_is_written_is_read(tmp_path):
    first = made_up()
    write_gap(tmp_path / "g.h5", first, "abc")
    again = read_gap(tmp_path / "g.h5")
    # NaN is not itself: the tables, in which it is null, are compared
    assert again.diagnosis.to_json() == first.diagnosis.to_json()
    assert math.isnan(again.diagnosis.how_far[0].response.G)
    for name in ("which", "gap", "sensors", "tolerances"):
        assert getattr(again.diagnosis, name) == getattr(first.diagnosis, name), name
    for name in ("effect_only", "tolerances_only", "log_score", "strained"):
        assert getattr(again.diagnosis.how_far[0], name) == getattr(first.diagnosis.how_far[0], name), name
    assert (again.coherence, again.increments, again.expected, again.provenance) == (
        first.coherence,
        first.increments,
        first.expected,
        first.provenance,
    )
    for one, other in (
        (again.cells, first.cells),
        (again.spectra[1], first.spectra[1]),
        (again.before_after[0], first.before_after[0]),
    ):
        for name, value in vars(other).items():
            np.testing.assert_array_equal(getattr(one, name), value, err_msg=name)
    with h5py.File(tmp_path / "g.h5") as file:
        assert (file.attrs["format"], file.attrs["scenario_sha256"]) == ("freqid-gap", "abc")


def test_the_table_has_one_number_before_and_after_of_each_figure():
    how_far = made_up().diagnosis.to_json()["how_far"]
    json.dumps(how_far, allow_nan=False)
    # over the response's own rms: sqrt((0.5^2 + 0.5^2) / 2), sqrt((0.125^2 + 0.5^2) / 2)
    assert how_far["rmse"]["before"] == pytest.approx(0.5)
    assert how_far["rmse"]["after"] == pytest.approx(math.sqrt((0.125**2 + 0.5**2) / 2))
    assert how_far["rmse"]["zero"] == pytest.approx(1.0)
    assert (how_far["theil"]["before"], how_far["theil"]["after"]) == pytest.approx((0.3, 0.2))
    assert (how_far["J"]["before"], how_far["J"]["after"], how_far["J"]["zero"]) == (100.0, 30.0, None)
    assert how_far["rmse"]["by_response"]["Z"] == {"before": 4.0, "after": 1.0, "zero": 8.0}
    assert how_far["per_effect"]["stall"]["wrench"]["G"] == 0.8


def test_relations_between_sensors_count_in_no_figure_of_the_simulation():
    closure = made_up().diagnosis.how_far[0]
    more = {**closure.rmse, "kinematic/w": Change(0.3, 0.3, 0.3), "kinematic/u": Change(0.3, 0.1, 0.3)}
    more = replace(closure, rmse=more)
    assert more.to_json()["rmse"]["before"] == closure.to_json()["rmse"]["before"]
    assert more.listed == ("Z", "M", "kinematic/u")  # the one that changes


def test_a_table_without_what_was_added_since_is_read():
    table = made_up().diagnosis.to_json()
    for name in ("sensors", "tolerances"):
        del table[name]
    for name in ("withdrawn", "places", "groups"):
        del table["which"][name]
    assert GapDiagnosis.from_json(table).tolerances == ()


def test_what_is_damaged_is_refused(tmp_path):
    path = tmp_path / "g.h5"
    write_gap(path, made_up())
    with store.editing(path) as file:
        table = json.loads(file["diagnosis"][()])
        del file["diagnosis"]
        file["diagnosis"] = json.dumps({**table, "verdict": 3})
    with pytest.raises(DataError, match="damaged or incomplete as a freqid-gap file"):
        read_gap(path)
    write_gap(path, made_up())
    with store.editing(path) as file:
        del file["map/energy"]
        file["map/energy"] = np.ones((1, 2))
    with pytest.raises(DataError, match=r"'detectability' has shape \(1, 2\), expected \(2, 3, 2, 2\)"):
        read_gap(path)

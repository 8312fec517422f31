"""Diagnoses on disk: what is written is read, and what is damaged is refused."""

import json
import math

import h5py
import numpy as np
import pytest

from freqid.core.diagnosis import Change, Closure, Existence, GapDiagnosis, Interval, Place, Share, Which
from freqid.core.errors import DataError
from freqid.core.gap_file import read_gap, write_gap
from freqid.core.gap_result import BeforeAfter, Cells, GapResult, Increment, ResidualSpectra


def made_up(exists=True):
    rng, nan = np.random.default_rng(0), math.nan
    which = Which(
        {"stall": 0.7, "other": 0.2, "none": 0.1},
        ("stall", "other"),
        (("mass", "sensor_scale"),),
        {"gyroscopic": "needs rotor, which is not there"},
        {"stall": {"strength": Interval(0.4, 0.3, 0.5, "1")}},
    )
    closure = Closure(
        ("stall",),
        {"stall": {"strength": Interval(0.45, 0.4, 0.5, "1")}},
        Share(0.8, 0.7, 0.9),
        Share(nan, nan, nan, "the simulation does not fly by itself"),
        {"Z": Change(4.0, 1.0, 8.0), "M": Change(2.0, 2.0, 4.0)},
        {"Z": Change(0.2, 0.1, 1.0), "M": Change(0.4, 0.3, 1.0)},
        {"Z": Change(120.0, 40.0), "M": Change(80.0, 20.0)},
        ("c.h5",),
        "a note",
        {"sentence": "as flown it costs 3.0 deg", "figures": {"margins/M/phase_deg": {"lo": nan}}},
    )
    diagnosis = GapDiagnosis(
        "A gap beyond noise.",
        "sim.py:wrench",
        ("a.h5", "b.h5", "c.h5"),
        Existence(exists, 1e-3, 0.02, 0.0, {"stall": 0.2, "mass": 0.1}, {"stall": "1", "mass": "1"}),
        (Place("Z", (0.1, 0.5), "u10 u20", "de", "all", 0.6),),
        which,
        (closure,),
        remarks=("a remark",),
    )
    hz, z = np.linspace(0.1, 2, 20), rng.standard_normal((2, 20)) + 1j * rng.standard_normal((2, 20))
    spectra = [
        ResidualSpectra(n, ("Z", "M"), ("N", "N m"), hz, ("de",), (np.arange(20.0) % 2) - 1, z, z / 2, abs(z))
        for n in ("a.h5", "b.h5")
    ]
    x = rng.standard_normal((2, 50))
    changes = BeforeAfter(
        "c.h5",
        True,
        ("Z", "M"),
        ("N", "N m"),
        np.arange(50) / 5,
        x,
        x / 2,
        x / 3,
        hz,
        z,
        z / 2,
        z / 3,
        abs(z),
    )
    energy = rng.uniform(size=(2, 3, 2, 2))
    return GapResult(
        diagnosis,
        Cells(
            ("Z", "M"),
            ("u10", "u20"),
            ("de", ""),
            np.array([(0.1, 0.2), (0.2, 1.0), (1.0, 2.0)]),
            energy,
            np.full((2, 3), 1 / 3),
        ),
        tuple(spectra),
        {"Z": {"de": 0.9}, "M": {"de": 0.1}},
        (Increment("M", "de", -25.0, -28.0, -22.0), Increment("Z", "w", 1.0, -3.0, 5.0)),
        (changes,),
        {"stall": 0.5, "mass": 0.05},
        {"records": ["a.h5", "b.h5"], "seed": 0},
    )


def test_what_is_written_is_read(tmp_path):
    first = made_up()
    write_gap(tmp_path / "g.h5", first, "abc")
    again = read_gap(tmp_path / "g.h5")
    # NaN is not itself: the tables, in which it is null, are compared
    assert again.diagnosis.to_json() == first.diagnosis.to_json()
    assert math.isnan(again.diagnosis.how_far[0].response.G)
    assert again.diagnosis.which == first.diagnosis.which
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


def test_what_is_damaged_is_refused(tmp_path):
    path = tmp_path / "g.h5"
    write_gap(path, made_up())
    with h5py.File(path, "r+") as file:
        table = json.loads(file["diagnosis"][()])
        del file["diagnosis"]
        file["diagnosis"] = json.dumps({**table, "verdict": 3})
    with pytest.raises(DataError, match="damaged or incomplete as a freqid-gap file"):
        read_gap(path)
    write_gap(path, made_up())
    with h5py.File(path, "r+") as file:
        del file["map/energy"]
        file["map/energy"] = np.ones((1, 2))
    with pytest.raises(DataError, match="the map has shape"):
        read_gap(path)

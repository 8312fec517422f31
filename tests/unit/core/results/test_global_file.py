"""A global model on disk: what is written is what is read, and what is damaged is said to be."""

import h5py
import numpy as np
import pytest
import tilt_wing

from freqid.blend.global_model import GlobalModel
from freqid.blend.line_up import line_up
from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.results.corridor import read_global, write_global


@pytest.fixture
def written(tmp_path):
    points = [tilt_wing.exact_point(tilt_wing.trim(u, 1.225), f"u{u:g}") for u in (3.0, 7.0, 12.0)]
    corridor = line_up(points, ["a.h5", "b.h5", "c.h5"])
    write_global(tmp_path / "g.h5", corridor)
    return corridor, tmp_path / "g.h5"


def test_it_comes_back_whole(written):
    corridor, path = written
    back = read_global(path)
    assert (back.ids, back.form, back.vehicle) == (corridor.ids, "force", "tilt-wing")
    assert list(back.provenance["points"]) == ["a.h5", "b.h5", "c.h5"]
    at = tilt_wing.trim(9.0, 1.225)
    expected, found = (GlobalModel(c).wrench(at) for c in (corridor, back))
    np.testing.assert_array_equal(found.values, expected.values)
    np.testing.assert_array_equal(found.std_error, expected.std_error)
    assert found.units == expected.units


def test_the_layout_is_that_of_a_point_model_with_an_axis_of_knots(written):
    corridor, path = written
    with h5py.File(path) as file:
        assert file.attrs["format"] == "freqid-global"
        np.testing.assert_array_equal(file["parameter/Z/w/estimate"], corridor["Z"].estimate[1])
        np.testing.assert_allclose(file["parameter/Z/w/std_error"], corridor["Z"].std_error[1])
        assert file["parameter/Z/w/estimate"].attrs["units"] == "N/(m/s)"
        assert file["covariance/Z"].shape == (3, 7, 7)
        assert file["parameter/M/bias/estimate"].attrs["units"] == "N m"


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (lambda f: f.attrs.__setitem__("version", "2.0"), "layout version 2.0 is newer than"),
        (
            lambda f: f.attrs.__setitem__("format", "freqid-point"),
            "found format 'freqid-point', expected 'freqid-gl",
        ),
        (lambda f: f.__delitem__("covariance/Z"), "damaged or incomplete"),
        (lambda f: f["reference/line"].__setitem__(..., [0, 0, 1]), "no two knots each"),
        (lambda f: f["reference/u"].__setitem__(..., [7.0, 3.0, 12.0]), "do not ascend"),
        (lambda f: f.attrs.__setitem__("responses", "[]"), "it has no response"),
        (lambda f: f["covariance/Z"].__setitem__((0, 1, 1), -1.0), "a variance of 'Z' is negative"),
    ],
)
def test_a_damaged_file_is_refused(written, damage, match):
    _, path = written
    with store.editing(path) as file:
        damage(file)
    with pytest.raises(DataError, match=match):
        read_global(path)

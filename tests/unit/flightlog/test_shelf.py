"""A shelf returns what was put on it, from memory or from its file."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from freqid.core.errors import DataError
from freqid.flightlog import resample
from freqid.flightlog.shelf import Shelf


def test_arrays_beyond_the_limit_come_back_from_the_file_as_they_were():
    rng = np.random.default_rng(0)
    made = {name: rng.normal(size=size) for name, size in (("a", 100), ("b", 300), ("c", 50), ("d", 20))}
    shelf = Shelf(limit=8 * 160)
    for name, values in made.items():
        shelf[name] = values
    assert list(shelf) == list(made)
    assert set(shelf._far) == {"b", "d"}  # a and c fit together
    for name, values in made.items():
        np.testing.assert_array_equal(shelf[name], values)
    shelf["b"] = -made["b"]  # as large as before: in its own place
    assert shelf._end == 8 * 320
    shelf.fill("d", 2, np.ones(3))
    np.testing.assert_array_equal(shelf["d"][2:5], 1.0)
    np.testing.assert_array_equal(shelf["d"][5:], made["d"][5:])
    np.testing.assert_array_equal(shelf.pop("b"), -made["b"])
    assert "b" not in shelf
    del shelf["a"]
    shelf["e"] = np.zeros(90)  # there is room in memory again
    assert "e" in shelf._near


def test_a_full_disk_is_said(monkeypatch):
    shelf = Shelf(limit=0)

    class Full:
        def seek(self, place):
            pass

        def write(self, data):
            raise OSError(28, "No space left on device")

    shelf._file = Full()
    with pytest.raises(DataError, match="No space left"):
        shelf["a"] = np.zeros(3)


def test_a_spline_in_pieces_is_the_spline_of_the_whole(monkeypatch):
    monkeypatch.setattr(resample, "_SPLINED", 500)
    rng = np.random.default_rng(1)
    own = np.sort(np.arange(2600) + rng.uniform(-0.45, 0.45, 2600))
    values = rng.normal(size=(2, own.size))
    even = np.linspace(own[0], own[-1], 3001)
    np.testing.assert_allclose(
        resample._splined(own, values, even), CubicSpline(own, values, axis=1)(even), atol=1e-12
    )

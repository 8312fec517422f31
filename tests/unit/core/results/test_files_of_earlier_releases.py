"""Files as the release before the layouts wrote them: each is read, and written again place by place."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from freqid.core.errors import UncheckedFile
from freqid.core.results.design import read_design, read_inputs, write_design
from freqid.workflows.files import read, save

FILES = Path(__file__).parent / "files"
pytestmark = pytest.mark.filterwarnings("ignore::freqid.core.errors.UncheckedFile")
OF_THE_WRITING = ("created", "version", "freqid_version", "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST")


def contents(path):
    """Every attribute and dataset of a file by its path, as HDF5 gives them."""
    found = {}

    def add(name, item):
        found.update({f"{name}@{k}": v for k, v in item.attrs.items() if k not in OF_THE_WRITING})
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path) as file:
        add("", file)
        file.visititems(add)
    return found


@pytest.mark.parametrize(
    "name", ["record", "design", "point", "global", "response", "gap", "rivals"], ids=lambda name: name
)
def test_a_file_of_an_earlier_release_is_read_and_written_the_same(tmp_path, name):
    before = contents(FILES / f"{name}.h5")
    if name == "design":  # its samples, as they are in the file, and not drawn anew
        design, inputs = read_design(FILES / "design.h5"), read_inputs(FILES / "design.h5")
        write_design(tmp_path / "again.h5", design, inputs, "cd")
    else:
        save(read(FILES / f"{name}.h5"), tmp_path / "again.h5")
    now = contents(tmp_path / "again.h5")
    now["@scenario_sha256"] = before["@scenario_sha256"]  # not every object knows it
    assert set(before) <= set(now)  # what later releases add is not in them
    for place, value in before.items():
        if isinstance(value, str) and value.startswith("{"):  # 2 and 2.0 are one number in JSON
            assert json.loads(now[place]) == json.loads(value), place
            continue
        np.testing.assert_array_equal(now[place], value, err_msg=place)
        assert np.asarray(now[place]).dtype == np.asarray(value).dtype, place


def test_samples_of_classic_inputs_are_read():
    inputs = read(FILES / "classic.h5")
    assert (inputs.names, inputs.units) == (("de", "n1"), ("rad", "rad/s"))
    np.testing.assert_allclose(inputs.values, [np.sin(inputs.time), np.cos(inputs.time)])


def test_values_stand_where_the_files_have_them():
    """Read by h5py beside: a value read from a wrong place would be written to that wrong place too."""
    with h5py.File(FILES / "point.h5") as file:
        point = read(FILES / "point.h5")
        assert point["X"]["de"] == (
            file["parameter/X/de/estimate"][()],
            file["parameter/X/de/std_error"][()],
        )
        beside = point["X"].errors_in_variables
        assert beside.strength[1] == file["parameter/X/de/instrument_strength"][()]
        assert point["X"].lower[0] == file["diagnostics/X/lower"][0]
        np.testing.assert_array_equal(point.prediction["Z"].modelled, file["prediction/Z/modelled"])
    with h5py.File(FILES / "gap.h5") as file:
        gap = read(FILES / "gap.h5")
        np.testing.assert_array_equal(gap.spectra[1].residual.imag, file["spectra/1/residual/imag"])
        np.testing.assert_array_equal(gap.before_after[0].after, file["before_after/0/after"])
        assert gap.increments[1].lo == file["increment/percent"][1, 1]
    with h5py.File(FILES / "global.h5") as file:
        model = read(FILES / "global.h5")
        np.testing.assert_array_equal(model.corridor["Z"].trim[1], file["parameter/Z/w/trim"])
        np.testing.assert_array_equal(model.corridor.schedule[1], file["reference/dw2"])


def test_a_file_without_checksum_is_read_with_a_warning():
    with pytest.warns(
        UncheckedFile, match=r"point\.h5: was written by freqid .*, before files had a checksum"
    ):
        read(FILES / "point.h5")

"""Files that were changed after they were written are refused; on purpose they are changed by `editing`."""

import hashlib
import re

import h5py
import numpy as np
import pytest

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.record import Channel, FlightRecord, read_record, write_record


@pytest.fixture
def path(tmp_path):
    time = 0.02 * np.arange(200)
    channel = Channel("state/q", "rad/s", np.sin(time), 50.0, "made up")
    write_record(tmp_path / "r.h5", FlightRecord(time, {"state/q": channel}))
    return tmp_path / "r.h5"


def test_the_checksum_is_what_sha256sum_says_of_the_bytes_after_the_block(path):
    raw = path.read_bytes()
    lines = raw[:512].decode().split("\n")
    assert lines[0] == "freqid-record file"
    assert lines[2] == hashlib.sha256(raw[512:]).hexdigest()
    with h5py.File(path) as file:  # and other programs read the file all the same
        assert file["state/q"].shape == (200,)


def test_no_changed_byte_is_accepted(path):
    """Of 400 places over the whole file, in the block, the tables of HDF5 and the numbers."""
    whole = path.read_bytes()
    places = {*range(200), *np.linspace(200, len(whole) - 1, 200).astype(int).tolist()}
    for at in sorted(places):
        damaged = bytearray(whole)
        damaged[at] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(DataError, match=r"r\.h5: is damaged or was changed") as caught:
            read_record(path)
        assert "\n" not in str(caught.value)


def test_a_number_changed_in_place_is_refused(path):
    with h5py.File(path, "r+") as file:
        file["state/q"][7] += 1e-15
    with pytest.raises(DataError, match="its bytes do not have the checksum that it states"):
        read_record(path)


def test_a_file_that_lost_its_checksum_is_refused(path):
    raw = path.read_bytes()
    path.write_bytes(bytes(512) + raw[512:])
    with pytest.raises(DataError, match="is damaged or was changed"):
        read_record(path)
    path.write_bytes(raw[512:])  # without the block, HDF5 still reads it
    with h5py.File(path) as file:
        assert file["state/q"].shape == (200,)
    with pytest.raises(DataError, match=r"a file of layout 1\.3 starts with its checksum"):
        read_record(path)


def test_what_is_edited_on_purpose_is_read(path):
    with store.editing(path) as file:
        file["state/q"][7] = 5.0
    assert read_record(path)["state/q"][7] == 5.0
    assert [p.name for p in path.parent.iterdir()] == ["r.h5"]


def test_an_edit_that_fails_changes_nothing(path):
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError), store.editing(path) as file:
        file["state/q"][7] = 1 / 0
    assert path.read_bytes() == before


def test_a_damaged_file_is_not_edited_into_a_good_one(path):
    raw = bytearray(path.read_bytes())
    raw[-9] ^= 1
    path.write_bytes(raw)
    with pytest.raises(DataError, match="is damaged"), store.editing(path):
        pass


def test_the_format_before_the_checksum_is_that_of_the_file(path):
    raw = path.read_bytes()
    path.write_bytes(re.sub(rb"freqid-record", b"freqid-points", raw[:512])[:512] + raw[512:])
    with pytest.raises(DataError, match="is damaged"):
        read_record(path)

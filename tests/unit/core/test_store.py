import dataclasses
import os

import h5py
import msgspec
import numpy as np
import pytest

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.record import Channel, Configuration, FlightRecord, read_record, write_record
from freqid.core.vehicle import Effector, Inertia, MassProperties, Rotor, Vehicle, Wing

MASS = MassProperties(mass_kg=28.6, inertia=Inertia(xx=2, yy=3, zz=4, xz=0.1), cg_sigma_m=(0.01, 0, 0.02))
VEHICLE = Vehicle(
    name="tilt",
    mass_properties=MASS,
    effectors=(Effector(name="dw1", kind="tilt", limits=(0, 1.6), rate_limit=0.5),),
    wings=(Wing(name="front", tilt="dw1", pivot_m=(0.5, 0, 0)),),
    rotors=(Rotor(name="n1", spin=-1, inertia=1e-4, wing="front"),),
)


@pytest.fixture
def flight():
    time = 10.0 + 0.02 * np.arange(200)
    channels = [
        Channel("state/q", "rad/s", np.sin(time), 50.0, "log.csv, column q"),
        Channel("state/ax", "m/s2", np.cos(time), 25.0, "log.csv, column ax", (0.1, 0.0, -0.2)),
        Channel("effector/dw1", "rad", 0.1 * time, 50.0, "log.csv, column 7"),
    ]
    return FlightRecord(
        time,
        {c.name: c for c in channels},
        VEHICLE,
        MASS,
        "u20",
        Configuration("N808", "4.5.1", "ab12"),
        {"files": ["log.csv"]},
    )


def test_a_record_comes_back_whole(flight, tmp_path):
    write_record(tmp_path / "r.h5", flight, "cafe")
    back = read_record(tmp_path / "r.h5")
    assert list(back.channels) == list(flight.channels)
    for name, channel in flight.channels.items():
        assert dataclasses.replace(back.channel(name), values=None) == dataclasses.replace(
            channel, values=None
        )
        np.testing.assert_array_equal(back[name], channel.values)
    np.testing.assert_array_equal(back.time, flight.time)
    for name in ("vehicle", "mass_properties", "reference", "configuration", "provenance"):
        assert getattr(back, name) == getattr(flight, name)


def test_the_file_says_what_others_rely_on(flight, tmp_path):
    write_record(tmp_path / "r.h5", flight, "cafe")
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["format"] == "freqid-record"
        assert file.attrs["scenario_sha256"] == "cafe"
        assert file["time"].is_scale
        assert file["state/q"].dims[0][0] == file["time"]
        assert file["state/q"].attrs["units"] == "rad/s"
        assert file["state/ax"].attrs["native_rate_hz"] == 25.0
        assert msgspec.json.decode(file.attrs["vehicle"])["name"] == "tilt"


def test_a_failed_write_leaves_the_old_file_and_no_litter(flight, tmp_path):
    path = tmp_path / "r.h5"
    write_record(path, flight)
    before = path.read_bytes()
    spoiled = dataclasses.replace(flight, provenance={"not JSON": object()})
    with pytest.raises(TypeError):
        write_record(path, spoiled)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["r.h5"]


def test_an_unwritable_folder_is_said_with_its_name(flight, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match=r"file/r\.h5: cannot be written"):
        write_record(tmp_path / "file" / "r.h5", flight)


def test_files_get_the_usual_permissions(flight, tmp_path):
    mask = os.umask(0o022)
    try:
        write_record(tmp_path / "r.h5", flight)
    finally:
        os.umask(mask)
    assert (tmp_path / "r.h5").stat().st_mode & 0o777 == 0o644


def test_every_truncation_is_refused_in_words(flight, tmp_path):
    write_record(tmp_path / "r.h5", flight)
    whole = (tmp_path / "r.h5").read_bytes()
    cut = tmp_path / "cut.h5"
    for size in np.linspace(0, len(whole) - 1, 40).astype(int):
        cut.write_bytes(whole[:size])
        with pytest.raises(DataError, match=r"cut\.h5: is (no readable HDF5|damaged)"):
            read_record(cut)


def spoil(path, change):
    with store.editing(path) as file:
        change(file)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda f: f.attrs.__setitem__("version", "2.0"), "newer than 1.3"),
        (lambda f: f.attrs.__setitem__("format", "freqid-point"), "expected 'freqid-record'"),
        (lambda f: f.attrs.__delitem__("format"), "found format 'none'"),
        (lambda f: f.__delitem__("state/q"), "damaged or incomplete"),
        (lambda f: f["state/q"].attrs.__delitem__("units"), "'state/q' has no unit"),
        (lambda f: f["state/q"].__setitem__(3, np.nan), "'state/q' is not finite"),
        (lambda f: f["time"].__setitem__(3, 0.0), "time runs backward"),
    ],
)
def test_a_spoiled_file_is_refused_with_its_name_and_the_reason(flight, tmp_path, change, says):
    path = tmp_path / "r.h5"
    write_record(path, flight)
    spoil(path, change)
    with pytest.raises(DataError, match=says) as caught:
        read_record(path)
    assert str(path) in str(caught.value)


def test_a_file_of_another_program_is_refused(tmp_path):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["data"] = 1
    with (
        pytest.raises(DataError, match="expected 'freqid-record'"),
        store.reading(tmp_path / "x.h5", "freqid-record"),
    ):
        pass
    with pytest.raises(DataError, match="no such file"):
        read_record(tmp_path / "absent.h5")

"""Files that mean harm: refused before anything is read, or harmless. Most carry a good checksum."""

import json
import os
import signal
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from freqid.core import probe, store
from freqid.core.errors import DataError, FreqidError, UsageError
from freqid.core.record import Channel, FlightRecord, read_record, write_record
from freqid.core.scenario import is_scenario, read_scenario
from freqid.flightlog.readers.matlab import load_variables
from freqid.workflows.files import read

T = 0.02 * np.arange(100)


@pytest.fixture
def path(tmp_path):
    """A good record, beside a file that it might be made to read."""
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["q"] = T
    (tmp_path / "secret.raw").write_bytes(T.tobytes())
    write_record(tmp_path / "r.h5", FlightRecord(T, {"state/q": Channel("state/q", "rad/s", T, 50.0, "")}))
    return tmp_path / "r.h5"


def replaced(file, path, make):
    """Put something else in the place of a channel, with its attributes."""
    attributes = dict(file["state/q"].attrs)
    del file["state/q"]
    made = make(file, path.parent)
    if made is not None:
        for name in ("units", "native_rate_hz", "source"):
            made.attrs[name] = attributes[name]


def external_link(file, folder):
    file["state/q"] = h5py.ExternalLink(str(folder / "secret.h5"), "/q")


def soft_link(file, folder):
    file["state/q"] = h5py.SoftLink("/time")


def circle(file, folder):
    file["state/again"] = file["/"]


def external_data(file, folder):
    return file.create_dataset("state/q", (100,), "f8", external=[(str(folder / "secret.raw"), 0, 800)])


def virtual_data(file, folder):
    layout = h5py.VirtualLayout((100,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "secret.h5"), "q", (100,))
    return file.create_virtual_dataset("state/q", layout)


def references(file, folder):
    kind = h5py.special_dtype(ref=h5py.Reference)
    return file.create_dataset("state/q", data=np.array([file["time"].ref] * 100, dtype=kind), dtype=kind)


def huge_shape(file, folder):
    return file.create_dataset("state/q", (10**15,), "f8", chunks=(1 << 20,))


def bomb(file, folder):
    """88 MB of zeros in some 100 kB."""
    made = file.create_dataset("state/q", (11 << 20,), "f8", chunks=(1 << 20,), compression="gzip")
    for i in range(11):
        made[i << 20 : (i + 1) << 20] = 0.0
    return made


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (external_link, "'/state/q' is a link to another place"),
        (soft_link, "'/state/q' is a link to another place"),
        (circle, "leads back to itself"),
        (external_data, "has its data in another file"),
        (virtual_data, "has its data in another file"),
        (references, "expected real numbers"),
        (huge_shape, "GB of data in a file of"),
        (bomb, "GB of data in a file of"),
    ],
)
def test_what_hdf5_could_be_made_to_do_is_refused(path, make, says):
    with store.editing(path) as file:
        replaced(file, path, make)
    begun = time.process_time()
    with pytest.raises(DataError, match=says) as caught:
        read_record(path)
    assert time.process_time() - begun < 1.0
    assert str(caught.value).startswith(str(path))
    with pytest.raises(DataError, match=says):
        read(path)


def test_a_matlab_file_with_a_link_to_another_file_is_refused(path):
    mat = path.with_name("x.mat")
    with h5py.File(mat, "w", userblock_size=512) as file:
        file["data"] = h5py.ExternalLink(str(path.with_name("secret.h5")), "/q")
    with pytest.raises(DataError, match=r"x\.mat: '/data' is a link to another place"):
        load_variables(mat)


def test_text_that_is_no_text_is_one_sentence(path):
    """String attributes of other bytes ended in a traceback once."""
    for name in ("format", "version", "reference", "vehicle", "channel_order"):
        whole = path.read_bytes()
        with store.editing(path) as file:
            file.attrs[name] = np.bytes_(b"\xff\xfe\x00\x80")
        with pytest.raises(FreqidError) as caught:
            read_record(path)
        assert "\n" not in str(caught.value)
        path.write_bytes(whole)


@pytest.mark.parametrize("fork", [True, False])
def test_what_crashes_the_hdf5_library_does_not_crash_the_reader(tmp_path, monkeypatch, fork):
    """A file without checksum is read by a process of its own first; here one that ends as such files do."""
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["version"] = "freqid-record", "1.0"
    assert probe.fault_of(path) == ""
    fatal, text = tmp_path / "probe.py", Path(probe.__file__).read_text()
    monkeypatch.setattr(probe, "__file__", str(fatal))
    monkeypatch.setattr(probe._Server, "_of_process", {})
    if not fork:
        monkeypatch.delattr(os, "fork")
    for code, says in (
        ("import signal; os.kill(os.getpid(), signal.SIGSEGV)", "ends the process"),
        ("while True: pass", "does not end"),
        ("x = bytearray(4 << 30)", "takes more memory"),
    ):
        fatal.write_text(text.replace("    def visit(", f"    {code}\n\n    def visit("))
        probe._fault.cache_clear()
        probe._Server._of_process.clear()
        with pytest.raises(DataError, match=f"reading it as HDF5 {says}"):
            read_record(path)
    probe._fault.cache_clear()


def test_one_process_looks_through_many_files_and_survives_them(tmp_path, monkeypatch):
    server = probe._Server()
    monkeypatch.setattr(probe._Server, "_of_process", {os.getpid(): server})
    for i in range(5):
        with h5py.File(tmp_path / f"{i} \n.h5", "w") as file:
            file["x"] = np.arange(5)
        assert probe.fault_of(tmp_path / f"{i} \n.h5") == ""
    assert probe._Server.mine() is server
    server._process.kill()
    server._process.wait()
    with h5py.File(tmp_path / "more.h5", "w") as file:
        file["x"] = np.arange(5)
    assert probe.fault_of(tmp_path / "more.h5") == ""  # by a new one
    assert probe._Server.mine() is not server


@pytest.mark.parametrize("when", ["before it is asked", "while it reads"])
def test_a_probe_that_is_killed_from_outside_is_started_again(tmp_path, monkeypatch, when):
    """A file that nobody tried would be opened, or one that is good refused, if nothing took its place."""
    slow = tmp_path / "probe.py"
    wait = "time.sleep(0.3)"
    slow.write_text(
        Path(probe.__file__).read_text().replace("    def visit(", f"    {wait}\n\n    def visit(")
    )
    monkeypatch.setattr(probe, "__file__", str(slow))
    server = probe._Server()
    monkeypatch.setattr(probe._Server, "_of_process", {os.getpid(): server})
    if when == "before it is asked":
        monkeypatch.setattr(server._process, "poll", lambda: None)  # and nobody has noticed yet
        os.kill(server._process.pid, signal.SIGKILL)
    else:
        threading.Timer(0.2, server._process.kill).start()
    with h5py.File(tmp_path / "good.h5", "w") as file:
        file["x"] = np.arange(5)
    assert probe.fault_of(tmp_path / "good.h5") == ""
    assert probe._Server.mine() is not server
    fatal = "import signal; os.kill(os.getpid(), signal.SIGSEGV)"
    slow.write_text(slow.read_text().replace(wait, fatal))
    probe._Server.mine()._process.kill()
    (tmp_path / "bad.h5").write_bytes((tmp_path / "good.h5").read_bytes())
    assert probe.fault_of(tmp_path / "bad.h5") == "ends the process (signal 11)"


def test_a_right_checksum_does_not_spare_a_file_the_probe(path, tmp_path, monkeypatch):
    """Whoever means harm can compute one; only what this process wrote itself is opened at once."""
    fatal = tmp_path / "probe.py"
    code = "import signal; os.kill(os.getpid(), signal.SIGSEGV)"
    fatal.write_text(
        Path(probe.__file__).read_text().replace("    def visit(", f"    {code}\n\n    def visit(")
    )
    monkeypatch.setattr(probe, "__file__", str(fatal))
    monkeypatch.setattr(probe._Server, "_of_process", {})
    read_record(path)
    monkeypatch.setattr(store, "_written", set())
    with pytest.raises(DataError, match="reading it as HDF5 ends the process"):
        read_record(path)


def test_a_toml_file_of_100_mb_is_refused_at_once(tmp_path):
    path = tmp_path / "s.toml"
    with path.open("wb") as file:
        file.write(b"[vehicle]\n# ")
        file.truncate(100_000_000)
    begun = time.process_time()
    with pytest.raises(DataError, match=r"s\.toml: is larger than 1 MB"):
        read_scenario(path)
    assert not is_scenario(path)
    assert time.process_time() - begun < 0.5


@pytest.mark.parametrize(
    "text",
    [
        "a." * 200_000 + "x = 1",
        "\n".join("a." * 200 + f"x{i} = 1" for i in range(2000)),
        "x = " + "[" * 200_000,
        "x = " + "{a=" * 100_000,
        "x = " + "9" * 500_000,
        "a" * 900_000,
    ],
    ids=["long key", "many long keys", "lists", "tables", "number", "word"],
)
def test_a_toml_file_that_would_not_end_is_refused(tmp_path, text):
    path = tmp_path / "s.toml"
    path.write_text(text)
    begun = time.process_time()
    with pytest.raises(FreqidError):
        read_scenario(path)
    assert time.process_time() - begun < 2.0


@pytest.mark.parametrize("name", ["../../outside", "/tmp/outside", "a/b", "a\\b", "..", "a\nb", "x" * 300])
def test_a_condition_cannot_name_a_file_elsewhere(tmp_path, name):
    path = tmp_path / "s.toml"
    path.write_text(
        '[vehicle]\nname = "x"\nmass_kg = 1.0\ninertia = { xx = 1.0, yy = 1.0, zz = 1.0 }\n'
        f"[[reference]]\nid = {json.dumps(name)}\nu = 20.0\nrho = 1.2\n"
    )
    with pytest.raises(UsageError, match="cannot be the name of a file"):
        read_scenario(path)


def test_an_infinite_number_of_a_scenario_is_named(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text('[vehicle]\nname = "x"\nmass_kg = inf\n')
    with pytest.raises(UsageError, match=r"at vehicle\.mass_kg: found inf, expected a finite number"):
        read_scenario(path)


def test_what_a_name_holds_does_not_reach_the_terminal_as_a_command():
    said = str(DataError("channel 'a\nb\x1b[2J' of θ", where="x\r.csv", remedy="rename it"))
    assert said == r"x\r.csv: channel 'a\nb\x1b[2J' of θ; rename it."

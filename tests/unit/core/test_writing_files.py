"""Files are the old one or the new one, whole, whatever happens to who writes them."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest

from freqid.core import store
from freqid.core.errors import DataError


@pytest.fixture(autouse=True)
def unswept(monkeypatch):
    """As in a process that has written nothing yet."""
    monkeypatch.setattr(store, "_swept", set())


def started(code, *words):
    """Start Python with some code, and wait until it says that it is ready."""
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, words)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


WRITER = """
    import sys, time
    from pathlib import Path
    from freqid.core.store import replacing
    with replacing(Path(sys.argv[1])) as temporary:
        temporary.write_text("half")
        print("ready", flush=True)
        time.sleep(float(sys.argv[2]))
        temporary.write_text("whole")
"""


def parts(folder):
    return [p for p in folder.iterdir() if p.name.endswith(".part")]


def test_what_a_killed_process_left_is_removed_by_the_next(tmp_path):
    target = tmp_path / "x.txt"
    target.write_text("old")
    process = started(WRITER, target, 60)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert len(parts(tmp_path)) == 1
    assert target.read_text() == "old"
    with store.replacing(tmp_path / "y.txt") as temporary:  # another file of the same folder
        temporary.write_text("new")
    assert parts(tmp_path) == []


def test_what_a_live_process_writes_is_not_taken_away(tmp_path):
    target = tmp_path / "x.txt"
    process = started(WRITER, target, 1.0)
    assert len(parts(tmp_path)) == 1
    with store.replacing(tmp_path / "y.txt") as temporary:
        temporary.write_text("new")
    store.remove_left_overs(tmp_path)
    assert len(parts(tmp_path)) == 1
    process.communicate()
    assert process.returncode == 0
    assert target.read_text() == "whole"
    assert parts(tmp_path) == []


def test_only_temporary_files_of_freqid_are_removed(tmp_path):
    names = ["x.part", ".x.part", ".x.h5.part", "x.abcd1234.part", ".x.abcd1234.part~"]
    for name in names:
        (tmp_path / name).write_text("mine")
    (tmp_path / ".x.abcd1234.part").write_text("left by a release before locks")
    store.remove_left_overs(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names)


def test_a_temporary_path_is_written_by_whoever_is_given_it(tmp_path):
    """A unit of work is given one and saves its result there: no second one beside it."""
    with store.replacing(tmp_path / "x.txt") as outer:
        with store.replacing(outer) as inner:
            assert inner == outer
            inner.write_text("new")
        assert not (tmp_path / "x.txt").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["x.txt"]


def test_two_processes_writing_one_file_leave_one_of_the_two(tmp_path):
    code = """
        import sys
        from pathlib import Path
        from freqid.core import store
        print("ready", flush=True)
        fill = lambda file: file.create_dataset("x", data=[float(sys.argv[2])] * 5000)
        while not Path(sys.argv[3]).exists():
            store.write(Path(sys.argv[1]), "freqid-record", fill)
    """
    path, enough = tmp_path / "x.h5", tmp_path / "enough"
    writers = [started(code, path, n, enough) for n in (1, 2)]
    read = 0
    while read < 20:
        assert [w.poll() for w in writers] == [None, None]
        if path.exists():
            with store.reading(path, "freqid-record") as file:
                assert len({*store.array(file, "x").tolist()}) == 1
            read += 1
    enough.touch()
    assert [w.wait() for w in writers] == [0, 0]
    for writer in writers:
        writer.stdout.close()
    enough.unlink()
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


FULL = """
    import resource, signal, sys
    from pathlib import Path
    import numpy as np
    from freqid.core import store
    from freqid.core.errors import DataError
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    print("ready", flush=True)
    try:
        if sys.argv[2] == "h5":
            fill = lambda f: f.create_dataset("x", data=np.ones(int(sys.argv[3])))
            store.write(Path(sys.argv[1]), "freqid-record", fill)
        else:
            with store.replacing(Path(sys.argv[1])) as temporary:
                temporary.write_text("x" * 200_000)
    except DataError as error:
        print(error)
        sys.exit(3)
"""


@pytest.mark.parametrize(("kind", "size"), [("h5", 13_000), ("h5", 1_000_000), ("text", 0)])
def test_a_full_disk_is_one_sentence_and_leaves_the_old_file(tmp_path, kind, size):
    """A limit on the size of files fails in the same calls as a full disk."""
    path = tmp_path / "x.h5"
    path.write_text("old")
    process = started(FULL, path, kind, size)
    said, _ = process.communicate()
    assert process.returncode == 3
    assert said.startswith(f"{path}: cannot be written (")
    assert said.count("\n") == 1
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a folder that nobody may write to")
def test_a_read_only_folder_is_one_sentence():
    with pytest.raises(DataError, match=r"/proc/self/x\.h5: cannot be written \(.+\); choose a folder"):
        store.write("/proc/self/x.h5", "freqid-record", lambda file: None)

"""Read a file in a process of its own first, which may hang or crash in place of ours.

The HDF5 library does not survive every damage: of a thousand files with a few changed bytes
it loops for ever over some and ends the process over others, which no Python code can catch. Nor does
mat-io, which reads the objects in MATLAB files and indexes tables by type codes of the file unchecked.

This file is also what that process runs, so it imports little. It is started once, which takes a fifth of a
second, and forks for every file, which takes milliseconds; where a system cannot fork, it is started for
every file, and where it is killed, once more.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

_SECONDS, _RATE = 1, 50_000_000  # of processor, and bytes that it reads in one more
_WALL, _DISK = 60.0, 5_000_000  # s, where the disk is slow, and bytes that it reads in one more
_EACH = 2e-3  # s more for every group and data set: MATLAB writes some thirty for a timeseries
_OBJECT_SECONDS, _OBJECT_RATE = 3, 1_000_000  # of objects, which are many small arrays
_HDF5, _OBJECTS = "h", "o"  # before a path, how it is to be read
_MEMORY = 1 << 29  # bytes beside the largest data set
_OUT_OF_MEMORY = 3
_DOES_NOT_END = -9  # SIGKILL, as of one that does not hear SIGXCPU


def fault_of(path: Path, *, objects: bool = False) -> str:
    """Return what happened to a process that read all of a file; empty where it ended well.

    An error that Python could catch counts as well: whoever reads the file will say it better.

    Parameters
    ----------
    path : Path
        Of a file that exists.
    objects : bool
        Whether it is read by mat-io, as a MATLAB file with objects, in place of h5py.
    """
    stat = os.stat(path)
    return _fault(os.path.abspath(path), stat.st_mtime_ns, stat.st_size, _OBJECTS if objects else _HDF5)


@lru_cache(maxsize=64)
def _fault(path: str, changed: int, size: int, kind: str) -> str:
    try:
        code = _code(kind + path, _WALL + size / _DISK)
    except OSError:
        return ""  # no Python to start, as inside another program
    if code in (-24, _DOES_NOT_END):  # 24 is SIGXCPU
        return "does not end"
    if code == _OUT_OF_MEMORY:
        return "takes more memory than the file can hold"
    return f"ends the process (signal {-code})" if code < 0 else ""


def _code(asked: str, longest: float) -> int:
    """Return the exit code of a process that reads a file and may take so many seconds."""
    for _ in range(2 if hasattr(os, "fork") else 0):
        server = _Server.mine()
        try:
            return server.code_of(asked, longest)
        except (EOFError, BrokenPipeError):  # it was killed from outside
            server.stop()
    return _started_for(asked, longest)


def _started_for(asked: str, longest: float) -> int:
    """Return the exit code of a process that is started for one file."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        return subprocess.run(
            [sys.executable, "-I", __file__, asked],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=longest,
        ).returncode
    return _DOES_NOT_END


class _Server:
    """The process that forks for every file whose name it is sent."""

    _of_process: ClassVar[dict[int, _Server]] = {}  # as a forked process must not share its pipes
    _turn = threading.Lock()

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-I", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(self._end, os.getpid())

    @classmethod
    def mine(cls) -> _Server:
        """Return the one of this process."""
        with cls._turn:
            found = cls._of_process.get(os.getpid())
            if found is None or found._process.poll() is not None:
                found = cls._of_process[os.getpid()] = cls()
            return found

    def code_of(self, asked: str, longest: float) -> int:
        """Return the exit code of a process that reads a file.

        Raises
        ------
        EOFError, BrokenPipeError
            Where the server has ended.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with self._turn:
            self._process.stdin.write(f"{longest}\0".encode() + os.fsencode(asked) + b"\0")
            self._process.stdin.flush()
            said = self._process.stdout.readline()
        if not said:
            raise EOFError
        return int(said)

    def stop(self) -> None:
        """End it, so that the next file has a new one."""
        with self._turn:
            if self._of_process.get(os.getpid()) is self:
                del self._of_process[os.getpid()]
        self._process.kill()
        self._process.wait()

    def _end(self, owner: int) -> None:
        if os.getpid() == owner:
            with contextlib.suppress(BrokenPipeError):  # it was killed
                self._process.communicate()  # it ends when nothing more can come


def _serve() -> None:
    """Fork for every name on standard input, and write the exit code of each."""
    import h5py  # noqa: F401  before forking

    asked = b""
    while more := os.read(0, 65536):
        asked += more
        while asked.count(b"\0") > 1:
            longest, name, asked = asked.split(b"\0", 2)
            if name.startswith(_OBJECTS.encode()):
                with contextlib.suppress(ImportError):
                    import matio  # noqa: F401  before forking, once it is needed
            child = os.fork()
            if child == 0:
                os.close(0)
                os.close(1)
                _try(os.fsdecode(name))
            until = time.monotonic() + float(longest)
            while not (ended := os.waitpid(child, os.WNOHANG))[0]:
                if time.monotonic() > until:
                    os.kill(child, signal.SIGKILL)
                time.sleep(0.001)
            os.write(1, f"{os.waitstatus_to_exitcode(ended[1])}\n".encode())


def _limit_processor(used: float, seconds: float) -> None:
    """Let this process use so many seconds more than it had used; the limit may be raised again."""
    import resource

    with contextlib.suppress(ValueError):  # beyond a limit that was set from outside
        resource.setrlimit(
            resource.RLIMIT_CPU, (int(used + seconds) + 1, resource.getrlimit(resource.RLIMIT_CPU)[1])
        )


def _limit_memory(beside: int) -> None:
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[0]) if sys.platform == "linux" else 0
    if pages:
        limit = pages * resource.getpagesize() + _MEMORY + beside
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _read_all(path: str, objects: bool) -> None:
    import h5py

    if objects:
        from matio import load_from_mat
    else:
        load_from_mat = None
    size, used = os.path.getsize(path), time.process_time()
    try:
        import resource
    except ImportError:  # no limits on this system; the wall clock is left
        limited = False
    else:
        limited = True
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        _limit_memory(101 * size)
        _limit_processor(used, _OBJECT_SECONDS + size / _OBJECT_RATE if objects else _SECONDS + size / _RATE)
    if load_from_mat is not None:
        load_from_mat(path, raw_data=True)
        return
    visited = 0

    def visit(_: str, item: h5py.Group | h5py.Dataset) -> None:
        nonlocal visited
        visited += 1
        if limited and visited % 500 == 0:
            _limit_processor(used, _SECONDS + size / _RATE + _EACH * visited)
        for name in item.attrs:
            item.attrs[name]
        if isinstance(item, h5py.Dataset):
            item[()]

    with h5py.File(path, "r") as file:
        for name in file.attrs:
            file.attrs[name]
        file.visititems(visit)


def _try(asked: str) -> None:
    """Read a file and end this process."""
    try:
        _read_all(asked[1:], asked[0] == _OBJECTS)
    except MemoryError:
        os._exit(_OUT_OF_MEMORY)
    except Exception:
        os._exit(0)
    os._exit(0)


if __name__ == "__main__":
    _try(sys.argv[1]) if sys.argv[1:] else _serve()

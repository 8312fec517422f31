"""Read an HDF5 file in a process of its own first, which may hang or crash in place of ours.

The HDF5 library does not survive every damage: of a thousand files with a few changed bytes
it loops for ever over some and ends the process over others, which no Python code can catch. Files with
freqid's own checksum need no probe. This file is also what that process runs, so it imports little.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

_SECONDS, _RATE = 1, 50_000_000  # of processor, and bytes that it reads in one more
_WALL = 60.0  # s, where the file's disk is slow
_MEMORY = 1 << 29  # bytes beside the largest data set
_OUT_OF_MEMORY = 3


def fault_of(path: Path) -> str:
    """Return what happened to a process that read all of a file; empty where it ended well.

    An error that Python could catch counts as well: whoever reads the file will say it better.

    Parameters
    ----------
    path : Path
        Of a file that exists.
    """
    stat = os.stat(path)
    return _fault(os.path.abspath(path), stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=64)
def _fault(path: str, changed: int, size: int) -> str:
    try:
        code = subprocess.run(
            [sys.executable, "-I", __file__, path],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_WALL,
        ).returncode
    except subprocess.TimeoutExpired:
        return "does not end"
    except OSError:
        return ""  # no Python to start, as inside another program
    if code in (-24, -9):  # SIGXCPU, and SIGKILL where that was not heard
        return "does not end"
    if code == _OUT_OF_MEMORY:
        return "takes more memory than the file can hold"
    return f"ends the process (signal {-code})" if code < 0 else ""


def _limit_processor(seconds: float) -> None:
    import resource

    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = int(used.ru_utime + used.ru_stime + seconds) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))


def _limit_memory(beside: int) -> None:
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[0]) if sys.platform == "linux" else 0
    if pages:
        limit = pages * resource.getpagesize() + _MEMORY + beside
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


def _read_all(path: str) -> None:
    import h5py

    try:
        import resource
    except ImportError:  # no limits on this system; the wall clock is left
        pass
    else:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        size = os.path.getsize(path)
        _limit_memory(101 * size)
        _limit_processor(_SECONDS + size / _RATE)

    def visit(_: str, item: h5py.Group | h5py.Dataset) -> None:
        for name in item.attrs:
            item.attrs[name]
        if isinstance(item, h5py.Dataset):
            item[()]

    with h5py.File(path, "r") as file:
        for name in file.attrs:
            file.attrs[name]
        file.visititems(visit)


if __name__ == "__main__":
    try:
        _read_all(sys.argv[1])
    except MemoryError:
        os._exit(_OUT_OF_MEMORY)
    except Exception:
        os._exit(0)
    os._exit(0)

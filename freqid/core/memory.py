"""Memory of large arrays that goes back to the system when they are freed.

The C library of Linux takes large arrays from the system one by one at first. Once one of up to 32 MB was
freed, it takes the next ones from its heap, and keeps that for later. A diagnosis makes and frees thousands
of arrays of 5 to 30 MB on several threads, and small ones that stay lie between them (docs/performance.md).
"""

from __future__ import annotations

import ctypes
import os
import sys

_THRESHOLD = -3  # M_MMAP_THRESHOLD of malloc.h
_LARGE = 4 << 20  # bytes


def give_back_large_arrays() -> None:
    """Let arrays of 4 MB or more go back to the system when they are freed, from now on.

    Where the C library is another one than glibc, or the user has set this in the environment, nothing
    changes (mallopt(3)).
    """
    if sys.platform != "linux" or "MALLOC_MMAP_THRESHOLD_" in os.environ:
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_THRESHOLD, _LARGE)

"""Matrix products on one thread.

Matrices here are small, and threads of OpenBLAS wait for each other longer than they multiply. With two of
them a diagnosis takes many times as long where another process has one of two cores
(benchmarks/blas_threads.py).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

_OWN = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")

P = ParamSpec("P")
T = TypeVar("T")


def on_one_thread(work: Callable[P, T]) -> Callable[P, T]:
    """Return a function during whose calls products of matrices use one thread.

    Or as many as the user has set in the environment. The limit is the process's: it holds for other threads
    of Python too until the call ends.
    """

    @wraps(work)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        from threadpoolctl import threadpool_limits

        stated = (os.environ.get(name, "") for name in _OWN)
        # where a script calls the command line, that sets it after numpy was loaded: too late to be read
        count = next((int(x) for x in stated if x.isdigit() and int(x)), 1)
        with threadpool_limits(limits=count, user_api="blas"):
            return work(*args, **kwargs)

    return limited

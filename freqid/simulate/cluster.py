"""Units of work on the workers of a dask cluster, which may come, go and be lost."""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from freqid.core.errors import DataError, UsageError
from freqid.core.extras import extra
from freqid.core.store import replacing
from freqid.simulate.runner import Failure, Inputs, Unit, Work, attempt

if TYPE_CHECKING:
    from distributed import Client

_AHEAD = 3
"""Units for each thread, under way or waiting at its worker: so it does not wait for the scheduler."""
_RECOUNT_S = 5.0
"""How often workers are counted: each count asks the scheduler."""
_REACHED_S = 20.0
"""How long a scheduler may take to answer at first."""


@contextmanager
def cluster(scheduler: str = "", workers: int = 0) -> Generator[Client | None]:
    """Yield a client of a cluster, or None where neither argument is given.

    Parameters
    ----------
    scheduler : str
        Address of one that runs, such as ``tcp://host:8786``.
    workers : int
        In its place, of a cluster on this machine that lives as long as the context: so many processes.

    Raises
    ------
    UsageError
        Where both are given.
    DataError
        Where dask.distributed is not installed (extra ``cluster``), or the scheduler does not answer.
    """
    if scheduler and workers:
        raise UsageError(
            "--scheduler names a cluster that runs, --workers starts one", remedy="give one of them"
        )
    if not scheduler and not workers:
        yield None
        return
    distributed = extra("distributed", "cluster")
    if scheduler:
        try:
            client = distributed.Client(scheduler, timeout=_REACHED_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise DataError(
                f"no scheduler answers at {scheduler} ({type(error).__name__})",
                remedy="start one with 'dask scheduler', or correct the address",
            ) from None
        with client:
            yield client
        return
    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs=logging.ERROR,  # that it ends workers is no news
        ) as local,
        distributed.Client(local, set_as_default=False) as client,
    ):
        yield client


def attempts_on(client: Client, work: Work, units: list[Unit], beside: Inputs) -> Iterator[Failure | None]:
    """Do units on a cluster; yield one failure, or None for success, for each unit as it ends.

    A worker makes the result in a folder of its own and sends its bytes. What a lost worker had goes to
    another one; a unit that loses several workers in turn is a failure.

    Parameters
    ----------
    client : distributed.Client
    work, units, beside
        As in `freqid.simulate.runner.run_units`.
    """
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    waiting, of = iter(units), {}

    def sent(count: int) -> list:
        some = list(islice(waiting, count))
        futures = [
            client.submit(_result_of, work, u.path.name, u.inputs, beside, key=f"freqid-{u.key}", pure=False)
            for u in some
        ]
        of.update(zip([future.key for future in futures], some, strict=True))
        return futures

    room, counted = _room(client), time.monotonic()
    running = as_completed(sent(room), loop=client.loop)
    for future in running:
        if time.monotonic() - counted > _RECOUNT_S:
            room, counted = _room(client), time.monotonic()
        unit = of.pop(future.key)
        try:
            failure, result = future.result()
        except KilledWorker as error:
            failure, result = (unit.inputs, f"{type(error).__name__}: it lost several workers in turn"), b""
        future.release()
        for more in sent(room - len(of)):
            running.add(more)
        if failure is None:
            with replacing(unit.path) as temporary:
                temporary.write_bytes(result)
        yield failure


def _room(client: Client) -> int:
    """Return how many units to have under way."""
    threads: Any = client.nthreads()
    return _AHEAD * max(1, sum(threads.values()))


def _result_of(work: Work, name: str, inputs: Inputs, beside: Inputs) -> tuple[Failure | None, bytes]:
    """Do one unit on a worker; return what failed, and the bytes of its result."""
    with tempfile.TemporaryDirectory(prefix="freqid-") as folder:
        path = Path(folder) / name
        failure = attempt(work, path, inputs, beside)
        return failure, path.read_bytes() if failure is None else b""

"""Many flights as units of work that are never done twice, on this machine or on a cluster.

A unit is a module-level function and its inputs. Its key is a hash of both, of the release and of
the scenario; its result is one file of that name, written whole or not at all. So a run that was
killed resumes with what is missing, and a changed input or scenario is a new unit, not a stale result.
A file among the inputs counts by its contents, wherever it lies: a folder that was moved goes on too.
"""

from __future__ import annotations

import hashlib
import json
import os
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from freqid import __version__
from freqid.core.errors import DataError, FreqidError, UsageError
from freqid.core.store import remove_left_overs, replacing

if TYPE_CHECKING:
    from distributed import Client

Inputs = Mapping[str, Any]
Work = Callable[..., Any]
Failure = tuple[Inputs, str]
_LOST = 3  # times in a row that worker processes may be killed before it is said that they are


@dataclass(frozen=True)
class Unit:
    """One piece of work and where its result is.

    Attributes
    ----------
    inputs : mapping
        Keyword arguments of the work function; JSON-compatible, or paths of files.
    key : str
        Hash of the function, the inputs, the release and the scenario; 32 hexadecimal digits.
    path : Path
        The result; the unit is done when this file exists.
    """

    inputs: Inputs
    key: str
    path: Path

    @property
    def done(self) -> bool:
        """Whether the result is there."""
        return self.path.is_file()


def plan(
    work: Work, inputs: Sequence[Inputs], folder: Path, *, scenario_sha256: str = "", suffix: str = ".json"
) -> list[Unit]:
    """Give every piece of work its key and its result file, without doing anything.

    Parameters
    ----------
    work : callable
        A function of a module (no lambda, no nested function: those have no lasting name), called as
        ``work(path, **inputs)``, that writes its result to `path`.
    inputs : sequence of mappings
        One a unit; names to JSON-compatible values, or to a `Path` of a file, which enters the key by
        its contents.
    folder : Path
        Where the results are kept.
    scenario_sha256 : str
        Of the scenario that the work depends on.
    suffix : str
        Of the result files.

    Returns
    -------
    list of Unit
        In the order of `inputs`; equal inputs share one result.

    Raises
    ------
    UsageError
        Where the function has no lasting name or an input is no JSON value.
    DataError
        Where a file among the inputs cannot be read.
    """
    name = f"{getattr(work, '__module__', None)}.{getattr(work, '__qualname__', '<nameless>')}"
    if "<" in name:
        raise UsageError(
            f"work function '{name}' has no lasting name to resume by",
            remedy="define it with def at the top of a module and pass what varies as inputs",
        )
    shared = {"work": name, "freqid": __version__, "scenario": scenario_sha256}
    units = []
    for number, values in enumerate(inputs):
        try:
            text = json.dumps({**shared, "inputs": identity(values)}, sort_keys=True, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise UsageError(
                f"inputs of unit {number} are no JSON values ({error})",
                remedy="pass finite numbers, strings, lists and mappings, and paths as text",
            ) from None
        key = hashlib.sha256(text.encode()).hexdigest()[:32]
        units.append(Unit(values, key, Path(folder) / f"{key}{suffix}"))
    return units


def identity(inputs: Inputs) -> dict[str, Any]:
    """Return inputs as they enter a key and the listing: a file as its name and a hash of its contents."""
    return {
        name: {"file": value.name, "sha256": _sha256(value)} if isinstance(value, Path) else value
        for name, value in inputs.items()
    }


def _sha256(path: Path) -> str:
    try:
        about = path.stat()
        return _hash_of(str(path), about.st_mtime_ns, about.st_size)
    except OSError as error:
        raise DataError(
            f"cannot be read ({error.strerror})", where=str(path), remedy="check the path"
        ) from None


@lru_cache(maxsize=4096)
def _hash_of(path: str, changed: int, size: int) -> str:
    """Return the hash of a file; by when it was changed, as one record serves many units."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def run_units(
    work: Work,
    inputs: Sequence[Inputs],
    folder: Path,
    *,
    scenario_sha256: str = "",
    suffix: str = ".json",
    beside: Inputs | None = None,
    jobs: int = 1,
    client: Client | None = None,
    listed: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Do all units that are not done yet and return the results of all.

    The folder also gets ``units.json``, which says which inputs each result belongs to, unless `listed` is
    false because results say it themselves. Units that fail do not stop the others and leave no result, so
    that the next run tries them again.

    Parameters
    ----------
    work, inputs, folder, scenario_sha256, suffix
        As in `plan`.
    beside : mapping, optional
        Further arguments of every call that do not enter the key, as they say only where something is;
        any objects that can be pickled.
    jobs : int
        Processes at once; -1 for one a core. Where one of them is killed, the units that it had are done
        again.
    client : distributed.Client, optional
        Of a cluster, which does the units in place of processes here. A worker sends the result back and
        need not see the folder; what a lost worker had goes to another one.
    progress : callable, optional
        Called as ``progress(done, total)`` after each unit; by default a bar on standard error
        where that is a terminal.

    Returns
    -------
    list of Path
        One result a unit, in the order of `inputs`.

    Raises
    ------
    UsageError
        As in `plan`.
    DataError
        Where the folder cannot be written, units failed (how many, and the first of them), or worker
        processes are killed again and again.
    """
    units = plan(work, inputs, folder, scenario_sha256=scenario_sha256, suffix=suffix)
    if listed:
        _list_units(Path(folder) / "units.json", units)
    missing = list({unit.key: unit for unit in units if not unit.done}.values())
    total = len({unit.key for unit in units})
    done, failures = total - len(missing), []
    with tqdm(total=total, initial=done, unit="unit", disable=True if progress else None) as bar:
        for failure in _attempts(work, missing, dict(beside or {}), jobs, client):
            if failure:
                failures.append(failure)
            else:
                done += 1
            bar.update()
            if progress:
                progress(done, total)
    remove_left_overs(Path(folder))  # of workers that were killed
    if failures:
        inputs_of_first, message = failures[0]
        first = json.dumps(identity(inputs_of_first))
        raise DataError(
            f"{len(failures)} of {total} units failed, first {first}: {message}",
            where=str(folder),
            remedy="correct the cause and run again, finished units are kept",
        )
    return [unit.path for unit in units]


def _list_units(path: Path, units: list[Unit]) -> None:
    """Add units to the listing that says which inputs each result belongs to."""
    try:
        listing = json.loads(path.read_text()) if path.is_file() else {}
    except ValueError:
        listing = {}  # a damaged listing costs no result: it only says what is where
    listing |= {unit.path.name: identity(unit.inputs) for unit in units}
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(listing, indent=1) + "\n")


def _attempts(
    work: Work, units: list[Unit], beside: Inputs, jobs: int, client: Client | None
) -> Iterator[Failure | None]:
    """Yield one failure, or None for success, for each unit as it ends."""
    if client is not None and units:
        from freqid.simulate.cluster import attempts_on

        yield from attempts_on(client, work, units, beside)
    elif jobs == 1 or len(units) < 2:
        yield from (attempt(work, unit.path, unit.inputs, beside) for unit in units)
    else:
        yield from _in_processes(work, units, beside, jobs)


def _in_processes(work: Work, units: list[Unit], beside: Inputs, jobs: int) -> Iterator[Failure | None]:
    """Do units in processes of this machine; where one is killed, what it had is done again."""
    from joblib import Parallel, delayed  # here, because one process needs no joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    waiting, lost = {unit.key: unit for unit in units}, 0
    while waiting:
        parallel = Parallel(n_jobs=jobs, return_as="generator_unordered", pre_dispatch="2*n_jobs")
        try:
            told: Any = parallel(
                delayed(_named_attempt)(work, unit, beside) for unit in list(waiting.values())
            )
            for key, failure in told:
                del waiting[key]
                lost = 0
                yield failure
        except TerminatedWorkerError:
            lost += 1
            for unit in [unit for unit in waiting.values() if unit.done]:  # written, but not told
                del waiting[unit.key]
                yield None
            if lost == _LOST:
                raise DataError(
                    f"worker processes were killed {_LOST} times with no unit done between, as a system does "
                    "that is out of memory",
                    remedy="use fewer processes with --jobs; finished units are kept",
                ) from None


def _named_attempt(work: Work, unit: Unit, beside: Inputs) -> tuple[str, Failure | None]:
    return unit.key, attempt(work, unit.path, unit.inputs, beside)


def attempt(work: Work, path: Path, inputs: Inputs, beside: Inputs) -> Failure | None:
    """Do one unit; return what was asked and what went wrong where it failed."""
    try:
        with replacing(path) as temporary:
            work(temporary, **inputs, **beside)
    except FreqidError as error:
        return inputs, str(error).rstrip(".")
    except Exception as error:  # a bug in one unit must not lose the others; it is named with its line
        place = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(place.filename)}:{place.lineno}"
        return inputs, f"{type(error).__name__}: {error} ({place})"
    return None

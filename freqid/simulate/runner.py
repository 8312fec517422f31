"""Many flights as units of work that are never done twice.

A unit is a module-level function and its inputs. Its key is a hash of both, of the release and of
the scenario; its result is one file of that name, written whole or not at all. So a run that was
killed resumes with what is missing, and a changed input or scenario is a new unit, not a stale result.
"""

from __future__ import annotations

import hashlib
import json
import os
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from freqid import __version__
from freqid.core.errors import DataError, FreqidError, UsageError
from freqid.core.store import replacing

Inputs = Mapping[str, Any]
Work = Callable[..., Any]


@dataclass(frozen=True)
class Unit:
    """One piece of work and where its result is.

    Attributes
    ----------
    inputs : mapping
        Keyword arguments of the work function; JSON-compatible.
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
        One a unit; names to JSON-compatible values.
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
            text = json.dumps({**shared, "inputs": dict(values)}, sort_keys=True, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise UsageError(
                f"inputs of unit {number} are no JSON values ({error})",
                remedy="pass finite numbers, strings, lists and mappings, and paths as text",
            ) from None
        key = hashlib.sha256(text.encode()).hexdigest()[:32]
        units.append(Unit(values, key, Path(folder) / f"{key}{suffix}"))
    return units


def run_units(
    work: Work,
    inputs: Sequence[Inputs],
    folder: Path,
    *,
    scenario_sha256: str = "",
    suffix: str = ".json",
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Do all units that are not done yet and return the results of all.

    The folder also gets ``units.json``, which says which inputs each result belongs to. Units that
    fail do not stop the others and leave no result, so that the next run tries them again.

    Parameters
    ----------
    work, inputs, folder, scenario_sha256, suffix
        As in `plan`.
    jobs : int
        Processes at once; -1 for one a core. With more than one, the units go through joblib, so a
        ``joblib.parallel_config(backend=...)`` around the call sends them elsewhere.
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
        Where the folder cannot be written, or units failed: how many, and the first of them.
    """
    units = plan(work, inputs, folder, scenario_sha256=scenario_sha256, suffix=suffix)
    _list_units(Path(folder) / "units.json", units)
    missing = list({unit.key: unit for unit in units if not unit.done}.values())
    total = len({unit.key for unit in units})
    done, failures = total - len(missing), []
    with tqdm(total=total, initial=done, unit="unit", disable=True if progress else None) as bar:
        for failure in _attempts(work, missing, jobs):
            if failure:
                failures.append(failure)
            else:
                done += 1
            bar.update()
            if progress:
                progress(done, total)
    if failures:
        inputs_of_first, message = failures[0]
        raise DataError(
            f"{len(failures)} of {total} units failed, first {json.dumps(dict(inputs_of_first))}: {message}",
            where=str(folder),
            remedy="correct the cause and run again, finished units are kept",
        )
    return [unit.path for unit in units]


def _list_units(path: Path, units: list[Unit]) -> None:
    """Add units to the listing that says which inputs each result belongs to."""
    listing = json.loads(path.read_text()) if path.is_file() else {}
    listing |= {unit.path.name: dict(unit.inputs) for unit in units}
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(listing, indent=1) + "\n")


def _attempts(work: Work, units: list[Unit], jobs: int):
    """Yield one failure, or None for success, for each unit as it ends."""
    if jobs == 1 or len(units) < 2:
        yield from (_attempt(work, unit) for unit in units)
        return
    from joblib import Parallel, delayed  # here, because one process needs no joblib

    parallel = Parallel(n_jobs=jobs, return_as="generator_unordered", pre_dispatch="2*n_jobs")
    yield from parallel(delayed(_attempt)(work, unit) for unit in units)


def _attempt(work: Work, unit: Unit) -> tuple[Inputs, str] | None:
    """Do one unit; return what was asked and what went wrong where it failed."""
    try:
        with replacing(unit.path) as temporary:
            work(temporary, **unit.inputs)
    except FreqidError as error:
        return unit.inputs, str(error).rstrip(".")
    except Exception as error:  # a bug in one unit must not lose the others; it is named with its line
        place = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(place.filename)}:{place.lineno}"
        return unit.inputs, f"{type(error).__name__}: {error} ({place})"
    return None

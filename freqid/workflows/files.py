"""Every kind of result, read from its file and saved in one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from freqid.core import record as record_file
from freqid.core import scenario, store
from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord
from freqid.core.results import (
    advance_ratio,
    corridor,
    design,
    frequency_response,
    gap,
    loop_margins,
    output_error,
    point,
    prediction,
    quicklook,
    rivals,
)
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.results.judged import monte_carlo, review, sealed_trial
from freqid.core.scenario import Scenario
from freqid.workflows.inputs import File, scenario_of


def read_scenario(path: File) -> Scenario:
    """Read and validate a scenario.

    Parameters
    ----------
    path : path or str
        A TOML file, or the name of a scenario that comes with the package: ``la8``.

    Returns
    -------
    Scenario
        Its ``file`` and ``sha256`` say where it is from.

    Raises
    ------
    DataError
        Where the file cannot be read or is no TOML.
    UsageError
        For an unknown key, a wrong type or values that do not fit together, with the key's path.

    Examples
    --------
    >>> scenario = read_scenario("la8")
    >>> len(scenario.effector), scenario.reference_of("u45").u
    (20, 13.72)
    """
    return scenario.read_scenario(path)[0]


def read(path: File) -> Any:
    """Read any file that freqid wrote.

    Parameters
    ----------
    path : path

    Returns
    -------
    Result
        FlightRecord, MultisineDesign, PointModel, OutputErrorModel, GlobalModel, AdvanceRatioModel,
        FrequencyResponse, LoopMargins, Quicklook, GapResult, Rivals, Prediction, Score, MonteCarlo,
        StudyResults, Review, SealedEffect or TrialOutcome, as the file says of itself. Of a scenario's TOML
        file, the `Scenario`; of classic inputs, their samples.

    Raises
    ------
    DataError
        Where the file is missing, damaged, or none of freqid's.

    Examples
    --------
    >>> model = read("point.h5")  # doctest: +SKIP
    >>> model["M"]["de"]  # doctest: +SKIP
    (-401.2, 1.9)
    """
    path = Path(path)
    if path.suffix == ".toml":
        return read_scenario(path)
    kind = store.kind_of(path)
    if kind in _READERS:
        return _READERS[kind](path)
    with store.reading(
        path, kind or "freqid"
    ):  # a missing file or one of another kind is refused in its own words
        raise DataError(
            f"found format '{kind or 'none'}', expected one of {', '.join(_READERS)}",
            where=str(path),
            remedy="check the path",
        )


def save(result: Any, path: File, *, scenario: Scenario | File | None = None) -> Path:
    """Save a result as HDF5, whole or not at all.

    Parameters
    ----------
    result : result of a verb
        A record, a model, frequency responses, a diagnosis, a comparison or a design; a simulated manoeuvre
        is saved with its truth in a file beside.
    path : path
    scenario : Scenario, path or name, optional
        Whose hash the file shall carry; that of the result's own provenance where absent.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    UsageError
        For something that is no result.

    Examples
    --------
    >>> save(model, "point.h5").name
    'point.h5'
    """
    path = Path(path)
    if hasattr(result, "save"):  # a whole job knows its files
        result.save(path)
        return path
    sha256 = scenario_of(scenario).sha256 if scenario is not None else _sha256_of(result)
    write = next((write for kind, write in _WRITERS.items() if isinstance(result, kind)), None)
    if write is not None:
        write(path, result, sha256)
        return path
    knots = getattr(result, "corridor", None)  # of a global model
    if knots is None:
        raise UsageError(
            f"found {type(result).__name__}, expected a result", remedy="save what a verb of freqid returns"
        )
    corridor.FILE.write(path, knots)
    return path


def _sha256_of(result: Any) -> str:
    """Return the hash of the scenario that a result was made with, as far as it says."""
    source = getattr(result, "provenance", {}).get("scenario", {})
    return str(source.get("sha256", "")) if isinstance(source, dict) else ""


def _read_design(path: Path) -> Any:
    try:
        return design.read_design(path)
    except DataError as error:
        if "expected multisines" not in error.message:
            raise
        return design.read_inputs(path)


def _read_global(path: Path) -> Any:
    from freqid.blend.global_model import GlobalModel

    return GlobalModel(corridor.FILE.read(path))


def _read_study(path: Path) -> Any:
    from freqid.blend.study_file import read_study

    return read_study(path)


def _write_design(path: Path, planned: MultisineDesign | ClassicDesign, sha256: str) -> None:
    from freqid.design.multisine.orthogonal_set import sampled

    inputs = sampled(planned) if isinstance(planned, MultisineDesign) else planned.inputs
    design.write_design(path, planned, inputs, sha256)


_FILES = (
    point.FILE,
    advance_ratio.FILE,
    output_error.FILE,
    frequency_response.FILE,
    gap.FILE,
    rivals.FILE,
    prediction.FILE,
    prediction.SCORE_FILE,
    quicklook.FILE,
    loop_margins.FILE,
    monte_carlo.FILE,
    review.FILE,
    sealed_trial.SEAL_FILE,
    sealed_trial.OUTCOME_FILE,
)
_READERS: dict[str, Callable[[Path], Any]] = {
    record_file.FORMAT: record_file.read_record,
    design.FORMAT: _read_design,
    corridor.FILE.format: _read_global,
    "freqid-study": _read_study,
    **{file.format: file.read for file in _FILES},
}
_WRITERS: dict[type, Callable[[Path, Any, str], None]] = {
    FlightRecord: record_file.write_record,
    MultisineDesign: _write_design,
    ClassicDesign: _write_design,
    **{file.of: file.write for file in _FILES},
}

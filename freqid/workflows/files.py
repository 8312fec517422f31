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
    advance_ratio as advance_ratio_file,
)
from freqid.core.results import (
    corridor as global_file,
)
from freqid.core.results import (
    design as design_file,
)
from freqid.core.results import (
    frequency_response as frequency_response_file,
)
from freqid.core.results import (
    gap as gap_file,
)
from freqid.core.results import (
    output_error as output_error_file,
)
from freqid.core.results import (
    point as point_file,
)
from freqid.core.results import (
    rivals as rivals_file,
)
from freqid.core.results.advance_ratio import AdvanceRatioModel
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.results.gap import GapResult
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.results.rivals import Rivals
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
        FrequencyResponse, GapResult or Rivals, as the file says of itself. Of a scenario's TOML file, the
        `Scenario`; of classic inputs, their samples.

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
    corridor = getattr(result, "corridor", None)
    if corridor is None:
        raise UsageError(
            f"found {type(result).__name__}, expected a result", remedy="save what a verb of freqid returns"
        )
    global_file.write_global(path, corridor)
    return path


def _sha256_of(result: Any) -> str:
    """Return the hash of the scenario that a result was made with, as far as it says."""
    source = getattr(result, "provenance", {}).get("scenario", {})
    return str(source.get("sha256", "")) if isinstance(source, dict) else ""


def _read_design(path: Path) -> Any:
    try:
        return design_file.read_design(path)
    except DataError as error:
        if "expected multisines" not in error.message:
            raise
        return design_file.read_inputs(path)


def _read_global(path: Path) -> Any:
    from freqid.blend.global_model import GlobalModel

    return GlobalModel(global_file.read_global(path))


def _write_design(path: Path, design: MultisineDesign | ClassicDesign, sha256: str) -> None:
    from freqid.design.multisine.orthogonal_set import sampled

    inputs = sampled(design) if isinstance(design, MultisineDesign) else design.inputs
    design_file.write_design(path, design, inputs, sha256)


_READERS: dict[str, Callable[[Path], Any]] = {
    record_file.FORMAT: record_file.read_record,
    design_file.FORMAT: _read_design,
    point_file.FORMAT: point_file.read_point,
    output_error_file.FORMAT: output_error_file.read_output_error,
    global_file.FORMAT: _read_global,
    advance_ratio_file.FORMAT: advance_ratio_file.read_advance_ratio,
    frequency_response_file.FORMAT: frequency_response_file.read_frequency_response,
    gap_file.FORMAT: gap_file.read_gap,
    rivals_file.FORMAT: rivals_file.read_rivals,
}
_WRITERS: dict[type, Callable[[Path, Any, str], None]] = {
    FlightRecord: record_file.write_record,
    MultisineDesign: _write_design,
    ClassicDesign: _write_design,
    PointModel: point_file.write_point,
    AdvanceRatioModel: advance_ratio_file.write_advance_ratio,
    OutputErrorModel: output_error_file.write_output_error,
    FrequencyResponse: frequency_response_file.write_frequency_response,
    GapResult: gap_file.write_gap,
    Rivals: rivals_file.write_rivals,
}

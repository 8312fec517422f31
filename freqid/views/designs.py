"""Files of designed inputs: the design, other formats of it, its page and its test card."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from freqid.core.results.design import ClassicDesign
from freqid.design.classic import Extent
from freqid.design.finish import FinishedSet
from freqid.design.multisine.merit import Merit
from freqid.report.design.classic_page import build_classic_page, write_classic_documents
from freqid.report.design.flight_plan import FlightPlan
from freqid.report.design.page import flight_plan, multisine_page, write_documents
from freqid.report.design.summary import classic_summary, classic_table, multisine_summary, multisine_table
from freqid.workflows.design import DesignedInputs

FORMATS = {
    ".csv": DesignedInputs.write_csv,
    ".mat": DesignedInputs.write_mat,
    ".h": DesignedInputs.write_c_header,
    ".lua": DesignedInputs.write_lua,
}
"""What else a design is written as, by the file's suffix."""


def write_design_files(
    found: DesignedInputs, path: Path, formats: Sequence[str] = (), *, documents: bool = True
) -> tuple[dict[str, Any], str]:
    """Write a design, and a second set of exchanged harmonics with ``-swapped`` in its name.

    Parameters
    ----------
    found : DesignedInputs
    path : Path
        Of the design.
    formats : sequence of str
        Suffixes among `FORMATS`.
    documents : bool
        Whether page and test card are written beside it.

    Returns
    -------
    result : dict
        What ``design-inputs --json`` prints.
    text : str
        The same for people.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """
    result, text = _write(found, path, formats, documents)
    if found.swapped is not None:
        other = path.with_stem(f"{path.stem}-swapped")
        second, more = _write(found.swapped, other, formats, documents)
        result, text = result | {"swapped": second}, f"{text}\n{more}"
    return result, text


def design_page(found: DesignedInputs) -> str:
    """Return the page of a design that has no file yet."""
    plan = _plan(None, found)
    if found.finished is None:
        return build_classic_page(*_sequence(found), plan)
    return multisine_page(*_set(found), found.scenario, plan, study=found.others, forecast=found.forecast)


def _write(
    found: DesignedInputs, path: Path, formats: Sequence[str], documents: bool
) -> tuple[dict[str, Any], str]:
    written = [found.save(path), *(FORMATS[suffix](found, path.with_suffix(suffix)) for suffix in formats)]
    plan = _plan(path, found)
    more = {"study": found.others, "forecast": found.forecast}
    if found.finished is None:
        written += write_classic_documents(path, *_sequence(found), plan) if documents else []
        result, text = classic_summary(*_sequence(found), plan), classic_table(*_sequence(found))
    else:
        written += write_documents(path, *_set(found), found.scenario, plan, **more) if documents else []
        result = multisine_summary(*_set(found), plan, found.forecast)
        text = multisine_table(*_set(found))
    return result | {"files": list(map(str, written))}, "\n".join([text, *map(str, written)])


def _plan(path: Path | None, found: DesignedInputs) -> FlightPlan:
    return flight_plan(path, found.design, found.scenario, found.aircraft, found.trim, found.condition)


def _set(found: DesignedInputs) -> tuple[FinishedSet, Merit]:
    assert found.finished is not None
    assert isinstance(found.merit, Merit)
    return found.finished, found.merit


def _sequence(found: DesignedInputs) -> tuple[ClassicDesign, Extent]:
    assert isinstance(found.design, ClassicDesign)
    assert isinstance(found.merit, Extent)
    return found.design, found.merit

"""MATLAB: a model or record as one structure, names of which MATLAB accepts."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat

from freqid.blend.exports.plain import Model, plain
from freqid.core.errors import UsageError
from freqid.core.record import FlightRecord
from freqid.core.store import replacing
from freqid.design.export import MATLAB_HEADER

_LONGEST = 63  # characters of a name in MATLAB


def write_mat(path: Path, result: Model | FlightRecord, version: str) -> None:
    """Write a model or record as a MATLAB 5 file with the one variable ``model`` or ``record``.

    Parameters
    ----------
    path : Path
    result : model or FlightRecord
    version : str
        Of the program that writes.

    Raises
    ------
    UsageError
        Where two names are the same once MATLAB accepts them.
    DataError
        Where the file cannot be written.

    Notes
    -----
    Vectors are columns, lists of texts are cells, and the provenance is JSON text. A name that MATLAB does
    not accept has ``_`` for what is wrong in it; ``original_names`` pairs such names with the true ones.
    """
    renamed: dict[str, str] = {}
    content = plain(result)
    content["provenance"] = json.dumps(content.get("provenance", {}), sort_keys=True, default=str)
    structure = _structure({**content, "freqid_version": version}, renamed)
    pairs = np.empty((len(renamed), 2), dtype=object)
    for i, pair in enumerate(renamed.items()):
        pairs[i] = pair
    structure["original_names"] = pairs
    variable = "record" if isinstance(result, FlightRecord) else "model"
    with replacing(path) as temporary:
        options: dict[str, Any] = {"appendmat": False, "do_compression": True, "long_field_names": True}
        savemat(str(temporary), {variable: structure}, oned_as="column", **options)
        with temporary.open("r+b") as file:
            file.write(MATLAB_HEADER)


def _structure(value: Mapping[str, Any], renamed: dict[str, str]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name, held in value.items():
        accepted = re.sub(r"[^A-Za-z0-9_]", "_", name)
        accepted = (accepted if accepted[:1].isalpha() else f"x{accepted}")[:_LONGEST]
        if accepted in result:
            raise UsageError(
                f"MATLAB has one name, '{accepted}', for '{renamed.get(accepted, accepted)}' and '{name}'",
                remedy="rename one of the two, or export to json",
            )
        if accepted != name:
            renamed[accepted] = name
        result[accepted] = _field(held, renamed)
    return result


def _field(value: Any, renamed: dict[str, str]) -> Any:
    if isinstance(value, Mapping):
        return _structure(value, renamed)
    if isinstance(value, list | tuple):
        cells = np.empty((len(value), 1), dtype=object)
        for i, one in enumerate(value):
            cells[i, 0] = _field(one, renamed)
        return cells
    if value is None:
        return np.zeros((0, 0))
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value

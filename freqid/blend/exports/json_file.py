"""JSON: a model with all its numbers to the last digit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from freqid.blend.exports.plain import Model, plain
from freqid.core.store import replacing


def write_json(path: Path, model: Model, version: str) -> None:
    """Write a model as JSON, its keys as `freqid.blend.exports.plain` has them.

    A number that is not finite is null, except that infinity is the text ``"inf"``: an advance ratio has it.

    Raises
    ------
    DataError
        Where the file cannot be written.
    """
    content = {**plain(model), "freqid_version": version}
    with replacing(path) as temporary:
        text = json.dumps(_compatible(content), indent=1, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")


def _compatible(value: Any) -> Any:
    """Return a value that JSON has; floats keep all their digits."""
    if isinstance(value, np.ndarray | np.generic):
        return _compatible(value.tolist())
    if isinstance(value, Mapping):
        return {str(k): _compatible(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_compatible(v) for v in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else "inf" if value > 0 else "-inf"
    return value

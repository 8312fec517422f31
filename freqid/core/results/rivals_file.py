"""Two simulations compared, on disk (``format="freqid-rivals"``)."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np

from freqid.core import store
from freqid.core.results.rivals import Rivals

FORMAT = "freqid-rivals"


def write_rivals(path: Path, found: Rivals, scenario_sha256: str = "") -> None:
    """Write a comparison, whole or not at all.

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        text = file.create_dataset("comparison", data=json.dumps(found.to_json(), allow_nan=False))
        text.attrs["units"] = "JSON"
        group = file.create_group("contest")
        every = (found.overall, *found.contests)
        store.put_json(group, "response", [c.response for c in every])
        store.put_json(group, "regime", [c.regime for c in every])
        store.put(group, "bands", np.array([c.band_hz for c in every]), "Hz")
        for name in ("misfit_a", "misfit_b", "difference"):
            spans = [getattr(c, name) for c in every]
            store.put(group, name, np.array([(s.value, s.lo, s.hi) for s in spans]), "1")
        store.put(group, "p_adjusted", np.array([c.p_adjusted for c in every]), "1")

    store.write(path, FORMAT, fill, scenario_sha256)


def read_rivals(path: Path) -> Rivals:
    """Read a comparison.

    Raises
    ------
    DataError
        Where the file is no intact comparison.
    """
    with store.reading(path, FORMAT) as file:
        return Rivals.from_json(json.loads(store.dataset(file, "comparison")[()]))

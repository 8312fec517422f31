"""A multisine design on disk (``format="freqid-design"``)."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from . import store
from .design import Multisine, MultisineDesign

FORMAT = "freqid-design"


def write_design(
    path: Path,
    design: MultisineDesign,
    time: NDArray[np.float64],
    excitation: NDArray[np.float64],
    scenario_sha256: str = "",
) -> None:
    """Write a design together with its samples, whole or not at all.

    Parameters
    ----------
    path : Path
    design : MultisineDesign
    time : ndarray, shape (sample,)
        s.
    excitation : ndarray, shape (effector, sample)
        In effector units.
    scenario_sha256 : str

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        scale = store.put(file, "time", time, "s")
        scale.make_scale("time")
        for signal, samples in zip(design.signals, excitation, strict=True):
            store.put(file, f"excitation/{signal.name}", samples, signal.unit).dims[0].attach_scale(scale)
            group = file.create_group(f"harmonic/{signal.name}")
            store.put(group, "index", signal.index, "1")
            store.put(group, "amplitude", signal.amplitude, signal.unit)
            store.put(group, "phase", signal.phase, "rad")
        file.attrs["period_s"] = design.period_s
        file.attrs["periods"] = design.periods
        file.attrs["band_hz"] = design.band_hz
        file.attrs["dt_s"] = design.dt_s
        file.attrs["seed"] = design.seed
        store.put_json(file, "effector_order", design.names)
        store.put_json(file, "provenance", dict(design.provenance))

    store.write(path, FORMAT, fill, scenario_sha256)


def read_design(path: Path) -> MultisineDesign:
    """Read a design.

    Raises
    ------
    DataError
        Where the file is no intact design.
    """
    with store.reading(path, FORMAT) as file:
        signals = []
        for name in store.get_json(file, "effector_order"):
            group = store.subgroup(file, f"harmonic/{name}")
            signals.append(
                Multisine(
                    name=name,
                    unit=store.get_text(store.dataset(group, "amplitude"), "units"),
                    index=store.array(group, "index").astype(np.int64),
                    amplitude=store.array(group, "amplitude"),
                    phase=store.array(group, "phase"),
                )
            )
        low, high = store.floats(file, "band_hz")
        return MultisineDesign(
            signals=tuple(signals),
            period_s=store.floats(file, "period_s")[0],
            periods=int(store.floats(file, "periods")[0]),
            band_hz=(low, high),
            dt_s=store.floats(file, "dt_s")[0],
            seed=int(store.floats(file, "seed")[0]),
            provenance=store.get_json(file, "provenance") or {},
        )

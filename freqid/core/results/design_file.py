"""Designed inputs on disk (``format="freqid-design"``): samples, and the harmonics of multisines."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from freqid.core import store
from freqid.core.errors import DataError
from freqid.core.results.design import ClassicDesign, Multisine, MultisineDesign, SampledInputs

FORMAT = "freqid-design"


def write_design(
    path: Path, design: MultisineDesign | ClassicDesign, inputs: SampledInputs, scenario_sha256: str = ""
) -> None:
    """Write a design together with its samples, whole or not at all.

    Parameters
    ----------
    path : Path
    design : MultisineDesign or ClassicDesign
    inputs : SampledInputs
        Of that design.
    scenario_sha256 : str

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        scale = store.put(file, "time", inputs.time, "s")
        scale.make_scale("time")
        for name, unit, samples in zip(inputs.names, inputs.units, inputs.values, strict=True):
            store.put(file, f"excitation/{name}", samples, unit).dims[0].attach_scale(scale)
        if isinstance(design, MultisineDesign):
            file.attrs["waveform"] = "multisine"
            file.attrs["seed"] = design.seed
            for signal in design.signals:
                group = file.create_group(f"harmonic/{signal.name}")
                store.put(group, "index", signal.index, "1")
                store.put(group, "amplitude", signal.amplitude, signal.unit)
                store.put(group, "phase", signal.phase, "rad")
        else:
            file.attrs["waveform"] = design.waveform
            file.attrs["seed"] = 0  # nothing is drawn
        file.attrs["period_s"] = design.period_s
        file.attrs["periods"] = design.periods
        file.attrs["band_hz"] = design.band_hz
        file.attrs["dt_s"] = design.dt_s
        store.put_json(file, "effector_order", inputs.names)
        store.put_json(file, "provenance", dict(design.provenance))

    store.write(path, FORMAT, fill, scenario_sha256)


def read_inputs(path: Path) -> SampledInputs:
    """Read the samples of a design, of whatever waveform.

    Raises
    ------
    DataError
        Where the file is no intact design.
    """
    with store.reading(path, FORMAT) as file:
        names = tuple(store.get_json(file, "effector_order"))
        rows = [store.dataset(file, f"excitation/{name}") for name in names]
        return SampledInputs(
            names=names,
            units=tuple(store.get_text(row, "units") for row in rows),
            time=store.array(file, "time"),
            values=np.array([store.array(file, f"excitation/{name}") for name in names]),
        )


def read_design(path: Path) -> MultisineDesign:
    """Read a multisine design; `read_inputs` reads the samples of any.

    Raises
    ------
    DataError
        Where the file is no intact design, or has no harmonics because it is of classic inputs.
    """
    with store.reading(path, FORMAT) as file:
        waveform = store.get_text(file, "waveform")
        if waveform not in ("", "multisine"):
            raise DataError(
                f"holds a {waveform}, expected multisines", remedy="design them with design-inputs"
            )
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

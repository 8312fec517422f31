"""Designed inputs (samples by effector, and of multisines the tones), and their file (``freqid-design``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.viewable import Viewable


@dataclass(frozen=True, eq=False)
class SampledInputs(Viewable):
    """Excitations of effectors on a common, uniform time axis.

    Attributes
    ----------
    names, units : tuple of str
        Effectors and their SI units.
    time : ndarray, shape (sample,)
        s, from zero.
    values : ndarray, shape (effector, sample)
        To be added to the trim, in `units`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    values: Array

    def __repr__(self) -> str:
        step = self.time[1] - self.time[0]
        return f"<SampledInputs {' '.join(self.names)}: {self.time[-1]:.6g} s at {1 / step:.6g} Hz>"


@dataclass(frozen=True, eq=False)
class ClassicDesign(Viewable):
    """Doublets, 3-2-1-1 or frequency sweeps, one effector after the other.

    Attributes
    ----------
    waveform : {"doublet", "3-2-1-1", "sweep"}
    inputs : SampledInputs
        All of it, as flown.
    amplitude : mapping of str to float
        Of the waveform by effector, in its unit, in the order of flight.
    periods : int
        How often the sequence of all effectors is flown.
    band_hz : tuple of 2 floats
        Of the sweeps; of steps, the one that is identified over.
    dt_s : float
        Sampling interval.
    provenance : dict
        JSON-compatible.
    """

    waveform: str
    inputs: SampledInputs
    amplitude: Mapping[str, float]
    periods: int
    band_hz: tuple[float, float]
    dt_s: float
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"<ClassicDesign {self.waveform} on {len(self.names)} effectors: {self.duration_s:.6g} s "
            f"at {1 / self.dt_s:.6g} Hz>"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Effectors, in the order of flight."""
        return self.inputs.names

    @property
    def units(self) -> tuple[str, ...]:
        """Their SI units."""
        return self.inputs.units

    @property
    def duration_s(self) -> float:
        """Of all sequences together, s."""
        return float(self.inputs.time[-1])

    @property
    def period_s(self) -> float:
        """Of one sequence, with its part of the last rest, s."""
        return self.inputs.time.size // self.periods * self.dt_s


@dataclass(frozen=True)
class Multisine:
    """The excitation of one effector, ``sum_k amplitude_k sin(2 pi index_k t / T + phase_k)``.

    Attributes
    ----------
    name, unit : str
        Effector and its SI unit.
    index : ndarray of int, shape (tone,)
        Harmonics of 1/T.
    amplitude : ndarray, shape (tone,)
        In `unit`.
    phase : ndarray, shape (tone,)
        rad.
    """

    name: str
    unit: str
    index: NDArray[np.int64]
    amplitude: Array
    phase: Array

    def __repr__(self) -> str:
        return f"<Multisine {self.name!r} in {self.unit}: {self.index.size} harmonics>"


@dataclass(frozen=True)
class MultisineDesign(Viewable):
    """What is to be flown.

    Attributes
    ----------
    signals : tuple of Multisine
    period_s : float
        Fundamental period T.
    periods : int
        How many are flown.
    band_hz : tuple of 2 floats
    dt_s : float
        Interval at which it is sampled.
    seed : int
    provenance : dict
        JSON-compatible.
    """

    signals: tuple[Multisine, ...]
    period_s: float
    periods: int
    band_hz: tuple[float, float]
    dt_s: float
    seed: int
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        low, high = self.band_hz
        return (
            f"<MultisineDesign for {len(self.signals)} effectors: {low:g} to {high:g} Hz, {self.periods} x "
            f"{self.period_s:g} s at {1 / self.dt_s:.6g} Hz>"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Effectors, in order."""
        return tuple(signal.name for signal in self.signals)

    @property
    def units(self) -> tuple[str, ...]:
        """Their SI units."""
        return tuple(signal.unit for signal in self.signals)

    @property
    def duration_s(self) -> float:
        """Of all periods together, s."""
        return self.period_s * self.periods


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

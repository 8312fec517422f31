"""Designed inputs (samples by effector, and of multisines the tones), and their file (``freqid-design``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import h5py
import numpy as np
from numpy.typing import NDArray

from freqid.core import store
from freqid.core.arrays import Array
from freqid.core.errors import DataError
from freqid.core.layout import Attribute, Dataset, Layout, NestedSeries, get_fields, put_fields
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
    seed: ClassVar[int] = 0  # nothing is drawn

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
    waveform: ClassVar[str] = "multisine"

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


def layout_of_samples(group: str = "") -> Layout:
    """Return where samples lie in a file: at its root, or in a group of another result."""
    at = f"{group}/" if group else ""
    return {
        "names": Attribute(f"{group}@effector_order", json=True),
        "time": Dataset(f"{at}time", "s", ("sample",)),
        "values": Dataset(f"{at}excitation/{{names}}", "{units}", ("names", "sample")),
        "units": Attribute(f"{at}excitation/{{names}}@units"),
    }


def layout_of_multisines(group: str = "") -> Layout:
    """Return where a multisine design's tones lie in a file, likewise."""
    tone = f"{group}/harmonic/{{name}}" if group else "harmonic/{name}"
    tones = {
        "index": Dataset(f"{tone}/index", axes=("tone",)),
        "amplitude": Dataset(f"{tone}/amplitude", "{unit}", ("tone",)),
        "unit": Attribute(f"{tone}/amplitude@units"),
        "phase": Dataset(f"{tone}/phase", "rad", ("tone",)),
    }
    signals = NestedSeries(Multisine, tones, "name", f"{group}@effector_order")
    return {**_header(group), "signals": signals}


def _header(group: str = "") -> Layout:
    names = ("waveform", "seed", "period_s", "periods", "band_hz", "dt_s")
    return {
        **{name: Attribute(f"{group}@{name}") for name in names},
        "provenance": Attribute(f"{group}@provenance", json=True),
    }


_SAMPLES, _HEADER, _MULTISINE = layout_of_samples(), _header(), layout_of_multisines()


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
        put_fields(file, design, _MULTISINE if isinstance(design, MultisineDesign) else _HEADER)
        put_fields(file, inputs, _SAMPLES)
        scale = store.dataset(file, "time")
        scale.make_scale("time")
        for name in inputs.names:
            store.dataset(file, f"excitation/{name}").dims[0].attach_scale(scale)

    store.write(path, FORMAT, fill, scenario_sha256)


def read_inputs(path: Path) -> SampledInputs:
    """Read the samples of a design, of whatever waveform.

    Raises
    ------
    DataError
        Where the file is no intact design.
    """
    with store.reading(path, FORMAT) as file:
        return SampledInputs(**get_fields(file, SampledInputs, _SAMPLES))


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
        return MultisineDesign(**get_fields(file, MultisineDesign, _MULTISINE))

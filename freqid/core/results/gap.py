"""A diagnosis with what its page is drawn from: map, spectra, increments; the file ``freqid-gap``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from freqid.core import store
from freqid.core.arrays import Array, Complex
from freqid.core.results.diagnosis import Closure, Existence, GapDiagnosis, Place, SensorFault, Which

LISTED = 0.1  # share of the energy from which a cell is listed
_THIRDS = ("first third", "middle third", "last third")
_ONE_THIRD = 0.6  # of the energy in one third of a manoeuvre is a phase; less is all of it


@dataclass(frozen=True, eq=False)
class GapMap:
    """Energy of a gap over noise, by cell.

    Attributes
    ----------
    rows, regimes, inputs : tuple of str
        The last input is ``""``: lines that no injected signal drives.
    bands_hz : tuple of tuple of 2 floats
    energy : ndarray, shape (row, band, regime, input)
        Of white noise of variance one a line.
    phase : ndarray, shape (row, 3)
        Share of a row's energy in each third of the manoeuvres.
    """

    rows: tuple[str, ...]
    regimes: tuple[str, ...]
    inputs: tuple[str, ...]
    bands_hz: tuple[tuple[float, float], ...]
    energy: Array
    phase: Array

    def share(self, axis: str) -> dict[str, float]:
        """Return the share of each ``row``, ``band``, ``regime`` or ``input``, largest first."""
        names = {
            "row": self.rows,
            "band": [f"{a:g}-{b:g} Hz" for a, b in self.bands_hz],
            "regime": self.regimes,
            "input": self.inputs,
        }
        at = list(names).index(axis)
        each = self.energy.sum(axis=tuple(i for i in range(4) if i != at))
        total = max(float(each.sum()), 1e-300)
        shares = {name: float(e / total) for name, e in zip(names[axis], each, strict=True)}
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def places(self) -> list[Place]:
        """Return the cells of row and band that hold `LISTED` of the energy or more, largest first."""
        total = float(self.energy.sum())
        if not total > 0:
            return []
        found = []
        for i, row in enumerate(self.rows):
            third = int(np.argmax(self.phase[i]))
            phase = _THIRDS[third] if self.phase[i, third] > _ONE_THIRD else "all"
            for j, band in enumerate(self.bands_hz):
                cell = self.energy[i, j]
                share = float(cell.sum() / total)
                if share >= LISTED:
                    regime = _holding(cell.sum(axis=1), self.regimes)
                    inputs = _holding(cell.sum(axis=0)[:-1], self.inputs[:-1])
                    found.append(Place(row, band, regime, inputs, phase, share))
        return sorted(found, key=lambda place: -place.share)


def _holding(energy: Array, names: Sequence[str]) -> str:
    """Return the names that hold a tenth of the energy or more, in their order."""
    total = energy.sum()
    return " ".join(n for n, e in zip(names, energy, strict=True) if total > 0 and e / total >= LISTED)


@dataclass(frozen=True, eq=False)
class ResidualSpectra:
    """One manoeuvre's residual on its lines.

    Attributes
    ----------
    maneuver : str
    rows, units : tuple of str
        ``M``, ``actuator/de1``, ``kinematic/w``.
    hz : ndarray, shape (line,)
    inputs : tuple of str
        Injected signals.
    owner : ndarray, shape (line,)
        Index of the signal that drives the line; -1 where none does.
    residual, explained : ndarray of complex, shape (row, line)
        Measured less simulated, and what the likeliest explanation makes of it; unit of the row times
        sqrt(s).
    noise : ndarray, shape (row, line)
        One standard deviation of noise, same unit.
    """

    maneuver: str
    rows: tuple[str, ...]
    units: tuple[str, ...]
    hz: Array
    inputs: tuple[str, ...]
    owner: Array
    residual: Complex
    explained: Complex
    noise: Array


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """One manoeuvre as measured, as simulated, and as simulated with the effects that were found.

    Attributes
    ----------
    maneuver : str
    held_out : bool
        Whether nothing was fitted to it.
    responses, units : tuple of str
    time : ndarray, shape (sample,)
        s.
    measured, before, after : ndarray, shape (response, sample)
        Without what lies above the band.
    hz : ndarray, shape (line,)
    measured_hz, before_hz, after_hz : ndarray of complex, shape (response, line)
        Unit of the response times sqrt(s).
    noise : ndarray, shape (response, line)
        One standard deviation, same unit.
    """

    maneuver: str
    held_out: bool
    responses: tuple[str, ...]
    units: tuple[str, ...]
    time: Array
    measured: Array
    before: Array
    after: Array
    hz: Array
    measured_hz: Complex
    before_hz: Complex
    after_hz: Complex
    noise: Array


@dataclass(frozen=True)
class Increment:
    """By how much a derivative in flight differs from the simulation's.

    Attributes
    ----------
    response, input : str
    percent, lo, hi : float
        Of the simulation's derivative, with a 95 % interval.
    """

    response: str
    input: str
    percent: float
    lo: float
    hi: float

    @property
    def clear(self) -> bool:
        """Whether the interval excludes no difference."""
        return self.lo > 0 or self.hi < 0


@dataclass(frozen=True, eq=False)
class GapResult:
    """A diagnosis and its pictures' numbers; what the diagnosis says is to be had here too.

    Attributes
    ----------
    diagnosis : GapDiagnosis
    cells : GapMap
    spectra : tuple of ResidualSpectra
        One a manoeuvre.
    coherence : dict of dict of float
        By row and injected signal: share of the residual there that noise does not account for.
    increments : tuple of Increment
        Clear ones first, largest first.
    before_after : tuple of BeforeAfter
    expected : dict of float
        By effect id: the size that is expected before any data, unit of the smallest detectable one.
    provenance : dict
    """

    diagnosis: GapDiagnosis
    cells: GapMap
    spectra: tuple[ResidualSpectra, ...] = ()
    coherence: dict[str, dict[str, float]] = field(default_factory=dict)
    increments: tuple[Increment, ...] = ()
    before_after: tuple[BeforeAfter, ...] = ()
    expected: dict[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return repr(self.diagnosis)

    def to_frame(self) -> Any:
        """Return the explanations and their probabilities as a `pandas.DataFrame`."""
        return self.diagnosis.to_frame()

    def plot(self) -> Any:
        """Return the explanations and their probabilities drawn, as a `matplotlib.figure.Figure`."""
        return self.diagnosis.plot()

    def _repr_html_(self) -> str:
        return self.diagnosis._repr_html_()

    @property
    def verdict(self) -> str:
        """One line."""
        return self.diagnosis.verdict

    @property
    def gap(self) -> Existence:
        """Whether there is a gap beyond noise and tolerances."""
        return self.diagnosis.gap

    @property
    def where(self) -> tuple[Place, ...]:
        """Where it is: responses, bands, regimes, inputs."""
        return self.diagnosis.where

    @property
    def which(self) -> Which:
        """Which effect makes it, with probabilities."""
        return self.diagnosis.which

    @property
    def how_far(self) -> tuple[Closure, ...]:
        """How much of it goes on flights that were not used."""
        return self.diagnosis.how_far

    @property
    def sensors(self) -> tuple[SensorFault, ...]:
        """Faults of the sensors."""
        return self.diagnosis.sensors

    @property
    def next_flight(self) -> dict[str, Any]:
        """The tests that separate what is left."""
        return self.diagnosis.next_flight

    @property
    def remarks(self) -> tuple[str, ...]:
        """What else to know, one sentence each."""
        return self.diagnosis.remarks

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as ``diagnose-gap --json`` has it (docs/files.md)."""
        return self.diagnosis.to_json()


FORMAT = "freqid-gap"
_LEVEL = 0.95  # of the increments' intervals
_DENSITY = "unit of the row times s^0.5"  # of spectra


def write_gap(path: Path, result: GapResult, scenario_sha256: str = "") -> None:
    """Write a diagnosis and its pictures' numbers, whole or not at all.

    Parameters
    ----------
    path : Path
    result : GapResult
    scenario_sha256 : str

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        # too long for an attribute, which holds 64 KiB
        _put_table(file, "diagnosis", result.diagnosis.to_json())
        _put_table(file, "provenance", result.provenance)
        store.put_json(file, "expected", result.expected)
        _put_cells(file.create_group("map"), result)
        for i, one in enumerate(result.spectra):
            _put_spectra(file.create_group(f"spectra/{i}"), one)
        for i, one in enumerate(result.before_after):
            _put_before_after(file.create_group(f"before_after/{i}"), one)
        group = file.create_group("increment")
        store.put_json(group, "response", [i.response for i in result.increments])
        store.put_json(group, "input", [i.input for i in result.increments])
        group.attrs["level"] = _LEVEL
        values = np.array([(i.percent, i.lo, i.hi) for i in result.increments]).reshape(-1, 3)
        store.put(group, "percent", values, "%")

    store.write(path, FORMAT, fill, scenario_sha256)


def read_gap(path: Path) -> GapResult:
    """Read a diagnosis.

    Raises
    ------
    DataError
        Where the file is no intact diagnosis.
    """
    with store.reading(path, FORMAT) as file:
        cells = store.subgroup(file, "map")
        group = store.subgroup(file, "increment")
        pairs = zip(store.get_json(group, "response"), store.get_json(group, "input"), strict=True)
        values = store.array(group, "percent").tolist()
        return GapResult(
            diagnosis=GapDiagnosis.from_json(_table(file, "diagnosis")),
            cells=_cells(cells),
            spectra=tuple(_spectra(g) for g in _numbered(file, "spectra")),
            coherence=store.get_json(cells, "coherence"),
            increments=tuple(Increment(r, i, *v) for (r, i), v in zip(pairs, values, strict=True)),
            before_after=tuple(_before_after(g) for g in _numbered(file, "before_after")),
            expected=store.get_json(file, "expected"),
            provenance=_table(file, "provenance"),
        )


def _put_table(file: h5py.File, name: str, table: dict[str, Any]) -> None:
    text = file.create_dataset(name, data=json.dumps(table, allow_nan=False))
    text.attrs["units"] = "JSON"


def _table(file: h5py.File, name: str) -> dict[str, Any]:
    return json.loads(store.dataset(file, name)[()])


def _put_cells(group: h5py.Group, result: GapResult) -> None:
    for name in ("rows", "regimes", "inputs"):
        store.put_json(group, name, getattr(result.cells, name))
    store.put_json(group, "coherence", result.coherence)
    store.put(group, "bands", np.array(result.cells.bands_hz), "Hz")
    store.put(group, "energy", result.cells.energy, "1")
    store.put(group, "phase", result.cells.phase, "1")


def _cells(group: h5py.Group) -> GapMap:
    rows, regimes, inputs = _names(group, "rows", "regimes", "inputs")
    bands, energy = store.array(group, "bands"), store.array(group, "energy")
    expected = (len(rows), len(bands), len(regimes), len(inputs))
    if energy.shape != expected:
        raise ValueError(f"the map has shape {energy.shape}, expected {expected}")
    pairs = tuple((float(low), float(high)) for low, high in bands)
    return GapMap(rows, regimes, inputs, pairs, energy, store.array(group, "phase"))


def _put_spectra(group: h5py.Group, one: ResidualSpectra) -> None:
    group.attrs["maneuver"] = one.maneuver
    for name in ("rows", "units", "inputs"):
        store.put_json(group, name, getattr(one, name))
    store.put(group, "hz", one.hz, "Hz")
    store.put(group, "owner", one.owner, "1")
    store.put(group, "noise", one.noise, _DENSITY)
    store.put_complex(group, "residual", one.residual, _DENSITY)
    store.put_complex(group, "explained", one.explained, _DENSITY)


def _spectra(group: h5py.Group) -> ResidualSpectra:
    rows, units, inputs = _names(group, "rows", "units", "inputs")
    hz = store.array(group, "hz")
    residual, explained = (store.complex_array(group, name) for name in ("residual", "explained"))
    noise = store.array(group, "noise")
    for found in (residual, explained, noise):
        if found.shape != (len(rows), hz.size):
            raise ValueError(f"a spectrum has shape {found.shape}, expected {(len(rows), hz.size)}")
    maneuver, owner = store.get_text(group, "maneuver"), store.array(group, "owner")
    return ResidualSpectra(maneuver, rows, units, hz, inputs, owner, residual, explained, noise)


def _put_before_after(group: h5py.Group, one: BeforeAfter) -> None:
    group.attrs["maneuver"] = one.maneuver
    group.attrs["held_out"] = one.held_out
    for name in ("responses", "units"):
        store.put_json(group, name, getattr(one, name))
    store.put(group, "time", one.time, "s")
    store.put(group, "hz", one.hz, "Hz")
    store.put(group, "noise", one.noise, _DENSITY)
    for name in ("measured", "before", "after"):
        store.put(group, name, getattr(one, name), "unit of the response")
        store.put_complex(group, f"{name}_hz", getattr(one, f"{name}_hz"), _DENSITY)


def _before_after(group: h5py.Group) -> BeforeAfter:
    responses, units = _names(group, "responses", "units")
    time, hz, noise = (store.array(group, name) for name in ("time", "hz", "noise"))
    measured, before, after = (store.array(group, name) for name in ("measured", "before", "after"))
    z, y, better = (store.complex_array(group, f"{name}_hz") for name in ("measured", "before", "after"))
    for found in (measured, before, after):
        if found.shape != (len(responses), time.size):
            raise ValueError(f"a history has shape {found.shape}, expected {(len(responses), time.size)}")
    held_out = bool(group.attrs["held_out"])
    maneuver = store.get_text(group, "maneuver")
    return BeforeAfter(
        maneuver, held_out, responses, units, time, measured, before, after, hz, z, y, better, noise
    )


def _names(group: h5py.Group, *names: str) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(store.get_json(group, name)) for name in names)


def _numbered(file: h5py.File, name: str) -> list[h5py.Group]:
    """Return the groups 0, 1, 2 below a name; none where it is absent."""
    if name not in file:
        return []
    inside = store.subgroup(file, name)
    return [store.subgroup(inside, str(i)) for i in range(len(inside))]

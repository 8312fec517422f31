"""A diagnosis with what its page is drawn from: map, spectra, increments; the file ``freqid-gap``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.layout import Attribute, Dataset, Nested, NestedSeries, ResultFile, Rows, Table
from freqid.core.results.diagnosis import Change, Closure, Existence, GapDiagnosis, Place, SensorFault, Which

LISTED = 0.1  # share of what is detectable from which a row or an injected signal is listed
_MOST = 0.5  # of a share: neighbouring bands that hold it are its band
_THIRDS = ("first third", "middle third", "last third")
_ONE_THIRD = 0.6  # of it in one third of a manoeuvre is a phase; less is all of it


@dataclass(frozen=True, eq=False)
class GapMap:
    """Where a gap is detectable beyond noise, tolerances and error of form, by cell.

    The detectability of an effect is ``s' S^-1 s``, with s what it makes and S the covariance of noise, of
    the records' own unknowns, of tolerances and of errors of form. Where several explain the gap each counts
    alike.

    Attributes
    ----------
    rows, regimes, inputs : tuple of str
        The last input is ``""``: lines that no injected signal drives.
    bands_hz : tuple of tuple of 2 floats
    detectability : ndarray, shape (row, band, regime, input)
        Each cell's share of it. Below zero where the effect makes less than tolerances that are fitted to all
        of it would make there; sums of cells below zero count as none.
    phase : ndarray, shape (row, 3)
        Share of a row's detectability in each third of the manoeuvres.
    """

    rows: tuple[str, ...]
    regimes: tuple[str, ...]
    inputs: tuple[str, ...]
    bands_hz: tuple[tuple[float, float], ...]
    detectability: Array
    phase: Array

    def share(self, axis: str) -> dict[str, float]:
        """Return shares by ``row``, ``band``, ``regime`` or ``input``, largest first.

        By row and input: sums of the cells of row and input, of which `places` lists the largest. By band and
        by regime: sums of the cells that the maps show.
        """
        rows_inputs = self.shares(1, 2)
        found = {
            "row": (self.rows, rows_inputs.sum(axis=1)),
            "band": ([f"{low:g}-{high:g} Hz" for low, high in self.bands_hz], self.shares(2, 3).sum(axis=0)),
            "regime": (self.regimes, self.shares(3).sum(axis=(0, 1))),
            "input": (self.inputs, rows_inputs.sum(axis=0)),
        }
        names, parts = found[axis]
        each = dict(zip(names, parts.tolist(), strict=True))
        return dict(sorted(each.items(), key=lambda item: -item[1]))

    def shares(self, *summed: int) -> Array:
        """Return the share of each cell, some axes summed over; sums below zero count as none."""
        parts = np.maximum(self.detectability.sum(axis=summed), 0.0)
        return parts / max(float(parts.sum()), 1e-300)

    def places(self) -> list[Place]:
        """Return the parts of the gap by row and injected signal: row by row, the largest first.

        Rows that hold `LISTED` of the gap or more. Of each row the signals whose lines hold `LISTED` of the
        gap and of that row or more, and all other lines together, where these hold as much of the row.
        """
        shares, by_band, by_regime = self.shares(1, 2), self.shares(2), self.shares(1)
        held = shares.sum(axis=0)
        found = []
        for i in np.argsort(-shares.sum(axis=1), kind="stable"):
            row = shares[i].sum()
            if row < LISTED:
                continue
            alone = [
                k
                for k, name in enumerate(self.inputs)
                if name and held[k] >= LISTED and shares[i, k] >= LISTED * row
            ]
            others = [k for k in range(len(self.inputs)) if k not in alone]
            parts = [([k], self.inputs[k]) for k in alone]
            if shares[i, others].sum() >= LISTED * row:
                parts.append((others, ""))
            parts.sort(key=lambda part: -shares[i, part[0]].sum())
            third = int(np.argmax(self.phase[i]))
            phase = _THIRDS[third] if self.phase[i, third] > _ONE_THIRD else "all"
            for at, name in parts:
                low, high = _narrowest(by_band[i][:, at].sum(axis=1))
                found.append(
                    Place(
                        self.rows[i],
                        (self.bands_hz[low][0], self.bands_hz[high][1]),
                        _holding(by_regime[i][:, at].sum(axis=1), self.regimes),
                        name,
                        phase,
                        float(shares[i, at].sum()),
                    )
                )
        return found

    def band_of(self, row: str) -> tuple[float, float]:
        """Return the fewest neighbouring bands that hold most of a row's share, as one."""
        low, high = _narrowest(self.shares(2, 3)[self.rows.index(row)])
        return self.bands_hz[low][0], self.bands_hz[high][1]


def _narrowest(parts: Array) -> tuple[int, int]:
    """Return the first and the last of the fewest neighbours that hold most."""
    count = parts.size
    runs = [(j - i, -parts[i : j + 1].sum(), i, j) for i in range(count) for j in range(i, count)]
    return min(run for run in runs if -run[1] >= _MOST * parts.sum())[2:]


def _holding(parts: Array, names: Sequence[str]) -> str:
    """Return the names that hold a tenth of the whole or more, in their order."""
    total = parts.sum()
    return " ".join(n for n, x in zip(names, parts, strict=True) if total > 0 and x / total >= LISTED)


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

    def mean_errors(self) -> tuple[Array, Array]:
        """Return the means over time of measured less simulated, before and after, by response."""
        return (self.measured - self.before).mean(axis=1), (self.measured - self.after).mean(axis=1)


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
    level: ClassVar[float] = 0.95  # of the increments' intervals

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
        """How much of it goes on flights that were left out."""
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

    def mean_errors(self) -> dict[str, Change]:
        """Return by response the error of the mean before and after, rms over `before_after`."""
        each: dict[str, list[tuple[float, float]]] = {}
        for one in self.before_after:
            for name, *ends in zip(one.responses, *one.mean_errors(), strict=True):
                each.setdefault(name, []).append((float(ends[0]), float(ends[1])))
        return {n: Change(*np.sqrt(np.mean(np.square(x), axis=0)).tolist()) for n, x in each.items()}

    def share_at_rest(self) -> float:
        """Return the share of what is explained, as energy over noise, at zero frequency; nan of nothing."""
        cells = [
            (np.abs(s.explained) ** 2 / np.maximum(s.noise, 1e-300) ** 2, s.hz == 0) for s in self.spectra
        ]
        total = sum(float(energy.sum()) for energy, _ in cells)
        at_rest = sum(float(energy[:, still].sum()) for energy, still in cells)
        return at_rest / total if total > 0 else float("nan")

    def to_json(self) -> dict[str, Any]:
        """Return the diagnosis as ``diagnose-gap --json`` has it (docs/files.md)."""
        return self.diagnosis.to_json()


_DENSITY = "unit of the row times s^0.5"  # of spectra
_MAP = {
    **{name: Attribute(f"map@{name}", json=True) for name in ("rows", "regimes", "inputs")},
    "bands_hz": Dataset("map/bands", "Hz", ("band", 2)),
    # stands where files of releases that had the energy have it
    "detectability": Dataset("map/energy", "1", ("rows", "band", "regimes", "inputs")),
    "phase": Dataset("map/phase", "1", ("rows", 3)),
}
_SPECTRA = {
    "maneuver": Attribute("spectra/{i}@maneuver"),
    **{name: Attribute(f"spectra/{{i}}@{name}", json=True) for name in ("rows", "units", "inputs")},
    "hz": Dataset("spectra/{i}/hz", "Hz", ("line",)),
    "owner": Dataset("spectra/{i}/owner", "1", ("line",)),
    **{
        name: Dataset(f"spectra/{{i}}/{name}", _DENSITY, ("rows", "line"))
        for name in ("noise", "residual", "explained")
    },
}
_HISTORIES = {
    "maneuver": Attribute("before_after/{i}@maneuver"),
    "held_out": Attribute("before_after/{i}@held_out"),
    **{name: Attribute(f"before_after/{{i}}@{name}", json=True) for name in ("responses", "units")},
    "time": Dataset("before_after/{i}/time", "s", ("sample",)),
    "hz": Dataset("before_after/{i}/hz", "Hz", ("line",)),
    **{
        name: Dataset(f"before_after/{{i}}/{name}", "unit of the response", ("responses", "sample"))
        for name in ("measured", "before", "after")
    },
    **{
        name: Dataset(f"before_after/{{i}}/{name}", _DENSITY, ("responses", "line"))
        for name in ("measured_hz", "before_hz", "after_hz", "noise")
    },
}
_INCREMENTS = {
    "response": Attribute("increment@response", json=True),
    "input": Attribute("increment@input", json=True),
    "percent lo hi": Dataset("increment/percent", "%"),
}
_RESULT = {
    "diagnosis": Table("diagnosis"),
    "provenance": Table("provenance"),
    "expected": Attribute("@expected", json=True),
    "cells": Nested(GapMap, _MAP),
    "coherence": Attribute("map@coherence", json=True),
    "spectra": NestedSeries(ResidualSpectra, _SPECTRA, "i", "spectra"),
    "before_after": NestedSeries(BeforeAfter, _HISTORIES, "i", "before_after"),
    "increments": Rows(Increment, _INCREMENTS),
    "level": Attribute("increment@level"),
}
FILE = ResultFile("freqid-gap", GapResult, _RESULT)
write_gap, read_gap = FILE.write, FILE.read

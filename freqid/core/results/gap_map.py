"""Energy of a gap by response, frequency band, flight regime, injected signal and time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from freqid.core.arrays import Array
from freqid.core.results.diagnosis import Place

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

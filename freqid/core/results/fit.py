"""A response as it was measured and as a model gives it, on frequencies or samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from freqid.core.arrays import Array
from freqid.core.layout import Dataset

LEAST_LINES = 8
"""Lines that a coherence is taken over at least, and that make the band of the worst fit."""


@dataclass(frozen=True)
class WorstBand:
    """Where in frequency a fit is worst.

    Attributes
    ----------
    low_hz, high_hz : float
        First and last line of the band.
    over_noise : float
        Root mean square of the residual over that of noise, in the band; nan where noise is not known.
    share : float
        Of the power of the whole residual.
    """

    low_hz: float
    high_hz: float
    over_noise: float
    share: float


@dataclass(frozen=True)
class Fit:
    """A response as measured and as the model gives it, on frequencies or samples.

    Attributes
    ----------
    axis : ndarray, shape (n,)
        Frequencies in Hz, or times in s.
    measured, modelled : ndarray, shape (n,)
        Complex transforms on frequencies, real values in time.
    noise : ndarray, shape (n,), optional
        On frequencies, where noise lines tell it: rms magnitude of a residual that is noise alone, allowing
        for what the fit takes of it.
    """

    axis: Array
    measured: NDArray[Any]
    modelled: NDArray[Any]
    noise: Array | None = None

    def __repr__(self) -> str:
        kind = "lines" if np.iscomplexobj(self.measured) else "samples"
        return f"<Fit on {self.axis.size} {kind}: R2 {self.r2:.4f}, rms of the residual {self.rms:.4g}>"

    @property
    def axis_unit(self) -> str:
        """Hz or s."""
        return "Hz" if np.iscomplexobj(self.measured) else "s"

    @property
    def transform_unit(self) -> str:
        """What the unit of a transform has beyond that of the response; empty in time."""
        return " s" if np.iscomplexobj(self.measured) else ""

    @property
    def residual(self) -> NDArray[Any]:
        """Measured less modelled, shape (n,)."""
        return self.measured - self.modelled

    @property
    def r2(self) -> float:
        """Share of the measured energy that the model explains; about the mean in time."""
        centre = 0.0 if np.iscomplexobj(self.measured) else self.measured.mean()
        total = np.sum(np.abs(self.measured - centre) ** 2)
        return float(1 - np.sum(np.abs(self.residual) ** 2) / total) if total else float("nan")

    @property
    def rms(self) -> float:
        """Root mean square of the residual."""
        return float(np.sqrt(np.mean(np.abs(self.residual) ** 2)))

    def inside(self, highest_hz: float = float("inf")) -> Fit:
        """Return a history without its ends.

        A history up to a highest frequency is made from samples on both sides, and moments from differences
        of rates: within two periods of that frequency of an end it says more about the end than about the
        model. A history too short for that keeps its ends.

        Parameters
        ----------
        highest_hz : float
            Of what the history holds; infinite where it holds all.
        """
        ends = round(2 / highest_hz / (self.axis[1] - self.axis[0]))
        keep = slice(ends, self.axis.size - ends)
        if self.axis.size - 2 * ends <= 2 * ends:
            return self
        return Fit(self.axis[keep], self.measured[keep], self.modelled[keep])

    @property
    def worst_band(self) -> WorstBand | None:
        """The `LEAST_LINES` neighbouring lines with the greatest normalised residual; None of a history.

        The power of the residual on each line is normalised by that of noise; without known noise all lines
        count alike, so that the band holds the most of the residual.
        """
        count = min(LEAST_LINES, self.axis.size)
        if not np.iscomplexobj(self.measured) or not count:
            return None
        left = np.abs(self.residual) ** 2
        known = self.noise is not None and bool(np.all(self.noise > 0))
        power = left / self.noise**2 if known and self.noise is not None else left
        within = np.convolve(power, np.ones(count), mode="valid")
        first = int(within.argmax())
        band = slice(first, first + count)
        total = float(left.sum())
        return WorstBand(
            low_hz=float(self.axis[band][0]),
            high_hz=float(self.axis[band][-1]),
            over_noise=float(np.sqrt(within[first] / count)) if known else float("nan"),
            share=float(left[band].sum()) / total if total else float("nan"),
        )

    @property
    def theil(self) -> float:
        """Theil's inequality coefficient of a history, about the means: 0 is perfect, 1 is none at all.

        References
        ----------
        Theil, Economic Forecasts and Policy, 2nd ed., 1961; Jategaonkar, Flight Vehicle System
        Identification, 2nd ed., ch. 11: below 0.25 to 0.3 in flight-model validation.
        """
        both = [np.sqrt(np.mean(np.abs(x - x.mean()) ** 2)) for x in (self.measured, self.modelled)]
        return float(np.std(self.residual) / sum(both)) if sum(both) else float("nan")

    @property
    def coherence(self) -> float:
        """Lowest coherence of measured and modelled transforms over the octaves of the lines.

        ``|sum conj(measured) modelled|^2 / (sum |measured|^2 sum |modelled|^2)`` over the lines of each
        octave from the lowest line on. Octaves of fewer than eight lines are taken with the next, because two
        noises of n lines have a coherence of 1/n in the mean. nan of a history.
        """
        if not np.iscomplexobj(self.measured):
            return float("nan")
        octave = np.floor(np.log2(self.axis / self.axis[0]) + 1e-9).astype(int)
        groups: list[list[int]] = [[]]
        for k in range(octave.max() + 1):
            if len(groups[-1]) >= LEAST_LINES:
                groups.append([])
            groups[-1] += np.flatnonzero(octave == k).tolist()
        if len(groups) > 1 and len(groups[-1]) < LEAST_LINES:
            groups[-2] += groups.pop()
        values = []
        for of in groups:
            z, y = self.measured[of], self.modelled[of]
            power = float(np.sum(np.abs(z) ** 2) * np.sum(np.abs(y) ** 2))
            values.append(float(np.abs(np.vdot(z, y)) ** 2 / power) if power else float("nan"))
        return min(values)


def fit_layout(group: str, unit: str) -> dict[str, Dataset]:
    """Return the layout of a fit in a group."""
    values = ("measured", "modelled", "noise")
    return {"axis": Dataset(f"{group}/axis", "{axis_unit}", ("sample",))} | {
        name: Dataset(f"{group}/{name}", unit + "{transform_unit}", ("sample",)) for name in values
    }

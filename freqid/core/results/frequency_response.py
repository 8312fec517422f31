"""Frequency responses with what is known of their errors, and their file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import UsageError, nearest
from freqid.core.extras import extra
from freqid.core.layout import Attribute, Dataset, ResultFile
from freqid.core.viewable import Viewable


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Viewable):
    """Responses of o outputs to n inputs at M frequencies.

    Attributes
    ----------
    inputs, outputs : tuple of str
    input_units, output_units : tuple of str
    frequencies_hz : ndarray, shape (M,)
    value : ndarray of complex, shape (o, n, M)
        Output unit per input unit; nan where nothing excites the input nearby.
    std_error : ndarray, shape (o, n, M)
        Standard deviation of the real and of the imaginary part, which is also that of the magnitude, where
        it is small beside the magnitude.
    degrees_of_freedom : ndarray, shape (o, M)
        Complex degrees of freedom of the noise that `std_error` was taken from.
    coherence : ndarray, shape (o, n, M)
        Of the output with the injected signal of the input, on that signal's lines.
    partial_coherence : ndarray, shape (o, n, M)
        Of the output with the input, once what the other inputs explain is gone.
    misfit : ndarray, shape (o, M)
        Power that is left on excited lines over that on noise lines near by: about one where the response is
        linear and smooth across the window; nan where no noise lines are.
    method : {"multisine", "windows"}
    remarks : tuple of str
        What a reader should know before using it, one sentence each.
    provenance : dict
        JSON-compatible.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    frequencies_hz: Array
    value: Complex
    std_error: Array
    degrees_of_freedom: Array
    coherence: Array
    partial_coherence: Array
    misfit: Array
    method: str
    remarks: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        f = self.frequencies_hz
        return (
            f"<FrequencyResponse of {' '.join(self.outputs)} to {' '.join(self.inputs)}: {f.size} lines, "
            f"{f[0]:.3g} to {f[-1]:.3g} Hz, {self.method}>"
        )

    @property
    def random_error(self) -> Array:
        """Normalised random error of the magnitude, and of the phase in rad, shape (o, n, M)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.std_error / np.abs(self.value)

    def radius(self, confidence: float = 0.95) -> Array:
        """Return the radius of the circles about `value` that hold the truth so often, shape (o, n, M).

        Parameters
        ----------
        confidence : float
            How often: 0.95 for 95 of 100.

        Notes
        -----
        ``|error|^2 / (2 std_error^2)`` follows F with 2 and 2 dof degrees of freedom, whose quantile is
        ``dof ((1 - P)^(-1/dof) - 1)``.
        """
        dof = self.degrees_of_freedom
        quantile = dof * np.expm1(-np.log1p(-confidence) / dof)
        return self.std_error * np.sqrt(2 * quantile)[:, None]

    def of(self, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> FrequencyResponse:
        """Return the responses of some outputs to some inputs.

        Parameters
        ----------
        inputs, outputs : tuple of str
            Names among those that it has.

        Raises
        ------
        UsageError
            For a name that it does not have, with the nearest.
        """
        places = []
        for asked, known in ((inputs, self.inputs), (outputs, self.outputs)):
            for name in asked:
                if name not in known:
                    raise UsageError(f"'{name}' is not among {', '.join(known)}", remedy=nearest(name, known))
            places.append([known.index(name) for name in asked])
        i, o = places
        grid = np.ix_(o, i)
        return FrequencyResponse(
            inputs,
            outputs,
            tuple(self.input_units[k] for k in i),
            tuple(self.output_units[k] for k in o),
            self.frequencies_hz,
            self.value[grid],
            self.std_error[grid],
            self.degrees_of_freedom[o],
            self.coherence[grid],
            self.partial_coherence[grid],
            self.misfit[o],
            self.method,
            self.remarks,
            self.provenance,
        )

    def to_control(self) -> Any:
        """Return the responses as a python-control ``FrequencyResponseData`` with its names.

        Returns
        -------
        control.FrequencyResponseData
            At the frequencies where every pair is known; output unit per input unit, rad/s.

        Raises
        ------
        UsageError
            Where no frequency has every pair: take fewer pairs with `of`.
        DataError
            Where python-control is not installed: it is the extra ``control``.

        Examples
        --------
        >>> response.of(("de1",), ("q",)).to_control().magnitude  # doctest: +SKIP
        """
        control = extra("control", "control")
        known = np.isfinite(self.value).all(axis=(0, 1))
        if not known.any():
            raise UsageError(
                "no frequency has the responses of all pairs", remedy="take fewer with .of(inputs, outputs)"
            )
        return control.frd(
            self.value[:, :, known],
            2 * np.pi * self.frequencies_hz[known],
            inputs=list(self.inputs),
            outputs=list(self.outputs),
        )


_PAIRS = ("outputs", "inputs", "line")
_PAIR_UNIT = "output unit / input unit"  # units differ by output and input; they are in attributes
_LAYOUT = {
    **{
        name: Attribute(f"@{name}", json=True)
        for name in ("inputs", "outputs", "input_units", "output_units", "remarks", "provenance")
    },
    "method": Attribute("@method"),
    "frequencies_hz": Dataset("frequency", "Hz", ("line",)),
    "value": Dataset("value", _PAIR_UNIT, _PAIRS),
    "std_error": Dataset("std_error", _PAIR_UNIT, _PAIRS),
    "degrees_of_freedom": Dataset("degrees_of_freedom", "1", ("outputs", "line")),
    "coherence": Dataset("coherence", "1", _PAIRS),
    "partial_coherence": Dataset("partial_coherence", "1", _PAIRS),
    "misfit": Dataset("misfit", "1", ("outputs", "line")),
}
FILE = ResultFile("freqid-frequency-response", FrequencyResponse, _LAYOUT)
write_frequency_response, read_frequency_response = FILE.write, FILE.read

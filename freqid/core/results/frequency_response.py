"""Frequency responses with what is known of their errors, and their file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.core.arrays import Array, Complex
from freqid.core.errors import UsageError, nearest
from freqid.core.extras import extra
from freqid.core.layout import Attribute, Dataset, NestedSeries, ResultFile
from freqid.core.viewable import Viewable


@dataclass(frozen=True, eq=False)
class ComparedResponse:
    """What a model or a simulation has in place of measured responses, and how far it is from them.

    Attributes
    ----------
    name : str
        Such as ``model`` or ``simulation``.
    source : str
        File that it is from.
    value : ndarray of complex, shape (o, n, M)
        nan where it has no such output or input.
    cost : ndarray, shape (o, n)
        J of Tischler & Remple: up to 100 acceptable, up to 50 hard to tell from flight; nan where the partial
        coherence is too low to judge.
    unnoticed : ndarray, shape (o, n)
        Share of the frequencies at which the mismatch is inside the bounds of maximum unnoticeable added
        dynamics; nan where none is between 0.1 and 30 rad/s.
    """

    name: str
    source: str
    value: Complex
    cost: Array
    unnoticed: Array


@dataclass(frozen=True, eq=False)
class FittedResponse:
    """A parametric model that was fitted to measured responses.

    Attributes
    ----------
    name : str
        What was fitted.
    outputs, inputs : tuple of str
    parameters, units : tuple of str
    estimate : ndarray, shape (p,)
    cramer_rao : ndarray, shape (p,)
        Standard errors, ``sqrt((H^-1)_ii)`` with H the information matrix: other parameters follow.
    insensitivity : ndarray, shape (p,)
        ``1 / sqrt(H_ii)``: how far a parameter alone moves for the same change of fit. Beside `cramer_rao`
        it tells a parameter without influence from one that others can stand in for.
    value : ndarray of complex, shape (o, n, M)
        Of `outputs` and `inputs`, at the response's frequencies.
    cost : float
        Mean J over the pairs.
    weighted_error : float
        Mean squared error in units of the random error: one where the model explains the responses.
    band_hz : tuple of 2 floats
        That was fitted.
    """

    name: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    estimate: Array
    cramer_rao: Array
    insensitivity: Array
    value: Complex
    cost: float
    weighted_error: float
    band_hz: tuple[float, float]

    def __repr__(self) -> str:
        found = ", ".join(f"{n} {x:.4g}" for n, x in zip(self.parameters, self.estimate, strict=True))
        return f"<FittedResponse {self.name!r}: {found}; J {self.cost:.3g}>"

    def __getitem__(self, parameter: str) -> tuple[float, float]:
        """Return a parameter's estimate and its Cramer-Rao bound; UsageError for an unknown name."""
        if parameter not in self.parameters:
            raise UsageError(f"the fit has no '{parameter}'", remedy=nearest(parameter, self.parameters))
        i = self.parameters.index(parameter)
        return float(self.estimate[i]), float(self.cramer_rao[i])


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
    method : {"multisine", "sweeps"}
    remarks : tuple of str
        What a reader should know before using it, one sentence each.
    provenance : dict
        JSON-compatible.
    independent : ndarray, shape (M,), optional
        Share of an independent estimate that each frequency is worth: windows of neighbours overlap.
    compared : tuple of ComparedResponse
    fits : tuple of FittedResponse
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
    independent: Array | None = None
    compared: tuple[ComparedResponse, ...] = ()
    fits: tuple[FittedResponse, ...] = ()

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
            self.independent,
            tuple(
                ComparedResponse(c.name, c.source, c.value[grid], c.cost[grid], c.unnoticed[grid])
                for c in self.compared
            ),
            tuple(x for x in self.fits if {*x.inputs} <= {*inputs} and {*x.outputs} <= {*outputs}),
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
_COMPARED = {
    "name": Attribute("compared/{i}@name"),
    "source": Attribute("compared/{i}@source"),
    "value": Dataset("compared/{i}/value", _PAIR_UNIT, _PAIRS),
    "cost": Dataset("compared/{i}/cost", "1", ("outputs", "inputs")),
    "unnoticed": Dataset("compared/{i}/unnoticed", "1", ("outputs", "inputs")),
}
_FIT = {
    **{
        name: Attribute(f"fit/{{i}}@{name}", json=True)
        for name in ("outputs", "inputs", "parameters", "units", "band_hz")
    },
    **{name: Attribute(f"fit/{{i}}@{name}") for name in ("name", "cost", "weighted_error")},
    **{
        name: Dataset(f"fit/{{i}}/{name}", "in the attribute units", ("parameters",))
        for name in ("estimate", "cramer_rao", "insensitivity")
    },
    "value": Dataset("fit/{i}/value", _PAIR_UNIT, _PAIRS),
}
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
    "independent": Dataset("independent", "1", ("line",)),
    "compared": NestedSeries(ComparedResponse, _COMPARED, "i", "compared"),
    "fits": NestedSeries(FittedResponse, _FIT, "i", "fit"),
}
FILE = ResultFile("freqid-frequency-response", FrequencyResponse, _LAYOUT)
write_frequency_response, read_frequency_response = FILE.write, FILE.read

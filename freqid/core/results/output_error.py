"""What maximum likelihood gives: parameters of a dynamic model, its fit in each output, and its file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from freqid.core.arrays import Array
from freqid.core.errors import UsageError, nearest
from freqid.core.layout import Attribute, Dataset, NestedSeries, ResultFile
from freqid.core.results.fit import Fit
from freqid.core.results.point import PointModel
from freqid.core.viewable import Viewable


@dataclass(frozen=True, eq=False)
class OutputErrorModel(Viewable):
    """Parameters of a dynamic model whose outputs are nearest to the measured ones.

    Attributes
    ----------
    model : str
        Name of the model.
    method : {"output-error", "filter-error"}
    domain : {"time", "frequency"}
    names, units : tuple of str, length f
        What was estimated; biases and initial states of several manoeuvres end in ``@2`` and so on.
    estimate, std_error, lower, upper : ndarray, shape (f,)
        With limits at `confidence`; nan errors for a parameter at its bound.
    covariance : ndarray, shape (f, f)
        Allows for coloured residuals where the identification does.
    cramer_rao : ndarray, shape (f,)
        Standard errors were the residuals white.
    start : ndarray, shape (f,)
        Where the iteration began: equation error, or the user.
    held : mapping of str to float
        What was not estimated, and its value: fixed, tied, or not excited.
    confidence : float
    noise : mapping of str to float
        Standard deviation of each output's noise, in its unit; on lines, per square root of Hz.
    process_noise : mapping of str to float
        Of each state, per square root of a second; by filter error.
    whiteness : mapping of str to float
        How likely each output's residual is if it were white.
    coloured : tuple of str
        Outputs for which it is not.
    converged : bool
    steps : int
        Of the iteration.
    cost : float
        Negative logarithm of the likelihood, apart from constants.
    at_bound : tuple of str
        Parameters whose optimum is beyond their bound.
    not_excited : mapping of str to tuple of str
        Parameters that the manoeuvres do not tell, held, with those that each cannot be told from.
    inseparable : tuple of tuple of str
        Groups of parameters that are told, but hardly from each other.
    fit : mapping of str to Fit
        By output, measured and modelled; ``beta@2`` is that of the second manoeuvre.
    remarks : tuple of str
        What a reader should know before using it, one sentence each.
    provenance : dict
        JSON-compatible.
    point : PointModel, optional
        The same as applied forces and moments, where a ready form of the model was used.
    """

    model: str
    method: str
    domain: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    estimate: Array
    std_error: Array
    lower: Array
    upper: Array
    covariance: Array
    cramer_rao: Array
    start: Array
    held: Mapping[str, float]
    confidence: float
    noise: Mapping[str, float]
    process_noise: Mapping[str, float]
    whiteness: Mapping[str, float]
    coloured: tuple[str, ...]
    converged: bool
    steps: int
    cost: float
    at_bound: tuple[str, ...]
    not_excited: Mapping[str, tuple[str, ...]]
    inseparable: tuple[tuple[str, ...], ...]
    fit: Mapping[str, Fit]
    remarks: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    point: PointModel | None = None

    def __repr__(self) -> str:
        fits = ", ".join(f"{name} R2 {f.r2:.4f}" for name, f in self.fit.items())
        said = "valid" if self.valid else "not valid, see remarks"
        return (
            f"<OutputErrorModel {self.model!r} by {self.method} in {self.domain}, {said}: "
            f"{len(self.names)} parameters, {fits}>"
        )

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Return estimate and standard error of one parameter; zero error for one that was held."""
        if name in self.names:
            i = self.names.index(name)
            return float(self.estimate[i]), float(self.std_error[i])
        if name in self.held:
            return float(self.held[name]), 0.0
        raise UsageError(
            f"model '{self.model}' has no parameter '{name}'", remedy=nearest(name, (*self.names, *self.held))
        )

    @property
    def valid(self) -> bool:
        """Whether it converged and its residuals are white, as its method takes them to be."""
        return self.converged and not self.coloured

    def values(self) -> dict[str, float]:
        """Return every number of the model, estimated or held, by name."""
        return {**self.held, **dict(zip(self.names, self.estimate.tolist(), strict=True))}


_FIT = {
    "axis": Dataset("fit/{output}/axis", "{axis_unit}", ("sample",)),
    "measured": Dataset("fit/{output}/measured", "mixed", ("sample",)),
    "modelled": Dataset("fit/{output}/modelled", "mixed", ("sample",)),
}
_TEXTS = ("model", "method", "domain", "confidence", "cost", "steps", "converged")
_JSON = ("names", "units", "coloured", "at_bound", "remarks", "inseparable")
_JSON += ("held", "noise", "process_noise", "whiteness", "not_excited", "provenance")
_VECTORS = ("estimate", "std_error", "lower", "upper", "cramer_rao", "start")
_LAYOUT = {
    **{name: Attribute(f"@{name}") for name in _TEXTS},
    **{name: Attribute(f"@{name}", json=True) for name in _JSON},
    **{name: Dataset(name, "mixed", ("names",)) for name in _VECTORS},
    "covariance": Dataset("covariance", "mixed", ("names", "names")),
    "fit": NestedSeries(Fit, _FIT, "output", "@fits"),
}
FILE = ResultFile("freqid-output-error", OutputErrorModel, _LAYOUT)  # its point model is a file of its own
write_output_error, read_output_error = FILE.write, FILE.read

"""A dynamic model as one pure function, and the signals of a manoeuvre that it is compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freqid.core.arrays import Array
from freqid.core.errors import DataError, UsageError, nearest
from freqid.identify.spectra.smoothing import local_derivative

Named = Mapping[str, Any]
Equations = Callable[[Named, Named, Named], tuple[Named, Named]]


@dataclass(frozen=True, eq=False)
class DynamicModel:
    """``state derivatives, outputs = equations(state, input, parameter)``, each a mapping by name.

    Attributes
    ----------
    name : str
    states, inputs, outputs, parameters : tuple of str
    equations : callable
        Pure: scalars in, scalars out, written with `jax.numpy`, so that its sensitivities are exact.
        Everything that is measured and not an output may be an input, and constants of the aircraft too:
        an input is a history or one number.
    own : tuple of str
        Parameters that every manoeuvre has for itself, as biases.
    delays : mapping of str to str
        By input, the parameter that says how many seconds late the input acts.
    rates : mapping of str to str
        By input, the input that it is the time derivative of: it needs no history of its own.
    units : mapping of str to str
        Of the parameters, for tables.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    equations: Equations
    own: tuple[str, ...] = ()
    delays: Mapping[str, str] = field(default_factory=dict)
    rates: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"<DynamicModel {self.name!r}: states {' '.join(self.states)}; inputs {' '.join(self.inputs)}; "
            f"outputs {' '.join(self.outputs)}; {len(self.parameters)} parameters>"
        )

    def __post_init__(self) -> None:
        for kind in ("states", "inputs", "outputs", "parameters"):
            names = getattr(self, kind)
            twice = sorted({n for n in names if names.count(n) > 1})
            if twice:
                raise UsageError(f"{kind} of model '{self.name}' name {twice} more than once")
        if not self.outputs or not self.parameters:
            raise UsageError(f"model '{self.name}' has no outputs or no parameters, expected some of each")
        for name in (*self.own, *self.delays.values()):
            if name not in self.parameters:
                raise UsageError(
                    f"'{name}' is no parameter of model '{self.name}'", remedy=nearest(name, self.parameters)
                )
        for name in (*self.delays, *self.rates, *self.rates.values()):
            if name not in self.inputs:
                raise UsageError(
                    f"'{name}' is no input of model '{self.name}'", remedy=nearest(name, self.inputs)
                )

    @property
    def shared(self) -> tuple[str, ...]:
        """Parameters that all manoeuvres have in common."""
        return tuple(p for p in self.parameters if p not in self.own)


@dataclass(frozen=True, eq=False)
class Signals:
    """What one manoeuvre gives a model.

    Attributes
    ----------
    dt : float
        Sampling interval, s.
    inputs : mapping of str to ndarray of shape (N,), or float
        A number is held throughout.
    outputs : mapping of str to ndarray of shape (N,)
        As measured.
    start : float
        Time of the first sample, s.
    name : str
        What errors and results call the manoeuvre.
    """

    dt: float
    inputs: Mapping[str, Array | float]
    outputs: Mapping[str, Array]
    start: float = 0.0
    name: str = ""

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return int(np.shape(next(iter(self.outputs.values())))[0])

    @property
    def time(self) -> Array:
        """Shape (N,), s."""
        return np.asarray(self.start + self.dt * np.arange(self.samples), dtype=np.float64)

    def input_matrix(self, model: DynamicModel) -> Array:
        """Return the model's inputs, shape (N, m)."""
        if not model.inputs:
            return np.empty((self.samples, 0))
        return np.stack([self._input(model, n) for n in model.inputs], axis=-1)

    def output_matrix(self, model: DynamicModel) -> Array:
        """Return the measured outputs, shape (N, k)."""
        return np.stack([self._history("output", n, self.outputs) for n in model.outputs], axis=-1)

    def _input(self, model: DynamicModel, name: str) -> Array:
        if name not in model.rates or name in self.inputs:
            return self._history("input", name, self.inputs)
        of = self._history("input", model.rates[name], self.inputs)
        return np.asarray(local_derivative(of[None], self.dt)[0])

    def _history(self, kind: str, name: str, given: Mapping[str, Array | float]) -> Array:
        where = self.name or None
        if name not in given:
            raise DataError(f"{kind} '{name}' is missing", where=where, remedy=nearest(name, given))
        values = np.asarray(given[name], dtype=np.float64)
        if values.ndim == 0:
            values = np.full(self.samples, values)
        if values.shape != (self.samples,):
            raise DataError(
                f"{kind} '{name}' has shape {values.shape}, expected ({self.samples},) like the others",
                where=where,
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise DataError(
                f"{kind} '{name}' is not finite in {bad.size} of {self.samples} samples, first at sample "
                f"{bad[0]}",
                where=where,
                remedy="cut the manoeuvre around them",
            )
        return np.asarray(values)

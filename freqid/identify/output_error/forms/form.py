"""What a ready form is, how one is found, and the applied loads that all of them have in common."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

from freqid.core.errors import UsageError
from freqid.core.sections.identification import factors_of
from freqid.identify.output_error.model import DynamicModel, Named

COEFFICIENT, DIMENSIONAL = ("coefficient",), ("force", "specific")
LENGTHS = {"L": "span_m", "M": "chord_m", "N": "span_m"}
OWN_INERTIA = {
    "X": "mass_kg",
    "Y": "mass_kg",
    "Z": "mass_kg",
    "L": "Ixx",
    "M": "Iyy",
    "N": "Izz",
}


@dataclass(frozen=True)
class Loads:
    """Applied forces and moments as functions of regressors.

    ``response = bias + sum_j derivative_j (regressor_j - trim_j)``, the bias each manoeuvre's own.

    Attributes
    ----------
    regressors : tuple of (str, tuple of str)
        By response, among X Y Z L M N.
    form : {"force", "specific", "coefficient"}
    outputs : tuple of str
        Those of the form's outputs that are compared.
    """

    regressors: tuple[tuple[str, tuple[str, ...]], ...]
    form: str
    outputs: tuple[str, ...]

    @property
    def responses(self) -> tuple[str, ...]:
        """Return the responses."""
        return tuple(r for r, _ in self.regressors)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Return the names of derivatives and biases: ``M_de``, ``M_bias``."""
        return tuple(f"{r}_{x}" for r, names in self.regressors for x in (*names, "bias"))

    @property
    def biases(self) -> tuple[str, ...]:
        """Return the names of the biases."""
        return tuple(f"{r}_bias" for r in self.responses)

    @property
    def factors(self) -> tuple[str, ...]:
        """Return all regressors, products as their factors."""
        return tuple(dict.fromkeys(f for _, names in self.regressors for n in names for f in factors_of(n)))

    def inputs(self, states: tuple[str, ...], others: tuple[str, ...]) -> tuple[str, ...]:
        """Return the inputs of a model: regressors that are no states, trims, and what its equations need."""
        hats = {"phat": ("p", "span_m"), "qhat": ("q", "chord_m"), "rhat": ("r", "span_m")}
        wanted = []
        for name in self.factors:
            if name in hats and hats[name][0] in states:
                wanted += [hats[name][1], *(() if "V" in states else ("V",))]
            elif name not in states:
                wanted.append(name)
        if self.form == "coefficient":
            wanted += ["area_m2", *(LENGTHS[r] for r in self.responses if r in LENGTHS)]
        wanted += [f"trim_{name}" for name in self.factors]
        return tuple(n for n in dict.fromkeys((*wanted, *others)) if n not in states)

    def of(self, x: Named, u: Named, p: Named, qbar: Any = None) -> dict[str, Any]:
        """Return the loads in N and N m by response.

        Parameters
        ----------
        x, u, p : mapping of str to scalar
            States, inputs and parameters of the model.
        qbar : scalar, optional
            Dynamic pressure, Pa, for coefficients.
        """
        known = {**u, **x}
        for hat, rate, length in (
            ("phat", "p", "span_m"),
            ("qhat", "q", "chord_m"),
            ("rhat", "r", "span_m"),
        ):
            if hat in self.factors and hat not in u:
                known[hat] = known[rate] * known[length] / (2 * known["V"])
        away = {name: known[name] - u[f"trim_{name}"] for name in self.factors}
        found = {}
        for response, names in self.regressors:
            value = p[f"{response}_bias"]
            for name in names:
                term = p[f"{response}_{name}"]
                for factor in factors_of(name):
                    term = term * away[factor]
                value = value + term
            found[response] = value * self._size(response, u, qbar)
        return found

    def _size(self, response: str, u: Named, qbar: Any) -> Any:
        if self.form == "specific":
            return u[OWN_INERTIA[response]]
        if self.form == "coefficient":
            return qbar * u["area_m2"] * (u[LENGTHS[response]] if response in LENGTHS else 1.0)
        return 1.0


@dataclass(frozen=True)
class Form:
    """One ready form; its file holds one of these as ``FORM``.

    Attributes
    ----------
    name : str
    responses : tuple of str
        Loads that it needs, all of them.
    forms : tuple of str
        Forms of the loads that it is for.
    outputs : tuple of str
        What it can be compared with.
    build : callable
        ``build(loads) -> DynamicModel``.
    """

    name: str
    responses: tuple[str, ...]
    forms: tuple[str, ...]
    outputs: tuple[str, ...]
    build: Callable[[Loads], DynamicModel]


@cache
def forms() -> tuple[Form, ...]:
    """Return the ready forms of this folder."""
    modules = pkgutil.iter_modules([str(Path(__file__).parent)])
    loaded = [import_module(f"{__package__}.{module.name}") for module in modules]
    return tuple(module.FORM for module in loaded if hasattr(module, "FORM"))


def parted(responses: tuple[str, ...], form: str) -> list[tuple[str, ...]]:
    """Return the responses by ready form: as they are, or longitudinal and lateral ones apart.

    Raises
    ------
    UsageError
        Where no forms have them.
    """
    if any(set(each.responses) == set(responses) and form in each.forms for each in forms()):
        return [responses]
    parts = [tuple(r for r in responses if r in group) for group in ("XZM", "YLN")]
    for part in filter(None, parts):
        find_form(part, form)
    return [part for part in parts if part]


def find_form(responses: tuple[str, ...], form: str) -> Form:
    """Return the ready form of some loads.

    Raises
    ------
    UsageError
        Where none has just these responses.
    """
    for each in forms():
        if set(each.responses) == set(responses) and form in each.forms:
            return each
    known = "; ".join(sorted({" ".join(each.responses) for each in forms()}))
    raise UsageError(
        f"no ready model has the responses {' '.join(responses)} in form '{form}'",
        remedy=f"ask for one of {known}, or give a model as a function in Python",
    )


@lru_cache(maxsize=64)
def model_of(form: Form, loads: Loads) -> DynamicModel:
    """Return the model of a form; the same object for the same loads, so that it is compiled once."""
    return form.build(loads)


def chosen(outputs: Mapping[str, Any], loads: Loads) -> dict[str, Any]:
    """Return the outputs that are compared."""
    return {name: outputs[name] for name in loads.outputs}


def output_biases(loads: Loads, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the biases of those accelerometers that are compared, as ``bias_ay``."""
    return tuple(f"bias_{name}" for name in names if name in loads.outputs)

"""A model as a list of scalar calculations and one-dimensional linear tables, for formats that know no more.

DAVE-ML and JSBSim both evaluate named quantities one after the other. They are written from this one list, so
that what one of them gives, the other gives too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from freqid.core.arrays import Array

Operation = Literal["+", "-", "*", "/", "sqrt", "abs", "floor", "min", "max", "if<"]


@dataclass(frozen=True)
class Apply:
    """An operation on expressions; ``if<`` of a, b, c and d is c where a < b, else d."""

    operation: Operation
    of: tuple[Expression, ...]


@dataclass(frozen=True, eq=False)
class Lookup:
    """A linear table of one quantity, held at its ends.

    Attributes
    ----------
    axis : str
        Name of the breakpoints.
    of : str
        Name of the quantity that is looked up.
    values : ndarray, shape (node,)
    """

    axis: str
    of: str
    values: Array


Expression = float | str | Apply
"""A number, the name of a quantity, or an operation on such."""


@dataclass(frozen=True)
class Quantity:
    """One step of a calculation.

    Attributes
    ----------
    name : str
        Of letters, digits and ``_``; unique.
    unit : str
        SI, as records have it.
    meaning : str
        In words.
    value : Expression, Lookup or None
        None where it is given from outside.
    std_error : str or float, optional
        One standard error, or the name of the quantity that is it.
    correlation : mapping of str to float
        With the errors of quantities before it.
    label : str
        What the model itself calls it; empty for what it has no name for.
    """

    name: str
    unit: str
    meaning: str
    value: Expression | Lookup | None = None
    std_error: str | float | None = None
    correlation: Mapping[str, float] = field(default_factory=dict)
    label: str = ""


@dataclass(frozen=True)
class Axis:
    """Breakpoints of tables: ascending nodes, shape (node,), two or more, and their unit."""

    nodes: Array
    unit: str


@dataclass(frozen=True)
class CheckCase:
    """One state and what the model itself gives there.

    Attributes
    ----------
    name : str
    inputs : dict of str to float
        By label, SI.
    outputs : dict of str to float
        By response, SI, as the model has it, not as tables have it.
    bounds : dict of str to float
        How far the calculation may be from that, by response.
    outside : bool
    """

    name: str
    inputs: dict[str, float]
    outputs: dict[str, float]
    bounds: dict[str, float]
    outside: bool


@dataclass(frozen=True)
class Calculation:
    """A whole model.

    Attributes
    ----------
    title : str
    notes : tuple of str
        What a user must know, one sentence each: range, what happens outside, errors.
    axes : mapping of str to Axis
    quantities : tuple of Quantity
        In an order in which each needs only those before it.
    outputs : mapping of str to str
        Name of the quantity by response.
    outside : str
        Name of the quantity that is 1 where the model is used too far away, else 0.
    inner : tuple of str
        Names of quantities on the way that tell most about a reader that goes wrong.
    bounds : mapping of str to float
        Largest difference from the model's own responses, by response, over the stated range.
    checks : tuple of CheckCase
    form : {"force", "specific", "coefficient"}
    """

    title: str
    notes: tuple[str, ...]
    axes: Mapping[str, Axis]
    quantities: tuple[Quantity, ...]
    outputs: Mapping[str, str]
    outside: str
    inner: tuple[str, ...]
    bounds: Mapping[str, float]
    checks: tuple[CheckCase, ...]
    form: str

    @property
    def inputs(self) -> tuple[Quantity, ...]:
        """What is given from outside."""
        return tuple(q for q in self.quantities if q.value is None)

    def evaluate(self, inputs: Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Return all quantities, by name, shape (n,) each, for inputs by label."""
        size = np.broadcast_shapes((1,), *(np.shape(inputs[q.label]) for q in self.inputs))
        known: dict[str, Array] = {}
        for q in self.quantities:
            if q.value is None:
                found = np.asarray(inputs[q.label], dtype=float)
            elif isinstance(q.value, Lookup):
                found = np.interp(known[q.value.of], self.axes[q.value.axis].nodes, q.value.values)
            else:
                found = _evaluate(q.value, known)
            known[q.name] = np.broadcast_to(found, size)
        return known


_ONE = {"sqrt": np.sqrt, "abs": np.abs, "floor": np.floor}
_MANY = {"+": np.add, "*": np.multiply, "min": np.minimum, "max": np.maximum}


def _evaluate(expression: Expression, known: Mapping[str, Array]) -> Array:
    if isinstance(expression, str):
        return known[expression]
    if not isinstance(expression, Apply):
        return np.asarray(expression, dtype=float)
    of = [_evaluate(one, known) for one in expression.of]
    if expression.operation in _ONE:
        return _ONE[expression.operation](of[0])
    if expression.operation == "if<":
        return np.where(of[0] < of[1], of[2], of[3])
    if expression.operation == "-":
        return of[0] - of[1]
    if expression.operation == "/":
        return of[0] / of[1]
    result = of[0]
    for one in of[1:]:
        result = _MANY[expression.operation](result, one)
    return result


def total(terms: Sequence[Expression]) -> Expression:
    """Return a sum without its zeros."""
    left = [t for t in terms if not (isinstance(t, float) and t == 0.0)]
    return 0.0 if not left else left[0] if len(left) == 1 else Apply("+", tuple(left))


def product(*factors: Expression) -> Expression:
    """Return a product without its ones; zero where a factor is."""
    if any(isinstance(f, float) and f == 0.0 for f in factors):
        return 0.0
    left = [f for f in factors if not (isinstance(f, float) and f == 1.0)]
    return 1.0 if not left else left[0] if len(left) == 1 else Apply("*", tuple(left))


def less(one: Expression, other: Expression) -> Expression:
    """Return a difference, or `one` where `other` is zero."""
    return one if isinstance(other, float) and other == 0.0 else Apply("-", (one, other))


def quotient(one: Expression, other: Expression) -> Expression:
    """Return `one` over `other`."""
    return Apply("/", (one, other))


def clipped(one: Expression, low: Expression, high: Expression) -> Expression:
    """Return an expression held between two others."""
    return Apply("min", (Apply("max", (one, low)), high))


def beyond(size: Expression, limit: float) -> Expression:
    """Return 1 where the magnitude of an expression is above a limit, else 0."""
    return Apply("if<", (limit, Apply("abs", (size,)), 1.0, 0.0))


class Steps:
    """Quantities as they are added, with names that formats accept and that are all different."""

    def __init__(self) -> None:
        self.quantities: list[Quantity] = []
        self.axes: dict[str, Axis] = {}
        self._taken: set[str] = set()

    def add(
        self,
        name: str,
        unit: str,
        meaning: str,
        value: Expression | Lookup | None,
        std_error: str | float | None = None,
        correlation: Mapping[str, float] | None = None,
        label: str = "",
    ) -> str:
        """Add a quantity and return the name that it has, which `name` is made into."""
        plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
        plain = plain if plain[:1].isalpha() else f"x_{plain}"
        unique, count = plain, 1
        while unique in self._taken:
            count += 1
            unique = f"{plain}_{count}"
        self._taken.add(unique)
        self.quantities.append(Quantity(unique, unit, meaning, value, std_error, correlation or {}, label))
        return unique

    def table(
        self,
        name: str,
        unit: str,
        meaning: str,
        axis: str,
        of: str,
        values: Array,
        std_error: str | None = None,
    ) -> str:
        """Add a table and return its name; a constant where all its values are the same."""
        value = float(values[0]) if np.ptp(values) == 0 else Lookup(axis, of, values)
        return self.add(name, unit, meaning, value, std_error)

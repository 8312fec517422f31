"""What a Monte Carlo campaign varies and does: its TOML file, and the settings that follow from it."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from freqid.core.errors import UsageError, nearest
from freqid.core.toml import read_toml
from freqid.core.vehicle import Strict

Setting = dict[str, Any]
"""One combination of values by dotted name: numbers, texts, truth values or, for alternatives, mappings."""


class MonteCarloPlan(Strict, frozen=True):
    """The file of ``freqid campaign``.

    Attributes
    ----------
    stage : str
        ``fly``, ``identify``, ``blend`` or ``diagnose``; or ``FILE.py:NAME``, a function of your own.
    scenario : str
        Path, from the folder of this file on, or the name of a shipped one; a function of your own may do
        without.
    seeds : int or tuple of int
        How many, or which.
    first_seed : int
        Of so many.
    axis : str
        Setting that the page shows results against; the first numeric one that varies where empty.
    by : str
        Setting, or column of a function of your own, that makes one curve for each of its values.
    batch : int
        Cases of one setting that are one unit of work.
    fixed, vary : mapping
        Arguments of the stage; those of `vary` are lists, and every combination is done. A table in a table
        is a name with a dot: ``[vary.effects] mass = [0.0, 0.05]`` varies ``effects.mass``.
    """

    stage: str
    scenario: str = ""
    seeds: int | tuple[int, ...] = 100
    first_seed: int = 0
    axis: str = ""
    by: str = ""
    batch: int = 10
    fixed: dict[str, Any] = msgspec.field(default_factory=dict)
    vary: dict[str, Any] = msgspec.field(default_factory=dict)

    def __post_init__(self) -> None:
        count = self.seeds if isinstance(self.seeds, int) else len(self.seeds)
        if count < 1:
            raise ValueError(f"seeds is {self.seeds}, expected one or more")
        if not isinstance(self.seeds, int) and len(set(self.seeds)) < len(self.seeds):
            raise ValueError("a seed is there twice")
        if min((self.first_seed, *(() if isinstance(self.seeds, int) else self.seeds))) < 0:
            raise ValueError("a seed is negative, expected zero or more")
        if self.batch < 1:
            raise ValueError(f"batch is {self.batch}, expected one or more")

    @property
    def each_seed(self) -> Sequence[int]:
        """Seeds of every setting."""
        if isinstance(self.seeds, int):
            return range(self.first_seed, self.first_seed + self.seeds)
        return self.seeds

    @property
    def batches(self) -> list[tuple[int, ...]]:
        """Seeds of the units of one setting. More seeds leave the full batches as they were."""
        every = self.each_seed
        return [tuple(every[i : i + self.batch]) for i in range(0, len(every), self.batch)]


@dataclass(frozen=True)
class Planned:
    """A plan with its factors.

    Attributes
    ----------
    plan : MonteCarloPlan
    where : str
        Its file.
    sha256 : str
    factors : dict of list
        Values by dotted name, of those that vary; of one type each.
    fixed : dict
    axis, by : str
        As chosen; empty where nothing varies.
    """

    plan: MonteCarloPlan
    where: str
    sha256: str
    factors: dict[str, list[Any]]
    fixed: Setting
    axis: str
    by: str

    @property
    def settings(self) -> Iterator[Setting]:
        """Every combination, the fixed ones among them."""
        for values in itertools.product(*self.factors.values()):
            yield {**self.fixed, **dict(zip(self.factors, values, strict=True))}

    @property
    def setting_count(self) -> int:
        """How many there are."""
        count = 1
        for values in self.factors.values():
            count *= len(values)
        return count

    @property
    def case_count(self) -> int:
        """How many cases that makes."""
        return self.setting_count * len(self.plan.each_seed)


def read_plan(path: Path, axis: str = "", by: str = "") -> Planned:
    """Read and check a campaign's file.

    Parameters
    ----------
    path : Path
    axis, by : str
        In place of those in the file.

    Raises
    ------
    UsageError
        For an unknown key, a list that is empty or of mixed types, or an axis that does not vary.
    DataError
        Where the file cannot be read.
    """
    plan, sha256 = read_toml(path, MonteCarloPlan)
    where = str(path)
    factors: dict[str, list[Any]] = {}
    for name, values in flat(plan.vary).items():
        factors[name] = _alike(name, values, where)
    fixed = flat(plan.fixed)
    twice = sorted({*factors} & {*fixed})
    if twice:
        raise UsageError(f"'{twice[0]}' is both fixed and varied", where=where, remedy="state it once")
    numeric = [n for n, v in factors.items() if isinstance(v[0], int | float) and not isinstance(v[0], bool)]
    axis = axis or plan.axis or next(iter(numeric + list(factors)), "")
    by = by or plan.by
    if axis and axis not in factors:
        raise UsageError(
            f"axis '{axis}' does not vary",
            where=where,
            remedy=nearest(axis, factors) if factors else "vary it",
        )
    if by and by == axis:
        raise UsageError(f"'{by}' is the axis and makes the curves too", where=where, remedy="choose another")
    return Planned(plan, where, sha256, factors, fixed, axis, by)


def flat(table: Mapping[str, Any], stem: str = "") -> dict[str, Any]:
    """Return a table of tables with dotted names."""
    found: dict[str, Any] = {}
    for name, value in table.items():
        nested = isinstance(value, Mapping) and value
        found |= flat(value, f"{stem}{name}.") if nested else {f"{stem}{name}": value}
    return found


def nested(setting: Mapping[str, Any]) -> dict[str, Any]:
    """Return a setting with a table for each name before a dot, as the arguments of a stage."""
    found: dict[str, Any] = {}
    for name, value in setting.items():
        place, (*stems, last) = found, name.split(".")
        for stem in stems:
            place = place.setdefault(stem, {})
        if isinstance(value, Mapping) and isinstance(place.get(last), dict):
            place[last] = {**value, **place[last]}
        else:
            place[last] = dict(value) if isinstance(value, Mapping) else value
    return found


def label(value: Any) -> Any:
    """Return a value as a column holds it: numbers, texts and truth values as they are, others as text."""
    if isinstance(value, Mapping):
        return " ".join(
            f"{n}={v:g}" if isinstance(v, float) else f"{n}={v}" for n, v in flat(value).items()
        ) or ("none")
    if isinstance(value, list | tuple):
        return ",".join(str(v) for v in value)
    return value


def _alike(name: str, values: Any, where: str) -> list[Any]:
    """Return the values of a factor, numbers as floats where any is one."""
    if not isinstance(values, list) or not values:
        raise UsageError(
            f"vary.{name} is {json.dumps(values)}, expected a list of values",
            where=where,
            remedy="list them, or put a single one into [fixed]",
        )
    numbers = [isinstance(v, int | float) and not isinstance(v, bool) for v in values]
    if all(numbers):
        values = [float(v) for v in values] if any(isinstance(v, float) for v in values) else values
    elif len({type(v) for v in values}) > 1:
        raise UsageError(
            f"vary.{name} mixes values of several types", where=where, remedy="make them all of one type"
        )
    if len({msgspec.json.encode(v, order="sorted") for v in values}) < len(values):
        raise UsageError(f"vary.{name} has a value twice", where=where, remedy="state each once")
    return values

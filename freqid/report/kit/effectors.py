"""Effectors as people speak of them: by group, in engineering units, with the room that is left to them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise

from freqid.core.vehicle import Vehicle
from freqid.report.kit.notation import shown_unit

MOST_GROUPS = 7  # colours that readers can tell apart


def effector_groups(names: Sequence[str], vehicle: Vehicle) -> dict[str, list[int]]:
    """Return which effectors belong together, as places in `names` by a label such as ``de1 to de4``.

    Parameters
    ----------
    names : sequence of str
    vehicle : Vehicle
        Effectors of one kind whose names differ in a number only are a group; where that gives too many
        groups, all of one kind are.
    """
    kinds = vehicle.effector_kinds
    family = [(kinds.get(n, ""), re.sub(r"\d+$", "", n)) for n in names]
    if len(set(family)) > MOST_GROUPS:
        family = [(kinds.get(n, ""), "") for n in names]
    members: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(family):
        members.setdefault(key, []).append(i)
    labels: dict[str, list[int]] = {}
    for (kind, stem), places in members.items():
        first, last = names[places[0]], names[places[-1]]
        join = ", " if len(places) == 2 else " to "
        label = f"{kind or 'effector'}s" if not stem else first if first == last else first + join + last
        labels[label] = places
    return labels


def runs(numbers: Sequence[int]) -> str:
    """Write ascending whole numbers shortly: a comb by its step, neighbours as a range.

    Examples
    --------
    >>> runs([3, 21, 39, 57, 75, 93]), runs([3, 4, 5, 9])
    ('3 to 93 by 18', '3 to 5, 9')
    """
    steps = {b - a for a, b in pairwise(numbers)}
    if len(numbers) > 3 and len(steps) == 1 and steps != {1}:
        return f"{numbers[0]} to {numbers[-1]} by {steps.pop()}"
    phrases = []
    for _, run in groupby(enumerate(numbers), key=lambda pair: pair[1] - pair[0]):
        block = [value for _, value in run]
        phrases.append(f"{block[0]} to {block[-1]}" if len(block) > 2 else ", ".join(map(str, block)))
    return ", ".join(phrases)


def engineering(unit: str) -> tuple[str, float]:
    """Return the unit that an effector's values are shown in, and the factor from SI to it."""
    return shown_unit("effector/", unit)


def reach(vehicle: Vehicle, name: str, trim: Mapping[str, float]) -> tuple[float, float] | None:
    """Return how far an effector may go down and up from its trim, or None where that is not known.

    Parameters
    ----------
    vehicle : Vehicle
    name : str
    trim : mapping of str to float
        Positions, SI; where absent an effector is at zero if its limits lie on both sides of it.

    Returns
    -------
    tuple of 2 floats, optional
        Lowest and highest deviation from the trim, SI. The first is negative, the second positive,
        unless the trim itself is outside the limits.
    """
    effector = vehicle.effector(name)
    low, high = effector.limits
    at = trim.get(name, 0.0)
    if name not in trim and not low < at < high:
        return None
    return low - at, high - at

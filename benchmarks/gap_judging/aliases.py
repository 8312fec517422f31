"""Effects that no flight data can tell apart: naming one for the other counts as right.

The exact groups hold for every vehicle; a case may add groups of its own (key ``aliases`` of ``case.json``),
where its records lack the channel that would tell two effects apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class AliasGroup:
    """Effects that change the data in the same way.

    Attributes
    ----------
    members : dict of tuple of str
        Effect id, and the parameters or places to which the group is limited; empty where all of the effect
        belongs to it.
    reason : str
    """

    members: Mapping[str, tuple[str, ...]]
    reason: str

    def holds(self, effect: str, words: Iterable[str]) -> bool:
        """Return whether an effect, with its parameters' and places' names as `words`, is a member."""
        if effect not in self.members:
            return False
        limits, said = self.members[effect], {w for w in words if w}
        return not limits or not said or not said.isdisjoint(limits)


EXACT = (
    AliasGroup(
        {"mass": (), "sensor_scale": ("ax", "ay", "az", "accelerometers")},
        "force is mass times measured specific force: a heavier vehicle and an accelerometer that reads "
        "too little give the same product",
    ),
    AliasGroup(
        {"steady_wind": (), "sensor_bias": ("u", "v", "w", "V", "qbar", "airspeed")},
        "velocity relative to the air is ground velocity less wind: over one heading a constant wind is a "
        "constant error of the airspeed sensor",
    ),
    AliasGroup(
        {"actuator_delay": (), "time_skew": ("rates", "p", "q", "r")},
        "a pure delay before the vehicle and one behind it are the same delay from command to output",
    ),
)
"""Groups of the design, one sentence of reason each."""


def groups_of(listed: Sequence[str] | Sequence[Sequence[str]], truth: Iterable[str]) -> list[list[str]]:
    """Return a case's own groups: those that it lists, or one of the truth and the ids that it lists."""
    names = [a for a in listed if isinstance(a, str)]
    own = [[*truth, *names]] if names else []
    return own + [list(a) for a in listed if not isinstance(a, str)]


def equivalent(
    effects: Mapping[str, Iterable[str]], groups: Sequence[Sequence[str]] = ()
) -> dict[str, frozenset[str]]:
    """Return, by true effect, the ids that count as its name.

    Parameters
    ----------
    effects : dict of iterable of str
        By effect id, names of the parameters and places that were set.
    groups : sequence of sequence of str
        Groups that hold in this case alone.
    """
    found = {}
    for effect, words in effects.items():
        same = {effect}
        listed = list(words)
        for group in EXACT:
            if group.holds(effect, listed):
                same |= set(group.members)
        for own in groups:
            if effect in own:
                same |= set(own)
        found[effect] = frozenset(same)
    return found


def merged(names: Iterable[str], groups: Sequence[Sequence[str]] = ()) -> list[frozenset[str]]:
    """Return names as answers, members of one alias group as one answer.

    Parameters
    ----------
    names : iterable of str
        Effect ids that a diagnosis gives.
    groups : sequence of sequence of str
        Groups that hold in this case alone.
    """
    answers: list[set[str]] = []
    every = [set(g.members) for g in EXACT] + [set(g) for g in groups]
    for name in dict.fromkeys(names):
        for answer in answers:
            if any({name, other} <= group for group in every for other in answer):
                answer.add(name)
                break
        else:
            answers.append({name})
    return [frozenset(a) for a in answers]

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


@dataclass(frozen=True)
class Compound:
    """An effect that moves the parameters of several others at once.

    Attributes
    ----------
    effect : str
    parts : dict of tuple of str
        By effect id, the parameters that the compound shares with it.
    reason : str
    """

    effect: str
    parts: Mapping[str, tuple[str, ...]]
    reason: str

    def names(self, truth: str, words: Iterable[str], moved: Iterable[str]) -> frozenset[str]:
        """Return the ids beside its own that name a true effect.

        Parameters
        ----------
        truth : str
            Effect id.
        words : iterable of str
            Parameters that were set.
        moved : iterable of str
            Parameters that the compound, where it is the answer, says are off: intervals without zero.
        """
        set_ = set(words) & {n for names in self.parts.values() for n in names}
        if truth in self.parts:
            # the answer holds the truth only where what it says is off is what was set
            return frozenset({self.effect}) if set_ and set_ <= set(moved) else frozenset()
        if truth == self.effect and set_:
            # a load that moved the parameters of one part alone is that part
            return frozenset(part for part, names in self.parts.items() if set_ <= set(names))
        return frozenset()


LOAD = Compound(
    "mass_properties",
    {"mass": ("fraction",), "cg_offset": ("x", "y", "z"), "inertia": ("xx", "yy", "zz", "xz")},
    "a load's mass, centre of gravity and inertia are the same numbers of the same body whichever effect "
    "names them: which of them are off is what the intervals say, and no data tell the names apart",
)
"""Named for one of its parts it is right where its intervals say that part; a part named for it is right
where the load moved nothing else. Where it is right, a part named beside it says the same body twice and is
one answer with it; where not, it is a name of its own, and wrong."""


def groups_of(listed: Sequence[str] | Sequence[Sequence[str]], truth: Iterable[str]) -> list[list[str]]:
    """Return a case's own groups: those that it lists, or one of the truth and the ids that it lists."""
    names = [a for a in listed if isinstance(a, str)]
    own = [[*truth, *names]] if names else []
    return own + [list(a) for a in listed if not isinstance(a, str)]


def equivalent(
    effects: Mapping[str, Iterable[str]],
    groups: Sequence[Sequence[str]] = (),
    moved: Mapping[str, Iterable[str]] | None = None,
) -> dict[str, frozenset[str]]:
    """Return, by true effect, the ids that count as its name.

    Parameters
    ----------
    effects : dict of iterable of str
        By effect id, names of the parameters and places that were set.
    groups : sequence of sequence of str
        Groups that hold in this case alone.
    moved : dict of iterable of str, optional
        By effect id that the answer gives, the parameters that it says are off. Without it `LOAD` names none
        of its parts: what it says of them is not known.
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
        same |= LOAD.names(effect, listed, (moved or {}).get(LOAD.effect, ()))
        found[effect] = frozenset(same)
    return found


def merged(
    names: Iterable[str],
    groups: Sequence[Sequence[str]] = (),
    same: Mapping[str, frozenset[str]] | None = None,
) -> list[frozenset[str]]:
    """Return names as answers, members of one alias group as one answer.

    Parameters
    ----------
    names : iterable of str
        Effect ids that a diagnosis gives.
    groups : sequence of sequence of str
        Groups that hold in this case alone.
    same : dict of frozenset of str, optional
        Of `equivalent`.
    """
    answers: list[set[str]] = []
    every = [set(g.members) for g in EXACT] + [set(g) for g in groups]
    if any(LOAD.effect in right_names for right_names in (same or {}).values()):
        every += [{LOAD.effect, part} for part in LOAD.parts]
    for name in dict.fromkeys(names):
        for answer in answers:
            if any({name, other} <= group for group in every for other in answer):
                answer.add(name)
                break
        else:
            answers.append({name})
    return [frozenset(a) for a in answers]


def right(same: Mapping[str, frozenset[str]], answers: Sequence[frozenset[str]]) -> bool:
    """Return whether answers name exactly the true effects.

    Parameters
    ----------
    same : dict of frozenset of str
        Of `equivalent`.
    answers : sequence of frozenset of str
        Of `merged`.
    """
    together = [e for e in same if e in LOAD.parts and LOAD.effect in same[e]]
    stated = any(LOAD.effect in a for a in answers)
    truths = len(same) - (len(together) - 1 if stated and together else 0)  # one load says all its parts
    return len(answers) == truths and all(any(a & names for a in answers) for names in same.values())

"""Phase margins of an identified model beside those of a simulation, and why the two differ."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import chain

from freqid.blend.corridor_study import StudiedPoint, causes_of
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.review import LoopCompared
from freqid.core.results.loop_margins import LoopMargins, least_of
from freqid.workflows.reviews.gap_grounds import least_flown, listed
from freqid.workflows.reviews.read_together import ReviewedFile

_FIGURE = "phase_deg"
_SIMULATION = "simulation"  # how `freqid margins --beside SCENARIO` names what stands beside


def loops_compared(files: Sequence[ReviewedFile]) -> tuple[LoopCompared, ...]:
    """Return phase margins by condition: of the identified model, the simulation, and with a gap's effect.

    At each condition the axis with the least of them; at that of a gap the axis that has least with its
    effect. Empty where the files hold margins of one aircraft alone.

    Parameters
    ----------
    files : sequence of ReviewedFile
    """
    found: dict[str, LoopCompared] = {}
    flown = {at: (axis, before, after) for at, axis, before, after in chain(*map(_flown, files))}
    for one in files:
        if isinstance(one.result, LoopMargins):
            for k, at in enumerate(one.result.ids):
                axis = flown[at][0] if at in flown else _least_axis(one.result, k)
                if axis:
                    found.setdefault(at, _row(one.result, k, axis, flown.get(at)))
    for at, (axis, before, after) in flown.items():
        found.setdefault(at, LoopCompared(at, axis, math.nan, math.nan, math.nan, before, after))
    rows = tuple(found.values())
    of_both = any(math.isfinite(r.model) for r in rows) and any(math.isfinite(r.simulation) for r in rows)
    return rows if of_both else ()


def why_loops_differ(
    rows: Sequence[LoopCompared], files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]
) -> tuple[str, ...]:
    """Return sentences on why the margins of a model and of a simulation are not the same.

    Parameters
    ----------
    rows : sequence of LoopCompared
        Of `loops_compared`.
    files : sequence of ReviewedFile
    points : sequence of StudiedPoint
        Conditions that the model was identified at; at others it is interpolated.
    """
    if not rows:
        return ()
    identified = [p.id for p in points]
    least = min((r for r in rows if math.isfinite(r.model)), key=lambda r: r.model)
    effects = next((e for one in files if (e := _effects(one))), "")
    said = [s for r in rows if math.isfinite(r.flown) for s in _of_gap(r, least, effects, identified)]
    return (*said, *_form([r for r in rows if r.at in identified], points))


def interpolated(ids: Sequence[str], identified: Sequence[str]) -> list[str]:
    """Return the conditions at which the model was not identified; none where nothing says where it was.

    Parameters
    ----------
    ids : sequence of str
        Conditions that margins were computed at.
    identified : sequence of str
        Of the point models among the files.
    """
    return [at for at in dict.fromkeys(ids) if identified and at not in identified]


def interpolation(identified: Sequence[str]) -> str:
    """Return what a margin at a condition without a point model rests on, as the end of a sentence."""
    return (
        f"it was not identified there but interpolated between {listed(identified)}, and no flight says that "
        "it holds there"
    )


def _of_gap(row: LoopCompared, least: LoopCompared, effects: str, identified: Sequence[str]) -> Iterator[str]:
    """Yield what the effect of a gap does to a margin, and why the identified model has another."""
    change = row.flown - row.simulation
    yield (
        f"At {row.at}, where the effect of the gap was computed, the phase margin of axis {row.axis} is "
        f"{row.simulation:.1f} deg in the simulation and {row.flown:.1f} deg with the effect ({effects}), "
        f"which {'takes' if change < 0 else 'adds'} {abs(change):.1f} deg"
    )
    if not math.isfinite(row.model):
        yield (
            f"The identified model's least margin, {least.model:.1f} deg (axis {least.axis} at {least.at}), "
            f"is of another condition; at {row.at} it was not computed: freqid margins MODEL SCENARIO --at "
            f"{row.at} --beside SCENARIO does"
        )
        return
    apart = row.model - row.simulation
    there = (
        f"The identified model has {row.model:.1f} deg there, {abs(apart):.1f} deg "
        f"{'more' if apart > 0 else 'less'} than the simulation"
    )
    if interpolated([row.at], identified):
        yield f"{there}: {interpolation(identified)}"
    else:
        yield f"{there}, {'within' if _holds(row) else 'beyond'} its interval"
    if row.at != least.at:
        yield (
            f"Its least margin, {least.model:.1f} deg (axis {least.axis}), is at {least.at}: another "
            "condition, and an aircraft without the effect"
        )


def _form(models: Sequence[LoopCompared], points: Sequence[StudiedPoint]) -> Iterator[str]:
    """Yield whether noise can be why model and simulation differ where the model was identified."""
    both = [r for r in models if math.isfinite(r.simulation) and math.isfinite(r.lower)]
    if not both:
        return
    off = [r.at for r in both if not _holds(r)]
    most = max(both, key=lambda r: abs(r.model - r.simulation))
    text = (
        f"Where the model was identified ({listed([r.at for r in both])}) it and the simulation differ by at "
        f"most {abs(most.model - most.simulation):.1f} deg ({most.at})"
    )
    if not off:
        yield f"{text}, within the model's interval: noise can be why"
    else:
        why, there, count = _causes([p for p in points if p.id in off]), listed(off), _off(points)
        yield (
            f"{text}, at {listed(off)} by more than the model's interval, so that noise alone is not why"
            + (
                f". Of the {count} parameters of all conditions that are off the simulation's linearisation, "
                f"{_off([p for p in points if p.id in off])} are at {there}: {why}"
                if why
                else ""
            )
        )


def _causes(points: Sequence[StudiedPoint]) -> str:
    """Return how many parameters are off the linearised simulation, by computed cause."""
    return listed([f"{count} by {cause}" for cause, count in causes_of(points).most_common()])


def _off(points: Sequence[StudiedPoint]) -> int:
    return causes_of(points).total()


def _holds(row: LoopCompared) -> bool:
    return row.lower <= row.simulation <= row.upper


def _row(found: LoopMargins, k: int, axis: str, flown: tuple[str, float, float] | None) -> LoopCompared:
    path = f"margins/{axis}/{_FIGURE}"
    known = path in found.figures
    model, lower, upper = found.row(path)[:, k].tolist() if known else (math.nan,) * 3
    simulation, after = (flown[1], flown[2]) if flown else (math.nan, math.nan)
    for name, other in found.beside.items():
        if name.startswith(_SIMULATION) and known and not flown:
            simulation = float(other.estimate[found.figures.index(path), k])
    return LoopCompared(found.ids[k], axis, model, lower, upper, simulation, after)


def _least_axis(found: LoopMargins, k: int) -> str:
    path = least_of(found, k, _FIGURE, found.axes)
    return path.split("/")[1] if path else ""


def _flown(one: ReviewedFile) -> Iterator[tuple[str, str, float, float]]:
    if isinstance(one.result, GapResult) and one.result.how_far:
        least = least_flown(one.result.how_far[0])
        if least is not None and least[0]:
            yield least


def _effects(one: ReviewedFile) -> str:
    known = isinstance(one.result, GapResult) and one.result.how_far
    return " and ".join(one.result.how_far[0].effects) if known else ""

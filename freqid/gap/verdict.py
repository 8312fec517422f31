"""The verdict of a diagnosis in one line, and what stands beside it: the same as tables and page say."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from freqid.core.record import Maneuver
from freqid.core.results.diagnosis import (
    POOR_FORM,
    Closure,
    Existence,
    Interval,
    Place,
    SensorFault,
    ToleranceUsed,
    Which,
)
from freqid.core.results.gap import GapMap
from freqid.gap.infer.evidence import NONE
from freqid.gap.model.candidate import OTHER
from freqid.gap.model.tolerance import DEFAULT, EACH_FLIGHT, TIMING, UNDECLARED, by_clock
from freqid.gap.settings import FORM_TYPICAL
from freqid.gap.simulation import Simulation
from freqid.gap.stack.block import Block
from freqid.simulate.effects.effect import Effect

_FEW = 3  # names that are listed
_POOR_SENSORS = 0.05
_STRAINED = 3.0  # sigmas from which a tolerance is strained: of a hundred, one is off by more than 2.5
_CLOSE = 0.1  # p below which a gap that is not called is said to be a close call
_LESS = 0.1  # of a gap, by which an effect closes less alone than with tolerances before that is said


def verdict(
    gap: Existence,
    where: Sequence[Place],
    cells: GapMap,
    which: Which,
    closures: Sequence[Closure],
    sensors: Sequence[SensorFault],
    library: Mapping[str, Effect],
) -> str:
    """Return the verdict in one line."""
    if gap.unconfirmed:
        return (
            f"No effect is called (p = {gap.p:.2g}), and the simulation is not confirmed: beyond its "
            f"tolerances its terms are wrong by {_by_row(gap, POOR_FORM)}, in ways that no tested effect "
            "explains."
        )
    if not gap.exists:
        return f"No gap beyond noise and tolerances (p = {gap.p:.2g}){_larger_than(gap)}.{_close(gap, which)}"
    words, row = ["A gap beyond noise and tolerances"], ""
    if cells.detectability.any():
        row, share = next(iter(cells.share("row").items()))
        words.append(f", {100 * share:.0f} % of it in {row}")
        low, high = cells.band_of(row)
        words.append(f", mostly {low:.2g}-{high:.2g} Hz")
        words.append(_driven([p for p in where if p.response == row], row, cells))
    words.append(". ")
    faults = list(dict.fromkeys(f.fault for f in sensors))
    if faults:
        words.append(f"Your sensors: {' and '.join(_said(n, which) for n in faults)}. ")
    words.append(f"Your simulation: {_name(which, faults, library, row)}")
    if closures and np.isfinite(closures[0].wrench.G) and (which.named or which.pair):
        words.append(_closed(closures[0], which, faults))
    if closures and which.withdrawn and (off := _strained(closures[0])):
        words.append(f"; without any effect it takes {off} to close it")
    words.append(".")
    words.append(_limited_by_form(gap))
    return "".join(words)


def _driven(places: Sequence[Place], row: str, cells: GapMap) -> str:
    """Return on whose lines a row's gap is, as the end of a sentence; nothing where nothing was injected.

    Signals are named where the largest of the row's places is one of theirs.
    """
    if places and places[0].input:
        return f", on the lines of {_listed([p.input for p in places if p.input])}"
    if not any(cells.inputs):
        return ""
    parts = cells.shares(1, 2)[cells.rows.index(row)]
    if parts[cells.inputs.index("")] < parts.sum() / 2:
        return ", on the lines of many signals"
    mean = ", the mean among them" if cells.band_of(row)[0] == 0 else ""
    return f", on lines that no signal drives{mean}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _closed(closure: Closure, which: Which, faults: Sequence[str]) -> str:
    """Return what goes with the effect, and what tolerances would have to do without it."""
    alone = closure.tolerances_only.G
    same = {*which.named, *which.pair} & set(closure.effects)
    only_sensors = bool(which.named) and set(which.named) <= set(faults)
    it = "both" if len(closure.effects) > 1 else "that fault" if only_sensors else "it"
    what = it if same else " and ".join(closure.effects)
    both, own = closure.wrench.G, closure.effect_only.G
    text = f"; with {what} {100 * both:.0f} % of the gap is closed {closure.scored_text}"
    if np.isfinite(own) and own < both - _LESS:
        text += f", {100 * max(own, 0.0):.0f} % while all that has a tolerance stays nominal"
    if not np.isfinite(alone):
        return text
    strained, without = _strained(closure), "them" if what == "both" else what
    if strained:
        need = f", but only with {strained}"
    elif closure.strained and closure.log_score > 0:
        nats = f"{closure.log_score:.0f} nats"
        need = (
            f", each off by less than {_STRAINED:.0f} times what is stated; so many at once are less likely "
            f"than {what}, by {nats}"
        )
    else:
        need = ""
    return f"{text}. Without {without}, tolerances alone would close {100 * alone:.0f} % of it{need}"


def _strained(closure: Closure) -> str:
    """Return the tolerance that is off most without the effect, where that is strained."""
    strain = next(((n, x) for n, x in closure.strained.items() if abs(x) >= _STRAINED), None)
    return f"{strain[0]} off by {abs(strain[1]):.0f} times its stated tolerance" if strain else ""


def _larger_than(gap: Existence) -> str:
    """Return the sizes that would have been found, a few of them."""
    named = [n for n in ("surface_effectiveness", "actuator_delay", "mass") if n in gap.largest_undetected]
    if not named:
        return ""
    sizes = [f"{n} {_number(gap.largest_undetected[n], gap.unit.get(n, ''))}" for n in named]
    return f": no gap larger than {', '.join(sizes)} (found in 95 of 100 cases)"


def _close(gap: Existence, which: Which) -> str:
    """Return what a gap would be that is nearly called."""
    causes = {n: p for n, p in which.probabilities.items() if n != NONE}
    if gap.p >= _CLOSE or not any(causes.values()):
        return ""
    name = max(causes, key=causes.__getitem__)
    chance = causes[name] / sum(causes.values())
    what = "a change that no effect of the library describes" if name == OTHER else _said(name, which)
    return (
        f" It is a close call: a gap is called up to p = {gap.level:g}. If there is one, its likeliest cause "
        f"is {what} (probability {chance:.2f}); more flights would decide it."
    )


def _limited_by_form(gap: Existence) -> str:
    if gap.form_error < POOR_FORM:
        return ""
    return f" The simulation's terms are wrong in form by {_by_row(gap, POOR_FORM)}, which limits the answer."


def _by_row(gap: Existence, least: float) -> str:
    """Return the errors of form from a least one on, in words."""
    return ", ".join(f"{_percent(f)} in {row}" for row, f in gap.form_errors.items() if f and f >= least)


def _percent(share: float) -> str:
    """Return a share in words, with two digits or more."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def _number(value: float, unit: str) -> str:
    return f"{value:.2g}" + (f" {unit}" if unit not in ("", "1") else "")


def _interval(one: Interval) -> str:
    """Return an estimate with its unit and its interval, with two digits of the interval's width."""
    width = one.hi - one.lo
    digits = max(1 - int(np.floor(np.log10(width))), 0) if width > 0 and np.isfinite(width) else 4
    estimate, lo, hi = (f"{float(f'{x:.{digits}f}'):.6g}" for x in (one.estimate, one.lo, one.hi))
    unit = f" {one.unit}" if one.unit not in ("", "1") else ""
    return f"{estimate}{unit} ({lo} to {hi})"


def _said(effect: str, which: Which) -> str:
    """Return an effect with its place and its size."""
    place = which.places.get(effect, "")
    sizes = which.parameters.get(effect, {})
    at = " ".join(word for word in place.split() if "=" not in word)
    label = f"{effect} of {at}" if at and at != "all" else effect
    found = [x for n, x in sizes.items() if f"{n}=" not in place]  # what was given is not estimated
    return f"{label} {_interval(found[0])}" if len(found) == 1 else label


def _name(which: Which, faults: Sequence[str], library: Mapping[str, Effect], row: str) -> str:
    """Return what the simulation lacks, and how much of the row that holds most of the gap that is."""
    if which.withdrawn:
        name, why = next(iter(which.withdrawn.items()))
        return f"no name; {name} fits best but {why}"
    if which.pair:
        rest = [n for n in which.pair if n not in faults]
        return " and ".join(_said(n, which) for n in rest) or "nothing beside that"
    if which.named:
        rest = [n for n in which.named if n not in faults]
        if not rest:
            return "nothing beside that"
        if len(which.named) > 1:
            return (
                f"one of {', '.join(_said(n, which) for n in which.named)}, which these data cannot separate"
            )
        chance = which.probabilities.get(rest[0], 0.0)
        effect = library.get(rest[0])
        meaning = f" ({effect.signed_meaning(which.changes(effect.id))})" if effect else ""
        share = which.moves.get(rest[0], {}).get(row, 0.0)
        large = f", {_percent(share)} of the changes in {row}" if share else ""
        return f"{_said(rest[0], which)}{meaning}{large}, probability {chance:.2f}"
    name, chance = next((n, p) for n, p in which.probabilities.items() if n != NONE)
    if name == OTHER:
        if own := which.parameters.get(OTHER):
            parameter, i = next(iter(own.items()))
            size = _interval(i)
            return f"no effect of the library explains it; its own parameter {parameter} does, off by {size}"
        return f"no effect of the library explains it ({100 * chance:.0f} % for another)"
    rest = [n for n in which.set if n not in (NONE, OTHER)]
    listed = ", ".join(rest[:_FEW]) + (f" and {len(rest) - _FEW} more" if len(rest) > _FEW else "")
    return f"no single name; {listed} remain possible"


def remarks_of(
    used: Sequence[Block],
    simulation: Simulation,
    gap: Existence,
    relations: Mapping[str, float],
    *,
    tried: bool,
) -> Iterator[str]:
    """Yield what records and simulation leave untold.

    Parameters
    ----------
    used : sequence of Block
    simulation : Simulation
    gap : Existence
    relations : dict of float
        Error of form of the relations between sensors, by what each is the rate of.
    tried : bool
        Whether there is more than one record.
    """
    if not any(b.lines.inputs for b in used):
        yield "the records hold no injected signals: where a gap lies by input cannot be told"
    if not any(row.kind == "kinematic" for b in used for row in b.rows):
        yield "without velocities, specific forces and attitude, faults of the sensors cannot be told apart"
    if not any(b.trial.positions for b in used):
        yield f"{simulation.name} has no actuators: what happens between command and position is not tested"
    if not simulation.tolerances:
        yield (
            "the simulation states no tolerances of its own: a share of each derivative and of each "
            "actuator's time stands in for them"
        )
    for block in used:
        if block.motion.source == "smoothed record":
            yield (
                f"{block.names[0]}: no model follows its motion, so effects are computed on the smoothed "
                "record, which shares its noise"
            )
        elif block.motion.source.endswith("smoothed"):
            yield (
                f"{block.names[0]}: no model follows its motion in one plane, so effects there are computed "
                "on the smoothed record, which shares its noise"
            )
    poor = {name: error for name, error in relations.items() if error >= _POOR_SENSORS}
    if poor:
        shares = ", ".join(f"{100 * error:.0f} % of d{name}/dt" for name, error in poor.items())
        yield f"the sensors contradict each other: {shares}; they count as little there"
    if not tried:
        yield "one manoeuvre only: what is said of it was not tried on another"
    if gap.form_error:
        yield (
            f"the records show an error of form of about {_by_row(gap, 0.0)} in the simulation's terms, "
            "which is allowed for"
        )
    else:
        yield (
            "the records show no error of form in the simulation's terms beyond the "
            f"{_percent(FORM_TYPICAL)} that is allowed for in every one"
        )
    yield f"noise learned from {' and from '.join(gap.noise_from)}"


def tolerances_used(
    sizes: Mapping[str, float],
    simulation: Simulation,
    library: Mapping[str, Effect],
    maneuver: Maneuver | None = None,
    given: Collection[str] = (),
) -> tuple[ToleranceUsed, ...]:
    """Return the tolerances that were allowed for, with their units and where each comes from.

    Parameters
    ----------
    sizes : dict of float
        One sigma by name, of `freqid.gap.model.tolerance.stated`.
    simulation : Simulation
    library : dict of Effect
        Of the vehicle at hand.
    maneuver : Maneuver, optional
        Its clock tells when a channel was taken, where nothing is stated; offsets of sensors that it lacks
        are left out.
    given : collection of str
        Names that are known to be stated; of others the size tells.
    """
    own = simulation.tolerances
    silent = {**DEFAULT, **UNDECLARED}
    found = []
    for name, sigma in sizes.items():
        if not sigma or (maneuver is not None and name in EACH_FLIGHT and not _logged(name, maneuver)):
            continue
        if name in EACH_FLIGHT:
            source = "each record"
        elif name in given:
            source = "stated"
        elif name in own and sigma == own[name].sigma:
            source = "simulation"
        else:
            source = "default" if name not in own and silent.get(name) == sigma else "stated"
        found.append(ToleranceUsed(name, float(sigma), _unit_of(name, simulation, library), source))
    if maneuver is not None:
        known = [n for n in TIMING if n in library and n not in sizes]
        found += [ToleranceUsed(n, by_clock(maneuver.record.dt), "s", "clock") for n in known]
    return tuple(found)


def _logged(offset: str, maneuver: Maneuver) -> bool:
    """Return whether a manoeuvre has the sensor of an offset, or an effector of that kind; air is in all."""
    effect, _, sensor = offset.partition(".")
    kinds, record = maneuver.vehicle.effector_kinds, maneuver.record
    of_kind = any(kinds.get(n) == sensor for n in record.group("effector"))
    return effect != "sensor_bias" or of_kind or any(f"{g}/{sensor}" in record for g in ("state", "air"))


def _unit_of(name: str, simulation: Simulation, library: Mapping[str, Effect]) -> str:
    if name in simulation.tolerances:
        return simulation.tolerances[name].unit
    effect, _, parameter = name.partition(".")
    if effect not in library:
        return "1"  # shares: of a derivative, a servo's or a rotor's number
    parameters = library[effect].parameters
    return parameters[parameter or next(iter(parameters))].unit

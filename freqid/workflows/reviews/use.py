"""What a set of results may be used for: which speeds, axes, frequencies and sizes of input were shown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from freqid.blend.corridor_study import GOOD_R2, MOST_VALIDATION, StudiedPoint, StudyResults
from freqid.core.channels import AIR, STATE
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.review import Use
from freqid.core.results.judged.truth import BEYOND
from freqid.core.results.loop_margins import LoopMargins
from freqid.core.results.point import ResponseModel
from freqid.core.sections.identification import factors_of
from freqid.core.vehicle import Effector, Vehicle
from freqid.workflows.reviews.gap_grounds import least_flown, listed
from freqid.workflows.reviews.grounds import said
from freqid.workflows.reviews.loops import interpolated, interpolation
from freqid.workflows.reviews.read_together import ReviewedFile

_LARGER = 1.25
"""Motion of a predicted flight over that of the flight that was fitted, from which it is called larger."""
_PLURAL = {
    "surface": "surfaces",
    "tilt": "tilts",
    "rotor": "rotors",
    "thrust": "thrusts",
    "throttle": "throttles",
}
_SHOWN = {"rad": ("deg", 180 / math.pi), "rad/s": ("rpm", 30 / math.pi)}


def uses_of(files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]) -> Iterator[Use]:
    """Yield what the files show the model, the simulation and the margins to be good for.

    Parameters
    ----------
    files : sequence of ReviewedFile
    points : sequence of StudiedPoint
        All point models among them.
    """
    if points:
        yield Use("Model: what for", _what_for(points))
        yield Use("Model: speeds and tilts", _where(files, points))
        yield Use("Model: axes", _axes(points))
        if band := _band(points):
            yield Use("Model: frequencies", band)
        if size := _size(files, points):
            yield Use("Model: size of inputs", size)
    for one in files:
        if isinstance(one.result, GapResult):
            yield Use("Simulation", _simulation(one.result))
    if known := _margins(files, points):
        yield Use("Margins of the control law", known)


def _what_for(points: Sequence[StudiedPoint]) -> str:
    """Return what the terms of the models can say, and what they cannot."""
    every = {n: None for p in points for r in p.model.responses.values() for n in r.regressors}
    products = [n for n in every if len(factors_of(n)) > 1]
    motions = [n for n in every if (n in STATE or n in AIR) and n not in products]
    others = len(every) - len(motions) - len(products)
    terms = [listed(motions)] if motions else []
    terms += [f"{others} inputs" if others != 1 else "1 input"] if others else []
    on = f"changes of the loads with {' and '.join(terms)}"
    if products:
        return f"stability, margins and responses to inputs, as {on}, with {len(products)} products of them"
    return f"stability, margins and responses to inputs, as linear {on}; not large manoeuvres"


def _where(files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]) -> str:
    """Return the conditions in words, and whether the model was tried between them."""
    each = [_condition(p) for p in points]
    text = f"small motion about the trims of {listed(each)}"
    studies = [one.result for one in files if isinstance(one.result, StudyResults)]
    blended = any(s.model is not None for s in studies)
    tried = [h.reference.id for s in studies for h in s.held_out]
    if not blended:
        return f"{text}; not between them, as no global model is among the files" if len(each) > 1 else text
    if tried:
        return f"{text}; between them by the global model, which was tried at {listed(tried)}; not outside"
    return f"{text}; between them by the global model, which no flight has tried there; not outside"


def _condition(point: StudiedPoint) -> str:
    at, units = point.model.reference, point.model.scheduled_units
    parts = [f"{at.u:.3g} m/s"] if math.isfinite(at.u) else []
    alike: dict[str, list[str]] = {}
    for name, value in at.scheduled.items():
        unit, factor = _SHOWN.get(units.get(name, "rad"), (units.get(name, "rad"), 1.0))
        alike.setdefault(f"{factor * value:.3g} {unit}", []).append(name)
    parts += [f"{listed(names)} {value}" for value, names in alike.items()]
    return f"{point.id or 'one condition'} ({', '.join(parts)})" if parts else point.id or "one condition"


def _axes(points: Sequence[StudiedPoint]) -> str:
    """Return of which responses the model is good enough, where, and of which it was not shown."""
    where: dict[str, list[str]] = {}
    flown: dict[str, list[str]] = {}
    for p in points:
        for name, r in p.model.responses.items():
            flown.setdefault(name, []).append(p.id)
            if r.r2 >= GOOD_R2 and not p.validation_ratio(name) > MOST_VALIDATION:
                where.setdefault(name, []).append(p.id)
    whole = [said(n) for n in flown if where.get(n) == flown[n]]
    some = [f"{said(n)} only at {listed(where[n])}" for n in flown if n in where and where[n] != flown[n]]
    none = [said(n) for n in flown if n not in where]
    tried = any(math.isfinite(p.validation_ratio(n)) for p in points for n in p.model.responses)
    asked = f"{100 * GOOD_R2:g} % or more explained" + (
        f", and a new flight predicted with at most {MOST_VALIDATION:g} times the error of the fit"
        if tried
        else "; no new flight was predicted"
    )
    texts = [
        f"{listed(whole)} at every condition ({asked})" if whole else f"none at every condition ({asked})"
    ]
    texts += some
    if none:
        texts.append(f"not {listed(none)}")
    return "; ".join(texts)


def _band(points: Sequence[StudiedPoint]) -> str:
    """Return the frequencies that all responses were fitted on at all conditions."""
    ends = [
        r.fit["frequency"].axis[[0, -1]]
        for p in points
        for r in p.model.responses.values()
        if "frequency" in r.fit
    ]
    if not ends:
        return ""
    low, high = max(float(e[0]) for e in ends), min(float(e[1]) for e in ends)
    return f"{low:.2g} to {high:.2g} Hz; slower and faster motion was not fitted" if low < high else ""


def _size(files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]) -> str:
    """Return how large the inputs were that the model holds for, and whether larger ones were tried."""
    texts = [*_inputs(points, _vehicle(files, points))]
    if not texts:
        return ""
    text = f"as small as flown, {listed(texts)}"
    ratios = [
        float(np.std(p.model.prediction[n].measured) / np.std(r.fit["time"].measured))
        for p in points
        for n, r in p.model.responses.items()
        if n in p.model.prediction and "time" in r.fit and np.std(r.fit["time"].measured) > 0
    ]
    if ratios:
        larger = max(ratios) > _LARGER
        text += (
            f"; the new flights that were predicted moved the vehicle {min(ratios):.2g} to "
            f"{max(ratios):.2g} times as much, so larger inputs were {'tried' if larger else 'not tried'}"
        )
    return text + _amplitude(points)


def _inputs(points: Sequence[StudiedPoint], vehicle: Vehicle | None) -> Iterator[str]:
    """Yield the rms of the effectors by kind, and the share of their range that it is."""
    known: dict[str, Effector] = {e.name: e for e in vehicle.effectors} if vehicle is not None else {}
    moved: dict[str, dict[str, list[float]]] = {}
    for p in points:
        for r in p.model.responses.values():
            for name, rms in zip(r.regressors, r.regressor_rms, strict=True):
                if name in known and math.isfinite(rms):
                    moved.setdefault(known[name].kind, {}).setdefault(name, []).append(float(rms))
    units = {n: u for p in points for r in p.model.responses.values() for n, u in _units(r)}
    for kind, each in moved.items():
        unit, factor = _SHOWN.get(units[next(iter(each))], (units[next(iter(each))], 1.0))
        every = [factor * x for values in each.values() for x in values]
        share = max(max(values) / _half_range(known[n]) for n, values in each.items())
        yield (
            f"{_PLURAL[kind]} {min(every):.3g} to {max(every):.3g} {unit} rms "
            f"({100 * share:.2g} % of half their range at most)"
        )


def _units(response: ResponseModel) -> Iterator[tuple[str, str]]:
    yield from zip(response.regressors, response.regressor_units, strict=True)


def _half_range(effector: Effector) -> float:
    return (effector.limits[1] - effector.limits[0]) / 2


def _vehicle(files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]) -> Vehicle | None:
    of_study = [one.result.vehicle for one in files if isinstance(one.result, StudyResults)]
    return next((v for v in [*of_study, *(p.model.aircraft for p in points)] if v is not None), None)


def _amplitude(points: Sequence[StudiedPoint]) -> str:
    """Return how many parameters depend on the size of the inputs, where flights without noise tell."""
    depends, count, scale = 0, 0, math.nan
    for p in points:
        for name, r in p.model.responses.items():
            truth = p.truth.get(name)
            if truth is None or truth.regressors != r.regressors:
                continue
            scale = truth.scale
            with np.errstate(divide="ignore", invalid="ignore"):
                moved = np.abs(truth.parts(r.estimate)["amplitude"] / r.std_error)
            depends, count = depends + int((moved > BEYOND).sum()), count + len(r.regressors)
    if not count:
        return ""
    return (
        f"; {depends} of {count} parameters differ by more than {BEYOND:g}σ from those at {scale:.3g} "
        "times these inputs, so the model is that of this size"
    )


def _simulation(gap: GapResult) -> str:
    """Return with which change, where and up to which frequency a simulation was held against flights."""
    hz = [float(s.hz[-1]) for s in gap.spectra if len(s.hz)]
    there = f"near {listed(gap.cells.regimes)}" if gap.cells.regimes else "for the flights of the diagnosis"
    band = f", up to {max(hz):.2g} Hz" if hz else ""
    where = f"{there}{band}: no flight says how it is elsewhere"
    named = gap.which.pair or gap.which.named
    if not gap.gap.exists:
        return f"as it is, {where}"
    if not named:
        return f"not until the cause of the gap has a name; it was held against flights {there}{band}"
    return f"with the change that was found ({' and '.join(named)}) only, {where}"


def _margins(files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]) -> str:
    """Return at which conditions margins are known, at which they are interpolated, and of which aircraft."""
    ids = [at for one in files if isinstance(one.result, LoopMargins) for at in one.result.ids]
    identified = [p.id for p in points]
    between = interpolated(ids, identified)
    known = [at for at in dict.fromkeys(ids) if at not in between]
    texts = []
    if known and identified:
        texts.append(f"known with the identified model at {listed(known)}")
    elif known:
        texts.append(
            f"computed with the identified model at {listed(known)}; no point model among the files says "
            "which of these were identified"
        )
    if between:
        texts.append(f"not known at {listed(between)}: {interpolation(identified)}")
    for one in files:
        if isinstance(one.result, GapResult) and one.result.how_far:
            least = least_flown(one.result.how_far[0])
            if least is not None and least[0]:
                texts.append(f"with the effect of the gap at {least[0]} alone")
    return "; ".join(texts)

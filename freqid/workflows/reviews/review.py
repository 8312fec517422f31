"""What follows from a set of results for their use: answers, open risks, what would overturn them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from freqid.blend.corridor_study import StudiedPoint, StudyResults, doubts_of_points, left_to_noise
from freqid.core.blas import on_one_thread
from freqid.core.errors import DataError, UsageError
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.doubt import DOUBT_KINDS
from freqid.core.results.judged.review import (
    Change,
    Decision,
    Ground,
    Limit,
    Quantity,
    Reversal,
    Review,
    Source,
    Subject,
    Trust,
    WorstFit,
)
from freqid.core.results.loop_margins import LoopMargins, least_of
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.workflows.inputs import File, scenario_of
from freqid.workflows.reviews.gap_grounds import vehicle_differs
from freqid.workflows.reviews.grounds import grounds_of, rules
from freqid.workflows.reviews.loops import loops_compared, why_loops_differ
from freqid.workflows.reviews.read_together import ReviewedFile, read_together, vehicle_of
from freqid.workflows.reviews.use import uses_of

_NO_MARGINS = "no margins of the control law are among the files"
_SUBJECTS: tuple[Subject, ...] = ("model", "simulation", "next flight")
_MISSING = {
    "excitation": "freqid design-inputs SCENARIO -o design.h5",
    "data": "freqid quicklook LOG design.h5 --scenario SCENARIO",
    "points": "freqid identify-point RECORD --scenario SCENARIO -o point.h5",
    "convergence": "freqid study SCENARIO -o FOLDER",
    "global": "freqid global-blend points/*.h5 -o aircraft.h5",
    "flights": "freqid predict point.h5 design.h5 --scenario SCENARIO, then freqid score",
    "responses": "freqid frequency-response RECORD --scenario SCENARIO",
    "margins": "freqid margins aircraft.h5 SCENARIO",
    "gap": "freqid diagnose-gap RECORD --holdout OTHER --sim model.py:wrench -o gap.h5",
}
"""By section of the report: the command that makes what it is about."""
SECTION_OF = {
    "freqid-study": "convergence",
    "freqid-design": "excitation",
    "freqid-record": "data",
    "freqid-quicklook": "data",
    "freqid-point": "points",
    "freqid-output-error": "points",
    "freqid-global": "global",
    "freqid-advance-ratio": "global",
    "freqid-prediction": "flights",
    "freqid-score": "flights",
    "freqid-frequency-response": "responses",
    "freqid-loop-margins": "margins",
    "freqid-gap": "gap",
    "freqid-rivals": "gap",
    "freqid-trial": "gap",
}
"""Section of the report that a file belongs to, by its format."""


@on_one_thread
def review(
    files: File | Sequence[File] | Sequence[ReviewedFile],
    *,
    scenario: Scenario | File | None = None,
    against: File | Sequence[File] = (),
) -> Review:
    """Return what follows from a set of results: use or do not use, and why.

    Parameters
    ----------
    files : path, or several
        Results in any mixture, and folders of studies; all of one vehicle.
    scenario : Scenario, path or name, optional
        Its gates count.
    against : path, or several
        An older set of files, or the review of one, to say what has changed.

    Returns
    -------
    Review

    Raises
    ------
    UsageError
        Where nothing is given.
    DataError
        Where a file cannot be read, or two are of different vehicles.

    Examples
    --------
    >>> review(["point.h5", "gap.h5"]).decisions  # doctest: +SKIP
    """
    given = [files] if isinstance(files, str) or not isinstance(files, Sequence) else list(files)
    read = tuple(one for one in given if isinstance(one, ReviewedFile))
    every = read or read_together([one for one in given if not isinstance(one, ReviewedFile)])
    described = scenario_of(scenario) if scenario is not None else None
    gates = described.gates if described is not None else None
    grounds = sorted(grounds_of(every, gates), key=lambda g: ("stop", "risk", "good").index(g.weight))
    points = _points(every)
    conditions = tuple(dict.fromkeys(p.model.reference.id for p in points))
    loops = loops_compared(every)
    found = Review(
        vehicle=next(
            (name for one in every if (name := vehicle_of(one.result))),
            described.aircraft().name if described is not None else "",
        ),
        decisions=tuple(_decide(subject, grounds, every) for subject in _SUBJECTS),
        envelope=tuple(_envelope(points)),
        conditions=conditions,
        grounds=tuple(grounds),
        reversals=tuple(_reversals(grounds)),
        missing=_missing(every),
        sources=tuple(_sources(every, described)),
        quantities=dict(_quantities(every, points)),
        worst_fit=_worst_fit(points),
        trust=_trust(points),
        loops=loops,
        loops_text=why_loops_differ(loops, every, points),
        uses=tuple(uses_of(every, points)),
        rules=rules(),
        vehicle_text=tuple(
            text
            for one in every
            if isinstance(one.result, GapResult)
            for text in vehicle_differs(one.result, one.source.name)
        ),
    )
    old = [against] if isinstance(against, str) or not isinstance(against, Sequence) else list(against)
    return _compared(found, old) if old else found


def _sources(files: Sequence[ReviewedFile], scenario: Scenario | None) -> Iterator[Source]:
    """Yield every file that was read, with its hash: those that a study holds stand behind it."""
    for one in files:
        yield one.source
        yield from one.held
    if scenario is not None and scenario.file:
        yield Source(Path(scenario.file).name, "scenario", scenario.sha256)


def _points(files: Sequence[ReviewedFile]) -> list[StudiedPoint]:
    """Return the point models among files, those of studies with what these know beside."""
    found: dict[str, StudiedPoint] = {}
    for one in files:
        if isinstance(one.result, StudyResults):
            found |= {f"{one.source.name} {p.id}": p for p in one.result.points}
    for one in files:
        model = one.result.point if isinstance(one.result, OutputErrorModel) else one.result
        if isinstance(model, PointModel):
            found[one.source.name] = StudiedPoint(model, {}, {}, np.zeros(0), {})
    return list(found.values())


def _worst_fit(points: Sequence[StudiedPoint]) -> WorstFit | None:
    """Return the response with the least R2 over all conditions, and where in frequency it fits worst."""
    every = [(p.id, r) for p in points for r in p.model.responses.values() if math.isfinite(r.r2)]
    if not every:
        return None
    at, least = min(every, key=lambda one: one[1].r2)
    fit = least.fit.get("frequency")
    band = fit.worst_band if fit is not None else None
    ends = (band.low_hz, band.high_hz, band.over_noise, band.share) if band is not None else (math.nan,) * 4
    ceiling = math.nan if least.r2_ceiling is None else least.r2_ceiling
    return WorstFit(at, least.response, least.r2, ceiling, *ends)


def _trust(points: Sequence[StudiedPoint]) -> Trust | None:
    """Return how many parameters of all conditions cannot be trusted, by reason."""
    doubts = [d for _, d in doubts_of_points(points)]
    count = sum(len(r.regressors) for p in points for r in p.model.responses.values())
    if not count:
        return None
    wide, collinear, missing = (sum(k in d.kinds for d in doubts) for k in DOUBT_KINDS)
    off = [d.miss.of for d in doubts if d.miss is not None]
    both = off.count("both")
    return Trust(
        count,
        len(doubts),
        sum(d.matters for d in doubts),
        wide,
        collinear,
        missing,
        dict(Counter(" and ".join(d.kinds) for d in doubts).most_common()),
        off.count("linearisation") + both,
        off.count("noise-free estimate") + both,
        both,
        left_to_noise(points),
    )


def _decide(subject: Subject, grounds: Sequence[Ground], files: Sequence[ReviewedFile]) -> Decision:
    """Return the answer that the grounds of a subject leave: the worst of them decides."""
    of = [g for g in grounds if g.subject == subject]
    if not of:
        nothing = {
            "model": "there is no model among the files",
            "simulation": "no simulation was held against a flight",
            "next flight": _NO_MARGINS,
        }
        return Decision(subject, "not decided", nothing[subject])
    if subject == "model" and all(one.unfinished for one in files):
        return Decision(subject, "not decided", f"{of[0].text}; it has no model yet")
    stops = [g for g in of if g.weight == "stop"]
    risks = [g for g in of if g.weight == "risk"]
    if stops:
        more = f". {_counted(len(stops) - 1, 'more reason')} against it" if len(stops) > 1 else ""
        return Decision(subject, "do not use", f"{stops[0].text}{more}")
    if subject == "next flight" and not any(isinstance(one.result, LoopMargins) for one in files):
        return Decision(subject, "not decided", f"{_NO_MARGINS}; {risks[0].text}" if risks else _NO_MARGINS)
    if risks:
        first = ", the first" if len(risks) > 1 else ""
        because = f"{_counted(len(risks), 'open risk')}{first}: {risks[0].text}"
        return Decision(subject, "use with limits", because)
    return Decision(subject, "use", of[0].text)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"


def _envelope(points: Sequence[StudiedPoint]) -> Iterator[Limit]:
    """Yield what the identified conditions span, and what moved there."""
    if not points:
        return
    at = [p.model.reference for p in points]
    sides: dict[str, tuple[str, list[float]]] = {
        "u": ("m/s", [r.u for r in at]),
        "air density": ("kg/m3", [r.rho for r in at]),
    }
    for p in points:
        for name, value in p.model.reference.scheduled.items():
            sides.setdefault(name, (p.model.scheduled_units.get(name, "rad"), []))[1].append(value)
    for p in points:
        for response in p.model.responses.values():
            for name, unit, rms in zip(
                response.regressors, response.regressor_units, response.regressor_rms, strict=True
            ):
                if name in ("u", "v", "w", "p", "q", "r"):
                    sides.setdefault(f"{name}, rms of its motion", (unit, []))[1].append(float(rms))
    lines = [
        fit.axis[[0, -1]]
        for p in points
        for r in p.model.responses.values()
        for n, fit in r.fit.items()
        if n == "frequency"
    ]
    if lines:
        sides["frequency"] = ("Hz", np.concatenate(lines).tolist())
    for name, (unit, values) in sides.items():
        known = [v for v in values if math.isfinite(v)]
        if known:
            yield Limit(name, min(known), max(known), unit)


def _reversals(grounds: Sequence[Ground]) -> Iterator[Reversal]:
    """Yield each figure beyond its bound, what forbids use first; then of each kind the nearest to it."""
    every = [replace(f, subject=g.subject) for g in grounds for f in g.figures if math.isfinite(f.now)]
    beyond = [f for f in every if f.room < 0]
    yield from sorted(beyond, key=lambda f: (("stop", "risk", "good").index(f.weight), f.room_share))
    nearest: dict[tuple[str, str, float], Reversal] = {}
    for f in sorted((f for f in every if f.room >= 0), key=lambda f: f.room_share):
        nearest.setdefault((f.subject, f.text, f.bound), f)
    yield from nearest.values()


def _missing(files: Sequence[ReviewedFile]) -> dict[str, str]:
    have = {SECTION_OF.get(one.kind) for one in files if not one.unfinished}
    if any(isinstance(one.result, StudyResults) for one in files):
        have |= {"points", "global", "excitation"}
    return {section: command for section, command in _MISSING.items() if section not in have}


def _quantities(
    files: Sequence[ReviewedFile], points: Sequence[StudiedPoint]
) -> Iterator[tuple[str, Quantity]]:
    """Yield the numbers that releases are compared by: parameters, margins, probabilities, closures."""
    for p in points:
        for name, r in p.model.responses.items():
            for j, regressor in enumerate(r.regressors):
                value, error = float(r.estimate[j]), float(r.std_error[j])
                if math.isfinite(value):
                    known = error if math.isfinite(error) else 0.0
                    yield f"{p.id} {name} {regressor}", Quantity(value, known, r.parameter_units[j])
            yield f"{p.id} R2 of {name}", Quantity(r.r2, 0.0, "1")
    for one in files:
        result = one.result
        if isinstance(result, OutputErrorModel):
            for name, unit, value, error in zip(
                result.names, result.units, result.estimate, result.std_error, strict=True
            ):
                known = float(error) if math.isfinite(error) else 0.0
                yield f"{result.model} {name}", Quantity(float(value), known, unit)
        if isinstance(result, LoopMargins):
            for figure, unit in (("phase_deg", "deg"), ("gain_up_db", "dB")):
                for k, at in enumerate(result.ids):
                    path = least_of(result, k, figure, result.axes)
                    if path:
                        value, low, high = result.row(path)[:, k].tolist()
                        spread = (high - low) / 3.92 if math.isfinite(high - low) else 0.0
                        label = f"{at} least {figure.split('_')[0]} margin"
                        yield label, Quantity(value, spread, unit)
        if isinstance(result, GapResult):
            for name, chance in result.which.probabilities.items():
                yield f"probability of {name}", Quantity(chance, 0.0, "1")
            if result.how_far and math.isfinite(result.how_far[0].wrench.G):
                g = result.how_far[0].wrench
                yield "share of the gap that is closed", Quantity(g.G, (g.hi - g.lo) / 3.92, "1")


_TELL_FROM = 0.005  # of a number without a standard error: less is called the same
_BEYOND = 2.0  # standard errors from which two numbers differ


def _compared(new: Review, old_files: Sequence[File]) -> Review:
    """Return a review with what has changed since an older one."""
    read = read_together(old_files)
    if len(read) == 1 and isinstance(read[0].result, Review):
        old = read[0].result
    elif any(isinstance(one.result, Review) for one in read):
        raise UsageError(
            "an older review is given together with other files", remedy="give the review, or the files"
        )
    else:
        old = review(read)
    if old.vehicle and new.vehicle and old.vehicle != new.vehicle:
        raise DataError(
            f"is of '{old.vehicle}', but what is reported is of '{new.vehicle}'",
            where=str(old_files[0]),
            remedy="compare with an older set of the same vehicle",
        )
    changes = [
        Change(f"answer on the {a.subject}", b.answer, a.answer)
        for a in new.decisions
        for b in old.decisions
        if a.subject == b.subject and a.answer != b.answer
    ]
    numbers, both = [], 0
    for label, now in new.quantities.items():
        before = old.quantities.get(label)
        if before is None:
            continue
        both += 1
        spread = math.hypot(now.std_error, before.std_error)
        apart = now.value - before.value
        sigmas = apart / spread if spread else math.nan
        told = abs(sigmas) > _BEYOND if spread else abs(apart) > _TELL_FROM * max(abs(before.value), 1e-12)
        if told:
            unit = "" if now.unit == "1" else f" {now.unit}"
            numbers.append(Change(label, f"{before.value:.4g}{unit}", f"{now.value:.4g}{unit}", sigmas))
    numbers.sort(key=lambda c: -abs(c.sigmas) if math.isfinite(c.sigmas) else 0.0)
    gone = sorted({k.split(" ")[0] for k in old.quantities} - {k.split(" ")[0] for k in new.quantities})
    came = sorted({k.split(" ")[0] for k in new.quantities} - {k.split(" ")[0] for k in old.quantities})
    changes += [Change(f"condition or model {name}", "there", "not there") for name in gone]
    changes += [Change(f"condition or model {name}", "not there", "there") for name in came]
    name = ", ".join(one.source.name for one in read)
    compared = [replace(s, kind=f"{s.kind}, compared with") for o in read for s in (o.source, *o.held)]
    return replace(
        new,
        against=name,
        changes=(*changes, *numbers),
        compared=both,
        sources=(*new.sources, *compared),
    )

"""Several results as one page: what each file adds, and where it stands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from markupsafe import Markup

from freqid.blend.corridor_study import StudiedPoint, StudyResults
from freqid.core.errors import FreqidError
from freqid.core.record import FlightRecord
from freqid.core.results.design import ClassicDesign, MultisineDesign
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.review import Review
from freqid.core.results.judged.sealed_trial import TrialOutcome
from freqid.core.results.loop_margins import LoopMargins
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.core.vehicle import Inertia, MassProperties, Vehicle
from freqid.report.kit.rendering import Sheet
from freqid.report.margins.page import build_margins_page
from freqid.report.review.page import Piece, build_review_page
from freqid.report.review.points import build_points_sheet
from freqid.report.review.single import (
    build_design_sheet,
    build_output_error_sheet,
    build_record_sheet,
    build_trial_sheet,
    test_card_of,
)
from freqid.report.review.vehicle import vehicle_values
from freqid.report.study.page import build_study_page
from freqid.workflows.files import read_scenario
from freqid.workflows.inputs import File, Tell, scenario_of, silent
from freqid.workflows.reviews.read_together import ReviewedFile, read_together
from freqid.workflows.reviews.review import SECTION_OF, review


def report_page(
    files: Sequence[File],
    page_of: Callable[[object], Sheet],
    *,
    scenario: Scenario | File | None = None,
    against: Sequence[File] = (),
    tell: Tell = silent,
) -> tuple[Sheet, Review]:
    """Return the page of several files, and the review that its page one shows.

    Parameters
    ----------
    files : sequence of path
    page_of : callable
        Returns the page of one result.
    scenario : Scenario, path or name, optional
        Draws the vehicle, and its gates count.
    against : sequence of path
        Older files, or an older review.
    tell : callable
        Told what is being drawn.

    Raises
    ------
    UsageError, DataError
        As `freqid.workflows.reviews.review.review`.
    """
    tell("reading")
    every = read_together(files)
    described = scenario_of(scenario) if scenario is not None else None
    decided = review(every, scenario=described, against=against)
    drawn_by = described or _own_scenario(every)
    points = [p for one in every if isinstance(one.result, StudyResults) for p in one.result.points]
    alone = [m for one in every if (m := _point_of(one)) is not None]
    models = [*(p.model for p in points), *alone]
    vehicle = next((v for one in every if (v := _vehicle_of(one)) is not None), None)
    pieces = list(_pieces(every, alone, page_of, drawn_by, vehicle, decided, tell))
    values = vehicle_values(vehicle or (drawn_by.aircraft() if drawn_by else None), models, drawn_by)
    values["drawn"] = drawn_by is not None and any("Three-view" in p.svg for p in values["pictures"])
    tell("page one")
    return build_review_page(decided, pieces, values, _notes(every)), decided


def _pieces(
    files: Sequence[ReviewedFile],
    alone: Sequence[PointModel],
    page_of: Callable[[object], Sheet],
    scenario: Scenario | None,
    vehicle: Vehicle | None,
    decided: Review,
    tell: Tell,
) -> Iterator[Piece]:
    """Yield what each file adds, the files of a section in their order."""
    if alone:
        tell("point models")
        yield Piece("points", "Point models", build_points_sheet(_together(alone, vehicle)))
    for place, one in enumerate(files):
        name, result = one.source.name, one.result
        tell(f"{name}, {place + 1} of {len(files)}")
        section = SECTION_OF.get(one.kind, "")
        if isinstance(result, StudyResults):
            if result.design is not None:
                for key, design in {"design.h5": result.design, **result.own_designs}.items():
                    yield _design_piece(design, result.vehicle, scenario, key, one.path.parent / key)
            tell(f"{len(result.points)} conditions of {name}")
            yield Piece("points", name, build_points_sheet(result))
            tell(f"convergence of {name}")
            yield Piece("convergence", name, build_study_page(result, ("conditions", "length")))
            if result.model is not None:
                tell(f"global model of {name}")
                yield Piece("global", "model.h5", build_study_page(result, ("corridor", "held-out")))
        elif isinstance(result, MultisineDesign | ClassicDesign):
            yield _design_piece(result, vehicle, scenario, name, one.path)
        elif isinstance(result, FlightRecord):
            yield Piece(section, name, build_record_sheet(result))
        elif isinstance(result, OutputErrorModel):
            yield Piece(section, name, build_output_error_sheet(result))
        elif isinstance(result, TrialOutcome):
            yield Piece(section, name, build_trial_sheet(result))
        elif isinstance(result, LoopMargins):
            others = [
                g
                for g in decided.grounds
                if g.subject == "next flight" and g.weight != "good" and g.source != name
            ]
            sheet = build_margins_page(result, others, decided.conditions)
            assert isinstance(sheet, Sheet)
            yield Piece(section, name, sheet)
        elif section and not isinstance(result, PointModel) and not one.unfinished:
            yield Piece(section, name, page_of(result))


def _design_piece(
    design: MultisineDesign | ClassicDesign,
    vehicle: Vehicle | None,
    scenario: Scenario | None,
    name: str,
    path: Path,
) -> Piece:
    import hashlib

    sha256 = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    sheet = build_design_sheet(design, vehicle, scenario, name, sha256)
    card = test_card_of(design, scenario) if scenario is not None and scenario.excitation is not None else ""
    if card:
        card_html = Markup(
            '<details><summary>Test card</summary><pre class="card">{}</pre></details>'
        ).format(card)
        sheet.after = card_html
    return Piece("excitation", name, sheet)


def _notes(files: Sequence[ReviewedFile]) -> dict[str, str]:
    """Return what is not there of files that are, by section."""
    notes = {}
    for one in files:
        if one.unfinished:
            notes["convergence"] = (
                f"The study in {one.source.name} is not finished, it has no study.h5: only the models that "
                "are done stand here. The same freqid study command goes on from there."
            )
        if isinstance(one.result, GapResult) and one.result.gap.exists and not one.result.how_far:
            notes["gap"] = (
                f"{one.source.name} has no closure: how far the gap shrinks with an effect is not known. "
                "freqid diagnose-gap with --holdout or --effect scores it."
            )
    return notes


def _point_of(one: ReviewedFile) -> PointModel | None:
    if isinstance(one.result, OutputErrorModel):
        return one.result.point
    return one.result if isinstance(one.result, PointModel) else None


def _together(models: Sequence[PointModel], vehicle: Vehicle | None) -> StudyResults:
    """Return point models as the conditions of one aircraft."""
    import numpy as np

    body = MassProperties(mass_kg=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0))
    return StudyResults(
        vehicle=vehicle or Vehicle(name=models[0].vehicle or "aircraft", mass_properties=body),
        sensors="",
        noise=float("nan"),
        estimator=models[0].estimator,
        design=None,
        points=tuple(StudiedPoint(m, {}, {}, np.zeros(0), {}) for m in models),
    )


def _vehicle_of(one: ReviewedFile) -> Vehicle | None:
    result = one.result
    for holder in (result, getattr(result, "corridor", None), getattr(result, "point", None)):
        for name in ("vehicle", "aircraft"):
            held = getattr(holder, name, None)
            if isinstance(held, Vehicle):
                return held
    return None


def _own_scenario(files: Sequence[ReviewedFile]) -> Scenario | None:
    """Return the scenario that a file says it was made with, where it is still the same."""
    for one in files:
        source = getattr(one.result, "provenance", {}).get("scenario", "") if one.result is not None else ""
        named = source.get("file", "") if isinstance(source, dict) else source
        if not isinstance(named, str) or not named:
            continue
        try:
            found = read_scenario(named)
        except FreqidError:
            continue
        if found.sha256 == one.source.scenario_sha256:
            return found
    return None

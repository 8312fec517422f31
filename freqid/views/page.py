"""Every result as one self-contained HTML page."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from freqid.core.errors import DataError, UsageError
from freqid.core.record import FlightRecord, read_record
from freqid.core.results.advance_ratio import AdvanceRatioModel
from freqid.core.results.design import MultisineDesign
from freqid.core.results.frequency_response import FrequencyResponse
from freqid.core.results.gap import GapResult
from freqid.core.results.judged.monte_carlo import MonteCarlo
from freqid.core.results.judged.review import Review
from freqid.core.results.judged.sealed_trial import TrialOutcome
from freqid.core.results.loop_margins import LoopMargins
from freqid.core.results.output_error import OutputErrorModel
from freqid.core.results.point import PointModel
from freqid.core.results.prediction import Prediction, Score
from freqid.core.results.quicklook import Quicklook
from freqid.core.results.rivals import Rivals
from freqid.core.scenario import Scenario
from freqid.core.store import kind_of
from freqid.report.kit.rendering import Sheet
from freqid.workflows.inputs import File, Flight, Tell, names_of, record_of, scenario_of, silent

if TYPE_CHECKING:
    from freqid.blend.global_model import GlobalModel


@dataclass(frozen=True, repr=False)
class Page:
    """One HTML text that fetches nothing; a notebook shows it in place.

    Attributes
    ----------
    html : str
    review : Review, optional
        What page one says, of a page about several results.
    """

    html: str
    review: Review | None = None

    def __repr__(self) -> str:
        return f"<Page of {len(self.html) // 1000} kB; save it with .save(path)>"

    def save(self, path: File) -> Path:
        """Write the page, whole or not at all; return its path.

        Raises
        ------
        DataError
            Where the folder cannot be written.
        """
        from freqid.report.kit.rendering import write_text

        write_text(Path(path), self.html)
        return Path(path)

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.html)}" width="100%" height="800"></iframe>'


def page(
    result: Any,
    *,
    record: Flight | None = None,
    scenario: Scenario | File | None = None,
    outside: Literal["refuse", "hold"] = "refuse",
    against: File | Sequence[File] = (),
    tell: Tell = silent,
) -> Page:
    """Return the page of a result, or of several, for a team to review.

    Parameters
    ----------
    result : PointModel, GlobalModel, AdvanceRatioModel, FrequencyResponse, LoopMargins, Prediction, ...
        What the verbs return, or `read`; or the path of such a file. Of several files, or the folder of a
        study, one page that says on page one what follows from them for their use.
    record : FlightRecord, Maneuver or path, optional
        Of a point model: the flight that it was made from, whose channels are drawn; the file that the
        model names where it is still there. Of a global model: a flight that no point is made from, to be
        predicted. Of a simulated manoeuvre, the path that it was saved to.
    scenario : Scenario, path or name, optional
        Of a point model: its gates enter the verdict. Of a global model: the vehicle of the flight.
    outside : {"refuse", "hold"}
        Of a global model: what is done where the flight leaves the corridor.
    against : path, or several, optional
        Of several results: an older set of files, or its review, to say what has changed.
    tell : callable
        Of several results: told what is being drawn.

    Returns
    -------
    Page
        The same for the same arguments; no time of day enters.

    Raises
    ------
    UsageError
        For something that has no page.
    DataError
        Where a file cannot be read, or the record is not the one that the model was made from.

    Examples
    --------
    >>> page(model, record=flight).html[:15]
    '<!DOCTYPE html>'
    """
    several = _several(result, against)
    if several:
        from .report import report_page

        if record is not None:
            raise UsageError("a record goes with one result, but several are given", remedy="leave it out")
        sheet, decided = report_page(
            several, _sheet_of, scenario=scenario, against=_listed(against), tell=tell
        )
        return Page(sheet, decided)
    if isinstance(result, list | tuple):
        result = result[0]
    if isinstance(result, str | Path):
        from freqid.workflows.files import read

        try:
            return page(read(result), record=record, scenario=scenario, outside=outside)
        except UsageError as error:
            if error.where:
                raise
            raise DataError(error.message, where=str(result), remedy="name a result that has one") from None
    if isinstance(result, PointModel):
        return Page(_of_point(result, record, scenario_of(scenario) if scenario is not None else None))
    if isinstance(result, GapResult):
        from freqid.report.gap.page import build_gap_page

        return Page(build_gap_page(result))
    if isinstance(result, Rivals):
        from freqid.report.gap.rivals_page import build_rivals_page

        return Page(build_rivals_page(result))
    if isinstance(result, FrequencyResponse):
        from freqid.report.response.page import build_frequency_response_page

        return Page(build_frequency_response_page(result, str(result.provenance.get("vehicle", ""))))
    if isinstance(result, Prediction):
        from freqid.report.prediction.page import build_prediction_page

        return Page(build_prediction_page(result))
    if isinstance(result, Score):
        from freqid.report.prediction.page import build_score_page

        return Page(build_score_page(result))
    if isinstance(result, Quicklook):
        from freqid.report.quicklook.page import build_quicklook_page

        return Page(build_quicklook_page(result))
    if isinstance(result, LoopMargins):
        from freqid.report.margins.page import build_margins_page

        return Page(build_margins_page(result))
    if isinstance(result, MonteCarlo):
        from freqid.report.monte_carlo.page import build_monte_carlo_page

        return Page(build_monte_carlo_page(result))
    if isinstance(result, TrialOutcome | OutputErrorModel | FlightRecord | MultisineDesign):
        return Page(_of_single(result, scenario_of(scenario) if scenario is not None else None))
    if isinstance(result, AdvanceRatioModel):
        from freqid.report.advance_ratio.page import build_advance_ratio_page

        return Page(build_advance_ratio_page(result))
    from freqid.blend.global_model import GlobalModel

    if isinstance(result, GlobalModel):
        return Page(_of_global(result, record, scenario, outside))
    return Page(_of_job(result, record))


def _of_single(
    result: TrialOutcome | OutputErrorModel | FlightRecord | MultisineDesign, scenario: Scenario | None
) -> str:
    """Return the page of what has no theme of its own."""
    from freqid.report.review import single

    if isinstance(result, TrialOutcome):
        return single.build_trial_sheet(result)
    if isinstance(result, OutputErrorModel):
        return single.build_output_error_sheet(result)
    if isinstance(result, FlightRecord):
        return single.build_record_sheet(result)
    return single.build_design_sheet(result, scenario.aircraft() if scenario else None, scenario, "", "")


def _listed(files: File | Sequence[File]) -> list[File]:
    return [files] if isinstance(files, str | Path) else list(files)


def _several(result: Any, against: File | Sequence[File]) -> list[File]:
    """Return the files of a page about several; empty for one result."""
    if isinstance(result, list | tuple):
        files = list(result)
        if not all(isinstance(one, str | Path) for one in files):
            raise UsageError("several results are given as objects", remedy="save them and name their files")
        if len(files) == 1 and not against and not _of_several(Path(files[0])):
            return []
        return files
    if isinstance(result, str | Path) and (_listed(against) or _of_several(Path(result))):
        return [result]
    return []


def _of_several(path: Path) -> bool:
    """Say whether a path stands for several results: a folder, or a study."""
    return path.is_dir() or kind_of(path) == "freqid-study"


def _sheet_of(result: object) -> Sheet:
    """Return the page of one result of a file, as a part of a report takes it in."""
    drawn = page(result).html
    assert isinstance(drawn, Sheet)
    return drawn


def _of_global(
    model: GlobalModel,
    record: Flight | None,
    scenario: Scenario | File | None,
    outside: Literal["refuse", "hold"],
) -> str:
    from freqid.blend.consistency import density_agreement
    from freqid.report.global_model.page import build_global_page
    from freqid.workflows.models.blend import predict

    if record is None:
        return build_global_page(model, density_agreement(model))
    predicted = predict(model, record, scenario, outside=outside)
    return build_global_page(model, density_agreement(model), predicted, Path(names_of([record])[0]).name)


def _of_point(model: PointModel, record: Flight | None, scenario: Scenario | None) -> str:
    from freqid.report.point.page import build_page

    if record is None:
        used = model.provenance.get("record")
        flight = read_record(Path(used)) if isinstance(used, str) and Path(used).is_file() else None
    else:
        flight = record_of(record)
    return build_page(model, flight, gates=scenario.gates if scenario else None)


def _of_job(result: Any, record: Any) -> str:
    """Return the page of what a whole job gives; these load more, so they are asked for last."""
    from freqid.blend.corridor_study import StudyResults
    from freqid.blend.semi_local.advance_ratio_study import CampaignStudy

    if isinstance(result, CampaignStudy):
        from freqid.report.advance_ratio.page import build_study_by_advance_ratio_page

        return build_study_by_advance_ratio_page(result)
    if isinstance(result, StudyResults):
        from freqid.report.study.page import build_study_page

        return build_study_page(result)
    if type(result).__name__ == "SimulatedManeuver":  # to ask for its type would load jax
        from .flight import flight_page

        return flight_page(result, Path(record).name if record else "")
    from freqid.workflows.design import DesignedInputs

    if isinstance(result, DesignedInputs):
        from .designs import design_page

        return design_page(result)
    raise UsageError(
        f"a {type(result).__name__} has no page",
        remedy="give a model, a diagnosis, a comparison, frequency responses, a study, a design or a "
        "simulated flight",
    )

"""A scenario becomes inputs that are safe to fly."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from freqid.core.blas import on_one_thread
from freqid.core.errors import FreqidError, UsageError
from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs, write_design
from freqid.core.results.point import PointModel
from freqid.core.scenario import Scenario
from freqid.core.toml import overridden
from freqid.design import export
from freqid.design.classic import ClassicWaveform, Extent, design_classic, extent
from freqid.design.finish import FinishedSet, finish, swapped
from freqid.design.forecast.modelled import Criterion, ModelledAircraft, about, positions_at
from freqid.design.forecast.standard_errors import Forecast
from freqid.design.multisine.merit import Merit, merit
from freqid.design.multisine.orthogonal_set import check_feasible, design_multisines, excited, sampled
from freqid.workflows.inputs import File, excitation_of, name_of, point_of, scenario_of, source_of

STUDIED_PERIODS = (40.0, 60.0, 80.0, 100.0, 120.0)  # s, the range of the LA-8 study
Watch = Callable[[Iterable[Any], str, int], Iterable[Any]]
"""Passes results on as they come, given what they are and how many: a progress bar."""


@dataclass(frozen=True, eq=False, repr=False)
class DesignedInputs:
    """Inputs as they are flown, with what was asked for and what they are worth.

    Attributes
    ----------
    design : MultisineDesign or ClassicDesign
    merit : Merit or Extent
        Peaks, rates and correlations; of classic inputs, peaks and rates.
    scenario : Scenario
        With the excitation that it was made from.
    aircraft : ModelledAircraft, optional
        Where a model was given.
    trim : mapping of str to float
        Positions of the effectors where it is flown, SI, as far as reference and model tell.
    finished : FinishedSet, optional
        Of multisines: the same before net loads were lowered, and how amplitudes were found.
    forecast : Forecast, optional
        Accuracy that is expected of the parameters, where a model was given.
    others : tuple of MultisineDesign
        Of other periods, for comparison.
    condition : str
        Reference that it is flown at; empty where none is named.
    swapped : DesignedInputs, optional
        The set in which effectors exchange their harmonics.
    """

    design: MultisineDesign | ClassicDesign
    merit: Merit | Extent
    scenario: Scenario
    aircraft: ModelledAircraft | None = None
    finished: FinishedSet | None = None
    forecast: Forecast | None = None
    others: tuple[MultisineDesign, ...] = field(default=())
    swapped: DesignedInputs | None = None
    trim: Mapping[str, float] = field(default_factory=dict)
    condition: str = ""

    def __repr__(self) -> str:
        return f"<DesignedInputs for {self.scenario.vehicle.name!r}: {self.design!r}>"

    def to_frame(self) -> Any:
        """Return the samples as a `pandas.DataFrame`."""
        return self.design.to_frame()

    def plot(self) -> Any:
        """Return the samples drawn, as a `matplotlib.figure.Figure`."""
        return self.design.plot()

    def _repr_html_(self) -> str:
        return self.design._repr_html_()

    @property
    def inputs(self) -> SampledInputs:
        """Samples of every effector, in its SI unit, to be added to the trim."""
        return sampled(self.design) if isinstance(self.design, MultisineDesign) else self.design.inputs

    def save(self, path: File) -> Path:
        """Write the design as HDF5 (docs/files.md), whole or not at all; return the path."""
        write_design(Path(path), self.design, self.inputs, self.scenario.sha256)
        return Path(path)

    def write_csv(self, path: File) -> Path:
        """Write the samples as CSV; return the path."""
        export.write_csv(Path(path), self.inputs)
        return Path(path)

    def write_mat(self, path: File) -> Path:
        """Write the samples as a MATLAB file; return the path."""
        export.write_mat(Path(path), self.inputs)
        return Path(path)

    def write_c_header(self, path: File) -> Path:
        """Write a C header that evaluates the signals; return the path.

        Raises
        ------
        UsageError
            For classic inputs, which have no harmonics to evaluate.
        """
        export.write_c_header(Path(path), self._multisines("C header"))
        return Path(path)

    def write_lua(self, path: File) -> Path:
        """Write a Lua table that evaluates the signals; return the path; errors as `write_c_header`."""
        export.write_lua(Path(path), self._multisines("Lua table"))
        return Path(path)

    def _multisines(self, what: str) -> MultisineDesign:
        if not isinstance(self.design, MultisineDesign):
            raise UsageError(
                f"a {what} evaluates multisines, and this is a {self.design.waveform}",
                remedy="write its samples as CSV",
            )
        return self.design


@on_one_thread
def design_inputs(
    scenario: Scenario | File,
    *,
    waveform: Literal["multisine"] | ClassicWaveform = "multisine",
    at: str = "",
    seed: int = 0,
    model: PointModel | File | None = None,
    optimal: Criterion | None = None,
    reach: Sequence[str] | Mapping[str, Mapping[str, float]] = (),
    longest_s: float = 600.0,
    swap: Sequence[str | tuple[str, str]] = (),
    study: bool = False,
    watch: Watch = lambda found, what, count: found,
    progress: Callable[[int, int], None] | None = None,
) -> DesignedInputs:
    """Design orthogonal, phase-optimised multisines, or classic inputs, for a scenario's effectors.

    Parameters
    ----------
    scenario : Scenario, path or name
        With ``[excitation]``.
    waveform : {"multisine", "doublet", "3-2-1-1", "sweep"}
        Multisines on all effectors at once, or a classic input on one after the other.
    at : str
        Reference condition: its own ``[excitation.at.ID]`` is taken, and limits count from its tilts. Where
        empty, that of the model.
    seed : int
        The same seed gives the same design.
    model : PointModel or path, optional
        To forecast accuracy and motion.
    optimal : {"A", "D"}, optional
        Scale amplitudes for the least variance (A) or volume (D) of uncertainty within all limits.
    reach : mapping, or sequence of str
        Standard errors to be reached in as few periods as do, by response and regressor; or words such as
        ``"M.de1=0.4"`` or ``"M.de1=5%"``.
    longest_s : float
        Longest manoeuvre for `reach`, s.
    swap : sequence of pairs of str
        Effectors that exchange their harmonics in a second set.
    study : bool
        Also design other periods, 40 to 120 s, for comparison on the page.
    watch : callable
        Passes on the designs of other periods as they come.
    progress : callable, optional
        Called with how many signals are done, and how many there are.

    Returns
    -------
    DesignedInputs

    Raises
    ------
    UsageError
        Where the scenario has no excitation, it is not feasible, or options do not fit each other.
    DataError
        Where scenario or model cannot be read.

    Notes
    -----
    Orthogonal phase-optimised multisines (Morelli, "Flight test maneuvers for efficient aerodynamic
    modeling", Journal of Aircraft 49, 2012; docs/theory/multisines.md).

    Examples
    --------
    >>> design = design_inputs(scenario, seed=0)
    >>> design.design.names
    ('de', 'da', 'dr', 'n1')
    >>> bool(design.merit.max_correlation < 1e-9)
    True
    """
    described = scenario_of(scenario)
    point = point_of(model) if model is not None else None
    known = [reference.id for reference in described.reference]
    at = at or (point.reference.id if point is not None and point.reference.id in known else "")
    reference = described.reference_of(at) if at else None
    described = described.at(at)
    excitation_of(described)
    refuse_unfit(waveform, {"--optimal": optimal, "--reach": reach, "--swapped": swap})
    for option, given in (("--optimal", optimal), ("--reach", reach)):
        if given and model is None:
            raise UsageError(f"{option} needs a model to predict with", remedy="name one with --model")
    provenance: dict[str, Any] = {"scenario": source_of(described), "seed": seed}
    aircraft = ModelledAircraft.of(point, described, seed) if point is not None else None
    trim = {**positions_at(reference, described.aircraft()), **(aircraft.trim if aircraft else {})}
    if at:
        provenance["reference"] = at
    try:
        if waveform != "multisine":
            return _classic(described, waveform, aircraft, provenance, trim, at)
        return _multisines(
            described,
            aircraft,
            provenance,
            trim=trim,
            at=at,
            seed=seed,
            criterion=optimal,
            reach=reach,
            longest_s=longest_s,
            swap=[effector_pair(pair) for pair in swap],
            others=lambda: watch(*_other_periods(described, seed)) if study else (),
            progress=progress,
        )
    except UsageError as error:
        raise error.at(name_of(described)) from None


def required_errors(
    reach: Sequence[str] | Mapping[str, Mapping[str, float]], point: PointModel
) -> dict[str, dict[str, float]]:
    """Return standard errors by response and regressor from texts such as ``M.de=0.4`` or ``M.de=5%``."""
    if isinstance(reach, Mapping):
        return {response: dict(errors) for response, errors in reach.items()}
    wanted: dict[str, dict[str, float]] = {}
    for text in reach:
        parts = re.fullmatch(r"(\w+)\.(\w+)=(\d*\.?\d+(?:[eE][+-]?\d+)?)(%?)", text)
        if parts is None:
            raise UsageError(
                f"found '{text}', expected RESPONSE.REGRESSOR=ERROR",
                where="--reach",
                remedy="write for example M.de1=0.4 or M.de1=5%",
            )
        response, regressor, error, percent = parts.groups()
        estimate = abs(point[response][regressor][0])
        wanted.setdefault(response, {})[regressor] = float(error) * (estimate / 100 if percent else 1.0)
    return wanted


def effector_pair(pair: str | tuple[str, str]) -> tuple[str, str]:
    """Return two effectors from a text such as ``de1:dr2``."""
    if not isinstance(pair, str):
        return pair
    first, colon, second = pair.partition(":")
    if not (first and colon and second):
        raise UsageError(
            f"found '{pair}', expected EFFECTOR:EFFECTOR",
            where="--swapped",
            remedy="write for example de1:dr2",
        )
    return first, second


def refuse_unfit(waveform: str, given: Mapping[str, object]) -> None:
    """Refuse options that are for multisines alone with a classic input.

    Raises
    ------
    UsageError
    """
    for option, value in given.items():
        if value and waveform != "multisine":
            raise UsageError(f"{option} is for multisines, not for --input {waveform}", remedy="drop one")


def _multisines(
    scenario: Scenario,
    aircraft: ModelledAircraft | None,
    provenance: dict[str, Any],
    *,
    trim: Mapping[str, float],
    at: str,
    seed: int,
    criterion: Criterion | None,
    reach: Sequence[str] | Mapping[str, Mapping[str, float]],
    longest_s: float,
    swap: Sequence[tuple[str, str]],
    others: Callable[[], Iterable[MultisineDesign | None]],
    progress: Callable[[int, int], None] | None,
) -> DesignedInputs:
    """Design multisines, and a second set where pairs are to be swapped."""
    excitation = excitation_of(scenario)
    wanted = required_errors(reach, aircraft.point) if aircraft else {}
    searched = [design_multisines(excitation, scenario.effector, seed=seed, progress=progress)]
    if swap:
        searched.append(swapped(searched[0], list(swap), excitation, scenario.effector))
    finished = [
        finish(one, excitation, scenario.effector, aircraft=aircraft, criterion=criterion, wanted=wanted)
        for one in searched
    ]
    for one in finished:
        check_feasible(one.design, excitation, excited(excitation, scenario.effector), trim)
    periods = excitation.periods
    if aircraft and wanted:
        periods = aircraft.shortest(finished[0].design, wanted, longest_s).periods
    compared = tuple(one for one in others() if one is not None)
    results: list[DesignedInputs] = []
    for one in finished:
        sources = {**provenance, **one.design.provenance}
        one = replace(one, design=replace(one.design, periods=periods, provenance=sources))
        results.append(
            DesignedInputs(
                design=one.design,
                merit=merit(one.design),
                scenario=scenario,
                aircraft=aircraft,
                finished=one,
                forecast=aircraft.forecast(one.design) if aircraft else None,
                others=compared,
                trim=trim,
                condition=at,
            )
        )
    return replace(results[0], swapped=results[1]) if swap else results[0]


def _classic(
    scenario: Scenario,
    waveform: ClassicWaveform,
    aircraft: ModelledAircraft | None,
    provenance: dict[str, Any],
    trim: Mapping[str, float],
    at: str,
) -> DesignedInputs:
    """Design doublets, 3-2-1-1 or sweeps."""
    vehicle = scenario.aircraft()
    design = design_classic(waveform, excitation_of(scenario), vehicle, about(vehicle, trim))
    design = replace(design, provenance=provenance)
    return DesignedInputs(design, extent(design), scenario, aircraft, trim=trim, condition=at)


def _other_periods(scenario: Scenario, seed: int) -> tuple[Iterable[MultisineDesign | None], str, int]:
    """Return the designs of other periods, those that have enough harmonics, one on each core."""
    from joblib import Parallel, delayed

    periods = sorted({*STUDIED_PERIODS} - {excitation_of(scenario).period_s}, reverse=True)  # longest first
    found = Parallel(n_jobs=-1, return_as="generator")(
        delayed(_with_period)(scenario, period, seed) for period in periods
    )
    return found, "study of other periods", len(periods)


def _with_period(scenario: Scenario, period_s: float, seed: int) -> MultisineDesign | None:
    """Return the design of another period; None where it is too short for so many effectors."""
    given = excitation_of(scenario)
    try:
        # a comparison of periods needs no best design of each
        excitation = overridden(given, period_s=period_s, starts=min(3, given.starts))
        return design_multisines(excitation, scenario.effector, seed=seed, quick=True)
    except FreqidError:
        return None

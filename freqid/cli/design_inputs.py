"""``freqid design-inputs``: a scenario becomes inputs that are safe to fly, a page and a test card."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from freqid.cli.design_texts import effector_pair, wanted_errors
from freqid.cli.options import as_json, emit, keep_inputs, output

if TYPE_CHECKING:
    from freqid.core.results.design import ClassicDesign, MultisineDesign, SampledInputs
    from freqid.core.scenario import Scenario
    from freqid.design.classic import Waveform
    from freqid.design.forecast.modelled import Criterion, ModelledAircraft

STUDIED_PERIODS = (40.0, 60.0, 80.0, 100.0, 120.0)  # s, the range of the LA-8 study


@dataclass(frozen=True)
class Job:
    """What a run has to work with, and where and what it has to write.

    Attributes
    ----------
    scenario : Scenario
        With an excitation.
    sha256 : str
        Of the scenario's file.
    aircraft : ModelledAircraft, optional
    destination : Path
        Of the design.
    suffixes : tuple of str
        Of the other formats.
    page : bool
        Whether page and test card are written.
    provenance : dict
    """

    scenario: Scenario
    sha256: str
    aircraft: ModelledAircraft | None
    destination: Path
    suffixes: tuple[str, ...]
    page: bool
    provenance: dict[str, Any]


@click.command("design-inputs")
@click.argument("scenario", type=click.Path(path_type=Path))
@output("design.h5 in reports/")
@click.option(
    "--input",
    "waveform",
    type=click.Choice(["multisine", "doublet", "3-2-1-1", "sweep"]),
    default="multisine",
    show_default=True,
    help="Multisines on all effectors at once, or a classic input on one after the other.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="The same seed gives the same design.")
@click.option(
    "--model", type=click.Path(path_type=Path), help="Point model, to forecast accuracy and motion."
)
@click.option(
    "--optimal",
    type=click.Choice(["A", "D"]),
    help="Scale amplitudes for the least variance (A) or volume (D) of uncertainty within all limits.",
)
@click.option(
    "--reach",
    multiple=True,
    metavar="RESPONSE.REGRESSOR=ERROR",
    help="Fly as few periods as reach this standard error, SI or with % of the parameter; repeatable.",
)
@click.option(
    "--longest", type=float, default=600.0, show_default=True, help="Longest manoeuvre for --reach, s."
)
@click.option(
    "--swapped",
    multiple=True,
    metavar="EFFECTOR:EFFECTOR",
    help="Also write a second set in which these two exchange their harmonics; repeatable.",
)
@click.option("--study/--no-study", default=True, help="Compare periods of 40 to 120 s on the page.")
@click.option("--page/--no-page", default=True, help="Write the page and the test card beside the design.")
@click.option("--csv", "csv_", is_flag=True, help="Also write the samples as CSV.")
@click.option("--mat", is_flag=True, help="Also write the samples as a MATLAB file.")
@click.option("--c-header", is_flag=True, help="Also write a C header that evaluates the signals.")
@click.option("--lua", is_flag=True, help="Also write a Lua table that evaluates the signals.")
@as_json
def command(
    scenario: Path,
    destination: Path | None,
    waveform: Literal["multisine"] | Waveform,
    seed: int,
    model: Path | None,
    optimal: Criterion | None,
    reach: tuple[str, ...],
    longest: float,
    swapped: tuple[str, ...],
    study: bool,
    page: bool,
    csv_: bool,
    mat: bool,
    c_header: bool,
    lua: bool,
    json_: bool,
) -> None:
    """Design orthogonal, phase-optimised multisines, or classic inputs, for the effectors of SCENARIO.

    Writes DESIGN.h5 and beside it a page with all plots, and a test card as text and HTML.
    """
    from freqid.core.errors import UsageError
    from freqid.core.results.point import read_point
    from freqid.core.scenario import read_scenario
    from freqid.design.forecast.modelled import ModelledAircraft

    described, sha256 = read_scenario(scenario)
    if described.excitation is None:
        raise UsageError("section [excitation] is missing", where=str(scenario), remedy="add it")
    destination = destination or Path("reports") / "design.h5"
    keep_inputs(destination, scenario, model)
    for option, given in (
        ("--optimal", optimal),
        ("--reach", reach),
        ("--swapped", swapped),
        ("--c-header", c_header),
        ("--lua", lua),
    ):
        if given and waveform != "multisine":
            raise UsageError(f"{option} is for multisines, not for --input {waveform}", remedy="drop one")
        if given and model is None and option in ("--optimal", "--reach"):
            raise UsageError(f"{option} needs a model to predict with", remedy="name one with --model")
    formats = {".csv": csv_, ".mat": mat, ".h": c_header, ".lua": lua}
    job = Job(
        scenario=described,
        sha256=sha256,
        aircraft=ModelledAircraft.of(read_point(model), described, seed) if model else None,
        destination=destination,
        suffixes=tuple(suffix for suffix, asked in formats.items() if asked),
        page=page,
        provenance={"scenario": {"file": str(scenario), "sha256": sha256}, "seed": seed},
    )
    try:
        if waveform == "multisine":
            result, text = _multisines(job, seed, optimal, reach, longest, swapped, page and study)
        else:
            result, text = _classic(job, waveform)
    except UsageError as error:
        raise error.at(str(scenario)) from None
    emit(json_, result, text)


def _multisines(
    job: Job,
    seed: int,
    criterion: Criterion | None,
    reach: tuple[str, ...],
    longest_s: float,
    pairs: tuple[str, ...],
    study: bool,
) -> tuple[dict[str, Any], str]:
    """Design multisines, and a second set where pairs are to be swapped."""
    from freqid.design.finish import finish, swapped
    from freqid.design.multisine.merit import merit
    from freqid.design.multisine.orthogonal_set import sampled
    from freqid.report.design.page import flight_plan, write_documents
    from freqid.report.design.summary import multisine_summary, multisine_table

    excitation, aircraft = job.scenario.excitation, job.aircraft
    assert excitation is not None
    wanted = wanted_errors(reach, aircraft.point) if aircraft else {}
    sets = {job.destination: _searched(job.scenario, seed)}
    if pairs:
        exchanged = swapped(
            sets[job.destination], list(map(effector_pair, pairs)), excitation, job.scenario.effector
        )
        sets[job.destination.with_stem(f"{job.destination.stem}-swapped")] = exchanged
    finished = [
        finish(one, excitation, job.scenario.effector, aircraft=aircraft, criterion=criterion, wanted=wanted)
        for one in sets.values()
    ]
    periods = excitation.periods
    if aircraft and wanted:
        periods = aircraft.shortest(finished[0].design, wanted, longest_s).periods
    others = _study(job.scenario, seed) if study else []
    results, texts = [], []
    for path, one in zip(sets, finished, strict=True):
        provenance = {**job.provenance, **one.design.provenance}
        one = replace(one, design=replace(one.design, periods=periods, provenance=provenance))
        judged = merit(one.design)
        written = _write(job, path, one.design, sampled(one.design))
        plan = flight_plan(path, one.design, job.scenario, aircraft)
        expected = aircraft.forecast(one.design) if aircraft else None
        if job.page:
            written += write_documents(path, one, judged, job.scenario, plan, study=others, forecast=expected)
        results.append(multisine_summary(one, judged, plan, expected) | {"files": list(map(str, written))})
        texts += [multisine_table(one, judged), *map(str, written)]
    return results[0] | ({"swapped": results[1]} if pairs else {}), "\n".join(texts)


def _classic(job: Job, waveform: Waveform) -> tuple[dict[str, Any], str]:
    """Design doublets, 3-2-1-1 or sweeps."""
    from freqid.design.classic import design_classic, extent
    from freqid.design.forecast.modelled import about
    from freqid.report.design.classic_page import write_classic_documents
    from freqid.report.design.page import flight_plan
    from freqid.report.design.summary import classic_summary, classic_table

    excitation, vehicle = job.scenario.excitation, job.scenario.aircraft()
    assert excitation is not None
    trim = about(vehicle, job.aircraft.trim if job.aircraft else {})
    design = replace(design_classic(waveform, excitation, vehicle, trim), provenance=job.provenance)
    judged = extent(design)
    written = _write(job, job.destination, design, design.inputs)
    plan = flight_plan(job.destination, design, job.scenario, job.aircraft)
    if job.page:
        written += write_classic_documents(job.destination, design, judged, plan)
    result = classic_summary(design, judged, plan) | {"files": list(map(str, written))}
    return result, "\n".join([classic_table(design, judged), *map(str, written)])


def _searched(scenario: Scenario, seed: int) -> MultisineDesign:
    """Return multisines of low peaks, with a progress bar."""
    from tqdm import tqdm

    from freqid.design.multisine.orthogonal_set import design_multisines

    assert scenario.excitation is not None
    with tqdm(desc="signals", unit="signal", disable=None, leave=False) as bar:

        def progress(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        return design_multisines(scenario.excitation, scenario.effector, seed=seed, progress=progress)


def _study(scenario: Scenario, seed: int) -> list[MultisineDesign]:
    """Return the designs of other periods, those that have enough harmonics, one on each core."""
    from joblib import Parallel, delayed
    from tqdm import tqdm

    assert scenario.excitation is not None
    periods = sorted({*STUDIED_PERIODS} - {scenario.excitation.period_s}, reverse=True)  # longest first
    found = Parallel(n_jobs=-1, return_as="generator")(
        delayed(_with_period)(scenario, period, seed) for period in periods
    )
    bar = tqdm(found, desc="study of other periods", total=len(periods), disable=None, leave=False)
    return [design for design in bar if design is not None]


def _with_period(scenario: Scenario, period_s: float, seed: int) -> MultisineDesign | None:
    """Return the design of another period; None where it is too short for so many effectors."""
    from freqid.core.errors import FreqidError
    from freqid.core.toml import overridden
    from freqid.design.multisine.orthogonal_set import design_multisines

    assert scenario.excitation is not None
    try:
        # a comparison of periods needs no best design of each
        excitation = overridden(
            scenario.excitation, period_s=period_s, starts=min(3, scenario.excitation.starts)
        )
        return design_multisines(excitation, scenario.effector, seed=seed)
    except FreqidError:
        return None


def _write(
    job: Job, path: Path, design: MultisineDesign | ClassicDesign, inputs: SampledInputs
) -> list[Path]:
    """Write a design and its other formats; return their paths."""
    from freqid.core.results.design import MultisineDesign, write_design
    from freqid.design import export

    write_design(path, design, inputs, job.sha256)
    written = [path]
    for suffix in job.suffixes:
        written.append(path.with_suffix(suffix))
        if suffix == ".csv":
            export.write_csv(written[-1], inputs)
        elif suffix == ".mat":
            export.write_mat(written[-1], inputs)
        elif isinstance(design, MultisineDesign):
            (export.write_c_header if suffix == ".h" else export.write_lua)(written[-1], design)
    return written
